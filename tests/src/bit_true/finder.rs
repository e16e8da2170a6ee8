//! Bit-true model of the echo finder of recorded waveforms.
//!
//! Sums stay below 2⁵³ on the waveforms of the tests, so every number in `f64` is exact.

use echoloop_dsp::template::Template;
use echoloop_instruments::finder::colour::Colour;
use echoloop_instruments::finder::components::SWEEPS;
use echoloop_instruments::finder::gaussian::TABLE;
use echoloop_instruments::finder::scale::{STEADY, WIDTHS};
use echoloop_instruments::finder::{FinderConfig, FoundEcho, Pulse, SHARPNESS};

use super::numbers::{nearest, nearest_ratio};
use super::refine::{LOW_CONFIDENCE, MERGED, SATURATED, TRUNCATED};
use super::split::{Sharpener, prominent_peaks};
use super::statistics::Order;
use super::values::Peak;

/// An echo with the fields of `FoundEcho`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "each is the field of FoundEcho of that name")]
pub struct Echo {
    pub time: f64,
    pub amplitude: f64,
    pub width: f64,
    pub snr: f64,
    pub flags: u8,
    pub top: f64,
    pub centre: f64,
}

impl From<FoundEcho> for Echo {
    fn from(r: FoundEcho) -> Self {
        Self {
            time: r.time as f64,
            amplitude: r.amplitude as f64,
            width: r.width as f64,
            snr: r.snr.into(),
            flags: r.flags.0,
            top: r.top as f64,
            centre: r.centre as f64,
        }
    }
}

fn q16(samples: f64) -> f64 {
    samples * 65_536.0
}

/// Ambient level (Q1.15) and noise (Q13.19) of a record.
fn rest(codes: &[f64], code: f64, search: &FinderConfig) -> (f64, f64) {
    let differences: Vec<f64> = codes.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect();
    let median = Order::from_values(differences.clone()).middle;
    let deviations: Vec<f64> = differences.iter().map(|d| (d - median).abs()).collect();
    let Order { middle: deviation, below, at, .. } = Order::from_values(deviations.clone());
    let (half, fine) = (deviations.len() as f64 / 2.0, code * 16.0);
    let mad = match deviation {
        0.0 => (half * fine / (2.0 * at)).floor(),
        _ => (deviation - 0.5) * fine + ((half - below) * fine / at).floor(),
    };
    let of_differences = nearest(mad * 24_291.0 / 16_384.0);
    let quantisation = nearest(9_459.0 * 16.0 * code / 32_768.0);
    let mut order = deviations.clone();
    order.sort_by(f64::total_cmp);
    let by_quarter = match order.len() {
        48.. => f64::INFINITY,
        n => nearest(order[(n - 1) / 4] * fine * 83_977.0 / 65_536.0),
    };
    let white = nearest(of_differences * 26_755.0 / 65_536.0).min(by_quarter).max(quantisation);
    let of_colour = |colour: &Colour| nearest(white * f64::from(colour.ratio) / 256.0);
    let own = search.colour.as_ref().map_or(white, of_colour);
    let sigma = search.sigma.map_or(own, f64::from);
    let mut order = codes.to_vec();
    order.sort_by(f64::total_cmp);
    let one_sigma = nearest(sigma / 16.0);
    let mut rest = order[(order.len() - 1) / 20] * code + nearest(sigma * 1_684.0 / 16_384.0);
    let mut dense: Option<(f64, f64)> = None;
    for (&a, &b) in order.iter().zip(&order[order.len() / 6..]) {
        let is_low = 2.0 * b <= order[0] + order[order.len() - 1];
        if is_low && dense.is_none_or(|(lower, upper)| b - a < upper - lower) {
            dense = Some((a, b));
        }
    }
    if let Some((a, b)) = dense.filter(|(a, b)| (b - a) * code <= (2.0 * one_sigma).max(code)) {
        rest = rest.max((a + b) * code / 2.0 - one_sigma);
    }
    let Order { middle: v, below, at, .. } = Order::from_values(codes.to_vec());
    let median =
        (v - 0.5) * code + ((codes.len() as f64 - 2.0 * below) * code / (2.0 * at)).floor();
    let ambient = if median <= rest + one_sigma { median } else { rest };
    (ambient.min(32_767.0), sigma)
}

/// Noise gain of taps, Q1.15, whose gain for white noise is `white`.
fn noise_gain(taps: &[f64], white: f64, colour: Option<&Colour>) -> f64 {
    let Some(colour) = colour else { return white };
    let product = |k: usize| taps.iter().zip(&taps[k..]).map(|(a, b)| a * b).sum::<f64>();
    let lags = 1..colour.correlation.len().min(taps.len());
    let more: f64 = lags.map(|k| 2.0 * f64::from(colour.correlation[k]) * product(k)).sum();
    let least = (product(0) / 4.0).floor();
    (product(0) + nearest(more / 32_768.0)).max(least).sqrt().floor().min(65_535.0)
}

/// A waveform filtered with symmetric taps, its end values repeated outside.
fn filtered(taps: &[f64], x: &[f64]) -> Vec<f64> {
    let sharpener = Sharpener { taps: taps.to_vec(), lag: 1, noise_gain: 0.0 };
    sharpener.sharpened(x, |n| if n < 0 { x[0] } else { x[x.len() - 1] })
}

fn taps(template: &Template) -> Vec<f64> {
    template.taps().iter().map(|&h| f64::from(h)).collect()
}

fn highest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// Width of the pulse, samples, and the index of the filter to measure through.
fn scale(bank: &[Template], x: &[f64], sigma: f64, search: &FinderConfig) -> (f64, usize) {
    let colour = search.colour.as_ref();
    let known = search.pulse.map(|pulse| nearest(pulse.width as f64 / 65_536.0).clamp(1.0, 63.0));
    let gain = |t: &Template| noise_gain(&taps(t), t.noise_gain.into(), colour);
    let pulse = known.unwrap_or_else(|| {
        let fits = |&&width: &&u32| width == 2 || 2 * width as usize <= x.len();
        let widths: Vec<u32> = WIDTHS.iter().take_while(fits).copied().collect();
        let seen: Vec<Vec<f64>> =
            widths.iter().zip(bank).map(|(_, t)| filtered(&taps(t), x)).collect();
        let tops: Vec<f64> = seen.iter().map(|y| highest(y)).collect();
        let mut best = 0;
        for i in 1..widths.len() {
            if tops[i] * gain(&bank[best]) > tops[best] * gain(&bank[i]) {
                best = i;
            }
        }
        let nearly =
            |&i: &usize| 32.0 * tops[i] * gain(&bank[best]) >= 31.0 * tops[best] * gain(&bank[i]);
        let first = (0..widths.len()).find(nearly).unwrap_or(0);
        let clear = |y: &[f64], t: &Template| {
            let least = nearest(nearest(sigma * gain(t) / 32_768.0) / 2.0).min(32_767.0);
            let level = least.max((highest(y) / 5.0).trunc());
            prominent_peaks(y, 0, level, |y| least.max((y / 4.0).floor())).len()
        };
        let clear: Vec<usize> = seen.iter().zip(bank).map(|(y, t)| clear(y, t)).collect();
        let mut widest = None;
        for last in STEADY - 1..widths.len() {
            let is_steady = (last + 1 - STEADY..last).all(|i| clear[i] == clear[last]);
            if is_steady && widest.is_none_or(|i: usize| clear[last] >= clear[i]) {
                widest = Some(last);
            }
        }
        let widest = if search.best_fit { first } else { widest.unwrap_or(first) };
        f64::from(widths[first.min(widest)])
    });
    let factor = (8.0 * pulse).max(100.0);
    let quiet = |t: &Template| factor * nearest(sigma * gain(t) / 32_768.0) <= 16.0 * highest(x);
    let view = (0..WIDTHS.len()).find(|&i| f64::from(WIDTHS[i]) >= pulse || quiet(&bank[i]));
    (pulse, view.unwrap_or(WIDTHS.len() - 1))
}

/// Gaussian g at a distance, in the formats of `Gaussian`.
fn gaussian(sigma: f64, distance: f64) -> f64 {
    let inverse = (536_870_912.0 / sigma).floor();
    let z = (distance.abs() * inverse / 65_536.0).floor();
    let j = (z / 256.0).floor();
    if j + 1.0 >= TABLE.len() as f64 {
        return 0.0;
    }
    let (here, next) = (f64::from(TABLE[j as usize]), f64::from(TABLE[j as usize + 1]));
    here + (((next - here) * (z - 256.0 * j) + 128.0) / 256.0).floor()
}

#[derive(Clone, Copy, Debug)]
struct Component {
    time: f64,
    height: f64,
    sigma: f64,
}

impl Component {
    /// Full width at half maximum, Q16.16.
    fn width(&self) -> f64 {
        (603.0 * self.sigma / 256.0).floor() * 256.0
    }

    fn distance(&self, n: usize) -> f64 {
        ((q16(n as f64) - self.time) / 256.0).floor()
    }

    /// Span of samples within 4.5 σ.
    fn span(&self, samples: usize) -> std::ops::Range<usize> {
        let (centre, reach) = ((self.time / 256.0).floor(), (4.5 * self.sigma).floor());
        let first = ((centre - reach) / 256.0).floor().max(0.0) as usize;
        let last = ((centre + reach) / 256.0).floor().max(0.0) as usize + 1;
        first.min(samples)..last.min(samples)
    }

    fn part(&self, n: usize, samples: usize) -> f64 {
        if !self.span(samples).contains(&n) {
            return 0.0;
        }
        nearest(self.height * gaussian(self.sigma, self.distance(n)) / 32_768.0)
    }
}

const MIN_SIGMA: f64 = 205.0;
const MAX_SIGMA: f64 = 16_384.0;

fn half_maximum<'a>(height: f64, side: impl Iterator<Item = &'a f64>) -> f64 {
    let mut last = height;
    let mut count = 1.0;
    for &x in side {
        if 2.0 * x <= height || 50.0 * (x - last) > height {
            break;
        }
        (last, count) = (x, count + 1.0);
    }
    count
}

fn fit(x: &[f64], peaks: &[Peak]) -> Vec<Component> {
    let first = |peak: &Peak| {
        let height = x[peak.index].max(1.0);
        let width = half_maximum(height, x[..peak.index].iter().rev())
            .min(half_maximum(height, x[peak.index + 1..].iter()));
        let sigma = (217.0 * width).max(256.0).clamp(MIN_SIGMA, MAX_SIGMA);
        Component { time: q16(peak.index as f64), height, sigma }
    };
    let mut all: Vec<Component> = peaks.iter().map(first).collect();
    for _ in 0..SWEEPS {
        let mut moved = false;
        for k in 0..all.len() {
            let before = all[k];
            let left = |n: usize, all: &[Component]| {
                let others = all.iter().enumerate().filter(|&(j, _)| j != k);
                x[n] - others.map(|(_, c)| c.part(n, x.len())).sum::<f64>()
            };
            let (mut s0, mut s1, mut s2) = (0.0, 0.0, 0.0);
            for n in before.span(x.len()) {
                let d = before.distance(n);
                let w = nearest(left(n, &all) * gaussian(before.sigma, d) / 32_768.0);
                (s0, s1, s2) = (s0 + w, s1 + w * d, s2 + w * (d * d / 256.0).floor());
            }
            if s0 <= 0.0 {
                continue;
            }
            let most = 128.0 * before.sigma;
            let step = nearest_ratio(512.0 * s1, s0).clamp(-most, most);
            all[k].time = (before.time + step).clamp(0.0, q16(x.len() as f64 - 1.0));
            all[k].sigma = next_sigma(before.sigma, nearest_ratio(s2, s0));
            let after = all[k];
            let (mut rg, mut gg) = (0.0, 0.0);
            for n in after.span(x.len()) {
                let g = gaussian(after.sigma, after.distance(n));
                (rg, gg) = (rg + left(n, &all) * g, gg + nearest(g * g / 32_768.0));
            }
            all[k].height = nearest_ratio(rg, gg).clamp(0.0, 65_536.0);
            moved |= step.abs() >= 256.0 || after.sigma != before.sigma;
        }
        if !moved {
            break;
        }
    }
    all
}

fn next_sigma(sigma: f64, v: f64) -> f64 {
    let square = (sigma * sigma / 256.0).floor();
    let rest = square - v;
    let next = match rest <= 16.0 {
        true => (sigma * 333.0 / 256.0).floor(),
        false => (256.0 * nearest_ratio(v.max(0.0) * square, rest)).sqrt().floor(),
    };
    let (least, most) = ((sigma * 179.0 / 256.0).floor(), (sigma * 358.0 / 256.0).floor());
    next.clamp(least, most).clamp(MIN_SIGMA, MAX_SIGMA)
}

struct Top {
    time: f64,
    first: usize,
    height: f64,
    flat: bool,
    clipped: bool,
    inside: bool,
}

fn climb(y: &[f64], start: usize, reach: usize, [flat, code, highest]: [f64; 3]) -> Top {
    let at = |i: i64| {
        usize::try_from(i).ok().and_then(|i| y.get(i)).copied().unwrap_or(f64::NEG_INFINITY)
    };
    let mut i = start as i64;
    for _ in 0..reach {
        let (before, after) = (at(i - 1), at(i + 1));
        if before.max(after) <= at(i) {
            break;
        }
        i += if before >= after { -1 } else { 1 };
    }
    let height = at(i);
    let run = |is_like: &dyn Fn(f64) -> bool| {
        let (mut a, mut b) = (i, i);
        while is_like(at(a - 1)) {
            a -= 1;
        }
        while is_like(at(b + 1)) {
            b += 1;
        }
        (a, b)
    };
    let is_inner = |(a, b): (i64, i64)| a > 0 && (b as usize) + 1 < y.len();
    let is_flat = |(a, b): (i64, i64), value: f64, times: f64| {
        let length = (b - a + 1) as f64;
        let drop = 2.0 * value - at(a - 1) - at(b + 1);
        is_inner((a, b))
            && length >= 3.0
            && drop * (length - 1.0).powi(2) > 2.0 * times * flat * (length + 1.0).powi(2)
    };
    let limit = highest - 3.0 * code;
    let wide = run(&|v| v >= limit);
    let wavers = height >= limit && is_flat(wide, highest, 4.0);
    let (a, b) = if wavers { wide } else { run(&|v| v == height) };
    let inner = is_inner((a, b));
    let time = match a == b {
        false => q16((a + b) as f64 / 2.0),
        true if inner => q16(a as f64) + vertex(at(a - 1), height, at(a + 1)),
        true => q16(a as f64),
    };
    let is_flat = wavers || is_flat((a, b), height, 1.0);
    let clipped = is_flat && (wavers || height == highest);
    Top { time, first: a as usize, height, flat: is_flat, clipped, inside: inner }
}

fn vertex(before: f64, here: f64, after: f64) -> f64 {
    let slope = (before - after) * 32_768.0;
    nearest_ratio(slope, before - 2.0 * here + after).clamp(-32_768.0, 32_768.0)
}

/// Time at which one side crosses half the height, or the flag that says why it does not.
fn crossing(y: &[f64], top: &Top, prominence: f64, direction: i64) -> Result<f64, u8> {
    let (half, rise) = ((top.height / 2.0).floor(), prominence.max((top.height / 16.0).floor()));
    let (mut i, mut valley) = (top.first as i64, top.height);
    loop {
        let Some(&value) = usize::try_from(i + direction).ok().and_then(|i| y.get(i)) else {
            return Err(TRUNCATED);
        };
        let inner = y[i as usize];
        if value < half {
            let fraction = (65_536.0 * (inner - half) / (inner - value)).trunc();
            return Ok(q16(i as f64) + direction as f64 * fraction);
        }
        if value > valley + rise {
            return Err(MERGED);
        }
        (i, valley) = (i + direction, valley.min(value));
    }
}

/// Echoes of a record of codes.
pub fn echoes(codes: &[u16], search: &FinderConfig) -> Vec<Echo> {
    let codes: Vec<f64> = codes.iter().map(|&code| code.into()).collect();
    if codes.len() < 3 {
        return Vec::new();
    }
    let record = Record::new(&codes, search);
    let sharpened = Sharpened::new(&record);
    let peaks = sharpened.peaks(&record);
    let strong: Vec<Peak> =
        peaks.iter().copied().filter(|peak| sharpened.is_strong(peak)).collect();
    let mut components = fit(&record.x, &strong).into_iter();
    let seen = Seen::new(&record);
    let place = |peak: &Peak| {
        let component = if sharpened.is_strong(peak) { components.next() } else { None };
        seen.echo(&sharpened, peak, component)
    };
    strongest(peaks.iter().filter_map(place).collect(), search)
}

/// A record without its ambient level.
struct Record<'a> {
    search: &'a FinderConfig,
    /// Q1.15 LSB per code.
    code: f64,
    x: Vec<f64>,
    sigma: f64,
    /// Width of its pulse, samples.
    pulse: f64,
    /// Index of `narrow` in the bank of filters.
    view: usize,
    /// Filter to measure through.
    narrow: Template,
}

impl<'a> Record<'a> {
    fn new(codes: &[f64], search: &'a FinderConfig) -> Self {
        let code = f64::from(1u32 << search.code_shift);
        let (ambient, sigma) = rest(codes, code, search);
        let x: Vec<f64> = codes.iter().map(|c| c * code - ambient).collect();
        let mut bank: Vec<Template> =
            WIDTHS.iter().map(|&width| Template::sin_squared(width * 1000, 1_000_000)).collect();
        let (pulse, view) = scale(&bank, &x, sigma, search);
        Self { search, code, x, sigma, pulse, view, narrow: bank.swap_remove(view) }
    }

    /// What tops are measured on, and its noise gain, Q1.15.
    fn viewed(&self) -> (Vec<f64>, f64) {
        if self.view == 0 {
            return (self.x.clone(), 32_768.0);
        }
        let (taps, white) = (taps(&self.narrow), self.narrow.noise_gain.into());
        let gain = noise_gain(&taps, white, self.search.colour.as_ref());
        (filtered(&taps, &self.x), gain)
    }
}

/// The sharpened waveform, in which peaks are found.
struct Sharpened {
    z: Vec<f64>,
    sigma: f64,
    top: f64,
    /// Least height of a peak.
    level: f64,
}

impl Sharpened {
    fn new(record: &Record) -> Self {
        let lag = (2.0 * record.pulse / 3.0).floor().max(1.0) as usize;
        let sharpener = Sharpener::new(&record.narrow, lag, f64::from(SHARPNESS));
        let z = filtered(&sharpener.taps, &record.x);
        let colour = record.search.colour.as_ref();
        let gain = noise_gain(&sharpener.taps, sharpener.noise_gain, colour);
        let (sigma, top) = (nearest(record.sigma * gain / 32_768.0), highest(&z));
        let by_noise = nearest(sigma * f64::from(record.search.snr_threshold) / 4_096.0);
        let by_floor = nearest(top.max(0.0) * f64::from(record.search.floor) / 32_768.0);
        Self { z, sigma, top, level: by_noise.max(by_floor).clamp(1.0, 32_767.0) }
    }

    fn peaks(&self, record: &Record) -> Vec<Peak> {
        let top = self.top;
        let least = nearest(self.sigma / 8.0).max((3.0 * top / 512.0).floor());
        let rise = |z: f64| {
            least.max(if 5.0 * z < top { (5.0 * z / 32.0).floor() } else { 0.0 }).min(65_535.0)
        };
        let peaks = prominent_peaks(&self.z, 0, self.level, rise);
        without_ringing(&peaks, &record.viewed().0, record.pulse, record.search.pulse.as_ref())
    }

    fn is_strong(&self, peak: &Peak) -> bool {
        5.0 * peak.height >= self.top
    }
}

/// The filtered waveform, on which tops and widths are measured.
struct Seen<'a> {
    record: &'a Record<'a>,
    y: Vec<f64>,
    top: f64,
    prominence: f64,
}

impl<'a> Seen<'a> {
    fn new(record: &'a Record<'a>) -> Self {
        let (y, gain) = record.viewed();
        let prominence = nearest(record.sigma * gain / 262_144.0).max(1.0);
        Self { record, top: highest(&y), y, prominence }
    }

    fn echo(
        &self,
        sharpened: &Sharpened,
        peak: &Peak,
        component: Option<Component>,
    ) -> Option<Echo> {
        let Self { record, y, prominence, .. } = self;
        let reach = (record.pulse / 2.0).floor().max(1.0) as usize;
        let limits = [prominence.max(2.0 * record.code), record.code, self.top];
        let top = climb(y, peak.index, reach, limits);
        if !top.inside || top.height <= 0.0 {
            return None;
        }
        let sides = [-1, 1].map(|direction| crossing(y, &top, *prominence, direction));
        let mut flags = sides.iter().filter_map(|side| side.err()).fold(0, |all, why| all | why);
        if top.clipped {
            flags |= SATURATED;
        }
        if 4.0 * peak.height < 5.0 * sharpened.level {
            flags |= LOW_CONFIDENCE;
        }
        let fitted = component.filter(|_| record.view > 0 && !top.flat);
        let halves = sides.map(|side| side.map(|side| (side - top.time).abs()));
        let is_tailed = matches!(halves, [Ok(a), Ok(b)] if a.max(b) >= 3.0 * a.min(b));
        let timed = component.filter(|_| !top.flat && !is_tailed && flags & TRUNCATED == 0);
        Some(Echo {
            time: timed.map_or(top.time, |c| self.time(&top, &c)),
            amplitude: fitted.map_or_else(|| self.height(&top), |c| c.height),
            width: fitted
                .map_or_else(|| width(&top, sides, component, record.pulse), |c| c.width()),
            snr: (4_096.0 * peak.height.max(0.0) / sharpened.sigma.max(1.0)).floor(),
            flags,
            top: top.time,
            centre: component.map_or(top.time, |c| c.time),
        })
    }

    /// Time of a component, limited to as far from the top as noise and skew allow, and to the
    /// record.
    fn time(&self, top: &Top, component: &Component) -> f64 {
        let Record { search, x, view, sigma, .. } = self.record;
        let noise = (*view == 0).then_some(*sigma);
        let time = limited(top.time, component, noise, search.pulse.as_ref());
        time.clamp(0.0, q16(x.len() as f64 - 1.0))
    }

    /// Height of a top before the filter lowered it.
    fn height(&self, top: &Top) -> f64 {
        let Record { narrow, view, pulse, .. } = self.record;
        let inverse = (536_870_912.0 / f64::from(narrow.peak_gain)).floor().min(65_535.0);
        match *view > 0 && f64::from(WIDTHS[*view]) >= *pulse {
            true => nearest(top.height * inverse / 16_384.0),
            false => top.height,
        }
    }
}

/// Width at half height. If one side has no crossing, twice the other half; without any, the
/// component's width.
fn width(
    top: &Top,
    [left, right]: [Result<f64, u8>; 2],
    component: Option<Component>,
    pulse: f64,
) -> f64 {
    match (left, right) {
        (Ok(left), Ok(right)) => right - left,
        (Ok(side), Err(_)) | (Err(_), Ok(side)) => 2.0 * (side - top.time).abs(),
        (Err(_), Err(_)) => component.map_or(q16(pulse), |c| c.width()),
    }
}

fn limited(top: f64, component: &Component, noise: Option<f64>, pulse: Option<&Pulse>) -> f64 {
    let square = (component.sigma * component.sigma / 256.0).floor();
    let jitter = |noise: f64| nearest_ratio(23.0 * noise * square, component.height.max(1.0));
    let reach = noise.map_or(0.0, |noise| (18.0 * component.sigma - jitter(noise)).max(0.0));
    let skew = pulse.map_or(0.0, |p| (p.skew as f64).clamp(-(p.width as f64), p.width as f64));
    top.clamp(
        component.time - reach.max(skew + 4_096.0),
        component.time + reach.max(4_096.0 - skew),
    )
}

fn without_ringing(peaks: &[Peak], y: &[f64], width: f64, pulse: Option<&Pulse>) -> Vec<Peak> {
    let mut kept: Vec<Peak> = Vec::new();
    for peak in peaks {
        let strong =
            peaks.iter().rev().find(|b| b.index < peak.index && b.height > 4.0 * peak.height);
        let swings = strong.is_some_and(|b| {
            let from = b.index.max(peak.index.saturating_sub(3 * width as usize));
            4.0 * y[from..peak.index].iter().copied().fold(f64::INFINITY, f64::min)
                <= -3.0 * y[peak.index]
        });
        let mut expected = 0.0;
        for (pulse, b) in pulse.iter().flat_map(|&p| kept.iter().map(move |b| (p, b))) {
            for &(ring, height) in &pulse.ringing {
                if 4.0 * (q16((peak.index - b.index) as f64) - ring as f64).abs()
                    <= pulse.width as f64
                {
                    expected += (b.height * f64::from(height) / 32_768.0).floor();
                }
            }
        }
        if !swings && 2.0 * peak.height > 3.0 * expected {
            kept.push(*peak);
        }
    }
    kept
}

/// The highest echoes that keep the minimum separation from every higher one.
fn strongest(mut echoes: Vec<Echo>, search: &FinderConfig) -> Vec<Echo> {
    echoes.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude).then(a.time.total_cmp(&b.time)));
    let apart = q16(f64::from(search.min_separation.max(1)));
    let mut kept: Vec<Echo> = Vec::new();
    for echo in echoes {
        if kept.len() < search.echoes && kept.iter().all(|k| (k.time - echo.time).abs() >= apart) {
            kept.push(echo);
        }
    }
    kept.sort_by(|a, b| a.time.total_cmp(&b.time));
    kept
}
