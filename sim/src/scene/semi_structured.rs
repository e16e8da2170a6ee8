//! A suburb: detached houses in gardens on a gentle slope.

use std::f64::consts::PI;

use super::material::Surface;
use super::mesh::Mesh;
use super::parts::dwelling::{cottage, garage, garden_tree};
use super::parts::plants::{bush, hedge, tuft};
use super::parts::street::{bench, lamp, pickets, sign};
use super::parts::terrain::{ground, rock};
use super::parts::vehicle::car;
use super::parts::{Builder, Frame, Point};
use super::value_noise::Noise;
use echoloop_random::Generator;

/// Half the side of the suburb, metres.
const HALF_M: f64 = 80.0;
/// Distance of viewpoints from the edge, metres.
const RIM_M: f64 = 12.0;
/// Half the width of a lane, metres.
const LANE_M: f64 = 3.0;

struct Suburb {
    relief: Noise,
    slope: [f64; 2],
    /// Mean y of the lanes along x, which curve from side to side.
    lanes: Vec<f64>,
    swing: f64,
    phase: f64,
    /// x of the lane across.
    cross_x: f64,
}

/// Plot of land: its lane and the side of it, the middle of its front along the lane, its width.
struct Plot {
    lane: usize,
    /// −1 or 1.
    side: f64,
    middle: f64,
    width: f64,
}

pub(crate) fn generate(seed: u64) -> (Mesh, f32) {
    let mut rng = Generator::new(seed, 2);
    let suburb = Suburb::new(seed, &mut rng);
    let mut b = Builder::default();
    let height = |x: f64, y: f64| suburb.height(x, y);
    ground(&mut b, HALF_M, 1.1, 64.0, &height, |x, y| suburb.surface(x, y));
    for lane in 0..suburb.lanes.len() {
        for side in [-1.0, 1.0] {
            suburb.plots(&mut b, lane, side, &mut rng);
        }
        suburb.lamps(&mut b, lane, &mut rng);
    }
    suburb.commons(&mut b, &mut rng);
    suburb.tufts(&mut b, &mut rng);
    (b.mesh, (HALF_M - RIM_M) as f32)
}

impl Suburb {
    fn new(seed: u64, rng: &mut Generator) -> Self {
        let first = -40.0 + rng.spread(5.0);
        Self {
            relief: Noise { seed, scale_m: 70.0, octaves: 4 },
            slope: [rng.spread(0.04), rng.spread(0.04)],
            lanes: vec![first, first + rng.range(76.0, 84.0)],
            swing: rng.range(2.0, 5.0),
            phase: rng.turn(),
            cross_x: rng.spread(25.0),
        }
    }

    fn height(&self, x: f64, y: f64) -> f64 {
        self.slope[0] * x + self.slope[1] * y + 2.2 * self.relief.at(x, y)
    }

    fn point(&self, x: f64, y: f64) -> Point {
        [x, y, self.height(x, y)]
    }

    /// y of the middle of a lane at `x`.
    fn lane_y(&self, lane: usize, x: f64) -> f64 {
        self.lanes[lane] + self.swing * libm::sin(0.035 * x + self.phase)
    }

    fn on_lane(&self, x: f64, y: f64, margin: f64) -> bool {
        let along =
            (0..self.lanes.len()).any(|lane| (y - self.lane_y(lane, x)).abs() < LANE_M + margin);
        along || (x - self.cross_x).abs() < LANE_M + margin
    }

    fn surface(&self, x: f64, y: f64) -> Surface {
        match (self.on_lane(x, y, 0.0), self.on_lane(x, y, 1.2)) {
            (true, _) => Surface::Asphalt,
            (_, true) => Surface::Gravel,
            _ => Surface::Grass,
        }
    }

    /// Builds the plots along one side of a lane.
    fn plots(&self, b: &mut Builder, lane: usize, side: f64, rng: &mut Generator) {
        let mut x = -HALF_M + 2.0;
        while x < HALF_M - 18.0 {
            let width = rng.range(17.0, 24.0);
            let middle = x + 0.5 * width;
            if (middle - self.cross_x).abs() > 0.5 * width + LANE_M {
                self.plot(b, &Plot { lane, side, middle, width }, rng);
            }
            x += width;
        }
    }

    /// Builds one plot, in a frame with x along the lane, y away from it, and its origin in the
    /// middle of the front.
    fn plot(&self, b: &mut Builder, plot: &Plot, rng: &mut Generator) {
        let Plot { lane, side, middle, width } = *plot;
        let front = self.lane_y(lane, middle) + side * (LANE_M + 2.2 + 0.1 * self.swing);
        let plot = Frame::new([middle, front, 0.0], if side > 0.0 { 0.0 } else { PI });
        let depth = rng.range(26.0, 31.0);
        let stand = |x: f64, y: f64, yaw: f64| {
            let p = plot.at([x, y, 0.0]);
            let turn = yaw + if side > 0.0 { 0.0 } else { PI };
            Frame::new(self.point(p[0], p[1]), turn)
        };
        let house = cottage(width, rng);
        let set_back = rng.range(5.0, 9.0) + 0.5 * house.depth_m;
        house.build(b, &stand(1.5, set_back, rng.spread(0.12)), rng);
        let drive = -0.5 * width + 2.6;
        if rng.chance(0.75) {
            car(b, &stand(drive, rng.range(2.8, 6.0), 0.5 * PI + rng.spread(0.1)), rng);
        }
        if rng.chance(0.5) {
            garage(rng).build(b, &stand(drive, set_back + 4.0, 0.0), rng);
        }
        self.borders(b, &plot, width, depth, rng);
        self.garden(b, &plot, width, [set_back + 0.5 * house.depth_m + 2.0, depth - 1.5], rng);
        self.front_garden(b, &plot, width, rng);
    }

    /// Plants the front garden: two bushes and sometimes a tree.
    fn front_garden(&self, b: &mut Builder, plot: &Frame, width: f64, rng: &mut Generator) {
        if rng.chance(0.6) {
            let at = plot.at([rng.range(1.0, 0.5 * width - 2.0), rng.range(1.5, 3.0), 0.0]);
            garden_tree(b, self.point(at[0], at[1]), rng);
        }
        for _ in 0..2 {
            let at = plot.at([rng.range(0.0, 0.5 * width - 2.0), rng.range(1.5, 3.5), 0.0]);
            bush(b, self.point(at[0], at[1]), [rng.range(0.5, 0.9), rng.range(0.8, 1.4)], 200, rng);
        }
    }

    /// Builds a hedge or a fence on three borders: the front beside the drive, one side, the back.
    fn borders(&self, b: &mut Builder, plot: &Frame, width: f64, depth: f64, rng: &mut Generator) {
        let half = 0.5 * width;
        let lines = [
            ([-half + 5.2, 0.4], 0.0, width - 5.6),
            ([half - 0.2, 0.6], 0.5 * PI, depth - 1.0),
            ([-half + 0.3, depth], 0.0, width - 0.6),
        ];
        for (start, yaw, length) in lines {
            let height = rng.range(0.9, 1.5);
            let line = plot.child([start[0], start[1], 0.0], yaw);
            if rng.chance(0.45) {
                let ground = |x: f64| {
                    let p = line.at([x, 0.0, 0.0]);
                    self.height(p[0], p[1])
                };
                pickets(b, &line, length, height, ground);
            } else if rng.chance(0.75) {
                self.hedge(b, &line, length, height + 0.3, rng);
            }
        }
    }

    /// Builds a hedge in pieces of 2 m, which follow the slope.
    fn hedge(&self, b: &mut Builder, line: &Frame, length: f64, height: f64, rng: &mut Generator) {
        let pieces = (length / 2.0).ceil() as usize;
        let step = length / pieces as f64;
        for k in 0..pieces {
            let x = k as f64 * step;
            let p = line.at([x + 0.5 * step, 0.0, 0.0]);
            let piece = line.child([x, 0.0, self.height(p[0], p[1])], 0.0);
            hedge(b, &piece, step, [0.7, height], rng);
        }
    }

    /// Plants trees and bushes behind the house; places a bench and a boulder.
    fn garden(&self, b: &mut Builder, plot: &Frame, width: f64, y: [f64; 2], rng: &mut Generator) {
        let spot = |rng: &mut Generator| {
            let p = plot.at([rng.spread(0.5 * width - 2.0), rng.range(y[0], y[1]), 0.0]);
            self.point(p[0], p[1])
        };
        for _ in 0..1 + rng.index(3) {
            let foot = spot(rng);
            garden_tree(b, foot, rng);
        }
        for _ in 0..2 {
            let foot = spot(rng);
            bush(b, foot, [rng.range(0.6, 1.2), rng.range(0.8, 1.8)], 220, rng);
        }
        if rng.chance(0.4) {
            bench(b, &Frame::new(spot(rng), rng.turn()));
        }
        if rng.chance(0.4) {
            rock(b, spot(rng), rng.range(0.3, 0.6), rng);
        }
    }

    fn lamps(&self, b: &mut Builder, lane: usize, rng: &mut Generator) {
        for k in 0..6 {
            let x = -HALF_M + 26.0 * (f64::from(k) + 0.5);
            let y = self.lane_y(lane, x) - LANE_M - 0.8;
            if (x - self.cross_x).abs() > LANE_M + 1.0 {
                lamp(b, &Frame::new(self.point(x, y), 0.5 * PI), 5.5 + rng.unit());
                if rng.chance(0.4) {
                    sign(b, &Frame::new(self.point(x + 6.0, y), 0.0));
                }
            }
        }
    }

    /// Plants the strip between the gardens of two lanes.
    fn commons(&self, b: &mut Builder, rng: &mut Generator) {
        for k in 0..40 {
            let x = -HALF_M + 4.0 * (f64::from(k) + rng.unit());
            let y = 0.5 * (self.lane_y(0, x) + self.lane_y(1, x)) + rng.spread(3.5);
            if self.on_lane(x, y, 2.0) {
                continue;
            }
            if rng.chance(0.3) {
                garden_tree(b, self.point(x, y), rng);
            } else {
                bush(b, self.point(x, y), [rng.range(0.6, 1.4), rng.range(0.8, 2.0)], 210, rng);
            }
        }
    }

    fn tufts(&self, b: &mut Builder, rng: &mut Generator) {
        for _ in 0..2500 {
            let (x, y) = (rng.spread(HALF_M), rng.spread(HALF_M));
            if !self.on_lane(x, y, 1.2) {
                tuft(b, self.point(x, y), rng.range(0.08, 0.25), 4, rng);
            }
        }
    }
}
