//! An echo behind the filter, in real numbers, from which the timing stage's constants follow.

use echoloop_dsp::choice::TimingMethod;

use crate::bit_true::lagrange;
use crate::vectors::pulse;

/// An echo of height 1 behind a symmetric filter. Times are in samples.
#[derive(Clone, Debug)]
pub struct Filtered {
    taps: Vec<f64>,
    width: f64,
    /// ℓ: interpolation weights of the samples −3..=4 at 1/o; for o = 1, sample 1 only.
    weights: Vec<(i32, f64)>,
    o: f64,
}

impl Filtered {
    /// An echo behind these taps, of a pulse `width` samples wide, interpolated at steps of 1/o.
    pub fn new(taps: Vec<f64>, width: f64, upsampling: i32) -> Self {
        let o = f64::from(upsampling);
        let weights =
            if upsampling == 1 { vec![(1, 1.0)] } else { (-3..).zip(lagrange(1.0 / o)).collect() };
        Self { taps, width, weights, o }
    }

    /// Index of the last tap, counted from the middle.
    fn half(&self) -> i32 {
        self.taps.len() as i32 / 2
    }

    fn tap(&self, k: i32) -> f64 {
        usize::try_from(k + self.half()).ok().and_then(|i| self.taps.get(i)).copied().unwrap_or(0.0)
    }

    /// h, interpolated linearly between taps.
    fn between(&self, k: f64) -> f64 {
        let whole = k.floor();
        (1.0 - k + whole) * self.tap(whole as i32) + (k - whole) * self.tap(whole as i32 + 1)
    }

    /// Filtered echo r(t).
    pub fn at(&self, t: f64) -> f64 {
        (-self.half()..=self.half())
            .map(|k| self.tap(k) * pulse(t - f64::from(k), self.width))
            .sum()
    }

    /// β: error of a parabola through r at steps of 1/o, a quarter of a step off the top, in units
    /// of δ (1 − 4δ²).
    pub fn bias(&self) -> f64 {
        let z = |steps: f64| self.at((steps - 0.25) / self.o);
        let parabola = (z(-1.0) - z(1.0)) / (2.0 * (z(-1.0) - 2.0 * z(0.0) + z(1.0)));
        16.0 / 3.0 * (parabola - 0.25)
    }

    /// Time at which r falls to half of its height, by bisection.
    fn half_width(&self) -> f64 {
        let (mut low, mut high) = (0.0, 2.0 * self.width);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if self.at(middle) > 0.5 * self.at(0.0) { low = middle } else { high = middle }
        }
        high
    }

    /// z, time from a method's edge to the middle of the echo.
    pub fn offset(&self, method: TimingMethod) -> f64 {
        match method {
            TimingMethod::ConstantFraction => self.half_width(),
            TimingMethod::RisingEdge => self.width + f64::from(self.half()),
            _ => 0.0,
        }
    }

    /// d[k], sensitivity of the method to sample k; z is its offset.
    fn shift(&self, method: TimingMethod, z: f64, k: i32) -> f64 {
        if method == TimingMethod::ConstantFraction {
            return self.between(f64::from(k) - z) - 0.5 * self.tap(k);
        }
        let rise =
            |&(t, weight): &(i32, f64)| weight * (self.tap(k + t) - self.tap(k - t)) * self.o / 2.0;
        self.weights.iter().map(rise).sum()
    }

    fn slope(&self, method: TimingMethod, z: f64) -> f64 {
        if method == TimingMethod::ConstantFraction {
            return self.at(z - 0.5) - self.at(z + 0.5);
        }
        let step = 1.0 / self.o;
        (2.0 * self.at(0.0) - self.at(step) - self.at(-step)) * self.o.powi(2) / (1.0 - self.bias())
    }

    /// Ratio of the time's σ to σ/A of a sample, and the share of the top's shot noise that counts.
    pub fn gain_and_share(&self, method: TimingMethod) -> (f64, f64) {
        let z = self.offset(method);
        let reach = 2 * self.half() + self.width.ceil() as i32 + 8;
        let (mut noise, mut shot) = (0.0, 0.0);
        for k in -reach..=reach {
            let square = self.shift(method, z, k).powi(2);
            noise += square;
            shot += square * pulse(k.into(), self.width);
        }
        (noise.sqrt() / self.slope(method, z), shot / noise)
    }
}
