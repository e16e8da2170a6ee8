//! Writer of generated networks as OpenDRIVE 1.4 text, which CARLA and its editors read.
//!
//! Every road is one cubic (`paramPoly3`): a Bézier curve with given directions at its ends.
//! Streets have a driving lane each way. In a crossing one road leads from each arm to every other,
//! and one with only the sidewalk runs round each corner.

use std::f64::consts::PI;
use std::fmt::Write;

use super::profile::{placed, slope_of};
use super::street_plan::{NetworkStyle, Plan, StyleParameters, arm_direction};

/// Point with a heading, radians.
#[derive(Clone, Copy, Debug)]
struct RoadEnd {
    at: [f64; 2],
    heading: f64,
}

impl RoadEnd {
    /// Point moved ahead and to the left, metres.
    fn moved(&self, ahead: f64, left: f64) -> Self {
        Self { at: placed(self.at, self.heading, [ahead, left]), ..*self }
    }

    fn turned(&self) -> Self {
        Self { heading: self.heading + PI, ..*self }
    }
}

/// Cubic from one end to another in the frame of the first: coefficients b, c, d of u and v.
struct CubicPiece {
    from: RoadEnd,
    u: [f64; 3],
    v: [f64; 3],
    length_m: f64,
}

impl CubicPiece {
    fn between(from: RoadEnd, to: RoadEnd) -> Self {
        let away = [to.at[0] - from.at[0], to.at[1] - from.at[1]];
        // Bézier handles of 0.39 chords, as those of a quarter circle.
        let reach = 0.39 * (away[0] * away[0] + away[1] * away[1]).sqrt();
        let (cos, sin) = (libm::cos(from.heading), libm::sin(from.heading));
        let local = |p: [f64; 2]| [cos * p[0] + sin * p[1], cos * p[1] - sin * p[0]];
        let end = local(away);
        let turn = to.heading - from.heading;
        let last = [end[0] - reach * libm::cos(turn), end[1] - reach * libm::sin(turn)];
        // Power form of the Bézier points 0, (reach, 0), last, end.
        let powers =
            |p1: f64, p2: f64, p3: f64| [3.0 * p1, 3.0 * (p2 - 2.0 * p1), p3 - 3.0 * p2 + 3.0 * p1];
        let (u, v) = (powers(reach, last[0], end[0]), powers(0.0, last[1], end[1]));
        let length_m = length(u, v);
        Self { from, u, v, length_m }
    }
}

/// Length of the cubic by Simpson's rule.
fn length(u: [f64; 3], v: [f64; 3]) -> f64 {
    const STEPS: u32 = 128;
    let rate = |k: u32| {
        let p = f64::from(k) / f64::from(STEPS);
        let (du, dv) = (slope_of(u, p), slope_of(v, p));
        (du * du + dv * dv).sqrt()
    };
    let weight = |k: u32| if k == 0 || k == STEPS { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
    (0..=STEPS).map(|k| weight(k) * rate(k)).sum::<f64>() / (3.0 * f64::from(STEPS))
}

/// Lane as written: id, kind, width, mark, and the lanes before and after it.
struct LaneRecord {
    id: i32,
    kind: &'static str,
    width_m: f64,
    mark: &'static str,
    links: [Option<i32>; 2],
}

/// Road as written.
struct Road {
    id: usize,
    junction: Option<usize>,
    /// Attributes of the links at its start and at its end; `None` where it leads nowhere.
    links: [Option<String>; 2],
    cubic: CubicPiece,
    /// Heights of its ends, metres.
    heights_m: [f64; 2],
    lanes: Vec<LaneRecord>,
    middle: &'static str,
    signals: String,
}

/// Text of a generated network, the same on every machine.
#[must_use]
pub fn draw_network(style: NetworkStyle, seed: u64) -> String {
    let (plan, parameters) = (Plan::new(style, seed), style.parameters());
    let mut text = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<OpenDRIVE>\n<header revMajor=\"1\" \
         revMinor=\"4\" name=\"\" version=\"1\" vendor=\"Echoloop\"/>\n",
    );
    for k in 0..plan.streets.len() {
        street(&plan, &parameters, style, k).write(&mut text);
    }
    let mut next = plan.streets.len();
    let mut junctions = String::new();
    for node in 0..plan.nodes.len() {
        if plan.nodes[node].arms.len() < 2 {
            continue;
        }
        let connections = junction_roads(&plan, &parameters, node, &mut next, &mut text);
        let id = junction_id(&plan, node);
        let _ = write!(junctions, "<junction id=\"{id}\" name=\"\">\n{connections}</junction>\n");
    }
    text + &junctions + "</OpenDRIVE>\n"
}

/// Id of a junction, above all ids of roads.
fn junction_id(plan: &Plan, node: usize) -> usize {
    100_000 + plan.streets.len() + node
}

/// End of the centre line of an arm at its crossing, heading out of the crossing.
fn arm_end(plan: &Plan, node: usize, arm: (usize, bool)) -> RoadEnd {
    let middle = RoadEnd { at: plan.nodes[node].at, heading: arm_direction(&plan.streets, arm) };
    middle.moved(plan.nodes[node].radius_m, 0.0)
}

fn street(plan: &Plan, parameters: &StyleParameters, style: NetworkStyle, k: usize) -> Road {
    let ends = plan.streets[k].nodes;
    let first = arm_end(plan, ends[0], (k, true));
    let last = arm_end(plan, ends[1], (k, false)).turned();
    let link = |node: usize| match plan.nodes[node].arms.len() {
        0 | 1 => None,
        _ => Some(format!(r#"elementType="junction" elementId="{}""#, junction_id(plan, node))),
    };
    let lanes = [1, -1].into_iter().flat_map(|side| {
        parameters.lanes.iter().enumerate().map(move |(n, (kind, width_m))| {
            let mark = match (*kind, parameters.lanes.get(n + 1).map(|(kind, _)| *kind)) {
                ("shoulder", Some(_)) => "curb",
                ("driving", _) => "solid",
                _ => "none",
            };
            LaneRecord {
                id: side * (n as i32 + 1),
                kind,
                width_m: *width_m,
                mark,
                links: [None; 2],
            }
        })
    });
    let cubic = CubicPiece::between(first, last);
    let lights = [ends[1], ends[0]].map(|node| plan.nodes[node].arms.len() >= 3);
    let signals = signals(parameters, &cubic, lights, style == NetworkStyle::Grid, k);
    Road {
        id: k,
        junction: None,
        links: ends.map(link),
        cubic,
        heights_m: ends.map(|node| plan.nodes[node].height_m),
        lanes: lanes.collect(),
        middle: "broken",
        signals,
    }
}

/// Signs at each end whose crossing has three arms or more: a light or a plate on the right of the
/// arriving traffic.
fn signals(
    parameters: &StyleParameters,
    cubic: &CubicPiece,
    at: [bool; 2],
    is_light: bool,
    road: usize,
) -> String {
    let mut text = String::new();
    let (name, kind, dynamic) =
        if is_light { ("Light", "1000001", "yes") } else { ("Yield", "205", "no") };
    let side = parameters.paved_m() + 0.8;
    let ends = [(cubic.length_m - 1.0, -side, "+"), (1.0, side, "-")];
    for (n, (s, t, orientation)) in ends.into_iter().enumerate().filter(|(n, _)| at[*n]) {
        let _ = writeln!(
            text,
            "<signal name=\"{name}\" id=\"{}0{n}\" s=\"{s}\" t=\"{t}\" zOffset=\"2.4\" \
             orientation=\"{orientation}\" dynamic=\"{dynamic}\" country=\"OpenDRIVE\" \
             type=\"{kind}\" subtype=\"-1\" value=\"-1\"/>",
            road + 1 // ids are unique in the whole file
        );
    }
    text
}

/// Writes the roads of one crossing; returns the connections of its junction.
fn junction_roads(
    plan: &Plan,
    parameters: &StyleParameters,
    node: usize,
    next: &mut usize,
    text: &mut String,
) -> String {
    let arms = &plan.nodes[node].arms;
    let height_m = plan.nodes[node].height_m;
    let (mut connections, mut turns) = (String::new(), 0);
    let street = |(id, begins): (usize, bool)| {
        let contact = if begins { "start" } else { "end" };
        Some(format!(r#"elementType="road" elementId="{id}" contactPoint="{contact}""#))
    };
    let mut write = |links: [Option<String>; 2], cubic: CubicPiece, lanes: Vec<LaneRecord>| {
        let junction = Some(junction_id(plan, node));
        let (id, heights_m, signals) = (*next, [height_m; 2], String::new());
        Road { id, junction, links, cubic, heights_m, lanes, middle: "none", signals }.write(text);
        *next += 1;
        id
    };
    for (k, &from) in arms.iter().enumerate() {
        for (_, &to) in arms.iter().enumerate().filter(|(n, _)| *n != k) {
            let cubic =
                CubicPiece::between(arm_end(plan, node, from).turned(), arm_end(plan, node, to));
            let links = [incoming(from), -incoming(to)];
            let lane = LaneRecord {
                id: -1,
                kind: "driving",
                width_m: parameters.driven_m(),
                mark: "none",
                links: links.map(Some),
            };
            let road = write([street(from), street(to)], cubic, vec![lane]);
            let _ = writeln!(
                connections,
                "<connection id=\"{turns}\" incomingRoad=\"{}\" connectingRoad=\"{road}\" \
                 contactPoint=\"start\"><laneLink from=\"{}\" to=\"-1\"/></connection>",
                from.0, links[0]
            );
            turns += 1;
        }
        // The sidewalk round the corner from this arm to the next one on its left.
        let to = arms[(k + 1) % arms.len()];
        let edge = parameters.paved_m();
        let cubic = CubicPiece::between(
            arm_end(plan, node, from).moved(0.0, edge).turned(),
            arm_end(plan, node, to).moved(0.0, -edge),
        );
        let lanes =
            parameters.lanes.iter().filter(|(kind, _)| *kind == "shoulder" || *kind == "sidewalk");
        let lanes = lanes.enumerate().map(|(n, (kind, width_m))| LaneRecord {
            id: -1 - n as i32,
            kind,
            width_m: *width_m,
            mark: if n == 0 { "curb" } else { "none" },
            links: [None; 2],
        });
        write([None, None], cubic, lanes.collect());
    }
    connections
}

/// Lane by which traffic enters a crossing from an arm; it leaves by the other.
fn incoming((_, begins): (usize, bool)) -> i32 {
    if begins { 1 } else { -1 }
}

impl Road {
    fn write(&self, text: &mut String) {
        let CubicPiece { from, u, v, length_m } = &self.cubic;
        let junction = self.junction.map_or_else(|| "-1".to_owned(), |id| id.to_string());
        let _ = writeln!(
            text,
            r#"<road name="" length="{length_m}" id="{}" junction="{junction}">"#,
            self.id
        );
        text.push_str("<link>\n");
        for (tag, link) in ["predecessor", "successor"].into_iter().zip(&self.links) {
            let _ = link.as_ref().map(|link| writeln!(text, "<{tag} {link}/>"));
        }
        text.push_str("</link>\n<type s=\"0\" type=\"town\"/>\n<planView>\n");
        let ([x, y], [bu, cu, du], [bv, cv, dv]) = (from.at, u, v);
        let _ = writeln!(
            text,
            "<geometry s=\"0\" x=\"{x}\" y=\"{y}\" hdg=\"{}\" length=\"{length_m}\"><paramPoly3 \
             pRange=\"normalized\" aU=\"0\" bU=\"{bu}\" cU=\"{cu}\" dU=\"{du}\" aV=\"0\" \
             bV=\"{bv}\" cV=\"{cv}\" dV=\"{dv}\"/></geometry>",
            from.heading
        );
        text.push_str("</planView>\n<elevationProfile>\n");
        let [low, high] = self.heights_m;
        // Level at both ends, where the crossings are.
        let (c, d) = (
            3.0 * (high - low) / (length_m * length_m),
            -2.0 * (high - low) / libm::pow(*length_m, 3.0),
        );
        let _ = writeln!(text, r#"<elevation s="0" a="{low}" b="0" c="{c}" d="{d}"/>"#);
        text.push_str("</elevationProfile>\n<lanes>\n<laneSection s=\"0\">\n");
        self.side(text, "left", |id| id > 0);
        let _ = writeln!(
            text,
            "<center><lane id=\"0\" type=\"none\" level=\"false\"><roadMark sOffset=\"0\" \
             type=\"{}\" weight=\"standard\" color=\"standard\" width=\"0.12\" \
             laneChange=\"none\"/></lane></center>",
            self.middle
        );
        self.side(text, "right", |id| id < 0);
        text.push_str("</laneSection>\n</lanes>\n");
        if !self.signals.is_empty() {
            let _ = writeln!(text, "<signals>\n{}</signals>", self.signals);
        }
        text.push_str("</road>\n");
    }

    fn side(&self, text: &mut String, tag: &str, is_on_side: impl Fn(i32) -> bool) {
        let mut lanes: Vec<&LaneRecord> =
            self.lanes.iter().filter(|lane| is_on_side(lane.id)).collect();
        if lanes.is_empty() {
            return;
        }
        lanes.sort_by_key(|lane| -lane.id);
        let _ = writeln!(text, "<{tag}>");
        for LaneRecord { id, kind, width_m, mark, links: [before, after] } in lanes {
            let _ = write!(text, r#"<lane id="{id}" type="{kind}" level="false"><link>"#);
            for (tag, link) in [("predecessor", before), ("successor", after)] {
                let _ = link.map(|link| write!(text, r#"<{tag} id="{link}"/>"#));
            }
            let _ = writeln!(
                text,
                "</link><width sOffset=\"0\" a=\"{width_m}\" b=\"0\" c=\"0\" d=\"0\"/><roadMark \
                 sOffset=\"0\" type=\"{mark}\" weight=\"standard\" color=\"standard\" \
                 width=\"0.12\" laneChange=\"none\"/></lane>"
            );
        }
        let _ = writeln!(text, "</{tag}>");
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LaneKind, RoadNetwork};
    use super::*;

    const STYLES: [NetworkStyle; 3] =
        [NetworkStyle::Grid, NetworkStyle::Suburb, NetworkStyle::Hillside];

    #[test]
    fn a_generated_network_is_read_without_a_remark() {
        for style in STYLES {
            for seed in 0..5 {
                let network = RoadNetwork::parse("ours", &draw_network(style, seed)).expect("ours");
                assert_eq!(network.remarks, [""; 0], "{style:?} {seed}");
                assert!(network.length_m > 1500.0, "{style:?} {seed}: {}", network.length_m);
            }
        }
        let [once, again] = [3, 4].map(|seed| draw_network(NetworkStyle::Grid, seed));
        assert_eq!(draw_network(NetworkStyle::Grid, 3), once);
        assert_ne!(once, again);
    }

    #[test]
    fn every_lane_leads_into_lanes_that_begin_where_it_ends() {
        for style in STYLES {
            let network = RoadNetwork::parse("ours", &draw_network(style, 1)).expect("ours");
            let mut checked = 0;
            for lane in network.lanes.iter().filter(|lane| lane.kind == LaneKind::Driving) {
                assert!(!lane.in_junction || lane.successors.len() == 1, "{lane:?}");
                let end = if lane.id < 0 { lane.ribs.last() } else { lane.ribs.first() };
                for next in &lane.successors {
                    let next = &network.lanes[*next];
                    let start = if next.id < 0 { next.ribs.first() } else { next.ribs.last() };
                    let middle = |rib: Option<&[[f64; 3]; 2]>| {
                        let [a, b] = *rib.expect("two ribs");
                        [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]))
                    };
                    let (end, start) = (middle(end), middle(start));
                    let gap = (0..3).map(|i| (end[i] - start[i]).powi(2)).sum::<f64>().sqrt();
                    assert!(gap < 0.02, "{style:?}: {gap} m from {} to {}", lane.road, next.road);
                    checked += 1;
                }
            }
            assert!(checked > 60, "{style:?}: {checked}");
        }
    }
}
