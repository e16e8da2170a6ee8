//! Range image: the distance that a sensor saw in each direction.

use nalgebra::Point3;

use super::cells::{Cells, Seen, direction};

/// The nearest range seen in each direction and the eight around it; nothing where no echo came
/// back, which is no proof of open space: it may have been too dark.
#[derive(Clone, Debug)]
pub(super) struct RangeImage {
    cells: Cells,
    /// Of each cell, m; infinite where nothing was seen.
    nearest_m: Vec<f32>,
}

impl RangeImage {
    /// The range image of a scan, with the sensor at the origin.
    pub(super) fn new(seen: &[Seen], step_deg: f32) -> Self {
        let cells = Cells::of_step(step_deg.to_radians());
        let mut image = Self { cells, nearest_m: vec![f32::INFINITY; cells.len()] };
        for Seen { direction, range_m, .. } in seen {
            let nearest_m = &mut image.nearest_m[cells.at(direction)];
            *nearest_m = nearest_m.min(*range_m);
        }
        image.nearest_m = (0..cells.len()).map(|at| image.around_m(at)).collect();
        image
    }

    /// The nearest range seen around a point's direction, m; none where nothing was seen.
    pub(super) fn nearest_m(&self, point: &Point3<f32>) -> Option<f32> {
        self.nearest_m
            .get(self.cells.at(&direction(point)))
            .copied()
            .filter(|range_m| range_m.is_finite())
    }

    /// The nearest of a direction and the eight around it; infinite where it saw nothing itself.
    fn around_m(&self, at: usize) -> f32 {
        if self.nearest_m[at].is_infinite() {
            return f32::INFINITY;
        }
        let (row, column) = self.cells.place(at);
        let rows = row.saturating_sub(1)..(row + 2).min(self.cells.rows);
        rows.flat_map(|row| self.cells.beside(row, column))
            .map(|at| self.nearest_m[at])
            .fold(f32::INFINITY, f32::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_knows_the_nearest_of_itself_and_its_neighbours() {
        let at = |deg: f32, range_m: f32| {
            Point3::new(range_m * deg.to_radians().cos(), range_m * deg.to_radians().sin(), 0.0)
        };
        // On both sides of where the azimuth begins anew.
        let image =
            RangeImage::new(&Seen::all(&[at(179.0, 9.0), at(-179.0, 7.0), at(0.0, 5.0)]), 2.5);
        assert_eq!(image.nearest_m(&at(179.0, 1.0)).map(f32::round), Some(7.0));
        assert_eq!(image.nearest_m(&at(0.3, 99.0)).map(f32::round), Some(5.0));
        assert_eq!(image.nearest_m(&at(90.0, 1.0)), None, "nothing came back from there");
    }

    #[test]
    fn points_without_a_direction_do_no_harm() {
        let odd = [Point3::origin(), Point3::new(f32::NAN, 0.0, 0.0), Point3::new(0.0, 0.0, -4.0)];
        let image = RangeImage::new(&Seen::all(&odd), 2.5);
        assert_eq!(image.nearest_m(&Point3::new(0.0, 0.0, -1.0)), Some(4.0));
        assert_eq!(image.nearest_m(&Point3::origin()), None);
    }
}
