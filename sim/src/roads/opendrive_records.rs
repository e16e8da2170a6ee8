//! Records of the roads of an OpenDRIVE file, with limits on the XML that are checked before
//! anything is built from it.

use std::collections::HashSet;

use echoloop_files::one_line;
use roxmltree::{Document, Node};

use super::continuity;
use super::fault::of_road;
use super::profile::{Cubic, Curve, Geometry, Profile, Section, placed};

/// Largest file, bytes. CARLA's towns have 1 to 20 MB.
const MAX_BYTES: usize = 64 << 20;
/// Largest length of all roads, km. CARLA's towns have 4 to 40.
const MAX_KM: f64 = 400.0;
/// Largest length of a piece of a reference line, metres.
const MAX_PIECE_M: f64 = 1e5;
/// Largest length of all lanes, km.
const MAX_LANES_KM: f64 = 1500.0;
/// Largest number of full turns of a road: a tighter or longer spiral takes more points.
const MAX_ROUNDS: f64 = 100.0;
/// Smallest number of bytes of a file per tag or attribute: the XML parser takes about 40 for each.
/// CARLA's towns have 25.
const BYTES_A_MARK: usize = 8;
/// Largest nesting depth of elements. CARLA's towns have 8.
const MAX_DEPTH: usize = 64;
/// Largest number of attributes of an element: the XML parser compares each with all others.
const MAX_ATTRIBUTES: usize = 1000;
/// Largest number of namespace declarations: an element that declares one copies those of all
/// elements around it.
const MAX_NAMESPACES: usize = 100;

/// Largest number of records of a list, such as pieces of a reference line or lane sections: each
/// point searches them. CARLA's towns have 100 or fewer.
const MAX_RECORDS: usize = 10_000;

/// Names of attributes that are numbers, in any element of a road.
const NUMBERS: &str = "s t x y hdg length curvature curvStart curvEnd a b c d aU bU cU dU aV bV \
                       cV dV sOffset tOffset zOffset width inner outer u v z dz";

/// Reads the records of all roads, with remarks on links to missing roads.
pub(super) fn profiles(text: &str) -> Result<(Vec<Profile>, Vec<String>), String> {
    if text.len() > MAX_BYTES {
        return Err(format!("it has more than {} MB", MAX_BYTES >> 20));
    }
    check_marks(text)?;
    let document = Document::parse(text)
        .map_err(|error| format!("it is not XML: {}", one_line(&error.to_string())))?;
    let root = document.root_element();
    if !root.has_tag_name("OpenDRIVE") {
        let name = one_line(root.tag_name().name());
        return Err(format!("its root is <{name}>, expected <OpenDRIVE>"));
    }
    check_depth(&document)?;
    refuse_includes(&document)?;
    let roads: Vec<Node<'_, '_>> = children(root, "road").collect();
    check_length(&roads)?;
    let mut seen = HashSet::new();
    let profiles = roads.iter().map(|road| {
        let profile = profile(*road).map_err(|what| of_road(id(*road), what))?;
        match seen.insert(profile.id.clone()) {
            true => Ok(profile),
            false => Err(of_road(&profile.id, "its id is that of another road too")),
        }
    });
    let profiles: Vec<Profile> = profiles.collect::<Result<_, _>>()?;
    check_work(&profiles)?;
    profiles.iter().try_for_each(continuity::check)?;
    Ok((profiles, lost_links(root, &roads)))
}

/// Remarks on links to roads or junctions that the file does not have.
fn lost_links(root: Node<'_, '_>, roads: &[Node<'_, '_>]) -> Vec<String> {
    let ids = |name| children(root, name).filter_map(|node| node.attribute("id"));
    let (all_roads, junctions): (HashSet<&str>, HashSet<&str>) =
        (ids("road").collect(), ids("junction").collect());
    let mut remarks = Vec::new();
    for road in roads {
        let links = children(*road, "link").flat_map(|link| link.children());
        let ends = links.filter(|link| {
            ["predecessor", "successor"].map(|end| link.has_tag_name(end)).contains(&true)
        });
        for end in ends {
            let to = end.attribute("elementId").unwrap_or_default();
            let (kind, there) = match end.attribute("elementType") {
                Some("junction") => ("junction", &junctions),
                _ => ("road", &all_roads),
            };
            if !there.contains(to) {
                let (id, tag, to) = (one_line(id(*road)), end.tag_name().name(), one_line(to));
                remarks.push(format!("road {id}: its {tag} is {kind} {to:?}, which is not there"));
            }
        }
    }
    remarks
}

/// Refuses roads that would take more points than any place has, before they are built.
fn check_work(profiles: &[Profile]) -> Result<(), String> {
    let mut lanes_m = 0.0;
    for (k, profile) in profiles.iter().enumerate() {
        let turn_rad: f64 = profile.geometries.iter().map(Geometry::turn_rad).sum();
        let rounds = turn_rad / std::f64::consts::TAU;
        // More pieces may turn more: each takes bytes of the file.
        if rounds > MAX_ROUNDS.max(profile.geometries.len() as f64) {
            let what = format!("it makes {rounds:.0} full turns, more than {MAX_ROUNDS:.0}");
            return Err(of_road(&profile.id, what));
        }
        let sections = 0..profile.sections.len();
        let lanes_of = |section: usize| {
            let [first, last] = profiles[k].span(section);
            (last - first).max(0.0) * profile.sections[section].widths.len() as f64
        };
        lanes_m += sections.map(lanes_of).sum::<f64>();
    }
    match lanes_m <= 1000.0 * MAX_LANES_KM {
        true => Ok(()),
        false => Err(format!(
            "it has {:.0} km of lanes, more than {MAX_LANES_KM:.0} km: cut out a part of it",
            0.001 * lanes_m
        )),
    }
}

/// Refuses XML that would take long or much memory, before it is parsed. Counts everything that
/// looks like a tag or an attribute, which is never too few: no attribute value contains a `<`.
fn check_marks(text: &str) -> Result<(), String> {
    let marks = text.bytes().filter(|byte| matches!(byte, b'<' | b'=')).count();
    if marks > text.len() / BYTES_A_MARK + 10_000 {
        return Err(format!("it has more than a tag or an attribute every {BYTES_A_MARK} bytes"));
    }
    let attributes = |tag: &[u8]| tag.iter().filter(|byte| **byte == b'=').count();
    if text.as_bytes().split(|byte| *byte == b'<').any(|tag| attributes(tag) > MAX_ATTRIBUTES) {
        return Err(format!("an element has more than {MAX_ATTRIBUTES} attributes"));
    }
    match text.matches("xmlns").nth(MAX_NAMESPACES) {
        None => Ok(()),
        Some(_) => Err(format!("it declares more than {MAX_NAMESPACES} namespaces")),
    }
}

/// Limits the nesting depth: the parser takes any depth, but code that recurses does not.
fn check_depth(document: &Document<'_>) -> Result<(), String> {
    let mut open = vec![(document.root_element(), 1)];
    while let Some((node, depth)) = open.pop() {
        if depth > MAX_DEPTH {
            return Err(format!("its elements are nested more than {MAX_DEPTH} deep"));
        }
        open.extend(node.children().filter(Node::is_element).map(|child| (child, depth + 1)));
    }
    Ok(())
}

/// Refuses includes: a network is untrusted input and opens no other file.
fn refuse_includes(document: &Document<'_>) -> Result<(), String> {
    match document.descendants().find(|node| node.has_tag_name("include")) {
        None => Ok(()),
        Some(node) => {
            let file = one_line(node.attribute("file").unwrap_or_default());
            let line = document.text_pos_at(node.range().start).row;
            Err(format!(
                "line {line} includes {file:?}, and no other file is read: write in what it has"
            ))
        }
    }
}

/// Limits the length of all roads before they are built: a kilometre takes many points.
fn check_length(roads: &[Node<'_, '_>]) -> Result<(), String> {
    if roads.is_empty() {
        return Err("it has no road".into());
    }
    let mut sum_m = 0.0;
    for road in roads {
        sum_m += number(*road, "length").map_err(|what| of_road(id(*road), what))?;
    }
    match sum_m <= 1000.0 * MAX_KM {
        true => Ok(()),
        false => Err(format!(
            "it has {:.0} km of road, more than {MAX_KM:.0} km: cut out a part of it",
            0.001 * sum_m
        )),
    }
}

fn children<'a, 'b>(node: Node<'a, 'b>, name: &str) -> impl Iterator<Item = Node<'a, 'b>> {
    node.children().filter(move |child| child.has_tag_name(name))
}

fn id<'a>(road: Node<'a, '_>) -> &'a str {
    road.attribute("id").unwrap_or("(without an id)")
}

/// Number in an attribute.
fn number(node: Node<'_, '_>, name: &str) -> Result<f64, String> {
    let (tag, text) = (node.tag_name().name(), node.attribute(name));
    let text = text.ok_or_else(|| format!("<{tag}> has no {name}"))?;
    let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    value
        .ok_or_else(|| format!("<{tag}> has {name}={:?}, expected a finite number", one_line(text)))
}

/// As [`number`], 0 where the attribute is missing.
fn number_or_zero(node: Node<'_, '_>, name: &str) -> Result<f64, String> {
    node.attribute(name).map_or(Ok(0.0), |_| number(node, name))
}

/// Checks all numbers of a road except those in `userData`, which belong to other programs.
fn check_numbers(road: Node<'_, '_>) -> Result<(), String> {
    let mut open = vec![road];
    while let Some(node) = open.pop() {
        for attribute in
            node.attributes().filter(|found| NUMBERS.split(' ').any(|name| name == found.name()))
        {
            // A width or a length may be empty outside of the records read here.
            if !attribute.value().is_empty() {
                number(node, attribute.name())?;
            }
        }
        let is_checked =
            |child: &Node<'_, '_>| child.is_element() && !child.has_tag_name("userData");
        open.extend(node.children().rev().filter(is_checked));
    }
    Ok(())
}

/// Records of a road; the caller adds the road to a fault.
fn profile(road: Node<'_, '_>) -> Result<Profile, String> {
    check_numbers(road)?;
    let length_m = number(road, "length")?;
    if length_m <= 0.0 {
        return Err(format!("its length is {length_m} m"));
    }
    let below = |path: &str| children(road, path).next();
    let plan = below("planView").ok_or("it has no <planView>")?;
    let mut geometries = records(plan, "geometry")?.map(geometry).collect::<Result<Vec<_>, _>>()?;
    geometries.retain(|piece| piece.length_m > 0.0); // some exporters end a road with one
    if geometries.is_empty() {
        return Err("its <planView> has no <geometry> with a length".into());
    }
    geometries.sort_by(|a, b| a.s.total_cmp(&b.s));
    let lanes = below("lanes").ok_or("it has no <lanes>")?;
    let mut sections =
        records(lanes, "laneSection")?.map(section).collect::<Result<Vec<_>, _>>()?;
    if sections.is_empty() {
        return Err("its <lanes> has no <laneSection>".into());
    }
    sections.sort_by(|a, b| a.s.total_cmp(&b.s));
    Ok(Profile {
        id: id(road).to_owned(),
        length_m,
        in_junction: road.attribute("junction").is_some_and(|junction| junction != "-1"),
        geometries,
        elevations: cubics(below("elevationProfile"), "elevation", "s")?,
        lane_offsets: cubics(Some(lanes), "laneOffset", "s")?,
        sections,
    })
}

/// Records of a list.
fn records<'a, 'b>(
    list: Node<'a, 'b>,
    name: &'static str,
) -> Result<impl Iterator<Item = Node<'a, 'b>>, String> {
    match children(list, name).nth(MAX_RECORDS) {
        None => Ok(children(list, name)),
        Some(_) => Err(format!("it has more than {MAX_RECORDS} <{name}> in a list")),
    }
}

fn cubics(
    list: Option<Node<'_, '_>>,
    name: &'static str,
    start: &str,
) -> Result<Vec<Cubic>, String> {
    let Some(list) = list else { return Ok(Vec::new()) };
    let read = records(list, name)?.map(|node| {
        let at = |name| number_or_zero(node, name);
        Ok(Cubic { s: at(start)?, a: at("a")?, b: at("b")?, c: at("c")?, d: at("d")? })
    });
    let mut records = read.collect::<Result<Vec<_>, String>>()?;
    records.sort_by(|a, b| a.s.total_cmp(&b.s));
    Ok(records)
}

fn geometry(node: Node<'_, '_>) -> Result<Geometry, String> {
    let at = |name| number(node, name);
    let (s, heading_rad, length_m) = (at("s")?, at("hdg")?, at("length")?);
    let [x, y] = [at("x")?, at("y")?];
    if !(0.0..=MAX_PIECE_M).contains(&length_m) {
        return Err(format!("<geometry> at s = {s} has a length of {length_m} m"));
    }
    let shape = node.children().find(|child| child.is_element() && !child.has_tag_name("userData"));
    let (curve, start) = curve(shape.ok_or("a <geometry> has no shape")?, length_m)?;
    let at = placed([x, y], heading_rad, start);
    Ok(Geometry { s, at, heading_rad, length_m, curve })
}

/// Shape of a piece, and the offset of its start in the frame of the piece.
fn curve(shape: Node<'_, '_>, length_m: f64) -> Result<(Curve, [f64; 2]), String> {
    let of = |name: &str| number(shape, name);
    let three = |suffix: &str| -> Result<[f64; 3], String> {
        let of = |letter: &str| of(&format!("{letter}{suffix}"));
        Ok([of("b")?, of("c")?, of("d")?])
    };
    let offset = |name| number_or_zero(shape, name);
    match shape.tag_name().name() {
        "line" => Ok((Curve::Line, [0.0; 2])),
        "arc" => Ok((Curve::Spiral([of("curvature")?; 2]), [0.0; 2])),
        "spiral" => Ok((Curve::Spiral([of("curvStart")?, of("curvEnd")?]), [0.0; 2])),
        "poly3" => Ok((Curve::Poly3(three("")?), [0.0, offset("a")?])),
        "paramPoly3" => {
            let is_long = shape
                .attribute("pRange")
                .is_some_and(|range| range.eq_ignore_ascii_case("arcLength"));
            let most = if is_long { length_m } else { 1.0 };
            let curve = Curve::ParamPoly3 { u: three("U")?, v: three("V")?, most };
            Ok((curve, [offset("aU")?, offset("aV")?]))
        }
        other => Err(format!(
            "a <geometry> has the shape <{}>, expected line, arc, spiral, poly3 or paramPoly3",
            one_line(other)
        )),
    }
}

fn section(node: Node<'_, '_>) -> Result<Section, String> {
    let mut section = Section { s: number_or_zero(node, "s")?, ..Section::default() };
    for lane in node.descendants().filter(|node| node.has_tag_name("lane")) {
        let text = lane.attribute("id").unwrap_or_default();
        let number = text.trim().parse::<i32>().map_err(|_| {
            format!("a <lane> has id={:?}, expected a whole number", one_line(text))
        })?;
        let widths = cubics(Some(lane), "width", "sOffset")?;
        if section.widths.insert(number, widths).is_some() {
            return Err(format!("the section at s = {} has lane {number} twice", section.s));
        }
    }
    Ok(section)
}
