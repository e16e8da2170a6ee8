//! The objective f_opt (Eq. 4): two scans through the sensor, a registration, an error.

use std::borrow::Cow;

use echoloop_dsp::{Echoes, Hardware, Settings};
use serde::{Deserialize, Serialize};

use crate::beams::Beams;
use crate::config::TuneConfig;
use crate::config::preset::ErrorMean;
use crate::cost::Scanner;
use crate::dataset::{Dataset, ScanPair};
use crate::evaluation::scan_cloud::cloud_from_scan;
use crate::parameters::{Parameters, ThetaReg};
use echoloop_clouds::Cloud;
use echoloop_clouds::pose::{Pose, frobenius_error, rotation_error_deg, translation_error_m};
use echoloop_registration::{Outcome, StopReason};
use echoloop_sensors::client::ClientError;
use echoloop_sensors::sensor::{SensorError, Sensors, View};

/// Error of one registered pair.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairError {
    /// Index of the pair in its set.
    pub pair: usize,
    /// e_t of Eq. 7, m.
    pub translation_m: f64,
    /// e_R of Eq. 7, degrees.
    pub rotation_deg: f64,
    /// ‖T_est − T*‖_F of Eq. 3.
    pub frobenius: f64,
    /// Points of both clouds.
    pub points: [usize; 2],
    /// Stop reason of the registration.
    pub stop: String,
    /// Iterations of the registration.
    pub iterations: usize,
}

impl PairError {
    /// True when no motion was found, for want of points, pairs, matches or valid settings. The
    /// error is then that of the initial guess.
    pub fn is_of_no_motion(&self) -> bool {
        let of_nothing = [
            StopReason::EmptyCloud,
            StopReason::TooFewPairs,
            StopReason::TooFewMatches,
            StopReason::BadSettings,
        ];
        of_nothing.iter().any(|reason| reason.name() == self.stop)
    }
}

/// Clouds, scans and motion of a registered pair, to look at.
#[derive(Clone, Debug)]
pub struct Registered {
    /// Error of the motion.
    pub error: PairError,
    /// First and second cloud, each in its sensor's frame.
    pub clouds: [Cloud; 2],
    /// Motion found.
    pub first_from_second: Pose,
    /// First and second scan, as they came over the link.
    pub scans: [Vec<Echoes>; 2],
}

/// Data set and sensors that all evaluations share.
#[derive(Clone, Copy)]
pub struct Bench<'a> {
    /// Pairs and scan pattern.
    pub dataset: &'a Dataset,
    /// Sensors to scan with.
    pub sensors: &'a Sensors,
}

/// A pair scanned with one set of settings.
#[derive(Clone, Debug)]
pub struct Scanned {
    /// First and second scan, as they came over the link.
    pub scans: [Vec<Echoes>; 2],
    /// First and second cloud, each in its sensor's frame.
    pub clouds: [Cloud; 2],
    /// Index of the pair in its set.
    pub pair: usize,
    /// True motion T*, `first_from_second`.
    pub truth: Pose,
}

impl Bench<'_> {
    /// f_opt of Eq. 4: both scans of a pair with one set of parameters, registered from the
    /// identity (which global methods do not look at).
    pub fn register(
        &self,
        parameters: &Parameters,
        index: usize,
        pair: &ScanPair,
        noise_seed: u64,
    ) -> Result<Registered, SensorError> {
        let scanned = self.scan(&parameters.settings, index, pair, noise_seed)?;
        let (error, first_from_second) = scanned.register(&parameters.registration);
        let Scanned { scans, clouds, .. } = scanned;
        Ok(Registered { error, clouds, first_from_second, scans })
    }

    /// Both scans of a pair, with their clouds.
    pub fn scan(
        &self,
        settings: &Settings,
        index: usize,
        pair: &ScanPair,
        noise_seed: u64,
    ) -> Result<Scanned, SensorError> {
        let beams = self.beams(settings)?;
        let scans = self.seen(settings, &beams, pair, noise_seed)?;
        let directions = |i: usize| beams.directions(pair.viewpoints[i]);
        let clouds = [0, 1].map(|i| cloud_from_scan(&scans[i], &directions(i)));
        Ok(Scanned { scans, clouds, pair: index, truth: pair.truth })
    }

    /// Both scans of a pair. The settings reach the sensor over the link, and every echo comes back
    /// over it.
    pub fn echoes(
        &self,
        settings: &Settings,
        pair: &ScanPair,
        noise_seed: u64,
    ) -> Result<[Vec<Echoes>; 2], SensorError> {
        let beams = self.beams(settings)?;
        self.seen(settings, &beams, pair, noise_seed)
    }

    fn seen(
        &self,
        settings: &Settings,
        beams: &Beams,
        pair: &ScanPair,
        noise_seed: u64,
    ) -> Result<[Vec<Echoes>; 2], SensorError> {
        let [first, second] = pair.viewpoints;
        let scenes = [&pair.first, &pair.second].map(|response| response.to(beams));
        self.sensors.with(|sensor| {
            sensor.configure(settings)?;
            Ok([
                sensor.scan(&View { scene: &scenes[0], noise_seed, scan: 1, viewpoint: first })?,
                sensor.scan(&View { scene: &scenes[1], noise_seed, scan: 2, viewpoint: second })?,
            ])
        })
    }

    /// Beams with the aim of these settings.
    ///
    /// # Errors
    ///
    /// [`SensorError`] of an aim that the scan pattern cannot have, or stored pairs do not.
    pub fn beams(&self, settings: &Settings) -> Result<Cow<'_, Beams>, SensorError> {
        let refused =
            |refusal| SensorError::client(self.sensors.name())(ClientError::Refused(refusal));
        match self.dataset.beams.aimed(settings).map_err(refused)? {
            Cow::Owned(_) if self.dataset.has_one_aim() => {
                Err(SensorError::open("scene.stored", "its pairs have the beams of another aim"))
            }
            beams => Ok(beams),
        }
    }

    /// Cost model of a scan, from the hardware, the scan pattern and the duration of a scan, s.
    pub fn scanner(&self, hardware: Hardware, duration_s: f64) -> Scanner {
        Scanner::new(hardware, self.dataset.beams.pattern(), duration_s)
    }
}

impl Scanned {
    /// Error of a registration from the identity, and the motion found.
    ///
    /// A registration that finds nothing returns the identity, its initial guess.
    pub fn register(&self, registration: &ThetaReg) -> (PairError, Pose) {
        let initial = Pose::identity();
        register_clouds(registration, self.pair, &self.clouds, &initial, &self.truth)
    }
}

/// Error of a registration of two clouds, `pair` of their list, from an initial guess; and the
/// motion found, `first_from_second`.
///
/// A registration that finds nothing returns its initial guess.
pub fn register_clouds(
    registration: &ThetaReg,
    pair: usize,
    clouds: &[Cloud; 2],
    initial: &Pose,
    truth: &Pose,
) -> (PairError, Pose) {
    let [first, second] = clouds;
    let outcome = match registration.build() {
        Ok(method) => method.register(first, second, initial),
        Err(_) => Outcome::nothing(initial, StopReason::BadSettings),
    };
    let points = [first.points.len(), second.points.len()];
    (pair_error(pair, &outcome, truth, points), outcome.target_from_source)
}

fn pair_error(pair: usize, outcome: &Outcome, truth: &Pose, points: [usize; 2]) -> PairError {
    let estimate = &outcome.target_from_source;
    PairError {
        pair,
        translation_m: translation_error_m(estimate, truth),
        rotation_deg: rotation_error_deg(estimate, truth),
        frobenius: frobenius_error(estimate, truth),
        points,
        stop: outcome.stop.name().to_owned(),
        iterations: outcome.iterations,
    }
}

/// Lower bound of ‖T_est − T*‖_F in a geometric mean: a tenth of a millimetre.
const LEAST: f64 = 1e-4;

/// Reduction of errors to one number; smaller is better.
///
/// Each kind is a mean of losses, one for each pair, so that candidates can be compared pair by
/// pair, on any number of them. The kinds differ in what a lost pair counts beside the others. Let
/// 99 pairs err by 5 mm and one by the cap of 1: losing it weighs as much as an error 3.0 times as
/// large on all the others by the arithmetic mean, 1.05 by the geometric one, 1.28 by that of
/// square roots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Worth {
    /// Kind of mean.
    pub mean: ErrorMean,
    /// Cap of each error; 0: no cap (Eq. 3).
    pub cap: f64,
}

impl From<&TuneConfig> for Worth {
    fn from(tune: &TuneConfig) -> Self {
        Self { mean: tune.error_mean, cap: tune.error_cap }
    }
}

impl Worth {
    /// Fitness: the mean of ‖T_est − T*‖_F, each at most the cap.
    pub fn of(&self, errors: &[PairError]) -> f64 {
        self.of_mean_loss(self.mean_loss(errors))
    }

    /// The pairs' losses.
    pub fn losses(&self, errors: &[PairError]) -> Vec<f64> {
        errors.iter().map(|error| self.loss(error)).collect()
    }

    /// Mean of the pairs' losses.
    pub fn mean_loss(&self, errors: &[PairError]) -> f64 {
        errors.iter().map(|error| self.loss(error)).sum::<f64>() / errors.len() as f64
    }

    /// Fitness of a mean of losses.
    pub fn of_mean_loss(&self, mean_loss: f64) -> f64 {
        match self.mean {
            ErrorMean::Arithmetic => mean_loss,
            ErrorMean::Geometric => libm::exp(mean_loss),
            ErrorMean::SquareRoot => mean_loss * mean_loss,
        }
    }

    /// Summand of one pair in the mean: its error, the logarithm or the square root of it.
    pub fn loss(&self, error: &PairError) -> f64 {
        let cap = if self.cap > 0.0 { self.cap } else { f64::INFINITY };
        let capped = error.frobenius.min(cap);
        match self.mean {
            ErrorMean::Arithmetic => capped,
            ErrorMean::Geometric => libm::log(capped.max(LEAST)),
            ErrorMean::SquareRoot => libm::sqrt(capped),
        }
    }

    /// Loss of a pair whose fitness is multiplied by a factor.
    pub fn times(&self, loss: f64, factor: f64) -> f64 {
        match self.mean {
            ErrorMean::Arithmetic => loss * factor,
            ErrorMean::Geometric => loss + libm::log(factor),
            ErrorMean::SquareRoot => loss * libm::sqrt(factor),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(frobenius: &[f64]) -> Vec<PairError> {
        let rest = PairError { translation_m: 0.1, rotation_deg: 7.0, ..PairError::default() };
        frobenius.iter().map(|&frobenius| PairError { frobenius, ..rest.clone() }).collect()
    }

    #[test]
    fn a_candidate_is_worth_the_mean_of_its_errors_each_no_more_than_the_cap() {
        let table: [(&[f64], f64, f64); 7] = [
            (&[0.5, 3.0, 100.0], 2.0, 1.5),
            (&[0.5, 3.0, 100.0], 0.0, 34.5), // no cap
            (&[0.5, 3.0, 100.0], 200.0, 34.5),
            (&[0.5, 3.0, 100.0], 0.25, 0.25),
            (&[0.5, 3.0, 100.0], 3.0, 6.5 / 3.0),
            (&[0.125], 1.0, 0.125),
            (&[7.0], 1.0, 1.0),
        ];
        for (frobenius, cap, expected) in table {
            let worth = Worth { mean: ErrorMean::Arithmetic, cap };
            assert_eq!(worth.of(&errors(frobenius)), expected, "{frobenius:?}, cap {cap}");
        }
    }

    #[test]
    fn in_a_geometric_mean_each_pair_counts_by_its_ratio_and_none_for_nothing() {
        let worth = |cap, frobenius: &[f64]| {
            Worth { mean: ErrorMean::Geometric, cap }.of(&errors(frobenius))
        };
        let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(close(worth(0.0, &[0.01, 1.0]), 0.1));
        assert!(close(worth(0.0, &[0.005, 1.0]), worth(0.0, &[0.01, 0.5])));
        assert!(close(worth(0.25, &[0.01, 9.0]), 0.05)); // 9 counts as the cap
        assert!(close(worth(1.0, &[0.0, 1.0]), 0.01)); // and nothing for less than 1e-4
    }

    #[test]
    fn what_a_lost_pair_outweighs_is_more_by_square_roots_than_by_ratios_and_less_than_by_sums() {
        // One of 100 pairs is lost; all others err by so many times 5 mm.
        let worth = |mean, times: f64, last: f64| {
            let mut frobenius = vec![0.005 * times; 99];
            frobenius.push(last);
            Worth { mean, cap: 1.0 }.of(&errors(&frobenius))
        };
        for (mean, times) in [
            (ErrorMean::Arithmetic, 3.0),
            (ErrorMean::SquareRoot, 1.28),
            (ErrorMean::Geometric, 1.05),
        ] {
            let lost = worth(mean, 1.0, 7.0);
            let equal = |times: f64| worth(mean, times, 0.005 * times);
            assert!((equal(0.98 * times)..equal(1.02 * times)).contains(&lost), "{mean:?}");
        }
    }

    #[test]
    fn a_factor_on_every_loss_is_a_factor_on_the_fitness() {
        for mean in [ErrorMean::Arithmetic, ErrorMean::Geometric, ErrorMean::SquareRoot] {
            let worth = Worth { mean, cap: 0.0 };
            let errors = errors(&[0.02, 0.3, 1.7]);
            let losses = errors.iter().map(|error| worth.times(worth.loss(error), 0.7));
            let fitness = worth.of_mean_loss(losses.sum::<f64>() / 3.0);
            assert!((fitness / worth.of(&errors) / 0.7 - 1.0).abs() < 1e-12, "{mean:?}");
        }
    }
}
