//! Random settings and waveforms: ordinary ones, extreme ones, and ties.
//!
//! [`case`] draws settings over the whole accepted table and a waveform of one [`Kind`]; [`output`]
//! draws outputs of a filter, with far more ties and plateaus than real ones; [`clipped_run`] draws
//! a clipped pulse of any depth. The same seed gives the same vector on every machine.

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use echoloop_dsp::hardware::sample_period_fs;
use echoloop_dsp::{Hardware, MAX_SAMPLES, ParameterId as Id, Settings};
use echoloop_random::box_muller;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Kind of a waveform.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it; `Drawing::codes` draws them")]
pub enum Kind {
    Noise,
    Short,
    Constant,
    SingleEcho,
    ClippedEcho,
    ClipEdge,
    MergedPair,
    ManyEchoes,
    EqualEchoes,
    WindowEdges,
    Sawtooth,
    Square,
    RandomCodes,
    WildCodes,
    Plateaus,
    TwoLevels,
    Dark,
}

/// All kinds; seed `s` draws kind `s % KINDS.len()`.
pub const KINDS: [Kind; 17] = [
    Kind::Noise,
    Kind::Short,
    Kind::Constant,
    Kind::SingleEcho,
    Kind::ClippedEcho,
    Kind::ClipEdge,
    Kind::MergedPair,
    Kind::ManyEchoes,
    Kind::EqualEchoes,
    Kind::WindowEdges,
    Kind::Sawtooth,
    Kind::Square,
    Kind::RandomCodes,
    Kind::WildCodes,
    Kind::Plateaus,
    Kind::TwoLevels,
    Kind::Dark,
];

/// One waveform, and the sensor that records it.
#[derive(Clone, Debug)]
pub struct Case {
    /// Settings that [`Settings::check`] accepts.
    pub settings: Settings,
    /// The sensor's hardware.
    pub hardware: Hardware,
    /// Kind of the waveform.
    pub kind: Kind,
    /// Input of the pipeline: the codes before the trigger, if the settings ask for them, then
    /// those of the window; for several shots their sum, as
    /// [`Accumulator`](echoloop_dsp::accumulate::Accumulator) gives it.
    pub codes: Vec<u16>,
}

impl Case {
    /// Codes before the trigger, and codes of the window.
    pub fn split(&self) -> (&[u16], &[u16]) {
        self.codes.split_at(self.codes.len().min(self.settings.pre_trigger_samples() as usize))
    }
}

/// Draws the case of a seed.
pub fn case(seed: u64) -> Case {
    let mut rng = rng(seed);
    let kind = KINDS[(seed % KINDS.len() as u64) as usize];
    let hardware = hardware(&mut rng);
    let settings = settings(&mut rng, &hardware);
    let codes = Drawing::new(&settings, &hardware, settings.shots).codes(kind, &mut rng);
    Case { settings, hardware, kind, codes }
}

/// Draws one shot of a kind, with the samples before the trigger that the settings ask for.
pub fn waveform(
    settings: &Settings,
    hardware: &Hardware,
    kind: Kind,
    rng: &mut impl Rng,
) -> Vec<u16> {
    Drawing::new(settings, hardware, 1).codes(kind, rng)
}

/// Draws the number of shots of the settings, all of one length: random codes up to a limit, or one
/// code throughout.
pub fn shots(case: &Case, rng: &mut impl Rng) -> Vec<Vec<u16>> {
    let full_scale = case.hardware.full_scale_code();
    let top = pick(rng, &[1, full_scale, full_scale, u16::MAX]);
    let full = rng.random_range(0..8) == 0;
    let length = rng.random_range(0..200);
    let mut code = || if full { top } else { rng.random_range(0..=top) };
    (0..case.settings.shots).map(|_| (0..length).map(|_| code()).collect()).collect()
}

/// Generator of a seed.
pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Draws hardware: half of it the reference sensor; the rest has 8 to 14 bits, other windows, which
/// may begin at 0 or at 10 km, and receivers of any sensitivity and noise.
pub fn hardware(rng: &mut impl Rng) -> Hardware {
    if rng.random() {
        return Hardware::REFERENCE;
    }
    let range_min_mm = pick(rng, &[0, 0, 100, 1_000, 2_500, 10_000_000]);
    // A shorter window would need more taps than the filter has.
    let window_mm = rng.random_range(119_000..=200_000);
    Hardware {
        adc_bits: rng.random_range(8..=14),
        range_min_mm,
        range_max_mm: range_min_mm + window_mm,
        unit_echo_milli: any_size(rng, Hardware::REFERENCE.unit_echo_milli),
        shot_noise_ppm: any_size(rng, Hardware::REFERENCE.shot_noise_ppm),
        ..Hardware::REFERENCE
    }
}

/// Draws settings over the whole accepted table, with its ends and some methods more often.
pub fn settings(rng: &mut impl Rng, hardware: &Hardware) -> Settings {
    loop {
        let settings = Settings {
            // Over the whole range, so that some widths exceed the energy limit.
            power_uw: log_uniform(rng, (*range(Id::Power).start()).into(), 2e7).round() as i32,
            pulse_width_ps: with_ends(rng, Id::PulseWidth),
            gain_cdb: with_ends(rng, Id::Gain),
            bins: with_ends(rng, Id::WaveformResolution),
            shots: pick(rng, &[1, 1, 2, 4, 8, 16]),
            saturation_ppm: if rng.random() {
                *range(Id::Saturation).end()
            } else {
                with_ends(rng, Id::Saturation)
            },
            noise_floor_ppm: evenly_in_log(rng, Id::NoiseFloor),
            snr_threshold_milli: with_ends(rng, Id::SnrThreshold),
            upsampling: pick(rng, &[1, 2, 4, 8]),
            denoise: pick(rng, &[0, 1, 2, 2]),
            ambient: rng.random_range(range(Id::Ambient)),
            timing: pick(rng, &[0, 1, 2, 3, 3]),
            min_separation_mm: if rng.random() {
                None
            } else {
                Some(with_ends(rng, Id::MinSeparation))
            },
            echoes: rng.random_range(range(Id::Echoes)),
            echo_choice: rng.random_range(range(Id::EchoChoice)),
            black_level_ppm: 0,
            dither: 0,
            gain_slope_mdb_m: 0,
            gain_range_mm: 40_000,
            overlap_mm: 1_000,
            ..Settings::default() // an aim, which no detector looks at
        };
        // Not drawn, so that the other draws of a seed stay as they were before these settings.
        let settings = with_later_ones(settings);
        if settings.check(hardware).is_ok() {
            return settings; // else draws again
        }
    }
}

/// Derives the settings that were added later: a black level in half of the cases, a rising gain in
/// two of five, another overlap in a third.
fn with_later_ones(settings: Settings) -> Settings {
    let Settings { bins, pulse_width_ps, .. } = settings;
    let rises = matches!(bins % 5, 1 | 3);
    Settings {
        black_level_ppm: bins % 2 * (7_919 * bins % 40_001),
        gain_slope_mdb_m: if rises { 1 + pulse_width_ps % 1_000 } else { 0 },
        gain_range_mm: if rises { 5_000 + 7_919 * bins % 35_001 } else { 40_000 },
        overlap_mm: if bins % 3 == 1 { 500 + pulse_width_ps % 19_501 } else { 1_000 },
        ..settings
    }
}

/// Bounds of a parameter, in wire units.
fn range(id: Id) -> RangeInclusive<i32> {
    id.parameter().min..=id.parameter().max
}

fn with_ends(rng: &mut impl Rng, id: Id) -> i32 {
    let range = range(id);
    match rng.random_range(0..16) {
        0 => *range.start(),
        1 => *range.end(),
        _ => rng.random_range(range),
    }
}

fn evenly_in_log(rng: &mut impl Rng, id: Id) -> i32 {
    let range = range(id);
    log_uniform(rng, (*range.start()).into(), (*range.end()).into()).round() as i32
}

/// Draws a quarter each: 0, 1 or the maximum; the usual value; one near it; any value.
fn any_size(rng: &mut impl Rng, usual: u32) -> u32 {
    match rng.random_range(0..4) {
        0 => pick(rng, &[0, 1, u32::MAX]),
        1 => usual,
        2 => (f64::from(usual) * log_uniform(rng, 0.1, 10.0)) as u32,
        _ => log_uniform(rng, 1.0, f64::from(u32::MAX)) as u32,
    }
}

fn log_uniform(rng: &mut impl Rng, min: f64, max: f64) -> f64 {
    min * libm::pow(max / min, rng.random::<f64>())
}

fn pick<T: Copy>(rng: &mut impl Rng, of: &[T]) -> T {
    of[rng.random_range(0..of.len())]
}

/// Draws a standard normal number.
pub fn normal(rng: &mut impl Rng) -> f64 {
    let exponential = -libm::log(1.0 - rng.random::<f64>());
    box_muller(exponential, rng.random())[0]
}

/// sin² pulse of full width at half maximum `width`, centred at 0, of height 1.
pub fn pulse(t: f64, width: f64) -> f64 {
    if t.abs() < width { 0.5 + 0.5 * libm::cos(PI * t / width) } else { 0.0 }
}

/// Adds an echo to a waveform in codes: `width` and the centre `at` are in samples.
pub fn add_echo(wave: &mut [f64], at: f64, amplitude: f64, width: f64) {
    let first = (at - width).floor().max(0.0) as usize;
    let last = ((at + width).ceil().max(0.0) as usize).min(wave.len());
    for (n, value) in wave.iter_mut().enumerate().take(last).skip(first) {
        *value += amplitude * pulse(n as f64 - at, width);
    }
}

/// White noise around an ambient level.
pub fn noise(rng: &mut impl Rng, samples: usize, ambient: f64, sigma: f64) -> Vec<f64> {
    (0..samples).map(|_| ambient + sigma * normal(rng)).collect()
}

/// Converts to the nearest ADC codes, 0 to full scale.
pub fn digitise(wave: &[f64], hardware: &Hardware) -> Vec<u16> {
    clamped(wave, f64::from(hardware.full_scale_code()))
}

fn clamped(wave: &[f64], full_scale: f64) -> Vec<u16> {
    wave.iter().map(|v| v.round().clamp(0.0, full_scale) as u16).collect()
}

/// Draws waveforms for one sensor.
struct Drawing {
    before: usize,
    samples: usize,
    /// Pulse width, samples.
    width: f64,
    full_scale: f64,
    clip: f64,
}

impl Drawing {
    /// Draws codes of the sum of `shots` shots.
    fn new(settings: &Settings, hardware: &Hardware, shots: i32) -> Self {
        let period_fs = sample_period_fs(settings.bins as u32, hardware);
        let sum = f64::from(shots) * f64::from(hardware.full_scale_code());
        let full_scale = (sum / f64::powi(2.0, sum.log2().ceil() as i32 - 14).max(1.0)).round();
        Self {
            before: settings.pre_trigger_samples() as usize,
            samples: settings.bins as usize,
            width: f64::from(settings.pulse_width_ps) * 1e3 / f64::from(period_fs),
            full_scale,
            clip: (f64::from(settings.saturation_ppm) * full_scale / 1e6).round(),
        }
    }

    fn codes(&self, kind: Kind, rng: &mut impl Rng) -> Vec<u16> {
        let codes = self.window(kind, rng);
        if self.before == 0 {
            return codes;
        }
        let mut all = self.before(&codes, rng);
        if kind == Kind::Short && rng.random_range(0..4) == 0 {
            all.truncate(rng.random_range(0..=self.before));
            return all;
        }
        all.extend(codes);
        all
    }

    /// Codes before the trigger: mostly as dark as the waveform, else constant or random.
    fn before(&self, codes: &[u16], rng: &mut impl Rng) -> Vec<u16> {
        let dark = codes.iter().copied().min().unwrap_or(0);
        let any = rng.random_range(0..=self.full_scale as u16);
        let width = pick(rng, &[1, 3, 20, any]);
        let top = pick(rng, &[self.full_scale as u16, u16::MAX]);
        match rng.random_range(0..6) {
            0 => vec![any; self.before],
            1 => (0..self.before).map(|_| rng.random_range(0..=top)).collect(),
            _ => {
                (0..self.before).map(|_| dark.saturating_add(rng.random_range(0..=width))).collect()
            }
        }
    }

    fn window(&self, kind: Kind, rng: &mut impl Rng) -> Vec<u16> {
        match kind {
            Kind::Noise => self.digitised(self.background(rng)),
            Kind::Short => self.short(rng),
            Kind::Constant => self.constant(rng),
            Kind::SingleEcho => self.single(rng),
            Kind::ClippedEcho => self.clipped(rng),
            Kind::ClipEdge => self.clip_edge(rng),
            Kind::MergedPair => self.pair(rng),
            Kind::ManyEchoes => self.many(rng),
            Kind::EqualEchoes => self.equal(rng),
            Kind::WindowEdges => self.edges(rng),
            Kind::Sawtooth => self.sawtooth(rng),
            Kind::Square => self.square(rng),
            Kind::RandomCodes => self.random(rng, self.full_scale as u16),
            Kind::WildCodes => self.wild(rng),
            Kind::Plateaus => self.plateaus(rng),
            Kind::TwoLevels => self.two_levels(rng),
            Kind::Dark => self.dark(rng),
        }
    }

    fn digitised(&self, wave: Vec<f64>) -> Vec<u16> {
        clamped(&wave, self.full_scale)
    }

    /// Noise of any ambient level, from far below one code to clipping at both ends.
    fn background(&self, rng: &mut impl Rng) -> Vec<f64> {
        let sigma = pick(rng, &[0.0, 0.05, 0.2, 0.4, 0.7, 1.0, 3.0, 10.0, 60.0]);
        self.background_of(rng, sigma)
    }

    fn background_of(&self, rng: &mut impl Rng, sigma: f64) -> Vec<f64> {
        let ambient = match rng.random_range(0..8) {
            0 => 0.0,
            1 => self.full_scale * rng.random::<f64>(),
            _ => 0.1 * self.full_scale * rng.random::<f64>(),
        };
        noise(rng, self.samples, ambient, sigma)
    }

    fn quiet(&self, rng: &mut impl Rng) -> Vec<f64> {
        let sigma = pick(rng, &[0.0, 0.3, 0.6, 1.0, 3.0]);
        self.background_of(rng, sigma)
    }

    /// Any position, at sub-sample phases that are often binary fractions.
    fn place(&self, rng: &mut impl Rng) -> f64 {
        let sample = rng.random_range(0..self.samples) as f64;
        let phase =
            if rng.random() { f64::from(rng.random_range(0..16u8)) / 16.0 } else { rng.random() };
        sample + phase
    }

    fn short(&self, rng: &mut impl Rng) -> Vec<u16> {
        let longest = (3.0 * self.width) as usize;
        let length =
            if rng.random() { rng.random_range(0..4) } else { rng.random_range(0..=longest) };
        let mut wave = self.quiet(rng);
        wave.truncate(length);
        if rng.random() {
            add_echo(
                &mut wave,
                longest as f64 * rng.random::<f64>(),
                self.full_scale * rng.random::<f64>(),
                self.width,
            );
            return self.digitised(wave);
        }
        (0..length).map(|_| rng.random_range(0..=self.full_scale as u16)).collect()
    }

    fn constant(&self, rng: &mut impl Rng) -> Vec<u16> {
        let any = rng.random_range(0..=self.full_scale as u16);
        let clip = self.clip as u16;
        let code = pick(rng, &[0, 1, any, clip - 1, clip, self.full_scale as u16, u16::MAX]);
        vec![code; self.samples]
    }

    /// One echo, of an amplitude from one code to full scale.
    fn single(&self, rng: &mut impl Rng) -> Vec<u16> {
        let mut wave = self.quiet(rng);
        let amplitude = log_uniform(rng, 1.0, self.full_scale);
        add_echo(&mut wave, self.place(rng), amplitude, self.width);
        self.digitised(wave)
    }

    /// Noise of which up to six tenths are clipped at 0, often with an echo.
    fn dark(&self, rng: &mut impl Rng) -> Vec<u16> {
        let sigma = log_uniform(rng, 0.3, 0.2 * self.full_scale);
        let ambient = sigma * rng.random_range(-0.25..2.0);
        let mut wave = noise(rng, self.samples, ambient, sigma);
        if rng.random() {
            let amplitude = sigma * log_uniform(rng, 1.0, 100.0);
            add_echo(&mut wave, self.place(rng), amplitude, self.width);
        }
        self.digitised(wave)
    }

    /// An echo of one to 10⁵ times the saturation level; sometimes two, or at an end of the window.
    fn clipped(&self, rng: &mut impl Rng) -> Vec<u16> {
        let mut wave = self.quiet(rng);
        let deepest = pick(rng, &[3.0, 60.0, 1e5]);
        let at = match rng.random_range(0..6) {
            0 => 2.0 * self.width * rng.random::<f64>(),
            1 => self.samples as f64 - 2.0 * self.width * rng.random::<f64>(),
            _ => self.place(rng),
        };
        add_echo(&mut wave, at, self.clip * log_uniform(rng, 1.0, deepest), self.width);
        if rng.random_range(0..4) == 0 {
            let other = at + self.width * rng.random_range(-3.0..3.0);
            add_echo(&mut wave, other, self.clip * log_uniform(rng, 0.1, 10.0), self.width);
        }
        self.digitised(wave)
    }

    /// An echo, and near its top one code at the saturation level or one below.
    fn clip_edge(&self, rng: &mut impl Rng) -> Vec<u16> {
        let mut wave = vec![0.0; self.samples];
        let at = self.place(rng).floor();
        add_echo(&mut wave, at, self.clip * 0.8 * rng.random::<f64>(), self.width);
        let mut codes = self.digitised(wave);
        let reach = (0.5 * self.width) as i64 + 2;
        let near = at as i64 + rng.random_range(-reach..=reach);
        if let Some(code) = usize::try_from(near).ok().and_then(|n| codes.get_mut(n)) {
            *code = self.clip as u16 - u16::from(rng.random::<bool>());
        }
        codes
    }

    /// Two echoes, from wholly merged to well apart.
    fn pair(&self, rng: &mut impl Rng) -> Vec<u16> {
        let mut wave = self.quiet(rng);
        let at = self.place(rng);
        let amplitude = log_uniform(rng, 4.0, self.full_scale);
        let ratio = if rng.random() { 1.0 } else { log_uniform(rng, 0.05, 1.0) };
        add_echo(&mut wave, at, amplitude, self.width);
        add_echo(
            &mut wave,
            at + 3.0 * self.width * rng.random::<f64>(),
            ratio * amplitude,
            self.width,
        );
        self.digitised(wave)
    }

    /// As many echoes as fit: in a long window, more than the detector's candidates.
    fn many(&self, rng: &mut impl Rng) -> Vec<u16> {
        let mut wave = self.quiet(rng);
        let amplitude = log_uniform(rng, 8.0, self.full_scale);
        let width = self.width.min(8.0); // shorter than a long template
        let mut at = 0.0;
        while at < self.samples as f64 {
            add_echo(&mut wave, at, amplitude * rng.random_range(0.2..1.0), width);
            at += width * rng.random_range(1.0..4.0);
        }
        self.digitised(wave)
    }

    /// Equal echoes whole numbers of samples apart: every comparison of heights is a tie.
    fn equal(&self, rng: &mut impl Rng) -> Vec<u16> {
        let phase = f64::from(rng.random_range(0..4u8)) / 4.0;
        let amplitude = log_uniform(rng, 8.0, 0.9 * self.full_scale).round();
        let ambient = (0.1 * self.full_scale * rng.random::<f64>()).round();
        let mut wave = vec![ambient; self.samples];
        let gap = rng.random_range(1..=(6.0 * self.width) as usize);
        let count = rng.random_range(2..50);
        let first = rng.random_range(0..self.samples);
        for i in 0..count {
            let mut echo = vec![0.0; self.samples];
            add_echo(&mut echo, (first + i * gap) as f64 + phase, amplitude, self.width);
            for (wave, echo) in wave.iter_mut().zip(echo) {
                *wave = wave.max(ambient + echo);
            }
        }
        self.digitised(wave)
    }

    /// Echoes at both ends of the window, inside and outside.
    fn edges(&self, rng: &mut impl Rng) -> Vec<u16> {
        let mut wave = self.quiet(rng);
        let amplitude = log_uniform(rng, 8.0, 2.0 * self.full_scale);
        let [begin, end] = [0; 2].map(|_| self.width * rng.random_range(-1.0..1.2));
        add_echo(&mut wave, begin, amplitude, self.width);
        add_echo(&mut wave, self.samples as f64 - 1.0 - end, amplitude, self.width);
        self.digitised(wave)
    }

    fn sawtooth(&self, rng: &mut impl Rng) -> Vec<u16> {
        let period = rng.random_range(2..(8.0 * self.width) as usize + 4);
        let height = log_uniform(rng, 1.0, self.full_scale);
        let falling = rng.random::<bool>();
        let tooth = |n: usize| if falling { period - 1 - n % period } else { n % period };
        (0..self.samples).map(|n| (height * tooth(n) as f64 / period as f64) as u16).collect()
    }

    fn square(&self, rng: &mut impl Rng) -> Vec<u16> {
        let period = rng.random_range(2..(8.0 * self.width) as usize + 4);
        let on = rng.random_range(1..period);
        let [low, high] = [0; 2].map(|_: i32| rng.random_range(0..=self.full_scale as u16));
        (0..self.samples).map(|n| if n % period < on { high } else { low }).collect()
    }

    fn random(&self, rng: &mut impl Rng, top: u16) -> Vec<u16> {
        (0..self.samples).map(|_| rng.random_range(0..=top)).collect()
    }

    /// Codes beyond the sensor's ADC; sometimes more of them than a waveform may have.
    fn wild(&self, rng: &mut impl Rng) -> Vec<u16> {
        match rng.random_range(0..4) {
            0 => self.random(rng, u16::MAX),
            1 => (0..MAX_SAMPLES + rng.random_range(1..100)).map(|_| rng.random()).collect(),
            2 => {
                let high = rng.random_range(30_000..=u16::MAX);
                (0..self.samples).map(|_| high.saturating_add(rng.random_range(0..4))).collect()
            }
            _ => {
                let mut codes = self.random(rng, self.full_scale as u16);
                for _ in 0..10 {
                    codes[rng.random_range(0..self.samples)] = u16::MAX;
                }
                codes
            }
        }
    }

    fn plateaus(&self, rng: &mut impl Rng) -> Vec<u16> {
        let mut codes = Vec::with_capacity(self.samples);
        let top = log_uniform(rng, 2.0, self.full_scale) as u16;
        while codes.len() < self.samples {
            let length = rng.random_range(1..=(6.0 * self.width) as usize);
            codes.extend(vec![rng.random_range(0..=top); length]);
        }
        codes.truncate(self.samples);
        codes
    }

    /// Two codes, about half of the samples each: one sample decides the median.
    fn two_levels(&self, rng: &mut impl Rng) -> Vec<u16> {
        let low = rng.random_range(0..self.full_scale as u16 - 20);
        let high = low + pick(rng, &[1, 2, 3, 20]);
        let length = self.samples - rng.random_range(0..2);
        let lows = length / 2 + rng.random_range(0..3) - 1;
        let mut codes: Vec<u16> = (0..length).map(|n| if n < lows { low } else { high }).collect();
        for n in (1..length).rev() {
            codes.swap(n, rng.random_range(0..=n));
        }
        codes
    }
}

/// A run of clipped samples, and its pulse.
#[derive(Clone, Debug)]
pub struct ClippedRun {
    /// Full width at half maximum, ps.
    pub width_ps: u32,
    /// Sample period, fs.
    pub period_fs: u32,
    /// Waveform without baseline, Q1.15.
    pub x: Vec<i16>,
    /// Clip level, Q1.15.
    pub level: i64,
    /// First sample of the run.
    pub first: usize,
    /// Last sample of the run.
    pub last: usize,
    /// σ̂, Q13.19.
    pub sigma: u32,
    /// κ, Q0.32.
    pub shot: u32,
}

/// Draws a pulse from just clipped to far beyond, at most 130 samples wide, in noise from none to
/// hiding it. Some runs are of another length than the pulse's, or at the ends.
pub fn clipped_run(seed: u64) -> ClippedRun {
    let mut rng = rng(seed ^ 0x0063_6c69_7070_6564);
    let rng = &mut rng;
    let period_fs = log_uniform(rng, 300_000.0, 4e6);
    let longest = pick(rng, &[3.0, 12.0, 130.0]);
    let samples = log_uniform(rng, 2.0, longest);
    let width_ps = if rng.random_range(0..64) == 0 {
        rng.random_range(0..60)
    } else {
        (samples * period_fs / 1e3) as u32
    };
    let level = match rng.random_range(0..4) {
        0 => rng.random_range(1..200),
        1 => 65_535 >> rng.random_range(0..4),
        _ => rng.random_range(1..=32_767),
    };
    let sigma = (16.0 * log_uniform(rng, 0.01, 1e4)) as u32 * rng.random_range(0..=1);
    let shot = any_size(rng, 1 << 22);
    let deepest = pick(rng, &[1.5, 10.0, 1e5]);
    let depth = log_uniform(rng, 1.0, deepest);
    let length = 8 + (3.0 * samples) as usize;
    let at = length as f64 / 2.0 + f64::from(rng.random_range(0..16u8)) / 16.0;
    let mut wave = noise(rng, length, 0.0, f64::from(sigma) / 16.0);
    add_echo(&mut wave, at, depth * level as f64, samples);
    if rng.random_range(0..3) == 0 {
        let clutter = pick(rng, &[1.5, 20.0, level as f64]);
        wave.iter_mut().for_each(|v| *v += clutter * (2.0 * rng.random::<f64>() - 0.5));
    }
    let clipped = |v: &f64| *v >= level as f64;
    let summit = (at as usize).min(length - 1);
    let (mut first, mut last) = (summit, summit);
    while first > 0 && clipped(&wave[first - 1]) {
        first -= 1;
    }
    while last + 1 < length && clipped(&wave[last + 1]) {
        last += 1;
    }
    if rng.random_range(0..8) == 0 {
        first = rng.random_range(0..=first);
        last = rng.random_range(last..length);
    }
    if rng.random_range(0..32) == 0 {
        return flat_top(rng, level, shot);
    }
    let x = wave
        .iter()
        .map(|v| v.round().min(level as f64).clamp(-32_768.0, 32_767.0) as i16)
        .collect();
    ClippedRun { width_ps, period_fs: period_fs as u32, x, level, first, last, sigma, shot }
}

/// Draws one clipped sample of the longest pulses, in noise that its neighbours just exceed: the
/// most uncertain edges.
fn flat_top(rng: &mut impl Rng, level: i64, shot: u32) -> ClippedRun {
    let width_ps = rng.random_range(100_000..=140_000);
    let x = (0..9).map(|_| (level - rng.random_range(0..2)).min(0x7fff) as i16).collect();
    let sigma = (level as f64 * 16.0 / rng.random_range(2.9..6.0)) as u32;
    let first = rng.random_range(1..8); // a run beside an end has only one pair of samples
    ClippedRun {
        width_ps,
        period_fs: 1_000_000,
        x,
        level,
        first,
        last: first,
        sigma,
        shot: shot % 4,
    }
}

/// Draws a filter's output and a threshold: steps of a few LSB, plateaus, ties, full-scale jumps.
pub fn output(seed: u64) -> (Vec<i16>, i16) {
    let mut rng = rng(seed ^ 0x6f75_7470_7574);
    let length = if rng.random_range(0..8) == 0 {
        rng.random_range(0..40)
    } else {
        rng.random_range(40..600)
    };
    let random = rng.random_range(1..=0x7fff);
    let threshold = pick(&mut rng, &[1, 2, 3, 4, 5, 8, 15, 16, 40, 41, 200, 2_000, random, 0x7fff]);
    let level = i32::from(threshold);
    let y: Vec<i32> = match seed % 7 {
        0 => walk(&mut rng, length, 3),
        1 => walk(&mut rng, length, 1 + level / 2),
        2 => (0..length).map(|_| i32::from(rng.random::<i16>())).collect(),
        3 => (0..length).map(|_| rng.random_range(level / 2 - 2..=level + 3)).collect(),
        4 => staircase(&mut rng, length, level),
        5 => comb(&mut rng, length, level),
        _ => bumps(&mut rng, length, level),
    };
    (y.into_iter().map(|v| v.clamp(-0x8000, 0x7fff) as i16).collect(), threshold)
}

fn walk(rng: &mut impl Rng, length: usize, step: i32) -> Vec<i32> {
    let mut value = 0;
    let mut next = || {
        value += rng.random_range(-step..=step);
        value
    };
    (0..length).map(|_| next()).collect()
}

/// Steps up and down of just the size of a peak or valley, give or take one LSB.
fn staircase(rng: &mut impl Rng, length: usize, threshold: i32) -> Vec<i32> {
    let mut value: i32 = threshold + rng.random_range(0..4 * threshold + 40);
    let mut next = || {
        let size = (threshold / 2).max(value / 16) + rng.random_range(-1..=2);
        let sign = if value > 0x7000 || value > 12 * threshold + 400 {
            -1
        } else if value < threshold / 2 {
            1
        } else {
            rng.random_range(-1..=1)
        };
        value += sign * size;
        value
    };
    (0..length).map(|_| next()).collect()
}

/// Narrow spikes, many of the same height.
fn comb(rng: &mut impl Rng, length: usize, threshold: i32) -> Vec<i32> {
    let gap = rng.random_range(2..12);
    let spread = pick(rng, &[0, 1, 2, 100]);
    (0..length)
        .map(|n| if n % gap == 0 { threshold + rng.random_range(-1..=spread) } else { 0 })
        .collect()
}

/// Filtered echoes of random height and width, their tops often flat.
fn bumps(rng: &mut impl Rng, length: usize, threshold: i32) -> Vec<i32> {
    let mut wave = vec![0.0; length];
    let width = rng.random_range(2.0..30.0);
    for _ in 0..rng.random_range(1..12) {
        let amplitude = f64::from(threshold) * log_uniform(rng, 0.5, 40.0);
        add_echo(
            &mut wave,
            rng.random::<f64>() * (length as f64 + 20.0) - 10.0,
            amplitude.min(40_000.0),
            width,
        );
    }
    let flat = if rng.random() { 2.0 * f64::from(threshold) } else { 32_767.0 };
    wave.into_iter().map(|v| v.min(flat).round() as i32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_draws_the_same_case_twice() {
        for seed in 0..32 {
            assert_eq!(case(seed).codes, case(seed).codes);
        }
    }

    #[test]
    fn every_case_has_accepted_settings() {
        for seed in 0..2_000 {
            let case = case(seed);
            assert_eq!(case.settings.check(&case.hardware), Ok(()), "seed {seed}");
        }
    }
}
