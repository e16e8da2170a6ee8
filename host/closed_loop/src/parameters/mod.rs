//! Parameters as the optimiser sees them: axes of a unit cube.
//!
//! The optimiser sees the cube, the code sees metres, the sensor sees codes. Only this module
//! converts.

mod aim;
mod axis;
mod candidate;
mod custom_axes;
mod device;
mod error;
mod ranges;
mod repair;
mod table;
mod theta_reg;
mod written;

use std::collections::BTreeMap;

use echoloop_cmaes::Coordinate;
use echoloop_dsp::{PARAMETERS, ParameterId, Settings};
use echoloop_files::one_line;
use echoloop_parameters::Refused;

use crate::config::RunConfig;
use crate::config::preset::{LidarPreset, Preset, Protocol};
use crate::cost::CostKind;

pub use aim::Columns;
pub(crate) use aim::filled_columns;
pub use axis::Axis;
pub use candidate::{candidate_values, read_candidate};
pub use device::Device;
pub use echoloop_parameters::Scale;
pub use error::ValueError;
pub use ranges::Ranges;
pub use repair::{Limits, repair};
pub use table::{Row, choices, parameter_json, parameter_table, table, tunable, tunable_rows};
pub use theta_reg::{ThetaReg, axes};
pub use written::{values_json, written, written_values};

use table::{device_axis, is_whole, lidar_axis, lidar_name};

/// One whole set of parameters, sensor and registration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Θ_lidar.
    pub settings: Settings,
    /// Θ_reg.
    pub registration: ThetaReg,
}

/// Parameters by name in their units, as files and reports have them.
pub type Values = BTreeMap<String, f64>;

/// The value that a named parameter has, given or following others, in its unit; `None` when there
/// is none of that name.
pub fn effective(values: &Values, name: &str) -> Option<f64> {
    let [separation, width] =
        [ParameterId::MinSeparation, ParameterId::PulseWidth].map(ParameterId::parameter);
    let follow = |width_ns: f64| {
        let pulse = Settings {
            pulse_width_ps: width.to_code(width_ns),
            min_separation_mm: None,
            ..Settings::default()
        };
        separation.to_unit(pulse.separation_mm())
    };
    values.get(name).copied().or_else(|| {
        let is_separation = name.strip_prefix("lidar.") == Some(separation.name);
        is_separation
            .then(|| values.get("lidar.pulse_width").map(|&width_ns| follow(width_ns)))
            .flatten()
    })
}

/// The sensor's settings of named values; those left out have their defaults.
pub fn settings_of(values: &Values) -> Settings {
    let mut settings = Settings::default();
    for (name, &value) in values {
        if let Some(id) = name.strip_prefix("lidar.").and_then(ParameterId::by_name) {
            settings.set(id, Some(id.parameter().to_code(value)));
        }
    }
    settings
}

impl Parameters {
    /// Start of a configuration.
    ///
    /// # Errors
    ///
    /// [`ValueError`] of the first registration parameter outside the preset's range, or of the
    /// joint constraints.
    pub fn start(config: &RunConfig, device: &Device) -> Result<Self, ValueError> {
        let ranges = Ranges::from(config).of_registration(config.registration.method);
        let registration = ThetaReg::start(&config.registration, &ranges)?;
        let settings = device.with_own_aim(config.lidar.0);
        let parameters = Self { settings, registration };
        device.check(&parameters.settings)?;
        Ok(parameters)
    }

    /// Registration of a configuration with values laid over it, where no sensor plays a part: its
    /// settings are not looked at.
    ///
    /// # Errors
    ///
    /// As [`Parameters::start`] and [`Parameters::with_values`], of the registration alone.
    pub fn registration_of(config: &RunConfig, values: &Values) -> Result<ThetaReg, ValueError> {
        let ranges = Ranges::from(config).of_registration(config.registration.method);
        let registration = ThetaReg::start(&config.registration, &ranges)?;
        let start = Self { settings: config.lidar.0, registration };
        let registration = start.laid(values, config.into())?.registration;
        registration.check()?;
        Ok(registration)
    }

    /// A copy of a configuration that starts with these parameters.
    pub fn as_start_of(&self, config: &RunConfig) -> RunConfig {
        let mut config = config.clone();
        config.lidar.0 = self.settings;
        config.tune.extended_to = None; // a run that starts here has gone nowhere yet
        config.tune.warm_starts.clear(); // what they had to give is in these
        for axis in self.registration_axes(&config) {
            let key = axis.name.strip_prefix(theta_reg::SECTION).unwrap_or(axis.name);
            if let Some(value) = self.registration.get(axis.name) {
                config.registration = config.registration.with(key, value);
            }
        }
        config
    }

    /// The value of a named axis, in its unit.
    pub fn get(&self, name: &str) -> Option<f64> {
        if let Some(id) = name.strip_prefix("lidar.").and_then(ParameterId::by_name) {
            return self.settings.get(id).map(|code| id.parameter().to_unit(code));
        }
        self.registration.get(name)
    }

    /// Sets a named axis; false when there is none.
    pub fn set(&mut self, name: &str, value: f64) -> bool {
        if let Some(id) = name.strip_prefix("lidar.").and_then(ParameterId::by_name) {
            self.settings.set(id, Some(id.parameter().to_code(value)));
            return true;
        }
        self.registration.set(name, value)
    }

    /// Values of all parameters by name, in their units.
    pub fn values<'a>(&self, ranges: impl Into<Ranges<'a>>) -> Values {
        let lidar = PARAMETERS.iter().map(|p| format!("lidar.{}", p.name));
        let lidar = lidar.filter_map(|name| self.get(&name).map(|value| (name, value)));
        lidar.chain(self.registration.values(ranges)).collect()
    }

    /// The axes of the method these parameters are for.
    pub fn registration_axes<'a>(&self, ranges: impl Into<Ranges<'a>>) -> Vec<Axis> {
        ranges.into().of_registration(self.registration.method.method())
    }

    /// Lays named values over these parameters, checking each.
    ///
    /// # Errors
    ///
    /// [`ValueError`] names the first that is unknown, not finite or no whole number; then the
    /// first out of range; then what the joint constraints refuse.
    pub fn with_values<'a>(
        self,
        values: &Values,
        ranges: impl Into<Ranges<'a>>,
        device: &Device,
    ) -> Result<Self, ValueError> {
        let laid = self.laid(values, ranges.into())?;
        device.check(&laid.settings)?;
        laid.registration.check()?;
        Ok(laid)
    }

    /// Lays values over these parameters, each checked by itself.
    fn laid(mut self, values: &Values, ranges: Ranges<'_>) -> Result<Self, ValueError> {
        let axes = self.registration_axes(ranges);
        let values = recognised(values, &axes)?;
        for (name, &value) in &values {
            if let Some(axis) = axes.iter().find(|axis| axis.name == name) {
                axis.require(value)?;
            }
            self.set(name, value);
        }
        Ok(self)
    }
}

/// Named values by their current names. Each must belong to the sensor or to `registration`, be
/// finite, and be whole where the parameter is.
fn recognised(values: &Values, registration: &[Axis]) -> Result<Values, ValueError> {
    let named = values.iter().map(|(given, &value)| {
        let is_known = |name: &str| {
            name.starts_with("lidar.") || registration.iter().any(|axis| axis.name == name)
        };
        let Some(name) = tunable(given).map(|row| row.key).filter(|name| is_known(name)) else {
            let sensor = PARAMETERS.iter().map(|p| format!("lidar.{}", p.name));
            let own = registration.iter().map(|axis| axis.name.to_owned());
            let known: Vec<String> = sensor.chain(own).collect();
            return Err(ValueError::Unknown(one_line(given), known.join(", ")));
        };
        if !value.is_finite() {
            return Err(Refused::new(name, value, "finite").into());
        }
        if is_whole(name) && value.fract() != 0.0 {
            return Err(Refused::new(name, value, "a whole number").into());
        }
        Ok((name.to_owned(), value))
    });
    named.collect()
}

/// The cube a search moves in.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    axes: Vec<Axis>,
    start: Parameters,
    device: Device,
    /// Columns of a candidate unless they are searched themselves or follow the aim.
    columns: Columns,
}

impl Space {
    /// The axes of a protocol around a start; that of power as far as the preset takes it.
    pub fn new(
        protocol: Protocol,
        lidar: LidarPreset,
        preset: Preset,
        start: Parameters,
        device: Device,
    ) -> Self {
        let mut axes = Vec::new();
        if matches!(protocol, Protocol::Lidar | Protocol::Joint) {
            let axis = |id| device_axis(id, lidar, &start.settings, &device);
            axes.extend(lidar.parameters(device.steered().is_some()).into_iter().filter_map(axis));
        }
        if matches!(protocol, Protocol::Registration | Protocol::Joint) {
            axes.extend(start.registration_axes(preset));
        }
        Self { axes, start, device, columns: Columns::Filled }
    }

    /// True when a cost depends on a searched parameter.
    pub fn changes(&self, cost: CostKind) -> bool {
        // Columns that fill the budget follow all of the aim.
        let fills = cost == CostKind::Energy
            && self.device.steered().is_some()
            && self.columns() == Columns::Filled;
        match cost.changed_by() {
            [] => !self.lidar_axes().is_empty(),
            some => fills || self.axes.iter().any(|axis| some.contains(&axis.name)),
        }
    }

    /// The same space without the aim: stored pairs have the beams of one.
    pub fn with_one_aim(mut self) -> Self {
        let is_of_aim =
            |axis: &Axis| ParameterId::AIM.iter().any(|id| axis.name == lidar_name(*id));
        self.axes.retain(|axis| !is_of_aim(axis));
        self.columns = Columns::OfTheStart;
        self
    }

    /// The same space with another range of the power.
    pub fn with_power(mut self, power: LidarPreset) -> Self {
        let own = lidar_axis(ParameterId::Power, power, &self.start.settings);
        self.axes.iter_mut().filter(|axis| axis.name == own.name).for_each(|axis| *axis = own);
        self
    }

    /// The axes, in the order of the cube's coordinates.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Indices of the sensor's axes.
    pub fn lidar_axes(&self) -> Vec<usize> {
        self.numbers(|name| name.starts_with("lidar."))
    }

    /// Indices of the registration's axes.
    pub fn registration_axes(&self) -> Vec<usize> {
        self.numbers(|name| !name.starts_with("lidar."))
    }

    fn numbers(&self, is_asked: impl Fn(&str) -> bool) -> Vec<usize> {
        let axes = self.axes.iter().enumerate();
        axes.filter(|(_, axis)| is_asked(axis.name)).map(|(i, _)| i).collect()
    }

    /// Kind of an axis for the optimiser: a choice has names, in no order. Counts are rounded:
    /// in as few generations a margin is worth a few percent of the loss at most, and nothing where
    /// noise is large (benches/record/optimiser.md).
    pub fn coordinate(&self, axis: usize) -> Coordinate {
        let axis = &self.axes[axis];
        match axis.cells() {
            Some(count) if !choices(axis.name).is_empty() => Coordinate::Choice(count),
            _ => Coordinate::Real,
        }
    }

    /// The start as a point of the cube.
    pub fn start_point(&self) -> Vec<f64> {
        self.point(&self.start)
    }

    /// Parameters as a point of the cube.
    pub fn point(&self, parameters: &Parameters) -> Vec<f64> {
        self.axes
            .iter()
            .map(|axis| axis.to_cube(parameters.get(axis.name).unwrap_or(axis.default)))
            .collect()
    }

    /// The searched parameters by name.
    pub fn values(&self, parameters: &Parameters) -> Values {
        let axes = self.axes.iter();
        axes.filter_map(|axis| parameters.get(axis.name).map(|value| (axis.name.to_owned(), value)))
            .collect()
    }

    /// Another start of the search: named values of its axes, brought within their bounds and the
    /// joint constraints as a candidate is. All else stays where it starts.
    ///
    /// # Errors
    ///
    /// [`ValueError`] names the first that is no parameter, not finite or no whole number.
    pub fn warm_start<'a>(
        &self,
        values: &Values,
        ranges: impl Into<Ranges<'a>>,
    ) -> Result<Parameters, ValueError> {
        let values = recognised(values, &self.start.registration_axes(ranges))?;
        let mut point = self.start_point();
        for (axis, coordinate) in self.axes.iter().zip(&mut point) {
            if let Some(value) = effective(&values, axis.name) {
                *coordinate = axis.to_cube(value.clamp(axis.min, axis.max));
            }
        }
        Ok(self.parameters(&point).0)
    }

    /// Limits of a repair: a fixed parameter stays at its start, a searched one within its bounds.
    fn limits(&self) -> Limits {
        let settings = &self.start.settings;
        let bounds = |id: ParameterId, fixed: i32| {
            let name = lidar_name(id);
            let axis = self.axes.iter().find(|axis| axis.name == name);
            let code = |value| id.parameter().to_code(value);
            axis.map_or([fixed; 2], |axis| [code(axis.min), code(axis.max)])
        };
        Limits {
            least_power_uw: bounds(ParameterId::Power, settings.power_uw)[0],
            pulse_ps: bounds(ParameterId::PulseWidth, settings.pulse_width_ps),
        }
    }

    /// Columns of a candidate. They fill the budget where the light is aimed and they are not
    /// searched or fixed themselves.
    fn columns(&self) -> Columns {
        let of_aim = ParameterId::AIM.into_iter().chain([ParameterId::Shots]);
        let has = |id| self.axes.iter().any(|axis| axis.name == lidar_name(id));
        match self.columns {
            Columns::Filled if has(ParameterId::Columns) || !of_aim.into_iter().any(has) => {
                Columns::AtMost
            }
            columns => columns,
        }
    }

    /// A point of the cube as parameters that every constraint accepts, and the names of those that
    /// had to be repaired.
    pub fn parameters(&self, point: &[f64]) -> (Parameters, Vec<&'static str>) {
        let mut parameters = self.start;
        for (axis, &coordinate) in self.axes.iter().zip(point) {
            parameters.set(axis.name, axis.from_cube(coordinate));
        }
        let settings = &mut parameters.settings;
        let mut repaired = repair(settings, &self.device, &self.limits(), self.columns());
        repaired.extend(parameters.registration.repair());
        (parameters, repaired)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_dsp::{Hardware, Kind, ScanPattern, Steered};
    use echoloop_registration::Method;

    fn space(protocol: Protocol) -> Space {
        space_of(Method::Icp, protocol)
    }

    fn space_of(method: Method, protocol: Protocol) -> Space {
        space_in(Preset::Outdoor, method, protocol)
    }

    fn space_in(preset: Preset, method: Method, protocol: Protocol) -> Space {
        let mut config = RunConfig::default();
        (config.registration.method, config.registration.preset) = (method, preset);
        let start = Parameters::start(&config, &Device::REFERENCE).unwrap();
        Space::new(protocol, LidarPreset::Paper, preset, start, Device::REFERENCE)
    }

    #[test]
    fn the_protocols_open_eight_eight_and_sixteen_axes() {
        let count = |protocol| space(protocol).axes().len();
        assert_eq!(count(Protocol::Default), 0);
        assert_eq!(count(Protocol::Lidar), 8);
        assert_eq!(count(Protocol::Registration), 8);
        assert_eq!(count(Protocol::Joint), 16);
    }

    #[test]
    fn a_warm_start_is_brought_within_bounds_and_constraints_and_moves_nothing_else() {
        let config = RunConfig::default();
        let preset = config.registration.preset;
        let start = Parameters::start(&config, &Device::REFERENCE).unwrap();
        let new = |protocol, lidar| Space::new(protocol, lidar, preset, start, Device::REFERENCE);
        let joint = new(Protocol::Joint, LidarPreset::Full);
        let at = |space: &Space, values: &[(&str, f64)]| {
            let values = values.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
            space.warm_start(&values, &config).unwrap()
        };
        // 100 W for 20 ns is more than a pulse may have; below an axis is its least value.
        let far = [("lidar.power", 1e9), ("lidar.pulse_width", 20.0), ("lidar.shots", -2.0)];
        let found = at(&joint, &[&far[..], &[("registration.voxel_m", -1.0)]].concat());
        assert_eq!(found.settings.check(&Hardware::REFERENCE), Ok(()));
        assert_eq!(found.registration.check(), Ok(()));
        assert_eq!(found.get("lidar.shots"), Some(1.0));
        let voxel = joint.axes().iter().find(|axis| axis.name == "registration.voxel_m").unwrap();
        assert_eq!(found.get("registration.voxel_m"), Some(voxel.min));
        // What followed the pulse where it was tuned follows that pulse.
        let wide = at(&joint, &[("lidar.pulse_width", 8.0)]);
        let (usual, _) = joint.parameters(&joint.start_point());
        assert!(wide.settings.min_separation_mm > usual.settings.min_separation_mm, "{wide:?}");
        // Half a search takes its half.
        let half = new(Protocol::Registration, LidarPreset::Full);
        let found = at(&half, &[("lidar.power", 20.0), ("registration.voxel_m", 0.5)]);
        assert_eq!(found.settings, start.settings);
        assert!((found.get("registration.voxel_m").unwrap() - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_full_preset_opens_the_whole_table_and_starts_where_it_should() {
        let steered = ScanPattern::Steered(Steered::REFERENCE);
        let aimless = PARAMETERS.len() - ParameterId::AIM.len();
        for (pattern, axes) in [(Device::REFERENCE.pattern, aimless), (steered, PARAMETERS.len())] {
            let device = Device { pattern, ..Device::REFERENCE };
            let start = Parameters::start(&RunConfig::default(), &device).unwrap();
            let preset = Preset::Outdoor;
            let space = Space::new(Protocol::Lidar, LidarPreset::Full, preset, start, device);
            assert_eq!(space.axes().len(), axes);
            let (parameters, repaired) = space.parameters(&space.start_point());
            assert!(repaired.is_empty());
            // 1.14 · cW/2 of 5 ns, which the start leaves to follow the pulse.
            let expected = Settings { min_separation_mm: Some(854), ..start.settings };
            assert_eq!(parameters.settings, expected);
        }
    }

    #[test]
    fn power_is_searched_from_the_paper_s_five_watts_or_from_where_nothing_is_detected() {
        let powers = |lidar, power: Option<LidarPreset>, start_uw| {
            let mut start = space(Protocol::Lidar).start;
            start.settings.power_uw = start_uw;
            let device = Device::REFERENCE;
            let space = Space::new(Protocol::Lidar, lidar, Preset::Outdoor, start, device);
            let space = power.map_or(space.clone(), |power| space.with_power(power));
            let least = space.parameters(&vec![0.0; space.axes().len()]).0;
            let (axis, least) = (space.axes()[0], least.get("lidar.power").unwrap());
            assert_eq!((axis.name, least), ("lidar.power", axis.min));
            let again = space.parameters(&space.start_point()).0.settings;
            assert_eq!(again.power_uw, start_uw, "a start below is where the axis begins");
            [axis.min, axis.max]
        };
        let (paper, full) = (LidarPreset::Paper, LidarPreset::Full);
        assert_eq!(powers(paper, None, 75_000_000), [5.0, 100.0]);
        assert_eq!(powers(full, None, 75_000_000), [1e-5, 100.0]);
        assert_eq!(powers(paper, Some(LidarPreset::Full), 75_000_000), [1e-5, 100.0]);
        assert_eq!(powers(full, Some(LidarPreset::Paper), 75_000_000), [5.0, 100.0]);
        assert_eq!(powers(paper, None, 200_000), [0.2, 100.0]);
    }

    #[test]
    fn the_optimiser_is_told_which_axes_have_names() {
        let start = space(Protocol::Lidar).start;
        let device = Device::REFERENCE;
        let space = Space::new(Protocol::Joint, LidarPreset::Full, Preset::Outdoor, start, device);
        let told = |name: &str| {
            let axis = space.axes().iter().position(|axis| axis.name == name);
            space.coordinate(axis.unwrap())
        };
        assert_eq!(told("lidar.power"), Coordinate::Real);
        assert_eq!(told("lidar.upsampling"), Coordinate::Real);
        assert_eq!(told("lidar.denoise"), Coordinate::Choice(3));
        assert_eq!(told("lidar.timing"), Coordinate::Choice(4));
    }

    #[test]
    fn the_start_comes_back_from_the_cube_unchanged() {
        let space = space(Protocol::Joint);
        let (parameters, repaired) = space.parameters(&space.start_point());
        assert!(repaired.is_empty());
        assert_eq!(parameters.settings, space.start.settings);
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(close(parameters.get("registration.voxel_m").unwrap(), 0.2));
        assert!(close(parameters.get("registration.max_pair_distance_m").unwrap(), 0.5));
        assert_eq!(parameters.get("registration.normal_neighbours"), Some(20.0));
    }

    #[test]
    fn every_point_of_the_cube_is_accepted_by_the_sensor_and_the_method() {
        let mut state = 1u64;
        for i in 0..20_000 {
            let method = [Method::Icp, Method::Gicp, Method::Fgr, Method::Mac][i % 4];
            let space =
                space_in([Preset::Outdoor, Preset::Paper][i / 4 % 2], method, Protocol::Joint);
            let point: Vec<f64> = (0..space.axes().len())
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    // Corners and faces too.
                    (((state >> 33) as f64 / (1u64 << 31) as f64) * 1.4 - 0.2).clamp(0.0, 1.0)
                })
                .collect();
            let (parameters, _) = space.parameters(&point);
            assert_eq!(parameters.settings.check(&Hardware::REFERENCE), Ok(()), "{point:?}");
            parameters.registration.check().unwrap();
        }
    }

    #[test]
    fn what_follows_the_pulse_has_the_value_that_the_sensor_uses() {
        for pulse_width_ps in [2_000, 5_000, 20_000] {
            let settings = Settings { pulse_width_ps, ..Settings::default() };
            let values =
                Parameters { settings, ..space(Protocol::Joint).start }.values(Preset::Outdoor);
            assert_eq!(values.get("lidar.min_separation"), None);
            let expected = f64::from(settings.separation_mm()) / 1e3;
            assert_eq!(effective(&values, "lidar.min_separation"), Some(expected));
            assert_eq!(
                effective(&values, "lidar.pulse_width"),
                Some(f64::from(pulse_width_ps) / 1e3)
            );
        }
        let given =
            Values::from([("lidar.min_separation".into(), 2.5), ("lidar.pulse_width".into(), 5.0)]);
        assert_eq!(effective(&given, "lidar.min_separation"), Some(2.5));
        assert_eq!(effective(&given, "lidar.powr"), None);
    }

    #[test]
    fn named_values_are_checked_and_laid_over() {
        let start = space(Protocol::Joint).start;
        let with = |name: &str, value: f64| {
            let values = Values::from([(name.to_owned(), value)]);
            start
                .with_values(&values, Preset::Outdoor, &Device::REFERENCE)
                .map_err(|e| e.to_string())
        };
        assert_eq!(with("lidar.power", 20.0).unwrap().settings.power_uw, 20_000_000);
        assert_eq!(
            with("lidar.power", 500.0).unwrap_err(),
            "lidar.power 500 W is above its maximum 100 W"
        );
        assert!(with("lidar.powr", 5.0).unwrap_err().starts_with("unknown parameter `lidar.powr`"));
        assert_eq!(
            with("registration.voxel_m", 9.0).unwrap_err(),
            "registration.voxel_m = 9 is outside 0.05 to 1 m"
        );
        let fraction = with("registration.normal_neighbours", 10.5).unwrap_err();
        assert_eq!(fraction, "registration.normal_neighbours = 10.5 must be a whole number");
        for parameter in &PARAMETERS {
            let name = format!("lidar.{}", parameter.name);
            let half = with(&name, parameter.to_unit(parameter.min) + 0.5);
            let is_real = matches!(parameter.kind, Kind::Real { .. });
            let fraction = format!(
                "{name} = {} must be a whole number",
                parameter.to_unit(parameter.min) + 0.5
            );
            assert_eq!(half.err() == Some(fraction), !is_real, "{name}");
        }
        for name in ["registration.voxel_m", "lidar.power"] {
            for value in [f64::NAN, f64::INFINITY] {
                let expected = format!("{name} = {value} must be finite");
                assert_eq!(with(name, value).unwrap_err(), expected);
            }
        }
        let mac = space_of(Method::Mac, Protocol::Joint).start;
        let former = Values::from([("registration.max_stretch_m".to_owned(), 0.3)]);
        let mac = mac.with_values(&former, Preset::Outdoor, &Device::REFERENCE).unwrap();
        assert_eq!(mac.get("registration.length_tolerance_m"), Some(0.3));
    }
}
