//! Table of every parameter: name, range, default, unit and where it acts.

use echoloop_registration::Method;

use super::{axes, choices, written};
use crate::config::preset::Preset;

/// A parameter, its numbers in its unit.
struct Row {
    name: String,
    unit: &'static str,
    min: f64,
    max: f64,
    default: Option<f64>,
    acts_in: &'static str,
    /// Names of a choice; empty for a number.
    choices: &'static [&'static str],
}

/// The firmware's parameters, then the method's.
fn rows(method: Method, preset: Preset) -> Vec<Row> {
    let lidar = echoloop_dsp::PARAMETERS.iter().map(|p| {
        let name = format!("lidar.{}", p.name);
        Row {
            choices: choices(&name),
            name,
            unit: p.unit,
            min: p.to_unit(p.min),
            max: p.to_unit(p.max),
            default: p.default.map(|code| p.to_unit(code)),
            acts_in: p.acts_in,
        }
    });
    let registration = axes(method, preset).into_iter().map(|a| Row {
        name: a.name.to_owned(),
        unit: a.unit,
        min: a.min,
        max: a.max,
        default: Some(a.default),
        acts_in: method.name(),
        choices: &[],
    });
    lidar.chain(registration).collect()
}

/// The table as aligned text.
pub fn parameter_table(method: Method, preset: Preset) -> String {
    let mut text = format!(
        "{:<34} {:>8} {:>8} {:>8}  {:<14} acts in\n",
        "parameter", "min", "max", "default", "unit"
    );
    for Row { name, unit, min, max, default, acts_in, choices } in rows(method, preset) {
        if !choices.is_empty() {
            let chosen = default.and_then(|code| choices.get(code as usize)).unwrap_or(&"follows");
            text += &format!(
                "{name:<34} {chosen:>26}  {unit:<14} {acts_in}: {}\n",
                choices.join(" | ")
            );
            continue;
        }
        let default = default.map_or_else(|| "follows".into(), |v| v.to_string());
        text += &format!("{name:<34} {min:>8} {max:>8} {default:>8}  {unit:<14} {acts_in}\n");
    }
    text
}

/// The table as JSON: an array of objects.
pub fn parameter_json(method: Method, preset: Preset) -> serde_json::Value {
    let row = |Row { name, unit, min, max, default, acts_in, choices }: Row| {
        let [min, max, default] =
            [Some(min), Some(max), default].map(|value| Some(written(&name, value?)));
        serde_json::json!({
            "name": name, "unit": unit, "min": min, "max": max, "default": default,
            "acts_in": acts_in, "choices": choices,
        })
    };
    rows(method, preset).into_iter().map(row).collect::<Vec<_>>().into()
}
