//! A forest on hills: dense woods with a floor of litter, clearings, and a winding track.

use super::planting::Planting;
use crate::scene::material::Surface;
use crate::scene::parts::grove::{fallen_trunk, stump, wild_tree};
use crate::scene::parts::plants::{bush, tuft};
use crate::scene::parts::terrain::rock;
use crate::scene::parts::{Builder, Point, add};
use crate::scene::value_noise::{Noise, ramp};
use echoloop_random::Generator;

/// Half the width of the track, metres.
const TRACK_M: f64 = 2.2;

struct Forest {
    hills: Noise,
    rough: Noise,
    woods: Noise,
    phase: f64,
}

impl Forest {
    fn track_y(&self, x: f64) -> f64 {
        24.0 * libm::sin(0.031 * x + self.phase) + 9.0 * libm::sin(0.083 * x - self.phase)
    }

    fn off_track(&self, [x, y]: [f64; 2]) -> f64 {
        (y - self.track_y(x)).abs()
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        // The track is smooth.
        let rough = ramp(self.off_track([x, y]), 1.5, 5.0);
        9.0 * self.hills.at(x, y) + 0.45 * (0.15 + 0.85 * rough) * self.rough.at(x, y)
    }

    fn point(&self, [x, y]: [f64; 2]) -> Point {
        [x, y, self.height(x, y)]
    }

    fn is_wood(&self, at: [f64; 2]) -> bool {
        self.woods.at(at[0], at[1]) > 0.02 && self.off_track(at) > TRACK_M + 1.5
    }

    fn surface(&self, x: f64, y: f64) -> Surface {
        let (track, patch) = (self.off_track([x, y]), self.woods.at(x, y + 300.0));
        match self.is_wood([x, y]) {
            _ if track < TRACK_M => Surface::Soil,
            true if patch > 0.45 => Surface::Grass,
            true => Surface::Litter,
            false => Surface::Grass,
        }
    }
}

pub(super) fn build(b: &mut Builder, planting: &mut Planting, seed: u64, rng: &mut Generator) {
    let forest = Forest {
        hills: planting.noise(1, 95.0, 3),
        rough: planting.noise(2, 5.0, 4),
        woods: planting.noise(3, 48.0, 2),
        phase: 0.7 * seed as f64,
    };
    Planting::lay_ground(b, &|x, y| forest.height(x, y), |x, y| forest.surface(x, y));
    for at in planting.scatter(270, 4.2, rng, |at, _| forest.is_wood(at)) {
        wild_tree(b, forest.point(at), [8.0, 17.0], 0.55, rng);
    }
    for at in planting.scatter(70, 2.5, rng, |at, _| forest.is_wood(at)) {
        // Young trees.
        wild_tree(b, forest.point(at), [2.0, 4.5], 0.7, rng);
    }
    for at in planting.scatter(60, 3.0, rng, |at, _| forest.off_track(at) > TRACK_M + 1.0) {
        let (foot, radius) = (forest.point(at), rng.range(0.14, 0.35));
        let (turn, length) = (rng.turn(), rng.range(4.0, 10.0));
        let end = [at[0] + length * libm::cos(turn), at[1] + length * libm::sin(turn)];
        if rng.chance(0.45) || forest.off_track(end) < TRACK_M {
            stump(b, foot, radius, rng);
        } else {
            fallen_trunk(b, [foot, forest.point(end)], radius, rng);
        }
    }
    for at in planting.scatter(260, 2.0, rng, |at, _| forest.off_track(at) > TRACK_M + 0.8) {
        bush(b, forest.point(at), [rng.range(0.4, 1.2), rng.range(0.4, 1.6)], 230, rng);
    }
    for at in planting.scatter(120, 1.5, rng, |at, _| forest.off_track(at) > TRACK_M + 0.3) {
        let radius = 0.2 + 0.8 * rng.unit() * rng.unit();
        rock(b, add(forest.point(at), [0.0, 0.0, 0.2 * radius]), radius, rng);
    }
    for _ in 0..9000 {
        let at = Planting::random_spot(rng);
        if forest.off_track(at) > TRACK_M {
            tuft(b, forest.point(at), rng.range(0.1, 0.5), 4, rng);
        }
    }
}
