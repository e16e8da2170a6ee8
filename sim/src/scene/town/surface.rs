//! Surfaces of roads: lanes, kerbs, sides, paint.

use super::cover_raster::{Cover, CoverRaster, KERB_M, flat, pieces};
use crate::roads::{Lane, LaneKind, Prop, RoadNetwork};
use crate::scene::material::Surface;
use crate::scene::parts::{Builder, Point, add};
use crate::vector::mix;

/// Height of paint above its road, metres.
const PAINT_M: f64 = 0.004;
/// Distance beyond an edge at which the neighbouring cover is looked up, metres.
const BEYOND_M: f64 = 0.4;
/// Height of the sides of a road, metres.
const SIDE_M: f64 = 0.4;
/// Width below which a piece of a lane is left out, metres.
const MIN_WIDTH_M: f64 = 0.02;

pub(super) fn build(b: &mut Builder, network: &RoadNetwork, raster: &CoverRaster) {
    network.lanes.iter().for_each(|lane| lay(b, lane, raster));
    for stripe in &network.paint {
        b.quad(stripe.map(|p| add(p, [0.0, 0.0, PAINT_M])), Surface::RoadPaint);
    }
    network.props.iter().filter(|prop| prop.height_m == 0.0).for_each(|prop| paint(b, prop));
}

fn surface(kind: LaneKind) -> Surface {
    match kind {
        LaneKind::Sidewalk => Surface::Paving,
        LaneKind::Median => Surface::Grass,
        LaneKind::Rail | LaneKind::Verge => Surface::Gravel,
        _ => Surface::Asphalt,
    }
}

fn lay(b: &mut Builder, lane: &Lane, raster: &CoverRaster) {
    let cover = Cover::of(lane.kind);
    let up = if cover == Cover::Raised { KERB_M } else { 0.0 };
    let pieces = pieces(lane);
    for (k, piece) in pieces.iter().enumerate() {
        let [l0, r0, r1, l1] = piece.map(|p| add(p, [0.0, 0.0, up]));
        let middle = mix(mix(l0, r0, 0.5), mix(l1, r1, 0.5), 0.5);
        // In a crossing roads overlap: driving lanes hide sidewalks.
        let hidden = cover == Cover::Raised && raster.cover([middle[0], middle[1]]) != cover;
        if hidden || flat(l0, r0).max(flat(l1, r1)) < MIN_WIDTH_M {
            continue;
        }
        b.quad([l0, r0, r1, l1], surface(lane.kind));
        let mut edges = vec![[l0, l1], [r0, r1]];
        edges.extend((k == 0).then_some([l0, r0]));
        edges.extend((k + 1 == pieces.len()).then_some([l1, r1]));
        for edge in edges {
            side(b, edge, middle, cover, raster);
        }
    }
}

/// Builds the side of a piece along an edge, where the neighbouring cover is lower.
fn side(b: &mut Builder, [p, q]: [Point; 2], middle: Point, cover: Cover, raster: &CoverRaster) {
    let half = mix(p, q, 0.5);
    let away = flat(middle, half).max(1e-6);
    let out = |i: usize| half[i] + (half[i] - middle[i]) / away * BEYOND_M;
    let beyond = raster.cover([out(0), out(1)]);
    let (down, surface) = match (cover, beyond) {
        (Cover::Raised, Cover::Raised) => return,
        (Cover::Raised, Cover::Driven | Cover::Paved) => (KERB_M + 0.05, Surface::Stone),
        (_, Cover::Open) => (SIDE_M, Surface::Concrete),
        _ => return,
    };
    let low = |p: Point| add(p, [0.0, 0.0, -down]);
    b.quad([p, q, low(q), low(p)], surface);
}

/// Paints crosswalks and areas as bars across their longer side, other marks as one stripe.
fn paint(b: &mut Builder, prop: &Prop) {
    let name = prop.name.to_ascii_lowercase();
    let is_barred = ["crosswalk", "region"].iter().any(|word| name.contains(word));
    let corners: Vec<Point> = prop.outline.iter().map(|p| add(*p, [0.0, 0.0, PAINT_M])).collect();
    let Some([a, b0, c, d]) = box_of(&corners) else { return };
    if !is_barred {
        // Paint covers about a third of the box of a stencil.
        let slim = |p: Point, q: Point, t: f64| mix(p, q, t);
        let (a, b0, c, d) = if flat(a, d) > 0.8 {
            (slim(a, d, 0.33), slim(b0, c, 0.33), slim(b0, c, 0.67), slim(a, d, 0.67))
        } else {
            (a, b0, c, d)
        };
        return b.quad([a, b0, c, d], Surface::RoadPaint);
    }
    let bars = (flat(a, b0) / 1.0).round().max(1.0);
    for k in 0..bars as usize {
        let [from, to] = [0.2, 0.7].map(|t| (k as f64 + t) / bars);
        let bar = [mix(a, b0, from), mix(a, b0, to), mix(d, c, to), mix(d, c, from)];
        b.quad(bar, Surface::RoadPaint);
    }
}

/// Bounding box of an outline along its longest edge; its first side is the longer.
fn box_of(corners: &[Point]) -> Option<[Point; 4]> {
    let edge = |k: usize| (corners[k], corners[(k + 1) % corners.len()]);
    let longest = (0..corners.len()).max_by(|i, j| {
        let long = |k: usize| flat(edge(k).0, edge(k).1);
        long(*i).total_cmp(&long(*j))
    })?;
    let (p, q) = edge(longest);
    let long = flat(p, q);
    if long < 1e-3 {
        return None;
    }
    let along = [0, 1].map(|i| (q[i] - p[i]) / long);
    let local = |c: &Point| {
        let d = [c[0] - p[0], c[1] - p[1]];
        [along[0] * d[0] + along[1] * d[1], along[0] * d[1] - along[1] * d[0]]
    };
    let start = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let (low, high) = corners.iter().map(local).fold(start, |(low, high), c| {
        ([0, 1].map(|i| low[i].min(c[i])), [0, 1].map(|i| high[i].max(c[i])))
    });
    let z = corners.iter().map(|c| c[2]).fold(f64::NEG_INFINITY, f64::max);
    let at = |u: f64, v: f64| {
        [p[0] + along[0] * u - along[1] * v, p[1] + along[1] * u + along[0] * v, z]
    };
    let round =
        [at(low[0], low[1]), at(high[0], low[1]), at(high[0], high[1]), at(low[0], high[1])];
    let [a, b, c, d] = round;
    Some(if flat(a, b) >= flat(a, d) { round } else { [b, c, d, a] })
}
