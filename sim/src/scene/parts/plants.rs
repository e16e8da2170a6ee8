//! Trees, bushes, hedges, grass: wood as tubes, foliage as single leaves.

use super::{Builder, Frame, Point, Surface, add, cross, scale, square_to, sub, unit};
use echoloop_random::Generator;

/// A broad-leaved tree; lengths in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Broadleaf {
    pub(crate) height_m: f64,
    /// Height of the first branches.
    pub(crate) clear_m: f64,
    pub(crate) spread_m: f64,
    pub(crate) leaves: usize,
}

impl Broadleaf {
    pub(crate) fn build(&self, b: &mut Builder, foot: Point, rng: &mut Generator) {
        let radius = 0.022 * self.height_m + 0.03;
        let fork = self.trunk(b, foot, radius, rng);
        let mut tips = Vec::new();
        let crown = self.height_m - self.clear_m;
        let top = add(fork, [rng.spread(0.1) * crown, rng.spread(0.1) * crown, 0.8 * crown]);
        b.branch((fork, 0.7 * radius), (top, 0.15 * radius), 6, Surface::Bark);
        tips.push((top, 0.2 * crown));
        let limbs = 7 + rng.index(3);
        for limb in 0..limbs {
            let up = (limb as f64 + 0.8 * rng.unit()) / limbs as f64;
            // Successive limbs are a golden angle apart, as on a real stem.
            let turn = 2.4 * limb as f64 + rng.spread(0.4);
            let from = add(scale(fork, 1.0 - 0.9 * up), scale(top, 0.9 * up));
            let out = unit([libm::cos(turn), libm::sin(turn), 0.35 + 0.5 * rng.unit()]);
            let length = self.spread_m * (1.0 - 0.55 * up) * rng.range(0.7, 1.0);
            let limb = Limb { from, out, length, radius: (0.5 - 0.3 * up) * radius, level: 2 };
            limb.grow(b, &mut tips, rng);
        }
        self.foliage(b, &tips, rng);
    }

    /// Builds the stem, slightly bent, with a root flare; returns the base of the crown.
    fn trunk(&self, b: &mut Builder, foot: Point, radius: f64, rng: &mut Generator) -> Point {
        let lean = [rng.spread(0.05), rng.spread(0.05)];
        let mut from = add(foot, [0.0, 0.0, -0.3]);
        let mut wide = 1.6 * radius;
        for k in 1..=4 {
            let z = self.clear_m * f64::from(k) / 4.0;
            let to = add(foot, [lean[0] * z + rng.spread(0.04), lean[1] * z + rng.spread(0.04), z]);
            let narrow = radius * (1.1 - 0.1 * f64::from(k));
            b.branch((from, wide), (to, narrow), 10, Surface::Bark);
            (from, wide) = (to, narrow);
        }
        from
    }

    fn foliage(&self, b: &mut Builder, tips: &[(Point, f64)], rng: &mut Generator) {
        for _ in 0..self.leaves {
            let (centre, reach) = rng.pick(tips);
            let reach = reach.clamp(0.45, 1.0);
            let at = add(centre, scale(rng.direction(), reach * rng.unit()));
            leaf(b, at, rng.range(0.2, 0.4), rng);
        }
    }
}

/// Branch with the twigs that grow from it.
struct Limb {
    from: Point,
    /// Direction, unit.
    out: Point,
    length: f64,
    radius: f64,
    /// Generations still to come.
    level: u32,
}

impl Limb {
    /// Builds the branch; adds to `tips` the places of leaves and their spread.
    fn grow(&self, b: &mut Builder, tips: &mut Vec<(Point, f64)>, rng: &mut Generator) {
        let (length, radius) = (self.length, self.radius);
        let bend = unit(add(self.out, scale(rng.direction(), 0.25)));
        let middle = add(self.from, scale(self.out, 0.5 * length));
        let to = add(middle, scale(bend, 0.5 * length));
        tips.push((to, 0.35 * length));
        if self.level == 0 {
            b.branch((self.from, radius), (to, 0.35 * radius), 4, Surface::Bark);
            return;
        }
        b.branch((self.from, radius), (middle, 0.7 * radius), 6, Surface::Bark);
        b.branch((middle, 0.7 * radius), (to, 0.35 * radius), 6, Surface::Bark);
        tips.push((middle, 0.25 * length));
        for _ in 0..3 {
            let twig = Self {
                from: if rng.chance(0.5) { middle } else { to },
                out: unit(add(bend, scale(rng.direction(), 0.9))),
                length: length * rng.range(0.35, 0.55),
                radius: 0.45 * radius,
                level: self.level - 1,
            };
            twig.grow(b, tips, rng);
        }
    }
}

fn leaf(b: &mut Builder, at: Point, length_m: f64, rng: &mut Generator) {
    let (along, normal) = (rng.direction(), rng.direction());
    b.leaf(at, along, normal, length_m, Surface::Leaf);
}

/// Conifer: straight stem, whorls of drooping boughs.
pub(crate) fn conifer(b: &mut Builder, foot: Point, height_m: f64, rng: &mut Generator) {
    let radius = 0.018 * height_m + 0.03;
    let top = add(foot, [rng.spread(0.2), rng.spread(0.2), height_m]);
    let stem = |t: f64| add(scale(foot, 1.0 - t), scale(top, t));
    b.branch(
        (add(foot, [0.0, 0.0, -0.3]), 1.3 * radius),
        (stem(0.3), 0.8 * radius),
        10,
        Surface::Bark,
    );
    b.branch((stem(0.3), 0.8 * radius), (top, 0.1 * radius), 8, Surface::Bark);
    let bare = rng.range(0.08, 0.25);
    let whorls = (height_m * 2.0) as usize;
    for whorl in 0..whorls {
        let t = bare + (0.98 - bare) * whorl as f64 / whorls as f64;
        let reach = (0.24 * height_m * (1.0 - t) / (1.0 - bare)).clamp(0.15, 3.5);
        for k in 0..6 {
            let turn = std::f64::consts::TAU * (f64::from(k) + rng.spread(0.4)) / 6.0;
            let out = unit([libm::cos(turn), libm::sin(turn), -0.25 + 0.4 * t + rng.spread(0.1)]);
            bough(b, stem(t), out, reach * rng.range(0.75, 1.1), rng);
        }
    }
}

/// Bough with twigs of needles on both sides.
fn bough(b: &mut Builder, from: Point, out: Point, length: f64, rng: &mut Generator) {
    let to = add(from, scale(out, length));
    b.branch((from, 0.03), (to, 0.008), 3, Surface::Bark);
    let side = unit(cross(out, [0.0, 0.0, 1.0]));
    let twigs = (length * 6.0) as usize + 2;
    for k in 0..twigs {
        let t = (k as f64 + rng.unit()) / twigs as f64;
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let along = unit(add(scale(side, sign), add(scale(out, 0.8), [0.0, 0.0, rng.spread(0.4)])));
        let length_m = 0.45 * (1.2 - t) * length.min(1.2) + 0.15;
        let centre = add(add(from, scale(out, t * length)), scale(along, 0.4 * length_m));
        let normal = add([0.0, 0.0, 1.0], scale(rng.direction(), 0.5));
        b.leaf(centre, along, normal, length_m, Surface::Leaf);
    }
}

/// Bush of a radius and a height: a few stems in an ellipsoid of leaves.
pub(crate) fn bush(
    b: &mut Builder,
    foot: Point,
    [radius_m, height_m]: [f64; 2],
    leaves: usize,
    rng: &mut Generator,
) {
    for _ in 0..5 {
        let lean = rng.direction();
        let tip = add(foot, [0.7 * radius_m * lean[0], 0.7 * radius_m * lean[1], 0.8 * height_m]);
        b.branch((add(foot, [0.0, 0.0, -0.1]), 0.03), (tip, 0.01), 5, Surface::Bark);
    }
    for _ in 0..leaves {
        let d = rng.direction();
        let shell = 0.55 + 0.45 * rng.unit().sqrt();
        let lumpy = shell * (0.85 + 0.15 * libm::sin(5.0 * d[0] + 3.0 * d[1] + 4.0 * d[2]));
        let z = 0.5 * height_m * (1.0 + lumpy * d[2]);
        leaf(
            b,
            add(foot, [radius_m * lumpy * d[0], radius_m * lumpy * d[1], z]),
            rng.range(0.1, 0.2),
            rng,
        );
    }
}

/// Clipped hedge along the x axis of the frame: a dark core behind a skin of leaves.
pub(crate) fn hedge(
    b: &mut Builder,
    frame: &Frame,
    length_m: f64,
    size: [f64; 2],
    rng: &mut Generator,
) {
    let [thick, height] = size;
    let core = [0.5 * thick - 0.14, height - 0.14];
    b.cuboid(frame, [0.0, -core[0], -0.5], [length_m, core[0], core[1]], Surface::Leaf);
    let leaves = (length_m * (2.0 * height + thick) * 23.0) as usize;
    for _ in 0..leaves {
        let x = rng.range(0.0, length_m);
        let turn = rng.range(0.0, 2.0 * height + thick);
        let bulge = rng.range(-0.1, 0.06);
        let (y, z) = if turn < height {
            (-0.5 * thick - bulge, turn)
        } else if turn < height + thick {
            (turn - height - 0.5 * thick, height + bulge)
        } else {
            (0.5 * thick + bulge, turn - height - thick)
        };
        leaf(b, frame.at([x, y, z]), rng.range(0.1, 0.17), rng);
    }
}

/// Tuft of grass: a few upright blades.
pub(crate) fn tuft(
    b: &mut Builder,
    foot: Point,
    height_m: f64,
    blades: usize,
    rng: &mut Generator,
) {
    for _ in 0..blades {
        let lean = rng.direction();
        let tip = add(
            foot,
            [0.4 * height_m * lean[0], 0.4 * height_m * lean[1], height_m * rng.range(0.7, 1.0)],
        );
        let (side, _) = square_to(unit([lean[0], lean[1], 0.05]));
        let root = add(foot, scale([lean[1], lean[0], 0.0], 0.1));
        let half = scale(side, 0.012 + 0.02 * height_m);
        b.triangle([sub(root, half), add(root, half), tip], Surface::Grass);
    }
}
