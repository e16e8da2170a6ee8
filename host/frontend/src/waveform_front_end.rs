//! A front end before a scene.

use std::sync::Arc;

use crate::aerosol::{Aerosol, Light};
use crate::board::{Analog, FrontEnd, Trigger};
use crate::exposure::{Exposure, ShotBuffers};
use crate::light::SceneResponse;
use crate::litl;
use crate::mode::Mode;
use crate::noise::{Purpose, before_the_trigger, noise_key};
use crate::receiver::Receiver;
use crate::synthesis::synthesise;
use crate::weather::Weather;

/// A front end that looks at one scene response.
#[derive(Clone, Debug)]
pub struct WaveformFrontEnd {
    receiver: Receiver,
    scene: Arc<SceneResponse>,
    seed: u64,
    buffers: ShotBuffers,
    aerosol: Option<Box<Aerosol>>,
}

impl WaveformFrontEnd {
    /// A front end; `seed` decides all of its noise, together with scan and beam.
    pub fn new(receiver: Receiver, scene: Arc<SceneResponse>, seed: u64) -> Self {
        let aerosol = Aerosol::before(&receiver).map(Box::new);
        // The air's α is a matter of every return: worked out once.
        let extinction_per_m = receiver.extinction_per_m();
        let receiver = Receiver { extinction_per_m, weather: Weather::default(), ..receiver };
        Self { receiver, scene, seed, buffers: ShotBuffers::default(), aerosol }
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
        let (receiver, buffers) = (&self.receiver, &mut self.buffers);
        let window = noise_key(self.seed, trigger);
        let (key, photons) = match when {
            When::Before => (before_the_trigger(window), Purpose::PhotonsBefore),
            When::Window => (window, Purpose::Photons),
        };
        let Light { returns, background } = light;
        let exposure = Exposure { receiver, analog, returns, background, key };
        match receiver.mode {
            Mode::Physical => synthesise(&exposure, buffers, codes),
            Mode::LitlCompat => {
                let photons = photons.for_shot(self.seed, trigger);
                litl::synthesise(&exposure, photons, buffers, codes);
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
        // The gain falls when the pulse leaves.
        let quiet = Analog { gain_slope_db_ns: 0.0, ..analog };
        self.render(&quiet, trigger, When::Before, Light::default(), before);
        let scene = Arc::clone(&self.scene);
        let returns = scene.of(trigger.beam as usize);
        // Taken out so that it can be lent beside the rest.
        let Some(mut aerosol) = self.aerosol.take() else {
            return self.render(
                &analog,
                trigger,
                When::Window,
                Light { returns, background: &[] },
                window,
            );
        };
        let light =
            aerosol.fill(&self.receiver, &analog, returns, (self.seed, trigger), window.len());
        self.render(&analog, trigger, When::Window, light, window);
        self.aerosol = Some(aerosol);
    }
}
