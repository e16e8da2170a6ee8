//! Waveforms and settings to measure with, in integers, so that they are the same everywhere.

use echoloop_dsp::{Hardware, MAX_SAMPLES, Settings};

/// Random numbers by xorshift32.
#[derive(Clone)]
pub(crate) struct Random(u32);

impl Random {
    pub(crate) fn new(seed: u32) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9) | 1)
    }

    pub(crate) fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// Random number from 0 to `end` − 1.
    pub(crate) fn below(&mut self, end: u32) -> u32 {
        ((u64::from(self.next()) * u64::from(end)) >> 32) as u32
    }

    /// About normal noise with σ = 4: the sum of three numbers of 0..8.
    fn noise(&mut self) -> i32 {
        (0..3).map(|_| self.below(8) as i32).sum::<i32>() - 10
    }
}

/// Case that is measured: settings, and the echoes of the waveform.
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) samples: usize,
    range_mm: u32,
    pulse_width_ps: i32,
    gain_slope_mdb_m: i32,
    /// Most echoes that are kept.
    keeps: i32,
    /// Amplitudes of the echoes in codes; the echoes are spread evenly over the waveform.
    pub(crate) echoes: &'static [i32],
}

/// Default of the cases.
const NOISE: Case = Case {
    name: "800x12 noise",
    samples: 800,
    range_mm: 119_000,
    pulse_width_ps: 5_000,
    gain_slope_mdb_m: 0,
    keeps: 1,
    echoes: &[],
};

const FOUR: Case =
    Case { name: "800x12 four echoes", keeps: 4, echoes: &[900, 300, 6000, 150], ..NOISE };

const SHORT: Case = Case {
    name: "256x16 one echo",
    samples: 256,
    range_mm: 38_373,
    pulse_width_ps: 7_500,
    echoes: &[900],
    ..NOISE
};

/// A sample takes a nanosecond, to within 1 %; in the case of 2400 samples, a third of one. Some
/// echoes reach full scale.
pub(crate) const CASES: [Case; 8] = [
    NOISE,
    Case { name: "800x12 one echo", echoes: &[900], ..NOISE },
    FOUR,
    Case { name: "800x12 one echo of four", echoes: &[900], ..FOUR },
    SHORT,
    Case { name: "1024x16 one echo", samples: 1024, range_mm: 153_494, ..SHORT },
    Case {
        name: "2400x62 one echo",
        samples: 2400,
        pulse_width_ps: 10_100,
        echoes: &[900],
        ..NOISE
    },
    Case { name: "800x12 four echoes, near gain", gain_slope_mdb_m: 1_000, ..FOUR },
];

const AMBIENT: i32 = 200;

/// Black level, which no gain scales: in codes, and as a setting.
const BLACK: (i32, i32) = (160, 39_063);

impl Case {
    pub(crate) fn hardware(&self) -> Hardware {
        let reference = Hardware::REFERENCE;
        Hardware { range_max_mm: reference.range_min_mm + self.range_mm, ..reference }
    }

    /// Default settings except for size, pulse, near gain and number of echoes kept.
    pub(crate) fn settings(&self) -> Settings {
        Settings {
            power_uw: 30_000_000,
            pulse_width_ps: self.pulse_width_ps,
            bins: self.samples as i32,
            echoes: self.keeps,
            gain_slope_mdb_m: self.gain_slope_mdb_m,
            black_level_ppm: if self.gain_slope_mdb_m > 0 { BLACK.1 } else { 0 },
            ..Settings::default()
        }
    }

    /// Waveform of 12-bit codes: ambient light, noise, and echoes `half` + 1 samples wide.
    pub(crate) fn waveform(&self, half: usize) -> [u16; MAX_SAMPLES] {
        let mut random = Random::new(1);
        let spacing = self.samples / (self.echoes.len() + 1);
        let rest = if self.gain_slope_mdb_m > 0 { BLACK.0 } else { AMBIENT };
        let square = |samples: usize| samples as i64 * samples as i64;
        core::array::from_fn(|n| {
            let echoes: i64 = (1..)
                .zip(self.echoes)
                .map(|(i, &amplitude)| {
                    let (width, from) = (square(half + 1), square(n.abs_diff(i * spacing)));
                    let shape = (width - from).max(0);
                    i64::from(amplitude) * shape * shape / (width * width)
                })
                .sum();
            (i64::from(rest + random.noise()) + echoes).clamp(0, 4095) as u16
        })
    }
}
