//! Objects along one side of a street: parked cars, lamps, trees, signs, benches.

use std::f64::consts::{FRAC_PI_2, PI};

use super::street_grid::{GroundKind, HALF_M, Street, StreetGrid};
use crate::scene::parts::dwelling::street_tree;
use crate::scene::parts::street::{bench, bin, bollard, lamp, sign};
use crate::scene::parts::vehicle::car;
use crate::scene::parts::{Builder, Frame};
use echoloop_random::Generator;

/// One side of a street.
pub(super) struct Kerb<'a> {
    grid: &'a StreetGrid,
    street: &'a Street,
    /// Axis of the coordinate across the street: 0 for a street along y, 1 for one along x.
    axis: usize,
    /// Side, −1 or 1.
    side: f64,
}

impl<'a> Kerb<'a> {
    pub(super) fn new(grid: &'a StreetGrid, axis: usize, street: &'a Street, side: f64) -> Self {
        Self { grid, street, axis, side }
    }

    /// Frame on the ground, if the ground there is of the wanted kind.
    fn stand(&self, along: f64, across: f64, yaw: f64, wanted: GroundKind) -> Option<Frame> {
        let offset = self.street.centre + self.side * across;
        let [x, y] = if self.axis == 0 { [offset, along] } else { [along, offset] };
        (self.grid.kind(x, y) == wanted).then(|| Frame::new(self.grid.point(x, y), yaw))
    }

    /// Direction from this kerb to the carriageway, radians.
    fn inward(&self) -> f64 {
        match (self.axis, self.side > 0.0) {
            (0, true) => PI,
            (0, false) => 0.0,
            _ => -self.side * FRAC_PI_2,
        }
    }

    /// Parks cars along the kerb, none near a crossing.
    pub(super) fn park(&self, b: &mut Builder, rng: &mut Generator) {
        let walk = self.street.road + 0.55;
        let mut along = -HALF_M + 3.0 + rng.range(0.0, 4.0);
        while along < HALF_M - 3.0 {
            let is_walk = |d: f64| self.stand(along + d, walk, 0.0, GroundKind::Walk).is_some();
            if is_walk(-6.0) && is_walk(6.0) && rng.chance(0.6) {
                let yaw = self.inward() + FRAC_PI_2 + rng.spread(0.03);
                let spot = self.stand(along, self.street.road - 1.1, yaw, GroundKind::Road);
                spot.iter().for_each(|at| car(b, at, rng));
            }
            along += rng.range(5.8, 7.2);
        }
    }

    /// Places a lamp every 28 m; between lamps trees, signs and bollards at the kerb, bins and
    /// benches at the wall.
    pub(super) fn furnish(&self, b: &mut Builder, rng: &mut Generator) {
        let (kerb, wall) = (self.street.road + 0.55, self.street.front - 0.7);
        for k in 0..(2.0 * HALF_M / 7.0) as usize {
            let along = -HALF_M + 7.0 * (k as f64 + 0.5) + rng.spread(0.8);
            let Some(at) = self.stand(along, kerb, self.inward(), GroundKind::Walk) else {
                continue;
            };
            let by_wall = self.stand(along, wall, self.inward() + FRAC_PI_2, GroundKind::Walk);
            match (k % 4, rng.index(8)) {
                (0, _) => lamp(b, &at, 6.5 + rng.unit()),
                (1 | 3, 0..=3) => street_tree(b, at.at([0.0; 3]), rng),
                (1 | 3, 4) => sign(b, &at.child([0.0; 3], FRAC_PI_2)),
                (2, 0 | 1) => by_wall.iter().for_each(|at| bin(b, at)),
                (2, 2 | 3) => by_wall.iter().for_each(|at| bench(b, at)),
                (2, 4 | 5) => bollard(b, &at),
                _ => {}
            }
        }
    }
}
