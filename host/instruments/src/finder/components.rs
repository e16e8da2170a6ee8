//! Separation of overlapping echoes: a sum of Gaussians, fitted together.

// No overflow: samples, heights and Gaussians are Q1.15, at most 32 of them; distances below 2¹⁷ in
// Q8 where a Gaussian is not 0; sums of 2400: below 2⁵⁶; divisors are checked.

use heapless::Vec;

use super::gaussian::{Gaussian, MAX_SIGMA, MIN_SIGMA};
use echoloop_dsp::peak::{MAX_CANDIDATES, Peak};
use echoloop_dsp::q::{divide_round, shift_round};

/// Greatest number of rounds of the fit.
pub const SWEEPS: usize = 60;

/// One Gaussian of the sum.
#[derive(Clone, Copy, Debug)]
pub struct Component {
    /// Centre u, Q16.16 samples.
    pub time: i64,
    /// Height A, Q1.15.
    pub height: i64,
    /// Shape: σ.
    pub shape: Gaussian,
}

/// Components in the order of their peaks.
pub type Components = Vec<Component, MAX_CANDIDATES>;

/// Fits `x ≈ Σ A·e^(−(n − u)²/2σ²)` by least squares, in rounds over the components.
///
/// ```text
/// m[n]  = Σ (A·g(n − u) + 2¹⁴) >> 15                      over all components
/// r[n]  = x[n] − m[n] + own part of m[n]                  what is left for this one
/// w[n]  = (r[n]·g(d) + 2¹⁴) >> 15,  d = n − u             within 4.5 σ
/// S₀, S₁, S₂ = Σ w, Σ w·d, Σ w·(d² >> 8)
/// u    += 2·S₁/S₀                                at most σ/2 either way, and within the record
/// v     = S₂/S₀;   σ² ← v·σ² / (σ² − v)                   within 0.7 to 1.4 of σ
/// A     = Σ r·g / Σ ((g² + 2¹⁴) >> 15)                    with the new g; at least 0, at most 2¹⁶
/// ```
///
/// | name | format |
/// |---|---|
/// | `x`, `m`, `r`, `A`, `w` | Q1.15 |
/// | `u` | Q16.16 samples; `d` in Q8: (n·2¹⁶ − u) >> 8 |
/// | `S₀`, `S₁`, `S₂` | Q15, Q23, Q23, exact |
/// | 2·S₁/S₀ | Q16.16, nearest |
/// | `σ²`, `v` | Q8 samples²: σ·σ >> 8; quotients nearest |
/// | `σ` | Q8 samples: ⌊√(σ² · 2⁸)⌋, within ⌊0.7 σ⌋, ⌊1.4 σ⌋ (179, 358 of 2⁸) and its bounds |
///
/// It ends after [`SWEEPS`] rounds, or after one that moved no centre by 2⁻⁸ samples and no σ.
/// Adaptive Gaussian moments, made joint: derived in benches/record/finder.md, Overlapping echoes
/// apart.
#[derive(Clone, Copy, Debug)]
pub struct Fit<'a> {
    /// Waveform without ambient, Q1.15.
    pub x: &'a [i16],
}

impl Fit<'_> {
    /// Fits one component to each peak. `model` is memory for at least as many samples as x.
    pub fn run(&self, peaks: &[Peak], model: &mut [i32]) -> Components {
        let model = model.get_mut(..self.x.len()).unwrap_or_default();
        model.fill(0);
        let mut components: Components = peaks.iter().map(|peak| self.first_guess(peak)).collect();
        for component in &components {
            add(component, 1, model);
        }
        for _ in 0..SWEEPS {
            let mut moved = false;
            for component in &mut components {
                add(component, -1, model);
                moved |= self.update(component, model);
                add(component, 1, model);
            }
            if !moved {
                break;
            }
        }
        components
    }

    /// Component at the peak's sample and height, with σ = w/1.177 (217 of 2⁸, at least 1). w is
    /// the distance, samples, to the nearer side where x falls to half the height, rises by more
    /// than a fiftieth of it, or ends.
    fn first_guess(&self, peak: &Peak) -> Component {
        let index = usize::from(peak.index);
        let height = self.x.get(index).map_or(0, |&x| i64::from(x)).max(1);
        let before = self.x.get(..index).unwrap_or_default().iter().rev();
        let after = self.x.get(index..).unwrap_or_default().iter().skip(1);
        let width = half_width(height, before).min(half_width(height, after));
        let shape = Gaussian::new((width as i64 * 217).max(256));
        Component { time: i64::from(peak.index) << 16, height, shape }
    }

    /// One step of one component; true when it moved.
    fn update(&self, component: &mut Component, others: &[i32]) -> bool {
        let (mut s0, mut s1, mut s2) = (0, 0, 0);
        for (r, d) in self.residuals(component, others) {
            let w = shift_round(r * component.shape.at(d), 15);
            s0 += w;
            s1 += w * d;
            s2 += w * ((d * d) >> 8);
        }
        if s0 <= 0 {
            return false; // no residual here to move it by
        }
        let sigma = component.shape.sigma();
        let step = divide_round(s1 << 9, s0).clamp(-(sigma << 7), sigma << 7);
        component.time = (component.time + step).clamp(0, (self.x.len().max(1) as i64 - 1) << 16);
        component.shape = Gaussian::new(next_sigma(sigma, divide_round(s2, s0)));
        let (mut rg, mut gg) = (0, 0);
        for (r, d) in self.residuals(component, others) {
            let g = component.shape.at(d);
            rg += r * g;
            gg += shift_round(g * g, 15);
        }
        component.height = divide_round(rg, gg).clamp(0, 1 << 16);
        step.abs() >= 1 << 8 || component.shape.sigma() != sigma
    }

    /// r and d of the samples around a component.
    fn residuals(&self, component: &Component, others: &[i32]) -> impl Iterator<Item = (i64, i64)> {
        let component = *component;
        let (start, end) = span(&component, self.x.len());
        let x = self.x.get(start..end).unwrap_or_default().iter();
        let pairs = x.zip(others.get(start..end).unwrap_or_default()).zip(start as i64..);
        pairs.map(move |((&x, &m), n)| {
            (i64::from(x) - i64::from(m), ((n << 16) - component.time) >> 8)
        })
    }
}

/// Start and end of the samples within reach, within `0..samples`.
fn span(component: &Component, samples: usize) -> (usize, usize) {
    let centre = component.time >> 8;
    let first = ((centre - component.shape.reach()) >> 8).max(0) as usize;
    let last = ((centre + component.shape.reach()) >> 8).max(0) as usize + 1;
    (first.min(samples), last.min(samples))
}

/// Adds `sign` times a component to the model.
fn add(component: &Component, sign: i64, model: &mut [i32]) {
    let (start, end) = span(component, model.len());
    for (m, n) in model.get_mut(start..end).unwrap_or_default().iter_mut().zip(start as i64..) {
        let d = ((n << 16) - component.time) >> 8;
        *m += (sign * shift_round(component.height * component.shape.at(d), 15)) as i32;
    }
}

/// Distance in samples from a peak to half its height or a valley on one side; at least 1.
fn half_width<'a>(height: i64, side: impl Iterator<Item = &'a i16>) -> usize {
    let mut last = height;
    let down = side.take_while(|&&x| {
        let x = i64::from(x);
        let falls = 2 * x > height && 50 * (x - last) <= height;
        last = x;
        falls
    });
    down.count() + 1
}

/// The next σ, Q8 samples, from σ and v = S₂/S₀.
fn next_sigma(sigma: i64, v: i64) -> i64 {
    let square = (sigma * sigma) >> 8;
    let next = match square - v {
        // v within 2⁻⁴ of σ² or above: flatter than any Gaussian, so σ grows by 1.3.
        ..=16 => (sigma * 333) >> 8,
        rest => (divide_round(v.max(0) * square, rest) << 8).isqrt(),
    };
    next.clamp((sigma * 179) >> 8, (sigma * 358) >> 8).clamp(MIN_SIGMA, MAX_SIGMA)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaussians of (centre, height, σ) in samples and Q1.15.
    fn waveform(echoes: &[(f64, f64, f64)]) -> [i16; 120] {
        core::array::from_fn(|n| {
            let value = |&(u, a, s): &(f64, f64, f64)| {
                a * (-(n as f64 - u) * (n as f64 - u) / (2.0 * s * s)).exp()
            };
            echoes.iter().map(value).sum::<f64>() as i16
        })
    }

    fn fit(x: &[i16], indices: &[u16]) -> Components {
        let peaks: Components = Components::new();
        assert!(peaks.is_empty());
        let peaks: Vec<Peak, 8> = indices.iter().map(|&index| Peak { index, height: 1 }).collect();
        Fit { x }.run(&peaks, &mut [0; 120])
    }

    #[test]
    fn one_echo_is_found_to_a_hundredth_of_a_sample() {
        let found = fit(&waveform(&[(40.37, 9_000.0, 6.5)]), &[40]);
        assert!((found[0].time as f64 / 65536.0 - 40.37).abs() < 0.01, "{found:?}");
        assert!((found[0].shape.sigma() as f64 / 256.0 - 6.5).abs() < 0.02, "{found:?}");
        assert!((found[0].height - 9_000).abs() < 20, "{found:?}");
    }

    #[test]
    fn overlapping_echoes_do_not_pull_each_other() {
        let found = fit(&waveform(&[(40.0, 9_000.0, 6.0), (58.5, 5_000.0, 8.0)]), &[40, 57]);
        assert!((found[0].time as f64 / 65536.0 - 40.0).abs() < 0.1, "{found:?}");
        assert!((found[1].time as f64 / 65536.0 - 58.5).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn no_waveform_panics_or_overflows() {
        for value in [i16::MIN, -1, 0, 1, i16::MAX] {
            for index in [0, 1, 119, 120, u16::MAX] {
                fit(&[value; 120], &[index, index, 60]);
                fit(&[], &[index]);
            }
        }
    }
}
