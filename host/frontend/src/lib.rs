//! The waveform front end: what the detector and the converter make of the light that comes back.
//!
//! Emission, receiver equation, shot and amplifier noise, analog clip and ADC. It sits behind the
//! sensor's virtual buses: power, width, gain and clock reach it only through the registers that
//! the firmware writes.

mod board;
mod counter;
mod haze;
mod hydrometeors;
mod light;
pub mod litl;
mod noise;
mod overload;
mod receiver;
mod shares;
mod shot;
mod soft;
mod synthesis;
mod weather;

use std::sync::Arc;

use counter::Purpose;
use haze::{Haze, Light};
use synthesis::synthesise_over;

pub use board::{Analog, FrontEnd, Trigger};
pub use counter::Stream;
pub use light::{OVERLAP_M, Return, SceneResponse};
pub use litl::Mode;
pub use noise::{NoiseKey, normals, splitmix64};
pub use receiver::{OpticsError, Receiver};
pub use shot::Channel;
pub use synthesis::{Shot, synthesise, synthesise_baseline};
pub use weather::{Air, Precipitation, Weather};

/// A front end that looks at one scene response.
#[derive(Clone, Debug)]
pub struct WaveformFrontEnd {
    receiver: Receiver,
    scene: Arc<SceneResponse>,
    seed: u64,
    shot: Shot,
    haze: Option<Box<Haze>>,
}

impl WaveformFrontEnd {
    /// A front end; `seed` decides all of its noise, together with scan and beam.
    pub fn new(receiver: Receiver, scene: Arc<SceneResponse>, seed: u64) -> Self {
        let haze = Haze::before(&receiver).map(Box::new);
        // The air's α is a matter of every return: worked out once.
        let extinction_per_m = receiver.extinction_per_m();
        let receiver = Receiver { extinction_per_m, weather: Weather::default(), ..receiver };
        Self { receiver, scene, seed, shot: Shot::default(), haze }
    }

    /// Looks at another scene from now on.
    pub fn look_at(&mut self, scene: Arc<SceneResponse>, seed: u64) {
        (self.scene, self.seed) = (scene, seed);
    }

    /// Renders one waveform; `light` is what comes back: returns, and a background.
    fn render(
        &mut self,
        analog: &Analog,
        trigger: Trigger,
        when: When,
        light: Light<'_>,
        codes: &mut [u16],
    ) {
        let (receiver, shot) = (&self.receiver, &mut self.shot);
        let window = NoiseKey::new(self.seed, trigger);
        let (key, photons) = match when {
            When::Before => (window.before_the_trigger(), Purpose::PhotonsBefore),
            When::Window => (window, Purpose::Photons),
        };
        match receiver.mode {
            Mode::Physical => {
                synthesise_over(receiver, analog, light.returns, light.background, key, shot, codes)
            }
            Mode::LitlCompat => {
                let photons = Stream::of_shot(self.seed, photons, trigger);
                litl::synthesise(
                    receiver,
                    analog,
                    light.returns,
                    light.background,
                    key,
                    photons,
                    shot,
                    codes,
                );
            }
        }
    }
}

/// Before the shot, or after it.
#[derive(Clone, Copy)]
enum When {
    Before,
    Window,
}

impl FrontEnd for WaveformFrontEnd {
    fn adc_bits(&self) -> u32 {
        self.receiver.adc_bits
    }

    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]) {
        let Some(analog) = self.receiver.hear(analog, self.seed, trigger) else {
            return codes.fill(0);
        };
        let (before, window) = codes.split_at_mut(analog.pre_trigger.min(codes.len()));
        self.render(&analog, trigger, When::Before, Light::default(), before);
        let scene = Arc::clone(&self.scene);
        let returns = scene.of(trigger.beam as usize);
        // Taken out so that it can be lent beside the rest.
        let Some(mut haze) = self.haze.take() else {
            return self.render(
                &analog,
                trigger,
                When::Window,
                Light { returns, background: &[] },
                window,
            );
        };
        let light = haze.fill(&self.receiver, &analog, returns, (self.seed, trigger), window.len());
        self.render(&analog, trigger, When::Window, light, window);
        self.haze = Some(haze);
    }
}
