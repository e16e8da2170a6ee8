//! The shore of a lake: water, a beach, reeds, trees behind it, and a jetty.

use super::planting::{HALF_M, Planting};
use crate::scene::material::Surface;
use crate::scene::parts::grove::{fallen_trunk, wild_tree};
use crate::scene::parts::plants::{bush, tuft};
use crate::scene::parts::terrain::rock;
use crate::scene::parts::{Builder, Frame, Point, add};
use crate::scene::value_noise::{Noise, ramp};
use echoloop_random::Generator;

/// Mean x of the shore, and its largest deviation, metres.
const SHORE_M: f64 = 45.0;
const SWING_M: f64 = 11.0;
/// Distance of viewpoints from the nearest possible shore, metres.
const DRY_M: f64 = 6.0;

struct Lake {
    hills: Noise,
    rough: Noise,
    woods: Noise,
    shore: Noise,
}

impl Lake {
    /// Approximate distance inland, metres; negative on the lake.
    fn inland(&self, [x, y]: [f64; 2]) -> f64 {
        SHORE_M + SWING_M * self.shore.at(0.0, y) - x
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        let inland = self.inland([x, y]);
        if inland < 0.0 {
            return (0.1 * inland).max(-6.0) - 0.02;
        }
        let beach = 0.07 * inland.min(14.0);
        let land = ramp(inland, 10.0, 45.0);
        beach
            + land * (3.0 + 4.5 * self.hills.at(x, y))
            + (0.04 + 0.35 * land) * self.rough.at(x, y)
    }

    fn point(&self, [x, y]: [f64; 2]) -> Point {
        [x, y, self.height(x, y)]
    }

    fn surface(&self, x: f64, y: f64) -> Surface {
        let patch = self.woods.at(x, y + 250.0);
        match self.inland([x, y]) {
            inland if inland < 9.0 + 4.0 * patch => Surface::Sand,
            _ if patch > 0.4 => Surface::Gravel,
            _ if patch < -0.35 => Surface::Soil,
            _ => Surface::Grass,
        }
    }
}

/// Builds the scene; returns the largest x of viewpoints, metres.
pub(super) fn build(
    b: &mut Builder,
    planting: &mut Planting,
    seed: u64,
    rng: &mut Generator,
) -> f64 {
    let lake = Lake {
        hills: planting.noise(1, 70.0, 3),
        rough: planting.noise(2, 5.0, 4),
        woods: planting.noise(3, 36.0, 2),
        shore: planting.noise(4 + seed % 2, 60.0, 2),
    };
    Planting::lay_ground(b, &|x, y| lake.height(x, y), |x, y| lake.surface(x, y));
    water(b);
    let is_wood = |at: [f64; 2]| lake.inland(at) > 12.0 && lake.woods.at(at[0], at[1]) > -0.05;
    for at in planting.scatter(190, 5.0, rng, |at, _| is_wood(at)) {
        wild_tree(b, lake.point(at), [5.0, 14.0], 0.25, rng);
    }
    for at in planting.scatter(260, 2.2, rng, |at, _| lake.inland(at) > 7.0) {
        bush(b, lake.point(at), [rng.range(0.5, 1.4), rng.range(0.6, 2.0)], 230, rng);
    }
    for at in planting.scatter(160, 1.5, rng, |at, _| lake.inland(at) > -3.0) {
        let size = rng.unit();
        let radius = 0.2 + 1.2 * size * size * size;
        rock(b, add(lake.point(at), [0.0, 0.0, 0.2 * radius]), radius, rng);
    }
    for at in planting.scatter(14, 6.0, rng, |at, _| (1.0..9.0).contains(&lake.inland(at))) {
        // Driftwood along the water.
        let end = [at[0] + rng.spread(1.5), at[1] + rng.range(2.5, 5.0)];
        fallen_trunk(b, [lake.point(at), lake.point(end)], rng.range(0.12, 0.25), rng);
    }
    for _ in 0..16_000 {
        let at = Planting::random_spot(rng);
        match lake.inland(at) {
            inland if (-5.0..1.5).contains(&inland) && lake.woods.at(at[1], at[0]) > -0.1 => {
                tuft(b, lake.point(at), rng.range(1.1, 2.0), 7, rng); // reeds
            }
            inland if inland > 10.0 => tuft(b, lake.point(at), rng.range(0.1, 0.45), 4, rng),
            _ => {}
        }
    }
    jetty(b, &lake, rng.spread(60.0));
    SHORE_M - SWING_M - DRY_M
}

/// Surface of the water; it also lies below the land, where it is hidden.
fn water(b: &mut Builder) {
    let (from, to, side) = (SHORE_M - SWING_M - 4.0, HALF_M + 80.0, HALF_M + 80.0);
    let (columns, rows) = (28, 60);
    let along =
        |t: usize, count: usize, low: f64, high: f64| low + (high - low) * t as f64 / count as f64;
    let point =
        |i: usize, j: usize| [along(i, columns, from, to), along(j, rows, -side, side), 0.0];
    b.sheet(columns, rows, point, |_, _| Surface::Water);
}

fn jetty(b: &mut Builder, lake: &Lake, y: f64) {
    let start = SHORE_M + SWING_M * lake.shore.at(0.0, y) - 2.0;
    let frame = Frame::new([start, y, 0.0], 0.0);
    b.cuboid(&frame, [0.0, -0.8, 0.45], [16.0, 0.8, 0.55], Surface::Wood);
    for k in 0..9 {
        for side in [-0.75, 0.75] {
            let at = |z: f64| frame.at([0.2 + 1.95 * f64::from(k), side, z]);
            b.tube((at(-2.5), 0.09), (at(0.9), 0.09), 8, Surface::Wood);
        }
    }
}
