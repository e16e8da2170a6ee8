//! The weather before a front end: what it adds to the light that comes back.

use crate::Return;
use crate::{Analog, Trigger};

use super::counter::{Purpose, Stream};
use super::hydrometeors::Hydrometeors;
use super::litl::{self, Mode};
use super::receiver::Receiver;
use super::soft::{Medium, SoftResponse};

/// What comes back.
#[derive(Clone, Copy, Default)]
pub(super) struct Light<'a> {
    pub(super) returns: &'a [Return],
    /// Signal current, µA, or units of the compatibility mode, a sample.
    pub(super) background: &'a [f32],
}

/// Weather, with its working memory.
#[derive(Clone, Debug)]
pub(super) struct Haze {
    medium: Medium,
    hydrometeors: Hydrometeors,
    soft: SoftResponse,
    returns: Vec<Return>,
    background: Vec<f32>,
}

impl Haze {
    /// The weather before a receiver; none in clear air.
    pub(super) fn before(receiver: &Receiver) -> Option<Self> {
        let air = receiver.air();
        if air.backscatter_per_m_sr <= 0.0 {
            return None;
        }
        let hydrometeors = Hydrometeors::new(air, receiver.divergence_mrad);
        let medium = Medium {
            extinction_per_m: receiver.extinction_per_m(),
            backscatter_per_m_sr: air.backscatter_per_m_sr,
            from_m: hydrometeors.reach_m,
        };
        let (soft, returns, background) = Default::default();
        Some(Self { medium, hydrometeors, soft, returns, background })
    }

    /// What comes back through it, and from it.
    pub(super) fn fill(
        &mut self,
        receiver: &Receiver,
        analog: &Analog,
        surfaces: &[Return],
        (seed, trigger): (u64, Trigger),
        samples: usize,
    ) -> Light<'_> {
        let unit = match receiver.mode {
            Mode::Physical => receiver.peak_current_ua(analog.power_w, 0.0, 1.0),
            Mode::LitlCompat => litl::units(analog.power_w),
        };
        self.background.clear();
        self.background.resize(samples, 0.0);
        self.soft.prepare(self.medium, analog, samples);
        self.soft.add(analog, surfaces, unit as f32, &mut self.background);
        self.returns.clear();
        self.returns.extend_from_slice(surfaces);
        // All shots of a beam are fired within microseconds: nothing falls far.
        let still = Stream::of_shot(seed, Purpose::Hydrometeors, Trigger { shot: 0, ..trigger });
        self.hydrometeors.add(still, &mut self.returns);
        Light { returns: &self.returns, background: &self.background }
    }
}
