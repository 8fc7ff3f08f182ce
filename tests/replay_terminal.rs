//! Replays in the terminal: the program runs in a pseudo-terminal, with real keys and a real
//! screen.
#![cfg(unix)]

use minimal_surprise_controller::{Controller, EncodedGenome, State};
use minimal_surprise_sim::drawing::draw;
use minimal_surprise_sim::exchange::Trajectory;
use minimal_surprise_sim::{Grid, Pose};
use serde_json::Value;
use tests::program::{Evolver, Finished, Profile};
use tests::terminal::{Terminal, close_terminal_of};

/// Default size of a terminal window.
const WINDOW: (u16, u16) = (24, 80);

/// Number of rows above the swarm.
const TITLE: usize = 2;

const RIGHT: &str = "\x1b[C";
const LEFT: &str = "\x1b[D";
const UP: &str = "\x1b[A";
const DOWN: &str = "\x1b[B";
const HOME: &str = "\x1b[H";
const END: &str = "\x1b[F";
const ESCAPE: &str = "\x1b";
const CTRL_C: &str = "\x03";

const EVALUATE: &str = "evaluate run --starts 2 --steps 20";
const STATUS: &str = "suite own.toml status --out suite";

/// Creates a folder with a short run in `run`, and a suite.
fn with_a_run() -> Evolver {
    let evolver = Evolver::built(Profile::Debug);
    let run = evolver.run(&evolve("run").collect::<Vec<_>>());
    assert_eq!(run.code, Some(0), "{run:?}");
    assert!(run.stdout.contains("evolver replay run\n"), "{run:?}");
    let suite = b"name = \"own\"\n[[experiment]]\nname = \"one\"\nruns = 1\n";
    evolver.write("own.toml", suite);
    evolver
}

fn evolve(out: &str) -> impl Iterator<Item = &str> {
    let flags = "evolve --population 4 --generations 2 --repetitions 1 --steps 60 --seed 4 --out";
    flags.split(' ').chain([out])
}

/// Returns all states of the run, read from its exported trajectory.
fn states(evolver: &Evolver) -> Trajectory {
    let exported = evolver.run(&["export", "run", "--format", "trajectory"]);
    assert_eq!(exported.code, Some(0), "{exported:?}");
    Trajectory::read(&exported.stdout).unwrap()
}

fn final_json(evolver: &Evolver, key: &str) -> Vec<Pose> {
    let state: Value = serde_json::from_slice(&evolver.read("run/final.json")).unwrap();
    serde_json::from_value(state[key].clone()).unwrap()
}

fn assert_refused(run: &Finished, words: &[&str]) {
    assert_eq!(run.code, Some(2), "{run:?}");
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in {run:?}");
    }
    assert_eq!(run.stderr.trim_end().lines().count(), 1, "{run:?}");
    assert_eq!(run.stdout, "", "{run:?}");
}

/// Returns the contents of a cell on the screen: the mark to the left of the cell, and the
/// character in the cell.
fn cell(terminal: &Terminal, grid: Grid, x: u16, y: u16) -> (String, String) {
    let row = TITLE as u16 + grid.height() - 1 - y;
    let at = |column| terminal.screen().cell(row, column).unwrap().contents();
    (at(2 * x).to_owned(), at(2 * x + 1).to_owned())
}

/// Returns the swarm on the screen, drawn with filled arrows.
fn swarm(terminal: &Terminal, grid: Grid) -> String {
    let arrows = [("▷▸", "▶"), ("△▴", "▲"), ("◁◂", "◀"), ("▽▾", "▼")];
    let rows = (0..grid.height()).rev().map(|y| {
        let cells = (0..grid.width()).map(|x| {
            let (_, drawn) = cell(terminal, grid, x, y);
            let filled = arrows
                .iter()
                .find(|(other, _)| other.chars().any(|c| drawn == c.to_string()));
            filled.map_or(drawn, |(_, filled)| (*filled).to_owned())
        });
        cells.collect::<String>()
    });
    rows.collect::<Vec<_>>().join("\n")
}

/// Returns the step shown on the screen.
fn step(terminal: &Terminal) -> usize {
    let rows = terminal.rows();
    let line = rows.iter().find(|row| row.contains(" of 60 ")).unwrap();
    let words: Vec<&str> = line.split_whitespace().collect();
    let at = words.iter().position(|word| *word == "step").unwrap();
    words[at + 1].parse().unwrap()
}

#[test]
fn every_key_that_moves_in_time_shows_the_state_of_the_displayed_step() {
    let evolver = with_a_run();
    let trajectory = states(&evolver);
    let grid = trajectory.grid();
    let mut terminal = Terminal::start(&evolver, WINDOW, &[], &["replay", "run"]);
    terminal.wait_for("q quit");
    let shows = |terminal: &Terminal, t: usize| {
        assert_eq!(step(terminal), t);
        let expected = draw(grid, &trajectory.states()[t]);
        assert_eq!(swarm(terminal, grid), expected, "state {t}");
    };
    shows(&terminal, 0);
    assert_eq!(
        swarm(&terminal, grid),
        draw(grid, &final_json(&evolver, "start"))
    );
    for words in ["run  15x15  100 robots  sensor model C", "seed 4  hash "] {
        assert!(terminal.screen().contents().contains(words), "{words}");
    }
    for (key, t) in [
        (RIGHT, 1),
        (RIGHT, 2),
        (LEFT, 1),
        (DOWN, 11),
        (UP, 1),
        (UP, 0),
        (LEFT, 0),
        (END, 60),
        (RIGHT, 60),
        ("5", 30),
        ("9", 54),
        (HOME, 0),
    ] {
        terminal.after(key, &format!("paused   10/s  step {t:>2} of 60"));
        shows(&terminal, t);
    }
    terminal.after(END, "step 60 of 60");
    assert_eq!(
        swarm(&terminal, grid),
        draw(grid, &final_json(&evolver, "final"))
    );
    terminal.types("q");
    assert_eq!(terminal.ended(), 0);
    assert!(terminal.is_restored());
    assert_eq!(terminal.screen().contents().trim(), "");
}

#[test]
fn playing_moves_the_robots_and_ends_at_the_last_state() {
    let evolver = with_a_run();
    let trajectory = states(&evolver);
    let grid = trajectory.grid();
    let mut terminal = Terminal::start(&evolver, WINDOW, &[], &["replay", "run"]);
    terminal.wait_for("q quit");
    terminal.after(" ", "playing  10/s  step  3 of 60");
    terminal.after(" ", "paused");
    let t = step(&terminal);
    assert!((3..60).contains(&t), "{t}");
    let shown = swarm(&terminal, grid);
    assert_eq!(shown, draw(grid, &trajectory.states()[t]));
    assert_ne!(shown, draw(grid, &trajectory.states()[0]));
    terminal.after("-", "  5/s");
    terminal.after("+++++", "200/s");
    terminal.after("9 ", "paused  200/s  step 60 of 60");
    // At the end, playing starts again from the beginning.
    terminal.after("----", " 10/s");
    terminal.after(" ", "playing  10/s  step  1 of 60");
    terminal.types("q");
    assert_eq!(terminal.ended(), 0);
}

#[test]
fn a_selected_robot_shows_what_it_senses_and_what_it_had_predicted() {
    let evolver = with_a_run();
    let starts = final_json(&evolver, "start");
    let grid = states(&evolver).grid();
    let bytes = evolver.read("run/best.genome");
    let genome = EncodedGenome::decode(&bytes).unwrap();
    let predicted = State::new(&Controller::from_encoded(&genome)).prediction();
    let mut terminal = Terminal::start(&evolver, WINDOW, &[], &["replay", "run"]);
    terminal.wait_for("q quit");
    for robot in [0, 1, 2] {
        terminal.after("n", &format!("robot {robot} at"));
        let pose = starts[robot];
        let mut hits = 0;
        let cells = genome.topology().model().cells();
        for (sensor, &sensed) in cells.iter().enumerate() {
            let (dx, dy) = pose.heading.offset(sensed);
            let (x, y) = grid.moved(pose.x, pose.y, dx, dy);
            let occupied = starts.iter().any(|other| (other.x, other.y) == (x, y));
            let mark = match (occupied, predicted.get(sensor)) {
                (true, true) => "■",
                (false, false) => "□",
                (true, false) => "✘",
                (false, true) => "×",
            };
            hits += usize::from(occupied == predicted.get(sensor));
            assert_eq!(cell(&terminal, grid, x, y).0, mark, "{x}, {y} of {robot}");
        }
        let rows = terminal.screen().contents();
        let (predicted, missed) = (hits, cells.len() - hits);
        assert!(
            rows.contains(&format!("as predicted {predicted:>2} ")),
            "{rows}"
        );
        assert!(
            rows.contains(&format!("mispredicted {missed:>2} ")),
            "{rows}"
        );
        let row = TITLE as u16 + grid.height() - 1 - pose.y;
        let at = terminal.screen().cell(row, 2 * pose.x + 1).unwrap();
        assert!(at.inverse(), "{row} {at:?}");
    }
    terminal.after("p", "robot 1 at");
    terminal.after(END, "expects");
    assert!(terminal.screen().contents().contains('○'));
    // If no pause followed, Escape and the next key would be read as a single key.
    terminal.types(ESCAPE);
    terminal.wait_while("robot 1 at");
    terminal.after(HOME, "step  0 of 60");
    terminal.after("p", "robot 99 at");
    terminal.after("c", "no sensor mispredicted");
    terminal.types("c");
    terminal.wait_while("no sensor mispredicted");
    terminal.after("c", "another structure");
}

#[test]
fn a_window_smaller_than_the_grid_says_which_part_it_shows_and_scrolls() {
    let evolver = with_a_run();
    let grid = states(&evolver).grid();
    let mut terminal = Terminal::start(&evolver, (12, 24), &[], &["replay", "run"]);
    terminal.wait_for("cropped: x 0–11 of 15");
    terminal.resize(12, 60);
    terminal.wait_for("cropped: x 0–14 of 15, y 8–14 of 15");
    terminal.after("j", "y 3–9 of 15");
    terminal.after("jj", "y 0–6 of 15");
    terminal.after("k", "y 5–11 of 15");
    let robot = final_json(&evolver, "start")[0];
    terminal.after("n", "cropped");
    terminal.after(RIGHT, "step  1 of 60");
    terminal.after(LEFT, "step  0 of 60");
    // The selected robot is the arrow in reverse video.
    let inverse = |terminal: &Terminal| {
        let mut cells = (0..60).flat_map(|x| (0..12).map(move |y| (y, x)));
        cells.any(|(y, x)| {
            let cell = terminal.screen().cell(y, x).unwrap();
            cell.inverse() && cell.contents() != " "
        })
    };
    assert!(inverse(&terminal), "robot 0 at {robot:?} is out of view");
    terminal.resize(24, 80);
    terminal.wait_while("cropped");
    terminal.wait_for("fitness so far  –");
    let expected = draw(grid, &final_json(&evolver, "start"));
    terminal.wait_until_it_shows("whole swarm", |terminal| swarm(terminal, grid) == expected);
    for (rows, columns) in [(1, 1), (3, 5), (6, 200)] {
        terminal.resize(rows, columns);
    }
    terminal.types("q");
    assert_eq!(terminal.ended(), 0);
}

#[test]
fn without_colours_the_screen_shows_the_same() {
    let evolver = with_a_run();
    let screen = |variables: &[(&str, &str)]| {
        let mut terminal = Terminal::start(&evolver, WINDOW, variables, &["replay", "run"]);
        terminal.wait_for("q quit");
        terminal.after("5", "step 30 of 60");
        terminal.after("n", "robot 0 at");
        let (rows, columns) = terminal.screen().size();
        let (rows, columns) = (u16::from(rows), u16::from(columns));
        let mut cells = (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x)));
        let plain = vt100::Color::Default;
        let is_coloured = cells.any(|(y, x)| {
            let cell = terminal.screen().cell(y, x).unwrap();
            cell.fgcolor() != plain || cell.bgcolor() != plain
        });
        (terminal.rows(), is_coloured)
    };
    let (coloured, has_colours) = screen(&[]);
    let (plain, has_none) = screen(&[("NO_COLOR", "1")]);
    assert!(has_colours && !has_none);
    assert_eq!(plain, coloured);
    let (rows, has_colours) = screen(&[("COLORTERM", "truecolor")]);
    assert!(has_colours);
    assert_eq!(rows, coloured);
}

#[test]
fn damage_is_shown_where_it_occurred_with_the_swarm_before_it() {
    let evolver = with_a_run();
    let grid = states(&evolver).grid();
    let before = final_json(&evolver, "final");
    let damaged = |pose: &Pose| (3..=8).contains(&pose.x) && (4..=9).contains(&pose.y);
    let left: Vec<Pose> = before
        .iter()
        .copied()
        .filter(|pose| !damaged(pose))
        .collect();
    let flags = ["replay", "run", "--remove", "3,4,8,9"];
    let mut terminal = Terminal::start(&evolver, WINDOW, &[], &flags);
    terminal.wait_for("q quit");
    assert_eq!(swarm(&terminal, grid), draw(grid, &left));
    for y in 0..grid.height() {
        for x in 0..grid.width() {
            let inside = (3..=8).contains(&x) && (4..=9).contains(&y);
            let (mark, _) = cell(&terminal, grid, x, y);
            assert_eq!(mark == "░", inside, "{x}, {y}");
        }
    }
    terminal.after("b", "before damage");
    assert_eq!(swarm(&terminal, grid), draw(grid, &before));
    terminal.after("b", "b shows the swarm before");
    assert_eq!(swarm(&terminal, grid), draw(grid, &left));
}

#[test]
fn ctrl_c_and_signals_end_it_and_restore_the_terminal() {
    let evolver = with_a_run();
    let run = || {
        let mut terminal = Terminal::start(&evolver, WINDOW, &[], &["replay", "run"]);
        terminal.wait_for("q quit");
        assert!(!terminal.is_restored());
        terminal
    };
    let mut terminal = run();
    terminal.types(CTRL_C);
    assert_eq!(terminal.ended(), 0);
    assert!(terminal.is_restored());
    for signal in ["INT", "TERM", "HUP"] {
        let mut terminal = run();
        terminal.signal(signal);
        assert_eq!(terminal.ended(), 130, "{signal}");
        assert!(terminal.is_restored(), "{signal}");
    }
    for more in [vec!["--resume", "run"], evolve("other").skip(1).collect()] {
        let arguments = [vec!["evolve", "--open"], more].concat();
        let mut terminal = Terminal::start(&evolver, WINDOW, &[], &arguments);
        terminal.wait_for("q quit");
        terminal.signal("TERM");
        assert_eq!(terminal.ended(), 130, "{arguments:?}");
        assert!(terminal.is_restored(), "{arguments:?}");
    }
}

#[test]
fn evolve_opens_the_replay_of_its_run_and_prints_its_summary() {
    let evolver = Evolver::built(Profile::Debug);
    let arguments: Vec<&str> = evolve("run").chain(["--open"]).collect();
    let mut terminal = Terminal::start(&evolver, (60, 100), &[], &arguments);
    terminal.wait_for("step  0 of 60");
    assert!(terminal.screen().alternate_screen());
    terminal.wait_for("q quit");
    terminal.types("q");
    assert_eq!(terminal.ended(), 0);
    assert!(terminal.is_restored());
    let summary = terminal.screen().contents();
    assert!(summary.contains("evolver replay run"), "{summary}");

    // The replay of a complete run opens immediately.
    let again = ["evolve", "--resume", "run", "--open"];
    let mut terminal = Terminal::start(&evolver, (60, 100), &[], &again);
    terminal.wait_for("q quit");
    terminal.types("q");
    assert_eq!(terminal.ended(), 0);
}

#[test]
fn without_a_terminal_nothing_is_evolved_or_played() {
    let evolver = with_a_run();
    let replayed = evolver.run(&["replay", "run"]);
    assert_refused(&replayed, &["standard output is not a terminal", "--html"]);
    let before = evolver.files();
    let arguments: Vec<&str> = evolve("other").chain(["--open"]).collect();
    assert_refused(&evolver.run(&arguments), &["--open", "not a terminal"]);
    assert_eq!(evolver.files(), before);
}

/// Runs the program to completion in a terminal with these variables; returns its exit code and
/// output.
fn ended_in(
    evolver: &Evolver,
    window: (u16, u16),
    variables: &[(&str, Option<&str>)],
    arguments: &[&str],
) -> (u32, String) {
    let variables = variables.iter().copied();
    let mut terminal = Terminal::start_with(evolver, window, variables, arguments);
    let code = terminal.ended();
    (code, terminal.sent())
}

#[test]
fn a_terminal_without_codes_gets_plain_lines() {
    let evolver = with_a_run();
    for (index, term) in [Some("dumb"), Some(""), None].into_iter().enumerate() {
        let run = |line: &str| {
            let arguments: Vec<&str> = line.split(' ').collect();
            let (code, sent) = ended_in(&evolver, WINDOW, &[("TERM", term)], &arguments);
            assert!(!sent.contains('\x1b'), "{term:?}, {line}: {sent:?}");
            (code, sent)
        };
        let out = format!("run-{index}");
        for progress in ["auto", "bar"] {
            let out = format!("{out}-{progress}");
            let line = evolve(&out).collect::<Vec<_>>().join(" ");
            let (code, sent) = run(&format!("{line} --progress {progress}"));
            assert_eq!(code, 0, "{sent}");
            assert!(sent.contains("generation 2/2  best 0."), "{sent}");
        }
        for line in ["classify run", EVALUATE, STATUS, "--help"] {
            assert_eq!(run(line).0, 0, "{line}");
        }
        assert_eq!(run("classify --nosuch").0, 2);
        for line in ["replay run", "evolve --open"] {
            let (code, sent) = run(line);
            assert_eq!(code, 2, "{sent}");
            assert!(sent.contains("it cannot move the cursor"), "{sent}");
        }
        assert!(run("replay run").1.contains("--svg"));
    }
}

#[test]
fn a_terminal_without_utf8_gets_ascii_and_a_pipe_gets_utf8() {
    let evolver = with_a_run();
    let robots = |sent: &str| sent.chars().filter(|c| "><^v".contains(*c)).count();
    for locale in [Some("C"), Some("POSIX"), Some("de_DE.ISO-8859-1"), None] {
        let variables = [
            ("LC_ALL", locale),
            ("LC_CTYPE", None),
            ("LANG", None),
            ("NO_COLOR", Some("1")),
        ];
        let run = |line: &str| {
            let arguments: Vec<&str> = line.split(' ').collect();
            let (_, sent) = ended_in(&evolver, (60, 100), &variables, &arguments);
            assert!(sent.is_ascii(), "{locale:?}, {line}: {sent}");
            sent
        };
        let classified = run("classify run");
        let (picture, _) = classified.split_once("\r\n\r\n").unwrap();
        assert_eq!(robots(picture), 100, "{picture}");
        assert!(picture.contains('.'), "{picture}");
        assert!(run(EVALUATE).contains("mean fitness"));
        assert!(run(STATUS).contains("0 of 1 done"));
        run("replay --help");
        run("classify --help");
        assert!(run("classify gr\u{fc}n").contains("\\u{fc}"));
        let mut terminal = Terminal::start_with(&evolver, WINDOW, variables, &["replay", "run"]);
        terminal.wait_for("q quit");
        terminal.after("n", "robot 0 at");
        terminal.after(END, "step 60 of 60");
        terminal.types("q");
        assert_eq!(terminal.ended(), 0);
        assert!(terminal.sent().is_ascii(), "{}", terminal.sent());
        assert!(robots(&terminal.sent()) >= 100);
    }
    let piped = evolver.run_with(("LC_ALL", "C"), &["classify", "run"]);
    assert!(piped.stdout.contains('·'), "{piped:?}");
}

#[test]
fn every_command_works_in_windows_of_any_size() {
    let evolver = with_a_run();
    for (rows, columns) in [(1, 1), (24, 1), (1, 20), (6, 7), (24, 20), (24, 39)] {
        let out = format!("run-{rows}-{columns}");
        let arguments: Vec<&str> = evolve(&out).collect();
        for arguments in [&arguments[..], &["classify", "run"], &["--help"]] {
            let (code, sent) = ended_in(&evolver, (rows, columns), &[], arguments);
            assert_eq!(code, 0, "{rows}x{columns}, {arguments:?}: {sent}");
        }
        let mut terminal = Terminal::start(&evolver, (rows, columns), &[], &["replay", "run"]);
        terminal.wait_until_it_shows("replay", |terminal| terminal.screen().alternate_screen());
        terminal.types("q");
        assert_eq!(terminal.ended(), 0, "{rows}x{columns}");
        assert!(terminal.is_restored(), "{rows}x{columns}");
    }
    // A progress bar leaves no text on the screen, even if the bar was truncated.
    let arguments: Vec<&str> = evolve("narrow").collect();
    let mut terminal = Terminal::start(&evolver, (40, 20), &[], &arguments);
    assert_eq!(terminal.ended(), 0);
    let rows = terminal.rows().join("\n");
    assert!(!rows.contains("/2  best"), "{rows}");
    assert!(rows.contains("(a 15x15 grid is too"), "{rows}");
    // In a small terminal, only the drawing is left out.
    let piped = evolver.run(&evolve("piped").collect::<Vec<_>>()).stdout;
    let piped = piped.replace("piped", "narrow");
    assert_tells_all(&terminal.sent(), &piped, &["fitness", "hash"]);
    let no_color = [("NO_COLOR", Some("1"))];
    let (_, sent) = ended_in(&evolver, (40, 20), &no_color, &["classify", "run"]);
    let piped = evolver.run(&["classify", "run"]).stdout;
    assert_tells_all(&sent, &piped, &["fitness", "clustering"]);
}

/// Asserts that the program prints these words to a pipe, and that a terminal shows all lines that
/// are printed to a pipe.
fn assert_tells_all(sent: &str, piped: &str, words: &[&str]) {
    for word in words {
        assert!(piped.contains(word), "no {word:?} in {piped}");
    }
    for line in piped.lines().filter(|line| !line.contains('·')) {
        assert!(sent.contains(line), "no {line:?} in {sent}");
    }
}

#[test]
fn a_run_under_nohup_outlives_its_terminal_and_another_can_be_resumed() {
    let evolver = Evolver::built(Profile::Debug);
    let program = evolver.program().display();
    let begun = |out: &str| {
        let table = evolver.folder().join(out).join("generations.csv");
        std::fs::read_to_string(table).is_ok_and(|table| table.lines().count() > 1)
    };
    let work = "--population 4 --generations 60 --repetitions 1 --steps 60 --seed 4";
    let wait_for = |file: &str| {
        let started = std::time::Instant::now();
        while !evolver.folder().join(file).exists() {
            assert!(started.elapsed().as_secs() < 120, "no {file}");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    };
    let line = format!("(nohup {program} evolve {work} --out kept; echo $? > kept.code) & wait");
    close_terminal_of(&evolver, &format!("trap '' HUP; {line}"), || begun("kept"));
    wait_for("kept.code");
    assert_eq!(evolver.text("kept.code").trim(), "0");
    assert!(evolver.folder().join("kept/DONE").exists());

    let line = format!("trap 'exit 0' HUP; {program} evolve {work} --out cut & wait");
    close_terminal_of(&evolver, &line, || begun("cut"));
    let mut resumed = evolver.run(&["evolve", "--resume", "cut"]);
    while resumed.stderr.contains("in use") {
        resumed = evolver.run(&["evolve", "--resume", "cut"]);
    }
    assert_eq!(resumed.code, Some(0), "{resumed:?}");
    assert_eq!(evolver.text("cut/DONE"), evolver.text("kept/DONE"));
}

#[test]
fn a_trajectory_is_played_without_predictions() {
    let evolver = with_a_run();
    let grid = states(&evolver).grid();
    let flags = "export run --format trajectory --out agent_trajectory";
    let exported = evolver.run(&flags.split(' ').collect::<Vec<_>>());
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let mut terminal = Terminal::start(&evolver, WINDOW, &[], &["replay", "agent_trajectory"]);
    terminal.wait_for("q quit");
    assert!(terminal.screen().contents().contains("poses only"));
    terminal.after("n", "predictions are unknown");
    terminal.after(END, "step 60 of 60");
    let shown = swarm(&terminal, grid);
    assert_eq!(shown, draw(grid, &final_json(&evolver, "final")));
}

#[test]
fn input_that_cannot_be_replayed_is_refused_with_one_message() {
    let evolver = with_a_run();
    let exported = evolver
        .run(&["export", "run", "--format", "trajectory"])
        .stdout;
    let genome = evolver.read("run/best.genome");
    let last = evolver.text("run/final.json");
    let refused = |arguments: &str, words: &[&str]| {
        let arguments: Vec<&str> = ["replay"].into_iter().chain(arguments.split(' ')).collect();
        assert_refused(&evolver.run(&arguments), words);
    };
    refused("nothing", &["nothing"]);
    evolver.write("cut.genome", &genome[..500]);
    refused("cut.genome", &["cut.genome", "too short"]);
    refused("run/best.genome --grid 2x9", &["--grid = 2x9"]);
    refused("run/best.genome --robots 300", &["--robots = 300"]);
    refused("run/best.genome --steps 0", &["--steps = 0"]);
    refused("run/best.genome --noise 2", &["--noise = 2"]);
    refused(
        "run/best.genome --remove 1,1,2,2",
        &["--remove", "run directory"],
    );
    refused("run --seed 3", &["--seed", "run directory"]);
    refused("run --remove 0,0,99,1", &["--remove = 0,0,99,1", "(99, 1)"]);
    refused("run --remove 0,0,14,14", &["--remove = 0,0,14,14"]);

    let first_state: Vec<&str> = exported.lines().take(3 + 100).collect();
    evolver.write("one.trajectory", first_state.join("\n").as_bytes());
    refused("one.trajectory", &["one.trajectory", "no step"]);
    evolver.write("cut.trajectory", &exported.as_bytes()[..exported.len() / 2]);
    refused("cut.trajectory", &["cut.trajectory"]);

    let damaged = |words: &[&str]| evolver.run(&["replay", "run"]).assert_failed(words);
    let mut changed: Value = serde_json::from_str(&last).unwrap();
    changed["schema_version"] = 9.into();
    evolver.write("run/final.json", changed.to_string().as_bytes());
    damaged(&["final.json", "schema version 9", "reads version"]);
    evolver.write("run/final.json", &last.as_bytes()[..last.len() / 2]);
    damaged(&["final.json", "line"]);
    evolver.write("run/final.json", b"");
    damaged(&["final.json"]);
    evolver.write("run/final.json", last.as_bytes());
    evolver.write("run/best.genome", &genome[..100]);
    damaged(&["best.genome", "too short"]);
    std::fs::remove_file(evolver.folder().join("run/DONE")).unwrap();
    refused("run", &["run", "no DONE"]);
}
