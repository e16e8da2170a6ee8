//! What landscapes share: their size, and places for plants that keep apart.

use std::collections::HashMap;

use crate::scene::material::Surface;
use crate::scene::parts::Builder;
use crate::scene::parts::terrain::ground;
use crate::scene::value_noise::Noise;
use echoloop_random::Generator;

/// Half the side of a landscape, metres.
pub(super) const HALF_M: f64 = 150.0;
/// Side of a cell of its ground, metres, and how far coarse ground goes on beyond it.
const CELL_M: f64 = 1.05;
const APRON_M: f64 = 80.0;

pub(super) struct Wild {
    seed: u64,
    /// What stands already, by cells of 4 m: place and radius of the room it needs.
    stands: HashMap<[i64; 2], Vec<[f64; 3]>>,
}

impl Wild {
    pub(super) fn new(seed: u64) -> Self {
        Self { seed, stands: HashMap::new() }
    }

    pub(super) fn noise(&self, stream: u64, scale_m: f64, octaves: u32) -> Noise {
        let seed = self.seed.wrapping_mul(37).wrapping_add(1000 + stream);
        Noise { seed, scale_m, octaves }
    }

    /// The ground.
    pub(super) fn lay(
        b: &mut Builder,
        height: &impl Fn(f64, f64) -> f64,
        surface: impl Fn(f64, f64) -> Surface,
    ) {
        ground(b, HALF_M, CELL_M, APRON_M, height, surface);
    }

    /// A place anywhere.
    pub(super) fn spot(rng: &mut Generator) -> [f64; 2] {
        [rng.spread(HALF_M), rng.spread(HALF_M)]
    }

    /// Up to `count` places that are wanted and as far apart as their rooms say, metres.
    pub(super) fn sow(
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
            let at = Self::spot(rng);
            if is_wanted(at, rng) && self.is_free(at, room_m) {
                self.stands.entry(cell(at)).or_default().push([at[0], at[1], room_m]);
                found.push(at);
            }
        }
        found
    }

    fn is_free(&self, at: [f64; 2], room_m: f64) -> bool {
        let [i, j] = cell(at);
        let near = (-2..=2).flat_map(|di| (-2..=2).map(move |dj| [i + di, j + dj]));
        let mut others = near.filter_map(|cell| self.stands.get(&cell)).flatten();
        others.all(|[x, y, room]| {
            let (dx, dy, least) = (x - at[0], y - at[1], 0.5 * (room + room_m));
            dx * dx + dy * dy > least * least
        })
    }
}

fn cell(at: [f64; 2]) -> [i64; 2] {
    at.map(|x| (x / 4.0).floor() as i64)
}
