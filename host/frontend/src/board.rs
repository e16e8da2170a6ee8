//! What a front end is asked, and answers.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What the registers ask of the analog world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Analog {
    /// Peak laser power, W.
    pub power_w: f64,
    /// Full width at half maximum of the pulse, ns.
    pub pulse_width_ns: f64,
    /// Analog gain, dB.
    pub gain_db: f64,
    /// Time between samples, ns.
    pub sample_period_ns: f64,
    /// From the trigger, which is the beginning of the pulse, to sample 0 of the window, ns.
    pub delay_ns: f64,
    /// Samples taken just before the trigger, in front of those of the window.
    pub pre_trigger: usize,
    /// What is added before conversion, fraction of full scale.
    pub black_level: f64,
    /// By how much the gain rises after the trigger, dB/ns; 0: it is full everywhere.
    pub gain_slope_db_ns: f64,
    /// From the trigger to when the gain is full, ns.
    pub gain_full_ns: f64,
    /// Range from which the receiver sees the whole beam, m; at nine tenths of it, nothing.
    pub overlap_m: f64,
}

impl Analog {
    /// ξ: how much of the beam the receiver sees at a range.
    pub fn overlap(&self, range_m: f64) -> f64 {
        let blind_m = 0.9 * self.overlap_m;
        ((range_m - blind_m) / (self.overlap_m - blind_m)).clamp(0.0, 1.0)
    }

    /// Gain of a sample of the window, a factor: less than that of `gain_db` while it rises.
    pub fn gain_at(&self, n: usize) -> f64 {
        let at_ns = self.delay_ns + n as f64 * self.sample_period_ns;
        let below_db = self.gain_slope_db_ns * (self.gain_full_ns - at_ns).max(0.0);
        libm::pow(10.0, (self.gain_db - below_db) / 20.0)
    }

    /// Samples of the window before the gain is full.
    pub fn near_samples(&self) -> usize {
        let near = ((self.gain_full_ns - self.delay_ns) / self.sample_period_ns).ceil();
        if self.gain_slope_db_ns > 0.0 { near.max(0.0) as usize } else { 0 } // `as` saturates
    }

    /// The default pulse, all registers at rest, 1 ns a sample.
    pub const USUAL: Self = Self {
        power_w: 75.0,
        pulse_width_ns: 5.0,
        gain_db: 0.0,
        sample_period_ns: 1.0,
        delay_ns: 11.0,
        pre_trigger: 0,
        black_level: 0.0,
        gain_slope_db_ns: 0.0,
        gain_full_ns: 0.0,
        overlap_m: 1.0,
    };
}

/// Which shot is fired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trigger {
    /// Number of the scan.
    pub frame: u32,
    /// The beam.
    pub beam: u32,
    /// Of the shots that are added up for one beam, the how manieth, from 0.
    pub shot: u32,
}

/// What decides the noise of a scan, beside beam and shot, where whoever asks for it says so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanNoise {
    /// Takes the place of [`Trigger::frame`].
    pub scan: u32,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// The analog world: light out, codes in.
pub trait FrontEnd {
    /// Resolution of its converter, bits.
    fn adc_bits(&self) -> u32;

    /// Hears what decides the noise of the shots to come; `None`: nobody says. Those whose owner
    /// decides that need not listen, nor those that are not simulated.
    fn name_noise(&mut self, _noise: Option<ScanNoise>) {}

    /// Fills `codes` with the samples of one shot: [`Analog::pre_trigger`] from before it, then the
    /// window's. A pure function of its arguments and of what the front end was made with.
    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]);
}

/// A front end that others can reach while a board has it, to look at another scene with.
impl<F: FrontEnd> FrontEnd for Arc<Mutex<F>> {
    fn adc_bits(&self) -> u32 {
        locked(self).adc_bits()
    }

    fn name_noise(&mut self, noise: Option<ScanNoise>) {
        locked(self).name_noise(noise);
    }

    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]) {
        locked(self).capture(analog, trigger, codes);
    }
}

/// A front end has no state that a panic could leave half done.
fn locked<F>(front_end: &Mutex<F>) -> MutexGuard<'_, F> {
    front_end.lock().unwrap_or_else(PoisonError::into_inner)
}
