//! Light that the weather returns: continuous backscatter, single drops and flakes.

use crate::backscatter::{BackscatterResponse, Medium};
use crate::board::{Analog, Trigger};
use crate::hydrometeors::Hydrometeors;
use crate::light::{Glare, Return};
use crate::litl_units as litl;
use crate::mode::Mode;
use crate::noise::Purpose;
use crate::other_lidar::PulseWithin;
use crate::receiver::Receiver;

/// Light that reaches the receiver.
#[derive(Clone, Copy, Default)]
pub(crate) struct Light<'a> {
    pub(crate) returns: &'a [Return],
    /// Signal of each sample besides the returns: µA, or units of the compatibility mode.
    pub(crate) background: &'a [f32],
    /// Another LiDAR's pulse.
    pub(crate) other: Option<PulseWithin>,
}

/// Weather in front of the receiver, with its working memory.
#[derive(Clone, Debug)]
pub(crate) struct Aerosol {
    medium: Medium,
    hydrometeors: Hydrometeors,
    backscatter: BackscatterResponse,
    returns: Vec<Return>,
    background: Vec<f32>,
}

impl Aerosol {
    /// Weather of a receiver; `None` in clear air.
    pub(crate) fn before(receiver: &Receiver) -> Option<Self> {
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
        let (backscatter, returns, background) = Default::default();
        Some(Self { medium, hydrometeors, backscatter, returns, background })
    }

    /// Light from the surfaces, their glare, and light from the air in front of them.
    pub(crate) fn fill(
        &mut self,
        receiver: &Receiver,
        analog: &Analog,
        (surfaces, glare): (&[Return], &[Glare]),
        (seed, trigger): (u64, Trigger),
        samples: usize,
    ) -> Light<'_> {
        let unit = match receiver.mode {
            Mode::Physical => receiver.peak_current_ua(analog.power_w, 0.0, 1.0),
            Mode::LitlCompat => litl::units(analog.power_w),
        };
        self.background.clear();
        self.background.resize(samples, 0.0);
        self.backscatter.prepare(self.medium, analog, samples);
        self.backscatter.add(analog, surfaces, unit as f32, &mut self.background);
        self.returns.clear();
        self.returns.extend_from_slice(surfaces);
        // All shots of a beam are fired within microseconds: they meet the same drops.
        let still = Purpose::Hydrometeors.for_shot(seed, Trigger { shot: 0, ..trigger });
        self.hydrometeors.add(still, &mut self.returns);
        self.returns.extend(glare.iter().map(|of| of.light));
        Light { returns: &self.returns, background: &self.background, other: None }
    }
}
