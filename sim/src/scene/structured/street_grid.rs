//! Grid of streets: the ground between them, and the houses round every block.

use std::f64::consts::{FRAC_PI_2, PI};

use crate::scene::material::Surface;
use crate::scene::parts::dwelling::{shed, street_tree, town_house};
use crate::scene::parts::plants::bush;
use crate::scene::parts::vehicle::car;
use crate::scene::parts::{Builder, Frame, Point};
use crate::scene::value_noise::Noise;
use echoloop_random::Generator;

/// Half the side of the town, metres.
pub(super) const HALF_M: f64 = 78.0;
/// Height of a kerb, metres.
const KERB_M: f64 = 0.13;

/// Position and width of a street, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Street {
    pub(super) centre: f64,
    /// Half the width of the carriageway.
    pub(super) road: f64,
    /// Half the distance between facades.
    pub(super) front: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum GroundKind {
    Road,
    Walk,
    Block,
}

pub(super) struct StreetGrid {
    /// Streets along y, sorted by x, and streets along x, sorted by y.
    pub(super) streets: [Vec<Street>; 2],
    relief: Noise,
    tilt: [f64; 2],
}

/// Row of houses: its start, direction and length.
#[derive(Clone, Copy, Debug)]
struct Row {
    start: [f64; 2],
    yaw: f64,
    length: f64,
}

impl StreetGrid {
    pub(super) fn new(seed: u64, rng: &mut Generator) -> Self {
        let longer = rng.index(2);
        let streets = [0, 1].map(|axis| {
            let count = if axis == longer { 3 } else { 2 + rng.index(2) };
            let pitch = 2.0 * HALF_M / count as f64;
            (0..count)
                .map(|k| Street::new(-HALF_M + (k as f64 + 0.5) * pitch + rng.spread(6.0), rng))
                .collect()
        });
        let tilt = [rng.spread(0.012), rng.spread(0.012)];
        Self { streets, relief: Noise { seed, scale_m: 60.0, octaves: 2 }, tilt }
    }

    /// Height at the level of the carriageway; the town lies on a slight slope.
    fn level(&self, x: f64, y: f64) -> f64 {
        self.tilt[0] * x + self.tilt[1] * y + 0.3 * self.relief.at(x, y)
    }

    pub(super) fn kind(&self, x: f64, y: f64) -> GroundKind {
        let within = |half: fn(&Street) -> f64| {
            let across = [x, y];
            (0..2).any(|a| self.streets[a].iter().any(|s| (across[a] - s.centre).abs() < half(s)))
        };
        if within(|s| s.road) {
            GroundKind::Road
        } else if within(|s| s.front) {
            GroundKind::Walk
        } else {
            GroundKind::Block
        }
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        self.level(x, y) + if self.kind(x, y) == GroundKind::Road { 0.0 } else { KERB_M }
    }

    pub(super) fn point(&self, x: f64, y: f64) -> Point {
        [x, y, self.height(x, y)]
    }

    /// Grid lines along one axis: where the ground changes, refined to cells of about a metre.
    fn lines(&self, axis: usize) -> Vec<f64> {
        let mut cuts = vec![-HALF_M - 60.0, -HALF_M, HALF_M, HALF_M + 60.0];
        for s in &self.streets[axis] {
            cuts.extend([
                s.centre - s.front,
                s.centre - s.road,
                s.centre + s.road,
                s.centre + s.front,
            ]);
        }
        cuts.sort_by(f64::total_cmp);
        let mut lines = vec![cuts[0]];
        for pair in cuts.windows(2) {
            let cell = if pair[0] < -HALF_M || pair[1] > HALF_M { 8.0 } else { 1.4 };
            let count = ((pair[1] - pair[0]) / cell).ceil().max(1.0);
            lines.extend(
                (1..=count as usize).map(|k| pair[0] + (pair[1] - pair[0]) * k as f64 / count),
            );
        }
        lines
    }

    /// Builds flat cells, with a kerb wherever two neighbours differ in height.
    pub(super) fn ground(&self, b: &mut Builder) {
        let [xs, ys] = [self.lines(0), self.lines(1)];
        let raise = |kind: GroundKind| if kind == GroundKind::Road { 0.0 } else { KERB_M };
        let middle = |lines: &[f64], k: usize| 0.5 * (lines[k] + lines[k + 1]);
        let kind = |i: usize, j: usize| self.kind(middle(&xs, i), middle(&ys, j));
        let at = |x: f64, y: f64, up: f64| [x, y, self.level(x, y) + up];
        for j in 0..ys.len() - 1 {
            for i in 0..xs.len() - 1 {
                let (here, [x0, x1, y0, y1]) = (kind(i, j), [xs[i], xs[i + 1], ys[j], ys[j + 1]]);
                let up = raise(here);
                let corners = [at(x0, y0, up), at(x1, y0, up), at(x1, y1, up), at(x0, y1, up)];
                b.quad(corners, surface(here));
                if i + 2 < xs.len() && raise(kind(i + 1, j)) != up {
                    let riser =
                        [at(x1, y0, 0.0), at(x1, y1, 0.0), at(x1, y1, KERB_M), at(x1, y0, KERB_M)];
                    b.quad(riser, Surface::Stone);
                }
                if j + 2 < ys.len() && raise(kind(i, j + 1)) != up {
                    let riser =
                        [at(x0, y1, 0.0), at(x1, y1, 0.0), at(x1, y1, KERB_M), at(x0, y1, KERB_M)];
                    b.quad(riser, Surface::Stone);
                }
            }
        }
    }

    /// Builds houses round every block, with a yard in its middle.
    pub(super) fn blocks(&self, b: &mut Builder, rng: &mut Generator) {
        let gaps = |axis: usize| {
            let s = &self.streets[axis];
            let starts = std::iter::once(-HALF_M).chain(s.iter().map(|s| s.centre + s.front));
            let ends = s.iter().map(|s| s.centre - s.front).chain([HALF_M]);
            starts.zip(ends).filter(|(low, high)| high - low > 12.0).collect::<Vec<_>>()
        };
        for &(x0, x1) in &gaps(0) {
            for &(y0, y1) in &gaps(1) {
                self.block(b, [x0, y0], [x1, y1], rng);
            }
        }
    }

    fn block(&self, b: &mut Builder, low: [f64; 2], high: [f64; 2], rng: &mut Generator) {
        let (wide, deep) = (high[0] - low[0], high[1] - low[1]);
        let depth = rng.range(9.0, 12.0).min(0.5 * wide).min(0.5 * deep);
        let inner = deep - 2.0 * depth;
        let rows = [
            Row { start: low, yaw: 0.0, length: wide },
            Row { start: high, yaw: PI, length: wide },
            Row { start: [high[0], low[1] + depth], yaw: FRAC_PI_2, length: inner },
            Row { start: [low[0], high[1] - depth], yaw: -FRAC_PI_2, length: inner },
        ];
        for row in rows.into_iter().filter(|row| row.length > 6.0) {
            self.terrace(b, row, depth, rng);
        }
        self.yard(b, low.map(|x| x + depth + 2.5), high.map(|x| x - depth - 2.5), rng);
    }

    /// Builds a yard: walls between the plots, sheds, trees, a car.
    fn yard(&self, b: &mut Builder, low: [f64; 2], high: [f64; 2], rng: &mut Generator) {
        if high[0] - low[0] < 3.0 || high[1] - low[1] < 3.0 {
            return;
        }
        let spot = |rng: &mut Generator| {
            self.point(rng.range(low[0], high[0]), rng.range(low[1], high[1]))
        };
        let walls = ((high[0] - low[0]) / 13.0) as usize;
        for k in 0..walls {
            let x = low[0] + (high[0] - low[0]) * (k as f64 + 0.5 + rng.spread(0.2)) / walls as f64;
            let reach = rng.range(0.45, 0.8) * (high[1] - low[1]);
            let foot = if rng.chance(0.5) { low[1] } else { high[1] - reach };
            let wall = Frame::new(self.point(x, foot), FRAC_PI_2);
            b.cuboid(&wall, [0.0, -0.12, -1.0], [reach, 0.12, 1.8], Surface::Brick);
            b.cuboid(&wall, [-0.05, -0.16, 1.8], [reach + 0.05, 0.16, 1.88], Surface::Stone);
            shed(rng).build(
                b,
                &Frame::new(self.point(x + 2.6, foot + 0.5 * reach), FRAC_PI_2),
                rng,
            );
        }
        for _ in 0..2 {
            street_tree(b, spot(rng), rng);
            let foot = spot(rng);
            bush(b, foot, [rng.range(0.6, 1.2), rng.range(0.9, 1.7)], 300, rng);
        }
        car(b, &Frame::new(spot(rng), rng.turn()), rng);
    }

    /// Builds houses wall to wall, with a gap now and then.
    fn terrace(&self, b: &mut Builder, row: Row, depth: f64, rng: &mut Generator) {
        let line = Frame::new([row.start[0], row.start[1], 0.0], row.yaw);
        let mut x = 0.0;
        while row.length - x > 6.0 {
            let mut width = rng.range(8.0, 17.0);
            if row.length - x - width < 7.0 {
                width = row.length - x;
            }
            let centre = line.at([x + 0.5 * width, 0.5 * depth, 0.0]);
            let foot = self.point(centre[0], centre[1]);
            let house = Frame::new(foot, row.yaw);
            if rng.chance(0.93) {
                town_house(width, depth, rng).build(b, &house, rng);
            } else {
                street_tree(b, foot, rng);
            }
            x += width;
        }
    }
}

impl Street {
    fn new(centre: f64, rng: &mut Generator) -> Self {
        let road = rng.range(4.2, 5.6);
        Self { centre, road, front: road + rng.range(2.6, 4.5) }
    }
}

fn surface(kind: GroundKind) -> Surface {
    match kind {
        GroundKind::Road => Surface::Asphalt,
        GroundKind::Walk => Surface::Paving,
        GroundKind::Block => Surface::Gravel,
    }
}
