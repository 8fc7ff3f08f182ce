//! Names, paths and files from users, as handled by the whole program.

use minimal_surprise_evolution::text;
use pulldown_cmark::{Event, Options, Parser, Tag};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tests::program::{Evolver, Finished};

/// Settings of a short run.
const SMALL: &str = "grid = \"8x8\"\nrobots = 20\npopulation = 4\ngenerations = 3\nrepetitions = 1\n\
                     steps = 20\nseed = 7\n";

/// Returns an experiment with one short run.
fn experiment(name: &str) -> String {
    let name = serde_json::to_string(name).unwrap();
    format!(
        "[[experiment]]\nname = {name}\nruns = 1\ngrids = [\"8x8\"]\nrobots = [20]\npopulation = 4\n\
         generations = 2\nrepetitions = 1\nsteps = 20\n"
    )
}

fn suite(name: &str, experiments: &[&str]) -> String {
    let name = serde_json::to_string(name).unwrap();
    let experiments: String = experiments.iter().map(|name| experiment(name)).collect();
    format!("name = {name}\n{experiments}")
}

fn done(run: Finished) -> Finished {
    assert_eq!(run.code, Some(0), "{run:?}");
    run
}

fn assert_refused(run: &Finished, words: &[&str]) {
    assert_eq!(run.code, Some(2), "{run:?}");
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in {run:?}");
    }
}

/// Runs a shell command printed by the program.
fn in_a_shell(evolver: &Evolver, line: &str) -> Output {
    let mut path = OsString::from(evolver.program().parent().unwrap());
    path.push(":");
    path.push(std::env::var_os("PATH").unwrap_or_default());
    let mut sh = Command::new("sh");
    sh.args(["-c", line]).env("PATH", path).env_remove("CARGO");
    sh.current_dir(evolver.folder()).output().unwrap()
}

fn bytes(name: &[u8]) -> &OsStr {
    OsStr::from_bytes(name)
}

#[test]
fn a_suite_and_its_experiments_can_have_any_name() {
    let long = "x".repeat(300);
    let names = [
        "noise 5/10",
        "#1 | low",
        "-only",
        "<b>\"&'",
        "`$(x)` *",
        "[a](b)",
        "Noise",
        "noise",
        "con",
        "report",
        "../up",
        "a\\b",
        &long,
    ];
    let evolver = Evolver::in_empty_folder();
    evolver.write("my suite's.toml", suite("../../x y#", &names).as_bytes());
    done(evolver.run(&["suite", "my suite's.toml", "run", "--progress", "none"]));
    done(evolver.run(&["suite", "my suite's.toml", "report", "--gallery"]));
    let folder = evolver.folder();
    assert!(!folder.join("runs/../../x y#").exists());
    let mut directories = fs::read_dir(folder.join("runs")).unwrap();
    let directory = directories.next().unwrap().unwrap().path();
    assert!(directories.next().is_none());
    let report = directory.join("report");

    let markdown = fs::read_to_string(report.join("report.md")).unwrap();
    let events = || Parser::new_ext(&markdown, Options::ENABLE_TABLES);
    let links: Vec<PathBuf> = events()
        .filter_map(|event| match event {
            Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                Some(report.join(text::path_of_text(&format!("file://{dest_url}"))))
            }
            Event::Html(_) | Event::InlineHtml(_) => panic!("{event:?}"),
            _ => None,
        })
        .collect();
    assert!(links.len() > 3 * names.len());
    let shown: String = events()
        .filter_map(|event| match event {
            Event::Text(text) | Event::Code(text) => Some(text.into_string()),
            Event::End(_) => Some("\n".to_owned()),
            _ => None,
        })
        .collect();
    for name in names {
        assert!(
            shown.contains(&format!("{name}\n")) || shown.contains(&format!("{name}:")),
            "{name}"
        );
    }
    let page = fs::read_to_string(report.join("report.html")).unwrap();
    assert!(!page.contains("<b>\"") && page.contains("&lt;b&gt;&quot;&amp;&#39;"));
    let hrefs = page
        .split("href=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap());
    for link in links.into_iter().chain(hrefs.map(|href| report.join(href))) {
        assert!(link.is_file(), "{}", link.display());
    }
    for entry in fs::read_dir(&report).unwrap() {
        let path = entry.unwrap().path();
        if path.extension() == Some(OsStr::new("svg")) {
            roxmltree::Document::parse(&fs::read_to_string(&path).unwrap()).unwrap();
        }
    }

    let made = fs::read_to_string(report.join("how-made.csv")).unwrap();
    assert_eq!(made.lines().count(), 1 + names.len());
    let commands = events().filter_map(|event| match event {
        Event::Code(code) if code.contains("--only") => Some(code.into_string()),
        _ => None,
    });
    let commands: Vec<String> = commands.collect();
    assert_eq!(commands.len(), names.len());
    for command in commands {
        let output = in_a_shell(&evolver, &format!("{command} --progress none"));
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success() && said.contains("1 of 1 runs done"),
            "{command}: {output:?}"
        );
    }
}

#[test]
fn a_name_that_is_not_readable_or_typable_is_refused_before_anything_is_written() {
    let evolver = Evolver::in_empty_folder();
    for name in [
        "",
        ".",
        "..",
        " ",
        "a\nb",
        "a\u{1b}[2J",
        "a\u{202e}b",
        "a\u{200b}b",
        "\u{feff}",
        "\u{2800}",
    ] {
        for text in [suite(name, &["one"]), suite("own", &[name])] {
            evolver.write("own.toml", text.as_bytes());
            let run = evolver.run(&["suite", "own.toml", "run"]);
            assert_refused(&run, &["own.toml", "name = ", "expected"]);
            assert!(
                !run.stderr.contains(['\u{1b}', '\u{202e}', '\u{200b}']),
                "{run:?}"
            );
        }
    }
    assert_eq!(evolver.files(), ["own.toml"]);
}

#[test]
fn a_users_suite_named_paper_is_not_the_papers_suite() {
    let evolver = Evolver::in_empty_folder();
    evolver.write(
        "own.toml",
        suite("paper", &["sensor-models", "densities"]).as_bytes(),
    );
    done(evolver.run(&["suite", "own.toml", "run", "--progress", "none"]));
    done(evolver.run(&["suite", "own.toml", "report"]));
    assert!(!evolver.folder().join("runs/paper").exists());
    let report = evolver
        .files()
        .into_iter()
        .find(|file| file.ends_with("report.md"));
    let report = evolver.text(&report.unwrap());
    assert!(
        !report.contains("Table 2") && !report.contains("paper's"),
        "{report}"
    );
}

#[test]
fn the_directory_named_by_an_earlier_version_after_a_suite_is_continued() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("own.toml", suite("My Suite", &["one"]).as_bytes());
    fs::create_dir_all(evolver.folder().join("runs/My Suite")).unwrap();
    let run = done(evolver.run(&["suite", "own.toml", "run", "--progress", "none"]));
    assert!(run.stdout.contains("in runs/My Suite\n"), "{run:?}");
}

#[test]
fn two_exported_genomes_fit_into_one_firmware() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("small.toml", SMALL.as_bytes());
    let mut includes = (String::new(), String::new());
    let mut expected = Vec::new();
    for (seed, run) in [("7", "run 1"), ("8", "run-1")] {
        done(evolver.run(&["evolve", "small.toml", "--seed", seed, "--out", run]));
        expected.extend(evolver.read(&format!("{run}/best.genome")));
        for (format, file) in [("c", format!("{seed}.h")), ("rust", format!("{seed}.rs"))] {
            done(evolver.run(&["export", run, "--format", format, "--out", &file]));
        }
        includes.0 += &format!("#include \"{seed}.h\"\n#include \"{seed}.h\"\n");
        includes.1 += &format!("include!(\"{seed}.rs\");\n");
    }
    let symbol = |file: &str, before: &str, after: &str| {
        let text = evolver.text(file);
        let rest = text.split(before).nth(1).unwrap();
        rest.split(after).next().unwrap().to_owned()
    };
    let symbols = ["7.h", "8.h"].map(|file| symbol(file, "uint8_t ", "["));
    assert!(
        symbols
            .iter()
            .all(|s| s.starts_with("minimal_surprise_genome_run_1_")),
        "{symbols:?}"
    );
    let prints = symbols
        .map(|s| format!("fwrite({s}, sizeof {s}, 1, stdout);"))
        .concat();
    let program = format!(
        "#include <stdio.h>\n{}int main(void) {{ {prints} return 0; }}\n",
        includes.0
    );
    evolver.write("both.c", program.as_bytes());
    let symbols = ["7.rs", "8.rs"].map(|file| symbol(file, "static ", ":"));
    let prints = symbols
        .map(|s| format!("std::io::stdout().write_all(&{s}).unwrap();"))
        .concat();
    let program = format!(
        "use std::io::Write;\n{}fn main() {{ {prints} }}\n",
        includes.1
    );
    evolver.write("both.rs", program.as_bytes());
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let compilers = [
        "cc -std=c99 -Wall -Werror -o both both.c && ./both".to_owned(),
        format!("{rustc} -D warnings -o both both.rs && ./both"),
    ];
    for line in compilers {
        let output = in_a_shell(&evolver, &line);
        assert!(
            output.status.success() && output.stdout == expected,
            "{line}: {output:?}"
        );
    }

    let named = |name: &str| evolver.run(&["export", "run-1", "--format", "c", "--name", name]);
    assert!(
        done(named("left_wheel"))
            .stdout
            .contains("uint8_t left_wheel[")
    );
    for name in [
        "",
        "1st",
        "a b",
        "int",
        "fn",
        "_x",
        "é",
        "a-b",
        "-x",
        &"x".repeat(64),
    ] {
        assert_refused(&named(name), &["--name = ", "identifier"]);
    }
    let raw = evolver.run(&["export", "run-1", "--format", "hex", "--name", "x"]);
    assert_refused(&raw, &["--name", "--format c"]);
}

/// Converts a text to the form in which a Windows program saves it.
fn of_windows(text: &str) -> Vec<u8> {
    format!("\u{feff}{}", text.replace('\n', "\r\n")).into_bytes()
}

#[test]
fn every_text_file_is_read_in_the_forms_that_programs_save() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("small.toml", SMALL.as_bytes());
    done(evolver.run(&["evolve", "small.toml", "--out", "run"]));
    done(evolver.run(&[
        "export",
        "run",
        "--format",
        "trajectory",
        "--out",
        "trajectory",
    ]));
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/exchange/a");
    let fixture = |name: &str| fs::read_to_string(fixtures.join(name)).unwrap();
    let cases: [(&[&str], &str, String); 7] = [
        (
            &["evolve", "file", "--out", "again", "--progress", "none"],
            "again",
            SMALL.to_owned(),
        ),
        (&["suite", "file", "plan"], "", suite("own", &["one"])),
        (&["classify", "file"], "", evolver.text("trajectory")),
        (
            &["replay", "file", "--svg", "shown.svg"],
            "shown.svg",
            evolver.text("trajectory"),
        ),
        (&["classify", "file"], "", "·▶··\n····\n▲··◀\n".to_owned()),
        (&["classify", "file"], "", evolver.text("run/final.json")),
        (
            &[
                "import",
                "--action",
                "file",
                "--prediction",
                "prediction",
                "--generation",
                "0",
                "--out",
                "in",
            ],
            "in",
            fixture("action_genomes"),
        ),
    ];
    evolver.write("prediction", &of_windows(&fixture("prediction_genomes")));
    for (arguments, written, text) in cases {
        let made = || {
            let run = done(evolver.run(arguments));
            let path = evolver.folder().join(written);
            if !written.is_empty() {
                let removed = fs::remove_file(&path).or_else(|_| fs::remove_dir_all(&path));
                removed.unwrap();
            }
            run.stdout
        };
        evolver.write("file", text.as_bytes());
        let expected = made();
        evolver.write("file", &of_windows(&text));
        let found = made();
        assert!(
            found == expected || written == "again",
            "{arguments:?}: {found}"
        );
        for order in [u16::to_le_bytes, u16::to_be_bytes] {
            let marked = format!("\u{feff}{text}");
            evolver.write(
                "file",
                &marked.encode_utf16().flat_map(order).collect::<Vec<_>>(),
            );
            assert_refused(
                &evolver.run(arguments),
                &["file", "UTF-16; save it as UTF-8"],
            );
        }
        evolver.write(
            "file",
            format!("{text}\n")
                .as_bytes()
                .iter()
                .chain(b"\xe9")
                .copied()
                .collect::<Vec<_>>()
                .as_slice(),
        );
        let line = 2 + text.lines().count();
        let run = evolver.run(arguments);
        assert!(run.code == Some(2), "{arguments:?}: {run:?}");
        assert!(
            run.stderr.contains(&format!("line {line}: byte")),
            "{arguments:?}: {run:?}"
        );
    }
}

#[test]
fn a_run_whose_config_got_other_line_ends_is_resumed() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("small.toml", SMALL.replace("= 3", "= 200").as_bytes());
    let whole = [
        "evolve",
        "small.toml",
        "--out",
        "run",
        "--progress",
        "lines",
    ];
    let running = evolver.start(&whole);
    running.wait_for_lines(3);
    assert!(!running.kill());
    let config = evolver.text("run/config.toml");
    evolver.write("run/config.toml", &of_windows(&config));
    let resume = ["evolve", "--resume", "run", "--progress", "none"];
    done(evolver.run(&resume));
    evolver.write("run/config.toml", config.as_bytes());
    done(evolver.run(&["classify", "run"]));
}

#[test]
fn no_message_sends_control_characters_of_paths_or_names_to_a_terminal() {
    let evolver = Evolver::in_empty_folder();
    let odd = "\u{1b}[31mred\u{202e}\u{200b}\u{9b}0m";
    fs::create_dir(evolver.folder().join(odd)).unwrap();
    evolver.write(
        "odd.toml",
        format!("{} = 1\n", serde_json::to_string(odd).unwrap()).as_bytes(),
    );
    evolver.write("small.toml", SMALL.as_bytes());
    let flag = format!("--{odd}");
    let gallery = format!("{odd}/g");
    let out = format!("{odd}/run");
    let cases: [(&[&str], i32); 9] = [
        (&["inspect", odd], 2),
        (&["classify", odd], 2),
        (&["evolve", "odd.toml"], 2),
        (&["evolve", "--grid", odd], 2),
        (&["evolve", &flag], 2),
        (&["suite", "odd.toml", "plan"], 2),
        (&["evolve", "small.toml", "--out", &out], 0),
        (&["evaluate", &out, "--starts", "1"], 0),
        (&["gallery", odd, "--out", &gallery], 0),
    ];
    for (arguments, code) in cases {
        let run = evolver.run(arguments);
        assert_eq!(run.code, Some(code), "{arguments:?}: {run:?}");
        for said in [&run.stdout, &run.stderr] {
            assert!(
                !said.chars().any(|c| c != '\n' && text::is_hidden(c)),
                "{arguments:?}: {said:?}"
            );
        }
    }
}

#[test]
fn paths_that_are_not_utf_8_are_kept() {
    let evolver = Evolver::in_empty_folder();
    let folder = evolver.folder();
    evolver.write("small.toml", SMALL.as_bytes());
    let run = |arguments: &[&OsStr]| done(evolver.run(arguments));
    let words = |line: &str| -> Vec<OsString> { line.split(' ').map(OsString::from).collect() };
    let with = |line: &str, last: &OsStr| {
        let words = [words(line), vec![last.to_owned()]].concat();
        let words: Vec<&OsStr> = words.iter().map(OsString::as_os_str).collect();
        run(&words)
    };

    let evolved = with("evolve small.toml --out", bytes(b"r\xff"));
    assert!(folder.join(bytes(b"r\xff/DONE")).is_file());
    for line in evolved
        .stdout
        .lines()
        .filter(|line| line.contains("evolver "))
    {
        let command = &line[line.find("evolver ").unwrap()..];
        let test = command.replace("evolver replay ", "evolver classify ");
        let test = test.replace(
            "evolver evolve ",
            "evolver evolve --generations 2 --steps 10 ",
        );
        let output = in_a_shell(&evolver, &test);
        assert!(output.status.success(), "{command}: {output:?}");
    }
    let resumed = with("evolve --progress json --resume", bytes(b"r\xff"));
    let event: serde_json::Value = serde_json::from_str(resumed.stdout.trim()).unwrap();
    let named = text::path_of_text(event["run"].as_str().unwrap());
    assert_eq!(
        named,
        fs::canonicalize(folder).unwrap().join(bytes(b"r\xff"))
    );

    // The settings contain the path of the ancestor, so that the run can be repeated.
    let from = bytes(b"r\xff/best.genome");
    with("evolve small.toml --out s --from", from);
    done(evolver.run(&["evolve", "s/config.toml", "--out", "t"]));
    assert_eq!(evolver.read("s/DONE"), evolver.read("t/DONE"));
    with("gallery --out g s", bytes(b"r\xff"));
    let pages = evolver
        .files()
        .into_iter()
        .filter(|file| file.ends_with(".html"));
    assert_eq!(pages.count(), 3);

    fs::write(folder.join(bytes(b"\xfe.toml")), suite("own", &["one"])).unwrap();
    let suite = |verb: &[&str], out: &[u8]| {
        let out = OsString::from_vec(out.to_vec());
        let file = bytes(b"\xfe.toml");
        let mut arguments = vec![OsStr::new("suite"), file];
        arguments.extend(verb.iter().map(OsStr::new));
        arguments.extend([OsStr::new("--out"), &out]);
        run(&arguments)
    };
    suite(&["run", "--progress", "none"], b"d\xff");
    suite(&["report"], b"d\xff");
    let report = fs::read_to_string(folder.join(bytes(b"d\xff/report/report.md"))).unwrap();
    assert!(report.contains(r"evolver suite "), "{report}");
    let script = suite(&["submit", "--engine", "slurm", "--dry-run"], b"d\xff").stdout;
    let words = script
        .lines()
        .last()
        .unwrap()
        .replace("exec ", "printf '%s\\0' ");
    let words = in_a_shell(&evolver, &words).stdout;
    let directory = fs::canonicalize(folder).unwrap().join(bytes(b"d\xff"));
    let named = words
        .split(|&byte| byte == 0)
        .any(|word| word == directory.as_os_str().as_bytes());
    assert!(named, "{script}");
}
