//! Response curves on surfaces of growing roughness, interpolated at any time.

/// Points of a curve per full width at half maximum.
pub(super) const PER_WIDTH: f64 = 24.0;

/// Number of prepared surfaces: the widest makes an echo some twelve times as wide as the pulse.
const SURFACES: i32 = 24;

/// σ of the first surface over the pulse's width, and of each surface over the one before.
const FIRST: f64 = 0.12;
const RATIO: f64 = 1.18;

/// Widths of narrower lobes over the response's: surfaces widened the echoes that the response is
/// estimated from.
const NARROWER: [f64; 4] = [0.7, 0.775, 0.85, 0.925];

/// Number of the flat surface, which gives the response itself.
pub(super) const FLAT: f64 = NARROWER.len() as f64;

/// Values on an even grid, 0 outside it. The top is 1, at time 0.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Curve {
    pub(super) values: Vec<f64>,
    /// Samples between two points.
    pub(super) step: f64,
    /// Index of the point at time 0.
    pub(super) zero: usize,
    /// Full width at half maximum, samples.
    pub(super) width: f64,
}

impl Curve {
    /// Scales values so that their top is 1 at time 0; `None` without a top.
    pub(super) fn normal(mut values: Vec<f64>, step: f64) -> Option<Self> {
        let zero = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b]))?;
        let top = values[zero];
        if !(top > 0.0 && top.is_finite()) {
            return None;
        }
        values.iter_mut().for_each(|v| *v /= top);
        let width = step * (half(values[..zero].iter().rev()) + half(values[zero + 1..].iter()));
        Some(Self { values, step, zero, width })
    }

    /// The time of a point, samples.
    pub(super) fn time(&self, point: usize) -> f64 {
        (point as f64 - self.zero as f64) * self.step
    }

    /// The value at a time, linear between points, and its slope.
    pub(super) fn at(&self, time: f64) -> (f64, f64) {
        let place = time / self.step + self.zero as f64;
        let index = place.floor();
        if !(index >= 0.0 && index + 1.0 < self.values.len() as f64) {
            return (0.0, 0.0);
        }
        let (a, b) = (self.values[index as usize], self.values[index as usize + 1]);
        (a + (b - a) * (place - index), (b - a) / self.step)
    }

    /// Times of the first point and the last, samples.
    pub(super) fn reach(&self) -> (f64, f64) {
        (self.time(0), self.time(self.values.len().saturating_sub(1)))
    }

    /// The curve on a Gaussian surface of σ samples.
    fn on_surface(&self, sigma: f64) -> Option<Self> {
        let sigma = sigma / self.step;
        let half = (4.0 * sigma).ceil() as usize;
        let tap = |k: usize| libm::exp(-0.5 * ((k as f64 - half as f64) / sigma).powi(2));
        let taps: Vec<f64> = (0..=2 * half).map(tap).collect();
        let mut values = vec![0.0; self.values.len() + 2 * half];
        for (i, v) in self.values.iter().enumerate() {
            for (out, tap) in values[i..].iter_mut().zip(&taps) {
                *out += v * tap;
            }
        }
        Self::normal(values, self.step)
    }

    /// The curve with a narrower lobe and the same tail.
    fn narrower(&self, scale: f64) -> Option<Self> {
        // 1 on the lobe, down to 0 between 1.2 and 1.5 widths.
        let lobe = |time: f64| ((1.5 - time.abs() / self.width) / 0.3).clamp(0.0, 1.0);
        let value = |point: usize| {
            let time = self.time(point);
            let inner = time / scale;
            self.at(inner).0 * lobe(inner) + self.at(time).0 * (1.0 - lobe(time))
        };
        Self::normal((0..self.values.len()).map(value).collect(), self.step)
    }
}

/// Distance in points from a top of 1 to a half, on one side.
fn half<'v>(side: impl Iterator<Item = &'v f64>) -> f64 {
    let (mut last, mut count) = (1.0, 0.0);
    for &v in side {
        if v < 0.5 {
            return count + (last - 0.5) / (last - v);
        }
        (last, count) = (v, count + 1.0);
    }
    count
}

/// The response on surfaces of growing width.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Family {
    curves: Vec<Curve>,
}

/// An echo of height 1 on a surface between two prepared ones. Both have the same grid, so a time
/// has the same share between two points in both.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape<'f> {
    near: &'f [f64],
    far: &'f [f64],
    /// Indices of the points at time 0.
    zeros: (isize, isize),
    /// Share of the way from the near to the far surface.
    share: f64,
    /// Points a sample.
    per_sample: f64,
}

impl Shape<'_> {
    /// Value at a time from its top, linear between points and surfaces.
    #[inline]
    pub(super) fn at(&self, time: f64) -> Value {
        let place = time * self.per_sample;
        let whole = place as isize;
        // Rounds down without a call of `floor`: this is the innermost loop.
        let whole = whole - isize::from(place < whole as f64);
        let (a, da) = between(self.near, whole + self.zeros.0, place - whole as f64);
        let (b, db) = between(self.far, whole + self.zeros.1, place - whole as f64);
        let slope = (da + (db - da) * self.share) * self.per_sample;
        Value { value: a + (b - a) * self.share, slope, growth: b - a }
    }
}

/// Value at a share of the way from a point to the next, and their difference; 0 outside.
#[inline]
fn between(values: &[f64], point: isize, share: f64) -> (f64, f64) {
    match values.get(point as usize..) {
        Some(&[a, b, ..]) => (a + (b - a) * share, b - a),
        _ => (0.0, 0.0),
    }
}

/// An echo of height 1 at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Value {
    pub(super) value: f64,
    /// Derivative by time, 1/samples.
    pub(super) slope: f64,
    /// Derivative by the number of the surface.
    pub(super) growth: f64,
}

impl Family {
    /// Prepares the surfaces, narrowest echo first.
    pub(super) fn new(response: Curve) -> Self {
        let first = FIRST * response.width;
        let narrower = NARROWER.iter().filter_map(|&scale| response.narrower(scale));
        let mut curves: Vec<Curve> = narrower.collect();
        curves.push(response.clone());
        curves.extend((0..SURFACES).map_while(|k| response.on_surface(first * RATIO.powi(k))));
        Self { curves }
    }

    /// The response itself.
    pub(super) fn response(&self) -> &Curve {
        &self.curves[NARROWER.len()]
    }

    /// Greatest number of a surface.
    pub(super) fn widest(&self) -> f64 {
        (self.curves.len() - 1) as f64
    }

    /// Full width at half maximum of an echo, samples.
    pub(super) fn width(&self, surface: f64) -> f64 {
        let (k, share) = self.between(surface);
        let (a, b) = (self.curves[k].width, self.curves[k + 1].width);
        a + (b - a) * share
    }

    /// Number of the surface that makes an echo of this width, samples.
    pub(super) fn surface(&self, width: f64) -> f64 {
        match self.curves.iter().position(|curve| curve.width >= width) {
            Some(0) => 0.0,
            Some(k) => {
                let (a, b) = (self.curves[k - 1].width, self.curves[k].width);
                (k - 1) as f64 + (width - a) / (b - a)
            }
            None => self.widest(),
        }
    }

    /// Begin and end of an echo, samples from its top.
    pub(super) fn reach(&self, surface: f64) -> (f64, f64) {
        self.curves[self.between(surface).0 + 1].reach()
    }

    /// Shape of an echo on a surface.
    pub(super) fn shape(&self, surface: f64) -> Shape<'_> {
        let (k, share) = self.between(surface);
        let (near, far) = (&self.curves[k], &self.curves[k + 1]);
        Shape {
            near: &near.values,
            far: &far.values,
            zeros: (near.zero as isize, far.zero as isize),
            share,
            per_sample: 1.0 / near.step,
        }
    }

    fn between(&self, surface: f64) -> (usize, f64) {
        let k = (surface.max(0.0) as usize).min(self.curves.len() - 2);
        (k, (surface - k as f64).clamp(0.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gaussian(width: f64) -> Curve {
        let sigma = width / 2.354_82;
        let value = |k: i32| libm::exp(-0.5 * (f64::from(k - 200) * 0.25 / sigma).powi(2));
        Curve::normal((0..400).map(value).collect(), 0.25).expect("a top")
    }

    #[test]
    fn a_surface_adds_its_width_in_quadrature() {
        let family = Family::new(gaussian(6.0));
        for (k, sigma) in [(6.0, FIRST * 6.0 * RATIO.powi(1)), (20.0, FIRST * 6.0 * RATIO.powi(15))]
        {
            let expected = 6f64.hypot(2.354_82 * sigma);
            assert!((family.width(k) - expected).abs() < 0.02 * expected, "{k}");
            assert!((family.surface(expected) - k).abs() < 0.2, "{k}");
        }
    }

    #[test]
    fn slope_and_growth_are_the_value_s_derivatives() {
        let family = Family::new(gaussian(6.0));
        for (time, surface) in [(-2.1, 4.4), (0.9, 7.3), (5.2, 18.6), (1.1, 1.5)] {
            let h = 1e-6;
            let at = |t: f64, s: f64| family.shape(s).at(t).value;
            let exact = family.shape(surface).at(time);
            let slope = (at(time + h, surface) - at(time - h, surface)) / (2.0 * h);
            let growth = (at(time, surface + h) - at(time, surface - h)) / (2.0 * h);
            assert!((exact.slope - slope).abs() < 1e-6 && (exact.growth - growth).abs() < 1e-6);
        }
    }

    #[test]
    fn without_a_top_there_is_no_curve() {
        assert_eq!(Curve::normal(vec![0.0, -1.0], 1.0), None);
        assert_eq!(Curve::normal(vec![], 1.0), None);
        assert_eq!(Curve::normal(vec![f64::INFINITY], 1.0), None);
    }
}
