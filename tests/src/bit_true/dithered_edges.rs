//! Edge fit of clipped echoes from dithered shots.

use echoloop_dsp::{Hardware, Settings};

use super::edges::{Clipped, Edges};
use super::noise::Noise;
use super::numbers::{floor_root, nearest, product, two_to};
use super::pulse::Pulse;

const SAMPLE: f64 = 65_536.0;

/// Combines shots that begin at different phases into one waveform of a higher sample rate.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dithered {
    phases: usize,
    /// Shots per phase.
    shots: f64,
    /// Q1.15 LSB of a code of one shot.
    code: f64,
    /// Lowest saturated sum of a phase's shots.
    clip: f64,
    pulse: Pulse,
}

impl Dithered {
    /// `None` without dithered shots, or when the pulse is too long.
    pub(super) fn new(settings: &Settings, hardware: &Hardware, period_fs: f64) -> Option<Self> {
        let phases = if settings.dither == 1 { settings.shots.min(4) } else { 1 };
        let shots = f64::from(settings.shots) / f64::from(phases);
        let bits = hardware.adc_bits as i32;
        let width_ps = f64::from(settings.pulse_width_ps) * f64::from(phases);
        (phases > 1 && width_ps * 1e3 <= 127.0 * period_fs).then(|| Self {
            phases: phases as usize,
            shots,
            code: two_to(15 - bits),
            clip: nearest(f64::from(settings.saturation_ppm) * shots * (two_to(bits) - 1.0) / 1e6)
                .min(65_535.0),
            pulse: Pulse::new(width_ps, period_fs),
        })
    }

    /// Fits a clipped run; `shots` hold the window's codes only.
    pub(super) fn fit(
        &self,
        shots: &[&[u16]],
        (first, last): (usize, usize),
        (ambient, above): (f64, impl Fn(usize, f64, f64) -> f64),
        noise: &Noise,
    ) -> Option<Edges> {
        let samples = shots.first()?.len();
        // Sum of every fourth shot, by phase.
        let sum = |n: usize, phase: usize| {
            let of_phase = shots.iter().enumerate().filter(|(k, _)| k % self.phases == phase);
            of_phase.map(|(_, codes)| f64::from(codes[n])).sum::<f64>()
        };
        let from = first.checked_sub(4)?;
        let to = (last + 5).min(samples);
        let fine: Vec<f64> =
            (from..to).flat_map(|n| (0..self.phases).map(move |k| sum(n, k))).collect();
        let middle = (first + last) * self.phases / 2 - from * self.phases;
        if fine.len() > 512 || fine[middle] < self.clip {
            return None;
        }
        let begin = (0..middle).rfind(|&j| fine[j] < self.clip).map_or(0, |j| j + 1);
        let end = (middle..fine.len()).find(|&j| fine[j] < self.clip).unwrap_or(fine.len()) - 1;
        // Time of a finer sample, Q16.16 samples of the waveform, rounded down.
        let phases = self.phases as f64;
        let time = |j: usize| ((2.0 * j as f64 + 1.0 - phases) * SAMPLE / (2.0 * phases)).floor();
        let in_q15 = |sum: f64| (sum * self.code / self.shots).floor();
        let x: Vec<f64> = fine
            .iter()
            .enumerate()
            .map(|(i, &sum)| {
                let j = from * self.phases + i;
                above(j / self.phases, time(j), in_q15(sum.min(self.clip)))
            })
            .collect();
        let root = floor_root(product(two_to(30), self.phases as f64));
        let most = two_to(32) - 1.0;
        let noise = Noise {
            sigma: ((product(noise.sigma, root) >> 15) as f64).min(most),
            shot: (noise.shot * self.phases as f64).min(most),
        };
        let level = (in_q15(self.clip) - ambient).max(1.0);
        let clipped = Clipped { pulse: &self.pulse, x: &x, level, first: begin, last: end, noise };
        let edges = clipped.fit()?;
        let time = edges.time + (from * self.phases) as f64 * SAMPLE;
        Some(Edges {
            time: ((2.0 * time - (phases - 1.0) * SAMPLE) / (2.0 * phases)).floor(),
            sigma: (edges.sigma / phases).floor(),
            ..edges
        })
    }
}
