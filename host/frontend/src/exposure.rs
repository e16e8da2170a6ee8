//! Inputs of one waveform, and its working memory.

use std::ops::Range;

use echoloop_random::Key;

use crate::board::Analog;
use crate::light::Return;
use crate::receiver::Receiver;

/// One shot: receiver, settings, returned light and noise.
#[derive(Clone, Copy, Debug)]
pub struct Exposure<'a> {
    /// Optics, detector and converter.
    pub receiver: &'a Receiver,
    /// Analog settings.
    pub analog: &'a Analog,
    /// Returns from surfaces, by increasing range; then those of the weather, and glare.
    pub returns: &'a [Return],
    /// Additional signal of each sample: µA, or units in the compatibility mode; 0 past its end.
    pub background: &'a [f32],
    /// Key of the noise.
    pub key: Key,
}

/// Working memory of one shot.
#[derive(Clone, Debug, Default)]
pub struct ShotBuffers {
    /// Signal current, µA; all zero between shots.
    signal_ua: Vec<f32>,
    /// Spans of samples with a signal.
    lit: Vec<Range<usize>>,
    /// Standard normals of the last shot.
    normal: Vec<f32>,
}

impl ShotBuffers {
    /// Memory for this many samples, with the background as their signal.
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

/// Memory of a shot in progress.
pub(crate) struct Shot<'a> {
    /// Signal: the background to begin with.
    pub(crate) signal_ua: &'a mut [f32],
    /// Spans of samples with a signal.
    pub(crate) lit: &'a mut Vec<Range<usize>>,
    /// Standard normals, to be overwritten.
    pub(crate) normal: &'a mut [f32],
}

impl Shot<'_> {
    /// Clears the signal for the next shot.
    #[inline(always)]
    pub(crate) fn end(self) {
        self.lit.drain(..).for_each(|span| self.signal_ua[span].fill(0.0));
    }
}
