//! Which parts of the settings that both together chose do the work, and which need each other.
//!
//! Of each choice one group of settings, or two, is taken back to the start, and the same held-out
//! pairs are judged again. With L the mean logarithm of the error, taking back a costs
//! Δ(a) = L(without a) − L(chosen), and a and b interact by Δ(a, b) − Δ(a) − Δ(b). Below 0 each is
//! worth less without the other, or either is enough to lose what both lose: an error counts 1 at
//! most. Above 0 either does part of what the other does.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::LazyLock;

use anyhow::Result;
use echoloop_campaign::{Cell, Line, Plan};
use echoloop_statistics::{Estimate, mean_of_groups};

use super::record::Run;
use super::table::{LEAST_RUNS, of_place};
use super::{PROOF, SHOWN, line_of};
use crate::study::table::differences;

/// The proof's plan with a record of its own.
pub(super) static TAKEN_BACK: LazyLock<Plan> = LazyLock::new(|| {
    let mut plan = Plan::read(include_str!("../../../benches/plans/proof.toml"));
    plan.record = "benches/record/proof-interactions.jsonl".into();
    plan
});

/// Axis of the groups taken back, of the cells of this record.
const WITHOUT: &str = "without";
/// Methods whose choices are taken apart.
const METHODS: [&str; 2] = ["icp", "fgr"];

/// Groups of settings, and how their names begin. A setting is of the first group that it fits.
const GROUPS: [(&str, &[&str]); 6] = [
    (
        "aim",
        &[
            "lidar.rows",
            "lidar.columns",
            "lidar.elevation",
            "lidar.azimuth",
            "lidar.tilt",
            "lidar.shots",
            "lidar.frame",
        ],
    ),
    // Samples are of the pulse: a short one needs many.
    ("pulse", &["lidar.power", "lidar.pulse", "lidar.waveform"]),
    ("gain", &["lidar.gain"]),
    ("detection", &["lidar."]),
    ("clouds", &["registration.voxel", "registration.normal", "registration.feature"]),
    ("pairing", &["registration."]),
];

/// Each group and each two of them, for each choice of both together among these cells.
pub(super) fn cells(proof: &[Cell]) -> Vec<Cell> {
    let names = GROUPS.map(|(name, _)| name);
    let mut taken: Vec<String> = names.map(str::to_owned).to_vec();
    for (k, first) in names.iter().enumerate() {
        taken.extend(names[k + 1..].iter().map(|second| format!("{first}+{second}")));
    }
    let is_chosen = |cell: &&Cell| {
        [cell.of("condition"), cell.of("tuned")] == [SHOWN, "joint"]
            && METHODS.contains(&cell.of("method"))
    };
    let chosen = proof.iter().filter(is_chosen);
    chosen.flat_map(|cell| taken.iter().map(|without| cell.with(WITHOUT, without))).collect()
}

/// True of a cell of this record.
pub(super) fn is_one(cell: &Cell) -> bool {
    !cell.of(WITHOUT).is_empty()
}

/// The search whose choice a cell takes apart.
pub(super) fn chosen(cell: &Cell) -> Cell {
    cell.without(WITHOUT)
}

/// The choice of both together with the groups of a cell as the start has them. More light than the
/// start's, which is the budget's, is not had: the power is lowered.
pub(super) fn parameters(cell: &Cell, proof: &[Line<Run>]) -> Result<BTreeMap<String, f64>> {
    let chosen = chosen(cell);
    let start = line_of(&chosen.with("tuned", "nothing"), proof)?;
    let mut parameters = line_of(&chosen, proof)?.result.parameters.clone();
    for (name, value) in &mut parameters {
        let is_taken = cell.of(WITHOUT).split('+').any(|group| group == group_of(name));
        if let Some(old) = start.result.parameters.get(name).filter(|_| is_taken) {
            *value = *old;
        }
    }
    let excess = light(&parameters) / light(&start.result.parameters);
    if excess > 1.0
        && let Some(power) = parameters.get_mut(POWER)
    {
        *power *= 0.999 / excess; // a power has finite steps: just below, not just above
    }
    Ok(parameters)
}

const POWER: &str = "lidar.power";

/// Light of a scan by its time, in any unit.
fn light(parameters: &BTreeMap<String, f64>) -> f64 {
    let of = |name: &str| parameters.get(name).copied().unwrap_or(1.0);
    let factors = ["lidar.rows", "lidar.columns", "lidar.shots", POWER, "lidar.pulse_width"];
    factors.map(of).iter().product::<f64>() / of("lidar.frame_time")
}

fn group_of(setting: &str) -> &'static str {
    let fits = |prefixes: &[&str]| prefixes.iter().any(|prefix| setting.starts_with(prefix));
    GROUPS.iter().find(|(_, prefixes)| fits(prefixes)).map_or("", |(name, _)| name)
}

/// A table for each method and kind of scene.
pub(super) fn tables(proof: &[Line<Run>], lines: &[Line<Run>]) -> String {
    let mut text = String::new();
    let all: Vec<&Line<Run>> = lines.iter().collect();
    for method in PROOF.values("method") {
        for scene in PROOF.names("scene") {
            let own = of_place(&all, &method.name, scene);
            if own.is_empty() {
                continue;
            }
            let names = GROUPS.map(|(name, _)| name);
            let head = names.join(" | ");
            let _ = write!(
                text,
                "\n#### {}, {scene}, taken back\n\n| | {head} |\n|---|{}\n",
                method.title(),
                "---|".repeat(names.len())
            );
            for (k, first) in names.iter().enumerate() {
                let entry = |(other, second): (usize, &&str)| match other {
                    other if other < k => String::new(),
                    other if other == k => cost(proof, &own, first).map_or("–".into(), ratio),
                    _ => interaction(proof, &own, [first, second]).map_or("–".into(), signed),
                };
                let entries: Vec<String> = names.iter().enumerate().map(entry).collect();
                let _ = writeln!(text, "| {first} | {} |", entries.join(" | "));
            }
        }
    }
    text + "\n"
}

/// Δ of a group: mean over the seeds, each of which is a group of pairs.
fn cost(proof: &[Line<Run>], lines: &[&Line<Run>], without: &str) -> Option<Estimate> {
    of_seeds(costs(proof, lines, without).into_values().collect())
}

/// Mean over seeds; `None` of too few to say something of others.
fn of_seeds(seeds: Vec<Vec<f64>>) -> Option<Estimate> {
    (seeds.len() >= LEAST_RUNS).then(|| mean_of_groups(&seeds)).flatten()
}

/// Interaction of two groups, of the seeds that have all three of their lines.
fn interaction(proof: &[Line<Run>], lines: &[&Line<Run>], two: [&str; 2]) -> Option<Estimate> {
    let both = costs(proof, lines, &two.join("+"));
    let [first, second] = two.map(|group| costs(proof, lines, group));
    let of_seed = |(seed, both): (String, Vec<f64>)| {
        let each = first.get(&seed)?.iter().zip(second.get(&seed)?);
        Some(both.iter().zip(each).map(|(both, (first, second))| both - first - second).collect())
    };
    of_seeds(both.into_iter().filter_map(of_seed).collect())
}

/// By seed, each pair's difference of the error's logarithm to what was chosen.
fn costs(proof: &[Line<Run>], lines: &[&Line<Run>], without: &str) -> BTreeMap<String, Vec<f64>> {
    let of_line = |line: &&Line<Run>| {
        let search = line_of(&chosen(&line.cell), proof).ok()?;
        let all = differences(&line.result.tuned, &search.result.tuned);
        Some((line.cell.of("seed").to_owned(), all))
    };
    lines.iter().filter(|line| line.cell.of(WITHOUT) == without).filter_map(of_line).collect()
}

/// A cost as the factor of the error, bold where it is significant.
fn ratio(estimate: Estimate) -> String {
    bold(&estimate, format!("× {:.2}", estimate.value.exp()))
}

/// An interaction with its sign, bold where it is significant.
fn signed(estimate: Estimate) -> String {
    bold(&estimate, format!("{:+.2}", estimate.value).replace('-', "−"))
}

fn bold(estimate: &Estimate, text: String) -> String {
    if estimate.holds(0.0) { text } else { format!("**{text}**") }
}

#[cfg(test)]
mod tests {
    use super::super::record::fixture;
    use super::*;

    fn cell(tuned: &str) -> Cell {
        let cell = PROOF.cells(&[("seed", &["7".to_owned()])]).swap_remove(0);
        cell.without("hand").with("condition", SHOWN).with("method", "icp").with("tuned", tuned)
    }

    fn line(cell: Cell, error: u32, parameters: &[(&str, f64)]) -> Line<Run> {
        let parameters = parameters.iter().map(|&(name, value)| (name.to_owned(), value));
        let result = Run { parameters: parameters.collect(), ..fixture(error, 1) };
        Line { cell, made: "today".into(), result }
    }

    #[test]
    fn of_each_choice_every_group_and_every_two_are_taken_back() {
        let all = cells(&[cell("joint"), cell("hand"), cell("joint").with("method", "mac")]);
        let names: Vec<&str> = all.iter().map(|cell| cell.of(WITHOUT)).collect();
        assert_eq!(names.len(), 6 + 15);
        assert_eq!(names[..2], ["aim", "pulse"]);
        assert!(names.contains(&"pulse+pairing") && !names.contains(&"pairing+pulse"));
    }

    #[test]
    fn a_group_taken_back_is_the_start_s_and_all_else_what_was_chosen() {
        let names = ["lidar.rows", "lidar.power", "lidar.denoise", "registration.voxel_m"];
        let with = |values: [f64; 4]| [0, 1, 2, 3].map(|k| (names[k], values[k]));
        let proof = [
            line(cell("joint"), 100, &with([2.0; 4])),
            line(cell("nothing"), 100, &with([1.0, 8.0, 1.0, 1.0])),
        ];
        let of = |without: &str| {
            let own = parameters(&cell("joint").with(WITHOUT, without), &proof).unwrap();
            names.map(|name| own[name])
        };
        assert_eq!(of("aim"), [1.0, 2.0, 2.0, 2.0]);
        assert_eq!(of("aim+pulse"), [1.0, 8.0, 2.0, 2.0]);
        assert_eq!(of("detection+clouds"), [2.0, 2.0, 1.0, 1.0]);
        // Twice the rows with the start's power would be twice its light.
        assert_eq!(of("pulse"), [2.0, 0.999 * 4.0, 2.0, 2.0]);
        let error = parameters(&cell("joint").with(WITHOUT, "aim"), &proof[..1]);
        assert!(error.unwrap_err().to_string().contains("nothing"));
    }

    #[test]
    fn what_needs_another_interacts_below_0_and_what_replaces_another_above() {
        let seeds = ["1", "2", "3"];
        let of_seeds =
            |cell: &Cell, error| seeds.map(|seed| line(cell.with("seed", seed), error, &[]));
        let proof = of_seeds(&cell("joint"), 100);
        // Without the pulse the aim is worth nothing more; the pairing alone does for the clouds.
        let taken = [
            ("aim", 400),
            ("pulse", 400),
            ("aim+pulse", 400),
            ("clouds", 100),
            ("pairing", 100),
            ("clouds+pairing", 300),
        ];
        let of = |(without, error)| of_seeds(&cell("joint").with(WITHOUT, without), error);
        let mut lines: Vec<Line<Run>> = taken.into_iter().flat_map(of).collect();
        let page = tables(&proof, &lines);
        assert!(page.contains("#### ICP, structured, taken back"), "{page}");
        assert!(page.contains("| aim | **× 3.99** | **−1.38** | – |"), "{page}");
        assert!(page.contains("| clouds |  |  |  |  | × 1.00 | **+1.10** |"), "{page}");
        lines.retain(|line| line.cell.of("seed") != "3");
        let page = tables(&proof, &lines);
        assert!(page.contains("| aim | – | – | – |"), "two seeds say nothing of others: {page}");
    }
}
