//! The waveform front end: what the detector and the converter make of the light that comes back.
//!
//! Emission, receiver equation, shot and amplifier noise, analog clip and ADC. It sits behind the sensor's virtual buses: power,
//! width, gain and clock reach it only through the registers that the firmware writes.

mod noise;
mod receiver;
mod synthesis;

use std::sync::Arc;

use echoloop_sim::board::{Analog, FrontEnd};
use echoloop_sim::scanner::SceneResponse;

pub use noise::{NoiseKey, normals, splitmix64};
pub use receiver::{OpticsError, Receiver};
pub use synthesis::{Shot, synthesise, synthesise_baseline};

/// A front end that looks at one scene response.
#[derive(Clone, Debug)]
pub struct WaveformFrontEnd {
    receiver: Receiver,
    scene: Arc<SceneResponse>,
    seed: u64,
    shot: Shot,
}

impl WaveformFrontEnd {
    /// A front end; `seed` decides all of its noise, together with scan and beam.
    pub fn new(receiver: Receiver, scene: Arc<SceneResponse>, seed: u64) -> Self {
        Self { receiver, scene, seed, shot: Shot::default() }
    }

    /// Looks at another scene from now on.
    pub fn look_at(&mut self, scene: Arc<SceneResponse>, seed: u64) {
        (self.scene, self.seed) = (scene, seed);
    }
}

impl FrontEnd for WaveformFrontEnd {
    fn adc_bits(&self) -> u32 {
        self.receiver.adc_bits
    }

    fn capture(&mut self, analog: &Analog, frame: u32, beam: u32, codes: &mut [u16]) {
        let key = NoiseKey::new(self.seed, frame, beam);
        synthesise(&self.receiver, analog, self.scene.of(beam as usize), key, &mut self.shot, codes);
    }
}
