//! The baselines of a setting, as tables or as JSON.

use minimal_surprise_evolution::baseline::{Chance, ceiling, constant_fitness};
use minimal_surprise_evolution::run_files::SCHEMA_VERSION;
use minimal_surprise_evolution::settings::{Settings, add_seed, describe};
use minimal_surprise_evolution::statistics::{mean, median, quantile};
use minimal_surprise_sim::structures::Structure;
use serde_json::{Map, Value, json};

/// The baselines of a setting.
#[derive(Clone, Copy, Debug)]
pub struct Baselines<'a> {
    /// The setting.
    pub settings: &'a Settings,
    /// Random placements.
    pub placements: &'a Chance,
    /// Random genomes.
    pub genomes: &'a Chance,
}

/// Formats the baselines for users.
#[must_use]
pub fn text(baselines: &Baselines<'_>) -> String {
    let Baselines {
        settings,
        placements,
        genomes,
    } = *baselines;
    let scenario = settings.scenario();
    let mut table = super::table(&[
        "structure",
        "placements",
        "share",
        "95 %",
        "genomes",
        "share",
        "95 %",
    ]);
    for structure in Structure::ALL {
        let mut row = vec![structure.name().to_owned()];
        for chance in [placements, genomes] {
            let shares = chance.sorted_shares(structure);
            let percent = |share: f64| format!("{:.1} %", 100.0 * share);
            row.extend([
                percent(chance.named(&[structure])),
                percent(mean(&shares)),
                percent(quantile(&shares, 0.95)),
            ]);
        }
        table.add_row(row);
    }
    let fitness = genomes.sorted_fitness();
    format!(
        "{} on {}, swarm size {}, {} steps, noise {}; seed {}\n\n\
         constant prediction on random states  {:.4}\n\
         ceiling                               {:.4}\n\
         random genomes, median                {:.4}\n\
         random genomes, 95 % at most          {:.4}\n\
         random genomes, best                  {:.4}\n\n\
         {}\n\n\
         placements, genomes: states dominated by the structure, of {} random placements and of\n\
         the final states of {} random genomes; share: mean share of robots in the structure;\n\
         95 %: share that 95 % of the states do not exceed",
        describe(settings.topology()),
        scenario.grid(),
        scenario.robots(),
        scenario.steps(),
        settings.noise(),
        settings.seed(),
        constant_fitness(scenario),
        ceiling(scenario),
        median(&fitness),
        quantile(&fitness, 0.95),
        fitness.last().copied().unwrap_or(0.0),
        super::right_aligned(table, &[1, 2, 3, 4, 5, 6]),
        placements.draws(),
        genomes.draws(),
    )
}

/// Formats the baselines as JSON for other programs.
#[must_use]
pub fn json(baselines: &Baselines<'_>) -> Value {
    let Baselines {
        settings,
        placements,
        genomes,
    } = *baselines;
    let scenario = settings.scenario();
    let fitness = genomes.sorted_fitness();
    let mut object = json!({
        "schema_version": SCHEMA_VERSION,
        "topology": describe(settings.topology()),
        "grid": scenario.grid().to_string(),
        "robots": scenario.robots(),
        "steps": scenario.steps(),
        "noise": settings.noise(),
        "repetitions": settings.repetitions(),
        "constant_fitness": constant_fitness(scenario),
        "ceiling": ceiling(scenario),
        "placements": chance(placements),
        "genomes": chance(genomes),
        "genome_fitness": fitness,
    });
    add_seed(&mut object, settings.seed());
    object
}

/// Formats the structures that chance gives as JSON.
pub(super) fn chance(chance: &Chance) -> Value {
    let of = |structure: &Structure| {
        let shares = chance.sorted_shares(*structure);
        let values = json!({
            "named_share": chance.named(&[*structure]),
            "mean_share": mean(&shares),
            "median_share": median(&shares),
            "share_95": quantile(&shares, 0.95),
        });
        (structure.name().to_owned(), values)
    };
    json!({
        "draws": chance.draws(),
        "structures": Structure::ALL.iter().map(of).collect::<Map<_, _>>(),
    })
}
