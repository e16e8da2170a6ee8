//! Comparison of a sensor with the configuration.

use echoloop_dsp::{Hardware, MAX_CODES};
use echoloop_link::Room;

use super::{Model, SensorError, Sensors};
use crate::client::Identity;

impl Sensors {
    /// Name and firmware, as in `serial:/dev/ttyACM0@115200, echoloop-sensor 0.1.0`.
    pub fn described(&self, identity: &Identity) -> String {
        format!("{}, {}", self.name(), identity.build)
    }

    /// Refuses a sensor whose beams point elsewhere than the model's, where the scenes are traced.
    /// One that gets its waveforms from the host must also have the model's hardware, and memory
    /// for the longest waveform.
    ///
    /// # Errors
    ///
    /// [`SensorError::Open`] says what differs; [`SensorError::Client`].
    pub fn check(&self, identity: &Identity, model: &Model) -> Result<(), SensorError> {
        let refused = |problem: String| Err(SensorError::open(self.name(), problem));
        let (theirs, ours) = (identity.pattern, model.pattern);
        if theirs != ours {
            return refused(format!(
                "its beams are {theirs}, the configuration's [scanner] has {ours}"
            ));
        }
        let Some(Room { codes, .. }) = self.with(|sensor| Ok(sensor.room()))? else {
            return Ok(());
        };
        if let Some((name, theirs, ours)) = difference(&identity.hardware, &model.hardware) {
            return refused(format!(
                "its {name} is {theirs}, that of the configuration's front end {ours}"
            ));
        }
        if codes < MAX_CODES as u32 {
            return refused(format!(
                "it has memory for waveforms of {codes} codes; they have up to {MAX_CODES}"
            ));
        }
        Ok(())
    }
}

/// Name and both values of the first field that differs.
fn difference(theirs: &Hardware, ours: &Hardware) -> Option<(&'static str, u32, u32)> {
    let table = [
        ("adc_bits", theirs.adc_bits, ours.adc_bits),
        ("range_min_mm", theirs.range_min_mm, ours.range_min_mm),
        ("range_max_mm", theirs.range_max_mm, ours.range_max_mm),
        ("energy_limit_pj", theirs.energy_limit_pj, ours.energy_limit_pj),
        ("unit_echo_milli", theirs.unit_echo_milli, ours.unit_echo_milli),
        ("shot_noise_ppm", theirs.shot_noise_ppm, ours.shot_noise_ppm),
    ];
    table.into_iter().find(|(_, theirs, ours)| theirs != ours)
}
