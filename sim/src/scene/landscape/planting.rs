//! Parts that landscapes share: their size, their ground, and spots for plants that keep apart.

use std::collections::HashMap;

use crate::scene::material::Surface;
use crate::scene::parts::Builder;
use crate::scene::parts::terrain::ground;
use crate::scene::value_noise::Noise;
use echoloop_random::Generator;

/// Half the side of a landscape, metres.
pub(super) const HALF_M: f64 = 150.0;
/// Side of a cell of the ground, and width of the coarse ground around it, metres.
const CELL_M: f64 = 1.05;
const APRON_M: f64 = 80.0;

/// Spots of plants and rocks so far, and the noise of a landscape.
pub(super) struct Planting {
    seed: u64,
    /// Occupied spots in cells of 4 m: position, and the room each needs, metres.
    planted: HashMap<[i64; 2], Vec<[f64; 3]>>,
}

impl Planting {
    pub(super) fn new(seed: u64) -> Self {
        Self { seed, planted: HashMap::new() }
    }

    pub(super) fn noise(&self, stream: u64, scale_m: f64, octaves: u32) -> Noise {
        let seed = self.seed.wrapping_mul(37).wrapping_add(1000 + stream);
        Noise { seed, scale_m, octaves }
    }

    /// Builds the ground.
    pub(super) fn lay_ground(
        b: &mut Builder,
        height: &impl Fn(f64, f64) -> f64,
        surface: impl Fn(f64, f64) -> Surface,
    ) {
        ground(b, HALF_M, CELL_M, APRON_M, height, surface);
    }

    /// Random spot anywhere.
    pub(super) fn random_spot(rng: &mut Generator) -> [f64; 2] {
        [rng.spread(HALF_M), rng.spread(HALF_M)]
    }

    /// Up to `count` random spots that are wanted and as far apart as the room of each demands,
    /// metres.
    pub(super) fn scatter(
        &mut self,
        count: usize,
        room_m: f64,
        rng: &mut Generator,
        is_wanted: impl Fn([f64; 2], &mut Generator) -> bool,
    ) -> Vec<[f64; 2]> {
        let mut found = Vec::new();
        for _ in 0..40 * count {
            if found.len() == count {
                break;
            }
            let at = Self::random_spot(rng);
            if is_wanted(at, rng) && self.is_free(at, room_m) {
                self.planted.entry(cell(at)).or_default().push([at[0], at[1], room_m]);
                found.push(at);
            }
        }
        found
    }

    fn is_free(&self, at: [f64; 2], room_m: f64) -> bool {
        let [i, j] = cell(at);
        let near = (-2..=2).flat_map(|di| (-2..=2).map(move |dj| [i + di, j + dj]));
        let mut others = near.filter_map(|cell| self.planted.get(&cell)).flatten();
        others.all(|[x, y, room]| {
            let (dx, dy, least) = (x - at[0], y - at[1], 0.5 * (room + room_m));
            dx * dx + dy * dy > least * least
        })
    }
}

fn cell(at: [f64; 2]) -> [i64; 2] {
    at.map(|x| (x / 4.0).floor() as i64)
}
