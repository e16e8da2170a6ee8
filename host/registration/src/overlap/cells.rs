//! Cells of equal angles into which the directions around a sensor fall.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use echoloop_dispatch::dispatch;
use nalgebra::Point3;

use super::is_echo;

/// Cells over the whole sphere, row after row from straight down.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    pub(super) columns: usize,
    pub(super) rows: usize,
    /// Angle of a cell, rad.
    pub(super) step_rad: f32,
}

impl Cells {
    /// Cells of an angle of which a turn is a multiple.
    pub(super) fn of_step(step_rad: f32) -> Self {
        let [columns, rows] = [TAU, PI].map(|angle| (angle / step_rad).round() as usize);
        Self { columns, rows, step_rad }
    }

    /// Cells no larger than an angle.
    pub(super) fn within(step_rad: f32) -> Self {
        let columns = (TAU / step_rad).ceil() as usize;
        let step_rad = TAU / columns as f32;
        Self { columns, rows: (PI / step_rad).ceil() as usize, step_rad }
    }

    pub(super) fn len(&self) -> usize {
        self.columns * self.rows
    }

    /// Index of the cell of an azimuth and an elevation: see [`direction`].
    pub(super) fn at(&self, [azimuth, elevation]: &[f32; 2]) -> usize {
        let column = ((azimuth / self.step_rad) as usize).min(self.columns - 1);
        let row = ((elevation / self.step_rad) as usize).min(self.rows - 1);
        row * self.columns + column
    }

    /// Row and column of a cell.
    pub(super) fn place(&self, at: usize) -> (usize, usize) {
        (at / self.columns, at % self.columns)
    }

    /// Indices of a cell of a row and of those beside it, all the way round: the first column is
    /// beside the last.
    pub(super) fn beside(&self, row: usize, column: usize) -> [usize; 3] {
        let columns = [column + self.columns - 1, column, column + 1];
        columns.map(|column| row * self.columns + column % self.columns)
    }
}

/// What a sensor at the origin saw: a direction and how far.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Index of the point.
    pub(super) point: usize,
    /// See [`direction`].
    pub(super) direction: [f32; 2],
    pub(super) range_m: f32,
}

impl Seen {
    /// Of all points that are echoes.
    pub(super) fn all(points: &[Point3<f32>]) -> Vec<Self> {
        let mut seen = Vec::with_capacity(points.len());
        see(points, &mut seen);
        seen
    }
}

dispatch! {
    /// Adds what the sensor saw at each point that is an echo.
    fn see(points: &[Point3<f32>], seen: &mut Vec<Seen>) = see_inline;
}

#[inline(always)]
fn see_inline(points: &[Point3<f32>], seen: &mut Vec<Seen>) {
    for (block, points) in points.chunks(LANES).enumerate() {
        let at = |lane: usize| points.get(lane).copied().unwrap_or_default();
        // All angles before the first is kept: eight at a time.
        let angles: [[f32; 2]; LANES] = std::array::from_fn(|lane| direction(&at(lane)));
        for (lane, (point, direction)) in points.iter().zip(angles).enumerate() {
            if is_echo(point) {
                let range_m = point.coords.norm();
                seen.push(Seen { point: block * LANES + lane, direction, range_m });
            }
        }
    }
}

/// Directions that are computed at a time.
const LANES: usize = 8;

/// Azimuth, from 0 to 2 π, and elevation above straight down, rad.
#[inline(always)]
pub(super) fn direction(point: &Point3<f32>) -> [f32; 2] {
    let across = (point.x * point.x + point.y * point.y).sqrt();
    [atan2(point.y, point.x) + PI, atan2(point.z, across) + FRAC_PI_2]
}

/// `atan2` to 1e-6 rad, of finite numbers, without a branch.
///
/// Abramowitz and Stegun, "Handbook of Mathematical Functions", 1964, 4.4.49.
#[inline(always)]
fn atan2(y: f32, x: f32) -> f32 {
    const POWERS: [f32; 8] = [
        -0.333_331_45,
        0.199_935_51,
        -0.142_089,
        0.106_562_64,
        -0.075_289_64,
        0.042_909_614,
        -0.016_165_737,
        0.002_866_226,
    ];
    let (across, up) = (x.abs(), y.abs());
    let is_steep = up > across;
    let (less, more) = if is_steep { (across, up) } else { (up, across) };
    let slope = less / more.max(f32::MIN_POSITIVE);
    let squared = slope * slope;
    let series = POWERS.iter().rev().fold(0.0, |sum, power| (sum + power) * squared);
    let angle = slope + slope * series;
    let angle = if is_steep { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    angle.copysign(y)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn angles_are_those_of_atan2(y in -1e3f32..1e3, x in -1e3f32..1e3, low in -40i32..1) {
            for (y, x) in [(y, x), (y * 2f32.powi(low), x), (y, x * 2f32.powi(low))] {
                prop_assert!((atan2(y, x) - y.atan2(x)).abs() < 1e-6, "{} {}", y, x);
            }
        }
    }

    #[test]
    fn angles_on_the_axes_are_exact() {
        for (y, x) in [(0.0, 0.0), (0.0, 2.0), (0.0, -2.0), (2.0, 0.0), (-2.0, 0.0), (-0.0, -1.0)] {
            assert_eq!(atan2(y, x), f32::atan2(y, x), "{y} {x}");
        }
    }

    #[test]
    fn echoes_are_seen_and_other_points_are_not() {
        let odd = [Point3::origin(), Point3::new(f32::NAN, 1.0, 0.0)];
        let points: Vec<_> =
            (0..20).flat_map(|i| [Point3::new(i as f32 - 9.5, 3.0, 1.0), odd[i % 2]]).collect();
        let seen = Seen::all(&points);
        assert!(seen.iter().map(|seen| seen.point).eq((0..20).map(|i| 2 * i)));
        for Seen { point, direction: [azimuth, elevation], range_m } in seen {
            let Point3 { coords: at } = points[point];
            let turned = [azimuth - PI, elevation - FRAC_PI_2];
            let expected = [at.y.atan2(at.x), at.z.atan2(at.x.hypot(at.y))];
            assert!(turned.iter().zip(expected).all(|(angle, is)| (angle - is).abs() < 1e-5));
            assert_eq!(range_m, at.norm());
        }
    }
}
