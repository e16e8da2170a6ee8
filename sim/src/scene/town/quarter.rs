//! Town quarter: houses wall to wall along the sidewalks, with lamps, trees and benches.

use std::f64::consts::FRAC_PI_2;

use super::layout::{Plant, TownLayout};
use crate::scene::parts::dwelling::{shed, town_house};
use crate::scene::parts::house::House;
use crate::scene::parts::street::{lamp, sign};
use crate::scene::parts::{Builder, Frame};
use echoloop_random::Generator;

/// Distance between lamps, and between other objects on a sidewalk, metres.
const LAMP_M: f64 = 28.0;
const OBJECT_M: f64 = 7.0;
/// Largest number of floors of a house.
const FLOORS: usize = 6;

pub(super) fn build(b: &mut Builder, layout: &mut TownLayout, rng: &mut Generator) -> Vec<Plant> {
    let mut plants = Vec::new();
    for k in 0..layout.edges.len() {
        houses(b, layout, k, &mut plants, rng);
    }
    for k in 0..layout.edges.len() {
        sidewalk(b, layout, k, &mut plants, rng);
    }
    layout.wild(&mut plants, rng);
    plants
}

/// Builds a row of houses along one edge, with a gap now and then.
fn houses(
    b: &mut Builder,
    layout: &mut TownLayout,
    edge_index: usize,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    let long = layout.edges[edge_index].length_m();
    // Without a sidewalk there is a strip in front of the door.
    let set_back = if layout.edges[edge_index].walk_m > 1.0 { 0.4 } else { 3.0 };
    let mut along = rng.range(0.0, 3.0);
    while along + 6.0 < long {
        let width = rng.range(9.0, 17.0).min(long - along);
        let depth = rng.range(9.0, 12.5);
        let edge = layout.edges[edge_index].frame(along + 0.5 * width);
        if rng.chance(0.9) {
            if !build_house(b, layout, &edge, [width, depth], set_back, rng) {
                // A bend or a neighbour is in the way: a smaller house set back farther may fit.
                build_house(b, layout, &edge, [0.7 * width, 0.8 * depth], set_back + 2.0, rng);
            }
        } else {
            let [x, y, _] = edge.at([0.0, 5.0, 0.0]);
            if layout.raster.take_spot([x, y], 1.5) {
                plants.push(Plant::StreetTree(layout.stand([x, y])));
            }
        }
        along += width + if rng.chance(0.15) { rng.range(2.5, 6.0) } else { 0.25 };
    }
}

/// Builds a house behind an edge; returns false when there is no room.
fn build_house(
    b: &mut Builder,
    layout: &mut TownLayout,
    edge: &Frame,
    [width, depth]: [f64; 2],
    set_back: f64,
    rng: &mut Generator,
) -> bool {
    // Narrower than the house: neighbours in a row share the cells where they touch.
    let half = 0.5 * width - 0.45;
    if width < 5.0 || !layout.raster.take(edge, [-half, set_back], [half, set_back + depth]) {
        return false;
    }
    let drawn = town_house(width - 0.1, depth, rng);
    let house = House {
        floors: drawn.floors.min(FLOORS),
        bay_m: drawn.bay_m.max(2.6),
        open: if TownLayout::is_rich(b) { drawn.open } else { [true, false, false, false] },
        ..drawn
    };
    house.build(b, &layout.frame(edge, [0.0, set_back + 0.5 * depth], 0.0), rng);
    let yard = [rng.spread(0.3 * width), set_back + depth + 3.5];
    let back = layout.frame(edge, yard, 0.0);
    if rng.chance(0.2) && layout.raster.take(&back, [-2.4, -1.8], [2.4, 1.8]) {
        shed(rng).build(b, &back, rng);
    }
    true
}

/// Places lamps, trees, signs, bins and benches along one edge.
fn sidewalk(
    b: &mut Builder,
    layout: &mut TownLayout,
    edge_index: usize,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    let (long, walk) = (layout.edges[edge_index].length_m(), layout.edges[edge_index].walk_m);
    // From the outer edge of the road back across the sidewalk to its kerb.
    let kerb = if walk > 1.0 { 0.5 - walk } else { 0.6 };
    let mut since_lamp = 0.5 * LAMP_M;
    let mut along = rng.range(3.0, OBJECT_M);
    while along < long - 2.0 {
        let edge = layout.edges[edge_index].frame(along);
        let at = layout.frame(&edge, [0.0, kerb], -FRAC_PI_2);
        since_lamp += OBJECT_M;
        let wide = walk >= 2.4;
        match rng.index(8) {
            _ if since_lamp >= LAMP_M => {
                lamp(b, &at, 6.5 + rng.unit());
                since_lamp = 0.0;
            }
            0..=2 if wide => plants.push(Plant::StreetTree(at.at([0.0; 3]))),
            3 if wide => sign(b, &at.child([0.0; 3], FRAC_PI_2)),
            4 if wide => plants.push(Plant::Bin(layout.frame(&edge, [0.0, -0.5], 0.0))),
            5 if wide => plants.push(Plant::Bench(layout.frame(&edge, [0.0, -0.5], 0.0))),
            6 => plants.push(Plant::Bollard(at)),
            _ => {}
        }
        along += OBJECT_M + rng.spread(0.8);
    }
}
