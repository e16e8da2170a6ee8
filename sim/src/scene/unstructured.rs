//! Open country: rough terrain with trees, bushes and rocks; no walls.

use super::material::Surface;
use super::mesh::Mesh;
use super::parts::grove::{fallen_trunk, stump, wild_tree};
use super::parts::plants::{bush, tuft};
use super::parts::terrain::{ground, rock};
use super::parts::{Builder, Point, add};
use super::value_noise::Noise;
use echoloop_random::Generator;

/// Half the side of the patch, metres.
const HALF_M: f64 = 85.0;
/// Distance of viewpoints from the edge, metres.
const RIM_M: f64 = 20.0;

struct Country {
    hills: Noise,
    rough: Noise,
    /// Density of the woods: trees stand where it is high.
    woods: Noise,
    relief_m: f64,
    conifers: f64,
}

pub(crate) fn generate(seed: u64) -> (Mesh, f32) {
    let mut rng = Generator::new(seed, 3);
    let country = Country::new(seed, &mut rng);
    let mut b = Builder::default();
    let height = |x: f64, y: f64| country.height(x, y);
    ground(&mut b, HALF_M, 0.85, 80.0, &height, |x, y| country.surface(x, y));
    country.trees(&mut b, &mut rng);
    country.fallen(&mut b, &mut rng);
    country.scatter(&mut b, &mut rng);
    (b.mesh, (HALF_M - RIM_M) as f32)
}

impl Country {
    fn new(seed: u64, rng: &mut Generator) -> Self {
        let noise = |stream: u64, scale_m: f64, octaves: u32| Noise {
            seed: seed.wrapping_mul(31).wrapping_add(stream),
            scale_m,
            octaves,
        };
        Self {
            hills: noise(1, 55.0, 3),
            rough: noise(2, 5.0, 4),
            woods: noise(3, 30.0, 2),
            relief_m: rng.range(5.0, 9.0),
            conifers: rng.range(0.2, 0.7),
        }
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        self.relief_m * self.hills.at(x, y) + 0.4 * self.rough.at(x, y)
    }

    fn point(&self, x: f64, y: f64) -> Point {
        [x, y, self.height(x, y)]
    }

    fn surface(&self, x: f64, y: f64) -> Surface {
        match self.rough.at(x + 500.0, y) {
            n if n > 0.35 => Surface::Gravel,
            n if n < -0.15 => Surface::Soil,
            _ => Surface::Grass,
        }
    }

    fn trees(&self, b: &mut Builder, rng: &mut Generator) {
        let mut feet: Vec<[f64; 2]> = Vec::new();
        for _ in 0..2500 {
            if feet.len() == 105 {
                break;
            }
            let p = [rng.spread(HALF_M), rng.spread(HALF_M)];
            let apart =
                |q: &[f64; 2]| (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) > 20.0;
            if self.woods.at(p[0], p[1]) + rng.spread(0.35) < 0.05 || !feet.iter().all(apart) {
                continue;
            }
            feet.push(p);
            wild_tree(b, self.point(p[0], p[1]), [5.0, 13.0], self.conifers, rng);
        }
    }

    /// Places stumps and fallen trunks.
    fn fallen(&self, b: &mut Builder, rng: &mut Generator) {
        for _ in 0..25 {
            let foot = self.point(rng.spread(HALF_M), rng.spread(HALF_M));
            let radius = rng.range(0.12, 0.3);
            if rng.chance(0.5) {
                stump(b, foot, radius, rng);
                continue;
            }
            let turn = rng.turn();
            let length = rng.range(3.0, 8.0);
            let end =
                self.point(foot[0] + length * libm::cos(turn), foot[1] + length * libm::sin(turn));
            fallen_trunk(b, [foot, end], radius, rng);
        }
    }

    fn scatter(&self, b: &mut Builder, rng: &mut Generator) {
        let spot = |rng: &mut Generator| self.point(rng.spread(HALF_M), rng.spread(HALF_M));
        for _ in 0..150 {
            let foot = spot(rng);
            bush(b, foot, [rng.range(0.4, 1.3), rng.range(0.5, 1.9)], 260, rng);
        }
        for _ in 0..130 {
            // Many small rocks, few boulders.
            let size = rng.unit();
            let radius = 0.2 + 1.6 * size * size * size;
            rock(b, add(spot(rng), [0.0, 0.0, 0.25 * radius]), radius, rng);
        }
        for _ in 0..6000 {
            let foot = spot(rng);
            tuft(b, foot, rng.range(0.1, 0.45), 4, rng);
        }
    }
}
