//! What a waveform is made from, and the memory that it is made in.

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
    /// Signal current, µA.
    signal_ua: Vec<f32>,
    /// Standard normals.
    normal: Vec<f32>,
}

impl ShotBuffers {
    /// Memory for this many samples: signal, which is `background` to begin with, and normals of an
    /// earlier shot.
    #[inline(always)]
    pub(crate) fn begin(&mut self, samples: usize, background: &[f32]) -> (&mut [f32], &mut [f32]) {
        if self.normal.len() < samples {
            self.signal_ua.resize(samples, 0.0);
            self.normal.resize(samples, 0.0);
        }
        let signal_ua = &mut self.signal_ua[..samples];
        let (lit, dark) = signal_ua.split_at_mut(background.len().min(samples));
        lit.copy_from_slice(&background[..lit.len()]);
        dark.fill(0.0);
        (signal_ua, &mut self.normal[..samples])
    }
}
