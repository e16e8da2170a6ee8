//! Road network: the surfaces of its lanes, paint, signs and objects.

use std::collections::HashMap;
use std::path::Path;

use echoloop_files::{one_line, read_data};
use xodr::{Extent, LaneType, Layer, Shape, Warning};

use super::fault::{RoadsError, of_road};
use super::opendrive_records;
use super::profile::{Profile, placed};

/// Largest distance from the origin, metres: there 32-bit points are rounded to 2 mm.
const MAX_REACH_M: f64 = 50_000.0;

/// Use of a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LaneKind {
    /// Traffic. Only driving lanes have waypoints, as in CARLA.
    Driving,
    /// Restricted traffic: buses, bicycles, ramps.
    Traffic,
    /// Parked cars.
    Parking,
    /// Paved, but not driven on: shoulders, kerbs, closed lanes.
    Shoulder,
    /// Pedestrians.
    Sidewalk,
    /// Strip between carriageways.
    Median,
    /// Rails.
    Rail,
    /// Part of a road without a use, or with an unknown one.
    Verge,
}

impl LaneKind {
    /// All kinds, with their names in tables.
    pub const NAMED: [(Self, &'static str); 8] = [
        (Self::Driving, "driving"),
        (Self::Traffic, "other traffic"),
        (Self::Parking, "parking"),
        (Self::Shoulder, "shoulder"),
        (Self::Sidewalk, "sidewalk"),
        (Self::Median, "median"),
        (Self::Rail, "rail"),
        (Self::Verge, "verge"),
    ];

    fn of(kind: LaneType) -> Self {
        use LaneType as L;
        match kind {
            L::Driving => Self::Driving,
            L::Parking => Self::Parking,
            L::Stop | L::Restricted | L::Shoulder | L::Border | L::Curb | L::RoadWorks => {
                Self::Shoulder
            }
            L::Sidewalk => Self::Sidewalk,
            L::Median => Self::Median,
            L::Tram | L::Rail => Self::Rail,
            L::None | L::Special1 | L::Special2 | L::Special3 | L::Unknown => Self::Verge,
            _ => Self::Traffic,
        }
    }
}

/// One lane of one section of a road.
#[derive(Clone, Debug, PartialEq)]
pub struct Lane {
    /// Id of its road.
    pub road: String,
    /// Index of the lane section within the road, in order of s.
    pub section: usize,
    /// Id in OpenDRIVE: negative on the right of the reference line, positive on the left.
    pub id: i32,
    /// Use of the lane.
    pub kind: LaneKind,
    /// True for a road within a junction.
    pub in_junction: bool,
    /// Left and right border of its surface, seen along the road; two points or more, metres.
    pub ribs: Vec<[[f64; 3]; 2]>,
    /// Lanes that its traffic may continue on, as indices into [`RoadNetwork::lanes`].
    pub successors: Vec<usize>,
    /// First and last s along the road's reference line, metres.
    pub span_m: [f64; 2],
    /// Id in the crate `xodr`.
    pub(super) key: xodr::LaneId,
    /// Index of its road's profile.
    pub(super) profile: usize,
}

/// Kind of a sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignKind {
    /// A traffic light.
    TrafficLight,
    /// A plate.
    Plate,
}

/// A traffic light or sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sign {
    /// Kind of the sign.
    pub kind: SignKind,
    /// Point below its plate, on the surface of the road or beside it, metres.
    pub foot: [f64; 3],
    /// Direction it faces, radians counter-clockwise from x.
    pub facing_rad: f64,
}

/// Object that stands on the network or is painted on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Prop {
    /// Name, or kind where it has none.
    pub name: String,
    /// Outline of its base, metres; three corners or more.
    pub outline: Vec<[f64; 3]>,
    /// Height, metres; 0 for paint.
    pub height_m: f64,
}

/// Lanes, paint, signs and objects of a road network. See [`crate::roads`].
#[derive(Clone, Debug)]
pub struct RoadNetwork {
    /// Name: that of the file without its extension.
    pub name: String,
    /// All lanes, of every kind.
    pub lanes: Vec<Lane>,
    /// Painted stripes, four corners each, metres.
    pub paint: Vec<[[f64; 3]; 4]>,
    /// Traffic lights and signs.
    pub signs: Vec<Sign>,
    /// Objects.
    pub props: Vec<Prop>,
    /// Remarks on harmless faults of the file and on items left out: a link that leads nowhere, an
    /// object without a position.
    pub remarks: Vec<String>,
    /// Length of all roads, metres.
    pub length_m: f64,
    pub(super) source: xodr::RoadNetwork,
    pub(super) profiles: Vec<Profile>,
}

/// Reads an OpenDRIVE file.
///
/// # Errors
///
/// [`RoadsError`], which names the file, and the road where one is at fault.
pub fn load_network(path: &Path) -> Result<RoadNetwork, RoadsError> {
    let bytes =
        read_data(path).map_err(|source| RoadsError::Unreadable { path: path.into(), source })?;
    parse_network(path, &bytes)
}

/// As [`load_network`], from the bytes of a file; `path` gives the name.
///
/// # Errors
///
/// As for [`load_network`].
pub fn parse_network(path: &Path, bytes: &[u8]) -> Result<RoadNetwork, RoadsError> {
    let name = path.file_stem().map_or_else(String::new, |stem| one_line(&stem.to_string_lossy()));
    let text = std::str::from_utf8(bytes).map_err(|error| format!("it is not UTF-8 text: {error}"));
    text.and_then(|text| RoadNetwork::parse(&name, text))
        .map_err(|fault| RoadsError::Malformed { path: path.into(), fault })
}

impl RoadNetwork {
    /// Builds a network from the text of an OpenDRIVE file.
    ///
    /// # Errors
    ///
    /// The fault of the text, and its place.
    pub fn parse(name: &str, text: &str) -> Result<Self, String> {
        let (profiles, mut remarks) = opendrive_records::profiles(text)?;
        let (source, found) =
            xodr::load_str_with_provenance(text).map_err(|error| one_line(&error.to_string()))?;
        for warning in found.warnings.iter().filter(|warning| !warning.is_ignored()) {
            let what = one_line(&warning.to_string());
            match breaks_a_road(warning) {
                true => return Err(of_road(warning.road_id(), what)),
                false => remarks.push(what),
            }
        }
        let lanes = lanes(&source, &profiles)?;
        let length_m = profiles.iter().map(|profile| profile.length_m).sum();
        let network = Self {
            name: name.to_owned(),
            lanes,
            paint: paint(&source),
            signs: source.signals().iter().map(sign).collect(),
            props: source.objects().iter().filter_map(prop).collect(),
            remarks,
            length_m,
            source,
            profiles,
        };
        network.check_reach(MAX_REACH_M)?;
        Ok(network)
    }

    /// Refuses a network that reaches farther than `most_m` from its origin.
    ///
    /// # Errors
    ///
    /// The first lane that does.
    pub fn check_reach(&self, most_m: f64) -> Result<(), String> {
        self.lanes.iter().try_for_each(|lane| {
            let numbers = lane.ribs.as_flattened().as_flattened().iter();
            let reach_m = numbers.fold(0.0, |most: f64, x| most.max(x.abs()));
            match reach_m <= most_m {
                true => Ok(()),
                false => Err(format!(
                    "road {} reaches {reach_m:.0} m from the origin, more than {most_m:.0} m: is \
                     its origin near?",
                    one_line(&lane.road)
                )),
            }
        })
    }

    /// Number of roads.
    #[must_use]
    pub fn roads(&self) -> usize {
        self.profiles.len()
    }

    /// Smallest and largest (x, y) of all lanes, metres.
    #[must_use]
    pub fn bounds(&self) -> ([f64; 2], [f64; 2]) {
        let points = self.lanes.iter().flat_map(|lane| lane.ribs.iter().flatten());
        let start = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        points.fold(start, |(low, high), p| {
            ([0, 1].map(|i| low[i].min(p[i])), [0, 1].map(|i| high[i].max(p[i])))
        })
    }

    /// Point on a lane: `s` along its road, `across_m` to the left of the middle of the lane,
    /// metres; `None` beyond the ends of the lane.
    #[must_use]
    pub fn point(&self, lane: usize, s: f64, across_m: f64) -> Option<[f64; 3]> {
        let lane = xodr::LanePosition { lane: self.lanes.get(lane)?.key, s, offset: across_m };
        self.source.lane_point(lane).map(rounded)
    }

    /// Width of a lane at `s`, metres.
    #[must_use]
    pub fn width_m(&self, lane: usize, s: f64) -> Option<f64> {
        let key = self.lanes.get(lane)?.key;
        let along = self.source.centerline_s(xodr::LanePosition { lane: key, s, offset: 0.0 })?;
        Some(f64::from(self.source.lane(key)?.width_at(along)))
    }
}

/// Point rounded to 2⁻¹² m: see [`crate::roads`].
fn rounded(p: xodr::Point) -> [f64; 3] {
    const STEPS: f64 = 4096.0;
    [p.x, p.y, p.z].map(|x| (f64::from(x) * STEPS).round() / STEPS)
}

/// True when a warning means that a road or a part of its surface would be missing or wrong. The
/// others concern links, marks, signs, objects and pieces without length; gaps in the reference
/// line are checked before.
fn breaks_a_road(warning: &Warning) -> bool {
    matches!(
        warning,
        Warning::RoadSkipped { .. }
            | Warning::LaneIdUnreadable { .. }
            | Warning::LaneIdRepeated { .. }
            | Warning::LaneOnWrongSide { .. }
            | Warning::LaneDropped { .. }
            | Warning::RecordDropped { .. }
            | Warning::RecordValueUnreadable { .. }
    )
}

fn lanes(source: &xodr::RoadNetwork, profiles: &[Profile]) -> Result<Vec<Lane>, String> {
    let by_id: HashMap<&str, usize> =
        profiles.iter().enumerate().map(|(k, profile)| (profile.id.as_str(), k)).collect();
    let mesh = source.surface_mesh();
    let mut lanes = Vec::with_capacity(mesh.lanes.len());
    for span in &mesh.lanes {
        let (Some(lane), Some(on)) = (source.lane(span.lane), source.road_lane(span.lane)) else {
            continue;
        };
        let Some(road) = source.road(on.road) else { continue };
        let Some(&profile) = by_id.get(road.od_id()) else { continue };
        let corners = &mesh.vertices[span.vertices.start as usize..span.vertices.end as usize];
        let ribs: Vec<_> =
            corners.chunks_exact(2).map(|pair| [rounded(pair[0]), rounded(pair[1])]).collect();
        lanes.push(Lane {
            road: road.od_id().to_owned(),
            section: on.section,
            id: on.od_id,
            kind: if lane.layer == Layer::Permanent { LaneKind::of(lane.kind) } else { continue },
            in_junction: profiles[profile].in_junction,
            ribs,
            successors: Vec::new(),
            span_m: profiles[profile].span(on.section),
            key: span.lane,
            profile,
        });
    }
    link(source, &mut lanes);
    match lanes.is_empty() {
        true => Err("none of its roads has a lane".into()),
        false => Ok(lanes),
    }
}

fn link(source: &xodr::RoadNetwork, lanes: &mut [Lane]) {
    let index: HashMap<xodr::LaneId, usize> =
        lanes.iter().enumerate().map(|(k, lane)| (lane.key, k)).collect();
    for lane in lanes {
        let next = source.successors(lane.key).filter_map(|next| index.get(&next.id).copied());
        lane.successors = next.collect();
    }
}

fn paint(source: &xodr::RoadNetwork) -> Vec<[[f64; 3]; 4]> {
    let lines = source.road_marks().iter().flat_map(|mark| &mark.lines);
    lines.flat_map(|line| line.pieces.iter().map(|piece| piece.map(rounded))).collect()
}

fn sign(signal: &xodr::Signal) -> Sign {
    let [x, y, _] = rounded(signal.position);
    // The plate may hang high or, in CARLA's files, below the road, so the surface counts.
    let surface = signal.applies_at.first().map_or(signal.position.z, |p| p.z);
    Sign {
        kind: if signal.dynamic { SignKind::TrafficLight } else { SignKind::Plate },
        foot: [x, y, f64::from(surface)],
        facing_rad: f64::from(signal.heading),
    }
}

fn prop(object: &xodr::Object) -> Option<Prop> {
    let name = if object.name.is_empty() { object.kind.as_str() } else { &object.name };
    let (outline, height_m): (Vec<[f64; 3]>, f64) = match &object.shape {
        Shape::Outline { corners, closed: true, .. } => {
            let rise = |corner: &xodr::Corner| f64::from(corner.top.z - corner.base.z);
            let height_m = corners.iter().map(rise).fold(0.0, f64::max);
            (corners.iter().map(|corner| rounded(corner.base)).collect(), height_m)
        }
        Shape::Solid { position, heading, extent: Some(extent), .. } => {
            let (sides, height) = match extent {
                Extent::Box { length, width, height } => ([*length, *width], height),
                Extent::Cylinder { radius, height } => ([2.0 * radius; 2], height),
                _ => return None,
            };
            (foot(rounded(*position), f64::from(*heading), sides), f64::from(*height))
        }
        _ => return None,
    };
    (outline.len() >= 3).then(|| Prop { name: one_line(name), outline, height_m })
}

/// Corners of a rectangle with these sides around a point.
fn foot([x, y, z]: [f64; 3], heading: f64, sides: [f32; 2]) -> Vec<[f64; 3]> {
    let [along, across] = sides.map(|side| 0.5 * f64::from(side));
    let corner = |u: f64, v: f64| {
        let [x, y] = placed([x, y], heading, [u, v]);
        [x, y, z]
    };
    vec![
        corner(-along, -across),
        corner(along, -across),
        corner(along, across),
        corner(-along, across),
    ]
}
