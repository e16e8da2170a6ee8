//! Width of an unknown pulse, and the filter to look at a record through.

// No overflow: widths are at most 48 samples; heights Q1.15 times a gain below 2¹⁵; noise below 2³²
// times 2¹⁰; lengths of memory.

use heapless::Vec;

use super::colour::Colour;
use echoloop_dsp::filter::{self, PADDING};
use echoloop_dsp::q::shift_round;
use echoloop_dsp::template::Template;
use echoloop_dsp::{MAX_SAMPLES, MAX_TAPS};

/// Widths of the bank, samples, in ratios of about √2.
pub const WIDTHS: [u32; 10] = [2, 3, 4, 6, 8, 12, 16, 24, 32, 48];

/// Samples on either side of a waveform that the longest filter needs.
pub const MARGIN: usize = MAX_TAPS / 2;

/// A waveform with its first and last sample repeated around it, so that the ends of a record make
/// no edges.
#[derive(Clone, Debug)]
pub struct Padded {
    samples: [i16; MAX_SAMPLES + MAX_TAPS + PADDING],
    length: usize,
}

impl Padded {
    /// Sets a waveform of at most [`MAX_SAMPLES`] samples, which `fill` writes.
    pub fn fill(&mut self, length: usize, fill: impl FnOnce(&mut [i16])) {
        self.length = length.min(MAX_SAMPLES);
        let end = MARGIN + self.length;
        fill(self.samples.get_mut(MARGIN..end).unwrap_or_default());
        let x = self.x();
        let (first, last) =
            (x.first().copied().unwrap_or_default(), x.last().copied().unwrap_or_default());
        self.samples.get_mut(..MARGIN).unwrap_or_default().fill(first);
        self.samples.get_mut(end..).unwrap_or_default().fill(last);
    }

    /// The waveform.
    pub fn x(&self) -> &[i16] {
        self.samples.get(MARGIN..MARGIN + self.length).unwrap_or_default()
    }

    /// Filters the waveform with symmetric taps, padded to pairs.
    pub fn filter<'y>(&self, taps_in_pairs: &[i16], y: &'y mut [i16; MAX_SAMPLES]) -> &'y [i16] {
        let half = (taps_in_pairs.len().saturating_sub(1) / 2).min(MARGIN);
        let out = y.get_mut(..self.length.next_multiple_of(filter::BLOCK)).unwrap_or_default();
        filter::correlate(
            taps_in_pairs,
            self.samples.get(MARGIN - half..).unwrap_or_default(),
            out,
        );
        y.get(..self.length).unwrap_or_default()
    }
}

impl Default for Padded {
    /// An empty waveform.
    fn default() -> Self {
        Self { samples: [0; MAX_SAMPLES + MAX_TAPS + PADDING], length: 0 }
    }
}

/// Filters for pulses of many widths. They give the width that fits a record best, and the least
/// smoothing that its noise allows.
///
/// ```text
/// y_W     = x through the sin² pulse of W samples                     as of Template
/// S_W     = max y_W / (σ·r_W)
/// pulse   = the first W with S_W ≥ 31/32 of the greatest              2W ≤ N or W = 2
/// view    = the first W with max(100, 8·pulse)·σ·r_W ≤ max x, but not beyond pulse
/// ```
///
/// `σ·r_W` is Q13.19, nearest, `max x` Q1.15. The quotients are compared exactly. Why the least
/// width, and why 100 and 8: benches/record/finder.md, Pulse and view.
#[derive(Clone, Debug)]
pub struct Bank {
    templates: Vec<Template, { WIDTHS.len() }>,
}

/// Noise of a record.
#[derive(Clone, Copy, Debug)]
pub struct RecordNoise<'a> {
    /// σ of a sample, Q13.19.
    pub sigma: u32,
    /// Its colour, where it is not white.
    pub colour: Option<&'a Colour>,
}

impl RecordNoise<'_> {
    /// r of a template, Q1.15.
    pub fn gain(&self, template: &Template) -> u16 {
        self.colour.map_or(template.noise_gain, |colour| colour.noise_gain(template.taps()))
    }

    /// σ after a filter whose noise gain for white noise is `white`, Q13.19, nearest.
    pub fn after(&self, taps: &[i16], white: u16) -> u32 {
        let gain = self.colour.map_or(white, |colour| colour.noise_gain(taps));
        shift_round(i64::from(self.sigma) * i64::from(gain), 15) as u32
    }
}

/// Pulse and view of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    /// Width of the pulse, samples.
    pub pulse: u32,
    /// Index of the filter to look through.
    pub view: usize,
}

impl Bank {
    /// The filters, in the order of [`WIDTHS`].
    pub(crate) fn templates(&self) -> impl Iterator<Item = &Template> {
        self.templates.iter()
    }

    /// The filter of an index of [`WIDTHS`].
    pub fn template(&self, index: usize) -> Option<&Template> {
        self.templates.get(index)
    }

    /// Pulse and view of a record; `pulse`, samples, when it is known.
    pub fn scale(
        &self,
        padded: &Padded,
        noise: RecordNoise<'_>,
        pulse: Option<u32>,
        y: &mut [i16; MAX_SAMPLES],
    ) -> Scale {
        let pulse = pulse.unwrap_or_else(|| self.best(padded, noise, y)).max(1);
        let highest = padded.x().iter().copied().max().unwrap_or_default();
        let factor = i64::from(pulse).min(MARGIN as i64) * 8;
        let quiet = |t: &Template| factor.max(100) * i64::from(noise.after(t.taps(), t.noise_gain));
        let enough =
            |(t, &width): (&Template, &u32)| width >= pulse || quiet(t) <= i64::from(highest) << 4;
        let view = self.templates.iter().zip(&WIDTHS).position(enough).unwrap_or(WIDTHS.len() - 1);
        Scale { pulse, view }
    }

    /// Least width whose SNR is at least 31/32 of the best, samples.
    fn best(&self, padded: &Padded, noise: RecordNoise<'_>, y: &mut [i16; MAX_SAMPLES]) -> u32 {
        let mut heights: Vec<(i64, i64, u32), { WIDTHS.len() }> = Vec::new();
        for (template, &width) in self.templates.iter().zip(&WIDTHS) {
            if width > 2 && 2 * width as usize > padded.x().len() {
                break;
            }
            let top = padded
                .filter(template.taps_in_pairs(), y)
                .iter()
                .copied()
                .max()
                .unwrap_or_default();
            // Never full: its capacity is the number of widths.
            let _ = heights.push((i64::from(top), i64::from(noise.gain(template)), width));
        }
        let best = heights
            .iter()
            .copied()
            .reduce(|a, b| if b.0 * a.1 > a.0 * b.1 { b } else { a })
            .unwrap_or((0, 1, 2));
        let nearly = |&&(top, gain, _): &&(i64, i64, u32)| 32 * top * best.1 >= 31 * best.0 * gain;
        heights.iter().find(nearly).map_or(2, |&(_, _, width)| width)
    }
}

impl Default for Bank {
    /// The filters of [`WIDTHS`].
    fn default() -> Self {
        let template = |&width: &u32| Template::sin_squared(width * 1000, 1_000_000);
        Self { templates: WIDTHS.iter().map(template).collect() }
    }
}
