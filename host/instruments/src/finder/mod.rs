//! Detector for records of other instruments: short, of an unknown pulse, with hardly any rest.
//!
//! The sensor knows its pulse and sees a window of mostly darkness; a record may be 20 samples of
//! echo. This detector shares stages with [`echoloop_dsp::Pipeline`] where they fit
//! ([`Statistics`](echoloop_dsp::statistics), [`filter`], [`split`](echoloop_dsp::split)) and has
//! its own where they do not:
//!
//! | stage | module | in | out |
//! |---|---|---|---|
//! | ambient, noise | [`baseline`] | codes | a Q1.15, σ Q13.19 |
//! | baseline | [`remove_baseline`] | codes | `x`, Q1.15 |
//! | width of the pulse | [`scale`] | `x` | pulse and view, samples |
//! | sharpening, peaks | [`split`](echoloop_dsp::split) | `x` | peaks |
//! | separation of overlapping echoes | [`components`] | `x`, the strong peaks | centres, σ |
//! | place, height, width | [`top`] | `x` or the view | [`FoundEcho`] |

// No overflow: heights are Q1.15, noise below 2³² times k below 2¹⁶, times Q16.16 within 2400
// samples, 2²⁸.

pub mod baseline;
pub mod colour;
pub mod components;
pub mod gaussian;
pub mod scale;
pub mod top;

use core::cmp::Reverse;

use heapless::Vec;

use crate::codes::Codes;
use baseline::{Baseline, KnownNoise};
use colour::Colour;
use components::{Component, Components, Fit};
use echoloop_dsp::baseline::remove as remove_baseline;
use echoloop_dsp::flags::Flags;
use echoloop_dsp::peak::{MAX_CANDIDATES, Peak, Peaks};
use echoloop_dsp::q::{divide_round, shift_round};
use echoloop_dsp::split::{Sharpener, prominent_peaks};
use echoloop_dsp::template::Template;
use echoloop_dsp::{MAX_SAMPLES, filter};
use scale::{Bank, MARGIN, Padded, RecordNoise, Scale};
use top::{Top, View};

/// Share of the second difference that the sharpener subtracts, 64ths.
pub const SHARPNESS: i32 = 3;

/// Settings of the search.
#[derive(Clone, Copy, Debug)]
pub struct FinderConfig {
    /// Left shift that brings a code to Q1.15: 1 to 7.
    pub code_shift: u32,
    /// k: least height in σ after the sharpener, Q8.8.
    pub snr_threshold: u32,
    /// Least height as a share of the record's highest top, Q1.15.
    pub floor: u32,
    /// Least distance of two echoes, samples; 0 counts as 1.
    pub min_separation: u32,
    /// Greatest number of echoes; the strongest are kept.
    pub echoes: usize,
    /// The emitted pulse, when it is known.
    pub pulse: Option<Pulse>,
    /// σ of a sample, Q13.19, when it is known.
    pub sigma: Option<u32>,
    /// True to take the pulse that fits best even where it hides clear tops.
    pub best_fit: bool,
    /// Colour of the noise, where it is not white.
    pub colour: Option<Colour>,
}

impl FinderConfig {
    /// k = 5, a floor of a twentieth of the highest, every echo. Receivers ring by up to 5 % after
    /// a strong echo.
    pub const DEFAULT: Self = Self {
        code_shift: 1,
        snr_threshold: 5 << 8,
        floor: 1638,
        min_separation: 1,
        echoes: MAX_CANDIDATES,
        pulse: None,
        sigma: None,
        best_fit: false,
        colour: None,
    };

    /// Default search of a record whose noise has a colour, or not.
    pub(crate) fn of_record(codes: &Codes, colour: Option<Colour>) -> Self {
        Self { code_shift: codes.shift, colour, ..Self::DEFAULT }
    }
}

/// The emitted pulse, measured in a record of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pulse {
    /// Time of its peak, Q16.16 samples.
    pub time: i64,
    /// Full width at half maximum, Q16.16 samples.
    pub width: i64,
    /// Time from its top to the centre of its fitted Gaussian, Q16.16 samples.
    pub skew: i64,
    /// Later tops: delay, Q16.16 samples, and height over that of the top, Q1.15.
    pub ringing: [(i64, i32); RINGS],
}

/// Greatest number of later tops of a pulse.
pub const RINGS: usize = 12;

/// An echo of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundEcho {
    /// Time of its peak since sample 0, Q16.16 samples.
    pub time: i64,
    /// Height above ambient, Q1.15.
    pub amplitude: i64,
    /// Full width at half maximum, Q16.16 samples.
    pub width: i64,
    /// Height in σ after the sharpener, Q.8, rounded down.
    pub snr: u32,
    /// Quality flags.
    pub flags: Flags,
    /// Time of the waveform's top, Q16.16 samples.
    pub top: i64,
    /// Centre of its fitted component, Q16.16 samples; the top of an echo too weak for one.
    pub centre: i64,
}

/// What a record was searched with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Threshold {
    /// Index of the filter of [`scale::WIDTHS`] that it was looked at through.
    pub view: usize,
    /// T/σ_z, Q.8, rounded down.
    pub snr: u32,
    /// True when the pulse that fits the record best hides a clear top.
    pub hides_top: bool,
}

/// Reason why a top above the threshold is no echo.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reason {
    /// The receiver swings back after an undershoot, or the emitted pulse has such a later top.
    Ringing,
    /// It touches an end of the record, or lies no higher than the ambient.
    Cut,
    /// A higher one is nearer than the least separation.
    Near,
    /// There are as many higher ones as echoes are kept.
    Surplus,
    /// It lies beside missing samples, or on a step of the background.
    Gap,
    /// The response of other echoes explains it.
    Response,
    /// It is below the least share of the highest.
    Floor,
}

/// A top that is no echo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dropped {
    /// Time, Q16.16 samples.
    pub time: i64,
    /// Height above ambient, Q1.15; of [`Reason::Ringing`] and [`Reason::Cut`] after the sharpener.
    pub amplitude: i64,
    /// Why it is none.
    pub reason: Reason,
}

impl Dropped {
    fn of_peak(peak: &Peak, reason: Reason) -> Self {
        Self { time: i64::from(peak.index) << 16, amplitude: peak.height.into(), reason }
    }
}

/// Tops that are no echoes; each peak is at most one.
type DroppedTops = Vec<Dropped, MAX_CANDIDATES>;

/// Echoes by rising time.
pub type FoundEchoes = Vec<FoundEcho, MAX_CANDIDATES>;

/// Finds echoes in records, with working memory for one record.
#[derive(Clone, Debug)]
pub struct EchoFinder {
    bank: Bank,
    padded: Padded,
    /// The waveform through the narrowest filter that noise allows.
    view: [i16; MAX_SAMPLES],
    /// The sharpened waveform.
    sharp: [i16; MAX_SAMPLES],
    order: [u16; MAX_SAMPLES],
    model: [i32; MAX_SAMPLES],
    threshold: Threshold,
    dropped: DroppedTops,
}

impl Default for EchoFinder {
    fn default() -> Self {
        Self::new()
    }
}

impl EchoFinder {
    /// Prepares the filters.
    pub fn new() -> Self {
        Self {
            bank: Bank::default(),
            padded: Padded::default(),
            view: [0; MAX_SAMPLES],
            sharp: [0; MAX_SAMPLES],
            order: [0; MAX_SAMPLES],
            model: [0; MAX_SAMPLES],
            threshold: Threshold::default(),
            dropped: DroppedTops::new(),
        }
    }

    /// Finds the echoes of one record of codes of at most 15 − shift bits. Samples beyond
    /// [`MAX_SAMPLES`] are ignored; fewer than three hold none.
    ///
    /// ```text
    /// a, σ      as of Baseline;  x = code − a;  r below of the noise's colour, if it has one
    /// pulse, view  as of Bank;  h = the view's filter; with best_fit whatever tops it hides
    /// z         = x through Sharpener(h, lag = max(1, ⌊2/3 · pulse⌋), SHARPNESS);   σ_z = σ·r
    /// T         = max(k·σ_z, floor · max z, 1)                   Q1.15, nearest
    /// peaks     = peaks of z at or above T that stand out by rise(z); without ringing
    /// rise(z)   = max(2·σ_z, ⌊3/512 · max z⌋, and where 5z < max z also ⌊5/32 · z⌋)
    /// strong    = peaks with 5z ≥ max z: fitted together, see Fit
    /// ```
    ///
    /// `k·σ_z` and `2·σ_z` are rounded to nearest; `place` makes echoes of the peaks. Of those the
    /// highest stay, ties to the first, each at least min_separation from every other that stays:
    /// two peaks that climb to one clipped top are one echo.
    pub fn echoes(&mut self, codes: &[u16], search: &FinderConfig) -> FoundEchoes {
        self.dropped.clear();
        let codes = codes.get(..MAX_SAMPLES).unwrap_or(codes);
        let shift = search.code_shift.clamp(1, 7);
        if codes.len() < 3 {
            return FoundEchoes::new();
        }
        let colour = search.colour.as_ref();
        let known = KnownNoise { colour, sigma: search.sigma };
        let baseline = Baseline::measure(codes, shift, known, &mut self.order);
        self.padded.fill(codes.len(), |x| {
            remove_baseline(codes, 0x7fff >> shift, shift, baseline.ambient, x)
        });
        let pulse =
            search.pulse.map(|pulse| shift_round(pulse.width, 16).clamp(1, MARGIN as i64) as u32);
        let noise = RecordNoise { sigma: baseline.sigma, colour };
        let scale = self.bank.scale(&self.padded, noise, pulse, search.best_fit, &mut self.view);
        let Some(narrow) = self.bank.template(scale.view).cloned() else {
            return FoundEchoes::new();
        };
        self.padded.filter(narrow.taps_in_pairs(), &mut self.view);
        let sharpener = Sharpener::new(&narrow, (2 * scale.pulse / 3).max(1) as usize, SHARPNESS);
        self.padded.filter(sharpener.taps_in_pairs(), &mut self.sharp);
        let sigma = noise.after(sharpener.taps(), sharpener.noise_gain);
        let (peaks, level) = self.peaks(sigma, scale, search);
        let snr = ((i64::from(level) << 12) / i64::from(sigma.max(1))) as u32;
        self.threshold = Threshold { view: scale.view, snr, hides_top: scale.hides_top };
        let mut found =
            self.place(&peaks, &Context { search, scale, narrow: &narrow, noise, sigma, level });
        keep_strongest(&mut found, search, &mut self.dropped);
        found
    }

    /// What the last record was searched with.
    pub fn threshold(&self) -> Threshold {
        self.threshold
    }

    /// Tops of the last record above its threshold that are no echoes.
    pub fn dropped(&self) -> &[Dropped] {
        &self.dropped
    }

    /// Peaks of the sharpened waveform without ringing, and T.
    fn peaks(&mut self, sigma: u32, scale: Scale, search: &FinderConfig) -> (Peaks, i16) {
        let z = self.sharp.get(..self.padded.x().len()).unwrap_or_default();
        let top = i64::from(z.iter().copied().max().unwrap_or_default());
        let by_noise =
            shift_round(i64::from(sigma) * i64::from(search.snr_threshold.min(0xffff)), 12);
        let by_floor = shift_round(top.max(0) * i64::from(search.floor.min(0x8000)), 15);
        let level = by_noise.max(by_floor).clamp(1, 0x7fff) as i16;
        let least = shift_round(i64::from(sigma), 3).max((3 * top) >> 9);
        let rise = |z: i16| {
            let z = i64::from(z);
            let of_weak = if 5 * z < top { (5 * z) >> 5 } else { 0 };
            least.max(of_weak).min(0xffff) as i32
        };
        let mut found = Peaks::new();
        prominent_peaks(z.iter().copied(), 0, level, rise, &mut found);
        let y = if scale.view == 0 { self.padded.x() } else { &self.view };
        without_ringing(&mut found, y, scale.pulse, search.pulse.as_ref(), &mut self.dropped);
        (found, level)
    }

    /// Makes echoes of the peaks whose tops lie inside the record.
    ///
    /// ```text
    /// no echo  if the top or its plateau touches the record's first or last sample, since the true
    ///          top may lie outside; or if the top is no higher than the ambient
    /// top    = View::climb from the peak by at most max(1, ⌊pulse/2⌋) samples, on x if the view is
    ///          the bank's first, else on the view
    /// time   = the top's, if it is flat, tailed or cut off or the peak is not strong; else within
    ///          u − max(X, skew + ε) .. u + max(X, −skew + ε), within the record
    /// X      = max(0, 18·σ_u − J) on x, 0 on the view;   ε = 2⁻⁴ samples
    /// J      = 23·σ·(σ_u² >> 8) / A                                       Q16.16, nearest
    /// height = the top's on x, if it is flat or the peak is not strong; else the component's
    /// width  = View::width's in the same cases; else 2.355 σ_u     603 of 2⁸, rounded down to 2⁻⁸
    /// ```
    ///
    /// 18·σ_u, Q16.16 of Q8, is 3 % of the width at half maximum; J is twice the jitter that noise
    /// gives the top of a Gaussian of height A. Where View::width is `None` the width is 2.355 σ_u
    /// or, without a component, the pulse's. Why: benches/record/finder.md, Time, height and width.
    fn place(&mut self, peaks: &[Peak], context: &Context) -> FoundEchoes {
        let x = self.padded.x();
        let z = self.sharp.get(..x.len()).unwrap_or_default();
        let top = z.iter().copied().max().unwrap_or_default();
        let is_strong = |peak: &Peak| 5 * i64::from(peak.height) >= i64::from(top);
        let strong: Peaks = peaks.iter().copied().filter(is_strong).collect();
        let components: Components = Fit { x }.run(&strong, &mut self.model);
        let view = context.view(x, self.view.get(..x.len()).unwrap_or_default());
        let mut components = components.into_iter();
        let place = |peak: &Peak| {
            let component = if is_strong(peak) { components.next() } else { None };
            let echo = context.echo(&view, peak, component.as_ref());
            echo.ok_or(Dropped::of_peak(peak, Reason::Cut))
        };
        let placed: Vec<Result<FoundEcho, Dropped>, MAX_CANDIDATES> =
            peaks.iter().map(place).collect();
        self.dropped.extend(placed.iter().filter_map(|place| place.err()));
        placed.into_iter().filter_map(Result::ok).collect()
    }
}

/// Results of the earlier stages for a record.
struct Context<'a> {
    search: &'a FinderConfig,
    scale: Scale,
    narrow: &'a Template,
    noise: RecordNoise<'a>,
    sigma: u32,
    level: i16,
}

impl Context<'_> {
    /// x itself in little noise, else the filtered waveform, with bounds from the noise of either.
    /// A step of two codes is no edge of a plateau.
    fn view<'y>(&self, x: &'y [i16], filtered: &'y [i16]) -> View<'y> {
        let (y, gain) = match self.scale.view {
            0 => (x, 1 << 15),
            _ => (filtered, i64::from(self.noise.gain(self.narrow))),
        };
        let two_sigma = shift_round(i64::from(self.noise.sigma) * gain, 18).max(1) as i32;
        let top = y.iter().copied().max().unwrap_or_default();
        View {
            y,
            prominence: two_sigma,
            flat: two_sigma.max(2 << self.search.code_shift.clamp(1, 7)),
            waver: 3 << self.search.code_shift.clamp(1, 7),
            top,
        }
    }

    fn echo(&self, view: &View, peak: &Peak, component: Option<&Component>) -> Option<FoundEcho> {
        let top = view.climb(usize::from(peak.index), (self.scale.pulse / 2).max(1) as usize);
        if !top.inside || top.height <= 0 {
            return None;
        }
        let width = view.width(&top);
        let mut flags = width.flags;
        let cut = flags.contains(Flags::TRUNCATED);
        if top.clipped {
            flags |= Flags::SATURATED;
        }
        // Less than a quarter above the threshold T.
        if 4 * i64::from(peak.height) < 5 * i64::from(self.level) {
            flags |= Flags::LOW_CONFIDENCE;
        }
        let fitted = component.filter(|_| self.scale.view > 0 && !top.flat);
        let of_component = |c: &Component| (603 * c.shape.sigma()) & !0xff;
        let without = component.map_or(i64::from(self.scale.pulse) << 16, of_component);
        let last = (view.y.len().saturating_sub(1) as i64) << 16;
        let within = |time: i64| time.max(0).min(last);
        Some(FoundEcho {
            time: component
                .filter(|_| !top.flat && !width.is_tailed && !cut)
                .map_or(top.time, |c| within(self.limited(&top, c))),
            amplitude: fitted.map_or(self.amplitude(&top), |c| c.height),
            width: fitted.map_or(width.samples.unwrap_or(without), of_component),
            snr: ((i64::from(peak.height.max(0)) << 12) / i64::from(self.sigma.max(1))) as u32,
            flags,
            top: top.time,
            centre: component.map_or(top.time, |c| c.time),
        })
    }

    /// Height of a top. A view as wide as the pulse lowers it, which the filter's gain undoes.
    fn amplitude(&self, top: &Top) -> i64 {
        let matched = self.scale.view > 0
            && scale::WIDTHS.get(self.scale.view).is_some_and(|&w| w >= self.scale.pulse);
        if matched { self.narrow.amplitude(top.height.into()) } else { top.height.into() }
    }

    /// Time of the top, clamped to the range around the component's centre; see `place`.
    fn limited(&self, top: &Top, component: &Component) -> i64 {
        let sigma = component.shape.sigma();
        let jitter = divide_round(
            23 * i64::from(self.noise.sigma) * ((sigma * sigma) >> 8),
            component.height.max(1),
        );
        let reach = if self.scale.view == 0 { (18 * sigma - jitter).max(0) } else { 0 };
        let skew = self
            .search
            .pulse
            .map_or(0, |pulse| pulse.skew.clamp(-pulse.width.abs(), pulse.width.abs()));
        let early = component.time - reach.max(skew + SLACK);
        let late = component.time + reach.max(SLACK - skew);
        top.time.clamp(early, late)
    }
}

/// ε, Q16.16 samples.
const SLACK: i64 = 1 << 12;

/// Greatest delay of a swing back after an undershoot, pulse widths.
const SWING: u32 = 3;

/// Drops ringing of the receiver after strong echoes.
///
/// A top is ringing in two cases. The nearest earlier one that is more than four times as high is
/// followed by an undershoot of at least three quarters of the top's height, at most [`SWING`]
/// pulse widths before it; both in the view, for the sharpener makes undershoots of its own. Or the
/// emitted pulse has later tops at the delays from earlier echoes, within a quarter of its width,
/// and this one is at most 1.5 times as high as all of them together.
fn without_ringing(
    found: &mut Peaks,
    y: &[i16],
    width: u32,
    pulse: Option<&Pulse>,
    dropped: &mut DroppedTops,
) {
    let all = core::mem::take(found);
    for peak in &all {
        let mut stronger = all
            .iter()
            .rev()
            .filter(|b| b.index < peak.index && i32::from(b.height) > 4 * i32::from(peak.height));
        let swings = stronger.next().is_some_and(|strong| {
            let recent = usize::from(peak.index).saturating_sub((SWING * width) as usize);
            let between =
                y.get(recent.max(strong.index.into())..usize::from(peak.index)).unwrap_or_default();
            let lowest = between.iter().copied().min().unwrap_or_default();
            let height = y.get(usize::from(peak.index)).copied().unwrap_or_default();
            4 * i32::from(lowest) <= -3 * i32::from(height)
        });
        let expected =
            pulse.map_or(0, |pulse| found.iter().map(|b| pulse.ringing_at(b, peak)).sum());
        // Neither is ever full: all peaks fit into either.
        if !swings && 2 * i64::from(peak.height) > 3 * expected {
            let _ = found.push(*peak);
        } else {
            let _ = dropped.push(Dropped::of_peak(peak, Reason::Ringing));
        }
    }
}

impl Pulse {
    /// The pulse in a record of it: the strongest echo, and the tops after it. `None` without an
    /// echo.
    pub fn from_record(finder: &mut EchoFinder, codes: &[u16], code_shift: u32) -> Option<Self> {
        let echoes =
            finder.echoes(codes, &FinderConfig { code_shift, floor: 328, ..FinderConfig::DEFAULT });
        let main =
            echoes.iter().copied().reduce(|a, b| if b.amplitude > a.amplitude { b } else { a })?;
        let mut ringing = [(0, 0); RINGS];
        for (ring, echo) in ringing.iter_mut().zip(echoes.iter().filter(|e| e.top > main.top)) {
            let height = divide_round(echo.amplitude << 15, main.amplitude.max(1));
            *ring = (echo.top - main.top, height.clamp(0, 1 << 15) as i32);
        }
        Some(Self { time: main.top, width: main.width, skew: main.centre - main.top, ringing })
    }

    /// Height at a peak of the pulse's later tops, Q1.15, if `before` is an echo.
    fn ringing_at(&self, before: &Peak, peak: &Peak) -> i64 {
        let delay = (i64::from(peak.index) - i64::from(before.index)) << 16;
        let near = self.ringing.iter().filter(|(ring, _)| 4 * (delay - ring).abs() <= self.width);
        near.map(|&(_, height)| (i64::from(before.height) * i64::from(height)) >> 15).sum()
    }
}

/// Samples of a time or width in Q16.16.
pub fn samples(time: i64) -> f64 {
    time as f64 / 65_536.0
}

/// Samples as Q16.16, rounded down.
pub fn from_samples(time: f64) -> i64 {
    (time * 65_536.0).floor() as i64
}

/// Keeps the highest echoes, ties to the first, each far enough from those already kept; sorted by
/// rising time.
fn keep_strongest(found: &mut FoundEchoes, search: &FinderConfig, dropped: &mut DroppedTops) {
    let apart = i64::from(search.min_separation.max(1)) << 16;
    let mut order: Vec<FoundEcho, MAX_CANDIDATES> = found.clone();
    order.sort_unstable_by_key(|echo| (Reverse(echo.amplitude), echo.time));
    found.clear();
    for echo in order {
        let is_apart = found.iter().all(|kept| (kept.time - echo.time).abs() >= apart);
        if found.len() < search.echoes && is_apart {
            let _ = found.push(echo); // never full: it held all of them before
            continue;
        }
        let reason = if is_apart { Reason::Surplus } else { Reason::Near };
        let FoundEcho { time, amplitude, .. } = echo;
        // Never full: each peak is dropped once.
        let _ = dropped.push(Dropped { time, amplitude, reason });
    }
    found.sort_unstable_by_key(|echo| echo.time);
}

const _: () = assert!(MAX_SAMPLES.is_multiple_of(filter::BLOCK), "the filter writes whole blocks");
