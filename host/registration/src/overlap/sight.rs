//! Ranges that a sensor saw in each direction.

use nalgebra::Point3;

use super::RANGE_SDS;
use super::cells::{Cells, Seen, direction};

/// Resolution at which the area seen is measured, and the coarsest of a [`Sight`], degrees.
const COARSE_DEG: f32 = 2.5;

/// The finest resolution, degrees.
const FINE_DEG: f32 = 0.5;

/// Cell over the mean spacing of the directions.
const CELL_SPACINGS: f32 = 1.5;

/// Most points that others hide from the origin, as a share, in a scan: of 16 % among the leaves of
/// a wood to 40 % and more in a map of many scans.
const MOST_HIDDEN: f64 = 0.25;

/// A point is hidden if what was seen all around it is nearer by this share of its range …
const HIDDEN_SHARE: f32 = 0.01;

/// … and by this distance, over the unit.
const HIDDEN_UNITS: f32 = 0.15;

/// Number of points that are looked at for it.
const LOOKED_AT: usize = 2_000;

/// The ranges seen in each direction and around it, in cells that suit the spacing of the scan's
/// directions. Nothing is known of a direction in which nothing was seen: it may have been too
/// dark. Nor is anything known of any direction where no sensor was at the origin.
#[derive(Clone, Debug)]
pub(super) struct Sight {
    cells: Cells,
    /// Of each cell: nearest and farthest, m; [`UNSEEN`].
    bounds_m: Vec<[f32; 2]>,
    is_scan: bool,
}

/// Bounds of a cell in which nothing was seen.
const UNSEEN: [f32; 2] = [f32::INFINITY, f32::NEG_INFINITY];

impl Sight {
    /// The ranges that a sensor at the origin saw, if there was one, each within three of the
    /// standard deviations that it reports.
    pub(super) fn new(seen: &[Seen], sds_m: Option<&[f32]>, unit_m: f32) -> Self {
        let cells = Cells::within(step_rad(seen));
        let mut sight = Self { cells, bounds_m: vec![UNSEEN; cells.len()], is_scan: true };
        seen.iter().for_each(|seen| sight.see(&seen.direction, [seen.range_m; 2]));
        let stride = seen.len().div_ceil(LOOKED_AT).max(1);
        let looked_at = seen.iter().step_by(stride);
        let is_hidden = |seen: &&Seen| sight.is_hidden(&seen.direction, seen.range_m, unit_m);
        let hidden = looked_at.clone().filter(is_hidden).count();
        sight.is_scan = hidden as f64 <= MOST_HIDDEN * looked_at.count() as f64;
        // Only now: with their errors, points in front of each other would be hidden.
        if let Some(sds_m) = sds_m {
            for Seen { point, direction, range_m } in seen {
                let error_m = RANGE_SDS * sds_m.get(*point).copied().unwrap_or_default();
                sight.see(direction, [range_m - error_m, range_m + error_m]);
            }
        }
        sight.bounds_m = (0..cells.len()).map(|at| sight.around_m(at)).collect();
        sight
    }

    fn see(&mut self, direction: &[f32; 2], within_m: [f32; 2]) {
        let at = self.cells.at(direction);
        self.bounds_m[at] = merged(self.bounds_m[at], within_m);
    }

    /// True when the cloud is what a sensor at the origin sees: its points do not hide each other.
    pub(super) fn is_scan(&self) -> bool {
        self.is_scan
    }

    /// Angle between directions beside each other, rad.
    pub(super) fn spacing_rad(&self) -> f32 {
        self.cells.step_rad / CELL_SPACINGS
    }

    /// The nearest and the farthest range seen around a point's direction, m.
    pub(super) fn bounds_m(&self, point: &Point3<f32>) -> Option<[f32; 2]> {
        let bounds_m = || self.of_cell(self.cells.at(&direction(point)));
        self.is_scan.then(bounds_m).filter(is_seen)
    }

    /// True when something was seen nearer than a range in its own cell, in those beside it, and in
    /// the next rows above and below. Before the bounds of neighbours are merged.
    fn is_hidden(&self, direction: &[f32; 2], range_m: f32, unit_m: f32) -> bool {
        let least_m = range_m * (1.0 - HIDDEN_SHARE) - HIDDEN_UNITS * unit_m;
        let is_near = |[nearest_m, _]: [f32; 2]| nearest_m < least_m;
        let at = self.cells.at(direction);
        let (row, column) = self.cells.place(at);
        let [left, own, right] = self.cells.beside(row, column);
        [left, own, right].into_iter().all(|at| is_near(self.of_cell(at)))
            && is_near(self.above(row, column))
            && is_near(self.below(row, column))
    }

    /// Those of a cell, if it saw something itself, of the cells beside it, and of the nearest rows
    /// above and below in which something was seen; nothing at the edge of the field of view.
    fn around_m(&self, at: usize) -> [f32; 2] {
        if !is_seen(&self.bounds_m[at]) {
            return UNSEEN;
        }
        let (row, column) = self.cells.place(at);
        let (above, below) = (self.above(row, column), self.below(row, column));
        match is_seen(&above) && is_seen(&below) {
            true => merged(self.of_row(row, column), merged(above, below)),
            false => UNSEEN,
        }
    }

    /// Those of the nearest row above in which something was seen.
    fn above(&self, row: usize, column: usize) -> [f32; 2] {
        self.nearest_row((1..=self.most_rows()).map(|k| row + k), column)
    }

    /// Those of the nearest row below.
    fn below(&self, row: usize, column: usize) -> [f32; 2] {
        self.nearest_row((1..=self.most_rows().min(row)).map(|k| row - k), column)
    }

    /// Those of the first of some rows in which something was seen.
    fn nearest_row(&self, mut rows: impl Iterator<Item = usize>, column: usize) -> [f32; 2] {
        rows.find_map(|row| Some(self.of_row(row, column)).filter(is_seen)).unwrap_or(UNSEEN)
    }

    /// Number of rows within [`COARSE_DEG`].
    fn most_rows(&self) -> usize {
        (COARSE_DEG.to_radians() / self.cells.step_rad).ceil() as usize
    }

    /// Those of three cells of a row.
    fn of_row(&self, row: usize, column: usize) -> [f32; 2] {
        self.cells.beside(row, column).map(|at| self.of_cell(at)).into_iter().fold(UNSEEN, merged)
    }

    fn of_cell(&self, at: usize) -> [f32; 2] {
        self.bounds_m.get(at).copied().unwrap_or(UNSEEN)
    }
}

fn is_seen([nearest_m, farthest_m]: &[f32; 2]) -> bool {
    nearest_m <= farthest_m
}

fn merged(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Angle of cells that hold about two points: from the solid angle seen, and the number of points.
fn step_rad(seen: &[Seen]) -> f32 {
    let coarse = COARSE_DEG.to_radians();
    let cells = Cells::of_step(coarse);
    let mut is_seen = vec![false; cells.len()];
    for seen in seen {
        is_seen[cells.at(&seen.direction)] = true;
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

    fn seen(points: Vec<Point3<f32>>) -> Sight {
        Sight::new(&Seen::all(&points), None, 1.0)
    }

    #[test]
    fn an_imprecise_echo_opens_no_space_in_front_of_its_error() {
        let mut points = shell(10.0);
        points.push(Point3::new(4.0, 0.0, 0.0));
        let mut sds_m = vec![0.0; points.len()];
        sds_m[points.len() - 1] = 0.5;
        let sight = Sight::new(&Seen::all(&points), Some(&sds_m), 1.0);
        assert_eq!(sight.bounds_m(&Point3::new(1.0, 0.0, 0.0)), Some([2.5, 10.0]));
    }

    #[test]
    fn a_direction_knows_the_ranges_around_it() {
        let mut points = shell(10.0);
        points.push(Point3::new(4.0, 0.0, 0.0));
        let sight = seen(points);
        assert_eq!(sight.bounds_m(&Point3::new(1.0, 0.0, 0.0)), Some([4.0, 10.0]));
        let aside = Point3::new(1.0, 0.1, 0.0);
        assert!(sight.bounds_m(&aside).is_some_and(|[nearest_m, _]| nearest_m > 9.9));
        let degrees = sight.spacing_rad().to_degrees();
        assert!((0.9..1.3).contains(&degrees), "{degrees}");
    }

    #[test]
    fn points_behind_others_are_not_of_a_sensor_at_the_origin() {
        assert!(seen(shell(10.0)).is_scan());
        // A wall, and one twice as far away behind it.
        let both = seen([shell(10.0), shell(20.0)].concat());
        assert!(!both.is_scan());
        assert_eq!(both.bounds_m(&Point3::new(1.0, 0.0, 0.0)), None);
    }

    #[test]
    fn the_edge_of_the_view_and_what_is_beyond_know_nothing() {
        let sight = seen(shell(10.0));
        let at = |deg: f32| Point3::new(deg.to_radians().cos(), 0.0, deg.to_radians().sin());
        assert_eq!(sight.bounds_m(&at(10.0)), None, "nothing above bounds the last row");
        assert_eq!(sight.bounds_m(&at(45.0)), None);
        assert!(seen(Vec::new()).bounds_m(&at(0.0)).is_none());
    }
}
