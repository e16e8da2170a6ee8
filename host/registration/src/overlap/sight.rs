//! Ranges that a sensor saw in each direction.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use echoloop_clouds::is_finite;
use nalgebra::Point3;

/// Resolution at which the area seen is measured, and the coarsest of a [`Sight`], degrees.
const COARSE_DEG: f32 = 2.5;

/// The finest resolution, degrees.
const FINE_DEG: f32 = 0.5;

/// Cell over the mean spacing of the directions.
const CELL_SPACINGS: f32 = 1.5;

/// The ranges seen in each direction and the eight around it, in cells that suit the spacing of the
/// scan's directions. Nothing is known of a direction in which nothing was seen: it may have been
/// too dark.
#[derive(Clone, Debug)]
pub(super) struct Sight {
    columns: usize,
    rows: usize,
    step_rad: f32,
    /// Row after row from straight down: nearest and farthest, m.
    bounds_m: Vec<Option<[f32; 2]>>,
}

impl Sight {
    /// What a sensor at the origin saw.
    pub(super) fn new(points: &[Point3<f32>]) -> Self {
        let seen: Vec<([f32; 2], f32)> = points
            .iter()
            .filter(|p| is_finite(p))
            .map(|p| (direction(p), p.coords.norm()))
            .filter(|(_, range_m)| *range_m > 0.0)
            .collect();
        let step_rad = step_rad(&seen);
        let columns = (TAU / step_rad).ceil() as usize;
        let step_rad = TAU / columns as f32;
        let rows = (PI / step_rad).ceil() as usize;
        let mut sight = Self { columns, rows, step_rad, bounds_m: vec![None; columns * rows] };
        for (direction, range_m) in &seen {
            let at = sight.at(direction);
            sight.bounds_m[at] = merged(sight.bounds_m[at], Some([*range_m; 2]));
        }
        sight.bounds_m = (0..columns * rows).map(|at| sight.around_m(at)).collect();
        sight
    }

    /// Angle between directions beside each other, rad.
    pub(super) fn spacing_rad(&self) -> f32 {
        self.step_rad / CELL_SPACINGS
    }

    /// The nearest and the farthest range seen around a point's direction, m.
    pub(super) fn bounds_m(&self, point: &Point3<f32>) -> Option<[f32; 2]> {
        self.bounds_m.get(self.at(&direction(point))).copied().flatten()
    }

    /// Those of a cell, if it saw something itself, of the cells beside it, and of the nearest rows
    /// above and below in which something was seen; nothing at the edge of the field of view.
    fn around_m(&self, at: usize) -> Option<[f32; 2]> {
        self.bounds_m[at]?;
        let (row, column) = (at / self.columns, at % self.columns);
        let most = (COARSE_DEG.to_radians() / self.step_rad).ceil() as usize;
        let above = (1..=most).find_map(|k| self.of_row(row + k, column));
        let below = (1..=most).find_map(|k| self.of_row(row.checked_sub(k)?, column));
        let rows = [self.of_row(row, column), Some(above?), Some(below?)];
        rows.into_iter().fold(None, merged)
    }

    /// Those of three cells of a row; all the way round: the first column is beside the last.
    fn of_row(&self, row: usize, column: usize) -> Option<[f32; 2]> {
        let columns = [column + self.columns - 1, column, column + 1].map(|c| c % self.columns);
        let cell = |c: usize| self.bounds_m.get(row * self.columns + c).copied().flatten();
        columns.into_iter().map(cell).fold(None, merged)
    }

    fn at(&self, [azimuth, elevation]: &[f32; 2]) -> usize {
        let column = ((azimuth / self.step_rad) as usize).min(self.columns - 1);
        let row = ((elevation / self.step_rad) as usize).min(self.rows - 1);
        row * self.columns + column
    }
}

fn merged(a: Option<[f32; 2]>, b: Option<[f32; 2]>) -> Option<[f32; 2]> {
    match (a, b) {
        (Some([a, b]), Some([c, d])) => Some([a.min(c), b.max(d)]),
        (one, other) => one.or(other),
    }
}

/// Azimuth, from 0 to 2 π, and elevation above straight down, rad.
fn direction(point: &Point3<f32>) -> [f32; 2] {
    [point.y.atan2(point.x) + PI, point.z.atan2(point.x.hypot(point.y)) + FRAC_PI_2]
}

/// Cells that hold about two points: from the solid angle seen, and the number of points.
fn step_rad(seen: &[([f32; 2], f32)]) -> f32 {
    let coarse = COARSE_DEG.to_radians();
    let (columns, rows) = ((TAU / coarse).round() as usize, (PI / coarse).round() as usize);
    let mut cells = vec![false; columns * rows];
    for ([azimuth, elevation], _) in seen {
        let (column, row) = ((azimuth / coarse) as usize, (elevation / coarse) as usize);
        cells[row.min(rows - 1) * columns + column.min(columns - 1)] = true;
    }
    let area = |row: usize| ((row as f32 + 0.5) * coarse).sin() * coarse * coarse;
    let seen_sr: f32 =
        cells.iter().enumerate().filter(|(_, seen)| **seen).map(|(at, _)| area(at / columns)).sum();
    let spacing = (seen_sr / seen.len().max(1) as f32).sqrt();
    (CELL_SPACINGS * spacing).clamp(FINE_DEG.to_radians(), coarse)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of which each point is at the same range, 20° high and 20° wide, a degree apart.
    fn shell(range_m: f32) -> Vec<Point3<f32>> {
        let at = |i: i32| {
            let (azimuth, elevation) = ((i % 21 - 10) as f32, (i / 21 - 10) as f32);
            let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
            let (across, up) = (elevation.cos(), elevation.sin());
            Point3::new(azimuth.cos() * across, azimuth.sin() * across, up) * range_m
        };
        (0..21 * 21).map(at).collect()
    }

    #[test]
    fn a_direction_knows_the_ranges_around_it() {
        let mut points = shell(10.0);
        points.push(Point3::new(4.0, 0.0, 0.0));
        let sight = Sight::new(&points);
        assert_eq!(sight.bounds_m(&Point3::new(1.0, 0.0, 0.0)), Some([4.0, 10.0]));
        let aside = Point3::new(1.0, 0.1, 0.0);
        assert!(sight.bounds_m(&aside).is_some_and(|[nearest_m, _]| nearest_m > 9.9));
        let degrees = sight.spacing_rad().to_degrees();
        assert!((0.9..1.3).contains(&degrees), "{degrees}");
    }

    #[test]
    fn the_edge_of_the_view_and_what_is_beyond_know_nothing() {
        let sight = Sight::new(&shell(10.0));
        let at = |deg: f32| Point3::new(deg.to_radians().cos(), 0.0, deg.to_radians().sin());
        assert_eq!(sight.bounds_m(&at(10.0)), None, "nothing above bounds the last row");
        assert_eq!(sight.bounds_m(&at(45.0)), None);
        assert!(Sight::new(&[]).bounds_m(&at(0.0)).is_none());
    }
}
