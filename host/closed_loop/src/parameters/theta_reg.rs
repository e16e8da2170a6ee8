//! Θ_reg: axes and settings of each method.

use echoloop_parameters::{Kind, Refused};
use echoloop_registration::config::{Range, Use};
use echoloop_registration::{
    ConfigError, FgrConfig, FgrMode, IcpConfig, Method, MethodConfig, Registration, Setting, build,
    setting,
};

use super::axis::Axis;
use super::error::ValueError;
use super::{Ranges, Values};
use crate::config::RegistrationConfig;
use crate::config::preset::Preset;

/// The prefix of these parameters' names.
pub(super) const SECTION: &str = "registration.";

/// Θ_reg of one method, and its refinement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThetaReg {
    /// The method's settings.
    pub method: MethodConfig,
    /// True when point-to-plane ICP refines the result of a global method.
    pub refine: bool,
}

impl ThetaReg {
    /// Start of a configuration: the preset's defaults, then its own values within these ranges.
    ///
    /// # Errors
    ///
    /// [`ValueError`] of the first value outside its axis, or that the method does not have.
    pub fn start(config: &RegistrationConfig, ranges: &[Axis]) -> Result<Self, ValueError> {
        let usual = axes(config.method, config.preset);
        let mut theta =
            Self { method: defaults(config.method, config.preset), refine: config.refine };
        if config.refine && !config.method.is_rough() {
            return Err(ValueError::NotRefined(config.method.name()));
        }
        if config.mode != FgrMode::Annealed && config.method != Method::Fgr {
            return Err(ValueError::NotOfMethod {
                key: "mode".into(),
                method: config.method.name(),
            });
        }
        // Open3D's own example has its own radii and counts; only the voxel is the preset's.
        let own =
            |axis: &&Axis| config.mode == FgrMode::Annealed || axis.name == "registration.voxel_m";
        for axis in usual.iter().filter(own) {
            theta.set(axis.name, axis.default);
            if let (FgrMode::Open3d, MethodConfig::Fgr(fgr)) = (config.mode, &mut theta.method) {
                *fgr = FgrConfig::open3d(axis.default);
            }
        }
        for (key, value) in config.chosen() {
            theta.give(key, value, ranges)?;
        }
        theta.check()?;
        Ok(theta)
    }

    /// Sets a value of the configuration: within its range if it is an axis, else within the
    /// method's bounds.
    fn give(&mut self, key: &'static str, value: f64, axes: &[Axis]) -> Result<(), ValueError> {
        let method = self.method.method();
        let of_method = setting(key).filter(|setting| setting.of(method).is_some());
        let Some(setting) = of_method else {
            return Err(ValueError::NotOfMethod { key: key.into(), method: method.name() });
        };
        match axes.iter().find(|axis| axis.name == setting.path) {
            Some(axis) => axis.require(value)?,
            None if setting.kind == Kind::Whole && value.fract() != 0.0 => {
                return Err(Refused::new(setting.path, value, "a whole number").into());
            }
            None => {}
        }
        self.method.set(key, value);
        Ok(())
    }

    /// The method as the paper has it, with these settings as far as it has them: ICP without a
    /// kernel, without normals that must agree, and with one pair distance from the first iteration
    /// on. `None` where that is what this is.
    pub fn plain(&self) -> Option<Self> {
        let method = self.method.method();
        let mut plain = Self { method: defaults(method, Preset::Paper), refine: self.refine };
        for axis in axes(method, Preset::Paper) {
            self.get(axis.name).map(|value| plain.set(axis.name, value));
        }
        let is_same = axes(method, Preset::Outdoor)
            .iter()
            .all(|axis| plain.get(axis.name) == self.get(axis.name));
        (!is_same).then_some(plain)
    }

    /// The value of a named axis, in its unit.
    pub fn get(&self, name: &str) -> Option<f64> {
        name.strip_prefix(SECTION).and_then(|key| self.method.get(key))
    }

    /// Values of the axes by name, in their units.
    pub fn values<'a>(&self, ranges: impl Into<Ranges<'a>>) -> Values {
        let axes = ranges.into().of_registration(self.method.method());
        let named = axes.iter().map(|axis| axis.name);
        named.filter_map(|name| self.get(name).map(|value| (name.to_owned(), value))).collect()
    }

    /// Sets a named axis; false when the method has none of that name.
    pub fn set(&mut self, name: &str, value: f64) -> bool {
        name.strip_prefix(SECTION).is_some_and(|key| self.method.set(key, value))
    }

    /// Checks that the settings go together.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the first that does not.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.method.check()
    }

    /// Brings settings that are each in range within their joint rules; returns the names of those
    /// changed.
    ///
    /// A feature's neighbourhood narrower than a normal's is widened to it (Sec. 3.3: φ_rad2 ≥
    /// φ_rad1).
    pub fn repair(&mut self) -> Vec<&'static str> {
        self.method.repair()
    }

    /// The method, ready to run.
    ///
    /// ICP that finishes follows the method's voxel alone ([`IcpConfig::refinement`]), so that an
    /// error depends on the settings that are judged, and on no choice made from the pair.
    /// `register` has one pair and looks at it: its
    /// [`refinement`](echoloop_registration::Suggestions::refinement) takes a finer voxel where the
    /// clouds have points enough, and first pairs as far apart as the method's own voxel needs.
    ///
    /// # Errors
    ///
    /// [`ConfigError`] names the setting that cannot run.
    pub fn build(&self) -> Result<Box<dyn Registration>, ConfigError> {
        let finish = self.method.get("voxel_m").filter(|_| self.refine).map(IcpConfig::refinement);
        build(&self.method, finish)
    }
}

/// Defaults of a preset, before its axes.
fn defaults(method: Method, preset: Preset) -> MethodConfig {
    match preset {
        Preset::Outdoor => MethodConfig::outdoor(method),
        Preset::Paper => MethodConfig::paper(method),
    }
}

/// Θ_reg of a method: the axes that registration's table has for it.
pub fn axes(method: Method, preset: Preset) -> Vec<Axis> {
    let outdoor = defaults(method, Preset::Outdoor);
    let axis = |(setting, of): (&'static Setting, Use)| {
        let search = of.search?;
        let (range, default) = match preset {
            Preset::Outdoor => (search.outdoor, outdoor.get(setting.key)?),
            Preset::Paper => search.paper?,
        };
        let Range { min, max, scale } = range;
        Some(Axis { name: setting.path, unit: setting.unit, scale, min, max, default })
    };
    method.settings().filter_map(axis).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(config: &RegistrationConfig) -> Result<ThetaReg, ValueError> {
        ThetaReg::start(config, &axes(config.method, config.preset))
    }

    fn config(method: Method, preset: Preset) -> RegistrationConfig {
        RegistrationConfig { method, preset, ..RegistrationConfig::default() }
    }

    #[test]
    fn every_method_has_all_its_axes_in_both_presets_and_starts_at_their_defaults() {
        for method in Method::ALL {
            for preset in [Preset::Outdoor, Preset::Paper] {
                let theta = start(&config(method, preset)).unwrap();
                for axis in axes(method, preset) {
                    assert_eq!(
                        theta.get(axis.name),
                        Some(axis.default),
                        "{} of {method:?}",
                        axis.name
                    );
                    axis.require(axis.default).unwrap();
                }
                theta.check().unwrap();
            }
        }
    }

    #[test]
    fn open3ds_way_starts_at_its_own_example() {
        let open3d =
            RegistrationConfig { mode: FgrMode::Open3d, ..config(Method::Fgr, Preset::Paper) };
        assert_eq!(start(&open3d).unwrap().method, MethodConfig::Fgr(FgrConfig::open3d(0.05)));
    }

    #[test]
    fn a_setting_that_is_no_axis_is_given_within_the_method_s_bounds() {
        let icp = config(Method::Icp, Preset::Outdoor);
        let given = |key: &str, value: f64| {
            let theta = start(&icp.with(key, value)).map_err(|error| error.to_string());
            theta.map(|theta| theta.method.get(key))
        };
        assert_eq!(given("translation_tolerance_m", 0.002), Ok(Some(0.002)));
        assert_eq!(given("first_pair_distance_m", 6.0), Ok(Some(6.0)));
        assert_eq!(
            given("rotation_tolerance_rad", -1.0),
            Err("registration.rotation_tolerance_rad is -1, expected 0 or more".into())
        );
        let mac = config(Method::Mac, Preset::Outdoor).with("max_matches", 900.5);
        assert_eq!(
            start(&mac).map_err(|error| error.to_string()),
            Err("registration.max_matches = 900.5 must be a whole number".into())
        );
    }

    #[test]
    fn the_paper_s_axes_are_those_of_outdoor_without_what_its_methods_lack() {
        const OURS: [&str; 3] = [
            "registration.first_pair_distance_m",
            "registration.kernel_width",
            "registration.max_normal_angle_rad",
        ];
        assert!(axes(Method::Auto, Preset::Paper).is_empty(), "the paper has no such method");
        for method in [Method::Icp, Method::Gicp, Method::Fgr, Method::Mac] {
            let names =
                |preset| axes(method, preset).iter().map(|axis| axis.name).collect::<Vec<_>>();
            let mut outdoor = names(Preset::Outdoor);
            outdoor.retain(|name| !OURS.contains(name));
            assert_eq!(outdoor, names(Preset::Paper));
            let theta = start(&config(method, Preset::Paper)).unwrap();
            assert_eq!(OURS.map(|name| theta.get(name)), [None; 3], "plain {method:?}");
        }
    }

    #[test]
    fn the_plain_method_has_what_the_paper_s_has_at_our_settings_and_no_more() {
        let icp = start(&config(Method::Icp, Preset::Outdoor)).unwrap();
        let plain = icp.plain().unwrap();
        for axis in axes(Method::Icp, Preset::Outdoor) {
            let is_the_paper_s =
                axes(Method::Icp, Preset::Paper).iter().any(|p| p.name == axis.name);
            let expected = icp.get(axis.name).filter(|_| is_the_paper_s);
            assert_eq!(plain.get(axis.name), expected, "{}", axis.name);
        }
        assert_eq!(plain.plain(), None);
        let fgr = start(&config(Method::Fgr, Preset::Outdoor)).unwrap();
        assert_eq!(fgr.plain(), None);
    }

    #[test]
    fn a_feature_radius_below_the_normal_radius_is_widened_and_says_so() {
        let mut theta = start(&config(Method::Fgr, Preset::Outdoor)).unwrap();
        theta.set("registration.feature_radius_m", 1.0);
        assert_eq!(theta.check().map_err(|e| e.field), Err("feature_radius_m"));
        assert_eq!(theta.repair(), ["feature_radius_m"]);
        assert_eq!(
            theta.get("registration.feature_radius_m"),
            theta.get("registration.normal_radius_m")
        );
        assert_eq!((theta.check(), theta.repair()), (Ok(()), Vec::new()));
    }

    #[test]
    fn what_a_method_does_not_have_is_refused_by_name() {
        let error =
            |config: RegistrationConfig| start(&config).map_err(|e| e.to_string()).unwrap_err();
        let icp = config(Method::Icp, Preset::Outdoor);
        let wide = icp.with("feature_radius_m", 2.0);
        assert_eq!(error(wide), "registration.feature_radius_m is no setting of icp");
        let mode = RegistrationConfig { mode: FgrMode::Open3d, ..icp };
        assert_eq!(error(mode), "registration.mode is no setting of icp");
        let refine = RegistrationConfig { refine: true, ..icp };
        assert_eq!(error(refine), "registration.refine goes with a global method, not with icp");
    }
}
