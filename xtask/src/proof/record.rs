//! Result of a run of the proof, as its line has it.

use std::collections::BTreeMap;

use anyhow::{Result, anyhow};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::record::Printed;
use crate::study::record::Judged;

/// Result of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Run {
    /// Registrations of the search, with its final selections and its check; none of what was not
    /// searched.
    pub(super) registrations: u64,
    /// Origin of the parameters chosen; empty where nothing was searched.
    pub(super) origin: String,
    /// How the choice did on the pairs that no search saw: what `echoloop tune --json` calls its
    /// check; null without one.
    #[serde(default)]
    pub(super) check: Value,
    /// Processor time, s.
    pub(super) cpu_s: f64,
    /// The parameters, by name.
    pub(super) parameters: BTreeMap<String, f64>,
    /// The parameters on the held-out pairs.
    pub(super) tuned: Judged,
}

impl Run {
    /// Reads what `echoloop tune --json` or `evaluate --json` printed.
    pub(super) fn new(Printed { json, cpu_s }: &Printed) -> Result<Self> {
        let missing = |name: &str| anyhow!("the result has no {name}");
        let cpu_s = (10.0 * cpu_s).round() / 10.0;
        let is_search = json["tuned"].is_object();
        let [parameters, summary] =
            if is_search { ["tuned", "tuned_summary"] } else { ["parameters", "summary"] };
        let numbers = json[parameters].as_object().ok_or_else(|| missing(parameters))?;
        let number = |(name, value): (&String, &Value)| Some((name.clone(), value.as_f64()?));
        let tuned = Judged::new(&json[summary]).ok_or_else(|| missing(summary))?;
        Ok(Self {
            registrations: json["registrations"].as_u64().unwrap_or_default(),
            origin: json["origin"].as_str().unwrap_or_default().to_owned(),
            check: json["check"].clone(),
            cpu_s,
            parameters: numbers.iter().filter_map(number).collect(),
            tuned,
        })
    }
}

/// A result of a hundred pairs, the first of which has this error, the next one more, and so on by
/// turns.
#[cfg(test)]
pub(super) fn fixture(error: u32, worst_cm: u32) -> Run {
    let tuned = Judged {
        recall_pct: 99.0,
        mean_cm: Some(f64::from(error) / 1e3),
        worst_cm: Some(f64::from(worst_cm)),
        energy_mj: 4.6,
        errors: (0..100).map(|i| error + i % 2).collect(),
    };
    Run {
        registrations: 900,
        origin: "start".into(),
        check: Value::Null,
        cpu_s: 1.0,
        parameters: BTreeMap::new(),
        tuned,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_search_and_an_evaluation_are_read_alike() {
        let summary = json!({
            "recall_pct": 50.0, "mean_translation_m": 0.012_345, "cost": {"energy_j": 0.001},
            "errors": [
                {"frobenius": 0.5, "translation_m": 0.3},
                {"frobenius": 9.0, "translation_m": 1.5},
            ],
        });
        let parameters = json!({"lidar.power": 7.5, "lidar.timing": 1});
        let search = json!({
            "registrations": 7, "origin": "start", "tuned": parameters, "tuned_summary": summary,
        });
        let evaluation = json!({ "parameters": parameters, "summary": summary });
        let read = |json| Run::new(&Printed { json, cpu_s: 12.34 }).unwrap();
        let (searched, evaluated) = (read(search), read(evaluation));
        assert_eq!((searched.registrations, &*searched.origin, searched.cpu_s), (7, "start", 12.3));
        assert_eq!((evaluated.registrations, &*evaluated.origin), (0, ""));
        assert_eq!(searched.tuned, evaluated.tuned);
        assert_eq!(searched.parameters, evaluated.parameters);
        assert_eq!(searched.tuned.errors, [50_000, 100_000]);
        assert_eq!(searched.tuned.worst_cm, Some(150.0));
        assert!(Run::new(&Printed { json: json!({}), cpu_s: 0.0 }).is_err());
    }
}
