//! `cargo xtask study`: the gain of tuning sensor, registration or both.
//!
//! The plan is `benches/plans/study.toml`. A line of its record has the error of every held-out
//! pair, and the tables of `benches/record/study.md` are written from the lines alone. `--front`
//! does the same for fronts of error against energy.

mod front;
pub(crate) mod record;
pub(crate) mod table;
mod warm;

use std::sync::LazyLock;

use anyhow::{Result, ensure};
use echoloop_campaign::{Cell, Line, Plan};

use crate::program::{self, Job, recorded};
use crate::record::write_page;
use front::Front;
use record::Run;

static STUDY: LazyLock<Plan> =
    LazyLock::new(|| Plan::read(include_str!("../../benches/plans/study.toml")));
/// The same with a front after each search.
static FRONTS: LazyLock<Plan> = LazyLock::new(|| {
    let mut plan = Plan::read(include_str!("../../benches/plans/study.toml"));
    plan.set.push("front.cost=energy".into());
    plan.record = "benches/record/fronts.jsonl".into();
    plan
});

const PAGE: &str = "benches/record/study.md";

/// Cells to run.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Study {
    /// Only these strategies.
    #[arg(long, value_delimiter = ',', default_value = "fast,paper",
          value_parser = STUDY.choices("strategy"))]
    strategy: Vec<String>,
    /// Only these protocols.
    #[arg(long, value_delimiter = ',', value_parser = STUDY.choices("protocol"))]
    protocol: Vec<String>,
    /// Only these methods.
    #[arg(long, value_delimiter = ',', value_parser = STUDY.choices("method"))]
    method: Vec<String>,
    /// Only these kinds of scene.
    #[arg(long, value_delimiter = ',', value_parser = STUDY.choices("scene"))]
    scene: Vec<String>,
    /// Only these conditions.
    #[arg(long, value_delimiter = ',', default_value = "clear",
          value_parser = STUDY.choices("condition"))]
    condition: Vec<String>,
    /// Only these seeds; the towns of a seed are its own.
    #[arg(long, value_delimiter = ',', default_value = "1,2,3,4,5",
          value_parser = clap::value_parser!(u64).range(1..))]
    seed: Vec<u64>,
    /// Fronts of error against energy instead, of these kinds and seeds.
    #[arg(long, conflicts_with_all = ["strategy", "protocol", "method", "condition"])]
    front: bool,
    /// Run nothing: write the page from the record.
    #[arg(long)]
    page: bool,
}

/// Runs the cells that the record lacks, then writes the page.
///
/// # Errors
///
/// When runs fail, which the others do not wait for, or the record cannot be read or written. Lines
/// of finished runs are kept.
pub(crate) fn run(args: &Study) -> Result<()> {
    let cells = args.cells();
    let ended = match (args.page, args.front) {
        (true, _) => Ok(()),
        (false, false) => {
            let job = |cell: &Cell, lines: &[Line<Run>]| {
                let more = warm::arguments(cell, lines)?;
                Ok(Some(Job::of(&STUDY, more)))
            };
            program::run(&STUDY, &cells, job, |_, _| None, |printed| Run::new(&printed.json))
        }
        (false, true) => {
            let job = |_: &Cell, _: &[Line<Front>]| Ok(Some(Job::of(&FRONTS, Vec::new())));
            program::run(&FRONTS, &cells, job, |_, _| None, |printed| Front::new(&printed.json))
        }
    };
    write_page(PAGE, "cargo xtask study", &table::tables(&checked(recorded(&STUDY)?)?))?;
    write_page(PAGE, "cargo xtask study --front", &front::tables(&recorded(&FRONTS)?))?;
    ended
}

impl Study {
    fn cells(&self) -> Vec<Cell> {
        let seeds: Vec<String> = self.seed.iter().map(u64::to_string).collect();
        // A front's run is that of both together by default.
        let of = |selected: &[String], front: &str| match self.front {
            true => vec![front.to_owned()],
            false => selected.to_vec(),
        };
        let cells = STUDY.cells(&[
            ("strategy", &of(&self.strategy, "fast")),
            ("protocol", &of(&self.protocol, "joint")),
            ("method", &of(&self.method, "icp")),
            ("scene", &self.scene),
            ("condition", &self.condition),
            ("seed", &seeds),
        ]);
        cells.into_iter().filter(|cell| !warm::is_in_its_own_towns(cell)).collect()
    }
}

/// Lines, each with the same pairs before and after tuning.
fn checked(lines: Vec<Line<Run>>) -> Result<Vec<Line<Run>>> {
    for (i, Line { result, .. }) in lines.iter().enumerate() {
        let pairs = [result.start.errors.len(), result.tuned.errors.len()];
        ensure!(
            pairs[0] == pairs[1] && pairs[0] > 0,
            "the study's line {}: pairs {pairs:?}",
            i + 1
        );
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        study: Study,
    }

    fn cells(flags: &[&str]) -> Vec<Cell> {
        Command::parse_from([&["study"], flags].concat()).study.cells()
    }

    #[test]
    fn all_of_it_is_every_search_of_clear_air_by_both_strategies_a_seed_after_the_other() {
        let all = cells(&[]);
        // Strategies, protocols, methods, scenes, seeds.
        assert_eq!(all.len(), 2 * 3 * 4 * 3 * 5);
        assert!(all.is_sorted_by_key(|cell| cell.of("seed")));
        assert!(all.iter().all(|cell| cell.of("condition") == "clear"));
        let once: BTreeSet<&Cell> = all.iter().collect();
        assert_eq!(once.len(), all.len(), "one comes twice");
    }

    #[test]
    fn a_part_is_what_was_asked_for_and_no_warm_start_is_of_its_own_towns() {
        let part = ["--strategy=warm", "--protocol=joint", "--method=icp", "--scene=structured"];
        let part = cells(&part);
        let seeds: Vec<&str> = part.iter().map(|cell| cell.of("seed")).collect();
        assert_eq!(seeds, ["2", "3", "4", "5"]);
        let fog = cells(&["--condition=fog", "--seed=2", "--method=mac", "--strategy=fast"]);
        assert_eq!(fog.len(), 3 * 3);
        assert!(fog.iter().all(|c| [c.of("condition"), c.of("method")] == ["fog", "mac"]));
    }

    #[test]
    fn every_committed_line_is_a_cell_of_its_plan() {
        let lines = recorded::<Run>(&STUDY).unwrap();
        assert!(lines.len() > 400, "{}", lines.len());
        for Line { cell, .. } in checked(lines).unwrap() {
            for axis in ["strategy", "protocol", "method", "scene", "condition"] {
                assert!(STUDY.names(axis).any(|value| value == cell.of(axis)), "{cell}: {axis}");
            }
        }
        let fronts = recorded::<Front>(&FRONTS).unwrap();
        let cells = cells(&["--front", "--seed=2,3"]);
        assert!(fronts.len() >= 4 && fronts.iter().all(|line| cells.contains(&line.cell)));
    }
}
