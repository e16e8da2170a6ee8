//! Layout of a town under construction: its ground, the occupied parts of it, and the plants to
//! come.

use super::cover_raster::{Cover, CoverRaster};
use super::ground::Ground;
use super::road_edge::RoadEdge;
use crate::roads::RoadNetwork;
use crate::scene::material::Surface;
use crate::scene::parts::dwelling::{garden_tree, street_tree};
use crate::scene::parts::plants::{bush, conifer, hedge, tuft};
use crate::scene::parts::street::{bench, bin, bollard, pickets};
use crate::scene::parts::terrain::rock;
use crate::scene::parts::{Builder, Frame, Point};
use crate::scene::value_noise::Noise;
use echoloop_random::Generator;

/// Number of triangles beyond which houses are plain.
const PLAIN_TRIANGLES: usize = 1_150_000;
/// Number of triangles beyond which nothing more is planted.
const MAX_TRIANGLES: usize = 1_850_000;

/// Buildings along the roads of a town.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dressing {
    /// Houses wall to wall.
    Quarter,
    /// Detached houses in gardens.
    Suburb,
}

/// Plants and furniture, added last as far as the limit of triangles allows.
#[derive(Clone, Copy)]
pub(super) enum Plant {
    StreetTree(Point),
    GardenTree(Point),
    Conifer(Point, f64),
    Bush(Point, [f64; 2]),
    /// Along the x axis of the frame; length and height, metres.
    Hedge(Frame, [f64; 2]),
    Fence(Frame, [f64; 2]),
    Bench(Frame),
    Bin(Frame),
    Bollard(Frame),
    Rock(Point, f64),
    Tuft(Point),
}

/// Ground, roads and occupied cells of a town.
pub(super) struct TownLayout {
    pub(super) raster: CoverRaster,
    pub(super) ground: Ground,
    pub(super) edges: Vec<RoadEdge>,
    dressing: Dressing,
    patches: Noise,
}

impl TownLayout {
    pub(super) fn new(network: &RoadNetwork, dressing: Dressing, seed: u64) -> Self {
        let raster = CoverRaster::new(network);
        let relief_m = match dressing {
            Dressing::Quarter => 0.4,
            Dressing::Suburb => 1.6,
        };
        let relief = Noise { seed, scale_m: 45.0, octaves: 3 };
        let ground = Ground::new(&raster, relief, relief_m);
        let patches = Noise { seed: seed.wrapping_add(77), scale_m: 18.0, octaves: 2 };
        Self { raster, ground, edges: RoadEdge::all(network), dressing, patches }
    }

    /// Surface of the ground at a point.
    pub(super) fn surface(&self, at: [f64; 2]) -> Surface {
        match (self.raster.cover(at), self.dressing) {
            (Cover::Driven | Cover::Paved | Cover::Infill, _) => Surface::Asphalt,
            (Cover::Raised, _) => Surface::Paving,
            (Cover::Open, Dressing::Suburb) => Surface::Grass,
            (Cover::Open, Dressing::Quarter) => {
                let patch = self.patches.at(at[0], at[1]);
                match self.ground.away(at) {
                    away if away < 6.0 => Surface::Paving,
                    away if away > 40.0 || patch > 0.1 => Surface::Grass,
                    _ if patch < -0.4 => Surface::Soil,
                    _ => Surface::Gravel,
                }
            }
        }
    }

    /// Point on the top surface: a sidewalk, a road or the ground.
    pub(super) fn stand(&self, at: [f64; 2]) -> Point {
        let height = self.raster.level(at).unwrap_or_else(|| self.ground.height(at));
        [at[0], at[1], height]
    }

    /// Frame at a point of another frame, moved onto the top surface there.
    pub(super) fn frame(&self, on: &Frame, at: [f64; 2], yaw: f64) -> Frame {
        let [x, y, z] = on.at([at[0], at[1], 0.0]);
        let foot = self.stand([x, y]);
        on.child([at[0], at[1], foot[2] - z], yaw)
    }

    /// True while the number of triangles allows houses with all their windows.
    pub(super) fn is_rich(b: &Builder) -> bool {
        b.mesh.triangles.len() < PLAIN_TRIANGLES
    }

    /// Adds trees, bushes and rocks on open ground away from roads.
    pub(super) fn wild(&mut self, plants: &mut Vec<Plant>, rng: &mut Generator) {
        let (low, high) = (self.raster.low, self.raster.high);
        let count = ((high[0] - low[0]) * (high[1] - low[1]) / 110.0) as usize;
        for _ in 0..count {
            let at = [0, 1].map(|i| rng.range(low[i], high[i]));
            let away = self.ground.away(at);
            if away < 5.0 || !self.raster.take_spot(at, 1.2) {
                continue;
            }
            let foot = self.ground.point(at);
            let woods = self.patches.at(0.3 * at[0], 0.3 * at[1]) + 0.004 * away;
            plants.push(match rng.index(10) {
                0..=2 if woods > 0.1 => Plant::GardenTree(foot),
                3 if woods > 0.2 => Plant::Conifer(foot, rng.range(5.0, 10.0)),
                0..=5 => Plant::Bush(foot, [rng.range(0.5, 1.2), rng.range(0.7, 1.8)]),
                6 => Plant::Rock(foot, rng.range(0.3, 0.7)),
                _ => Plant::Tuft(foot),
            });
        }
    }

    /// Builds the plants in random order, so that those beyond the limit are missing everywhere
    /// alike.
    pub(super) fn plant(&self, b: &mut Builder, mut plants: Vec<Plant>, rng: &mut Generator) {
        for k in (1..plants.len()).rev() {
            plants.swap(k, rng.index(k + 1));
        }
        for plant in plants {
            if b.mesh.triangles.len() > MAX_TRIANGLES {
                break;
            }
            self.grow(b, plant, rng);
        }
    }

    fn grow(&self, b: &mut Builder, plant: Plant, rng: &mut Generator) {
        match plant {
            Plant::StreetTree(foot) => street_tree(b, foot, rng),
            Plant::GardenTree(foot) => garden_tree(b, foot, rng),
            Plant::Conifer(foot, height_m) => conifer(b, foot, height_m, rng),
            Plant::Bush(foot, size) => bush(b, foot, size, 200, rng),
            Plant::Hedge(line, [long, high]) => self.hedge(b, &line, long, high, rng),
            Plant::Fence(line, [long, high]) => {
                let [_, _, base] = line.at([0.0; 3]);
                let below = |x: f64| {
                    let [x, y, _] = line.at([x, 0.0, 0.0]);
                    self.stand([x, y])[2] - base
                };
                pickets(b, &line, long, high, below);
            }
            Plant::Bench(at) => bench(b, &at),
            Plant::Bin(at) => bin(b, &at),
            Plant::Bollard(at) => bollard(b, &at),
            Plant::Rock(foot, radius_m) => rock(b, foot, radius_m, rng),
            Plant::Tuft(foot) => tuft(b, foot, rng.range(0.1, 0.35), 4, rng),
        }
    }

    /// Builds a hedge in pieces of 2 m, which follow the slope.
    fn hedge(&self, b: &mut Builder, line: &Frame, long: f64, high: f64, rng: &mut Generator) {
        let pieces = (long / 2.0).ceil().max(1.0);
        let step = long / pieces;
        for k in 0..pieces as usize {
            let piece = self.frame(line, [k as f64 * step, 0.0], 0.0);
            hedge(b, &piece, step, [0.7, high], rng);
        }
    }
}
