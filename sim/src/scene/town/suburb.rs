//! A suburb: plots along the roads, each with a house, a drive, a garden within a hedge or a fence.

use std::f64::consts::FRAC_PI_2;

use super::layout::{Place, Plant};
use crate::scene::parts::dwelling::{cottage, garage};
use crate::scene::parts::house::House;
use crate::scene::parts::street::lamp;
use crate::scene::parts::vehicle::car;
use crate::scene::parts::{Builder, Frame};
use echoloop_random::Generator;

/// From lamp to lamp, metres.
const LAMP_M: f64 = 32.0;
/// Between a road's edge and a garden's border, metres.
const VERGE_M: f64 = 1.0;

pub(super) fn build(b: &mut Builder, place: &mut Place, rng: &mut Generator) -> Vec<Plant> {
    let mut plants = Vec::new();
    for k in 0..place.fronts.len() {
        let long = place.fronts[k].length_m();
        let mut along = rng.range(0.0, 4.0);
        while along + 12.0 < long {
            let width = rng.range(16.0, 24.0).min(long - along);
            let edge = place.fronts[k].frame(along + 0.5 * width);
            if rng.chance(0.92) {
                plot(b, place, &edge, width, &mut plants, rng);
            }
            along += width;
        }
        lamps(b, place, k, rng);
    }
    place.wild(&mut plants, rng);
    plants
}

/// One plot; its frame's x runs along the road and its y away from it.
fn plot(
    b: &mut Builder,
    place: &mut Place,
    edge: &Frame,
    width: f64,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    let drawn = cottage(width.max(17.0), rng);
    let house = House {
        width_m: drawn.width_m.min(width - 5.0),
        open: if Place::is_rich(b) { drawn.open } else { [true, false, false, false] },
        ..drawn
    };
    let [half, deep] = [0.5 * house.width_m, 0.5 * house.depth_m];
    let middle = VERGE_M + rng.range(4.5, 9.0) + deep;
    let aside = 1.5;
    let (low, high) =
        ([aside - half - 0.6, middle - deep - 0.6], [aside + half + 0.6, middle + deep + 0.6]);
    if !place.site.take(edge, low, high) {
        return;
    }
    house.build(b, &place.frame(edge, [aside, middle], rng.spread(0.05)), rng);
    drive(b, place, edge, [-0.5 * width + 2.4, middle], rng);
    front_garden(place, edge, width, middle - deep, plants, rng);
    back_garden(place, edge, width, middle + deep, plants, rng);
}

/// A car in the drive, a garage behind it.
fn drive(b: &mut Builder, place: &mut Place, edge: &Frame, [x, y]: [f64; 2], rng: &mut Generator) {
    let spot = place.frame(edge, [x, rng.range(4.2, 6.0)], FRAC_PI_2 + rng.spread(0.08));
    if rng.chance(0.6) && place.site.take(&spot, [-2.7, -1.1], [2.7, 1.1]) {
        car(b, &spot, rng);
    }
    let shelter = place.frame(edge, [x - 0.2, y + 5.0], 0.0);
    if rng.chance(0.45) && place.site.take(&shelter, [-2.0, -2.9], [2.0, 2.9]) {
        garage(rng).build(b, &shelter, rng);
    }
}

fn front_garden(
    place: &mut Place,
    edge: &Frame,
    width: f64,
    wall: f64,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    // Beside the drive.
    let (start, long) = (-0.5 * width + 4.8, width - 5.4);
    let line = edge.child([start, VERGE_M + 0.5, 0.0], 0.0);
    border(place, &line, long, plants, rng);
    for _ in 0..3 {
        let at = [rng.range(start + 1.0, 0.5 * width - 1.0), rng.range(VERGE_M + 2.0, wall - 1.0)];
        let [x, y, _] = edge.at([at[0], at[1], 0.0]);
        if place.site.take_spot([x, y], 0.9) {
            let foot = place.stand([x, y]);
            plants.push(match rng.chance(0.35) {
                true => Plant::GardenTree(foot),
                false => Plant::Bush(foot, [rng.range(0.5, 0.9), rng.range(0.8, 1.4)]),
            });
        }
    }
}

fn back_garden(
    place: &mut Place,
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
            border(place, &line, deep, plants, rng);
        }
    }
    for _ in 0..4 {
        let at = [rng.spread(0.5 * width - 1.5), rng.range(wall + 2.0, wall + deep)];
        let [x, y, _] = edge.at([at[0], at[1], 0.0]);
        if !place.site.take_spot([x, y], 1.2) {
            continue;
        }
        let foot = place.stand([x, y]);
        plants.push(match rng.index(6) {
            0..=2 => Plant::GardenTree(foot),
            3 => Plant::Bench(Frame::new(foot, rng.turn())),
            _ => Plant::Bush(foot, [rng.range(0.6, 1.2), rng.range(0.8, 1.8)]),
        });
    }
}

/// A hedge, a fence or nothing along a line, where it is free.
fn border(
    place: &mut Place,
    line: &Frame,
    long: f64,
    plants: &mut Vec<Plant>,
    rng: &mut Generator,
) {
    let (kind, high) = (rng.unit(), rng.range(0.9, 1.5));
    if long < 3.0 || kind > 0.8 || !place.site.take(line, [0.0, -0.4], [long, 0.4]) {
        return;
    }
    let [x, y, z] = line.at([0.0; 3]);
    let line = line.child([0.0, 0.0, place.stand([x, y])[2] - z], 0.0);
    plants.push(match kind < 0.45 {
        true => Plant::Hedge(line, [long, high + 0.3]),
        false => Plant::Fence(line, [long, high]),
    });
}

fn lamps(b: &mut Builder, place: &mut Place, front: usize, rng: &mut Generator) {
    let walk = place.fronts[front].walk_m;
    let mut along = rng.range(4.0, LAMP_M);
    while along < place.fronts[front].length_m() - 2.0 {
        let edge = place.fronts[front].frame(along);
        let beside = if walk > 1.0 { 0.3 - walk } else { 0.6 };
        lamp(b, &place.frame(&edge, [0.0, beside], -FRAC_PI_2), 5.5 + rng.unit());
        along += LAMP_M + rng.spread(3.0);
    }
}
