//! Trees of the wild, stumps and fallen trunks.

use super::plants::{Broadleaf, conifer};
use super::{Builder, Point, Surface, add, unit};
use crate::vector::mix;
use echoloop_random::Generator;

/// Tree with a height between two, metres; a share of them are conifers.
pub(crate) fn wild_tree(
    b: &mut Builder,
    foot: Point,
    heights_m: [f64; 2],
    conifers: f64,
    rng: &mut Generator,
) {
    let height_m = rng.range(heights_m[0], heights_m[1]);
    if rng.chance(conifers) {
        return conifer(b, foot, height_m, rng);
    }
    let tree = Broadleaf {
        height_m,
        clear_m: rng.range(0.15, 0.35) * height_m,
        spread_m: rng.range(0.28, 0.4) * height_m,
        leaves: 420 + (55.0 * height_m) as usize,
    };
    tree.build(b, foot, rng);
}

/// Tree stump.
pub(crate) fn stump(b: &mut Builder, foot: Point, radius: f64, rng: &mut Generator) {
    let top = add(foot, [rng.spread(0.1), rng.spread(0.1), rng.range(0.3, 1.2)]);
    b.tube((add(foot, [0.0, 0.0, -0.3]), 1.4 * radius), (top, radius), 12, Surface::Bark);
}

/// Fallen trunk between two points on the ground, with stubs of branches.
pub(crate) fn fallen_trunk(
    b: &mut Builder,
    [foot, end]: [Point; 2],
    radius: f64,
    rng: &mut Generator,
) {
    let lift = [0.0, 0.0, radius];
    b.tube((add(foot, lift), radius), (add(end, lift), 0.6 * radius), 12, Surface::Bark);
    for k in 1..6 {
        let t = f64::from(k) / 6.0;
        let at = add(mix(foot, end, t), lift);
        let up = rng.direction();
        let twig = unit([up[0], up[1], up[2].abs() + 0.2]);
        let tip = add(at, twig.map(|x| x * rng.range(0.4, 1.2)));
        b.tube((at, 0.05), (tip, 0.02), 5, Surface::Bark);
    }
}
