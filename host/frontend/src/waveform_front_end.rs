//! The simulated front end: a receiver that looks at a scene.

use std::sync::Arc;

use echoloop_random::{Key, Stream};

use crate::aerosol::{Aerosol, Light};
use crate::board::{Analog, FrontEnd, Trigger};
use crate::exposure::{Exposure, ShotBuffers};
use crate::light::{Return, SceneResponse};
use crate::litl;
use crate::mode::Mode;
use crate::noise::{Purpose, before_the_trigger, noise_key};
use crate::other_lidar::OtherPulse;
use crate::receiver::Receiver;
use crate::synthesis::{Prepared, render};
use crate::weather::Weather;

/// Simulated front end that looks at one scene response.
#[derive(Clone, Debug)]
pub struct WaveformFrontEnd {
    receiver: Receiver,
    scene: Arc<SceneResponse>,
    seed: u64,
    /// Cell that the beam is steered to.
    cell: u32,
    aerosol: Option<Box<Aerosol>>,
    /// Returns and glare of the last beam with glare, in clear air.
    with_glare: Vec<Return>,
    before: Rendering,
    window: Rendering,
}

impl WaveformFrontEnd {
    /// A front end; its noise is a function of `seed`, scan, beam and shot.
    pub fn new(receiver: Receiver, scene: Arc<SceneResponse>, seed: u64) -> Self {
        let aerosol = Aerosol::before(&receiver).map(Box::new);
        // Every return needs the air's α: computed once.
        let extinction_per_m = receiver.extinction_per_m();
        let receiver = Receiver { extinction_per_m, weather: Weather::default(), ..receiver };
        let (before, window) = (Rendering::default(), Rendering::default());
        Self { receiver, scene, seed, cell: 0, aerosol, with_glare: Vec::new(), before, window }
    }

    /// Looks at another scene from now on.
    pub fn look_at(&mut self, scene: Arc<SceneResponse>, seed: u64) {
        (self.scene, self.seed) = (scene, seed);
    }
}

/// Working memory for one part of a shot, before the trigger or in the window.
#[derive(Clone, Debug, Default)]
struct Rendering {
    buffers: ShotBuffers,
    /// Constants of the last shot's settings.
    prepared: Option<Prepared>,
}

impl Rendering {
    /// Renders one waveform.
    fn render(
        &mut self,
        receiver: &Receiver,
        analog: &Analog,
        light: Light<'_>,
        (key, photons): (Key, impl FnOnce() -> Stream),
        codes: &mut [u16],
    ) {
        if receiver.mode == Mode::LitlCompat {
            let Light { returns, background, .. } = light;
            let exposure = Exposure { receiver, analog, returns, background, key };
            return litl::synthesise(&exposure, photons(), &mut self.buffers, codes);
        }
        self.prepared.take_if(|of| !of.is_for(analog, codes.len()));
        let prepare = || Prepared::new(receiver, analog, codes.len());
        let prepared = self.prepared.get_or_insert_with(prepare);
        render(prepared, light, key, &mut self.buffers, codes);
    }
}

impl FrontEnd for WaveformFrontEnd {
    fn adc_bits(&self) -> u32 {
        self.receiver.adc_bits
    }

    fn steer(&mut self, cell: u32) {
        self.cell = cell;
    }

    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]) {
        let Some(heard) = self.receiver.hear(analog, self.seed, trigger) else {
            return codes.fill(0);
        };
        let share = heard.power_w / analog.power_w;
        let unshaken_ns = analog.delay_ns;
        let analog = heard;
        let Self { receiver, scene, seed, cell, aerosol, with_glare, before, window } = self;
        let key = noise_key(*seed, trigger);
        let other = scene.other_at(trigger.beam as usize, *cell);
        let moment = Trigger { beam: scene.first_fired_with(trigger.beam), ..trigger };
        let other = other.map(|light| OtherPulse::at(receiver, light, share, (*seed, moment)));
        let (early, codes) = codes.split_at_mut(analog.pre_trigger.min(codes.len()));
        if !early.is_empty() {
            // The gain is full until the pulse leaves; then it falls and rises again.
            let quiet = Analog { gain_slope_db_ns: 0.0, ..analog };
            let photons = || Purpose::PhotonsBefore.for_shot(*seed, trigger);
            let noise = (before_the_trigger(key), photons);
            let other = other.as_ref().map(|pulse| pulse.before_trigger(&quiet));
            before.render(receiver, &quiet, Light { other, ..Light::default() }, noise, early);
        }
        let returns = scene.at(trigger.beam as usize, *cell);
        let glare = scene.glare_in(trigger.beam);
        let light = match aerosol {
            Some(air) => {
                air.fill(receiver, &analog, (returns, glare), (*seed, trigger), codes.len())
            }
            None if glare.is_empty() => Light { returns, ..Light::default() },
            None => {
                with_glare.clear();
                with_glare.extend(returns.iter().copied().chain(glare.iter().map(|of| of.light)));
                Light { returns: with_glare, ..Light::default() }
            }
        };
        // The laser's own jitter moves the echoes in the window, and not the other's pulse.
        let still = Analog { delay_ns: unshaken_ns, ..analog };
        let light = Light { other: other.map(|pulse| pulse.in_window(&still)), ..light };
        let photons = || Purpose::Photons.for_shot(*seed, trigger);
        window.render(receiver, &analog, light, (key, photons), codes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Glare;
    use crate::weather::Precipitation;

    fn codes(receiver: &Receiver, scene: &SceneResponse, beam: u32) -> Vec<u16> {
        let mut front_end = WaveformFrontEnd::new(receiver.clone(), Arc::new(scene.clone()), 5);
        let mut codes = vec![0; 800];
        front_end.capture(&Analog::USUAL, Trigger { frame: 1, beam, shot: 0 }, &mut codes);
        codes
    }

    /// Samples of a beam at the sky that glare at 40 m changes.
    fn changed_by_glare(receiver: &Receiver, beam: u32) -> Vec<usize> {
        let light = Return { range_m: 40.0, strength_per_m2: 1e-3 };
        let sky = SceneResponse::empty(64);
        let glared = SceneResponse { glare: vec![Glare { beam, light }], ..sky.clone() };
        let [without, with] = [&sky, &glared].map(|scene| codes(receiver, scene, beam));
        (0..800).filter(|&n| without[n] != with[n]).collect()
    }

    #[test]
    fn glare_hides_no_weather_and_is_seen_at_its_own_range_alone() {
        for mode in [Mode::Physical, Mode::LitlCompat] {
            for kind in Precipitation::ALL {
                let weather = Weather { kind, visibility_m: 100.0, ..Weather::default() };
                let receiver = Receiver { mode, weather, ..Receiver::default() };
                for beam in 0..8 {
                    let changed = changed_by_glare(&receiver, beam);
                    // A pulse of 10 ns, 267 ns after the trigger and 256 after the window begins.
                    let [first, .., last] = changed[..] else {
                        panic!("{mode:?} {kind:?}: unseen")
                    };
                    assert!(first >= 255 && last < 290, "{mode:?} {kind:?}: {first} to {last}");
                }
            }
        }
    }
}
