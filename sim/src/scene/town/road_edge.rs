//! Outer edges of roads, along which a town is built.

use std::collections::BTreeMap;

use super::cover_raster::flat;
use crate::roads::{Lane, LaneKind, RoadNetwork};
use crate::scene::parts::{Frame, Point};
use crate::vector::mix;

/// Edge of one side of a road outside crossings.
pub(super) struct RoadEdge {
    points: Vec<Point>,
    /// Distance of each point along the edge, metres.
    along_m: Vec<f64>,
    /// 1 on the left in the order of the points, −1 on the right.
    side: f64,
    /// Width of the sidewalk at the edge, metres; 0 without one.
    pub(super) walk_m: f64,
}

impl RoadEdge {
    /// Both edges of every road that is not part of a crossing.
    pub(super) fn all(network: &RoadNetwork) -> Vec<Self> {
        let mut roads: BTreeMap<&str, Vec<&Lane>> = BTreeMap::new();
        for lane in network.lanes.iter().filter(|lane| !lane.in_junction) {
            roads.entry(&lane.road).or_default().push(lane);
        }
        let both = roads.values().flat_map(|lanes| [1, -1].map(|side| Self::new(lanes, side)));
        both.flatten().collect()
    }

    fn new(lanes: &[&Lane], side: i32) -> Option<Self> {
        let mut by_section: BTreeMap<usize, Vec<&Lane>> = BTreeMap::new();
        for lane in lanes {
            by_section.entry(lane.section).or_default().push(lane);
        }
        let (mut points, mut walk_m) = (Vec::new(), 0.0_f64);
        for section in by_section.values() {
            // The outermost lane on this side, else the innermost of the other side.
            let outmost = section.iter().max_by_key(|lane| side * lane.id)?;
            points.extend(outmost.ribs.iter().map(|rib| rib[usize::from(side < 0)]));
            if outmost.kind == LaneKind::Sidewalk && outmost.id * side > 0 {
                let wide = outmost.ribs.iter().map(|[l, r]| flat(*l, *r)).fold(0.0, f64::max);
                walk_m = walk_m.max(wide);
            }
        }
        points.dedup_by(|a, b| flat(*a, *b) < 0.05);
        let mut along_m = vec![0.0];
        for pair in points.windows(2) {
            along_m.push(along_m[along_m.len() - 1] + flat(pair[0], pair[1]));
        }
        (points.len() > 1).then(|| Self { points, along_m, side: f64::from(side), walk_m })
    }

    pub(super) fn length_m(&self) -> f64 {
        self.along_m.last().copied().unwrap_or(0.0)
    }

    /// Frame on the edge at a distance along it: x along the road, y away from it, z of the road.
    pub(super) fn frame(&self, along_m: f64) -> Frame {
        let k = self.along_m.partition_point(|a| *a < along_m).clamp(1, self.points.len() - 1);
        let (p, q) = (self.points[k - 1], self.points[k]);
        let long = (self.along_m[k] - self.along_m[k - 1]).max(1e-9);
        let t = (along_m - self.along_m[k - 1]) / long;
        let at = mix(p, q, t);
        let ahead = [(q[0] - p[0]) / long, (q[1] - p[1]) / long];
        let out = [-self.side * ahead[1], self.side * ahead[0]];
        Frame::new(at, libm::atan2(-out[0], out[1]))
    }
}
