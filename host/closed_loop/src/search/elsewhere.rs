//! Registrations that a search leaves to others: in other threads, processes or machines.
//!
//! A task is data: whoever has the same configuration can do it ([`Prepared::work`]), and gets the
//! same numbers wherever that is.

use std::collections::BTreeMap;

use echoloop_dsp::Settings;
use echoloop_registration::{FgrMode, MethodConfig};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::batch::Task;
use crate::cost::ScanCost;
use crate::dataset::{Dataset, ScanPair};
use crate::evaluation::objective::PairError;
use crate::parameters::ThetaReg;
use crate::prepared::Prepared;
use echoloop_sensors::sensor::SensorError;

/// Set of pairs of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PairsOf {
    /// [`Dataset::train`].
    Train,
    /// [`Dataset::check`].
    Check,
    /// [`Dataset::test`].
    Test,
}

impl PairsOf {
    /// Pairs of the set.
    pub fn pairs(self, dataset: &Dataset) -> &[ScanPair] {
        match self {
            Self::Train => &dataset.train,
            Self::Check => &dataset.check,
            Self::Test => &dataset.test,
        }
    }
}

/// Registration parameters of a task, to lay over the start of the configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskRegistration {
    /// Settings of the method by name, in their units; `None`: left out.
    pub settings: BTreeMap<String, Option<f64>>,
    /// Mode of FGR.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<FgrMode>,
}

impl TaskRegistration {
    fn of(theta: &ThetaReg) -> Self {
        let method = theta.method;
        let each = method.method().settings();
        let settings = each.map(|(setting, _)| (setting.key.to_owned(), method.get(setting.key)));
        Self { settings: settings.collect(), mode: method.mode() }
    }

    fn over(&self, mut theta: ThetaReg) -> Result<ThetaReg, TaskError> {
        for (key, value) in &self.settings {
            let is_known = match value {
                Some(value) => theta.method.set(key, *value),
                None => theta.method.clear(key),
            };
            if !is_known {
                let method = theta.method.method().name();
                return Err(TaskError::Unknown { key: key.clone(), method });
            }
        }
        if let (MethodConfig::Fgr(fgr), Some(mode)) = (&mut theta.method, self.mode) {
            fgr.mode = mode;
        }
        Ok(theta)
    }
}

/// One candidate on one pair: both scans with its settings, and registrations of them, of as many
/// candidates as share the scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScanTask {
    /// Set of the pair.
    pub set: PairsOf,
    /// Index of the pair in its set.
    pub pair: usize,
    /// Seed of the noise of both scans.
    pub noise: u64,
    /// Settings of the sensor, in codes.
    pub settings: Settings,
    /// Registration parameters.
    pub registrations: Vec<TaskRegistration>,
}

/// Result of a task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScanResult {
    /// Cost of both scans.
    pub costs: [ScanCost; 2],
    /// Error of each registration.
    pub errors: Vec<PairError>,
}

/// A task that cannot be done.
#[derive(Debug, Error)]
pub enum TaskError {
    /// The set has no such pair.
    #[error("pair {pair}: the set has {pairs}")]
    Pair {
        /// Index of the task's pair.
        pair: usize,
        /// Number of pairs.
        pairs: usize,
    },
    /// The method has no such setting.
    #[error("registrations: {method} has no setting {key}")]
    Unknown {
        /// The setting.
        key: String,
        /// The method.
        method: &'static str,
    },
    /// The sensor failed.
    #[error(transparent)]
    Sensor(#[from] SensorError),
}

/// Those who do tasks.
pub trait Elsewhere: Sync {
    /// Results in the order of the tasks; `None` once the search is to end.
    fn results(&self, tasks: Vec<ScanTask>) -> Option<Vec<ScanResult>>;
}

impl ScanTask {
    /// Task of registrations that share the scans of the first.
    pub(super) fn of(set: PairsOf, tasks: &[Task<'_>]) -> Option<Self> {
        let Task { parameters, pair, noise } = *tasks.first()?;
        let each = tasks.iter().map(|task| TaskRegistration::of(&task.parameters.registration));
        let (settings, registrations) = (parameters.settings, each.collect());
        Some(Self { set, pair, noise, settings, registrations })
    }
}

impl Prepared {
    /// Does a task of a search of this configuration.
    ///
    /// # Errors
    ///
    /// [`TaskError`] of a task that is of another configuration, or of the sensor.
    pub fn work(&self, task: &ScanTask) -> Result<ScanResult, TaskError> {
        let ScanTask { set, pair, noise, settings, .. } = *task;
        let (bench, pairs) = (self.bench(), set.pairs(&self.dataset));
        let no_pair = TaskError::Pair { pair, pairs: pairs.len() };
        let scanned = bench.scan(&settings, pair, pairs.get(pair).ok_or(no_pair)?, noise)?;
        let scanner = bench.scanner(self.device.hardware, self.config.motion.duration_s);
        let costs = scanned.scans.each_ref().map(|scan| scanner.cost(&settings, scan));
        let error = |own: &TaskRegistration| {
            own.over(self.start.registration).map(|theta| scanned.register(&theta).0)
        };
        let errors = task.registrations.iter().map(error).collect::<Result<_, _>>()?;
        Ok(ScanResult { costs, errors })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::load;
    use crate::parameters::Parameters;
    use crate::prepared::space;

    #[test]
    fn the_parameters_of_a_task_are_those_of_its_candidate_to_the_bit() {
        for method in ["icp", "gicp", "auto", "fgr", "mac"] {
            for mode in ["annealed", "open3d"] {
                if mode == "open3d" && method != "fgr" {
                    continue;
                }
                let method = format!("registration.method={method}");
                let mode = format!("registration.mode={mode}");
                let config = load(None, &[method.parse().unwrap(), mode.parse().unwrap()]).unwrap();
                let device = config.device();
                let start = Parameters::start(&config, &device).unwrap();
                let space = space(&config, start, device).unwrap();
                let axes = space.axes().len();
                let point = |k: usize| (0..axes).map(move |i| ((i + 7 * k) % 11) as f64 / 10.7);
                let drawn = (0..5).map(|k| space.parameters(&point(k).collect::<Vec<_>>()).0);
                let plain = start.registration.plain();
                let plain = plain.map(|registration| Parameters { registration, ..start });
                for own in drawn.chain(plain).chain([start]) {
                    let task = Task { parameters: &own, pair: 3, noise: u64::MAX };
                    let task = ScanTask::of(PairsOf::Check, &[task]).unwrap();
                    let text = serde_json::to_string(&task).unwrap();
                    let read: ScanTask = serde_json::from_str(&text).unwrap();
                    let theta = read.registrations[0].over(start.registration).unwrap();
                    assert_eq!((read.settings, theta), (own.settings, own.registration), "{text}");
                    assert_eq!((read.set, read.pair, read.noise), (PairsOf::Check, 3, u64::MAX));
                }
            }
        }
    }

    #[test]
    fn a_setting_that_the_method_lacks_is_named() {
        let config = load(None, &[]).unwrap();
        let theta = Parameters::start(&config, &config.device()).unwrap().registration;
        let mut own = TaskRegistration::of(&theta);
        own.settings.insert("clique".into(), Some(1.0));
        let problem = own.over(theta).unwrap_err().to_string();
        assert_eq!(problem, "registrations: icp has no setting clique");
    }
}
