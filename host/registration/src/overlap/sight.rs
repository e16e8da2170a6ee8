//! Ranges that a sensor saw in each direction.

use echoloop_clouds::is_finite;
use nalgebra::Point3;

use super::cells::{Cells, direction};

/// Resolution at which the area seen is measured, and the coarsest of a [`Sight`], degrees.
const COARSE_DEG: f32 = 2.5;

/// The finest resolution, degrees.
const FINE_DEG: f32 = 0.5;

/// Cell over the mean spacing of the directions.
const CELL_SPACINGS: f32 = 1.5;

/// The ranges seen in each direction and around it, in cells that suit the spacing of the scan's
/// directions. Nothing is known of a direction in which nothing was seen: it may have been too
/// dark.
#[derive(Clone, Debug)]
pub(super) struct Sight {
    cells: Cells,
    /// Of each cell: nearest and farthest, m.
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
        let cells = Cells::within(step_rad(&seen));
        let mut sight = Self { cells, bounds_m: vec![None; cells.len()] };
        for (direction, range_m) in &seen {
            let at = cells.at(direction);
            sight.bounds_m[at] = merged(sight.bounds_m[at], Some([*range_m; 2]));
        }
        sight.bounds_m = (0..cells.len()).map(|at| sight.around_m(at)).collect();
        sight
    }

    /// Angle between directions beside each other, rad.
    pub(super) fn spacing_rad(&self) -> f32 {
        self.cells.step_rad / CELL_SPACINGS
    }

    /// The nearest and the farthest range seen around a point's direction, m.
    pub(super) fn bounds_m(&self, point: &Point3<f32>) -> Option<[f32; 2]> {
        self.bounds_m.get(self.cells.at(&direction(point))).copied().flatten()
    }

    /// Those of a cell, if it saw something itself, of the cells beside it, and of the nearest rows
    /// above and below in which something was seen; nothing at the edge of the field of view.
    fn around_m(&self, at: usize) -> Option<[f32; 2]> {
        self.bounds_m[at]?;
        let (row, column) = self.cells.place(at);
        let most = (COARSE_DEG.to_radians() / self.cells.step_rad).ceil() as usize;
        let above = (1..=most).find_map(|k| self.of_row(row + k, column));
        let below = (1..=most).find_map(|k| self.of_row(row.checked_sub(k)?, column));
        let rows = [self.of_row(row, column), Some(above?), Some(below?)];
        rows.into_iter().fold(None, merged)
    }

    /// Those of three cells of a row.
    fn of_row(&self, row: usize, column: usize) -> Option<[f32; 2]> {
        let cell = |at: usize| self.bounds_m.get(at).copied().flatten();
        self.cells.beside(row, column).into_iter().map(cell).fold(None, merged)
    }
}

fn merged(a: Option<[f32; 2]>, b: Option<[f32; 2]>) -> Option<[f32; 2]> {
    match (a, b) {
        (Some([a, b]), Some([c, d])) => Some([a.min(c), b.max(d)]),
        (one, other) => one.or(other),
    }
}

/// Angle of cells that hold about two points: from the solid angle seen, and the number of points.
fn step_rad(seen: &[([f32; 2], f32)]) -> f32 {
    let coarse = COARSE_DEG.to_radians();
    let cells = Cells::of_step(coarse);
    let mut is_seen = vec![false; cells.len()];
    for (direction, _) in seen {
        is_seen[cells.at(direction)] = true;
    }
    let area = |row: usize| ((row as f32 + 0.5) * coarse).sin() * coarse * coarse;
    let seen_sr: f32 =
        (0..cells.len()).filter(|at| is_seen[*at]).map(|at| area(cells.place(at).0)).sum();
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
