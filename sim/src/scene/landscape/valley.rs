//! A rocky valley: a dry bed of gravel between stepped slopes, with boulders at their feet.

use super::planting::Planting;
use crate::scene::material::Surface;
use crate::scene::parts::grove::wild_tree;
use crate::scene::parts::plants::{bush, tuft};
use crate::scene::parts::terrain::rock;
use crate::scene::parts::{Builder, Point, add};
use crate::scene::value_noise::{Noise, ramp};
use echoloop_random::Generator;

/// Half the width of the gravel bed and of the level floor, metres.
const BED_M: f64 = 7.0;
const FLOOR_M: f64 = 30.0;
/// Height of a step of the slopes, metres.
const STEP_M: f64 = 5.5;

struct Valley {
    hills: Noise,
    rough: Noise,
    crags: Noise,
    phase: f64,
}

impl Valley {
    /// Distance from the middle of the bed, which winds along y.
    fn away(&self, [x, y]: [f64; 2]) -> f64 {
        let bed = 22.0 * libm::sin(0.027 * y + self.phase) + 7.0 * libm::sin(0.071 * y);
        (x - bed).abs()
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        let away = self.away([x, y]);
        let up = (away - FLOOR_M - 7.0 * self.crags.at(x, y)).max(0.0);
        // Steps with a level foot and a steep face.
        let smooth = (0.42 * up + 2.8 * self.hills.at(x, y) * ramp(up, 0.0, 15.0)).max(0.0);
        let (step, part) = ((smooth / STEP_M).floor(), (smooth / STEP_M).fract());
        let slope = STEP_M * (step + ramp(part, 0.55, 0.95));
        let bed = -0.9 * (1.0 - ramp(away, BED_M - 2.5, BED_M + 1.5));
        let floor = 0.8 * self.hills.at(x, y) * ramp(away, BED_M, FLOOR_M);
        slope + bed + floor + (0.25 + 0.5 * ramp(up, 0.0, 20.0)) * self.rough.at(x, y)
    }

    fn point(&self, [x, y]: [f64; 2]) -> Point {
        [x, y, self.height(x, y)]
    }

    fn steepness(&self, x: f64, y: f64) -> f64 {
        let d = 0.8;
        let (dx, dy) = (
            self.height(x + d, y) - self.height(x - d, y),
            self.height(x, y + d) - self.height(x, y - d),
        );
        (dx * dx + dy * dy).sqrt() / (2.0 * d)
    }

    fn surface(&self, x: f64, y: f64) -> Surface {
        match (self.away([x, y]), self.steepness(x, y)) {
            (away, _) if away < BED_M => Surface::Gravel,
            (_, steep) if steep > 0.75 => Surface::Rock,
            _ => match self.crags.at(x + 400.0, y) {
                patch if patch > 0.3 => Surface::Gravel,
                patch if patch < -0.3 => Surface::Soil,
                _ => Surface::Grass,
            },
        }
    }
}

pub(super) fn build(b: &mut Builder, planting: &mut Planting, seed: u64, rng: &mut Generator) {
    let valley = Valley {
        hills: planting.noise(1, 40.0, 3),
        rough: planting.noise(2, 4.0, 4),
        crags: planting.noise(3, 26.0, 3),
        phase: 0.9 * seed as f64,
    };
    Planting::lay_ground(b, &|x, y| valley.height(x, y), |x, y| valley.surface(x, y));
    boulders(b, planting, &valley, rng);
    let is_soft =
        |at: [f64; 2]| valley.away(at) > BED_M + 2.0 && valley.steepness(at[0], at[1]) < 0.5;
    for at in planting.scatter(75, 4.0, rng, |at, _| is_soft(at)) {
        wild_tree(b, valley.point(at), [3.5, 10.0], 0.75, rng);
    }
    for at in planting.scatter(330, 2.0, rng, |at, _| is_soft(at)) {
        bush(b, valley.point(at), [rng.range(0.35, 1.2), rng.range(0.4, 1.4)], 220, rng);
    }
    for _ in 0..7000 {
        let at = Planting::random_spot(rng);
        if is_soft(at) {
            tuft(b, valley.point(at), rng.range(0.1, 0.4), 4, rng);
        }
    }
}

/// Places boulders: many at the foot of the slopes, some in the bed, small ones everywhere.
fn boulders(b: &mut Builder, planting: &mut Planting, valley: &Valley, rng: &mut Generator) {
    let at_foot = |at: [f64; 2], rng: &mut Generator| {
        let away = valley.away(at) - FLOOR_M;
        (-9.0..14.0).contains(&away) && rng.chance(0.8)
    };
    for at in planting.scatter(190, 3.2, rng, at_foot) {
        let size = rng.unit();
        let radius = 0.5 + 2.4 * size * size;
        rock(b, add(valley.point(at), [0.0, 0.0, 0.25 * radius]), radius, rng);
    }
    for at in planting.scatter(420, 1.6, rng, |_, _| true) {
        let size = rng.unit();
        let radius = 0.2 + 1.1 * size * size * size;
        rock(b, add(valley.point(at), [0.0, 0.0, 0.2 * radius]), radius, rng);
    }
}
