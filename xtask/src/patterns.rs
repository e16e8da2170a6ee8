//! `cargo xtask patterns`: what registration gains with each scan pattern.
//!
//! A run that is done is a line of `benches/record/patterns.jsonl`; the table of
//! `benches/record/data.md` is written from those lines alone.

use std::fmt::Write;

use anyhow::{Context, Result, anyhow};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::bootstrap::mean;
use crate::record::{append, echoloop, lines, printed, stamp, write_page};
use crate::shell::{cargo, workspace};

const RECORD: &str = "benches/record/patterns.jsonl";
const PAGE: &str = "benches/record/data.md";

/// The order of the table.
const PATTERNS: [&str; 9] = [
    "grid",
    "raster",
    "livox-mid-40",
    "vlp-16",
    "vlp-32c",
    "os1-64",
    "os1-128",
    "hdl-64e",
    "vls-128",
];
const SCENES: [&str; 3] = ["structured", "semi-structured", "unstructured"];
const METHODS: [&str; 2] = ["icp", "auto"];

/// Power by default, W.
const POWER_W: f64 = 75.0;
/// A pulse by default, J: 5 ns of it.
const PULSE_J: f64 = 375e-9;
const GRID_BEAMS: f64 = 12_288.0;
/// A registration has succeeded up to these errors (Sec. 4.1).
const MOST_M: f64 = 0.5;
const MOST_DEG: f64 = 2.5;

/// Which patterns.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Patterns {
    /// Only these patterns.
    #[arg(long, value_delimiter = ',', value_parser = PATTERNS)]
    pattern: Vec<String>,
    /// Runs nothing: writes the table from the record.
    #[arg(long)]
    page: bool,
}

impl Patterns {
    fn has(&self, pattern: &str) -> bool {
        self.pattern.is_empty() || self.pattern.iter().any(|one| one == pattern)
    }
}

/// What is asked of one run.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct Asked {
    pattern: String,
    light: Light,
    method: String,
    scene: String,
}

/// What a pattern is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Light {
    /// The default power for each beam: the grid's time.
    Time,
    /// The grid's energy, over all beams.
    Energy,
}

/// A run that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    asked: Asked,
    /// Day and commit.
    made: String,
    power_w: f64,
    /// Energy that a scan emits, J.
    energy_j: f64,
    /// Registrations that were tried.
    pairs: usize,
    /// Translation error of each that succeeded, mm.
    errors_mm: Vec<f64>,
}

/// Runs what the record lacks, then writes the table.
///
/// # Errors
///
/// When a run fails, or the record cannot be read or written. What is done stays done.
pub(crate) fn run(asked: &Patterns) -> Result<()> {
    let root = workspace()?;
    let record = root.join(RECORD);
    if !asked.page {
        cargo(["build", "--release", "--package", "echoloop-app", "--bin", "echoloop"])?;
        let mut done: Vec<Line> = lines(&record)?;
        for run in PATTERNS.into_iter().filter(|name| asked.has(name)).flat_map(all_of) {
            let is_done = done.iter().any(|line| line.asked == run);
            if let Some(power_w) = power_w(&run, &done)?.filter(|_| !is_done) {
                let line = measured(run, power_w)?;
                append(&record, &line)?;
                done.push(line);
            }
        }
    }
    write_page(PAGE, "cargo xtask patterns", &table(&lines(&record)?))
}

/// All that is asked of a pattern; what has the time comes before what has the energy.
fn all_of(pattern: &str) -> impl Iterator<Item = Asked> {
    let scenes = |light| SCENES.map(|scene| METHODS.map(|m| Asked::new(pattern, light, m, scene)));
    [Light::Time, Light::Energy].into_iter().flat_map(scenes).flatten()
}

/// The power of a run, W; none where the grid's energy is no less than what there is.
fn power_w(asked: &Asked, done: &[Line]) -> Result<Option<f64>> {
    if asked.light == Light::Time {
        return Ok(Some(POWER_W));
    }
    let of_all = Asked { light: Light::Time, ..asked.clone() };
    let of_all = done.iter().find(|line| line.asked == of_all);
    let beams = of_all.context("the run at equal time comes first")?.beams();
    Ok((beams > GRID_BEAMS).then_some(POWER_W * GRID_BEAMS / beams))
}

/// One run of `echoloop evaluate`, in towns that nothing was tuned on.
fn measured(asked: Asked, power_w: f64) -> Result<Line> {
    let Asked { pattern, method, scene, .. } = &asked;
    let mut command = echoloop()?;
    command.args(["evaluate", "--json", "--seed", "51", "--scene", scene, "--method", method]);
    let sets = [
        "scene.towns=[51,52]".into(),
        "data.train_pairs=2".into(),
        "data.test_pairs=12".into(),
        format!("scanner.pattern={pattern}"),
        format!("lidar.power={power_w:.2}"),
    ];
    command.args(sets.iter().flat_map(|set| ["--set", set]));
    let result = printed(&mut command)?;
    Line::new(asked, stamp()?, power_w, &result["summary"])
}

impl Asked {
    fn new(pattern: &str, light: Light, method: &str, scene: &str) -> Self {
        let [pattern, method, scene] = [pattern, method, scene].map(String::from);
        Self { pattern, light, method, scene }
    }
}

impl Line {
    /// From what `echoloop evaluate --json` printed.
    fn new(asked: Asked, made: String, power_w: f64, summary: &Value) -> Result<Self> {
        let read = || {
            let each = summary["errors"].as_array()?.iter();
            let errors =
                each.map(|e| Some([e["translation_m"].as_f64()?, e["rotation_deg"].as_f64()?]));
            let errors: Vec<[f64; 2]> = errors.collect::<Option<_>>()?;
            Some((errors, summary["cost"]["energy_j"].as_f64()?))
        };
        let (errors, energy_j) = read().ok_or_else(|| anyhow!("the result is not evaluate's"))?;
        let found = errors.iter().filter(|[m, deg]| *m <= MOST_M && *deg <= MOST_DEG);
        let errors_mm = found.map(|[m, _]| (1e6 * m).round() / 1e3).collect();
        Ok(Self { asked, made, power_w, energy_j, pairs: errors.len(), errors_mm })
    }

    fn beams(&self) -> f64 {
        (self.energy_j / (PULSE_J * self.power_w / POWER_W)).round()
    }

    /// Mean error over those that were found, and how many these are where some are not.
    fn told(&self) -> String {
        let errors_cm = self.errors_mm.iter().map(|mm| mm / 10.0).collect();
        let Some(cm) = mean(&[errors_cm]) else { return format!("0 of {}", self.pairs) };
        let found = match self.errors_mm.len() {
            all if all == self.pairs => String::new(),
            some => format!("{some} of {}, ", self.pairs),
        };
        format!("{found}{:.2} ({:.2}–{:.2})", cm.value, cm.low, cm.high)
    }
}

const HEAD: &str = "
| pattern, beams a scan | method | structured | semi-structured | unstructured |
|---|---|---|---|---|
";

fn table(lines: &[Line]) -> String {
    let mut text = HEAD.to_owned();
    for pattern in PATTERNS {
        for light in [Light::Time, Light::Energy] {
            let of = |method: &str, scene: &str| {
                let asked = Asked::new(pattern, light, method, scene);
                lines.iter().find(|line| line.asked == asked)
            };
            let mut label =
                SCENES.iter().find_map(|scene| of(METHODS[0], scene)).map(|line| match light {
                    Light::Time => format!("`{pattern}`, {}", with_commas(line.beams())),
                    Light::Energy => format!("… at the grid's energy, {:.2} W", line.power_w),
                });
            for method in METHODS {
                let cells = SCENES.map(|scene| of(method, scene).map_or("–".into(), Line::told));
                if cells.iter().any(|cell| cell != "–") {
                    let (label, name) = (label.take().unwrap_or_default(), name(method));
                    let _ = writeln!(text, "| {label} | {name} | {} |", cells.join(" | "));
                }
            }
        }
    }
    text.push('\n');
    text
}

fn name(method: &str) -> String {
    if method == "icp" { method.to_uppercase() } else { method.to_owned() }
}

/// Thousands apart.
fn with_commas(count: f64) -> String {
    let (thousands, rest) = ((count / 1e3).floor(), count % 1e3);
    format!("{thousands},{rest:03}")
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn line(pattern: &str, light: Light, beams: f64, errors_m: &[f64]) -> Line {
        let error = |m: &f64| json!({"translation_m": m, "rotation_deg": 0.1});
        let errors: Vec<Value> = errors_m.iter().map(error).collect();
        let power_w = match light {
            Light::Time => POWER_W,
            Light::Energy => POWER_W * GRID_BEAMS / beams,
        };
        let energy_j = beams * PULSE_J * power_w / POWER_W;
        let summary = json!({"errors": errors, "cost": {"energy_j": energy_j}});
        let asked = Asked::new(pattern, light, "icp", "structured");
        Line::new(asked, "today".into(), power_w, &summary).unwrap()
    }

    #[test]
    fn a_row_has_the_beams_the_error_and_how_many_were_found() {
        let lines = [
            line("vlp-16", Light::Time, 28_928.0, &[0.01, 0.01, 0.7]),
            line("vlp-16", Light::Energy, 28_928.0, &[0.02, 0.02, 0.02]),
        ];
        let table = table(&lines);
        let rows: Vec<&str> = table.lines().skip(3).collect();
        assert_eq!(rows[0], "| `vlp-16`, 28,928 | ICP | 2 of 3, 1.00 (1.00–1.00) | – | – |");
        let energy = "| … at the grid's energy, 31.86 W | ICP | 2.00 (2.00–2.00) | – | – |";
        assert_eq!(rows[1], energy);
        assert_eq!(lines[1].energy_j, GRID_BEAMS * PULSE_J);
        assert_eq!(line("grid", Light::Time, 12_288.0, &[9.0]).told(), "0 of 1");
    }
}
