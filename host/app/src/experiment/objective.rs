//! What a candidate is worth: two scans through the sensor, a registration, an error.

use echoloop_dsp::{Echoes, Settings};
use serde::{Deserialize, Serialize};

use crate::experiment::config::RunConfig;
use crate::experiment::cost::Scanner;
use crate::experiment::dataset::{Dataset, ScanPair};
use crate::experiment::params::Parameters;
use crate::experiment::scan_cloud::cloud_from_scan;
use crate::link::client::ClientError;
use crate::link::sensor::{Sensor, SensorError, Sensors, View};
use echoloop_registration::cloud::Cloud;
use echoloop_registration::pose::{Pose, frobenius_error, rotation_error_deg, translation_error_m};
use echoloop_registration::{Outcome, StopReason};

/// How one pair came out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Why the registration ended.
    pub stop: String,
    /// Its iterations.
    pub iterations: usize,
}

/// A pair's clouds and the motion found, for those who want to look.
#[derive(Clone, Debug)]
pub struct Registered {
    /// How it came out.
    pub error: PairError,
    /// First and second cloud, each in its sensor's frame.
    pub clouds: [Cloud; 2],
    /// The motion found.
    pub first_from_second: Pose,
    /// First and second scan, as they came over the link.
    pub scans: [Vec<Echoes>; 2],
}

/// What every evaluation shares.
#[derive(Clone, Copy)]
pub struct Bench<'a> {
    /// The pairs and the scan pattern.
    pub dataset: &'a Dataset,
    /// The sensors to scan with.
    pub sensors: &'a Sensors,
}

impl Bench<'_> {
    /// f_opt of Eq. 4: both scans of a pair with one set of parameters, registered from the
    /// identity (which global methods do not look at).
    ///
    /// The settings reach the sensor over the link, and every echo comes back over it. A
    /// registration that finds nothing counts as the identity, its initial guess.
    ///
    /// # Errors
    ///
    /// [`SensorError`] when the sensor does not do its part.
    pub fn register(
        &self,
        parameters: &Parameters,
        index: usize,
        pair: &ScanPair,
        noise_seed: u64,
    ) -> Result<Registered, SensorError> {
        // Given back before the registration: others can scan meanwhile.
        let scans = self
            .sensors
            .with(|sensor| scan_pair(sensor, &parameters.settings, pair, noise_seed))?;
        let [first, second] = [0, 1].map(|i| self.cloud(&scans[i], pair.viewpoints[i]));
        let initial = Pose::identity();
        let outcome = match parameters.registration.build() {
            Ok(method) => method.register(&first, &second, &initial),
            Err(_) => Outcome::nothing(&initial, StopReason::BadSettings),
        };
        let error =
            pair_error(index, &outcome, &pair.truth, [first.points.len(), second.points.len()]);
        Ok(Registered {
            error,
            clouds: [first, second],
            first_from_second: outcome.target_from_source,
            scans,
        })
    }

    /// What costs hang on: the hardware of a configuration, and the pattern that is scanned with.
    pub fn scanner(&self, config: &RunConfig) -> Scanner {
        Scanner::new(config.hardware(), self.dataset.beams.pattern(), config.motion.duration_s)
    }

    /// The points of the scan of a viewpoint, sensor frame.
    pub fn cloud(&self, scan: &[Echoes], viewpoint: u32) -> Cloud {
        cloud_from_scan(scan, &self.dataset.beams.directions(viewpoint))
    }
}

/// Both scans of a pair with one set of settings.
fn scan_pair(
    sensor: &mut Sensor,
    settings: &Settings,
    pair: &ScanPair,
    noise_seed: u64,
) -> Result<[Vec<Echoes>; 2], ClientError> {
    let [first, second] = pair.viewpoints;
    sensor.configure(settings)?;
    Ok([
        sensor.scan(&View { scene: &pair.first, noise_seed, scan: 1, viewpoint: first })?,
        sensor.scan(&View { scene: &pair.second, noise_seed, scan: 2, viewpoint: second })?,
    ])
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

/// Fitness: the mean of ‖T_est − T*‖_F, each at most `cap` (0: no cap, Eq. 3).
pub fn fitness(errors: &[PairError], cap: f64) -> f64 {
    let capped = |e: &PairError| if cap > 0.0 { e.frobenius.min(cap) } else { e.frobenius };
    errors.iter().map(capped).sum::<f64>() / errors.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(frobenius: &[f64]) -> Vec<PairError> {
        let error = |(pair, &frobenius): (usize, &f64)| PairError {
            pair,
            translation_m: 0.1,
            rotation_deg: 7.0,
            frobenius,
            points: [100, 200],
            stop: String::new(),
            iterations: 1,
        };
        frobenius.iter().enumerate().map(error).collect()
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
            assert_eq!(fitness(&errors(frobenius), cap), expected, "{frobenius:?}, cap {cap}");
        }
    }
}
