//! Tests what chance gives, as printed by `baseline`, `classify` and `evaluate`.

use serde_json::Value;
use std::fs;
use tests::program::{Evolver, Finished};

fn json(run: &Finished) -> Value {
    assert_eq!(run.code, Some(0), "{run:?}");
    serde_json::from_str(&run.stdout).unwrap_or_else(|error| panic!("{error}: {run:?}"))
}

fn words(text: &str) -> Vec<&str> {
    text.split_whitespace().collect()
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("{value} is not a number"))
}

/// F₀ by the formula of `docs/measures.md`.
fn constant_fitness(cells: f64, robots: f64, noise: f64) -> f64 {
    let occupied = (robots - 1.0) / (cells - 1.0);
    let set = occupied * (1.0 - noise) + (1.0 - occupied) * noise;
    set.max(1.0 - set)
}

const SMALL: &str = "baseline --grid 9x8 --robots 20 --steps 40 --repetitions 2 --noise 0.125 \
                     --placements 60 --genomes 9 --json --seed 5";

#[test]
fn baselines_are_the_same_on_any_number_of_threads() {
    let evolver = Evolver::in_empty_folder();
    let one = json(&evolver.run(&words(&format!("{SMALL} --threads 1"))));
    let three = json(&evolver.run(&words(&format!("{SMALL} --threads 3"))));
    assert_eq!(one, three);
    assert_eq!(
        number(&one["constant_fitness"]),
        constant_fitness(72.0, 20.0, 0.125)
    );
    assert_eq!(number(&one["ceiling"]), 0.875);
    assert_eq!(one["placements"]["draws"], 60);
    assert_eq!(one["genome_fitness"].as_array().unwrap().len(), 9);
    let different = SMALL.replace("--seed 5", "--seed 6");
    let different = json(&evolver.run(&words(&different)));
    assert_ne!(
        one["placements"]["structures"],
        different["placements"]["structures"]
    );
}

#[test]
fn random_placements_on_15x15_are_groupings_and_on_20x20_dispersed() {
    let evolver = Evolver::in_empty_folder();
    let named = |grid: &str, structures: &[&str]| -> f64 {
        let flags = format!("baseline --grid {grid} --genomes 1 --steps 1 --json");
        let placements = &json(&evolver.run(&words(&flags)))["placements"]["structures"];
        let named = structures
            .iter()
            .map(|name| number(&placements[name]["named_share"]));
        named.sum()
    };
    assert!(named("15x15", &["aggregation", "clustering", "loose grouping"]) > 0.9);
    assert!(named("20x20", &["random dispersion"]) > 0.98);
}

#[test]
fn invalid_numbers_of_draws_and_settings_are_bad_input() {
    let evolver = Evolver::in_empty_folder();
    for (flags, problem) in [
        ("--placements 0", "--placements = 0"),
        ("--genomes -1", "--genomes = -1"),
        ("--genomes 1000001", "--genomes = 1000001"),
        ("--grid 3", "--grid = 3"),
        ("--robots 226", "--robots = 226"),
        ("--noise 1.5", "--noise = 1.5"),
        (
            "--grid 5000x5000 --robots 20000000 --placements 1000000",
            "memory",
        ),
    ] {
        let run = evolver.run(&[&["baseline"], words(flags).as_slice()].concat());
        assert_eq!(
            (run.code, run.stdout.as_str()),
            (Some(2), ""),
            "{flags}: {run:?}"
        );
        assert!(run.stderr.contains(problem), "{flags}: {run:?}");
    }
}

#[test]
fn classify_and_evaluate_compare_fitness_and_shares_with_chance() {
    let evolver = Evolver::in_empty_folder();
    let evolve = "evolve --population 6 --generations 3 --repetitions 2 --steps 60 --seed 4 \
                  --grid 9x8 --robots 20 --noise 0.125 --out run";
    let run = evolver.run(&words(evolve));
    assert_eq!(run.code, Some(0), "{run:?}");

    let classified = json(&evolver.run(&words("classify run --json")));
    let (baselines, fitness) = (
        &classified["baselines"],
        number(&classified["measures"]["fitness"]),
    );
    let skill = |constant: f64| (fitness - constant) / (0.875 - constant);
    let constant = constant_fitness(72.0, 20.0, 0.125);
    assert_eq!(number(&baselines["constant_fitness"]), constant);
    assert!((number(&baselines["skill"]) - skill(constant)).abs() < 1e-12);
    let of_readings = number(&baselines["constant_fitness_of_readings"]);
    assert!((0.5..1.0).contains(&of_readings));
    assert!((number(&baselines["model_gain"]) - skill(of_readings)).abs() < 1e-12);
    assert_eq!(classified["chance"]["draws"], 1000);
    for (name, structure) in classified["structures"].as_object().unwrap() {
        let p = number(&structure["p_by_chance"]);
        assert!(p > 0.0 && p <= 1.0, "{name}");
        let share = number(&structure["share"]);
        assert!(
            share > 0.0 || p == 1.0,
            "chance has at least no robot in a {name}"
        );
    }
    let text = evolver.run(&words("classify run")).stdout;
    assert!(
        text.contains("skill") && text.contains("model gain"),
        "{text}"
    );

    // A file of poses has no noise and no fitness, but its shares can be compared.
    let of_file = json(&evolver.run(&words("classify run/final.json --json")));
    assert_eq!(of_file["baselines"], Value::Null);
    assert_eq!(of_file["chance"], classified["chance"]);

    let evaluated = "evaluate run --starts 2 --noise 0,0.49 --json";
    let evaluated = json(&evolver.run(&words(evaluated)));
    let rows = evaluated["conditions"].as_array().unwrap();
    let mean = number(&rows[0]["mean_fitness"]);
    let constant = constant_fitness(72.0, 20.0, 0.0);
    let expected = (mean - constant) / (1.0 - constant);
    assert!((number(&rows[0]["skill"]) - expected).abs() < 1e-12);
    assert_eq!(rows[1]["skill"], Value::Null, "nothing can be predicted");
}

#[test]
fn the_chance_of_a_swarm_of_more_than_a_thousand_robots_is_not_computed() {
    let evolver = Evolver::in_empty_folder();
    let drawing = "▶".repeat(60) + "\n";
    fs::write(evolver.folder().join("large.txt"), drawing.repeat(60)).unwrap();
    let classified = json(&evolver.run(&words("classify large.txt --json")));
    assert_eq!(classified["chance"], Value::Null);
    let text = evolver.run(&words("classify large.txt")).stdout;
    assert!(
        text.contains("not computed for more than 1000 robots"),
        "{text}"
    );
}

const SUITE: &str = r#"
name = "two noise levels"

[[experiment]]
name = "noise"
runs = 2
grids = ["7x6"]
robots = [12]
noise = [0.0, 0.25]
population = 4
generations = 2
repetitions = 2
steps = 20
"#;

#[test]
fn a_suite_is_exported_as_tables_that_agree_with_its_runs() {
    let evolver = Evolver::in_empty_folder();
    evolver.write("own.toml", SUITE.as_bytes());
    let export = "suite own.toml export --out runs --to data --what \
                  runs,generations,steps,robots,genomes";
    let none = evolver.run(&words(export));
    assert_eq!(none.code, Some(2), "no run is finished: {none:?}");
    let run = evolver.run(&words("suite own.toml run --out runs --progress none"));
    assert_eq!(run.code, Some(0), "{run:?}");
    let exported = evolver.run(&words(export));
    assert_eq!(exported.code, Some(0), "{exported:?}");

    let data = evolver.folder().join("data");
    let package = fs::read_to_string(data.join("datapackage.json")).unwrap();
    let package: Value = serde_json::from_str(&package).unwrap();
    for (resource, rows) in
        package["resources"]
            .as_array()
            .unwrap()
            .iter()
            .zip([4, 4 * 2, 4 * 20, 4 * 20 * 12, 4])
    {
        let path = data.join(resource["path"].as_str().unwrap());
        let mut table = csv::Reader::from_path(&path).unwrap();
        let fields = resource["schema"]["fields"].as_array().unwrap();
        let names = fields.iter().map(|field| field["name"].as_str().unwrap());
        assert!(
            table.headers().unwrap().iter().eq(names),
            "{}",
            path.display()
        );
        let mut number = 0;
        for row in table.records() {
            let row = row.unwrap();
            for (field, text) in fields.iter().zip(&row) {
                let valid = match field["type"].as_str().unwrap() {
                    _ if text.is_empty() => true,
                    "integer" => text.parse::<i64>().is_ok(),
                    "number" => text.parse::<f64>().is_ok(),
                    _ => true,
                };
                assert!(valid, "{}: {field}: {text}", path.display());
            }
            number += 1;
        }
        assert_eq!(number, rows, "{}", path.display());
    }

    let twice = export.replace("--to data", "--to twice") + ",runs,steps";
    assert_eq!(evolver.run(&words(&twice)).code, Some(0));
    for file in ["runs.csv", "steps.csv", "datapackage.json"] {
        let [once, twice] =
            ["data", "twice"].map(|folder| evolver.read(&format!("{folder}/{file}")));
        assert!(once == twice, "{file}: a table named twice is written once");
    }

    let again = evolver.run(&words(export));
    assert_eq!(
        again.code,
        Some(2),
        "a directory is never overwritten: {again:?}"
    );
    let unknown = evolver.run(&words(
        "suite own.toml export --out runs --to more --what weights",
    ));
    assert_eq!(unknown.code, Some(2), "{unknown:?}");
    assert!(!evolver.folder().join("more").exists());
}

#[test]
fn one_run_is_exported_with_the_values_that_classify_prints() {
    let evolver = Evolver::in_empty_folder();
    let evolve = "evolve --population 4 --generations 2 --repetitions 2 --steps 20 --seed 4 \
                  --grid 7x6 --robots 12 --noise 0.25 --out run";
    assert_eq!(evolver.run(&words(evolve)).code, Some(0));
    let exported = evolver.run(&words("export run --format csv --to data --what runs"));
    assert_eq!(exported.code, Some(0), "{exported:?}");
    let mut table = csv::Reader::from_path(evolver.folder().join("data/runs.csv")).unwrap();
    let names = table.headers().unwrap().clone();
    let row = table.records().next().unwrap().unwrap();
    let value = |name: &str| {
        let place = names.iter().position(|column| column == name);
        row[place.unwrap_or_else(|| panic!("no column {name}"))].to_owned()
    };
    let classified = json(&evolver.run(&words("classify run --json")));
    for name in [
        "constant_fitness",
        "constant_fitness_of_readings",
        "skill",
        "model_gain",
    ] {
        let printed = &classified["baselines"][name];
        let expected = printed.as_f64().map(|number| number.to_string());
        assert_eq!(value(name), expected.unwrap_or_default(), "{name}");
    }
    assert_eq!(
        value("fitness"),
        number(&classified["measures"]["fitness"]).to_string()
    );
    assert_eq!(
        (value("run"), value("grid"), value("robots")),
        ("run".into(), "7x6".into(), "12".into())
    );
    assert_eq!(
        (value("selection"), value("crossover")),
        ("roulette".into(), "0".into())
    );

    for flags in [
        "export run --format csv",
        "export run --format c --to data2",
        "export run --format csv --to data2 --out file",
        "export run --format c --what runs",
        "export run/best.genome --format csv --to data2",
        "export run --format csv --to run/config.toml/data2",
        "export run --format csv --to data",
    ] {
        let run = evolver.run(&words(flags));
        assert_eq!(run.code, Some(2), "{flags}: {run:?}");
        assert!(!evolver.folder().join("data2").exists(), "{flags}");
    }
}
