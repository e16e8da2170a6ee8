//! `[data]`: pairs of scans to register, and the limits of a success.

use echoloop_parameters::{Bounds, Refused, section};
use echoloop_registration::Method;
use serde::{Deserialize, Serialize};

section! {
    /// Pairs of scans to register.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default, expecting = "a table, [data]")]
    pub struct DataConfig in "data" {
        train_pairs: usize, "pairs", Bounds::between(1.0, 1e4),
            "Pairs to tune on: 30, of global methods 100, with the paper's strategy 10.";
        test_pairs: usize, "pairs", Bounds::between(1.0, 1e4),
            "Pairs to judge on, from other viewpoints of the same towns: 10 m from any to tune on, \
             less where the place is under 100 m wide.";
        check_pairs: usize, "pairs", Bounds::between(0.0, 1e4),
            "More pairs of the towns that are tuned in, `baseline_m` apart, which no search sees: \
             on them the choice must do better than start, warm starts and halves, or that is \
             chosen. Three times as many as `train_pairs`, 100 at most; 0, none, with the paper's \
             strategy.";
        baseline_m: f64, "m", Bounds::between(0.0, 100.0),
            "Distance of a pair's scans, m: the paper's 2 for local methods, 5 for global ones.";
        train_baseline_factor: f64, "times", Bounds::between(1.0, 10.0),
            "Pairs to tune on are up to so many times as far apart, evenly: what is chosen on them \
             keeps away from where registrations begin to fail. 1 for global methods, which fail \
             often enough on pairs like those that are judged, and with the paper's strategy.";
        difficulty: f64, "steps", Bounds::between(0.0, 6.0),
            "How hard pairs are made: each step doubles `baseline_m` and `heading_range_deg` (up \
             to 180).";
        interval_s: f64, "s", Bounds::between(0.0, 60.0),
            "Time from the first scan of a pair to the second: vehicles on the roads of towns \
             drive on, 5 to 10 m/s, 20 m at most.";
        least_overlap: f64, "of 1", Bounds::between(0.0, 1.0),
            "Share of what either scan of a pair sees that the other sees, too, at least; pairs \
             that share less are drawn again.";
        most_overlap: f64, "of 1", Bounds::between(0.0, 1.0),
            "The same at most.";
        heading_range_deg: f64, "°", Bounds::between(0.0, 180.0),
            "The second scan's heading differs by at most this, degrees.";
        tilt_range_deg: f64, "°", Bounds::between(0.0, 45.0),
            "Roll and pitch of each scan, at most, degrees.";
        success_translation_m: f64, "m", Bounds::above(0.0, 100.0),
            "A registration succeeds within this translation, m, and `success_rotation_deg`.";
        success_rotation_deg: f64, "°", Bounds::above(0.0, 180.0),
            "A registration succeeds within this rotation, degrees, and `success_translation_m`.";
    }
}

impl Default for DataConfig {
    fn default() -> Self {
        Self {
            train_pairs: 30,
            test_pairs: 40,
            check_pairs: Self::usual_check_pairs(30),
            baseline_m: 2.0,
            train_baseline_factor: 2.0,
            difficulty: 0.0,
            interval_s: 0.5,
            least_overlap: 0.0,
            most_overlap: 1.0,
            heading_range_deg: 10.0,
            tilt_range_deg: 2.0,
            success_translation_m: 0.5,
            success_rotation_deg: 2.5,
        }
    }
}

impl DataConfig {
    /// Factor of the difficulty on the distance and the turn of a pair.
    fn times(&self) -> f64 {
        libm::exp2(self.difficulty)
    }

    /// Distance of a pair's scans at this difficulty, m.
    pub fn hard_baseline_m(&self) -> f64 {
        self.times() * self.baseline_m
    }

    /// Largest difference of headings at this difficulty, degrees.
    pub fn hard_heading_range_deg(&self) -> f64 {
        (self.times() * self.heading_range_deg).min(180.0)
    }

    /// True when a pair's overlap is within the limits.
    pub fn wants(&self, overlap: f64) -> bool {
        (self.least_overlap..=self.most_overlap).contains(&overlap)
    }

    /// Checks that a pair can exist.
    ///
    /// # Errors
    ///
    /// [`Refused`] names the key.
    pub fn check(&self) -> Result<(), Refused> {
        self.check_keys()?;
        let (least, most) = (self.least_overlap, self.most_overlap);
        let expected = format!("at most data.most_overlap = {most}");
        let refused = || Refused::new("data.least_overlap", least, expected);
        (least <= most).then_some(()).ok_or_else(refused)
    }

    /// Default number of check pairs. Resampled, the two runs of the study's seed 1 that gain
    /// least by a sensor, 0.63 and 0.66 times the error, are one standard error ahead on 30 pairs
    /// in 89 and 83 cases of 100, on 90 in 99; and one that is as good is in a case of six on any.
    pub fn usual_check_pairs(train_pairs: usize) -> usize {
        train_pairs.saturating_mul(3).min(100)
    }

    /// Defaults for a method, as in the paper: local methods get scans 2 m apart and succeed within
    /// 0.5 m and 2.5°, global ones 5 m, 1 m and 5°. Global ones lose pairs whatever their settings:
    /// of 30 a search finds half, and what wins on those by chance loses on others, so they have
    /// more to tune on, and none that is harder than those that are judged.
    pub fn for_method(method: Method) -> Self {
        let local = Self::default();
        match method.is_global() {
            true => Self {
                train_pairs: 100,
                check_pairs: Self::usual_check_pairs(100),
                baseline_m: 5.0,
                train_baseline_factor: 1.0,
                success_translation_m: 1.0,
                success_rotation_deg: 5.0,
                ..local
            },
            false => local,
        }
    }
}
