//! Opens the pages from files in a headless Chromium without a network.

use minimal_surprise_evolution::finished_run::FinishedRun;
use minimal_surprise_replay::page::page;
use minimal_surprise_replay::recording::Recording;
use minimal_surprise_replay::scene::{Colouring, Scene};
use minimal_surprise_sim::damage::{Area, Damage};
use minimal_surprise_sim::exchange::Trajectory;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tests::browser::{Browser, chromium};
use tests::full;
use tests::noisy_run::copy_noisy_run;
use tests::program::{Evolver, Finished};
use tests::tools::require;

/// Creates a folder with the named short runs in `runs`.
fn with_runs(runs: &[(&str, &str)]) -> Evolver {
    let evolver = Evolver::in_empty_folder();
    fs::create_dir(evolver.folder().join("runs")).unwrap();
    for (name, flags) in runs {
        let line = format!(
            "evolve --population 6 --generations 3 --repetitions 2 --progress none --out \
             runs/{name} {flags}"
        );
        succeed(&evolver, &line);
    }
    evolver
}

/// Runs the program with the words of a line as arguments.
fn run(evolver: &Evolver, line: &str) -> Finished {
    evolver.run(&line.split_whitespace().collect::<Vec<_>>())
}

fn succeed(evolver: &Evolver, line: &str) -> Finished {
    let run = run(evolver, line);
    assert_eq!(run.code, Some(0), "{line}: {run:?}");
    run
}

/// Checks the exit code (2 if the input is invalid, 1 if a run is damaged) and the words of the
/// message.
fn assert_refused(run: &Finished, code: i32, words: &[&str]) {
    assert_eq!(run.code, Some(code), "{run:?}");
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in {run:?}");
    }
    assert_eq!(run.stderr.trim_end().lines().count(), 1, "{run:?}");
}

/// Starts a browser; returns `None` if Chromium is not installed and the test may be skipped.
fn browser() -> Option<Browser> {
    require(chromium()).map(|chromium| Browser::start(&chromium))
}

fn open(browser: &mut Browser, page: &Path) {
    browser.open(page);
    let _: Value = browser.evaluate("replay.ready.then(() => true)");
}

fn recording_of(evolver: &Evolver, run: &str) -> Recording {
    let path = evolver.folder().join(run);
    Recording::of_run(run, &FinishedRun::read(&path).unwrap(), &|| ()).unwrap()
}

/// Compares every kind of scene of some states with the page's scenes.
fn assert_same_scenes(browser: &mut Browser, recording: &Recording) {
    let steps = recording.steps();
    let states = [0, 1, 2, 127, 128, 129, steps / 2, steps - 1, steps];
    let picked = [None, Some(0), Some(recording.robots() - 1)];
    for t in states.into_iter().filter(|&t| t <= steps) {
        for colouring in [Colouring::Structure, Colouring::Surprise, Colouring::Plain] {
            for robot in picked {
                let ours = serde_json::to_value(Scene::of(recording, t, colouring, robot));
                let theirs: Value = browser.evaluate(&format!(
                    "replay.scene({t}, {}, {})",
                    json!(colouring),
                    json!(robot)
                ));
                assert_eq!(theirs, ours.unwrap(), "{t} {colouring:?} {robot:?}");
            }
        }
    }
}

fn checked(browser: &mut Browser) -> (String, String) {
    browser.wait_for("!['waiting', null].includes(replay.state().check.status)");
    browser.evaluate(
        "[replay.state().check.status, document.getElementById('check-text').textContent]",
    )
}

#[test]
fn the_page_shows_the_same_scenes_as_the_program_and_hashes_the_steps_of_the_run() {
    let Some(mut browser) = browser() else { return };
    let flags = [
        ("c", "--seed 4 --steps 300"),
        (
            "b",
            "--seed 5 --steps 128 --sensor-model b --grid 11x9 --robots 30",
        ),
        (
            "noisy",
            "--seed 6 --steps 140 --sensor-model a --noise 0.1 --grid 4x20 --robots 40",
        ),
        (
            "noisy-c",
            "--seed 7 --steps 60 --noise 0.2 --predefine-partly line",
        ),
    ];
    let evolver = with_runs(&flags);
    copy_noisy_run(&evolver.folder().join("runs/noisy-v1"));
    for name in flags.map(|(name, _)| name).into_iter().chain(["noisy-v1"]) {
        succeed(&evolver, &format!("replay runs/{name} --html {name}.html"));
        open(&mut browser, &evolver.folder().join(format!("{name}.html")));
        let recording = recording_of(&evolver, &format!("runs/{name}"));
        assert_same_scenes(&mut browser, &recording);
        let (status, words) = checked(&mut browser);
        assert_eq!(status, "good", "{words}");
        assert!(words.contains("identical to the recorded run"), "{words}");
        let hash: String = browser.evaluate("replay.state().check.computed");
        assert_eq!(hash, recording.origin.steps_hash.as_ref().unwrap().hash);
        let fitness: f64 = browser.evaluate(&format!("replay.fitness({})", recording.steps()));
        let ours = *recording.controller.unwrap().fitness.last().unwrap();
        assert!((fitness - ours).abs() < 1e-12, "{fitness} {ours}");
    }
    browser.assert_quiet();
}

#[test]
fn pages_of_damaged_swarms_genomes_and_trajectories_say_what_their_steps_can_be_compared_with() {
    let Some(mut browser) = browser() else { return };
    let evolver = with_runs(&[("run", "--seed 4 --steps 150")]);
    let finished = FinishedRun::read(&evolver.folder().join("runs/run")).unwrap();
    let area = Area::new(finished.settings.scenario().grid(), 13, 2, 3, 9).unwrap();
    for (flag, damage) in [
        ("remove", Damage::Remove(area)),
        ("reposition", Damage::Reposition(area)),
    ] {
        succeed(
            &evolver,
            &format!("replay runs/run --{flag} 13,2,3,9 --html {flag}.html"),
        );
        open(&mut browser, &evolver.folder().join(format!("{flag}.html")));
        let recording = Recording::of_damage("run", &finished, damage, &|| ()).unwrap();
        assert_same_scenes(&mut browser, &recording);
        let (status, words) = checked(&mut browser);
        assert_eq!(status, "good");
        assert!(words.contains("recorded no hash"), "{words}");
        let both: bool = browser.evaluate(
            "['before', 'now'].every((id) => document.getElementById(id).clientWidth > 50)",
        );
        assert!(both, "the swarm before the damage and now");
    }
    succeed(
        &evolver,
        "replay runs/run/best.genome --steps 20 --html genome.html",
    );
    open(&mut browser, &evolver.folder().join("genome.html"));
    let (status, words) = checked(&mut browser);
    assert_eq!(status, "good");
    assert!(words.contains("that the program computed"), "{words}");

    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/exchange/c/agent_trajectory");
    succeed(
        &evolver,
        &format!("replay {} --html trajectory.html", file.display()),
    );
    open(&mut browser, &evolver.folder().join("trajectory.html"));
    let trajectory = Trajectory::read(&fs::read_to_string(file).unwrap()).unwrap();
    let recording = Recording::of_trajectory("trajectory", &trajectory).unwrap();
    assert_same_scenes(&mut browser, &recording);
    let (status, words) = checked(&mut browser);
    assert_eq!(status, "no hash");
    assert!(words.contains("poses only"), "{words}");
    browser.assert_quiet();
}

#[test]
fn a_page_whose_steps_differ_from_the_run_says_so() {
    let Some(mut browser) = browser() else { return };
    let evolver = with_runs(&[("run", "--seed 4 --steps 40")]);
    let state: Value = serde_json::from_slice(&evolver.read("runs/run/final.json")).unwrap();
    let recorded = state["steps_hash_v2"].as_str().unwrap();
    let other = recorded.chars().rev().collect::<String>();
    let changed = evolver
        .text("runs/run/final.json")
        .replace(recorded, &other);
    evolver.write("runs/run/final.json", changed.as_bytes());
    // The program rejects such a run, but a page may be changed after it was written.
    assert_refused(
        &run(&evolver, "replay runs/run --html run.html"),
        1,
        &["runs/run", "another run"],
    );
    let recording = recording_of(&evolver, "runs/run");
    let text = page(&recording, Colouring::Structure, None).unwrap();
    evolver.write("run.html", text.as_bytes());
    open(&mut browser, &evolver.folder().join("run.html"));
    let (status, words) = checked(&mut browser);
    assert_eq!(status, "bad");
    assert!(words.contains("their hashes differ"), "{words}");
    browser.assert_quiet();
}

#[test]
fn play_moves_robots_and_the_last_state_is_the_final_one() {
    let Some(mut browser) = browser() else { return };
    let evolver = with_runs(&[("run", "--seed 4 --steps 90")]);
    succeed(&evolver, "replay runs/run --html run.html");
    open(&mut browser, &evolver.folder().join("run.html"));
    let seen = "document.getElementById('swarm').toDataURL()";
    let start: String = browser.evaluate(seen);
    let _: Value = browser.evaluate("replay.setSpeed(320), replay.play(), null");
    browser.wait_for("replay.state().t > 3");
    assert_ne!(browser.evaluate::<String>(seen), start);
    browser.wait_for("replay.state().t === 90 && !replay.state().playing");

    let _: Value = browser.evaluate("replay.seek(0), replay.seek(90), null");
    let poses: Value = browser.evaluate(
        "replay.scene(replay.state().t, 'plain', null).robots.map((r) => [r.x, r.y, r.heading])",
    );
    let state: Value = serde_json::from_slice(&evolver.read("runs/run/final.json")).unwrap();
    assert_eq!(poses, state["final"]);
    browser.assert_quiet();
}

#[test]
fn a_click_on_a_robot_shows_what_it_predicts_and_senses() {
    let Some(mut browser) = browser() else { return };
    let evolver = with_runs(&[("run", "--seed 4 --steps 90")]);
    succeed(&evolver, "replay runs/run --html run.html");
    open(&mut browser, &evolver.folder().join("run.html"));
    let _: Value = browser.evaluate("replay.seek(50), null");
    let [x, y]: [f64; 2] = browser.evaluate(
        "(() => { const { x, y } = replay.scene(50, 'plain', null).robots[17];
          const box = document.getElementById('swarm').getBoundingClientRect();
          return [box.left + (x + 0.5) * box.width / 15, box.top + (14.5 - y) * box.height / 15]; })()",
    );
    browser.click(x, y);
    browser.wait_for(
        "document.getElementById('world-model-text').textContent.startsWith('Robot 17 ')",
    );
    let recording = recording_of(&evolver, "runs/run");
    let (sensed, predicted) = (recording.sensed(50, 17), recording.predicted(50, 17));
    let right = 14 - sensed.unwrap().differing(predicted.unwrap());
    let words: String = browser.evaluate("document.getElementById('world-model-text').textContent");
    assert!(
        words.contains(&format!("{right} of 14 sensors predicted correctly")),
        "{words}"
    );
    let shown = |view: usize| {
        format!(
            "[...document.querySelectorAll('#views figure')[{view}].querySelectorAll('g')]
             .reduce((bits, spot, i) => bits | spot.classList.contains('occupied') << i, 0)"
        )
    };
    assert_eq!(
        browser.evaluate::<u16>(&shown(0)),
        predicted.unwrap().bits()
    );
    assert_eq!(browser.evaluate::<u16>(&shown(1)), sensed.unwrap().bits());
    let next = recording.predicted(51, 17).unwrap().bits();
    assert_eq!(browser.evaluate::<u16>(&shown(2)), next);
    let misses: u32 =
        browser.evaluate("document.querySelectorAll('#views figure:nth-child(2) .miss').length");
    assert_eq!(misses, 14 - right);
    // Clicking the same robot again deselects it.
    browser.click(x, y);
    browser.wait_for("replay.state().picked === null");
    browser.assert_quiet();
}

/// Returns the controls reached by Tab in one cycle, by ID, label or text.
fn tab_order(browser: &mut Browser) -> Vec<String> {
    let here = "(() => { const at = document.activeElement;
        return at === document.body ? '' : at.id || at.textContent; })()";
    let mut order: Vec<String> = Vec::new();
    loop {
        browser.press("Tab");
        let at: String = browser.evaluate(here);
        if at.is_empty() || order.contains(&at) || order.len() > 60 {
            return order;
        }
        let outline: String =
            browser.evaluate("getComputedStyle(document.activeElement).outlineStyle");
        assert_ne!(outline, "none", "{at} does not show that it has the focus");
        let label: bool = browser.evaluate(
            "(() => { const at = document.activeElement;
              return Boolean(at.getAttribute('aria-label') || at.textContent.trim() || at.labels?.length); })()",
        );
        assert!(label, "{at} has no label");
        order.push(at);
    }
}

/// Presses keys and waits until the expression is true.
fn after(browser: &mut Browser, keys: &[&str], expression: &str) {
    for key in keys {
        browser.press(key);
    }
    browser.wait_for(expression);
}

#[test]
fn the_replay_works_with_the_keyboard_alone() {
    let Some(mut browser) = browser() else { return };
    let evolver = with_runs(&[("run", "--seed 4 --steps 90")]);
    succeed(&evolver, "replay runs/run --html run.html");
    open(&mut browser, &evolver.folder().join("run.html"));
    let order = [
        "theme",
        "seek",
        "back",
        "play",
        "forward",
        "speed",
        "colouring",
        "robot",
        "previous",
        "next",
        "none",
    ];
    assert_eq!(tab_order(&mut browser), order);
    let _: Value = browser.evaluate("document.activeElement.blur(), null");
    after(&mut browser, &["End"], "replay.state().t === 90");
    after(
        &mut browser,
        &["ArrowLeft", "ArrowLeft"],
        "replay.state().t === 88",
    );
    after(&mut browser, &["ArrowRight"], "replay.state().t === 89");
    after(&mut browser, &["Home"], "replay.state().t === 0");
    after(&mut browser, &["+", "+"], "replay.state().speed === 80");
    after(&mut browser, &["-"], "replay.state().speed === 40");
    after(
        &mut browser,
        &[" "],
        "replay.state().playing && replay.state().t > 2",
    );
    after(&mut browser, &[" "], "!replay.state().playing");
    after(
        &mut browser,
        &["n", "n", "n"],
        "replay.state().picked === 2",
    );
    after(&mut browser, &["p", "["], "replay.state().picked === 0");
    after(&mut browser, &["]"], "replay.state().picked === 1");
    after(&mut browser, &["Escape"], "replay.state().picked === null");
    after(
        &mut browser,
        &["c"],
        "replay.state().colouring === 'surprise'",
    );
    after(&mut browser, &["c"], "replay.state().colouring === 'plain'");
    after(
        &mut browser,
        &["t"],
        "document.documentElement.dataset.theme === 'dark'",
    );
    // A focused control receives the keys.
    let _: Value = browser.evaluate("document.getElementById('theme').focus(), null");
    after(
        &mut browser,
        &["Home", "Tab", "ArrowRight", "ArrowRight"],
        "replay.state().t === 2",
    );
    after(
        &mut browser,
        &["Tab", "Tab", "Enter"],
        "replay.state().playing",
    );
    after(&mut browser, &["Enter"], "!replay.state().playing");
    after(
        &mut browser,
        &["Tab", "Tab", "ArrowUp"],
        "replay.state().speed === 20",
    );
    after(
        &mut browser,
        &["Tab", "Tab", "1", "2"],
        "replay.state().picked === 12",
    );
    after(
        &mut browser,
        &["Home"],
        "/^State \\d+ of 90.*Robot 12 at/.test(document.getElementById('status').textContent)",
    );
    browser.assert_quiet();
}

#[test]
fn the_gallery_sorts_filters_and_opens_replays_with_the_keyboard() {
    let Some(mut browser) = browser() else { return };
    let evolver = with_runs(&[
        ("one", "--seed 1 --steps 60"),
        ("two", "--seed 2 --steps 60 --grid 20x20"),
        ("three", "--seed 3 --steps 60 --sensor-model a"),
        ("four", "--seed 4 --steps 60 --sensor-model b --grid 20x20"),
    ]);
    let written = succeed(&evolver, "gallery runs --out gallery");
    assert!(
        written.stdout.starts_with("gallery/index.html (4 runs, 0."),
        "{written:?}"
    );
    let mut files = evolver.files();
    files.retain(|name| name.starts_with("gallery/"));
    let written = [
        ".evolver-gallery",
        "four.html",
        "index.html",
        "one.html",
        "three.html",
        "two.html",
    ];
    assert_eq!(files, written.map(|name| format!("gallery/{name}")));

    browser.open(&evolver.folder().join("gallery/index.html"));
    let _: Value = browser.evaluate("gallery.ready.then(() => true)");
    browser.wait_for("gallery.state().drawn === 4");
    let finals = |key: &str| {
        let mut values: Vec<(f64, &str)> = ["one", "two", "three", "four"]
            .map(|name| {
                let state = evolver.read(&format!("runs/{name}/final.json"));
                let state: Value = serde_json::from_slice(&state).unwrap();
                (state[key].as_f64().unwrap(), name)
            })
            .to_vec();
        values.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(b.1)));
        values
            .into_iter()
            .map(|(_, name)| format!("{name}.html"))
            .collect::<Vec<_>>()
    };
    let cards: Vec<String> = browser.evaluate(
        "[...document.querySelectorAll('#runs .how')].map(({ textContent }) => textContent)",
    );
    assert!(
        cards
            .iter()
            .any(|card| card.contains("100 robots") && card.ends_with("seed 1 · one")),
        "{cards:?}"
    );
    let shown = "gallery.state().shown.map(({ page }) => page)";
    assert_eq!(browser.evaluate::<Vec<String>>(shown), finals("fitness"));
    browser.press("s");
    assert_eq!(browser.evaluate::<Vec<String>>(shown), finals("share"));
    browser.press("f");
    let of_first: bool = browser.evaluate(
        "gallery.state().shown.every(({ names }) => names.includes(gallery.state().structure))",
    );
    assert!(of_first);
    let _: Value = browser.evaluate("gallery.choose('structure', ''), gallery.choose('grid', '20x20'), gallery.choose('sort', 'seed'), null");
    assert_eq!(
        browser.evaluate::<Vec<String>>(shown),
        ["two.html", "four.html"]
    );
    let reached = tab_order(&mut browser);
    for control in ["theme", "grid", "model", "sort"] {
        assert!(
            reached.iter().any(|at| at == control),
            "{control}: {reached:?}"
        );
    }
    // In tab order, the runs follow the last control; arrow keys move between runs.
    let _: Value = browser.evaluate("document.getElementById('sort').focus(), null");
    browser.press("Tab");
    browser.press("ArrowRight");
    browser.press("Enter");
    browser.wait_for("location.pathname.endsWith('/gallery/four.html') && Boolean(window.replay)");
    let _: Value = browser.evaluate("replay.ready.then(() => true)");
    assert_eq!(checked(&mut browser).0, "good");
    let up: String = browser.evaluate("document.getElementById('gallery').getAttribute('href')");
    assert_eq!(up, "index.html");
    browser.assert_quiet();
}

#[test]
fn pages_fit_a_phone_and_a_wide_screen_in_light_and_dark() {
    let Some(mut browser) = browser() else { return };
    let evolver = with_runs(&[("run", "--seed 4 --steps 60")]);
    succeed(&evolver, "gallery runs");
    succeed(
        &evolver,
        "replay runs/run --remove 2,2,6,6 --html damage.html",
    );
    for page in ["gallery/index.html", "gallery/run.html", "damage.html"] {
        browser.open(&evolver.folder().join(page));
        let _: Value = browser.evaluate("(window.replay || window.gallery).ready.then(() => true)");
        for (width, height) in [(360, 740), (1600, 1000)] {
            browser.resize(width, height);
            browser.wait_for(&format!(
                "innerWidth === {width} && document.documentElement.scrollWidth <= {width}"
            ));
        }
        let ground = "getComputedStyle(document.documentElement).backgroundColor";
        let schemes = ["light", "dark"].map(|scheme| {
            let media =
                json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
            browser.call("Emulation.setEmulatedMedia", media);
            browser.evaluate::<String>(ground)
        });
        assert_eq!(schemes, ["rgb(255, 255, 255)", "rgb(22, 22, 21)"]);
    }
    browser.assert_quiet();
}

#[test]
fn the_same_run_has_the_same_page_and_pages_are_small() {
    let evolver = with_runs(&[("run", "--seed 4")]);
    let line = "replay runs/run --html";
    succeed(&evolver, &format!("{line} one.html"));
    succeed(&evolver, &format!("{line} two.html"));
    assert_eq!(evolver.read("one.html"), evolver.read("two.html"));
    succeed(&evolver, "gallery runs --threads 1 --out one");
    succeed(&evolver, "gallery runs --threads 3 --out two");
    for page in ["index.html", "run.html"] {
        assert_eq!(
            evolver.read(&format!("one/{page}")),
            evolver.read(&format!("two/{page}"))
        );
    }
    succeed(
        &evolver,
        "replay runs/run/best.genome --steps 10000 --html long.html",
    );
    let line = "replay runs/run/best.genome --noise 0.15 --steps 10000 --html noisy.html";
    succeed(&evolver, line);
    let pages = [
        ("one.html", 300_000),
        ("long.html", 3_000_000),
        ("noisy.html", 3_000_000),
    ];
    for (name, most) in pages {
        let bytes = evolver.read(name).len();
        println!("{name}: {bytes} bytes, at most {most}");
        assert!(bytes <= most, "{name}: {bytes}");
    }
}

#[test]
fn a_long_run_of_a_thousand_robots_opens_and_plays() {
    let Some(mut browser) = browser() else { return };
    let steps = if full::all_cases() { 10_000 } else { 2_000 };
    let evolver = with_runs(&[("run", "--seed 4 --steps 100 --sensor-model a --grid 20x20")]);
    let started = Instant::now();
    let line = "replay runs/run/best.genome --robots 1000 --grid 60x60 --noise 0.02 --html long.html --steps";
    succeed(&evolver, &format!("{line} {steps}"));
    let made = started.elapsed();
    open(&mut browser, &evolver.folder().join("long.html"));
    let opened: f64 = browser.evaluate("replay.state().opened");
    let _: Value = browser.evaluate("replay.setSpeed(80), replay.play(), null");
    let frames = "new Promise((done) => { const [from, t] = [replay.state().frames, performance.now()];
        setTimeout(() => done((replay.state().frames - from) / (performance.now() - t) * 1000), 2000); })";
    let checking: f64 = browser.evaluate(frames);
    let (status, _) = checked(&mut browser);
    assert_eq!(status, "good");
    let _: Value = browser.evaluate("replay.seek(0), replay.play(), null");
    let playing: f64 = browser.evaluate(frames);
    println!(
        "1000 robots, {steps} steps: page of {:.1} MB written in {:.1} s, opened in {opened:.0} ms; \
         {playing:.0} frames/s ({checking:.0} while the steps are hashed)",
        evolver.read("long.html").len() as f64 / 1e6,
        made.as_secs_f64()
    );
    browser.assert_quiet();
}

#[test]
fn input_that_cannot_be_shown_is_refused_and_nothing_is_overwritten() {
    let evolver = with_runs(&[("run", "--seed 4 --steps 30")]);
    let refused_with = |code: i32, line: &str, words: &[&str]| {
        let before = evolver.files();
        assert_refused(&run(&evolver, line), code, words);
        assert_eq!(evolver.files(), before, "{line}");
    };
    let refused = |line: &str, words: &[&str]| refused_with(2, line, words);
    evolver.write("there.html", b"mine");
    refused(
        "replay runs/run --html there.html",
        &["--html = there.html", "exists"],
    );
    assert_eq!(evolver.read("there.html"), b"mine");
    succeed(&evolver, "replay runs/run --html there.html --overwrite");
    assert!(evolver.text("there.html").starts_with("<!DOCTYPE html>"));
    refused(
        "replay runs/run --html no/such/folder.html",
        &["folder.html"],
    );
    refused(
        "replay runs/run/best.genome --steps 0 --html out.html",
        &["--steps = 0"],
    );
    refused(
        "replay runs/run/best.genome --steps 300000 --html out.html",
        &["best.genome", "20 million robot-steps"],
    );

    succeed(&evolver, "gallery runs/run");
    refused("gallery runs", &["gallery exists", "--overwrite"]);
    succeed(&evolver, "gallery runs --overwrite");
    fs::create_dir(evolver.folder().join("empty")).unwrap();
    refused("gallery empty --out new", &["no complete run in empty"]);
    refused("gallery missing --out new", &["missing"]);
    for (name, spoil) in [
        (
            "truncated",
            &(|run: &Path| fs::remove_file(run.join("final.json")).unwrap()) as &dyn Fn(&Path),
        ),
        ("unfinished", &|run| {
            fs::remove_file(run.join("DONE")).unwrap()
        }),
        ("cut", &|run| {
            let genome = fs::read(run.join("best.genome")).unwrap();
            fs::write(run.join("best.genome"), &genome[..genome.len() / 2]).unwrap();
        }),
        ("newer", &|run| {
            let text = fs::read_to_string(run.join("final.json")).unwrap();
            let newer = text.replacen("\"schema_version\": 1", "\"schema_version\": 9", 1);
            fs::write(run.join("final.json"), newer).unwrap();
        }),
    ] {
        let copy = copy_of_run(&evolver, name);
        spoil(&copy);
        let word = match name {
            "newer" => "schema version 9",
            "cut" => "best.genome",
            "truncated" => "final.json",
            _ => "DONE",
        };
        let code = if name == "unfinished" { 2 } else { 1 };
        refused_with(
            code,
            &format!("replay {name} --html out.html"),
            &[name, word],
        );
        // In a gallery, a run that cannot be shown counts as a damaged run among others.
        refused_with(1, &format!("gallery {name} --out new"), &[name, word]);
    }
    // An unfinished run among other runs is left out.
    fs::rename(
        evolver.folder().join("unfinished"),
        evolver.folder().join("runs/unfinished"),
    )
    .unwrap();
    let written = succeed(&evolver, "gallery runs --out new");
    assert!(
        written.stdout.contains("left out: 1 unfinished"),
        "{written:?}"
    );
}

fn copy_of_run(evolver: &Evolver, name: &str) -> PathBuf {
    let copy = evolver.folder().join(name);
    fs::create_dir(&copy).unwrap();
    for entry in fs::read_dir(evolver.folder().join("runs/run")).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), copy.join(entry.file_name())).unwrap();
    }
    copy
}
