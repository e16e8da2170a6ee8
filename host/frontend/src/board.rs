//! The interface between a board and a front end: analog settings in, samples out.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Analog settings, as the registers ask for them.
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
    /// Delay from the trigger, at which the pulse begins, to sample 0 of the window, ns.
    pub delay_ns: f64,
    /// Samples taken just before the trigger; they precede those of the window.
    pub pre_trigger: usize,
    /// Offset added before conversion, fraction of full scale.
    pub black_level: f64,
    /// Slope of the gain after the trigger, dB/ns; 0: full gain everywhere.
    pub gain_slope_db_ns: f64,
    /// Time from the trigger to full gain, ns.
    pub gain_full_ns: f64,
    /// Range from which the receiver sees the whole beam, m; up to nine tenths of it, it sees none.
    pub overlap_m: f64,
}

impl Analog {
    /// ξ, fraction of the beam that the receiver sees at a range.
    pub fn overlap(&self, range_m: f64) -> f64 {
        let blind_m = 0.9 * self.overlap_m;
        ((range_m - blind_m) / (self.overlap_m - blind_m)).clamp(0.0, 1.0)
    }

    /// Gain of a sample of the window, as a factor; below that of `gain_db` while it rises.
    pub fn gain_at(&self, n: usize) -> f64 {
        let at_ns = self.delay_ns + n as f64 * self.sample_period_ns;
        let below_db = self.gain_slope_db_ns * (self.gain_full_ns - at_ns).max(0.0);
        libm::pow(10.0, (self.gain_db - below_db) / 20.0)
    }

    /// Number of samples of the window before the gain is full.
    pub fn near_samples(&self) -> usize {
        let near = ((self.gain_full_ns - self.delay_ns) / self.sample_period_ns).ceil();
        if self.gain_slope_db_ns > 0.0 { near.max(0.0) as usize } else { 0 } // `as` saturates
    }

    /// The default pulse, neutral registers, 1 ns a sample.
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

/// Identity of a shot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Trigger {
    /// Number of the scan.
    pub frame: u32,
    /// Index of the beam.
    pub beam: u32,
    /// Index of the shot among those averaged for the beam, from 0.
    pub shot: u32,
}

/// Identity of a scan's noise, when the host sets it instead of the front end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanNoise {
    /// Takes the place of [`Trigger::frame`].
    pub scan: u32,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// The analog hardware: fires pulses and samples what returns.
pub trait FrontEnd {
    /// Resolution of its converter, bits.
    fn adc_bits(&self) -> u32;

    /// Sets the noise of the following shots; `None`: the front end's own. Ignored by default, as
    /// by hardware that is not simulated.
    fn name_noise(&mut self, _noise: Option<ScanNoise>) {}

    /// Steers the beam of the following shots to a cell ([`crate::SceneResponse::cells`]). Ignored
    /// by default, as by hardware whose beams are fixed.
    fn steer(&mut self, _cell: u32) {}

    /// Fills `codes` with the samples of one shot: [`Analog::pre_trigger`] from before the trigger,
    /// then the window's. A pure function of its arguments and of the front end's construction.
    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]);
}

/// A shared front end: its owner can change the scene while a board uses it.
impl<F: FrontEnd> FrontEnd for Arc<Mutex<F>> {
    fn adc_bits(&self) -> u32 {
        locked(self).adc_bits()
    }

    fn name_noise(&mut self, noise: Option<ScanNoise>) {
        locked(self).name_noise(noise);
    }

    fn steer(&mut self, cell: u32) {
        locked(self).steer(cell);
    }

    fn capture(&mut self, analog: &Analog, trigger: Trigger, codes: &mut [u16]) {
        locked(self).capture(analog, trigger, codes);
    }
}

/// A front end has no state that a panic could leave half done.
fn locked<F>(front_end: &Mutex<F>) -> MutexGuard<'_, F> {
    front_end.lock().unwrap_or_else(PoisonError::into_inner)
}
