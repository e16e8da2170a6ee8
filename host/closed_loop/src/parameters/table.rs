//! The table of all parameters of a run.
//!
//! Its rows come from the tables that declare them: `parameters!` of the firmware, `SETTINGS` of
//! registration, and the sections of the configuration. Only this module converts them to
//! [`Parameter`]s. The reference of the keys, axes, choices and written values follow.

use std::sync::LazyLock;

use echoloop_dsp::{Kind as LidarKind, PARAMETERS, ParameterId, Settings, Steered};
use echoloop_parameters::{Bounds, Kind, Parameter, Range, Scale, Step};
use echoloop_registration::{Method, SETTINGS, Setting, setting};

use super::aim::aim_axis;
use super::axis::Axis;
use super::device::Device;
use super::ranges::Ranges;
use super::theta_reg::{SECTION, axes};
use super::written::written;
use crate::budget::Budget;
use crate::config::preset::{LidarPreset, Preset};
use crate::config::{RunConfig, keys};

/// A parameter of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Key, unit, kind, bounds and help.
    pub parameter: Parameter,
    /// Default of a parameter that a search can move, in its unit; None where it follows others.
    pub default: Option<f64>,
    /// Range of a search; None where no search moves the parameter.
    pub search: Option<Axis>,
    /// Parts of the sensor, or the registration method, that use it; empty for other keys.
    pub acts_in: &'static str,
}

impl Row {
    /// Bounds, to follow "must be". A setting of registration that a search moves must lie where
    /// the search may go.
    pub fn expected(&self) -> String {
        let Parameter { bounds, .. } = self.parameter;
        match (bounds, self.search) {
            (Bounds::Words(_), Some(Axis { min, max, .. })) => {
                format!("{min} to {max} in a run; {bounds}")
            }
            _ => self.parameter.expected(),
        }
    }

    /// Ends of the range of a number: its bounds, or where these are words those of its search.
    pub fn range(&self) -> Option<[f64; 2]> {
        match self.parameter.bounds {
            Bounds::Words(_) => self.search.map(|axis| [axis.min, axis.max]),
            bounds => bounds.range().map(|range| [range.min, range.max]),
        }
    }
}

/// Parameters of the sensor, then settings of registration.
static TUNABLE: LazyLock<Vec<Parameter>> = LazyLock::new(|| {
    PARAMETERS.iter().map(of_lidar).chain(SETTINGS.iter().map(of_setting)).collect()
});

fn of_lidar(parameter: &echoloop_dsp::Parameter) -> Parameter {
    let [min, max] = [parameter.min, parameter.max].map(|code| parameter.to_unit(code));
    let within = |step| Bounds::Within(Range { step, ..Range::new(min, max) });
    let (kind, bounds) = match parameter.kind {
        LidarKind::Choice { names } => (Kind::Text, Bounds::OneOf(names)),
        LidarKind::PowerOfTwo => (Kind::Whole, within(Step::PowerOfTwo)),
        LidarKind::Integer => (Kind::Whole, within(Step::Whole)),
        LidarKind::Real { .. } => (Kind::Number, within(Step::Any)),
    };
    let key = format!("lidar.{}", parameter.name).leak(); // once, for the static table
    Parameter { key, unit: parameter.unit, kind, bounds, help: parameter.id.help() }
}

fn of_setting(setting: &Setting) -> Parameter {
    let &Setting { path: key, unit, kind, help, .. } = setting;
    let bounds = Bounds::Words(setting.bounds().leak()); // once, for the static table
    Parameter { key, unit, kind, bounds, help }
}

/// The parameter of the sensor or of registration with that name, today's or a former one.
pub fn tunable(name: &str) -> Option<&'static Parameter> {
    let of_registration = name.strip_prefix(SECTION).and_then(setting);
    let name = of_registration.map_or(name, |setting| setting.path);
    TUNABLE.iter().find(|parameter| parameter.key == name)
}

/// The names that a named parameter chooses from, by number from 0; none when it is no choice.
pub fn choices(name: &str) -> &'static [&'static str] {
    tunable(name).map_or(&[], |parameter| parameter.bounds.names())
}

/// True when the parameter of that name takes whole numbers only.
pub(super) fn is_whole(name: &str) -> bool {
    tunable(name).is_some_and(|parameter| parameter.kind != Kind::Number)
}

/// Every parameter of a run, in the order of its file.
pub fn table(config: &RunConfig) -> Vec<Row> {
    let mut rows = Vec::new();
    for &parameter in keys() {
        if parameter.key == "registration.method" {
            rows.extend(lidar_rows());
        }
        rows.push(Row { parameter, default: None, search: None, acts_in: "" });
        if parameter.key == "registration.refine" {
            let method = config.registration.method;
            let axes = Ranges::from(config).of_registration(method);
            let searched =
                |name| axes.iter().find(|axis| axis.name == name && axis.max.is_finite());
            let of_registration = TUNABLE.iter().skip(PARAMETERS.len());
            rows.extend(
                of_registration.map(|row| registration_row(*row, searched(row.key), method)),
            );
        }
    }
    rows
}

/// The parameters that a search of this method can move in the ranges of a preset.
pub fn tunable_rows(method: Method, preset: Preset) -> Vec<Row> {
    let searched = axes(method, preset);
    let of_axis = |axis: &Axis| Some(registration_row(*tunable(axis.name)?, Some(axis), method));
    lidar_rows().chain(searched.iter().filter_map(of_axis)).collect()
}

/// The parameters that a search can move as aligned text: name, range, default, unit and where each
/// acts.
pub fn parameter_table(method: Method, preset: Preset) -> String {
    let mut text = format!(
        "{:<34} {:>8} {:>8} {:>8}  {:<14} acts in\n",
        "parameter", "min", "max", "default", "unit"
    );
    for Row { parameter, default, search, acts_in } in tunable_rows(method, preset) {
        let Parameter { key, unit, bounds, .. } = parameter;
        let [min, max] = search.map_or([f64::NAN; 2], |axis| [axis.min, axis.max]);
        let number = default.map_or_else(|| "follows".to_owned(), |value| value.to_string());
        let names = bounds.names();
        let (values, names) = match default.and_then(|code| names.get(code as usize)) {
            Some(name) => (format!("{name:>26}"), format!(": {}", names.join(" | "))),
            None => (format!("{min:>8} {max:>8} {number:>8}"), String::new()),
        };
        text += &format!("{key:<34} {values}  {unit:<14} {acts_in}{names}\n");
    }
    text
}

/// The parameters that a search can move as JSON: an array of objects.
pub fn parameter_json(method: Method, preset: Preset) -> serde_json::Value {
    let row = |row: Row| {
        let Parameter { key, unit, bounds, .. } = row.parameter;
        let (min, max) = row.search.map(|axis| (axis.min, axis.max)).unzip();
        let [min, max, default] = [min, max, row.default].map(|value| Some(written(key, value?)));
        serde_json::json!({
            "name": key, "unit": unit, "min": min, "max": max, "default": default,
            "acts_in": row.acts_in, "choices": bounds.names(),
        })
    };
    tunable_rows(method, preset).into_iter().map(row).collect::<Vec<_>>().into()
}

fn lidar_rows() -> impl Iterator<Item = Row> {
    PARAMETERS.iter().zip(&*TUNABLE).map(|(p, &parameter)| Row {
        parameter,
        default: p.default.map(|code| p.to_unit(code)),
        search: Some(lidar_axis(p.id, LidarPreset::Full, &Settings::default())),
        acts_in: p.acts_in,
    })
}

fn registration_row(parameter: Parameter, axis: Option<&Axis>, method: Method) -> Row {
    let (default, acts_in) = (axis.map(|axis| axis.default), method.name());
    Row { parameter, default, search: axis.copied(), acts_in }
}

/// Name of a parameter of the sensor among all parameters.
pub(super) fn lidar_name(id: ParameterId) -> &'static str {
    TUNABLE[id as usize].key
}

/// An axis of Θ_lidar of a sensor; none of the aim where nothing is steered.
pub(super) fn device_axis(
    id: ParameterId,
    power: LidarPreset,
    start: &Settings,
    device: &Device,
) -> Option<Axis> {
    match ParameterId::AIM.contains(&id) {
        true => device.steered().map(|mount| aim_axis(id, mount, &device.budget)),
        false => Some(lidar_axis(id, power, start)),
    }
}

/// An axis of Θ_lidar, of the reference mount where it is of the aim; that of power as far as a
/// search may go.
pub(super) fn lidar_axis(id: ParameterId, power: LidarPreset, start: &Settings) -> Axis {
    if ParameterId::AIM.contains(&id) {
        return aim_axis(id, &Steered::REFERENCE, &Budget::NONE);
    }
    let p = id.parameter();
    let scale = match p.kind {
        LidarKind::Real { log: true } => Scale::Log,
        LidarKind::Real { log: false } => Scale::Linear,
        LidarKind::Integer | LidarKind::Choice { .. } => Scale::Integer,
        LidarKind::PowerOfTwo => Scale::PowerOfTwo,
    };
    let default = p.to_unit(p.default.unwrap_or_else(|| start.separation_mm().clamp(p.min, p.max)));
    let min = match id {
        ParameterId::Power => power.least_power_w(p.to_unit(start.power_uw)),
        _ => p.to_unit(p.min),
    };
    let name = lidar_name(id);
    Axis { name, unit: p.unit, scale, min, max: p.to_unit(p.max), default }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_of_a_run_stands_in_the_table_once() {
        let rows = table(&RunConfig::default());
        let count = |key: &str| rows.iter().filter(|row| row.parameter.key == key).count();
        let sections = keys().count();
        assert_eq!(rows.len(), sections + PARAMETERS.len() + SETTINGS.len());
        assert!(rows.iter().all(|row| count(row.parameter.key) == 1));
    }

    #[test]
    fn a_parameter_is_found_by_its_name_of_today_and_by_its_former_one() {
        for setting in SETTINGS {
            let former = setting.former.map(|former| format!("{SECTION}{former}"));
            for name in [Some(setting.path.to_owned()), former].into_iter().flatten() {
                assert_eq!(tunable(&name).map(|parameter| parameter.key), Some(setting.path));
            }
        }
        assert_eq!(tunable("lidar.power").map(|parameter| parameter.unit), Some("W"));
        assert_eq!(tunable("lidar.powr"), None);
        assert_eq!(choices("lidar.denoise"), ["none", "gaussian", "matched"]);
        assert!(choices("registration.voxel_m").is_empty());
    }

    #[test]
    fn every_search_lies_within_the_bounds() {
        for row in tunable_rows(Method::Fgr, Preset::Outdoor) {
            let axis = row.search.expect("a search moves it");
            assert_eq!(axis.name, row.parameter.key);
            let bounds = row.parameter.bounds;
            assert!(bounds.allows(axis.min) && bounds.allows(axis.max), "{}", axis.name);
        }
    }
}
