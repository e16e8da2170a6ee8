//! Axes of a search as `[tune.axes]` changes them.

use echoloop_dsp::ParameterId;
use echoloop_parameters::Scale;
use echoloop_registration::{Method, setting};

use super::axis::Axis;
use super::device::Device;
use super::error::ValueError;
use super::ranges::free_setting;
use super::table::{device_axis, lidar_name, tunable};
use super::{Columns, Parameters, Space, choices, theta_reg};
use crate::config::preset::{LidarPreset, Preset};
use crate::config::{AxisChoice, OwnAxes};

impl Space {
    /// The space with the user's axes: fixed ones removed, free ones added, bounds as given. The
    /// sensor's axes stay before registration's.
    ///
    /// # Errors
    ///
    /// [`ValueError::Axis`] for a parameter that the method does not have, bounds that the sensor
    /// or the method refuses, or a start outside them.
    pub fn with_own(mut self, own: &OwnAxes) -> Result<Self, ValueError> {
        for (name, choice) in own.iter() {
            self.choose(name, choice)
                .map_err(|problem| ValueError::Axis { name: name.into(), problem })?;
        }
        self.axes.sort_by_key(|axis| !axis.name.starts_with("lidar."));
        Ok(self)
    }

    fn choose(&mut self, name: &str, choice: AxisChoice) -> Result<(), String> {
        let method = self.start.registration.method.method();
        let usual = self.axes.iter().find(|axis| axis.name == name).copied();
        let usual = usual.or_else(|| usual_axis(name, &self.start, method, &self.device));
        let is_of_aim = |id: &ParameterId| name == lidar_name(*id);
        let is_aimed = ParameterId::AIM.iter().any(is_of_aim);
        if self.columns == Columns::OfTheStart && is_aimed && choice != AxisChoice::Fixed {
            return Err("the pairs have the beams of one aim".into());
        }
        let no_setting = || match name.starts_with("lidar.") {
            true => "the scan pattern is not steered".to_owned(),
            false => format!("it is no setting of {}", method.name()),
        };
        let axis = match choice {
            AxisChoice::Fixed => {
                usual.ok_or_else(no_setting)?;
                self.axes.retain(|axis| axis.name != name);
                if name == lidar_name(ParameterId::Columns) && self.columns == Columns::Filled {
                    self.columns = Columns::AtMost;
                }
                return Ok(());
            }
            AxisChoice::Free => match usual.ok_or_else(no_setting)? {
                axis if axis.min.is_finite() => axis,
                _ => return Err("it has no usual range: give bounds, as 1..100".into()),
            },
            AxisChoice::Within { min, max, log } => {
                let axis = bounded(usual.ok_or_else(no_setting)?, min, max, log)?;
                accepted(&axis, method)?;
                started(axis, &self.start)?
            }
        };
        match self.axes.iter_mut().find(|axis| axis.name == name) {
            Some(place) => *place = axis,
            None => self.axes.push(axis),
        }
        Ok(())
    }
}

/// Usual axis of a parameter, searched or not; without a range where none is usual.
fn usual_axis(name: &str, start: &Parameters, method: Method, device: &Device) -> Option<Axis> {
    if let Some(id) = name.strip_prefix("lidar.").and_then(ParameterId::by_name) {
        return device_axis(id, LidarPreset::Usual, &start.settings, device);
    }
    let axes = theta_reg::axes(method, Preset::Outdoor);
    axes.into_iter().find(|axis| axis.name == name).or_else(|| free_setting(name, method))
}

/// The axis within other bounds.
fn bounded(axis: Axis, min: f64, max: f64, log: Option<bool>) -> Result<Axis, String> {
    if !choices(axis.name).is_empty() {
        return Err(format!("it chooses from {}: free or fixed", choices(axis.name).join(", ")));
    }
    let scale = match (axis.scale, log) {
        (Scale::Integer | Scale::PowerOfTwo, Some(_)) => {
            return Err("it takes whole numbers, which are not spaced".into());
        }
        (Scale::Integer, None) if min.fract() != 0.0 || max.fract() != 0.0 => {
            return Err(format!("expected whole numbers as bounds, found {min} to {max}"));
        }
        (Scale::PowerOfTwo, None) if ![min, max].into_iter().all(is_power_of_two) => {
            return Err(format!("expected powers of two as bounds, found {min} to {max}"));
        }
        (usual, None) => usual,
        (_, Some(true)) => Scale::Log,
        (_, Some(false)) => Scale::Linear,
    };
    match scale {
        Scale::Log if min <= 0.0 => {
            Err(format!("a logarithmic axis begins above 0, found {min}; add ,linear"))
        }
        _ => Ok(Axis { min, max, scale, ..axis }),
    }
}

fn is_power_of_two(value: f64) -> bool {
    value >= 1.0 && libm::log2(value).fract() == 0.0
}

/// Checks that the sensor or the method accepts both ends.
fn accepted(axis: &Axis, method: Method) -> Result<(), String> {
    let Axis { min, max, .. } = *axis;
    let unit = if axis.unit.is_empty() { String::new() } else { format!(" {}", axis.unit) };
    if let Some(sensor) = tunable(axis.name).and_then(|row| row.bounds.range()) {
        let (least, most) = (sensor.min, sensor.max);
        return match least <= min && max <= most {
            true => Ok(()),
            false => Err(format!(
                "{min} to {max} is outside what the sensor takes, {least} to {most}{unit}"
            )),
        };
    }
    let key = axis.name.strip_prefix(theta_reg::SECTION).unwrap_or_default();
    let bounds = setting(key).and_then(|setting| Some(setting.bound(&setting.of(method)?).bounds));
    match bounds {
        Some(bounds) if !(bounds.allows(min) && bounds.allows(max)) => {
            Err(format!("{min} to {max} is outside what {} takes, {bounds}", method.name()))
        }
        _ => Ok(()),
    }
}

/// The axis with the start as its default; the start must lie on it.
fn started(axis: Axis, start: &Parameters) -> Result<Axis, String> {
    let name = axis.name;
    let Some(value) = start.get(name) else {
        // A separation that follows the pulse is searched from where it follows it to.
        return match axis.default.is_finite() {
            true => Ok(Axis { default: axis.default.clamp(axis.min, axis.max), ..axis }),
            false => Err(format!("the start leaves it out: give it a value, as --set {name}=…")),
        };
    };
    let Axis { min, max, .. } = axis;
    match (min..=max).contains(&value) {
        true => Ok(Axis { default: value, ..axis }),
        false => Err(format!(
            "the start, {value}, is outside {min} to {max}: move it, as --set {name}=…"
        )),
    }
}

#[cfg(test)]
mod tests {
    use echoloop_dsp::Hardware;

    use crate::parameters::Device;

    use super::*;
    use crate::config::RunConfig;
    use crate::config::preset::{LidarPreset, Protocol};

    fn config(axes: &str, more: &str) -> RunConfig {
        toml::from_str(&format!("{more}\n[tune.axes]\n{axes}")).unwrap()
    }

    fn space(axes: &str, more: &str) -> Result<Space, String> {
        let config = config(axes, more);
        let start = Parameters::start(&config, &Device::REFERENCE).map_err(|e| e.to_string())?;
        let preset = config.registration.preset;
        let device = Device::REFERENCE;
        let space = Space::new(Protocol::Joint, LidarPreset::Paper, preset, start, device);
        space.with_own(&config.tune.axes).map_err(|error| error.to_string())
    }

    fn axis(space: &Space, name: &str) -> Option<Axis> {
        space.axes().iter().find(|axis| axis.name == name).copied()
    }

    #[test]
    fn axes_are_fixed_freed_and_bounded_as_the_user_says() {
        let axes = "lidar.power = \"1..80\"\nlidar.gain = \"fixed\"\nlidar.shots = \"free\"\n\
                    lidar.dither = \"free\"\nregistration.voxel_m = \"0.1..3,linear\"\n\
                    registration.translation_tolerance_m = \"1e-5..1e-2,log\"";
        let space = space(axes, "").unwrap();
        assert_eq!(space.axes().len(), 16 - 1 + 2 + 1);
        let power = axis(&space, "lidar.power").unwrap();
        assert_eq!((power.min, power.max, power.scale), (1.0, 80.0, Scale::Log));
        assert_eq!(axis(&space, "lidar.gain"), None);
        assert_eq!(axis(&space, "lidar.shots").map(|axis| axis.scale), Some(Scale::PowerOfTwo));
        let voxel = axis(&space, "registration.voxel_m").unwrap();
        assert_eq!((voxel.max, voxel.scale, voxel.default), (3.0, Scale::Linear, 0.2));
        let tolerance = axis(&space, "registration.translation_tolerance_m").unwrap();
        assert_eq!((tolerance.scale, tolerance.unit), (Scale::Log, "m"));
        assert_eq!(space.lidar_axes(), (0..9).collect::<Vec<_>>(), "the sensor's come first");
        let ends = [0.0, 1.0].map(|u| space.parameters(&vec![u; space.axes().len()]).0);
        assert_eq!(ends.map(|p| p.get("registration.voxel_m")), [Some(0.1), Some(3.0)]);
        assert_eq!(ends[0].get("lidar.gain"), space.start.get("lidar.gain"));
        let most = ends[1].get("registration.translation_tolerance_m").unwrap();
        assert!(
            (most - 1e-2).abs() < 1e-15,
            "{most}: by way of a logarithm, to the last bit but one"
        );
        for parameters in ends {
            parameters.settings.check(&Hardware::REFERENCE).unwrap();
            parameters.registration.check().unwrap();
        }
    }

    #[test]
    fn what_is_fixed_or_bounded_may_start_beyond_the_usual_range() {
        let voxel = "[registration]\nvoxel_m = 2.5";
        assert!(space("", voxel).unwrap_err().contains("outside 0.05 to 1 m"));
        let wide = space("registration.voxel_m = \"0.1..3\"", voxel).unwrap();
        assert_eq!(wide.start.get("registration.voxel_m"), Some(2.5));
        let fixed = space("registration.voxel_m = \"fixed\"", voxel).unwrap();
        assert_eq!(fixed.parameters(&[0.5; 15]).0.get("registration.voxel_m"), Some(2.5));
        let negative = space("registration.voxel_m = \"fixed\"", "[registration]\nvoxel_m = -1");
        assert!(negative.unwrap_err().contains("registration.voxel_m is -1"));
    }

    #[test]
    fn bounds_that_nobody_takes_and_a_start_outside_them_are_refused() {
        for (axes, said) in [
            ("lidar.power = \"1..500\"", "1 to 500 is outside what the sensor takes, 0.00001 to"),
            ("lidar.power = \"1..50\"", "the start, 75, is outside 1 to 50: move it"),
            ("lidar.shots = \"1..3\"", "expected powers of two as bounds, found 1 to 3"),
            ("lidar.shots = \"1..4,log\"", "it takes whole numbers"),
            ("lidar.waveform_resolution = \"400.5..800\"", "expected whole numbers as bounds"),
            ("lidar.timing = \"0..2\"", "it chooses from"),
            ("lidar.gain = \"-5..30,log\"", "a logarithmic axis begins above 0, found -5"),
            ("registration.voxel_m = \"-1..1,linear\"", "is outside what icp takes"),
            ("registration.feature_radius_m = \"free\"", "it is no setting of icp"),
            ("registration.feature_radius_m = \"fixed\"", "it is no setting of icp"),
            ("registration.translation_tolerance_m = \"free\"", "it has no usual range"),
        ] {
            let error = space(axes, "").unwrap_err();
            let name = axes.split(' ').next().unwrap();
            assert!(error.starts_with(&format!("tune.axes.{name}: ")), "{axes}: {error}");
            assert!(error.contains(said), "{axes}: {error}");
        }
    }
}
