//! A sensor that holds what is configured, and what it is told.

use echoloop_dsp::{ScanPattern, Settings};
use nalgebra::Vector3;

use super::choice::{described, hold_to};
use super::common::Setup;
use super::exit::Failure;
use crate::experiment::config::RunConfig;
use crate::experiment::params::Parameters;
use crate::experiment::scan_cloud::directions;
use crate::link::sensor::{Model, Sensors};

/// Sensors that were asked who they are.
pub(super) struct Ready {
    pub(super) sensors: Sensors,
    /// Which, and its firmware.
    pub(super) sensor: String,
    /// What the configuration starts with.
    pub(super) settings: Settings,
    pub(super) pattern: ScanPattern,
    /// Of every beam.
    pub(super) directions: Vec<Vector3<f32>>,
}

impl Ready {
    /// Opens one, and holds it to the configuration.
    pub(super) fn new(setup: &Setup, config: &RunConfig) -> Result<Self, Failure> {
        let model = Model::from(config);
        let sensors = setup.sensor.sensors(model.clone())?;
        let identity = sensors.identity()?;
        hold_to(&sensors, &identity, &model)?;
        let start = Parameters::start(config, &identity.hardware).map_err(Failure::usage)?;
        let sensor = described(&sensors, &identity);
        let pattern = identity.pattern;
        let directions = directions(&pattern);
        Ok(Self { sensors, sensor, settings: start.settings, pattern, directions })
    }
}
