//! Every parameter with range, default and unit: in the help, and for `config --parameters`.

use echoloop_dsp::{Kind, Parameter};
use echoloop_registration::Method;

use echoloop_closed_loop::config::preset::Preset;
use echoloop_closed_loop::parameters::{axes, written};

/// A row of the parameter table, in units.
struct Row {
    name: String,
    unit: &'static str,
    min: f64,
    max: f64,
    default: Option<f64>,
    acts_in: &'static str,
    /// What a choice chooses from.
    choices: Vec<&'static str>,
}

/// The methods of a choice.
pub(super) fn choices(parameter: &Parameter) -> Vec<&'static str> {
    let Kind::Choice { names } = parameter.kind else { return Vec::new() };
    names.to_vec()
}

/// Every parameter: the firmware's table, then the registration method's.
fn parameter_rows(method: Method, preset: Preset) -> Vec<Row> {
    let lidar = echoloop_dsp::PARAMETERS.iter().map(|p| Row {
        name: format!("lidar.{}", p.name),
        unit: p.unit,
        min: p.to_unit(p.min),
        max: p.to_unit(p.max),
        default: p.default.map(|code| p.to_unit(code)),
        acts_in: p.acts_in,
        choices: choices(p),
    });
    let registration = axes(method, preset).into_iter().map(|a| Row {
        name: a.name.to_owned(),
        unit: a.unit,
        min: a.min,
        max: a.max,
        default: Some(a.default),
        acts_in: method.name(),
        choices: Vec::new(),
    });
    lidar.chain(registration).collect()
}

/// The parameter table as text: name, range, default, unit, where it acts.
pub(super) fn parameter_table(method: Method, preset: Preset) -> String {
    let mut text = format!(
        "{:<34} {:>8} {:>8} {:>8}  {:<14} acts in\n",
        "parameter", "min", "max", "default", "unit"
    );
    for Row { name, unit, min, max, default, acts_in, choices } in parameter_rows(method, preset) {
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

/// The parameter table as JSON.
pub(super) fn parameter_json(method: Method, preset: Preset) -> serde_json::Value {
    let row = |Row { name, unit, min, max, default, acts_in, choices }: Row| {
        let [min, max, default] =
            [Some(min), Some(max), default].map(|value| Some(written(&name, value?)));
        serde_json::json!({
            "name": name, "unit": unit, "min": min, "max": max, "default": default,
            "acts_in": acts_in, "choices": choices,
        })
    };
    parameter_rows(method, preset).into_iter().map(row).collect::<Vec<_>>().into()
}
