//! A sensor that holds what is configured, and what it is told.

use echoloop_dsp::Settings;

use super::choice::{described, hold_to};
use super::common::Setup;
use super::exit::Failure;
use echoloop_closed_loop::beams::Beams;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::parameters::Parameters;
use echoloop_sensors::sensor::{Model, Sensors};

/// Sensors that were asked who they are.
pub(super) struct Ready {
    pub(super) sensors: Sensors,
    /// Which, and its firmware.
    pub(super) sensor: String,
    /// What the configuration starts with.
    pub(super) settings: Settings,
    /// Where they point, and when.
    pub(super) beams: Beams,
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
        let beams = config.scanner.beams(); // the sensor's too, or it would have been refused
        Ok(Self { sensors, sensor, settings: start.settings, beams })
    }
}
