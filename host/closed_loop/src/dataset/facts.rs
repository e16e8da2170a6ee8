//! Statistics of a set of pairs: overlaps and distances.

use std::fmt;

use serde::Serialize;

use super::pairs::{Dataset, ScanPair};
use echoloop_clouds::Pose;
use echoloop_statistics::{median, quantile};

/// Statistics of a set of pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Facts {
    /// Overlaps of the pairs to tune on.
    pub train: Overlaps,
    /// Overlaps of the pairs to judge on.
    pub test: Overlaps,
    /// Least distance between a viewpoint to tune on and one to judge on in the same town, m;
    /// `None` where no town has both.
    pub least_apart_m: Option<f64>,
}

/// Distribution of the overlaps of pairs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Overlaps {
    /// Number of pairs.
    pub pairs: usize,
    /// Minimum, 10 % quantile, median, 90 % quantile, maximum; 0 without pairs.
    pub overlap: [f64; 5],
}

impl Facts {
    /// Statistics of the pairs of a run.
    pub fn new(dataset: &Dataset) -> Self {
        let Dataset { train, test, .. } = dataset;
        let apart = |a: &ScanPair| {
            let same_place = test.iter().filter(|b| b.place == a.place);
            same_place
                .map(|b| apart_m(&a.world_from_sensor, &b.world_from_sensor))
                .min_by(f64::total_cmp)
        };
        Self {
            train: Overlaps::new(train.iter().map(|pair| pair.overlap)),
            test: Overlaps::new(test.iter().map(|pair| pair.overlap)),
            least_apart_m: train.iter().filter_map(apart).min_by(f64::total_cmp),
        }
    }
}

impl Overlaps {
    /// Distribution of these overlaps.
    pub fn new(overlaps: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = overlaps.collect();
        sorted.sort_by(f64::total_cmp);
        if sorted.is_empty() {
            return Self { pairs: 0, overlap: [0.0; 5] };
        }
        let [least, low, high, greatest] = [0.0, 0.1, 0.9, 1.0].map(|s| quantile(&sorted, s));
        let middle = median(sorted.iter().copied());
        Self { pairs: sorted.len(), overlap: [least, low, middle, high, greatest] }
    }
}

/// Least distance between viewpoints of two pairs, seen from above, m.
pub fn apart_m(a: &[Pose; 2], b: &[Pose; 2]) -> f64 {
    let flat =
        |from: &Pose, to: &Pose| (from.translation.vector.xy() - to.translation.vector.xy()).norm();
    let of = |from: &Pose| b.iter().map(|to| flat(from, to)).fold(f64::INFINITY, f64::min);
    a.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// `30 pairs to tune on, overlap 0.52 to 0.91, median 0.74; 40 to judge on, …; at least 10.3 m
/// between them`.
impl fmt::Display for Facts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let phrase = |overlaps: &Overlaps, to: &str| {
            let Overlaps { pairs, overlap: [least, _, median, _, most] } = overlaps;
            if *pairs == 0 {
                return format!("no pairs to {to} on");
            }
            format!("{pairs} pairs to {to} on, overlap {least:.2} to {most:.2}, median {median:.2}")
        };
        write!(f, "{}; {}", phrase(&self.train, "tune"), phrase(&self.test, "judge"))?;
        match self.least_apart_m {
            Some(least_m) => write!(f, "; at least {least_m:.1} m between them"),
            None => Ok(()),
        }
    }
}
