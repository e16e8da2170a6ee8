//! Settings of any method, read and written by name.

use super::error::ConfigError;
use super::method::{Method, with_methods};
use super::mode::FgrMode;
use super::setting::{Setting, SettingField, Use};
use super::table::*;

macro_rules! declare {
    ($($method:ident $config:ident $name:literal $searched:ident $help:literal;)+) => {
        /// The settings of one method.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum MethodConfig {
            $(
                #[doc = concat!("Settings of [`crate::", stringify!($method), "`].")]
                $method($config),
            )+
        }

        impl MethodConfig {
            /// The defaults of a method, for outdoor scans some tens of metres wide.
            pub fn outdoor(method: Method) -> Self {
                match method {
                    $(Method::$method => Self::$method($config::outdoor()),)+
                }
            }

            /// The method of these settings.
            pub fn method(&self) -> Method {
                match self {
                    $(Self::$method(_) => Method::$method,)+
                }
            }

            /// Checks that the method can run with each setting.
            ///
            /// # Errors
            ///
            /// [`ConfigError`] names the first setting out of bounds, and its bound.
            pub fn check(&self) -> Result<(), ConfigError> {
                match self {
                    $(Self::$method(config) => config.check(),)+
                }
            }

            /// The field of the setting with that current name.
            fn field(&mut self, key: &str) -> Option<&mut dyn SettingField> {
                match self {
                    $(Self::$method(config) => config.slot(key),)+
                }
            }
        }
    };
}

with_methods!(declare);

impl Method {
    /// Its settings, in the order of use.
    pub fn settings(self) -> impl Iterator<Item = (&'static Setting, Use)> {
        SETTINGS.iter().filter_map(move |setting| Some((setting, setting.of(self)?)))
    }
}

impl MethodConfig {
    /// The start of a search of the paper's ranges: [`Self::outdoor`] without the settings that the
    /// paper's methods lack.
    pub fn paper(method: Method) -> Self {
        let mut config = Self::outdoor(method);
        for (setting, of) in method.settings() {
            if of.search.is_some_and(|search| search.paper.is_none())
                && let Some(slot) = config.slot(setting.key)
            {
                slot.set(None);
            }
        }
        config
    }

    /// The value of a setting by its name or its former name. `None` when the method has no such
    /// setting, or it is left out.
    pub fn get(&self, key: &str) -> Option<f64> {
        let mut copy = *self;
        copy.slot(key).and_then(|slot| slot.get())
    }

    /// Sets a setting by its name or its former name; false when the method has none.
    pub fn set(&mut self, key: &str, value: f64) -> bool {
        match self.slot(key) {
            Some(slot) => slot.set(Some(value)),
            None => return false,
        }
        true
    }

    /// Leaves out a setting that may be left out; false when the method has none of that name.
    pub fn clear(&mut self, key: &str) -> bool {
        self.slot(key).map(|slot| slot.set(None)).is_some()
    }

    /// Mode of FGR; `None` for other methods.
    pub fn mode(&self) -> Option<FgrMode> {
        match self {
            Self::Fgr(config) => Some(config.mode),
            _ => None,
        }
    }

    /// Sets the seed of the method's draws; false when it draws nothing.
    pub fn set_seed(&mut self, seed: u64) -> bool {
        match self {
            Self::Fgr(config) => config.seed = seed,
            _ => return false,
        }
        true
    }

    /// Raises each setting that is below its bound by another setting to that setting's value;
    /// returns their names.
    pub fn repair(&mut self) -> Vec<&'static str> {
        let mut repaired = Vec::new();
        for (setting, of) in self.method().settings() {
            let other = setting.bound(&of).not_below.and_then(|(other, _)| self.get(other));
            if let (Some(value), Some(least)) = (self.get(setting.key), other)
                && value < least
            {
                self.set(setting.key, least);
                repaired.push(setting.key);
            }
        }
        repaired
    }

    fn slot(&mut self, key: &str) -> Option<&mut dyn SettingField> {
        self.field(setting(key)?.key)
    }
}

#[cfg(test)]
mod tests {
    use super::super::setting::Search;
    use super::*;

    fn all() -> [MethodConfig; Method::ALL.len()] {
        Method::ALL.map(MethodConfig::outdoor)
    }

    fn keys(config: &MethodConfig) -> Vec<&'static str> {
        config.method().settings().map(|(setting, _)| setting.key).collect()
    }

    #[test]
    fn every_key_is_kept_by_its_own_name_and_no_other() {
        for mut config in all() {
            assert_eq!(config.check(), Ok(()));
            for (i, key) in keys(&config).iter().enumerate() {
                assert!(config.set(key, 10.0 + i as f64), "{key}");
            }
            for (i, key) in keys(&config).iter().enumerate() {
                assert_eq!(
                    config.get(key),
                    Some(10.0 + i as f64),
                    "{key} of {:?}",
                    config.method()
                );
            }
            assert!(!config.set("no_such_setting", 1.0));
            assert_eq!(config.get("no_such_setting"), None);
        }
    }

    #[test]
    fn a_former_name_reads_and_sets_its_setting() {
        for mut config in all() {
            for (i, setting) in SETTINGS.iter().enumerate() {
                let Some(former) = setting.former else { continue };
                let has = setting.of(config.method()).is_some();
                assert_eq!(config.set(former, 10.0 + i as f64), has, "{former}");
                assert_eq!(config.get(setting.key), has.then_some(10.0 + i as f64), "{former}");
                assert_eq!(config.get(former), config.get(setting.key));
            }
        }
    }

    #[test]
    fn no_two_settings_share_a_name_or_former_name() {
        let names: Vec<&str> = SETTINGS
            .iter()
            .flat_map(|setting| [setting.key].into_iter().chain(setting.former))
            .collect();
        let mut once = names.clone();
        once.sort_unstable();
        once.dedup();
        assert_eq!(once.len(), names.len());
    }

    #[test]
    fn every_default_and_both_searches_lie_within_the_bounds() {
        for method in Method::ALL {
            for (setting, of) in method.settings() {
                let Some(search) = of.search else { continue };
                let mut config = MethodConfig::outdoor(method);
                let default = config.get(setting.key).unwrap();
                assert!(
                    (search.outdoor.min..=search.outdoor.max).contains(&default),
                    "{setting:?}"
                );
                if let Some((paper, start)) = search.paper {
                    assert!((paper.min..=paper.max).contains(&start));
                }
                for range in [Some(search.outdoor), search.paper.map(|(range, _)| range)] {
                    let Some(range) = range else { continue };
                    for end in [range.min, range.max] {
                        config.set(setting.key, end);
                        config.repair();
                        assert!(setting.check(&of, |key| config.get(key)).is_ok(), "{setting:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_setting_below_its_bound_is_raised_and_named() {
        let mut fgr = MethodConfig::outdoor(Method::Fgr);
        assert_eq!(fgr.repair(), Vec::<&str>::new());
        fgr.set("feature_radius_m", 1.0);
        fgr.set("normal_radius_m", 2.0);
        assert_eq!(fgr.repair(), ["feature_radius_m"]);
        assert_eq!((fgr.get("feature_radius_m"), fgr.check()), (Some(2.0), Ok(())));
        let mut icp = MethodConfig::outdoor(Method::Icp);
        icp.set("first_pair_distance_m", 0.25);
        assert_eq!(icp.repair(), ["first_pair_distance_m"]);
        assert!(icp.clear("first_pair_distance_m") && !fgr.clear("first_pair_distance_m"));
        assert_eq!(icp.get("first_pair_distance_m"), None);
    }

    #[test]
    fn help_is_a_sentence_without_numbers_and_the_bounds_say_the_range_of_each_method() {
        for setting in SETTINGS {
            let help = setting.help;
            assert!(help.ends_with('.') && !help.contains('…'), "{help}");
            assert!(!help.contains(|c: char| c.is_ascii_digit()), "{help}");
        }
        let bounds = |key: &str| setting(key).map(Setting::bounds).unwrap();
        assert_eq!(bounds("voxel_m"), "a length above 0 m, at most 1e6 m");
        assert_eq!(bounds("normal_neighbours"), "icp, gicp: 3 to 1000; fgr, mac: 3 to 500");
        assert_eq!(
            bounds("max_iterations"),
            "icp, gicp: 1 or more; fgr: 1 to 100000; mac: at most 100000"
        );
        assert_eq!(
            bounds("feature_radius_m"),
            "a length above 0 m, at most 1e6 m; normal_radius_m or more (Sec. 3.3)"
        );
    }

    #[test]
    fn the_paper_s_ranges_start_at_open3d_s_example_or_at_their_end_next_to_it() {
        let voxel_m = 0.05;
        for method in Method::ALL {
            let features = FeatureConfig::open3d(voxel_m);
            let example = match method {
                local if !local.is_global() => MethodConfig::Icp(IcpConfig::open3d(voxel_m, 1.0)),
                Method::Fgr => MethodConfig::Fgr(FgrConfig::open3d(voxel_m)),
                Method::Mac => MethodConfig::Mac(MacConfig::from_features(features)),
                _ => continue, // the paper has none like it
            };
            for (setting, of) in method.settings() {
                let Some(Search { paper: Some((paper, start)), .. }) = of.search else { continue };
                // Open3D has no example of MAC's own length, which starts at a round number.
                if setting.key != "length_tolerance_m" {
                    let near = example.get(setting.key).unwrap().clamp(paper.min, paper.max);
                    assert_eq!(start, near, "{} of {method:?}", setting.key);
                }
            }
        }
    }

    #[test]
    fn mode_and_seed_are_those_of_the_method_that_has_them() {
        for mut config in all() {
            let is_fgr = config.method() == Method::Fgr;
            assert_eq!(config.mode().is_some(), is_fgr);
            assert_eq!(config.set_seed(7), is_fgr);
        }
    }

    #[test]
    fn a_count_below_zero_is_refused_by_name() {
        for mut config in all() {
            if !config.set("max_iterations", -3.0) {
                continue;
            }
            if config.method() != Method::Mac {
                assert_eq!(config.check().map_err(|e| e.field), Err("max_iterations"));
            }
            assert_eq!(config.get("max_iterations"), Some(0.0));
        }
    }
}
