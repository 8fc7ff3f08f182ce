//! The paper's main findings, compared with our runs.

use super::gather::{Gathered, GatheredRun, Group, GroupChance, Resilient, regained};
use super::paper::{PaperValues, is_grouping};
use super::statistics::{Interval, RUNS_MIN, Test, fisher, mann_whitney, median_interval, sign};
use super::tables::MEDIAN_BEST_FITNESS;
use minimal_surprise_evolution::statistics::{mean, median};
use minimal_surprise_sim::structures::{LineOrientation, Structure};
use serde::{Serialize, Serializer};
use std::collections::BTreeSet;

/// Maximum difference between a median best fitness and the paper's.
const FITNESS_TOLERANCE: f64 = 0.03;
/// Margin for floating-point error: printed numbers that differ by exactly the tolerance are
/// accepted.
const PRINTED: f64 = 1e-9;

/// Verdict on a finding of the paper in our runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The finding holds.
    Holds,
    /// The finding holds, but random placements or random genomes give as much.
    #[serde(rename = "holds, but chance gives as much")]
    HoldsAsByChance,
    /// The tendency exists, but may be due to chance.
    #[serde(rename = "holds, not significant")]
    HoldsNotSignificantly,
    /// The finding does not hold.
    Differs,
    /// There are too few finished runs to decide.
    #[serde(rename = "not enough runs")]
    NotEnoughRuns,
}

impl Verdict {
    /// Returns the verdict's text.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::HoldsAsByChance => "holds, but chance gives as much",
            Self::HoldsNotSignificantly => "holds, not significant",
            Self::Differs => "differs",
            Self::NotEnoughRuns => "not enough runs",
        }
    }
}

/// Evidence for a verdict, in addition to the finding itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Detail {
    /// No further evidence.
    None,
    /// The runs that contradict the claim.
    Contradicted(Vec<Contradiction>),
    /// A description of the result for all runs of a damaged structure.
    Damaged(String),
}

/// A run that contradicts a finding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contradiction {
    /// Seed of the run.
    pub seed: u64,
    /// Run ID.
    pub run: String,
    /// Structures and fitness of the run.
    pub formed: String,
}

impl Detail {
    /// Describes the evidence; `text` and `code` format text and code.
    pub fn in_words(&self, text: fn(&str) -> String, code: fn(&str) -> String) -> String {
        let runs = match self {
            Self::None => return String::new(),
            Self::Damaged(words) => return text(words),
            Self::Contradicted(runs) => runs,
        };
        let words = runs.iter().map(|run| {
            let Contradiction { seed, run, formed } = run;
            format!("seed {seed} ({}), {}", code(run), text(formed))
        });
        let words: Vec<String> = words.collect();
        match words.as_slice() {
            [one] => format!("Contradicted by {one}"),
            more => format!("Contradicted by {} runs: {}", more.len(), more.join("; ")),
        }
    }
}

/// The form written to `findings.csv`.
impl Serialize for Detail {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.in_words(str::to_owned, |run| format!("`{run}`")))
    }
}

/// A finding of the paper and the result in our runs.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// The paper's finding.
    pub claim: String,
    /// The result in our runs.
    pub ours: String,
    /// Evidence for the verdict.
    pub detail: Detail,
    /// The test, or the criterion of the verdict.
    pub test: String,
    /// The test's p-value, if it has one.
    pub p: Option<f64>,
    /// The verdict.
    pub verdict: Verdict,
}

impl Finding {
    /// Changes the verdict of a finding that holds if chance gives as much.
    fn or_by_chance(mut self, as_much: bool) -> Self {
        if as_much
            && matches!(
                self.verdict,
                Verdict::Holds | Verdict::HoldsNotSignificantly
            )
        {
            self.verdict = Verdict::HoldsAsByChance;
        }
        self
    }

    /// Replaces the result if a group has no runs.
    fn about(mut self, groups: &[&Group]) -> Self {
        if groups.iter().any(|group| group.runs.is_empty()) {
            self.ours = "no runs yet".to_owned();
            self.p = None;
        }
        self
    }
}

/// Compares the share of runs dominated by some structures with the shares that chance gives. The
/// finding holds beyond chance if the share is significantly larger than in random placements and
/// in the final states of random genomes.
fn beyond_chance(mut finding: Finding, group: &Group, structures: &[Structure]) -> Finding {
    let Some(chance) = group.chance.as_ref().filter(|_| !group.runs.is_empty()) else {
        return finding;
    };
    let runs = group.runs.len() as u32;
    let named = count(group, |run| is_named(run, structures));
    let mut as_much = false;
    for (kind, chance) in chance.kinds() {
        let (draws, share) = (chance.draws() as u32, chance.named(structures));
        let by_chance = (share * f64::from(draws)).round() as u32;
        let test = fisher(&[named, runs - named], &[by_chance, draws - by_chance]);
        let more = f64::from(named) / f64::from(runs) > share;
        as_much |= !more || test.compatible();
        finding.ours += &format!("; by chance in {:.0} % of {kind}", 100.0 * share);
    }
    finding.or_by_chance(as_much)
}

/// Looks up the groups of a finding; `None` if one is not in the plan.
fn groups<'a, const N: usize>(
    gathered: &'a Gathered,
    wanted: [(&str, &str); N],
) -> Option<[&'a Group; N]> {
    let found: Option<Vec<&Group>> = wanted
        .into_iter()
        .map(|(experiment, label)| gathered.group(experiment, label))
        .collect();
    found?.try_into().ok()
}

/// Returns the verdict on a statement about all runs; a single run can contradict such a statement.
fn universal(groups: &[&Group], is_true: bool) -> Verdict {
    if !is_true && groups.iter().all(|group| !group.runs.is_empty()) {
        Verdict::Differs
    } else if is_true && groups.iter().all(|group| group.is_complete()) {
        Verdict::Holds
    } else {
        Verdict::NotEnoughRuns
    }
}

/// Returns the verdict on a statement about a tendency; a false statement counts as different only
/// if the test is significant.
fn tendency(groups: &[&Group], is_true: bool, test: Test) -> Verdict {
    let complete = groups.iter().all(|group| group.is_complete());
    if groups.iter().any(|group| group.runs.is_empty()) {
        Verdict::NotEnoughRuns
    } else if is_true && !test.compatible() {
        Verdict::Holds
    } else if is_true && complete {
        Verdict::HoldsNotSignificantly
    } else if !is_true && !test.compatible() {
        Verdict::Differs
    } else {
        Verdict::NotEnoughRuns
    }
}

fn count(group: &Group, is: impl Fn(&GatheredRun) -> bool) -> u32 {
    group.runs.iter().filter(|run| is(run)).count() as u32
}

fn is_named(run: &GatheredRun, structures: &[Structure]) -> bool {
    run.name().is_some_and(|name| structures.contains(&name))
}

/// Returns the runs that do not satisfy a condition.
fn others(group: &Group, is: impl Fn(&GatheredRun) -> bool) -> Detail {
    let others = group.runs.iter().filter(|run| !is(run)).map(|run| {
        let mut shares: Vec<_> = Structure::ALL.into_iter().zip(run.shares).collect();
        shares.retain(|(_, share)| *share > 0.0);
        shares.sort_by(|(_, one), (_, two)| two.total_cmp(one));
        let shares = shares
            .iter()
            .map(|(structure, share)| format!("{structure} {:.0} %, ", 100.0 * share));
        Contradiction {
            seed: run.finished.settings.seed(),
            run: run.id.clone(),
            formed: format!("{}fitness {:.3}", shares.collect::<String>(), run.fitness()),
        }
    });
    let others: Vec<Contradiction> = others.collect();
    if others.is_empty() {
        Detail::None
    } else {
        Detail::Contradicted(others)
    }
}

/// Formats a count, such as "12 of 20 runs", with the number of planned runs if some are missing.
fn of_runs(number: u32, group: &Group) -> String {
    format!("{number} of {} runs{}", group.runs.len(), unfinished(group))
}

/// Formats the number of planned runs, if some are not finished.
fn unfinished(group: &Group) -> String {
    if group.is_complete() {
        String::new()
    } else {
        format!(" ({} planned)", group.planned)
    }
}

/// Returns all findings that are about experiments in the plan.
#[must_use]
pub fn all(gathered: &Gathered, paper: &PaperValues) -> Vec<Finding> {
    if paper.distributions.is_empty() {
        return Vec::new();
    }
    let mut findings = Vec::new();
    findings.extend(model_b(gathered));
    findings.extend(many_structures(gathered));
    findings.extend(densities(gathered));
    findings.extend(predefined(gathered));
    findings.extend(partly_predefined(gathered, paper));
    findings.extend(horizontal(gathered));
    for resilient in &gathered.resiliences {
        findings.extend(resilience(resilient));
    }
    findings.extend(noise(gathered));
    findings.extend(fitness(gathered, paper));
    findings
}

fn model_b(gathered: &Gathered) -> Option<Finding> {
    let [group] = groups(gathered, [("sensor-models", "B, 20x20")])?;
    let structures = [Structure::Line, Structure::Pair];
    let is = |run: &GatheredRun| is_named(run, &structures);
    let named = count(group, is);
    let number = group.runs.len() as u32 - named;
    let test = fisher(&[named, number], &[group.planned as u32, 0]);
    Some(beyond_chance(
        Finding {
            claim: "Sensor model B on 20 × 20 gives only lines and pairs".into(),
            detail: others(group, is),
            ours: format!("lines or pairs in {}", of_runs(named, group)),
            test: format!("every run; against the paper {}", test.name),
            p: Some(test.p),
            verdict: universal(&[group], number == 0),
        }
        .about(&[group]),
        group,
        &structures,
    ))
}

fn many_structures(gathered: &Gathered) -> Vec<Finding> {
    let of_grid = |grid: &str| {
        let [group] = groups(gathered, [("sensor-models", format!("C, {grid}").as_str())])?;
        let names: BTreeSet<&str> = group
            .runs
            .iter()
            .filter_map(|run| run.name().map(Structure::name))
            .collect();
        let enough = names.len() >= 4;
        // As many draws as runs, again and again: the share of samples with four or more structures.
        let mut as_much = false;
        let mut by_chance = String::new();
        for (kind, chance) in group.chance.iter().flat_map(GroupChance::kinds) {
            let samples = chance.states.chunks_exact(group.runs.len().max(1));
            let of = samples.len();
            let many = samples.filter(|states| {
                let names = states.iter().filter_map(|state| state.names.first());
                names.map(|name| name.name()).collect::<BTreeSet<_>>().len() >= 4
            });
            let many = many.count();
            as_much |= many * 20 >= of;
            by_chance += &format!("; {many} of {of} samples of {kind} have four or more");
        }
        let finding = Finding {
            claim: format!("Sensor model C gives four or more structures on {grid}"),
            detail: Detail::None,
            ours: format!(
                "{} in {}: {}{by_chance}",
                names.len(),
                group.counted(),
                names.into_iter().collect::<Vec<_>>().join(", ")
            ),
            test: "number of dominant structures".into(),
            p: None,
            verdict: match (enough, group.is_complete()) {
                (true, _) => Verdict::Holds,
                (false, true) => Verdict::Differs,
                (false, false) => Verdict::NotEnoughRuns,
            },
        };
        Some(finding.or_by_chance(as_much))
    };
    ["15x15", "20x20"].into_iter().filter_map(of_grid).collect()
}

/// Returns the finding that some structures dominate more than half of the runs.
fn most(group: &Group, claim: &str, what: &str, structures: &[Structure]) -> Finding {
    let named = count(group, |run| is_named(run, structures));
    let others = group.runs.len() as u32 - named;
    let test = sign(named, others);
    let finding = Finding {
        claim: claim.into(),
        detail: Detail::None,
        ours: format!("{what} in {}", of_runs(named, group)),
        test: format!("{} against one half", test.name),
        p: Some(test.p),
        verdict: tendency(&[group], named > others, test),
    }
    .about(&[group]);
    beyond_chance(finding, group, structures)
}

/// Returns the structures that count as groupings.
fn groupings() -> Vec<Structure> {
    Structure::ALL
        .into_iter()
        .filter(|s| is_grouping(*s))
        .collect()
}

fn densities(gathered: &Gathered) -> Vec<Finding> {
    let Some([dense, sparse]) = groups(
        gathered,
        [("densities", "C, 15x15"), ("densities", "C, 20x20")],
    ) else {
        return Vec::new();
    };
    let loose = [
        Structure::Line,
        Structure::Pair,
        Structure::RandomDispersion,
    ];
    vec![
        most(
            dense,
            "Grouping dominates on 15 × 15",
            "grouping",
            &groupings(),
        ),
        most(
            sparse,
            "Dispersion, lines and pairs dominate on 20 × 20",
            "dispersion, lines or pairs",
            &loose,
        ),
    ]
}

fn predefined(gathered: &Gathered) -> Vec<Finding> {
    let wanted = [
        ("predefined", "C, 15x15, line predefined"),
        ("predefined", "C, 20x20, line predefined"),
    ];
    let Some([dense, sparse]) = groups(gathered, wanted) else {
        return Vec::new();
    };
    let every = |group: &&Group| {
        let is = |run: &GatheredRun| is_named(run, &[Structure::Line]);
        let lines = count(group, is);
        let number = group.runs.len() as u32 - lines;
        let test = fisher(&[lines, number], &[group.planned as u32, 0]);
        let finding = Finding {
            claim: format!(
                "Predefined lines give lines in every run on {}",
                group.settings.scenario().grid()
            ),
            detail: others(group, is),
            ours: format!("lines in {}", of_runs(lines, group)),
            test: format!("every run; against the paper {}", test.name),
            p: Some(test.p),
            verdict: universal(&[group], number == 0),
        }
        .about(&[group]);
        beyond_chance(finding, group, &[Structure::Line])
    };
    let mut findings: Vec<Finding> = [dense, sparse].iter().map(every).collect();
    let shares = [dense, sparse].map(|group| group.values(|run| run.share(Structure::Line)));
    let test = mann_whitney(&shares[1], &shares[0]);
    findings.push(
        Finding {
            claim: "Predefined lines hold a larger share of the robots on 20 × 20 than on 15 × 15"
                .into(),
            detail: Detail::None,
            ours: format!(
                "medians {:.1} % ({}) and {:.1} % ({})",
                100.0 * median(&shares[1]),
                sparse.counted(),
                100.0 * median(&shares[0]),
                dense.counted()
            ),
            test: test.name.into(),
            p: Some(test.p),
            verdict: tendency(
                &[dense, sparse],
                median(&shares[1]) > median(&shares[0]),
                test,
            ),
        }
        .about(&[dense, sparse]),
    );
    findings
}

fn partly_predefined(gathered: &Gathered, paper: &PaperValues) -> Vec<Finding> {
    let of_grid = |raised: &super::paper::Raised| {
        let grid = &raised.grid;
        let [free, partly] = groups(
            gathered,
            [
                ("densities", format!("C, {grid}").as_str()),
                (
                    "partly-predefined",
                    format!("C, {grid}, line partly predefined").as_str(),
                ),
            ],
        )?;
        let lines = [free, partly].map(|g| count(g, |run| is_named(run, &[Structure::Line])));
        let runs = [free, partly].map(|group| group.runs.len() as u32);
        let percent =
            |index: usize| 100.0 * f64::from(lines[index]) / f64::from(runs[index].max(1));
        let test = fisher(
            &[lines[0], runs[0] - lines[0]],
            &[lines[1], runs[1] - lines[1]],
        );
        Some(Finding {
            claim: format!(
                "Partly predefining raises the share of line runs on {grid} (paper: by {} points)",
                raised.points
            ),
            detail: Detail::None,
            ours: format!(
                "by {:+.0} points, from {:.0} % ({}) to {:.0} % ({})",
                percent(1) - percent(0),
                percent(0),
                free.counted(),
                percent(1),
                partly.counted()
            ),
            test: test.name.into(),
            p: Some(test.p),
            verdict: tendency(&[free, partly], percent(1) > percent(0), test),
        }.about(&[free, partly]))
    };
    paper.raised.iter().filter_map(of_grid).collect()
}

fn horizontal(gathered: &Gathered) -> Option<Finding> {
    let [group] = groups(gathered, [("geometry", "C, 11x18, line predefined")])?;
    let [horizontal, vertical] = [
        LineOrientation::MostlyHorizontal,
        LineOrientation::MostlyVertical,
    ]
    .map(|orientation| count(group, |run| run.lines.orientation() == Some(orientation)));
    let test = sign(horizontal, vertical);
    Some(
        Finding {
            claim: "11 × 18 favours horizontal over vertical lines".into(),
            detail: Detail::None,
            ours: format!(
                "mostly horizontal in {horizontal}, mostly vertical in {}",
                of_runs(vertical, group)
            ),
            test: test.name.into(),
            p: Some(test.p),
            verdict: tendency(&[group], horizontal > vertical, test),
        }
        .about(&[group]),
    )
}

fn resilience(resilient: &Resilient) -> Vec<Finding> {
    let of_kind = |kind: &str| {
        let claim = format!(
            "After {kind} the share in the structure at the end is at least the share at the start \
             ({})",
            resilient.structure
        );
        let Some(damaged) = &resilient.damaged else {
            return Finding {
                claim,
                detail: Detail::None,
                ours: format!("the structure dominates none of {}", resilient.counted()),
                test: "mean shares".into(),
                p: None,
                verdict: Verdict::NotEnoughRuns,
            };
        };
        let rows: Vec<_> = damaged
            .areas
            .iter()
            .map(|area| {
                let removed = kind == "removal";
                let row = if removed {
                    &area.removed
                } else {
                    &area.repositioned
                };
                (area.name, row)
            })
            .collect();
        let pairs = rows
            .iter()
            .flat_map(|(_, row)| row.share_end.iter().zip(&row.share_start));
        let (mut gained, mut lost) = (0, 0);
        for (end, start) in pairs {
            gained += u32::from(end > start);
            lost += u32::from(end < start);
        }
        let test = sign(gained, lost);
        let words = rows.iter().map(|(name, row)| {
            format!(
                "{name} {:.1} → {:.1} %",
                100.0 * mean(&row.share_start),
                100.0 * mean(&row.share_end)
            )
        });
        Finding {
            claim,
            detail: resilient
                .all_damaged()
                .map_or(Detail::None, Detail::Damaged),
            ours: words.collect::<Vec<_>>().join(", "),
            test: format!("mean shares of each area; {} of the runs", test.name),
            p: Some(test.p),
            verdict: if rows.len() < resilient.asked.robots_in_areas.len() {
                Verdict::NotEnoughRuns
            } else if rows.iter().all(|(_, row)| regained(row) >= 0.0) {
                Verdict::Holds
            } else {
                Verdict::Differs
            },
        }
    };
    vec![of_kind("removal"), of_kind("repositioning")]
}

fn noise(gathered: &Gathered) -> Vec<Finding> {
    let Some([dense, sparse]) = groups(
        gathered,
        [
            ("noise", "C, 15x15, 15 % noise"),
            ("noise", "C, 20x20, 15 % noise"),
        ],
    ) else {
        return Vec::new();
    };
    let is = |run: &GatheredRun| is_named(run, &[Structure::RandomDispersion]);
    let dispersed = count(sparse, is);
    let number = sparse.runs.len() as u32 - dispersed;
    let test = fisher(&[dispersed, number], &[sparse.planned as u32, 0]);
    let only = Finding {
        claim: "With 15 % noise 20 × 20 gives only dispersion".into(),
        detail: others(sparse, is),
        ours: format!("random dispersion in {}", of_runs(dispersed, sparse)),
        test: format!("every run; against the paper {}", test.name),
        p: Some(test.p),
        verdict: universal(&[sparse], number == 0),
    }
    .about(&[sparse]);
    vec![
        beyond_chance(only, sparse, &[Structure::RandomDispersion]),
        most(
            dense,
            "With 15 % noise 15 × 15 gives mostly grouping",
            "grouping",
            &groupings(),
        ),
    ]
}

/// Returns a finding for every setting whose median best fitness is in the paper.
fn fitness(gathered: &Gathered, paper: &PaperValues) -> Vec<Finding> {
    let of_group = |group: &Group| {
        let number = paper.number(&group.experiment, &group.label, MEDIAN_BEST_FITNESS)?;
        let values = group.values(GatheredRun::fitness);
        let ours = median(&values);
        let interval = median_interval(&values);
        let near = (ours - number.value).abs() <= FITNESS_TOLERANCE + PRINTED;
        // The verdict is certain if the interval is entirely within or entirely outside the
        // tolerance.
        let sure = values.len() >= RUNS_MIN
            && interval.is_some_and(|interval| {
                let ends = [interval.low, interval.high];
                let nearer = ends.map(|end| (end - number.value).abs() <= FITNESS_TOLERANCE);
                nearer[0] == nearer[1]
            });
        Some(Finding {
            claim: format!(
                "Median best fitness within {FITNESS_TOLERANCE} of the paper's {} ({}: {}, {})",
                number.value, group.experiment, group.label, number.source
            ),
            detail: Detail::None,
            ours: match interval {
                _ if values.is_empty() => "no runs yet".to_owned(),
                None => format!("{ours:.3}, {}", group.counted()),
                Some(Interval { low, high }) => {
                    format!("{ours:.3} ({low:.3} to {high:.3}), {}", group.counted())
                }
            },
            test: "distance; bootstrap 95 % interval".into(),
            p: None,
            verdict: match (near, group.is_complete() || sure) {
                _ if values.is_empty() => Verdict::NotEnoughRuns,
                (true, true) => Verdict::Holds,
                (false, true) => Verdict::Differs,
                (_, false) => Verdict::NotEnoughRuns,
            },
        })
    };
    gathered.groups.iter().filter_map(of_group).collect()
}
