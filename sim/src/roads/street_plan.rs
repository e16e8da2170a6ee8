//! Plans of generated networks: crossings, and the streets between them, from a seed.

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::scene::value_noise::Noise;
use echoloop_random::Generator;

/// Style of a generated network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetworkStyle {
    /// Streets of an old town: an irregular grid, parked cars, wide sidewalks.
    Grid,
    /// Lanes of a suburb: curved, with dead ends, narrow sidewalks.
    Suburb,
    /// As [`Self::Suburb`] on a slope, wider apart, without sidewalks.
    Hillside,
}

/// Parameters of a style; lengths in metres.
pub(super) struct StyleParameters {
    /// Number of crossings along x and along y.
    pub(super) nodes: [usize; 2],
    pitch_m: f64,
    /// Largest offset of a crossing from the grid, along each axis.
    jitter_m: f64,
    /// Share of streets that are left out, of those that the network does not need to be connected.
    gaps: f64,
    /// Largest angle between an end of a street and the straight line, radians.
    bend_rad: f64,
    /// Half the height of the hills, and their size.
    relief_m: f64,
    relief_scale_m: f64,
    /// Kinds and widths of the lanes, from the middle out.
    pub(super) lanes: &'static [(&'static str, f64)],
}

impl NetworkStyle {
    pub(super) fn parameters(self) -> StyleParameters {
        match self {
            Self::Grid => StyleParameters {
                nodes: [5, 4],
                pitch_m: 72.0,
                jitter_m: 9.0,
                gaps: 0.18,
                bend_rad: 0.06,
                relief_m: 1.2,
                relief_scale_m: 150.0,
                lanes: &[("driving", 3.2), ("parking", 2.2), ("shoulder", 0.3), ("sidewalk", 3.0)],
            },
            Self::Suburb => StyleParameters {
                nodes: [5, 4],
                pitch_m: 84.0,
                jitter_m: 13.0,
                gaps: 0.42,
                bend_rad: 0.45,
                relief_m: 2.5,
                relief_scale_m: 170.0,
                lanes: &[("driving", 3.0), ("shoulder", 0.4), ("sidewalk", 1.8)],
            },
            Self::Hillside => StyleParameters {
                nodes: [4, 4],
                pitch_m: 98.0,
                jitter_m: 16.0,
                gaps: 0.45,
                bend_rad: 0.6,
                relief_m: 6.0,
                relief_scale_m: 260.0,
                lanes: &[("driving", 2.8), ("shoulder", 0.8)],
            },
        }
    }
}

impl StyleParameters {
    /// Distance from the middle of a street to its edge.
    pub(super) fn half_m(&self) -> f64 {
        self.lanes.iter().map(|(_, width)| width).sum()
    }

    /// Width of the driving lane.
    pub(super) fn driven_m(&self) -> f64 {
        self.lanes.first().map_or(0.0, |(_, width)| *width)
    }

    /// Width within the kerb.
    pub(super) fn paved_m(&self) -> f64 {
        let inside =
            self.lanes.iter().filter(|(kind, _)| *kind != "sidewalk" && *kind != "shoulder");
        inside.map(|(_, width)| width).sum()
    }
}

/// A crossing.
pub(super) struct Node {
    pub(super) at: [f64; 2],
    pub(super) height_m: f64,
    /// Streets that meet here, and true for each that begins here, by rising direction.
    pub(super) arms: Vec<(usize, bool)>,
    /// Distance from its middle at which streets end, metres.
    pub(super) radius_m: f64,
}

/// A street between two crossings.
pub(super) struct Street {
    pub(super) nodes: [usize; 2],
    /// Heading at its first crossing and at its last, both along the street, radians.
    pub(super) headings: [f64; 2],
}

/// Crossings and streets of a network.
pub(super) struct Plan {
    pub(super) nodes: Vec<Node>,
    pub(super) streets: Vec<Street>,
}

impl Plan {
    pub(super) fn new(style: NetworkStyle, seed: u64) -> Self {
        let parameters = style.parameters();
        let mut rng = Generator::new(seed, 40 + style as u64);
        let mut nodes = nodes(&parameters, seed, &mut rng);
        let mut streets = Vec::new();
        for ends in edges(&parameters, &mut rng) {
            let [from, to] = ends.map(|k| nodes[k].at);
            let straight = libm::atan2(to[1] - from[1], to[0] - from[0]);
            let headings = [0, 1].map(|_| straight + rng.spread(parameters.bend_rad));
            streets.push(Street { nodes: ends, headings });
        }
        for (k, street) in streets.iter().enumerate() {
            nodes[street.nodes[0]].arms.push((k, true));
            nodes[street.nodes[1]].arms.push((k, false));
        }
        for node in &mut nodes {
            node.arms.sort_by(|a, b| {
                arm_direction(&streets, *a).total_cmp(&arm_direction(&streets, *b))
            });
            node.radius_m = radius(&parameters, &streets, &node.arms);
        }
        Self { nodes, streets }
    }
}

/// Direction in which an arm leaves its crossing, 0 to 2π.
pub(super) fn arm_direction(streets: &[Street], (street, begins): (usize, bool)) -> f64 {
    let [first, last] = streets[street].headings;
    (if begins { first } else { last + TAU / 2.0 }).rem_euclid(TAU)
}

fn nodes(parameters: &StyleParameters, seed: u64, rng: &mut Generator) -> Vec<Node> {
    let relief = Noise { seed, scale_m: parameters.relief_scale_m, octaves: 1 };
    let [columns, rows] = parameters.nodes;
    let place = |k: usize, count: usize| parameters.pitch_m * (k as f64 - 0.5 * (count - 1) as f64);
    let mut nodes = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let at =
                [place(i, columns), place(j, rows)].map(|x| x + rng.spread(parameters.jitter_m));
            let height_m = parameters.relief_m * relief.at(at[0], at[1]);
            nodes.push(Node { at, height_m, arms: Vec::new(), radius_m: 0.0 });
        }
    }
    nodes
}

/// Edges of the grid: a random spanning tree, and all others but a random share.
fn edges(parameters: &StyleParameters, rng: &mut Generator) -> Vec<[usize; 2]> {
    let [columns, rows] = parameters.nodes;
    let along_x =
        (0..rows).flat_map(|j| (1..columns).map(move |i| [j * columns + i - 1, j * columns + i]));
    let along_y =
        (1..rows).flat_map(|j| (0..columns).map(move |i| [(j - 1) * columns + i, j * columns + i]));
    let mut all: Vec<[usize; 2]> = along_x.chain(along_y).collect();
    for k in (1..all.len()).rev() {
        all.swap(k, rng.index(k + 1));
    }
    let mut group: Vec<usize> = (0..columns * rows).collect();
    all.retain(|[a, b]| {
        let (from, to) = (group[*a], group[*b]);
        let joins = from != to;
        group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
        !rng.chance(parameters.gaps) || joins
    });
    all.sort_unstable();
    all
}

/// Radius at which the edges of neighbouring arms do not overlap and a corner fits.
fn radius(parameters: &StyleParameters, streets: &[Street], arms: &[(usize, bool)]) -> f64 {
    if arms.len() < 2 {
        return 0.0;
    }
    let turns: Vec<f64> = arms.iter().map(|arm| arm_direction(streets, *arm)).collect();
    let gap = |k: usize| {
        let next = turns[(k + 1) % turns.len()];
        let gap = (next - turns[k]).rem_euclid(TAU);
        if gap == 0.0 { TAU } else { gap }
    };
    let least = (0..turns.len()).map(gap).fold(FRAC_PI_2, f64::min).max(0.7);
    parameters.half_m() / libm::tan(0.5 * least) + 4.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_crossing_has_a_street_and_streets_are_longer_than_their_crossings() {
        for style in [NetworkStyle::Grid, NetworkStyle::Suburb, NetworkStyle::Hillside] {
            for seed in 0..20 {
                let plan = Plan::new(style, seed);
                assert!(plan.nodes.iter().all(|node| !node.arms.is_empty()), "{style:?} {seed}");
                for street in &plan.streets {
                    let [a, b] = street.nodes.map(|k| &plan.nodes[k]);
                    let apart = [0, 1].map(|i| a.at[i] - b.at[i]);
                    let long = (apart[0] * apart[0] + apart[1] * apart[1]).sqrt();
                    let left = long - a.radius_m - b.radius_m;
                    assert!(left > 8.0, "{style:?} {seed}: {left}");
                }
            }
        }
    }
}
