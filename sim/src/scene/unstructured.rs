//! Open country: rough terrain with trees, bushes and rocks; no walls.

use super::material::Surface;
use super::mesh::Mesh;
use super::parts::plants::{Broadleaf, bush, conifer, tuft};
use super::parts::terrain::{ground, rock};
use super::parts::{Builder, Point, add, unit};
use super::random::{Dice, Noise};

/// Half the side of the patch, metres.
const HALF_M: f64 = 85.0;
/// Viewpoints keep this far from its edge, metres.
const RIM_M: f64 = 20.0;

struct Country {
    hills: Noise,
    rough: Noise,
    /// Where the woods are: trees stand where this is high.
    woods: Noise,
    relief_m: f64,
    conifers: f64,
}

pub(crate) fn generate(seed: u64) -> (Mesh, f32) {
    let mut dice = Dice::new(seed, 3);
    let country = Country::new(seed, &mut dice);
    let mut b = Builder::default();
    let height = |x: f64, y: f64| country.height(x, y);
    ground(&mut b, HALF_M, 0.85, 80.0, &height, |x, y| country.surface(x, y));
    country.trees(&mut b, &mut dice);
    country.fallen(&mut b, &mut dice);
    country.scatter(&mut b, &mut dice);
    (b.finish(), (HALF_M - RIM_M) as f32)
}

impl Country {
    fn new(seed: u64, dice: &mut Dice) -> Self {
        let noise = |stream: u64, scale_m: f64, octaves: u32| Noise {
            seed: seed.wrapping_mul(31).wrapping_add(stream),
            scale_m,
            octaves,
        };
        Self {
            hills: noise(1, 55.0, 3),
            rough: noise(2, 5.0, 4),
            woods: noise(3, 30.0, 2),
            relief_m: dice.range(5.0, 9.0),
            conifers: dice.range(0.2, 0.7),
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

    fn trees(&self, b: &mut Builder, dice: &mut Dice) {
        let mut feet: Vec<[f64; 2]> = Vec::new();
        for _ in 0..2500 {
            if feet.len() == 105 {
                break;
            }
            let p = [dice.spread(HALF_M), dice.spread(HALF_M)];
            let apart =
                |q: &[f64; 2]| (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) > 20.0;
            if self.woods.at(p[0], p[1]) + dice.spread(0.35) < 0.05 || !feet.iter().all(apart) {
                continue;
            }
            feet.push(p);
            self.tree(b, self.point(p[0], p[1]), dice);
        }
    }

    fn tree(&self, b: &mut Builder, foot: Point, dice: &mut Dice) {
        let height_m = dice.range(5.0, 13.0);
        if dice.chance(self.conifers) {
            return conifer(b, foot, height_m, dice);
        }
        let tree = Broadleaf {
            height_m,
            clear_m: dice.range(0.15, 0.35) * height_m,
            spread_m: dice.range(0.28, 0.4) * height_m,
            leaves: 420 + (55.0 * height_m) as usize,
        };
        tree.build(b, foot, dice);
    }

    /// Stumps and trunks that lie on the ground.
    fn fallen(&self, b: &mut Builder, dice: &mut Dice) {
        for _ in 0..25 {
            let foot = self.point(dice.spread(HALF_M), dice.spread(HALF_M));
            let radius = dice.range(0.12, 0.3);
            if dice.chance(0.5) {
                let top = add(foot, [dice.spread(0.1), dice.spread(0.1), dice.range(0.3, 1.2)]);
                b.tube(add(foot, [0.0, 0.0, -0.3]), 1.4 * radius, top, radius, 12, Surface::Bark);
                continue;
            }
            let turn = dice.turn();
            let length = dice.range(3.0, 8.0);
            let end =
                self.point(foot[0] + length * libm::cos(turn), foot[1] + length * libm::sin(turn));
            let lift = [0.0, 0.0, radius];
            b.tube(add(foot, lift), radius, add(end, lift), 0.6 * radius, 12, Surface::Bark);
            for k in 1..6 {
                let t = f64::from(k) / 6.0;
                let at: Point = std::array::from_fn(|i| foot[i] + t * (end[i] - foot[i]) + lift[i]);
                let up = dice.direction();
                let twig = unit([up[0], up[1], up[2].abs() + 0.2]);
                b.tube(
                    at,
                    0.05,
                    add(at, twig.map(|x| x * dice.range(0.4, 1.2))),
                    0.02,
                    5,
                    Surface::Bark,
                );
            }
        }
    }

    fn scatter(&self, b: &mut Builder, dice: &mut Dice) {
        let spot = |dice: &mut Dice| self.point(dice.spread(HALF_M), dice.spread(HALF_M));
        for _ in 0..150 {
            let foot = spot(dice);
            bush(b, foot, dice.range(0.4, 1.3), dice.range(0.5, 1.9), 260, dice);
        }
        for _ in 0..130 {
            // Many small ones, few boulders.
            let size = dice.unit();
            let radius = 0.2 + 1.6 * size * size * size;
            rock(b, add(spot(dice), [0.0, 0.0, 0.25 * radius]), radius, dice);
        }
        for _ in 0..6000 {
            let foot = spot(dice);
            tuft(b, foot, dice.range(0.1, 0.45), 4, dice);
        }
    }
}
