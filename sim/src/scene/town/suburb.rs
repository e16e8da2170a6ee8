//! Suburb: plots along the roads, each with a house, a drive, and a garden within a hedge or a
//! fence.

use std::f64::consts::FRAC_PI_2;

use super::layout::{Plant, TownLayout};
use crate::scene::parts::dwelling::{cottage, garage};
use crate::scene::parts::house::House;
use crate::scene::parts::street::lamp;
use crate::scene::parts::vehicle::car;
use crate::scene::parts::{Builder, Frame};
use echoloop_random::Generator;

/// Distance between lamps, metres.
const LAMP_M: f64 = 32.0;
/// Distance from the edge of a road to the border of a garden, metres.
const VERGE_M: f64 = 1.0;

pub(super) fn build(b: &mut Builder, layout: &mut TownLayout, rng: &mut Generator) -> Vec<Plant> {
    let mut plants = Vec::new();
    for k in 0..layout.edges.len() {
        let long = layout.edges[k].length_m();
        let mut along = rng.range(0.0, 4.0);
        while along + 12.0 < long {
            let width = rng.range(16.0, 24.0).min(long - along);
            let edge = layout.edges[k].frame(along + 0.5 * width);
            if rng.chance(0.92) {
                plot(b, layout, &edge, width, &mut plants, rng);
            }
            along += width;
        }
        lamps(b, layout, k, rng);
    }
    layout.wild(&mut plants, rng);
    plants
}

/// Builds one plot, in a frame with x along the road and y away from it.
fn plot(
    b: &mut Builder,
    layout: &mut TownLayout,
    edge: &Frame,
    width: f64,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    let drawn = cottage(width.max(17.0), rng);
    let house = House {
        width_m: drawn.width_m.min(width - 5.0),
        open: if TownLayout::is_rich(b) { drawn.open } else { [true, false, false, false] },
        ..drawn
    };
    let [half, deep] = [0.5 * house.width_m, 0.5 * house.depth_m];
    let middle = VERGE_M + rng.range(4.5, 9.0) + deep;
    let aside = 1.5;
    let (low, high) =
        ([aside - half - 0.6, middle - deep - 0.6], [aside + half + 0.6, middle + deep + 0.6]);
    if !layout.raster.take(edge, low, high) {
        return;
    }
    house.build(b, &layout.frame(edge, [aside, middle], rng.spread(0.05)), rng);
    drive(b, layout, edge, [-0.5 * width + 2.4, middle], rng);
    front_garden(layout, edge, width, middle - deep, plants, rng);
    back_garden(layout, edge, width, middle + deep, plants, rng);
}

/// Places a car in the drive and a garage behind it, as far as there is room.
fn drive(
    b: &mut Builder,
    layout: &mut TownLayout,
    edge: &Frame,
    [x, y]: [f64; 2],
    rng: &mut Generator,
) {
    let spot = layout.frame(edge, [x, rng.range(4.2, 6.0)], FRAC_PI_2 + rng.spread(0.08));
    if rng.chance(0.6) && layout.raster.take(&spot, [-2.7, -1.1], [2.7, 1.1]) {
        car(b, &spot, rng);
    }
    let shelter = layout.frame(edge, [x - 0.2, y + 5.0], 0.0);
    if rng.chance(0.45) && layout.raster.take(&shelter, [-2.0, -2.9], [2.0, 2.9]) {
        garage(rng).build(b, &shelter, rng);
    }
}

fn front_garden(
    layout: &mut TownLayout,
    edge: &Frame,
    width: f64,
    wall: f64,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    // Beside the drive.
    let (start, long) = (-0.5 * width + 4.8, width - 5.4);
    let line = edge.child([start, VERGE_M + 0.5, 0.0], 0.0);
    border(layout, &line, long, plants, rng);
    for _ in 0..3 {
        let at = [rng.range(start + 1.0, 0.5 * width - 1.0), rng.range(VERGE_M + 2.0, wall - 1.0)];
        let [x, y, _] = edge.at([at[0], at[1], 0.0]);
        if layout.raster.take_spot([x, y], 0.9) {
            let foot = layout.stand([x, y]);
            plants.push(match rng.chance(0.35) {
                true => Plant::GardenTree(foot),
                false => Plant::Bush(foot, [rng.range(0.5, 0.9), rng.range(0.8, 1.4)]),
            });
        }
    }
}

fn back_garden(
    layout: &mut TownLayout,
    edge: &Frame,
    width: f64,
    wall: f64,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    let deep = rng.range(9.0, 14.0);
    for side in [-0.5 * width + 0.4, 0.5 * width - 0.4] {
        if rng.chance(0.4) {
            let line = edge.child([side, wall + 1.0, 0.0], FRAC_PI_2);
            border(layout, &line, deep, plants, rng);
        }
    }
    for _ in 0..4 {
        let at = [rng.spread(0.5 * width - 1.5), rng.range(wall + 2.0, wall + deep)];
        let [x, y, _] = edge.at([at[0], at[1], 0.0]);
        if !layout.raster.take_spot([x, y], 1.2) {
            continue;
        }
        let foot = layout.stand([x, y]);
        plants.push(match rng.index(6) {
            0..=2 => Plant::GardenTree(foot),
            3 => Plant::Bench(Frame::new(foot, rng.turn())),
            _ => Plant::Bush(foot, [rng.range(0.6, 1.2), rng.range(0.8, 1.8)]),
        });
    }
}

/// Adds a hedge, a fence or nothing along a line, if it is free.
fn border(
    layout: &mut TownLayout,
    line: &Frame,
    long: f64,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    let (kind, high) = (rng.unit(), rng.range(0.9, 1.5));
    if long < 3.0 || kind > 0.8 || !layout.raster.take(line, [0.0, -0.4], [long, 0.4]) {
        return;
    }
    let [x, y, z] = line.at([0.0; 3]);
    let line = line.child([0.0, 0.0, layout.stand([x, y])[2] - z], 0.0);
    plants.push(match kind < 0.45 {
        true => Plant::Hedge(line, [long, high + 0.3]),
        false => Plant::Fence(line, [long, high]),
    });
}

fn lamps(b: &mut Builder, layout: &mut TownLayout, edge_index: usize, rng: &mut Generator) {
    let walk = layout.edges[edge_index].walk_m;
    let mut along = rng.range(4.0, LAMP_M);
    while along < layout.edges[edge_index].length_m() - 2.0 {
        let edge = layout.edges[edge_index].frame(along);
        let beside = if walk > 1.0 { 0.3 - walk } else { 0.6 };
        lamp(b, &layout.frame(&edge, [0.0, beside], -FRAC_PI_2), 5.5 + rng.unit());
        along += LAMP_M + rng.spread(3.0);
    }
}
