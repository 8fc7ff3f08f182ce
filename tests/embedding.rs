//! Builds, without changes, the README's code that embeds the controller.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use tests::firmware::{build_in, target_dir};
use tests::tools::require;

/// Returns the files in the README: fenced blocks whose first line is a comment with a file name.
fn files(readme: &str) -> Vec<(&str, &str)> {
    let blocks = readme.split("\n```").skip(1).step_by(2);
    let named = blocks.filter_map(|block| {
        let (_language, contents) = block.split_once('\n')?;
        let (first, _) = contents.split_once('\n')?;
        let name = first.trim_start_matches(['#', '/', '*', ' ']);
        Some((name.trim().split(':').next()?, contents))
    });
    named.collect()
}

#[test]
fn the_readmes_embedding_code_builds_outside_the_repository() {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let readme = fs::read_to_string(repository.join("README.md")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    symlink(
        repository.canonicalize().unwrap(),
        folder.path().join("minimal-surprise"),
    )
    .unwrap();
    let robot = folder.path().join("my-robot");
    fs::create_dir_all(robot.join("src")).unwrap();
    let names = ["Cargo.toml", "src/main.rs", "build.rs", "memory.x"];
    for name in names {
        let all = files(&readme);
        let found = all.iter().find(|(found, _)| *found == name);
        let (_, contents) = found.unwrap_or_else(|| panic!("no {name} in the README"));
        fs::write(robot.join(name), contents).unwrap();
    }
    let genome = repository.join("controller/tests/b-predefined-line.genome");
    fs::copy(genome, robot.join("best.genome")).unwrap();
    // Use the same versions as the robot's firmware.
    let versions = repository.join("firmware-example/Cargo.lock");
    fs::copy(versions, robot.join("Cargo.lock")).unwrap();

    let Some(built) = require(build_in(&robot, &target_dir(), &[])) else {
        return;
    };
    assert!(built.success, "{}", built.messages);
}
