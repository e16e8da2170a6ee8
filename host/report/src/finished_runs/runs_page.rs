//! The page of several runs side by side.

use std::collections::BTreeMap;

use super::compared::{Against, Compared, ComparedRun};
use crate::sections::cost::{cells, heads};
use crate::{Costs, DifferingTable, EvaluationRow, EvaluationTable, RowKind, RunsPage};

/// The page of compared runs.
pub fn runs_page(compared: &Compared) -> RunsPage {
    let runs = &compared.runs;
    let first = runs.first().map_or("", |run| run.run.as_str());
    let names: Vec<String> = runs.iter().map(|run| run.run.clone()).collect();
    let table = |title: &str, values: &BTreeMap<String, Vec<Option<String>>>| DifferingTable {
        title: title.to_owned(),
        runs: names.clone(),
        rows: values.iter().map(|(name, values)| (name.clone(), values.clone())).collect(),
    };
    RunsPage {
        title: format!("Echoloop: {} runs compared", runs.len()),
        facts: runs.iter().map(|run| (run.run.clone(), fact(run))).collect(),
        remarks: runs.iter().filter_map(|run| remark(run, first)).collect(),
        table: EvaluationTable {
            rows: runs.iter().map(row).collect(),
            ..EvaluationTable::default()
        },
        costs: costs(runs),
        differing: vec![
            table("Settings that differ", &compared.settings),
            table("Tuned parameters that differ", &compared.parameters),
        ],
    }
}

fn fact(run: &ComparedRun) -> String {
    format!(
        "{}, {}, {}, seed {}, {} registrations, {} held-out pairs",
        run.scene, run.method, run.protocol, run.seed, run.registrations, run.pairs
    )
}

fn remark(run: &ComparedRun, first: &str) -> Option<String> {
    match &run.against_first {
        Against::OtherPairs(why) => Some(format!(
            "{} and {first} have other held-out pairs, or count success otherwise ({why}), so no \
             differences are shown.",
            run.run
        )),
        Against::Itself | Against::Paired(_) => None,
    }
}

fn row(run: &ComparedRun) -> EvaluationRow {
    let (kind, gain) = match &run.against_first {
        Against::Itself => (RowKind::Default, None),
        Against::Paired(gain) => (RowKind::Tuned, Some(**gain)),
        Against::OtherPairs(_) => (RowKind::Reference, None),
    };
    let (label, pairs, figures) = (run.run.clone(), Some(run.pairs), run.tuned);
    EvaluationRow { label, kind, pairs, figures, gain }
}

fn costs(runs: &[ComparedRun]) -> Costs {
    let row = |run: &ComparedRun| Some((run.run.clone(), cells(&run.cost?)));
    Costs {
        heads: heads(),
        rows: runs.iter().filter_map(row).collect(),
        verdict: "Of the tuned parameters, in the mean over scans of the held-out pairs.".into(),
    }
}
