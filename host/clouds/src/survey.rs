//! Survey coordinates: so far from the origin that `f32` would round them, and the shift that
//! brings them near.

use echoloop_files::NumberType;
use nalgebra::{Point3, Vector3};

use crate::Pose;

/// Largest coordinate that is read, m. UTM's northings reach it, and `f64` is exact to 2 nm there.
pub const MOST_COORDINATE_M: f64 = 1e7;

/// Largest median coordinate of a cloud without a shift, m, but downwards: `f32` rounds by up to
/// 0.03 mm there.
const NEAR_M: f64 = 1000.0;

/// Largest coordinate, m, from which no rounding reaches [`NEAR_M`].
pub(crate) const WELL_NEAR_M: f32 = 500.0;

/// Greatest height of a sensor above the median of its points, m; `f32` rounds by up to 0.5 mm
/// there. No survey is so far below its zero: points deep below the origin are an aircraft's.
const ALTITUDE_M: f64 = 10_000.0;

/// Height of a shift over the median height, m. Most points are on the ground, a scanner stands so
/// high above it, and normals face the scanner.
const SCANNER_M: f64 = 2.0;

/// Most points whose median is taken.
const MOST_SAMPLES: usize = 10_000;

/// Coordinates that `f32` does not hold, in the frame of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Exact {
    /// Coordinates in the frame of the file, m, `[n]`.
    pub at_m: Vec<Point3<f64>>,
    /// Numbers that the file has them as.
    pub precision: Precision,
}

/// Numbers that a file has coordinates as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// `f32`, or integers that it holds.
    Single,
    /// Wider integers, or text.
    Wide,
    /// `f64`.
    Double,
}

impl Exact {
    /// The type in which the coordinates are written.
    pub(crate) fn written(&self) -> NumberType {
        match self.precision {
            Precision::Single => NumberType::F32,
            Precision::Wide | Precision::Double => NumberType::F64,
        }
    }
}

/// The shift of a cloud, m: zero near the origin and straight below it, else whole metres, near the
/// middle of the points and [`SCANNER_M`] above it.
pub(crate) fn shift_m(points: impl ExactSizeIterator<Item = Point3<f64>>) -> Vector3<f64> {
    let step = points.len() / MOST_SAMPLES + 1;
    let samples: Vec<Point3<f64>> = points.step_by(step).collect();
    let is_of_sensor =
        |at: &Vector3<f64>| at.xy().amax() <= NEAR_M && (-ALTITUDE_M..=NEAR_M).contains(&at.z);
    let middle = median(&samples);
    match is_of_sensor(&middle) {
        true => Vector3::zeros(),
        false => (middle + SCANNER_M * Vector3::z()).map(f64::round),
    }
}

/// The median of each coordinate, m; zero without points.
fn median(samples: &[Point3<f64>]) -> Vector3<f64> {
    let middle = samples.len().saturating_sub(1) / 2;
    Vector3::from_fn(|axis, _| {
        let mut values: Vec<f64> = samples.iter().map(|p| p[axis]).collect();
        match values.is_empty() {
            true => 0.0,
            false => *values.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    })
}

/// Refuses a finite point with a coordinate beyond [`MOST_COORDINATE_M`].
pub(crate) fn check_range(points: impl Iterator<Item = Point3<f64>>) -> Result<(), String> {
    let is_far =
        |p: &Point3<f64>| p.iter().all(|v| v.is_finite()) && p.coords.amax() > MOST_COORDINATE_M;
    let Some((point, at)) = points.enumerate().find(|(_, point)| is_far(point)) else {
        return Ok(());
    };
    let axis = at.coords.iamax();
    let offset =
        at.coords.map(|v| if v.abs() > NEAR_M { (v / NEAR_M).round() * NEAR_M } else { 0.0 });
    Err(format!(
        "point {point}, counted from 0, has {} = {:e} m, expected at most {MOST_COORDINATE_M:e} m: \
         subtract a common offset from all clouds first, here {:e} {:e} {:e}",
        ["x", "y", "z"][axis],
        at[axis],
        offset.x,
        offset.y,
        offset.z
    ))
}

/// Refuses a shift: such points are no cloud in the frame of its sensor.
pub(crate) fn refuse_shift(shift_m: &Vector3<f64>) -> Result<(), String> {
    if *shift_m == Vector3::zeros() {
        return Ok(());
    }
    let (x, y, z) = (shift_m.x, shift_m.y, shift_m.z);
    Err(format!(
        "expected a cloud in the frame of its sensor, found survey coordinates near {x} {y} {z} m, \
         which single precision rounds by up to {:.1e} m: subtract that offset first",
        shift_m.amax() * f64::from(f32::EPSILON) / 2.0
    ))
}

/// A motion between frames as one between frames that are shifted: `a'_from_b'`, where `a = a' +
/// a_shift_m` and `b = b' + b_shift_m`. Without shifts it is the same to the bit.
///
/// ```text
/// a'_from_b' = T(-a_shift) · a_from_b · T(b_shift)
/// ```
#[must_use]
pub fn shifted(a_from_b: &Pose, a_shift_m: &Vector3<f64>, b_shift_m: &Vector3<f64>) -> Pose {
    let mut motion = *a_from_b;
    if *a_shift_m != *b_shift_m || *b_shift_m != Vector3::zeros() {
        let moved = motion.rotation * b_shift_m - a_shift_m;
        motion.translation.vector += moved;
    }
    motion
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cloud_near_the_origin_has_no_shift_and_one_far_off_whole_metres() {
        let cloud = |x: f64| (0..30_000).map(move |i| Point3::new(x + f64::from(i % 7), 0.3, -0.4));
        assert_eq!(shift_m(cloud(990.0).collect::<Vec<_>>().into_iter()), Vector3::zeros());
        let far = cloud(-5_155_487.25).collect::<Vec<_>>().into_iter();
        assert_eq!(shift_m(far), Vector3::new(-5_155_484.0, 0.0, 2.0));
        assert_eq!(shift_m([].into_iter()), Vector3::zeros());
    }

    #[test]
    fn points_an_aircraft_sees_below_it_keep_their_sensor_and_mountains_have_a_shift() {
        let cloud = |x: f64, z: f64| {
            let points = (-500..=500).map(move |i| Point3::new(x + f64::from(i), -0.5, z));
            points.collect::<Vec<_>>().into_iter()
        };
        assert_eq!(shift_m(cloud(300.0, -3000.0)), Vector3::zeros());
        assert_eq!(shift_m(cloud(0.0, 2600.0)), Vector3::new(0.0, -1.0, 2602.0));
        assert_eq!(shift_m(cloud(2000.0, -3000.0)), Vector3::new(2000.0, -1.0, -2998.0));
        assert_eq!(shift_m(cloud(0.0, -5e6)), Vector3::new(0.0, -1.0, 2.0 - 5e6));
    }

    #[test]
    fn a_motion_between_shifted_frames_moves_each_point_alike() {
        let motion = Pose::new(Vector3::new(9.0, -7.0, 1.0), Vector3::new(0.1, 0.2, -0.4));
        let (a, b) = (Vector3::new(7e5, 5e6, 400.0), Vector3::new(7e5, 5e6, 380.0));
        let point = Point3::new(3.0, 4.0, 5.0);
        let expected = motion * (point + b) - a;
        assert!((shifted(&motion, &a, &b) * point - expected).norm() < 1e-8);
        let back = shifted(&shifted(&motion, &a, &b), &-a, &-b);
        assert!((back.translation.vector - motion.translation.vector).norm() < 1e-8);
        assert_eq!(shifted(&motion, &Vector3::zeros(), &Vector3::zeros()), motion);
    }

    #[test]
    fn a_coordinate_beyond_ten_million_metres_is_refused_with_an_offset_that_cures_it() {
        let at = |x: f64| check_range([Point3::origin(), Point3::new(2.0, x, 3e5)].into_iter());
        assert_eq!(at(-1e7), Ok(()));
        assert_eq!(at(f64::INFINITY), Ok(()), "no echo");
        let refusal = at(-1.2345678e7).unwrap_err();
        assert!(refusal.contains("point 1, counted from 0, has y = -1.2345678e7 m"), "{refusal}");
        assert!(refusal.ends_with("here 0e0 -1.2346e7 3e5"), "{refusal}");
    }
}
