//! `cargo xtask study --front`: the front of error against energy, a run for each kind of scene.

use std::fmt::Write;

use anyhow::{Result, anyhow};
use echoloop_campaign::Line;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::record::energy;
use crate::record::three_digits;

/// Front of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Front {
    start: Point,
    /// Choice of the search before the front's.
    tuned: Point,
    /// Cheapest first.
    points: Vec<Point>,
}

/// Parameters on the held-out pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Point {
    /// Energy that a scan emits, mJ.
    energy_mj: f64,
    /// Mean ‖T − T*‖_F, none counted above 1, and its 95 % interval.
    error: [f64; 3],
    recall_pct: f64,
    median_cm: f64,
    /// The error less the start's, pair by pair, and its 95 % interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    less_start: Option<[f64; 3]>,
}

impl Front {
    /// Reads what `echoloop tune --pareto energy --json` printed.
    pub(super) fn new(result: &Value) -> Result<Self> {
        let front = &result["front"];
        let missing = |name: &str| anyhow!("the front has no {name}");
        let points = front["points"].as_array().ok_or_else(|| missing("points"))?.iter();
        let point = |point| Point::new(point).ok_or_else(|| missing("whole point"));
        Ok(Self {
            start: Point::new(&front["default"]).ok_or_else(|| missing("start"))?,
            tuned: Point::new(&front["tuned"]).ok_or_else(|| missing("choice"))?,
            points: points.map(point).collect::<Result<_>>()?,
        })
    }
}

impl Point {
    fn new(point: &Value) -> Option<Self> {
        let digits = |value: &Value| value.as_f64().map(three_digits);
        let of = |middle: &Value, interval: &Value| {
            Some([digits(middle)?, digits(&interval[0])?, digits(&interval[1])?])
        };
        let comparison = &point["comparison"];
        Some(Self {
            energy_mj: three_digits(1e3 * point["cost"]["energy_j"].as_f64()?),
            error: of(&point["error"], &point["interval"])?,
            recall_pct: point["recall_pct"].as_f64()?,
            median_cm: three_digits(100.0 * point["median_translation_m"].as_f64()?),
            less_start: of(&comparison["difference"], &comparison["interval"]),
        })
    }
}

const HEAD: &str = "\
| | energy a scan | of the start's | recall | median error | mean ‖T − T*‖ | to the start |
|---|---|---|---|---|---|---|
";

/// A table for each front.
pub(super) fn tables(lines: &[Line<Front>]) -> String {
    let mut text = String::new();
    for Line { cell, result: Front { start, tuned, points }, .. } in lines {
        let (scene, seed) = (cell.of("scene"), cell.of("seed"));
        let _ = write!(text, "\n### Front, ICP, {scene}, seed {seed}\n\n{HEAD}");
        row(&mut text, "start", start, start);
        row(&mut text, "tuned", tuned, start);
        for (i, point) in points.iter().enumerate() {
            row(&mut text, &(i + 1).to_string(), point, start);
        }
    }
    text.push('\n');
    text
}

fn row(text: &mut String, name: &str, point: &Point, start: &Point) {
    let [error, low, high] = point.error;
    let share = match start.energy_mj / point.energy_mj {
        times if times > 1.005 => format!("1/{:.0}", three_digits(times)),
        times => format!("{:.2}", 1.0 / times),
    };
    let verdict = match point.less_start {
        None => "–",
        Some([_, low, _]) if low > 0.0 => "higher",
        Some([_, _, high]) if high < 0.0 => "**lower**",
        Some(_) => "not told apart",
    };
    let _ = writeln!(
        text,
        "| {name} | {} | {share} | {:.1} % | {} cm | {error} ({low} to {high}) | {verdict} |",
        energy(point.energy_mj),
        point.recall_pct,
        point.median_cm,
    );
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use echoloop_campaign::Cell;

    #[test]
    fn a_front_is_a_table_of_its_points_with_what_they_are_to_the_start() {
        let point = |energy_j: f64, difference: [f64; 3]| {
            json!({
                "error": 0.012_345, "interval": [0.01, 0.015], "recall_pct": 97.0,
                "median_translation_m": 0.004_321, "cost": {"energy_j": energy_j},
                "comparison": {
                    "difference": difference[0], "interval": [difference[1], difference[2]],
                },
            })
        };
        let mut start = point(0.004, [0.0; 3]);
        start.as_object_mut().unwrap().remove("comparison");
        let points = [point(2e-6, [0.1, -0.1, 0.2]), point(1e-3, [-0.2, -0.3, -0.1])];
        let result = json!({"front": {"default": start, "tuned": start, "points": points}});
        let front = Front::new(&result).unwrap();
        let text = serde_json::to_string(&front).unwrap();
        assert_eq!(serde_json::from_str::<Front>(&text).unwrap(), front);
        let cell = Cell::default().with("scene", "structured").with("seed", "2");
        let page = tables(&[Line { cell, made: "today".into(), result: front }]);
        for row in [
            "| start | 4.00 mJ | 1.00 | 97.0 % | 0.432 cm | 0.0123 (0.01 to 0.015) | – |",
            "| 1 | 2.00 µJ | 1/2000 | 97.0 % | 0.432 cm | 0.0123 (0.01 to 0.015) | not told \
             apart |",
            "| 2 | 1.00 mJ | 1/4 | 97.0 % | 0.432 cm | 0.0123 (0.01 to 0.015) | **lower** |",
        ] {
            assert!(page.contains(row), "{row}\n{page}");
        }
        assert!(Front::new(&json!({})).is_err());
    }
}
