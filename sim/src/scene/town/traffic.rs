//! Objects on roads: lights and signs, parked vehicles, moving vehicles.

use std::f64::consts::PI;

use super::cover_raster::{Cover, flat};
use super::layout::TownLayout;
use crate::roads::{Lane, LaneKind, RoadNetwork, Sign, SignKind, Waypoint};
use crate::scene::material::Surface;
use crate::scene::mover::{Mover, Placement, STEP_M};
use crate::scene::parts::street::{sign, traffic_light};
use crate::scene::parts::vehicle::car;
use crate::scene::parts::{Builder, Frame, Point};
use echoloop_random::Generator;

/// Distance between parked vehicles, metres.
const SPACE_M: f64 = 6.4;
/// Least width of a lane for parked vehicles, metres.
const BAY_M: f64 = 1.9;
/// Half the length and width of the area that a vehicle occupies, metres; mirrors may reach over a
/// kerb.
const VEHICLE_M: [f64; 2] = [2.9, 0.75];
/// Longest path of a moving vehicle, metres.
const FARTHEST_M: f64 = 20.0;
/// Least distance between the centre lines of two paths, metres: vehicles are 1.8 m wide plus
/// mirrors.
const APART_M: f64 = 2.3;

/// Vehicles, and the points that each passes.
struct Traffic<'a> {
    network: &'a RoadNetwork,
    movers: Vec<Mover>,
    /// Points below every vehicle and along its path, a metre apart.
    passed: Vec<[f64; 2]>,
}

/// Places signs, objects and vehicles; returns the moving vehicles.
pub(super) fn build(
    b: &mut Builder,
    layout: &mut TownLayout,
    network: &RoadNetwork,
    rng: &mut Generator,
) -> Vec<Mover> {
    let mut traffic = Traffic { network, movers: Vec::new(), passed: Vec::new() };
    network.signs.iter().for_each(|sign| put_up(b, layout, sign));
    for prop in network.props.iter().filter(|prop| prop.height_m > 0.0) {
        stand(b, &prop.name, &prop.outline, prop.height_m);
    }
    for (index, lane) in network.lanes.iter().enumerate() {
        let wide = lane.ribs.iter().any(|[l, r]| flat(*l, *r) > BAY_M);
        match lane.kind {
            LaneKind::Parking | LaneKind::Shoulder if wide && !lane.in_junction => {
                traffic.park(b, layout, (index, lane), rng);
            }
            LaneKind::Driving => traffic.drive(b, layout, (index, lane), rng),
            _ => {}
        }
    }
    traffic.movers
}

/// Places a sign at the nearest point off the traffic: CARLA has the feet of some lights on a lane.
fn put_up(b: &mut Builder, layout: &TownLayout, found: &Sign) {
    let [x, y, _] = found.foot;
    // Rings of points around it, the nearest first.
    let around = (0..12).flat_map(|ring| {
        let radius = f64::from(ring);
        (0..8).map(move |k| {
            let turn = PI * f64::from(k) / 4.0;
            [x + radius * libm::cos(turn), y + radius * libm::sin(turn)]
        })
    });
    let mut free =
        around.filter(|at| !matches!(layout.raster.cover(*at), Cover::Driven | Cover::Infill));
    let Some(at) = free.next() else { return };
    let frame = Frame::new(layout.stand(at), found.facing_rad);
    match found.kind {
        SignKind::TrafficLight => traffic_light(b, &frame),
        SignKind::Plate => sign(b, &frame),
    }
}

/// Places an object of the network: speed signs as signs, others as a block on their outline.
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

impl Traffic<'_> {
    /// Parks vehicles along a lane.
    fn park(
        &mut self,
        b: &mut Builder,
        layout: &mut TownLayout,
        (index, lane): (usize, &Lane),
        rng: &mut Generator,
    ) {
        let mut s = lane.span_m[0] + 5.0 + rng.range(0.0, SPACE_M);
        while s < lane.span_m[1] - 6.0 {
            let wide = self.network.width_m(index, s).unwrap_or(0.0);
            if wide > BAY_M && rng.chance(0.6) {
                self.vehicle(b, layout, self.network.waypoint(index, s), 0.0, rng);
            }
            s += SPACE_M + rng.range(0.0, 1.5);
        }
    }

    /// Places moving vehicles on a lane.
    fn drive(
        &mut self,
        b: &mut Builder,
        layout: &mut TownLayout,
        (index, lane): (usize, &Lane),
        rng: &mut Generator,
    ) {
        let mut s = lane.span_m[0] + rng.range(2.0, 90.0);
        while s < lane.span_m[1] {
            if !lane.in_junction || rng.chance(0.3) {
                let (first, at) = (b.mesh.vertices.len(), self.network.waypoint(index, s));
                let aside_m = rng.spread(0.25);
                if let Some(start) = self.vehicle(b, layout, at, aside_m, rng) {
                    let way = self.way(start, (index, s), aside_m);
                    let speed_m_s = rng.range(5.0, 10.0);
                    self.movers.push(Mover {
                        vertices: first..b.mesh.vertices.len(),
                        speed_m_s,
                        way,
                    });
                }
            }
            s += rng.range(25.0, 110.0);
        }
    }

    /// Places a vehicle in a lane, `aside_m` to the left of its middle, if there is room.
    fn vehicle(
        &mut self,
        b: &mut Builder,
        layout: &mut TownLayout,
        at: Option<Waypoint>,
        aside_m: f64,
        rng: &mut Generator,
    ) -> Option<Placement> {
        let at = at?;
        let heading_rad = at.heading_rad + rng.spread(0.02);
        let frame = Frame::new(at.at, heading_rad).child([0.0, aside_m, 0.0], 0.0);
        let [along, across] = VEHICLE_M;
        let is_road = |cover: Cover| matches!(cover, Cover::Driven | Cover::Paved | Cover::Infill);
        let below: Vec<Point> =
            [-2.0, -1.0, 0.0, 1.0, 2.0].map(|x| frame.at([x, 0.0, 0.0])).to_vec();
        if !below.iter().all(|at| self.is_free(*at, self.passed.len()))
            || !layout.raster.take_if(&frame, [-along, -across], [along, across], is_road)
        {
            return None;
        }
        car(b, &frame, rng);
        self.passed.extend(below.iter().map(|[x, y, _]| [*x, *y]));
        Some(Placement { at: frame.at([0.0; 3]), heading_rad })
    }

    /// Path of a vehicle along its lane and those after it, up to the path of another vehicle.
    fn way(&mut self, start: Placement, (lane, s): (usize, f64), aside_m: f64) -> Vec<Placement> {
        let (others, mut way, mut on) = (self.passed.len() - 5, vec![start], (lane, s));
        while (way.len() as f64) * STEP_M <= FARTHEST_M {
            let Some(next) = self.next(on) else { break };
            let frame = Frame::new(next.at, next.heading_rad).child([0.0, aside_m, 0.0], 0.0);
            let nose = frame.at([VEHICLE_M[0], 0.0, 0.0]);
            if !self.is_free(nose, others) {
                break;
            }
            self.passed.push([nose[0], nose[1]]);
            way.push(Placement { at: frame.at([0.0; 3]), heading_rad: next.heading_rad });
            on = (next.lane, next.s_m);
        }
        way
    }

    /// Waypoint one step on, in the lane or in the one that it leads into.
    fn next(&self, (lane, s): (usize, f64)) -> Option<Waypoint> {
        let found = &self.network.lanes[lane];
        let [low, high] = found.span_m;
        let s = if found.id < 0 { s + STEP_M } else { s - STEP_M };
        if (low..high).contains(&s) {
            return self.network.waypoint(lane, s);
        }
        let beyond = if found.id < 0 { s - high } else { low - s };
        let next = *found.successors.first()?;
        let lane = self.network.lanes.get(next)?;
        let [low, high] = lane.span_m;
        let s = if lane.id < 0 { low + beyond } else { high - beyond };
        (low..high).contains(&s).then(|| self.network.waypoint(next, s)).flatten()
    }

    /// True when none of the first `others` points passed by vehicles is near.
    fn is_free(&self, [x, y, _]: Point, others: usize) -> bool {
        let near = |[a, b]: &[f64; 2]| (x - a).powi(2) + (y - b).powi(2) < APART_M * APART_M;
        !self.passed[..others].iter().any(near)
    }
}
