//! Files written by commands: on a full disk, with long names, and to special files.

use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};
use tests::disk::Disk;
use tests::program::Evolver;
use tests::tools;

/// Maximum duration of any operation in these tests.
const PATIENCE: Duration = Duration::from_secs(120);

const EVOLVE: [&str; 11] = [
    "evolve",
    "--grid",
    "8x8",
    "--robots",
    "20",
    "--population",
    "4",
    "--generations",
    "2",
    "--seed",
    "7",
];

/// Creates a folder with a run in `r`.
fn with_a_run() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    evolve(&evolver, "r");
    evolver
}

fn evolve(evolver: &Evolver, out: &str) {
    let evolved = evolver.run(&[&EVOLVE[..], &["--repetitions", "1", "--out", out]].concat());
    assert_eq!(evolved.code, Some(0), "{evolved:?}");
}

#[test]
fn on_a_full_disk_nothing_is_left_behind_and_the_second_attempt_succeeds() {
    let evolver = with_a_run();
    let Some(disk) = tools::require(Disk::mounted_at(evolver.folder().join("disk"), "8k")) else {
        return;
    };
    let trajectory = "export r --format trajectory --out disk/file";
    let writers = [
        // The size of a trajectory is known in advance.
        (trajectory, 2, "of disk would be needed"),
        (
            "gallery r --threads 1 --out disk/gallery",
            1,
            "No space left",
        ),
        ("replay r --html disk/page.html", 1, "No space left"),
    ];
    let run = |writer: &str| evolver.run(&writer.split(' ').collect::<Vec<_>>());
    for (writer, code, said) in writers {
        let full = run(writer);
        assert_eq!(full.code, Some(code), "{writer}: {full:?}");
        assert!(full.stderr.contains(said), "{writer}: {full:?}");
        let left = fs::read_dir(evolver.folder().join("disk")).unwrap().count();
        assert_eq!(left, 0, "{writer}");
    }
    disk.remount("size=64m");
    for (writer, ..) in writers {
        let again = run(writer);
        assert_eq!(again.code, Some(0), "{writer}: {again:?}");
    }
}

#[test]
fn a_run_that_does_not_fit_on_the_disk_leaves_nothing() {
    let evolver = with_a_run();
    // Enough space to start the run, but too few inodes for its files.
    let Some(disk) = tools::require(Disk::mounted_at(
        evolver.folder().join("disk"),
        "64m,nr_inodes=5",
    )) else {
        return;
    };
    let evolve = [
        "evolve",
        "r/config.toml",
        "--seed",
        "8",
        "--out",
        "disk/run",
    ];
    let full = evolver.run(&evolve);
    assert_eq!(full.code, Some(1), "{full:?}");
    for words in ["No space left", "disk/run/"] {
        assert!(full.stderr.contains(words), "no {words:?}: {full:?}");
    }
    let left = fs::read_dir(evolver.folder().join("disk")).unwrap().count();
    assert_eq!(left, 0);
    disk.remount("nr_inodes=100");
    assert_eq!(evolver.run(&evolve).code, Some(0));
}

#[test]
fn a_run_during_which_the_disk_becomes_full_can_be_resumed() {
    let evolver = Evolver::in_empty_folder();
    let Some(_disk) = tools::require(Disk::mounted_at(evolver.folder().join("disk"), "8m")) else {
        return;
    };
    let long = [
        "--generations",
        "400",
        "--repetitions",
        "1",
        "--steps",
        "2000",
    ];
    let evolve = |out| {
        let settings = [&EVOLVE[..7], &["--seed", "7", "--out", out]].concat();
        [&settings[..], &long].concat()
    };
    let running = evolver.start(&evolve("disk/run"));
    let started = Instant::now();
    while !evolver.folder().join("disk/run/checkpoint").exists() {
        assert!(started.elapsed() < PATIENCE, "no checkpoint yet");
        thread::sleep(Duration::from_millis(1));
    }
    let filler = evolver.folder().join("disk/filler");
    let filled = fs::write(&filler, vec![0; 16 << 20]);
    assert!(filled.is_err(), "the disk is full");
    let full = running.ended(PATIENCE);
    assert_eq!(full.code, Some(1), "{full:?}");
    for words in ["No space left", "disk/run/"] {
        assert!(full.stderr.contains(words), "no {words:?}: {full:?}");
    }
    assert!(!evolver.folder().join("disk/run/DONE").exists());
    fs::remove_file(filler).unwrap();
    let resumed = evolver.run(&["evolve", "--resume", "disk/run"]);
    assert_eq!(resumed.code, Some(0), "{resumed:?}");
    let elsewhere = evolver.run(&evolve("elsewhere"));
    assert_eq!(elsewhere.code, Some(0), "{elsewhere:?}");
    assert_eq!(
        evolver.text("disk/run/DONE"),
        evolver.text("elsewhere/DONE")
    );
    let left = fs::read_dir(evolver.folder().join("disk/run")).unwrap();
    let part = |name: &str| Path::new(name).extension().is_some_and(|end| end == "part");
    let parts = left.filter(|entry| part(&entry.as_ref().unwrap().file_name().to_string_lossy()));
    assert_eq!(parts.count(), 0);
}

#[test]
fn the_longest_names_that_file_systems_allow_are_written() {
    let evolver = with_a_run();
    for length in [236, 255] {
        let run = "r".repeat(length);
        evolve(&evolver, &run);
        assert_eq!(evolver.text(&format!("{run}/DONE")), evolver.text("r/DONE"));
        let file = "f".repeat(length);
        let exported = evolver.run(&["export", "r", "--format", "c", "--out", &file]);
        assert_eq!(exported.code, Some(0), "{exported:?}");
        let gallery = "g".repeat(length);
        let written = evolver.run(&["gallery", "r", "--out", &gallery]);
        assert_eq!(written.code, Some(0), "{written:?}");
    }
    let too_long = evolver.run(&["export", "r", "--format", "c", "--out", &"f".repeat(256)]);
    assert_eq!(too_long.code, Some(2), "{too_long:?}");
    assert!(
        too_long.stderr.contains("File name too long"),
        "{too_long:?}"
    );
}

fn svg(evolver: &Evolver, file: &str) -> tests::program::Finished {
    evolver.run(&["replay", "r", "--svg", file, "--overwrite"])
}

#[test]
fn overwriting_a_link_a_pipe_or_a_device_does_not_replace_it() {
    let evolver = with_a_run();
    assert_eq!(svg(&evolver, "expected.svg").code, Some(0));
    let expected = evolver.read("expected.svg");
    let at = |name: &str| evolver.folder().join(name);

    evolver.write("target.svg", b"old");
    symlink("target.svg", at("link.svg")).unwrap();
    assert_eq!(svg(&evolver, "link.svg").code, Some(0));
    assert!(at("link.svg").is_symlink());
    assert_eq!(evolver.read("target.svg"), expected);

    let made = Command::new("mkfifo").arg(at("pipe")).status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo");
    let (written, read) = thread::scope(|scope| {
        let reader = scope.spawn(|| fs::read(at("pipe")));
        (
            svg(&evolver, "pipe"),
            reader.join().expect("the reader does not panic"),
        )
    });
    assert_eq!(written.code, Some(0), "{written:?}");
    assert_eq!(read.unwrap(), expected);
    let kind = at("pipe").metadata().unwrap().file_type();
    assert!(kind.is_fifo());

    if Path::new("/dev/full").exists() {
        symlink("/dev/full", at("full")).unwrap();
        let full = svg(&evolver, "full");
        assert_eq!(full.code, Some(1), "{full:?}");
        assert!(full.stderr.contains("No space left"), "{full:?}");
    }
}

#[test]
fn overwriting_a_mounted_file_writes_to_that_file() {
    let evolver = with_a_run();
    assert_eq!(svg(&evolver, "expected.svg").code, Some(0));
    for name in ["outside.svg", "mounted.svg"] {
        evolver.write(name, b"old");
    }
    let at = |name: &str| evolver.folder().join(name);
    let Some(_mounted) = tools::require(Disk::bound(&at("outside.svg"), at("mounted.svg"))) else {
        return;
    };
    let written = svg(&evolver, "mounted.svg");
    assert_eq!(written.code, Some(0), "{written:?}");
    assert_eq!(evolver.read("outside.svg"), evolver.read("expected.svg"));
}

#[test]
fn a_name_that_is_not_utf_8_is_written() {
    let evolver = with_a_run();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9.h");
    let words = ["export", "r", "--format", "c", "--out"].map(std::ffi::OsStr::new);
    let exported = evolver.run(&[&words[..], &[name]].concat());
    assert_eq!(exported.code, Some(0), "{exported:?}");
    assert!(evolver.folder().join(name).is_file());
}
