//! `cargo xtask patterns`: registration with each scan pattern, at equal time and at equal energy.
//!
//! The plan is `benches/plans/patterns.toml`; the table of `benches/record/data.md` is written from
//! the lines of its record alone.

use std::fmt::Write;
use std::sync::LazyLock;

use anyhow::{Context, Result, anyhow};
use echoloop_campaign::{Cell, Plan};
use echoloop_statistics::mean_of_groups;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::program::{self, Job, recorded};
use crate::record::{with_commas, write_page};

static PATTERNS: LazyLock<Plan> =
    LazyLock::new(|| Plan::read(include_str!("../../benches/plans/patterns.toml")));

const PAGE: &str = "benches/record/data.md";

/// Default power, W.
const POWER_W: f64 = 75.0;
/// Energy of a pulse by default, J: 5 ns at that power.
const PULSE_J: f64 = 375e-9;
const GRID_BEAMS: f64 = 12_288.0;
/// Greatest errors of a registration that succeeded (Sec. 4.1).
const MAX_M: f64 = 0.5;
const MAX_DEG: f64 = 2.5;

/// Patterns to run.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Patterns {
    /// Only these patterns.
    #[arg(long, value_delimiter = ',', value_parser = PATTERNS.choices("pattern"))]
    pattern: Vec<String>,
    /// Run nothing: write the table from the record.
    #[arg(long)]
    page: bool,
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Run {
    power_w: f64,
    /// Energy that a scan emits, J.
    energy_j: f64,
    /// Registrations that were tried.
    pairs: usize,
    /// Translation error of each that succeeded, mm.
    errors_mm: Vec<f64>,
}

type Line = echoloop_campaign::Line<Run>;

/// Runs what the record lacks, then writes the table.
///
/// # Errors
///
/// When runs fail, or the record cannot be read or written. Lines of finished runs are kept.
pub(crate) fn run(args: &Patterns) -> Result<()> {
    let cells = PATTERNS.cells(&[("pattern", &args.pattern)]);
    let ended = match args.page {
        true => Ok(()),
        false => {
            let job = |cell: &Cell, lines: &[Line]| {
                Ok(power(cell, lines)?.map(|more| Job::of(&PATTERNS, more)))
            };
            program::run(&PATTERNS, &cells, job, |_, _| None, |printed| Run::new(&printed.json))
        }
    };
    write_page(PAGE, "cargo xtask patterns", &table(&recorded(&PATTERNS)?))?;
    ended
}

/// Power of a run at equal energy; `None` where the pattern has no more energy than the grid.
fn power(cell: &Cell, recorded: &[Line]) -> Result<Option<Vec<String>>> {
    if cell.of("light") == "time" {
        return Ok(Some(Vec::new()));
    }
    let at_equal_time = cell.with("light", "time");
    let line = recorded.iter().find(|line| line.cell == at_equal_time);
    let beams = line.context("the run at equal time comes first")?.result.beams();
    let power_w = POWER_W * GRID_BEAMS / beams;
    Ok((beams > GRID_BEAMS).then(|| vec![format!("--set=lidar.power={power_w:.2}")]))
}

impl Run {
    /// Reads what `echoloop evaluate --json` printed.
    fn new(result: &Value) -> Result<Self> {
        let summary = &result["summary"];
        let read = || {
            let each = summary["errors"].as_array()?.iter();
            let errors =
                each.map(|e| Some([e["translation_m"].as_f64()?, e["rotation_deg"].as_f64()?]));
            let errors: Vec<[f64; 2]> = errors.collect::<Option<_>>()?;
            let power_w = result["parameters"]["lidar.power"].as_f64()?;
            Some((errors, power_w, summary["cost"]["energy_j"].as_f64()?))
        };
        let (errors, power_w, energy_j) =
            read().ok_or_else(|| anyhow!("the result is not evaluate's"))?;
        let found = errors.iter().filter(|[m, deg]| *m <= MAX_M && *deg <= MAX_DEG);
        let errors_mm = found.map(|[m, _]| (1e6 * m).round() / 1e3).collect();
        Ok(Self { power_w, energy_j, pairs: errors.len(), errors_mm })
    }

    fn beams(&self) -> f64 {
        (self.energy_j / (PULSE_J * self.power_w / POWER_W)).round()
    }

    /// Mean error over the pairs found, and their number where some are not.
    fn as_text(&self) -> String {
        let errors_cm = self.errors_mm.iter().map(|mm| mm / 10.0).collect();
        let Some(cm) = mean_of_groups(&[errors_cm]) else { return format!("0 of {}", self.pairs) };
        let found = match self.errors_mm.len() {
            all if all == self.pairs => String::new(),
            some => format!("{some} of {}, ", self.pairs),
        };
        let [low, high] = cm.interval;
        format!("{found}{:.2} ({low:.2}–{high:.2})", cm.value)
    }
}

const HEAD: &str = "
| pattern, beams a scan | method | structured | semi-structured | unstructured |
|---|---|---|---|---|
";

fn table(lines: &[Line]) -> String {
    let mut text = HEAD.to_owned();
    let methods = PATTERNS.values("method");
    let scenes: Vec<&str> = PATTERNS.names("scene").collect();
    for pattern in PATTERNS.names("pattern") {
        for light in PATTERNS.names("light") {
            let of = |method: &str, scene: &str| {
                let cell = Cell::default().with("pattern", pattern).with("light", light);
                let cell = cell.with("method", method).with("scene", scene);
                lines.iter().find(|line| line.cell == cell).map(|line| &line.result)
            };
            let run = scenes.iter().find_map(|scene| of(&methods[0].name, scene));
            let mut label = run.map(|run| match light {
                "time" => format!("`{pattern}`, {}", with_commas(run.beams(), 0)),
                _ => format!("… at the grid's energy, {:.2} W", run.power_w),
            });
            for method in methods {
                let cell = |scene: &&str| of(&method.name, scene).map_or("–".into(), Run::as_text);
                let cells: Vec<String> = scenes.iter().map(cell).collect();
                if cells.iter().any(|cell| cell != "–") {
                    let (label, name) = (label.take().unwrap_or_default(), method.title());
                    let _ = writeln!(text, "| {label} | {name} | {} |", cells.join(" | "));
                }
            }
        }
    }
    text.push('\n');
    text
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn line(pattern: &str, light: &str, beams: f64, errors_m: &[f64]) -> Line {
        let error = |m: &f64| json!({"translation_m": m, "rotation_deg": 0.1});
        let errors: Vec<Value> = errors_m.iter().map(error).collect();
        let power_w = if light == "time" { POWER_W } else { POWER_W * GRID_BEAMS / beams };
        let energy_j = beams * PULSE_J * power_w / POWER_W;
        let result = Run::new(&json!({
            "parameters": {"lidar.power": power_w},
            "summary": {"errors": errors, "cost": {"energy_j": energy_j}},
        }));
        let cell = PATTERNS.cells(&[("pattern", &[pattern.to_owned()])]).swap_remove(0);
        let cell = cell.with("light", light);
        Line { cell, made: "today".into(), result: result.unwrap() }
    }

    #[test]
    fn a_row_has_the_beams_the_mean_error_and_the_number_of_pairs_found() {
        let lines = [
            line("vlp-16", "time", 28_928.0, &[0.01, 0.01, 0.7]),
            line("vlp-16", "energy", 28_928.0, &[0.02, 0.02, 0.02]),
        ];
        let table = table(&lines);
        let rows: Vec<&str> = table.lines().skip(3).collect();
        assert_eq!(rows[0], "| `vlp-16`, 28,928 | ICP | 2 of 3, 1.00 (1.00–1.00) | – | – |");
        let energy = "| … at the grid's energy, 31.86 W | ICP | 2.00 (2.00–2.00) | – | – |";
        assert_eq!(rows[1], energy);
        assert_eq!(lines[1].result.energy_j, GRID_BEAMS * PULSE_J);
        assert_eq!(line("grid", "time", 12_288.0, &[9.0]).result.as_text(), "0 of 1");
    }
}
