//! Pictures of a run: `evolver replay` writes SVG, PNG, GIF and MP4.
//!
//! `UPDATE_SNAPSHOTS=1` rewrites the files in `snapshots/`; check them before committing.

use minimal_surprise_controller::codec::{self, CONTAINER_BYTES_MAX};
use minimal_surprise_controller::{EncodedGenome, Provenance};
use minimal_surprise_sim::Pose;
use minimal_surprise_sim::exchange::Trajectory;
use std::fs;
use std::path::{Path, PathBuf};
use tests::noisy_run::copy_noisy_run;
use tests::program::{Evolver, Finished};

/// Creates a folder with a short run in `run`.
fn with_a_run() -> Evolver {
    let evolver = Evolver::in_empty_folder();
    let short = "evolve --population 6 --generations 3 --repetitions 2 --steps 60 --robots 60 \
                 --seed 4 --out run";
    let run = evolver.run(&words(short));
    assert_eq!(run.code, Some(0), "{run:?}");
    evolver
}

fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

fn replay(evolver: &Evolver, line: &str) {
    let run = evolver.run(&words(&format!("replay {line}")));
    assert_eq!(run.code, Some(0), "{line}: {run:?}");
    assert_eq!(run.stderr, "", "{line}");
}

fn assert_refused(run: &Finished, words: &[&str]) {
    assert_ended(run, 2, words);
}

fn assert_ended(run: &Finished, code: i32, words: &[&str]) {
    assert_eq!(run.code, Some(code), "{run:?}");
    for word in words {
        assert!(run.stderr.contains(word), "no {word:?} in {run:?}");
    }
    assert_eq!(run.stderr.trim_end().lines().count(), 1, "{run:?}");
}

/// Red, green and blue values of every pixel, row by row.
#[derive(Clone, PartialEq, Eq)]
struct Pixels {
    width: usize,
    height: usize,
    rgb: Vec<[u8; 3]>,
}

impl Pixels {
    fn at(&self, x: usize, y: usize) -> [u8; 3] {
        self.rgb[y * self.width + x]
    }
}

fn png_pixels(bytes: &[u8]) -> (Pixels, Option<u32>) {
    let decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    let mut reader = decoder.read_info().expect("a PNG");
    let mut rgb = vec![0; reader.output_buffer_size().expect("it fits")];
    let info = reader.next_frame(&mut rgb).expect("a whole PNG");
    assert_eq!(info.color_type, png::ColorType::Rgb);
    let pixels = Pixels {
        width: info.width as usize,
        height: info.height as usize,
        rgb: rgb.as_chunks::<3>().0.to_vec(),
    };
    let per_metre = reader.info().pixel_dims.map(|dims| dims.xppu);
    (pixels, per_metre)
}

/// Returns every frame of a GIF as it is displayed, with the frame's duration in hundredths of a
/// second.
fn gif_frames(bytes: &[u8]) -> Vec<(Pixels, u16)> {
    let mut reader = gif::DecodeOptions::new().read_info(bytes).expect("a GIF");
    let width = usize::from(reader.width());
    let height = usize::from(reader.height());
    let palette = reader.global_palette().expect("one palette").to_vec();
    let mut seen = Pixels {
        width,
        height,
        rgb: vec![[0; 3]; width * height],
    };
    let mut frames = Vec::new();
    while let Some(frame) = reader.read_next_frame().expect("a whole GIF") {
        assert!(frame.palette.is_none(), "frames use the palette of the GIF");
        for (index, &colour) in frame.buffer.iter().enumerate() {
            if Some(colour) != frame.transparent {
                let x = usize::from(frame.left) + index % usize::from(frame.width);
                let y = usize::from(frame.top) + index / usize::from(frame.width);
                let at = 3 * usize::from(colour);
                let rgb = palette[at..at + 3].try_into().expect("three");
                seen.rgb[y * width + x] = rgb;
            }
        }
        frames.push((seen.clone(), frame.delay));
    }
    frames
}

fn snapshot(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("snapshots");
    folder.join(name)
}

/// Compares a picture in the folder with the snapshot of the same name.
fn assert_as_kept(evolver: &Evolver, name: &str) {
    let file = snapshot(name);
    let made = evolver.read(name);
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::write(&file, &made).expect("the file can be written");
    }
    let kept = fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let same = if name.ends_with(".png") {
        png_pixels(&made) == png_pixels(&kept)
    } else {
        made == kept
    };
    let there = std::env::temp_dir().join(name);
    if !same {
        fs::write(&there, &made).expect("the file can be written");
    }
    assert!(
        same,
        "{name} differs from tests/snapshots; the new picture is in {}",
        there.display()
    );
}

#[test]
fn stills_match_their_snapshots() {
    let evolver = with_a_run();
    let stills = [
        ("final-state", ""),
        (
            "robot-dark",
            "--at 30 --robot 7 --colour surprise --theme dark",
        ),
        ("damage", "--reposition 12,2,3,7 --at 20"),
    ];
    for (name, flags) in stills {
        let line = format!("run {flags} --svg {name}.svg --png {name}.png --dpi 100");
        replay(&evolver, &line);
        assert_as_kept(&evolver, &format!("{name}.svg"));
        assert_as_kept(&evolver, &format!("{name}.png"));
    }
}

#[test]
fn a_still_has_the_width_of_a_column_and_text_of_seven_points() {
    let evolver = with_a_run();
    replay(&evolver, "run --svg a.svg --png a.png");
    let svg = evolver.text("a.svg");
    assert!(svg.contains("width=\"85mm\""), "{svg:.200}");
    assert!(!svg.contains("<text"), "words are outlines");
    let (pixels, per_metre) = png_pixels(&evolver.read("a.png"));
    // 85 mm at 300 dots per inch.
    assert_eq!((pixels.width, per_metre), (1004, Some(11811)));
    replay(
        &evolver,
        "run --svg b.svg --png b.png --width-mm 170 --dpi 100",
    );
    assert!(evolver.text("b.svg").contains("width=\"170mm\""));
    let ground = pixels.at(0, 0);
    let rows = pixels.rgb.chunks_exact(pixels.width);
    let last = rows.last().expect("it has rows");
    assert!(last.iter().all(|&pixel| pixel == ground), "no grey row");
    let (pixels, per_metre) = png_pixels(&evolver.read("b.png"));
    assert_eq!((pixels.width, per_metre), (669, Some(3937)));
}

#[test]
fn predictions_and_curves_are_drawn_with_their_names_and_numbers() {
    let evolver = with_a_run();
    let shown = [
        ("predictions", &["average predictions, ", "0."][..]),
        ("temperature", &["time step", "temperature", "60", "0.1"]),
        ("fitness", &["generation", "best fitness", "0.5"]),
    ];
    for (what, words) in shown {
        replay(
            &evolver,
            &format!("run --what {what} --svg {what}.svg --png {what}.png"),
        );
        let svg = evolver.text(&format!("{what}.svg"));
        for word in words {
            let label = format!("aria-label=\"{word}");
            assert!(svg.contains(&label), "no {word:?} in {what}");
        }
        let (pixels, _) = png_pixels(&evolver.read(&format!("{what}.png")));
        assert_eq!(pixels.width, 1004, "{what}");
    }
    let predictions = evolver.text("predictions.svg");
    let averages = predictions.matches("aria-label=\"").count() - 1;
    assert_eq!(averages, 14, "number of sensors of model C");
}

const CELL: [u8; 3] = [0xf4, 0xf4, 0xf2];
const LINE: [u8; 3] = [0xdc, 0xdc, 0xd8];
const ROBOT: [u8; 3] = [0x2b, 0x2b, 0x29];

/// Reads the poses from a frame. The grid's cells have the given size in pixels, and the robots are
/// drawn plain.
fn poses_seen(frame: &Pixels, cells: (usize, usize), side: usize) -> Vec<Pose> {
    // The first pixel of the grid belongs to a grid line.
    let corner = frame.rgb.iter().position(|&colour| colour == LINE);
    let corner = corner.expect("there is a grid");
    let (west, north) = (corner % frame.width, corner / frame.width);
    let mut seen = Vec::new();
    for y in 0..cells.1 {
        for x in 0..cells.0 {
            let quarter = |right: usize, down: usize| {
                frame.at(
                    west + x * side + right * side / 4,
                    north + (cells.1 - 1 - y) * side + down * side / 4,
                )
            };
            // The order is east, north, west, south; the outline of a robot has a notch at the
            // back.
            let around = [(3, 2), (2, 1), (1, 2), (2, 3)].map(|(x, y)| quarter(x, y));
            if quarter(2, 2) == ROBOT {
                let ahead: Vec<usize> = (0..4)
                    .filter(|&heading| {
                        around[heading] == ROBOT && around[(heading + 2) % 4] == CELL
                    })
                    .collect();
                assert_eq!(ahead.len(), 1, "one way ahead at {x}, {y}: {around:?}");
                let heading = u8::try_from(ahead[0]).unwrap().try_into().unwrap();
                seen.push(Pose {
                    x: x as u16,
                    y: y as u16,
                    heading,
                });
            } else {
                assert_eq!(quarter(2, 2), CELL, "at {x}, {y}");
            }
        }
    }
    seen
}

fn by_cell(poses: &[Pose]) -> Vec<(u16, u16, u8)> {
    let mut cells: Vec<_> = poses
        .iter()
        .map(|pose| (pose.y, pose.x, pose.heading as u8))
        .collect();
    cells.sort_unstable();
    cells
}

#[test]
fn every_frame_of_a_gif_shows_the_poses_of_its_state() {
    let evolver = with_a_run();
    let exported = evolver.run(&words("export run --format trajectory --out trajectory"));
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let trajectory = Trajectory::read(&evolver.text("trajectory")).expect("a trajectory");
    // The run and its trajectory produce the same pictures.
    for from in ["run", "trajectory"] {
        replay(
            &evolver,
            &format!("{from} --gif {from}.gif --colour plain --every 25 --cell-px 20 --fps 5"),
        );
        let frames = gif_frames(&evolver.read(&format!("{from}.gif")));
        let delays: Vec<u16> = frames.iter().map(|&(_, delay)| delay).collect();
        assert_eq!(delays, [20, 20, 20, 200], "steps 0, 25, 50 and the last");
        for ((frame, _), t) in frames.iter().zip([0, 25, 50, 60]) {
            let seen = poses_seen(frame, (15, 15), 20);
            assert_eq!(
                by_cell(&seen),
                by_cell(&trajectory.states()[t]),
                "{from} {t}"
            );
        }
    }
}

#[test]
fn the_readme_opens_with_the_picture_that_its_first_commands_draw() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let readme = fs::read_to_string(root.join("README.md")).expect("the README can be read");
    let picture = readme.split_once("](docs/").expect("a picture").1;
    let picture = picture.split_once(')').expect("its end").0;
    let commands: Vec<&str> = readme
        .lines()
        .filter_map(|line| line.strip_prefix("$ cargo run --release -- "))
        .filter_map(|line| line.split('#').next())
        .take(2)
        .collect();
    let evolver = Evolver::in_empty_folder();
    for command in &commands {
        let run = evolver.run(&words(command));
        assert_eq!(run.code, Some(0), "{command}: {run:?}");
    }
    let kept = fs::read(root.join("docs").join(picture)).expect("the picture");
    assert!(
        kept == evolver.read(picture),
        "{commands:?} draw a picture different from {picture}"
    );
}

#[test]
fn an_animation_has_about_a_hundred_frames_by_default() {
    let evolver = Evolver::in_empty_folder();
    let short = "evolve --population 4 --generations 1 --repetitions 1 --steps 350 --robots 9 \
                 --grid 6x6 --out run";
    assert_eq!(evolver.run(&words(short)).code, Some(0));
    replay(&evolver, "run --gif a.gif");
    assert_eq!(gif_frames(&evolver.read("a.gif")).len(), 89, "every fourth");
    replay(&evolver, "run --gif b.gif --every 350 --colour surprise");
    // In the last state, robots have no readings that could surprise them.
    assert_eq!(gif_frames(&evolver.read("b.gif")).len(), 2);
}

#[test]
fn a_replay_is_drawn_the_same_every_time() {
    let evolver = with_a_run();
    for copy in ["a", "b"] {
        replay(
            &evolver,
            &format!("run --svg {copy}.svg --png {copy}.png --gif {copy}.gif --robot 3"),
        );
    }
    for kind in ["svg", "png", "gif"] {
        let [a, b] = ["a", "b"].map(|copy| evolver.read(&format!("{copy}.{kind}")));
        assert!(a == b, "{kind}");
    }
}

/// Installs a script as `ffmpeg` in a separate folder, and returns the folder's path.
#[cfg(unix)]
fn stand_in(evolver: &Evolver, script: &str) -> String {
    use std::os::unix::fs::PermissionsExt;
    let folder = evolver.folder().join("programs");
    fs::create_dir_all(&folder).unwrap();
    let file = folder.join("ffmpeg");
    fs::write(&file, script).unwrap();
    fs::set_permissions(&file, fs::Permissions::from_mode(0o755)).unwrap();
    folder.to_string_lossy().into_owned()
}

#[cfg(unix)]
#[test]
fn ffmpeg_gets_the_frames_of_the_gif() {
    let evolver = with_a_run();
    // The last argument is the output file; the script needs only shell builtins and programs in
    // /bin.
    let keeps = "#!/bin/sh\nfor file; do :; done\n/bin/cat > \"$file\"\n";
    let path = stand_in(&evolver, keeps);
    let flags = "replay run --gif a.gif --mp4 a.mp4 --every 20 --fps 7";
    let run = evolver.run_with(("PATH", &path), &words(flags));
    assert_eq!(run.code, Some(0), "{run:?}");
    let frames = gif_frames(&evolver.read("a.gif"));
    let piped: Vec<u8> = evolver.read("a.mp4");
    let drawn: Vec<u8> = frames
        .iter()
        .flat_map(|(frame, _)| frame.rgb.as_flattened())
        .copied()
        .collect();
    assert_eq!(frames.len(), 4);
    assert!(piped == drawn, "{} and {} bytes", piped.len(), drawn.len());
}

#[cfg(unix)]
#[test]
fn without_ffmpeg_there_is_no_mp4_and_a_message_says_what_to_install() {
    let evolver = with_a_run();
    let flags = words("replay run --mp4 a.mp4");
    let run = evolver.run_with(("PATH", "/nowhere"), &flags);
    assert_refused(
        &run,
        &["--mp4 = a.mp4", "ffmpeg", "apt-get install", "--gif"],
    );
    // No other file is written either.
    let both = words("replay run --gif a.gif --svg a.svg --mp4 a.mp4");
    let run = evolver.run_with(("PATH", "/nowhere"), &both);
    assert_refused(&run, &["--mp4 = a.mp4", "ffmpeg"]);
    for file in ["a.gif", "a.svg", "a.mp4"] {
        assert!(!evolver.folder().join(file).exists(), "{file}");
    }
    let fails = "#!/bin/sh\necho 'Unknown encoder' >&2\nexit 3\n";
    let path = stand_in(&evolver, fails);
    let run = evolver.run_with(("PATH", &path), &flags);
    assert_eq!(run.code, Some(1), "{run:?}");
    assert!(
        run.stderr.contains("ffmpeg failed: Unknown encoder"),
        "{run:?}"
    );
    assert!(!evolver.folder().join("a.mp4").exists());
}

#[test]
fn nothing_is_overwritten() {
    let evolver = with_a_run();
    for kind in ["svg", "png", "gif", "mp4"] {
        let file = format!("a.{kind}");
        evolver.write(&file, b"mine");
        let line = format!("replay run --{kind} {file}");
        let run = evolver.run(&words(&line));
        assert_refused(&run, &[&format!("--{kind} = {file}"), "exists"]);
        assert_eq!(evolver.text(&file), "mine");
    }
}

#[test]
fn requests_for_what_a_run_does_not_have_are_refused() {
    let evolver = with_a_run();
    let exported = evolver.run(&words("export run --format trajectory --out trajectory"));
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let cases: [(&str, &[&str]); 19] = [
        ("run --svg a --at 61", &["--at = 61", "0 to 60"]),
        ("run --svg a --at -1", &["--at = -1", "0 or more"]),
        ("run --svg a --at x", &["--at = x", "whole number"]),
        (
            "run --svg a --at 3 --what fitness",
            &["--at = 3", "whole run"],
        ),
        ("run --svg a --robot 60", &["--robot = 60", "0 to 59"]),
        ("run --gif a --robot 60", &["--robot = 60", "0 to 59"]),
        ("run --svg a --what damage", &["--remove", "--reposition"]),
        (
            "run --svg a --width-mm 39",
            &["--width-mm = 39", "40 to 500"],
        ),
        (
            "run --svg a --width-mm 50 --remove 0,0,3,3",
            &["--width-mm = 50", "text of this picture needs", "mm"],
        ),
        (
            "run --svg a --width-mm 40 --what predictions",
            &["--width-mm = 40", "text of this picture needs"],
        ),
        ("run --png a --dpi 0", &["--dpi = 0", "50 to 1200"]),
        (
            "run --png a --dpi 1200 --width-mm 500",
            &["23622 x", "too many"],
        ),
        ("run --gif a --cell-px 3", &["--cell-px = 3", "4 to 64"]),
        ("run --gif a --every 61", &["--every = 61", "1 to 60"]),
        ("run --gif a --fps 0", &["--fps = 0", "1 to 50"]),
        ("trajectory --svg a --robot 0", &["trajectory", "sense"]),
        (
            "trajectory --gif a --colour surprise",
            &["trajectory", "sense"],
        ),
        (
            "trajectory --svg a --what predictions",
            &["trajectory", "predict"],
        ),
        (
            "run/best.genome --svg a --what fitness",
            &["only a run directory"],
        ),
    ];
    for (line, words_of_it) in cases {
        let run = evolver.run(&words(&format!("replay {line}")));
        assert_refused(&run, words_of_it);
        assert!(!evolver.folder().join("a").exists(), "{line}");
    }
    // Flags for pictures, but no picture is requested.
    for flag in ["--at 3", "--every 2", "--what state", "--dpi 200"] {
        let run = evolver.run(&words(&format!("replay run {flag}")));
        assert_eq!(run.code, Some(2), "{run:?}");
    }
    let run = evolver.run(&words("replay run --svg no/such/folder/a.svg"));
    assert_refused(&run, &["no/such/folder/a.svg", "No such file"]);
}

#[test]
fn an_incomplete_run_directory_is_refused() {
    let evolver = with_a_run();
    let refused = |file: &str, change: &dyn Fn(&str) -> Option<String>, words_of_it: &[&str]| {
        let path = evolver.folder().join("run").join(file);
        let good = fs::read(&path).unwrap();
        match change(&String::from_utf8_lossy(&good)) {
            Some(text) => fs::write(&path, text).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        let run = evolver.run(&words("replay run --svg a.svg"));
        // If DONE is missing, the run is incomplete; if any other file is missing, the run is
        // damaged.
        let code = if file == "DONE" { 2 } else { 1 };
        assert_ended(&run, code, words_of_it);
        fs::write(&path, good).unwrap();
    };
    for file in [
        "DONE",
        "config.toml",
        "best.genome",
        "final.json",
        "generations.csv",
    ] {
        refused(file, &|_| None, &["run", "no complete run", file]);
    }
    let half = |text: &str| Some(text.chars().take(text.chars().count() / 2).collect());
    refused("final.json", &half, &["run/final.json", "line"]);
    refused("best.genome", &half, &["run/best.genome"]);
    refused("generations.csv", &half, &["generations.csv"]);
    let other = |text: &str| Some(text.replace("\"schema_version\": 1", "\"schema_version\": 9"));
    refused(
        "final.json",
        &other,
        &["run/final.json", "schema version 9"],
    );
    let still = |text: &str| Some(text.replace("steps = 60", "steps = 0"));
    refused("config.toml", &still, &["config.toml", "steps", "0"]);
    replay(&evolver, "run --svg a.svg");
}

#[test]
fn impossible_numbers_are_refused_in_every_file_of_a_run() {
    let evolver = with_a_run();
    let hash = evolver.text("run/DONE");
    let first_fitness = |value: &str| {
        let table = evolver.text("run/generations.csv");
        let (head, rest) = table.split_once('\n').expect("it has lines");
        let fields: Vec<&str> = rest.splitn(3, ',').collect();
        format!("{head}\n{},{value},{}", fields[0], fields[2])
    };
    let state = |key: &str, value: &str| {
        let mut state: serde_json::Value =
            serde_json::from_str(&evolver.text("run/final.json")).expect("it is JSON");
        let value = serde_json::from_str(value).expect("it is JSON");
        *state.pointer_mut(key).expect("it has the key") = value;
        state.to_string()
    };
    let time = |text: &str| format!("{{\"wall_s\":{text},\"cpu_s\":1,\"sittings\":1}}");
    let config = |from: &str, to: &str| evolver.text("run/config.toml").replace(from, to);
    let cases = [
        ("DONE", "zzz\n".to_owned(), "64 hexadecimal digits"),
        (
            "DONE",
            hash.replace(['0', '1'], "2"),
            "a different hash from DONE",
        ),
        ("generations.csv", first_fitness("inf"), "from 0 to 1"),
        ("generations.csv", first_fitness("NaN"), "from 0 to 1"),
        ("generations.csv", first_fitness("-1"), "from 0 to 1"),
        ("generations.csv", first_fitness("2"), "from 0 to 1"),
        (
            "final.json",
            state("/measures/movement", "-1"),
            "from 0 to 1",
        ),
        (
            "final.json",
            state("/measures/temperature/3", "2"),
            "from 0 to 1",
        ),
        (
            "final.json",
            state("/measures/temperature", "[]"),
            "number of steps",
        ),
        (
            "final.json",
            state("/average_prediction/0", "1.5"),
            "from 0 to 1",
        ),
        ("final.json", state("/average_prediction", "[]"), "sensors"),
        ("final.json", state("/repetition", "2"), "repetition"),
        ("final.json", state("/repetition", "-1"), "line 1"),
        (
            "final.json",
            state("/steps_hash_v2", "\"zzz\""),
            "64 hexadecimal digits",
        ),
        (
            "final.json",
            state("/hash", "\"zzz\""),
            "64 hexadecimal digits",
        ),
        ("time.json", time("-1"), "seconds"),
        ("time.json", time("1e300"), "seconds"),
        ("meta.json", "{}".to_owned(), "line 1"),
        (
            "config.toml",
            config("generations = 3", "generations = 2"),
            "generations",
        ),
        (
            "config.toml",
            config("noise = 0.0", "noise = nan"),
            "from 0 to 1",
        ),
    ];
    for (file, text, problem) in cases {
        let file = format!("run/{file}");
        let good = evolver.read(&file);
        assert_ne!(text.as_bytes(), good, "{file}");
        evolver.write(&file, text.as_bytes());
        let run = evolver.run(&words("replay run --what fitness --svg a.svg"));
        run.assert_failed(&[problem]);
        assert_eq!(run.stderr.lines().count(), 1, "{run:?}");
        assert!(!evolver.folder().join("a.svg").exists(), "{file}");
        evolver.write(&file, &good);
    }
    let good = evolver.read("run/best.genome");
    let genome = EncodedGenome::decode(&good).expect("it is a genome");
    let mut buffer = [0; CONTAINER_BYTES_MAX];
    let spoilt = codec::encode(
        &genome.to_genome(),
        Provenance {
            matched_bits: 3,
            scored_bits: 2,
            ..genome.provenance()
        },
        &mut buffer,
    );
    evolver.write("run/best.genome", spoilt.expect("it fits"));
    let run = evolver.run(&words("replay run --svg a.svg"));
    assert!(run.stderr.contains("more matched bits"), "{run:?}");
    let run = evolver.run(&words("inspect run"));
    assert!(run.stdout.contains("impossible (3 of 2 bits)"), "{run:?}");
    evolver.write("run/best.genome", &good);
    replay(&evolver, "run --what fitness --svg a.svg");
    evolver.write("run/DONE", b"zzz\n");
    let resumed = evolver.run(&["evolve", "--resume", "run"]);
    resumed.assert_failed(&["run/DONE", "64 hexadecimal digits"]);
}

#[test]
fn unreadable_files_are_not_reported_as_missing() {
    let evolver = with_a_run();
    let run = evolver.folder().join("run");
    let refused = |code: i32, arguments: &str, problem: &str| {
        let run = evolver.run(&words(arguments));
        assert_eq!(run.code, Some(code), "{run:?}");
        assert!(run.stderr.contains(problem), "no {problem:?}: {run:?}");
        assert!(!run.stderr.contains("it has no"), "{run:?}");
    };
    let long = "n".repeat(300);
    let export = "export --format trajectory";
    for line in [
        "classify",
        "replay --svg a",
        export,
        "gallery --out g",
        "evolve --resume",
    ] {
        refused(2, &format!("{line} nowhere"), "nowhere: No such file");
        refused(2, &format!("{line} run/DONE/x"), "Not a directory");
        refused(2, &format!("{line} {long}"), "File name too long");
    }
    for file in [
        "DONE",
        "config.toml",
        "final.json",
        "best.genome",
        "meta.json",
    ] {
        let good = evolver.read(&format!("run/{file}"));
        let path = run.join(file);
        fs::remove_file(&path).unwrap();
        fs::create_dir(&path).unwrap();
        refused(
            1,
            "replay run --svg a",
            &format!("run/{file}: Is a directory"),
        );
        fs::remove_dir(&path).unwrap();
        for wait_or_endless in ["pipe", "/dev/zero"] {
            if wait_or_endless == "pipe" {
                let made = std::process::Command::new("mkfifo").arg(&path).status();
                assert!(made.unwrap().success());
            } else {
                std::os::unix::fs::symlink(wait_or_endless, &path).unwrap();
            }
            for line in ["replay run --svg a", "classify run", "gallery run --out g"] {
                refused(1, line, &format!("run/{file}: not a plain file"));
            }
            fs::remove_file(&path).unwrap();
        }
        std::os::unix::fs::symlink(file, &path).unwrap();
        refused(
            1,
            "replay run --svg a",
            &format!("run/{file}: Too many levels"),
        );
        fs::remove_file(&path).unwrap();
        evolver.write(&format!("run/{file}"), &good);
    }
    replay(&evolver, "run --svg a");
}

#[test]
fn genomes_are_read_from_run_directories_and_export_overwrites_no_file() {
    let evolver = with_a_run();
    for line in ["inspect", "export --format c", "export --format hex"] {
        let of = |from: &str| evolver.run(&[words(line), vec![from]].concat());
        let (run, genome) = (of("run"), of("run/best.genome"));
        assert_eq!(run.code, Some(0), "{run:?}");
        assert_eq!(run.stdout, genome.stdout);
    }
    let run = evolver.run(&words("export run/best.genome --format trajectory"));
    assert_refused(&run, &["run/best.genome", "from a run directory"]);
    evolver.write("there", b"mine");
    let run = evolver.run(&words("export run --format c --out there"));
    assert_refused(
        &run,
        &["--out = there: already exists; choose a different name"],
    );
    assert_eq!(evolver.text("there"), "mine");
}

#[test]
fn a_damaged_swarm_is_named_after_its_structure_before_the_damage() {
    let evolver = with_a_run();
    let classified = evolver.run(&words("classify run --json"));
    let classified: serde_json::Value =
        serde_json::from_str(&classified.stdout).expect("it is JSON");
    let name = classified["names"][0].as_str().expect("it has a name");
    // If most of a swarm is removed, the remaining robots are too few to have a dominant structure.
    replay(&evolver, "run --remove 0,0,14,11 --svg a.svg --html a.html");
    assert!(
        evolver
            .text("a.svg")
            .contains(&format!("aria-label=\"{name} "))
    );
    assert!(
        evolver
            .text("a.html")
            .contains(&format!("\"names\":[\"{name}\""))
    );
}

#[test]
fn a_run_with_the_genome_or_the_state_of_another_run_is_refused_by_every_replay() {
    let evolver = with_a_run();
    let other = "evolve --population 6 --generations 3 --repetitions 2 --steps 60 --robots 60 \
                 --seed 5 --out other";
    assert_eq!(evolver.run(&words(other)).code, Some(0));
    let state = evolver.text("run/final.json");
    let hash_at =
        state.find("steps_hash_v2").expect("it is recorded") + "steps_hash_v2\": \"".len();
    let mut other_hash = state.clone();
    let digit = if &state[hash_at..=hash_at] == "0" {
        "1"
    } else {
        "0"
    };
    other_hash.replace_range(hash_at..=hash_at, digit);
    let steps = "best.genome does not repeat the steps recorded in final.json";
    let spoilt = [
        ("best.genome", evolver.read("other/best.genome"), steps),
        (
            "final.json",
            evolver.read("other/final.json"),
            "final.json has a different hash from DONE",
        ),
        ("final.json", other_hash.into_bytes(), steps),
    ];
    let lines = [
        "classify run",
        "damage run --area 0,0,7,7 --remove --structure clustering",
        "replay run --svg out",
        "replay run --html out",
        "replay run --remove 0,0,3,3 --svg out",
        "replay run",
        "export run --format trajectory --out out",
        "gallery run --out out",
    ];
    for (file, bytes, problem) in spoilt {
        let file = format!("run/{file}");
        let good = evolver.read(&file);
        evolver.write(&file, &bytes);
        for line in lines {
            let run = evolver.run(&words(line));
            run.assert_failed(&["error: run: ", problem]);
            assert!(!evolver.folder().join("out").exists(), "{line}");
        }
        evolver.write(&file, &good);
    }
    replay(&evolver, "run --svg out");
}

#[test]
fn a_noisy_run_of_the_first_version_is_checked_with_the_bits_that_it_hashed() {
    let evolver = Evolver::in_empty_folder();
    copy_noisy_run(&evolver.folder().join("run"));
    let lines = [
        "classify run",
        "replay run --html a.html",
        "gallery run --out gallery",
    ];
    for line in lines {
        let run = evolver.run(&words(line));
        assert_eq!(run.code, Some(0), "{line}: {run:?}");
    }
    // If the hash is declared as version 2, it belongs to a different run.
    let state = evolver.text("run/final.json");
    let state = state.replace("\"steps_hash\"", "\"steps_hash_v2\"");
    evolver.write("run/final.json", state.as_bytes());
    let run = evolver.run(&words("classify run"));
    run.assert_failed(&["error: run: best.genome", "final.json", "another"]);
}

#[test]
fn a_damaged_run_or_folder_does_not_exclude_others_from_a_gallery() {
    let evolver = with_a_run();
    let whole = evolver.read("run/final.json");
    for copy in ["cut", "loop", "good"] {
        let from = evolver.folder().join("run");
        let to = evolver.folder().join(copy);
        fs::create_dir(&to).unwrap();
        for file in fs::read_dir(from).unwrap().flatten() {
            fs::copy(file.path(), to.join(file.file_name())).unwrap();
        }
    }
    evolver.write("cut/final.json", &whole[..300]);
    let done = evolver.folder().join("loop/DONE");
    fs::remove_file(&done).unwrap();
    std::os::unix::fs::symlink("DONE", &done).unwrap();
    let gallery = evolver.run(&words("gallery . --out g"));
    assert_eq!(gallery.code, Some(1), "{gallery:?}");
    for word in ["cut/final.json", "loop/DONE: Too many levels", "2 left out"] {
        assert!(gallery.stderr.contains(word), "no {word:?}: {gallery:?}");
    }
    assert!(gallery.stdout.contains("2 runs"), "{gallery:?}");
    let pages = evolver.files();
    let pages = pages
        .iter()
        .filter(|f| f.starts_with("g/") && f.ends_with(".html"));
    assert_eq!(pages.count(), 3);
}

#[test]
fn a_trajectory_with_one_state_cannot_be_replayed() {
    let evolver = with_a_run();
    let exported = evolver.run(&words("export run --format trajectory --out trajectory"));
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let text = evolver.text("trajectory");
    let shown: String = text
        .lines()
        .take(3 + 60)
        .map(|line| format!("{line}\n"))
        .collect();
    evolver.write("one-state", shown.as_bytes());
    let run = evolver.run(&words("replay one-state --svg a.svg"));
    assert_refused(&run, &["one-state", "nothing to replay"]);
}
