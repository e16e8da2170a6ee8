//! Width of an unknown pulse, and the filter to look at a record through.

// No overflow: widths are at most 48 samples; heights Q1.15 times a gain below 2¹⁵; noise below 2³²
// times 2¹⁰; lengths of memory.

use heapless::Vec;

use super::colour::Colour;
use echoloop_dsp::filter::{self, PADDING};
use echoloop_dsp::peak::Peaks;
use echoloop_dsp::q::shift_round;
use echoloop_dsp::split::prominent_peaks;
use echoloop_dsp::template::Template;
use echoloop_dsp::{MAX_SAMPLES, MAX_TAPS};

/// Widths of the bank, samples, in ratios of about √2.
pub const WIDTHS: [u32; 10] = [2, 3, 4, 6, 8, 12, 16, 24, 32, 48];

/// Number of neighbouring widths that have to show the same number of tops.
pub const STEADY: usize = 3;

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
/// n_W     = tops of y_W ≥ max(8·σ·r_W, ⌊max y_W / 5⌋) that stand out by max(8·σ·r_W, ⌊y/4⌋)
/// pulse   = the first W with S_W ≥ 31/32 of the greatest              2W ≤ N or W = 2
///           but not beyond the last of three neighbouring W with the same n_W, the greatest
///           that three have
/// view    = the first W with max(100, 8·pulse)·σ·r_W ≤ max x, but not beyond pulse
/// ```
///
/// `σ·r_W` is Q13.19, nearest, 8 of it and `max x` Q1.15. The quotients are compared exactly. Why
/// the least width, why tops are counted, and why 100 and 8: benches/record/finder.md, Pulse and
/// view.
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
    /// True when the pulse that fits best hides a clear top.
    pub hides_top: bool,
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

    /// Pulse and view of a record; `pulse`, samples, when it is known. With `best_fit` it is the
    /// first with S_W ≥ 31/32 of the greatest, whatever tops it hides.
    pub fn scale(
        &self,
        padded: &Padded,
        noise: RecordNoise<'_>,
        pulse: Option<u32>,
        best_fit: bool,
        y: &mut [i16; MAX_SAMPLES],
    ) -> Scale {
        let (pulse, hides_top) = match pulse {
            Some(pulse) => (pulse.max(1), false),
            None => {
                let [best, widest] = self.widths(padded, noise, y);
                (if best_fit { best } else { best.min(widest) }, widest < best)
            }
        };
        let highest = padded.x().iter().copied().max().unwrap_or_default();
        let factor = i64::from(pulse).min(MARGIN as i64) * 8;
        let quiet = |t: &Template| factor.max(100) * i64::from(noise.after(t.taps(), t.noise_gain));
        let enough =
            |(t, &width): (&Template, &u32)| width >= pulse || quiet(t) <= i64::from(highest) << 4;
        let view = self.templates.iter().zip(&WIDTHS).position(enough).unwrap_or(WIDTHS.len() - 1);
        Scale { pulse, view, hides_top }
    }

    /// Least width whose SNR is at least 31/32 of the best, and the greatest that hides no clear
    /// top, samples: the filter that fits two echoes best may be as wide as both.
    fn widths(
        &self,
        padded: &Padded,
        noise: RecordNoise<'_>,
        y: &mut [i16; MAX_SAMPLES],
    ) -> [u32; 2] {
        let mut seen: Vec<Seen, { WIDTHS.len() }> = Vec::new();
        for (template, &width) in self.templates.iter().zip(&WIDTHS) {
            if width > 2 && 2 * width as usize > padded.x().len() {
                break;
            }
            let y = padded.filter(template.taps_in_pairs(), y);
            let sigma = noise.after(template.taps(), template.noise_gain);
            // Never full: its capacity is the number of widths.
            let _ = seen.push(Seen::of(y, sigma, noise.gain(template), width));
        }
        let best = seen.iter().reduce(|a, b| if b.exceeds(a) { b } else { a });
        let nearly = |s: &&Seen| best.is_some_and(|b| 32 * s.top * b.gain >= 31 * b.top * s.gain);
        let first = seen.iter().find(nearly);
        // Tops of noise change with the width, those of echoes do not.
        let is_steady = |around: &&[Seen]| around.iter().all(|s| s.tops == around[0].tops);
        let steady = seen.windows(STEADY).filter(is_steady);
        let widest = steady.filter_map(|around| around.last()).max_by_key(|s| s.tops);
        let first = first.map_or(2, |s| s.width);
        [first, widest.map_or(first, |s| s.width)]
    }
}

/// A record through a filter.
struct Seen {
    /// Highest value, Q1.15.
    top: i64,
    /// Noise gain, Q1.15.
    gain: i64,
    width: u32,
    /// Number of clear tops.
    tops: usize,
}

impl Seen {
    /// `sigma`: noise after the filter, Q13.19.
    fn of(y: &[i16], sigma: u32, gain: u16, width: u32) -> Self {
        let top = y.iter().copied().max().unwrap_or_default();
        let least = shift_round(i64::from(sigma), 1).min(0x7fff) as i16;
        let mut tops = Peaks::new();
        let rise = |y: i16| i32::from(least.max(y >> 2));
        prominent_peaks(y.iter().copied(), 0, least.max(top / 5), rise, &mut tops);
        Self { top: top.into(), gain: gain.into(), width, tops: tops.len() }
    }

    /// True when its SNR is higher.
    fn exceeds(&self, other: &Self) -> bool {
        self.top * other.gain > other.top * self.gain
    }
}

impl Default for Bank {
    /// The filters of [`WIDTHS`].
    fn default() -> Self {
        let template = |&width: &u32| Template::sin_squared(width * 1000, 1_000_000);
        Self { templates: WIDTHS.iter().map(template).collect() }
    }
}
