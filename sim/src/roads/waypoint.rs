//! Waypoints on driving lanes and links between lanes, as in CARLA's map.

use std::f64::consts::{PI, TAU};

use super::network::{Lane, LaneKind, RoadNetwork};

/// Distance of the first waypoint from the end of a lane, metres: the end itself belongs to the
/// next lane.
const INSET_M: f64 = 1e-9;

/// Point in the middle of a driving lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoint {
    /// Index into [`RoadNetwork::lanes`].
    pub lane: usize,
    /// Distance along the reference line of the road, metres.
    pub s_m: f64,
    /// Position, metres, right-handed.
    pub at: [f64; 3],
    /// Heading of the traffic, radians counter-clockwise from x, 0 to 2π.
    pub heading_rad: f64,
    /// Rise along that heading, metres per metre.
    pub rise: f64,
    /// Width of the lane, metres.
    pub width_m: f64,
}

impl RoadNetwork {
    /// Waypoints of every driving lane, every `step_m` metres of reference line from the start of
    /// the road: CARLA's `generate_waypoints`.
    #[must_use]
    pub fn waypoints(&self, step_m: f64) -> Vec<Waypoint> {
        let indices = 0..self.lanes.len();
        let driven = indices.filter(|&k| self.lanes[k].kind == LaneKind::Driving);
        driven.flat_map(|k| self.along(k, step_m)).collect()
    }

    fn along(&self, index: usize, step_m: f64) -> Vec<Waypoint> {
        let lane = &self.lanes[index];
        let profile = &self.profiles[lane.profile];
        let step_m = step_m.max(0.01);
        // Candidates around the section; the exact s decides which lie in it.
        let [first, last] = lane.span_m;
        let first = if lane.section == 0 { 0.0 } else { first };
        let near = (first / step_m - 1.0) as usize..(last / step_m + 2.0) as usize;
        near.map(|k| k as f64 * step_m + INSET_M)
            .filter(|s| *s < profile.length_m && profile.section_at(*s) == lane.section)
            .filter_map(|s| self.waypoint(index, s))
            .collect()
    }

    /// Waypoint of a lane at `s`; `None` beyond its ends.
    #[must_use]
    pub fn waypoint(&self, index: usize, s: f64) -> Option<Waypoint> {
        let lane = self.lanes.get(index)?;
        let profile = &self.profiles[lane.profile];
        let along = profile.heading(s) + profile.drift(lane.section, lane.id, s);
        let (turned, sign) = if lane.id > 0 { (along + PI, -1.0) } else { (along, 1.0) };
        Some(Waypoint {
            lane: index,
            s_m: s,
            at: self.point(index, s, 0.0)?,
            heading_rad: turned.rem_euclid(TAU),
            rise: sign * profile.rise(s),
            width_m: self.width_m(index, s)?,
        })
    }

    /// Waypoint at which traffic enters a lane.
    #[must_use]
    pub fn entry(&self, index: usize) -> Option<Waypoint> {
        let lane = self.lanes.get(index)?;
        self.waypoint(index, entry_s(lane))
    }

    /// Pairs of entries: of every driving lane, and of each lane that it leads into. CARLA's
    /// `get_topology`.
    #[must_use]
    pub fn topology(&self) -> Vec<[Waypoint; 2]> {
        let lanes = self.lanes.iter().enumerate();
        let driven = lanes.filter(|(_, lane)| lane.kind == LaneKind::Driving);
        let pairs =
            driven.flat_map(|(from, lane)| lane.successors.iter().map(move |to| (from, *to)));
        pairs.filter_map(|(from, to)| Some([self.entry(from)?, self.entry(to)?])).collect()
    }
}

/// s at which traffic enters a lane: the start of the road for right lanes, its end for left ones.
fn entry_s(lane: &Lane) -> f64 {
    let [first, last] = lane.span_m;
    if lane.id < 0 { first + INSET_M.min(last - first) } else { (last - INSET_M).max(first) }
}
