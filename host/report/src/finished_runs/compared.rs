//! Several runs side by side: figures of their tuned parameters, and differences of settings.

use std::collections::BTreeMap;

use serde::Serialize;

use super::folder::FinishedRun;
use crate::format::choice;
use echoloop_closed_loop::cost::ScanCost;
use echoloop_closed_loop::evaluation::gain::{Difference, Estimate, Figures};
use echoloop_closed_loop::parameters::written;

/// Several runs, compared with the first.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// Version of this format.
    pub format: u32,
    /// The runs, in the order given.
    pub runs: Vec<ComparedRun>,
    /// Settings that differ: a value for each run, `None` where a run has none.
    pub settings: Differing,
    /// Tuned parameters that differ, likewise.
    pub parameters: Differing,
}

/// Names, with a value for each run.
pub type Differing = BTreeMap<String, Vec<Option<String>>>;

/// One of the runs.
#[derive(Clone, Debug, Serialize)]
pub struct ComparedRun {
    /// Folder, as the user wrote it.
    pub run: String,
    /// Name of the scene.
    pub scene: String,
    /// The registration method.
    pub method: String,
    /// Tuning protocol.
    pub protocol: String,
    /// The seed.
    pub seed: u64,
    /// Number of registrations of the search.
    pub registrations: usize,
    /// Number of held-out pairs.
    pub pairs: usize,
    /// Figures of the tuned parameters on the held-out pairs.
    pub tuned: Figures<Estimate>,
    /// Mean cost of a scan with the tuned parameters.
    pub cost: Option<ScanCost>,
    /// Difference from the first run.
    pub against_first: Against,
}

/// Difference of a run from the first.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum Against {
    /// The first run itself.
    Itself,
    /// Differences pair by pair, on the same held-out pairs.
    Paired(Box<Figures<Difference>>),
    /// The held-out pairs differ.
    OtherPairs {
        /// First difference between the pairs.
        other_pairs: String,
    },
}

/// Compares runs with the first.
pub fn compared(runs: &[FinishedRun]) -> Compared {
    let tables: Vec<Settings> = runs.iter().map(settings).collect();
    let parameters: Vec<Settings> = runs.iter().map(parameters).collect();
    Compared {
        format: 1,
        runs: runs.iter().enumerate().map(|(i, run)| compared_run(run, &runs[0], i)).collect(),
        settings: differing(&tables),
        parameters: differing(&parameters),
    }
}

fn compared_run(run: &FinishedRun, first: &FinishedRun, number: usize) -> ComparedRun {
    let (result, data) = (&run.result, &run.config.data);
    let against_first = match (number, other_pairs(run, first)) {
        (0, _) => Against::Itself,
        (_, Some(other_pairs)) => Against::OtherPairs { other_pairs },
        (_, None) => Against::Paired(Box::new(Figures::between(
            &first.result.tuned_summary,
            &result.tuned_summary,
            data,
        ))),
    };
    ComparedRun {
        run: run.path.display().to_string(),
        scene: result.scene.clone(),
        method: result.method.clone(),
        protocol: result.protocol.clone(),
        seed: result.seed,
        registrations: result.registrations,
        pairs: result.tuned_summary.pairs,
        tuned: Figures::of(&result.tuned_summary, data),
        cost: result.tuned_summary.cost,
        against_first,
    }
}

/// First difference between two runs in their held-out pairs or in their bounds of success; `None`
/// where both are the same.
fn other_pairs(run: &FinishedRun, first: &FinishedRun) -> Option<String> {
    let (own, theirs) = (settings(run), settings(first));
    let decides = |key: &String| {
        let of_pairs = key == "seed" || key.starts_with("scene.") || key.starts_with("data.");
        of_pairs && key != "data.train_baseline_factor"
    };
    let keys = own.keys().chain(theirs.keys()).filter(|key| decides(key));
    let value = |of: Option<&String>| of.map_or("not set", String::as_str).to_owned();
    for key in keys {
        let (own, theirs) = (value(own.get(key)), value(theirs.get(key)));
        if own != theirs {
            return Some(format!("{key} is {own} here and {theirs} in the first"));
        }
    }
    let pairs = |run: &FinishedRun| {
        run.result.tuned_summary.errors.iter().map(|error| error.pair).collect::<Vec<_>>()
    };
    if pairs(run) != pairs(first) {
        return Some("other pairs were judged".to_owned());
    }
    // The mesh file may have changed. Without a readable journal the scenes count as equal.
    let scene = |run: &FinishedRun| run.journal().ok().map(|(header, _)| header.content.scene);
    let (own, theirs) = (scene(run)?, scene(first)?);
    (own != theirs).then(|| "the scene's file is another".to_owned())
}

/// Keys, with the section before the dot, and their values.
type Settings = BTreeMap<String, String>;

fn settings(run: &FinishedRun) -> Settings {
    let table: toml::Table = run.config_text.parse().unwrap_or_default();
    let mut settings = Settings::new();
    flatten("", &table, &mut settings);
    settings
}

/// Adds the keys of a table to `settings`, each with its section before the dot.
pub fn flatten(section: &str, table: &toml::Table, settings: &mut Settings) {
    for (key, value) in table {
        let name = if section.is_empty() { key.clone() } else { format!("{section}.{key}") };
        match value {
            toml::Value::Table(inner) => flatten(&name, inner, settings),
            toml::Value::String(text) => drop(settings.insert(name, text.clone())),
            value => drop(settings.insert(name, value.to_string())),
        }
    }
}

/// The tuned parameters as text, rounded as in files; a choice by its name.
fn parameters(run: &FinishedRun) -> Settings {
    let text = |name: &String, value: f64| match choice(name, value) {
        Some(choice) => choice.to_owned(),
        None => serde_json::to_string(&written(name, value)).unwrap_or_default(),
    };
    run.result.tuned.iter().map(|(name, value)| (name.clone(), text(name, *value))).collect()
}

/// Settings whose values differ between the tables.
fn differing(tables: &[Settings]) -> Differing {
    let names = tables.iter().flat_map(BTreeMap::keys);
    let all = names.map(|name| {
        let values = tables.iter().map(|table| table.get(name).cloned()).collect::<Vec<_>>();
        (name.clone(), values)
    });
    all.filter(|(_, values)| values.iter().any(|value| *value != values[0])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::finished_runs::tests::{finished_run, result};
    use echoloop_closed_loop::run_folder::run::RunResult;

    fn run(seed: u64, power: f64) -> FinishedRun {
        let tuned = [("lidar.denoise", 1.0), ("lidar.power", power)];
        let tuned = tuned.map(|(name, value)| (name.to_owned(), value)).into();
        finished_run(RunResult { seed, ..result("start", tuned) })
    }

    #[test]
    fn only_differences_are_listed_and_choices_by_name() {
        let mut third = run(1, 40.0);
        third.result.tuned.insert("lidar.denoise".into(), 2.0);
        third.result.tuned.insert("registration.voxel_m".into(), 0.3);
        let compared = compared(&[run(1, 40.0), run(2, 75.0), third]);
        let values = |values: [Option<&str>; 3]| values.map(|v| v.map(str::to_owned)).to_vec();
        assert_eq!(
            compared.settings.into_iter().collect::<Vec<_>>(),
            [("seed".to_owned(), values([Some("1"), Some("2"), Some("1")]))]
        );
        assert_eq!(
            compared.parameters.into_iter().collect::<Vec<_>>(),
            [
                (
                    "lidar.denoise".to_owned(),
                    values([Some("gaussian"), Some("gaussian"), Some("matched")])
                ),
                ("lidar.power".to_owned(), values([Some("40.0"), Some("75.0"), Some("40.0")])),
                ("registration.voxel_m".to_owned(), values([None, None, Some("0.3")])),
            ]
        );
    }

    #[test]
    fn differences_are_paired_only_where_the_pairs_are_the_same() {
        let mut fewer = run(1, 40.0);
        fewer.result.tuned_summary.errors.pop();
        let mut better = run(1, 75.0);
        better.result.tuned_summary.errors.iter_mut().for_each(|e| e.translation_m = 0.05);
        let compared = compared(&[run(1, 40.0), run(2, 75.0), fewer, better]);
        let against = |i: usize| compared.runs[i].against_first.clone();
        assert!(matches!(against(0), Against::Itself));
        assert!(matches!(against(1), Against::OtherPairs { other_pairs }
            if other_pairs == "seed is 2 here and 1 in the first"));
        assert!(matches!(against(2), Against::OtherPairs { other_pairs }
            if other_pairs.contains("other pairs")));
        let Against::Paired(differences) = against(3) else { panic!("{:?}", against(3)) };
        assert!(differences.mean_translation_m.is_shown && !differences.recall_pct.is_shown);
        let json = serde_json::to_value(&compared).unwrap();
        assert!(json["runs"][0]["against_first"].is_null());
        assert_eq!(json["runs"][3]["against_first"]["mean_translation_m"]["is_shown"], true);
    }
}
