//! Result of a run of the study, as its line has it.

use std::collections::BTreeMap;

use anyhow::{Context, Result, anyhow};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::record::three_digits;

/// Cap of a pair's error, ‖T − T*‖_F.
const CAP: f64 = 1.0;

/// Result of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Run {
    /// Registrations of the search, with its final selection.
    pub(super) registrations: u64,
    /// Origin of the parameters chosen.
    pub(super) origin: String,
    /// The parameters chosen, by name; older lines do not have them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) parameters: BTreeMap<String, f64>,
    /// The start on the held-out pairs.
    pub(super) start: Judged,
    /// The parameters chosen on the held-out pairs.
    pub(super) tuned: Judged,
}

/// Parameters on the held-out pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Judged {
    /// Share within the bounds of success, percent.
    pub(crate) recall_pct: f64,
    /// Mean translation error over the successes, cm.
    pub(crate) mean_cm: Option<f64>,
    /// Largest translation error, cm; older lines do not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) worst_cm: Option<f64>,
    /// Energy that a scan emits, mJ.
    pub(crate) energy_mj: f64,
    /// ‖T − T*‖_F of every pair, at most 1, in units of 10⁻⁵.
    pub(crate) errors: Vec<u32>,
}

impl Run {
    /// Reads what `echoloop tune --json` printed.
    pub(super) fn new(result: &Value) -> Result<Self> {
        let missing = |name: &str| anyhow!("the result has no {name}");
        let registrations = result["registrations"].as_u64();
        Ok(Self {
            registrations: registrations.ok_or_else(|| missing("registrations"))?,
            origin: result["origin"].as_str().ok_or_else(|| missing("origin"))?.to_owned(),
            parameters: serde_json::from_value(result["tuned"].clone())
                .context("the result's parameters")?,
            start: Judged::new(&result["default_summary"]).ok_or_else(|| missing("start"))?,
            tuned: Judged::new(&result["tuned_summary"]).ok_or_else(|| missing("tuned"))?,
        })
    }
}

impl Judged {
    /// Reads a summary that `echoloop` printed; `None` where it has not all of it.
    pub(crate) fn new(summary: &Value) -> Option<Self> {
        let errors = summary["errors"].as_array()?;
        let error = |e: &Value| Some((e["frobenius"].as_f64()?.min(CAP) * 1e5).round() as u32);
        let cm = |m: f64| (1e4 * m).round() / 100.0;
        let translations = errors.iter().filter_map(|e| e["translation_m"].as_f64());
        Some(Self {
            recall_pct: summary["recall_pct"].as_f64()?,
            mean_cm: summary["mean_translation_m"].as_f64().map(cm),
            worst_cm: translations.max_by(f64::total_cmp).map(cm),
            energy_mj: three_digits(1e3 * summary["cost"]["energy_j"].as_f64()?),
            errors: errors.iter().map(error).collect::<Option<_>>()?,
        })
    }

    /// Each pair's error, ‖T − T*‖_F, at most 1.
    pub(crate) fn losses(&self) -> Vec<f64> {
        self.errors.iter().map(|&error| f64::from(error) / 1e5).collect()
    }
}

/// An energy in the unit that leaves it digits.
pub(super) fn energy(mj: f64) -> String {
    match mj {
        mj if mj < 9.95e-5 => format!("{:.2} nJ", 1e6 * mj),
        mj if mj < 0.0995 => format!("{:.2} µJ", 1e3 * mj),
        mj => format!("{mj:.2} mJ"),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn an_energy_is_told_in_the_unit_that_leaves_it_digits() {
        assert_eq!(energy(4.61), "4.61 mJ");
        assert_eq!(energy(0.0612), "61.20 µJ");
        assert_eq!(energy(1.11e-6), "1.11 nJ");
    }

    #[test]
    fn what_a_run_prints_is_a_line_that_reads_back() {
        let summary = |scale: f64| {
            let error = |e: f64| json!({"frobenius": scale * e, "translation_m": 1.0});
            let errors = [error(0.5), error(9.0)];
            json!({
                "recall_pct": 50.0, "mean_translation_m": 0.012_345,
                "cost": {"energy_j": 0.004_608_4}, "errors": errors,
            })
        };
        let result = json!({
            "registrations": 7, "origin": "start", "tuned": {"lidar.power": 75.0},
            "default_summary": summary(1.0), "tuned_summary": summary(0.01),
        });
        let run = Run::new(&result).unwrap();
        assert_eq!(run.start.errors, [50_000, 100_000]);
        assert_eq!(run.tuned.errors, [500, 9_000]);
        assert_eq!((run.start.mean_cm, run.start.energy_mj), (Some(1.23), 4.61));
        let text = serde_json::to_string(&run).unwrap();
        assert_eq!(serde_json::from_str::<Run>(&text).unwrap(), run);
        assert!(Run::new(&json!({})).is_err());
    }
}
