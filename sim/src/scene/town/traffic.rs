//! What the roads carry: lights and signs, parked vehicles, vehicles on their way.

use std::f64::consts::PI;

use super::place::Place;
use super::site::Cover;
use crate::roads::{Lane, LaneKind, RoadNetwork, Sign, SignKind, Waypoint};
use crate::scene::material::Surface;
use crate::scene::parts::street::{sign, traffic_light};
use crate::scene::parts::vehicle::car;
use crate::scene::parts::{Builder, Frame, Point};
use echoloop_random::Generator;

/// From parked vehicle to parked vehicle, metres.
const SPACE_M: f64 = 6.4;
/// A lane this wide has room for parked vehicles, metres.
const BAY_M: f64 = 1.9;
/// Half the length and width of the room a vehicle takes, metres; mirrors may reach over a kerb.
const VEHICLE_M: [f64; 2] = [2.9, 0.75];

pub(super) fn build(
    b: &mut Builder,
    place: &mut Place,
    network: &RoadNetwork,
    rng: &mut Generator,
) {
    network.signs().iter().for_each(|sign| put_up(b, place, sign));
    for prop in network.props().iter().filter(|prop| prop.height_m > 0.0) {
        stand(b, &prop.name, &prop.outline, prop.height_m);
    }
    for (index, lane) in network.lanes().iter().enumerate() {
        let wide = lane.ribs.iter().any(|[l, r]| super::site::flat(*l, *r) > BAY_M);
        match lane.kind {
            LaneKind::Parking | LaneKind::Shoulder if wide && !lane.in_junction => {
                park(b, place, network, (index, lane), rng);
            }
            LaneKind::Driving => drive(b, place, network, (index, lane), rng),
            _ => {}
        }
    }
}

/// Where traffic does not go: CARLA has the feet of some lights on a lane.
fn put_up(b: &mut Builder, place: &Place, found: &Sign) {
    let [x, y, _] = found.foot;
    // Rings of places, the nearest first.
    let around = (0..12).flat_map(|ring| {
        let radius = f64::from(ring);
        (0..8).map(move |k| {
            let turn = PI * f64::from(k) / 4.0;
            [x + radius * libm::cos(turn), y + radius * libm::sin(turn)]
        })
    });
    let mut free =
        around.filter(|at| !matches!(place.site.cover(*at), Cover::Driven | Cover::Infill));
    let Some(at) = free.next() else { return };
    let frame = Frame::new(place.stand(at), found.facing_rad);
    match found.kind {
        SignKind::TrafficLight => traffic_light(b, &frame),
        SignKind::Plate => sign(b, &frame),
    }
}

/// An object of the network: a sign by its name, otherwise a block of its outline.
fn stand(b: &mut Builder, name: &str, outline: &[Point], height_m: f64) {
    let (a, c) = (outline[0], outline[outline.len() / 2]);
    let middle: Point = std::array::from_fn(|i| 0.5 * (a[i] + c[i]));
    let ahead = libm::atan2(outline[1][1] - a[1], outline[1][0] - a[0]);
    if name.to_ascii_lowercase().starts_with("speed") {
        return sign(b, &Frame::new([middle[0], middle[1], a[2]], ahead));
    }
    let up = |p: Point| [p[0], p[1], p[2] + height_m];
    for k in 0..outline.len() {
        let (p, q) = (outline[k], outline[(k + 1) % outline.len()]);
        b.quad([p, q, up(q), up(p)], Surface::Metal);
        b.triangle([up(p), up(q), up(middle)], Surface::Metal);
    }
}

fn park(
    b: &mut Builder,
    place: &mut Place,
    network: &RoadNetwork,
    (index, lane): (usize, &Lane),
    rng: &mut Generator,
) {
    let mut s = lane.span_m[0] + 5.0 + rng.range(0.0, SPACE_M);
    while s < lane.span_m[1] - 6.0 {
        let wide = network.width_m(index, s).unwrap_or(0.0);
        if wide > BAY_M && rng.chance(0.6) {
            vehicle(b, place, network.waypoint(index, s), 0.0, rng);
        }
        s += SPACE_M + rng.range(0.0, 1.5);
    }
}

fn drive(
    b: &mut Builder,
    place: &mut Place,
    network: &RoadNetwork,
    (index, lane): (usize, &Lane),
    rng: &mut Generator,
) {
    let mut s = lane.span_m[0] + rng.range(2.0, 90.0);
    while s < lane.span_m[1] {
        if !lane.in_junction || rng.chance(0.3) {
            vehicle(b, place, network.waypoint(index, s), rng.spread(0.25), rng);
        }
        s += rng.range(25.0, 110.0);
    }
}

/// A vehicle in a lane, so far to the left of its middle, if there is room.
fn vehicle(
    b: &mut Builder,
    place: &mut Place,
    at: Option<Waypoint>,
    aside_m: f64,
    rng: &mut Generator,
) {
    let Some(at) = at else { return };
    let frame =
        Frame::new(at.at, at.heading_rad + rng.spread(0.02)).child([0.0, aside_m, 0.0], 0.0);
    let [along, across] = VEHICLE_M;
    let is_road = |cover: Cover| matches!(cover, Cover::Driven | Cover::Paved | Cover::Infill);
    if place.site.take_if(&frame, [-along, -across], [along, across], is_road) {
        car(b, &frame, rng);
    }
}
