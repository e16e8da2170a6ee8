//! A town: a grid of streets between blocks of terraced houses.

mod kerb;
mod street_grid;

use super::mesh::Mesh;
use super::parts::Builder;
use echoloop_random::Generator;
use kerb::Kerb;
use street_grid::{HALF_M, StreetGrid};

/// Distance of viewpoints from the edge, metres.
const RIM_M: f64 = 10.0;

pub(crate) fn generate(seed: u64) -> (Mesh, f32) {
    let mut rng = Generator::new(seed, 1);
    let grid = StreetGrid::new(seed, &mut rng);
    let mut b = Builder::default();
    grid.ground(&mut b);
    grid.blocks(&mut b, &mut rng);
    for axis in [0, 1] {
        for street in &grid.streets[axis] {
            for side in [-1.0, 1.0] {
                let kerb = Kerb::new(&grid, axis, street, side);
                kerb.park(&mut b, &mut rng);
                kerb.furnish(&mut b, &mut rng);
            }
        }
    }
    (b.mesh, (HALF_M - RIM_M) as f32)
}
