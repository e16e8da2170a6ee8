//! The `[motion]` section: a sensor that moves and shakes while it scans.

use echoloop_dsp::ScanPattern;
use echoloop_parameters::{Bounds, choice, section};
use serde::{Deserialize, Serialize};

section! {
    /// Motion of the sensor during a scan. Off: it stands still, and a scan is taken at once.
    ///
    /// A beam is fired when the pattern says, of the grid's `n` beams the one `b` at
    /// `t = ((b + ½)/n − ½) · duration`. The pose of a scan, and so the truth of a pair, is that of
    /// its middle, t = 0; points are laid out as if all were measured from there. A steered sensor
    /// that moves takes `lidar.frame_time` for a scan, whatever the duration here.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [motion]")]
    pub struct Motion in "motion" {
        duration_s: f64, "s", Bounds::between(0.0, 10.0),
            "Time from a scan's first beam to its last, s; 0: all at once.";
        linear_m_s: [f64; 3], "m/s", Bounds::between(-100.0, 100.0),
            "Velocity in the sensor's frame (x forward, y left, z up), m/s.";
        angular_deg_s: [f64; 3], "°/s", Bounds::between(-3600.0, 3600.0),
            "Angular velocity about the sensor's axes, degrees/s.";
        jitter_mrad: f64, "mrad", Bounds::between(0.0, 100.0),
            "Spread of the shaking about each axis, mrad.";
        jitter_mm: f64, "mm", Bounds::between(0.0, 1000.0),
            "Spread of the shaking along each axis, mm.";
        jitter_per: JitterPer, "", JitterPer::BOUNDS,
            "What shakes as one: `column` or `beam`.";
    }
}

choice! {
    /// Beams that shake as one.
    pub enum JitterPer by default Column {
        /// The beams of a column.
        Column = "column",
        /// Each beam for itself.
        Beam = "beam",
    }
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            duration_s: 0.0,
            linear_m_s: [0.0; 3],
            angular_deg_s: [0.0; 3],
            jitter_mrad: 0.0,
            jitter_mm: 0.0,
            jitter_per: JitterPer::Column,
        }
    }
}

impl Motion {
    /// Time of a scan, s: `duration_s`, or where that is not 0 the frame time of a steered sensor.
    pub fn scan_s(&self, pattern: &ScanPattern) -> f64 {
        match pattern {
            ScanPattern::Steered(_) if self.duration_s > 0.0 => pattern.duration_s(),
            _ => self.duration_s,
        }
    }

    /// True when every beam has the same pose.
    pub fn is_still(&self) -> bool {
        let steady = self.duration_s == 0.0
            || (self.linear_m_s == [0.0; 3] && self.angular_deg_s == [0.0; 3]);
        steady && self.jitter_mrad == 0.0 && self.jitter_mm == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::RunConfig;

    fn fault(text: &str) -> String {
        let config: RunConfig = toml::from_str(text).unwrap();
        config.check().unwrap_err().to_string()
    }

    #[test]
    fn a_switch_out_of_bounds_is_named() {
        for (text, message) in [
            ("[motion]\nduration_s = -1.0", "motion.duration_s = -1 must be 0 to 10"),
            (
                "[motion]\nlinear_m_s = [0.0, nan, 0.0]",
                "motion.linear_m_s = [0.0, NaN, 0.0] must be three numbers, -100 to 100",
            ),
            (
                "[motion]\nangular_deg_s = [0.0, 0.0, 1e4]",
                "motion.angular_deg_s = [0.0, 0.0, 10000.0] must be three numbers",
            ),
            ("[motion]\njitter_mrad = nan", "motion.jitter_mrad = NaN must be 0 to 100"),
            ("[motion]\njitter_mm = 1e9", "motion.jitter_mm = 1000000000 must be 0 to 1000"),
            (
                "[weather]\nkind = \"fog\"\nvisibility_m = 3.0",
                "weather.visibility_m = 3 must be 6 to 998",
            ),
            (
                "[weather]\nkind = \"snow\"\nrate_mm_h = 99.0",
                "weather.rate_mm_h = 99 must be 0.1 to 50 in snow",
            ),
            (
                "[receiver]\ntiming_jitter_ns = inf",
                "receiver.timing_jitter_ns = inf must be 0 to 10",
            ),
            ("[receiver]\ndead_channels = 1.5", "receiver.dead_channels = 1.5 must be 0 to 1"),
            (
                "[receiver]\ndead_channels = 0.6\nweak_channels = 0.5",
                "receiver.weak_channels = 0.5 must be 0 to 1 less",
            ),
            (
                "[receiver]\noverload_tail_ns = 0.0",
                "receiver.overload_tail_ns = 0 must be 0.1 to 10000",
            ),
        ] {
            let fault = fault(text);
            assert!(fault.starts_with(message), "{text}: {fault}");
        }
    }

    #[test]
    fn every_switch_is_off_by_default_and_a_choice_is_made_by_name() {
        let plain = RunConfig::default();
        assert!(plain.motion.is_still());
        assert_eq!(plain.front_end().air(), echoloop_frontend::Air::CLEAR);
        let text = "[weather]\nkind = \"wet-snow\"\n[motion]\njitter_per = \"beam\"\n[receiver]\n\
                    mode = \"litl-compat\"";
        let config: RunConfig = toml::from_str(text).unwrap();
        let again: RunConfig = toml::from_str(&toml::to_string(&config).unwrap()).unwrap();
        assert_eq!(config, again);
        assert_ne!(config, plain);
        let unknown =
            toml::from_str::<RunConfig>("[weather]\nkind = \"hail\"").unwrap_err().to_string();
        assert!(unknown.contains("unknown variant `hail`"), "{unknown}");
    }
}
