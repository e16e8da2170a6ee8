//! What a waveform is made from, and the memory that it is made in.

use std::ops::Range;

use echoloop_random::Key;

use crate::board::Analog;
use crate::light::Return;
use crate::receiver::Receiver;

/// One shot: who looks, with which settings, at what.
#[derive(Clone, Copy, Debug)]
pub struct Exposure<'a> {
    /// Optics, detector and converter.
    pub receiver: &'a Receiver,
    /// What the registers ask for.
    pub analog: &'a Analog,
    /// What comes back from surfaces, by increasing range.
    pub returns: &'a [Return],
    /// Signal that flows besides, a sample: µA, or units in the compatibility mode. Beyond its end,
    /// none.
    pub background: &'a [f32],
    /// The noise.
    pub key: Key,
}

/// Working memory of one shot.
#[derive(Clone, Debug, Default)]
pub struct ShotBuffers {
    /// Signal current, µA. Between shots there is none.
    signal_ua: Vec<f32>,
    /// Samples with a signal.
    lit: Vec<Range<usize>>,
    /// Standard normals.
    normal: Vec<f32>,
}

impl ShotBuffers {
    /// Memory for this many samples, of which the first have a background.
    #[inline(always)]
    pub(crate) fn begin(&mut self, samples: usize, background: &[f32]) -> Shot<'_> {
        if self.normal.len() < samples {
            self.signal_ua.resize(samples, 0.0);
            self.normal.resize(samples, 0.0);
        }
        let Self { signal_ua, lit, normal } = self;
        let (signal_ua, normal) = (&mut signal_ua[..samples], &mut normal[..samples]);
        let bright = background.len().min(samples);
        signal_ua[..bright].copy_from_slice(&background[..bright]);
        lit.clear();
        lit.extend((bright > 0).then_some(0..bright));
        Shot { signal_ua, lit, normal }
    }
}

/// Memory of a shot under way.
pub(crate) struct Shot<'a> {
    /// Signal: at first the background.
    pub(crate) signal_ua: &'a mut [f32],
    /// Samples with a signal.
    pub(crate) lit: &'a mut Vec<Range<usize>>,
    /// Normals of an earlier shot.
    pub(crate) normal: &'a mut [f32],
}

impl Shot<'_> {
    /// Leaves no signal behind.
    #[inline(always)]
    pub(crate) fn end(self) {
        self.lit.drain(..).for_each(|span| self.signal_ua[span].fill(0.0));
    }
}
