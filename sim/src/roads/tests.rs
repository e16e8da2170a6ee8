use std::path::Path;

use super::*;

/// Straight road of 40 m along x with a lane on each side.
fn straight() -> String {
    road_of(r#"<geometry s="0" x="0" y="0" hdg="0" length="40"><line/></geometry>"#)
}

fn road_of(plan: &str) -> String {
    let lane = |id: i32, kind: &str, wide: &str| {
        format!(r#"<lane id="{id}" type="{kind}"><width sOffset="0" a="{wide}" b="0"/></lane>"#)
    };
    let (left, right) = (lane(1, "driving", "3"), lane(-1, "driving", "3.5"));
    let walk = lane(-2, "sidewalk", "2");
    format!(
        r#"<OpenDRIVE><header revMajor="1" revMinor="4"/>
<road name="" length="40" id="7" junction="-1">
<planView>{plan}</planView>
<lanes><laneSection s="0"><left>{left}</left>
<center><lane id="0" type="none"/></center>
<right>{right}{walk}</right></laneSection></lanes></road></OpenDRIVE>"#
    )
}

/// Two straight pieces of 20 m, with the start and heading of the second given.
fn two_pieces(x: &str, y: &str, heading: &str) -> String {
    format!(
        r#"<geometry s="0" x="0" y="0" hdg="0" length="20"><line/></geometry>
<geometry s="20" x="{x}" y="{y}" hdg="{heading}" length="20"><line/></geometry>"#
    )
}

fn without_sections() -> String {
    let text = straight();
    let at = |part: &str| text.find(part).expect("it is there");
    text[..at("<laneSection")].to_owned() + &text[at("</lanes>")..]
}

fn lanes(count: usize) -> String {
    (10..10 + count).map(|id| format!(r#"<lane id="{id}" type="driving"/>"#)).collect()
}

/// Straight road with nested elements. A `/>` inside an attribute closes none.
fn nested(levels: usize) -> String {
    let (open, closed) = (r#"<q w="/>">"#.repeat(levels), "</q>".repeat(levels));
    straight().replace("</lanes>", &format!("</lanes>{open}{closed}"))
}

fn attributes(count: usize, name: impl Fn(usize) -> String) -> String {
    (0..count).map(|k| format!(" {}=\"1\"", name(k))).collect()
}

fn parse(text: &str) -> Result<RoadNetwork, String> {
    parse_network(Path::new("some/town.xodr"), text.as_bytes()).map_err(|error| error.to_string())
}

#[test]
fn a_straight_road_has_lanes_on_both_sides() {
    let network = parse(&straight()).expect("a network");
    assert_eq!((network.name.as_str(), network.roads()), ("town", 1));
    let kinds: Vec<(i32, LaneKind)> = network.lanes.iter().map(|l| (l.id, l.kind)).collect();
    assert!(kinds.contains(&(-2, LaneKind::Sidewalk)) && kinds.len() == 3, "{kinds:?}");
    assert_eq!(network.bounds(), ([0.0, -5.5], [40.0, 3.0]));
    let waypoints = network.waypoints(15.0);
    assert_eq!(waypoints.len(), 6);
    for at in waypoints {
        let lane = &network.lanes[at.lane];
        let (y, heading) = if lane.id > 0 { (1.5, std::f64::consts::PI) } else { (-1.75, 0.0) };
        assert!((at.at[1] - y).abs() < 1e-3 && (at.heading_rad - heading).abs() < 1e-9, "{at:?}");
        assert!((at.at[0] - at.s_m).abs() < 1e-3 && (at.width_m - 2.0 * y.abs()).abs() < 1e-3);
    }
}

#[test]
fn elements_may_be_nested_and_user_data_is_not_read() {
    assert!(parse(&nested(62)).is_ok());
    let theirs = r#"<userData s="x"><q hdg="NaN"><q a="-"/></q></userData>"#;
    let kept = straight().replace("</lanes>", &format!("</lanes>{theirs}"));
    assert_eq!(parse(&kept).map(|network| network.lanes.len()), Ok(3));
    let message = parse(&kept.replace("userData", "ours")).expect_err("numbers that are none");
    assert!(message.contains("road 7: <ours> has s=\"x\", expected a finite number"), "{message}");
}

#[test]
fn a_piece_without_length_is_skipped() {
    let pieces = r#"<geometry s="0" x="0" y="0" hdg="0" length="40"><line/></geometry>
<geometry s="40" x="40" y="0" hdg="1" length="0"><line/></geometry>"#;
    let network = parse(&road_of(pieces)).expect("a network");
    assert_eq!(network.remarks.len(), 1, "{:?}", network.remarks);
    assert!(network.waypoints(39.9).iter().all(|at| libm::sin(at.heading_rad).abs() < 1e-9));
}

#[test]
fn pieces_may_differ_by_rounding_and_headings_by_whole_turns() {
    let turned = two_pieces("20.3", "0.3", "-6.2"); // 4.8 degrees and a whole turn
    assert!(parse(&road_of(&turned)).is_ok());
    let taper = straight().replace("a=\"3\" b=\"0\"", "a=\"3\" b=\"-0.076\""); // to -4 cm
    assert!(parse(&taper).is_ok());
    // A piece of 1 cm between them heads elsewhere: there is no hole.
    let short = r#"<geometry s="20" x="20" y="0" hdg="2" length="0.01"><line/></geometry>"#;
    let rest = two_pieces("20.01", "0", "0").replace("s=\"20\"", "s=\"20.01\"");
    assert!(parse(&road_of(&(rest + short))).is_ok());
}

#[test]
fn a_network_may_lie_far_from_the_origin() {
    let line = r#"<geometry s="0" x="-9000" y="12000" hdg="0" length="40"><line/></geometry>"#;
    let network = parse(&road_of(line)).expect("a network");
    let ways = network.waypoints(10.0);
    assert_eq!(ways.len(), 8);
    for way in ways {
        assert!((way.at[0] + 9000.0 - way.s_m).abs() < 1e-3, "{way:?}");
    }
    assert_eq!(network.check_reach(12_003.0), Ok(()));
    let message = network.check_reach(12_002.0).expect_err("too far").to_string();
    assert!(
        message.starts_with("road 7 reaches 12003 m from the origin, more than 12002 m"),
        "{message}"
    );
}

#[test]
fn links_that_lead_nowhere_are_remarks() {
    let linked = |kind: &str| {
        let link = r#"<link><predecessor elementType="road" elementId="7" contactPoint="end"/>
<successor elementType="KIND" elementId="99" contactPoint="start"/></link><planView>"#;
        straight().replace("<planView>", &link.replace("KIND", kind))
    };
    for kind in ["road", "junction"] {
        let network = parse(&linked(kind)).expect("a network");
        let message = format!("road 7: its successor is {kind} \"99\", which is not there");
        let of_links = network.remarks.iter().filter(|remark| remark.contains("not there"));
        assert_eq!(of_links.collect::<Vec<_>>(), [&message]);
    }
}

#[test]
fn waypoints_belong_to_the_section_between_whose_ends_they_lie() {
    let section = |s: f64| {
        format!(
            r#"<laneSection s="{s}"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="3.5"/></lane></right></laneSection>"#
        )
    };
    let text = without_sections();
    let starts = [0.0, 7.5, 20.0, 20.4, 33.0];
    let sections: String = starts.into_iter().map(section).collect();
    let network = parse(&text.replace("</lanes>", &format!("{sections}</lanes>"))).expect("one");
    let found = |step_m: f64| -> Vec<(i64, usize)> {
        let ways = network.waypoints(step_m).into_iter();
        ways.map(|at| ((at.s_m * 10.0).round() as i64, network.lanes[at.lane].section)).collect()
    };
    let expected = [(0, 0), (50, 0), (100, 1), (150, 1), (200, 2), (250, 3), (300, 3), (350, 4)];
    assert_eq!(found(5.0), expected);
    assert_eq!(found(0.1).len(), 400);
    assert_eq!(found(1000.0), [(0, 0)]);
}

#[test]
fn an_arc_is_followed() {
    let plan =
        r#"<geometry s="0" x="0" y="0" hdg="0" length="40"><arc curvature="0.02"/></geometry>"#;
    let network = parse(&road_of(plan)).expect("a network");
    for at in network.waypoints(7.0).iter().filter(|at| network.lanes[at.lane].id == -1) {
        // The middle of the right lane is 1.75 m outside a circle of 50 m about (0, 50).
        let [x, y, _] = at.at;
        let radius = (x * x + (y - 50.0) * (y - 50.0)).sqrt();
        assert!((radius - 51.75).abs() < 1e-3, "{at:?}");
        assert!((at.heading_rad - 0.02 * at.s_m).abs() < 1e-9, "{at:?}");
    }
}

#[test]
fn a_broken_network_is_refused_by_road_and_fault() {
    let line = r#"<geometry s="0" x="0" y="0" hdg="0" length="40"><line/></geometry>"#;
    let far = line.replace(r#"x="0""#, r#"x="7e6""#);
    let cases = [
        ("hello".to_owned(), "it is not XML"),
        ("<a/>".to_owned(), "its root is <a>, expected <OpenDRIVE>"),
        ("<OpenDRIVE/>".to_owned(), "it has no road"),
        (nested(64), "its elements are nested more than 64 deep"),
        (
            format!("<OpenDRIVE{}/>", attributes(1001, |k| format!("a{k}"))),
            "an element has more than 1000 attributes",
        ),
        (
            format!("<OpenDRIVE{}/>", attributes(101, |k| format!("xmlns:a{k}"))),
            "it declares more than 100 namespaces",
        ),
        (road_of(""), "road 7: its <planView> has no <geometry>"),
        (
            straight().replace("<width sOffset=\"0\" a=\"3\" b=\"0\"/>", ""),
            "road 7: road \"7\", lane section 0: lane 1",
        ),
        (
            road_of(&line.replace("hdg=\"0\"", "hdg=\"NaN\"")),
            "road 7: <geometry> has hdg=\"NaN\", expected a finite number",
        ),
        (road_of(&line.replace("hdg=\"0\"", "")), "road 7: <geometry> has no hdg"),
        (
            road_of(&line.replace("length=\"40\"", "length=\"-1\"")),
            "road 7: <geometry> at s = 0 has a length of -1 m",
        ),
        (
            road_of(&line.replace("<line/>", "<clothoid/>")),
            "road 7: a <geometry> has the shape <clothoid>",
        ),
        (road_of(&far), "road 7 reaches 7000040 m from the origin, more than 50000 m"),
        (
            straight().replace("length=\"40\" id", "length=\"5e5\" id"),
            "it has 500 km of road, more than 400 km",
        ),
        (
            straight()
                .replace("length=\"40\"", "length=\"1e5\"")
                .replace("<line/>", "<arc curvature=\"1\"/>"),
            "road 7: it makes 15915 full turns, more than 100",
        ),
        (
            straight()
                .replace("length=\"40\"", "length=\"5e4\"")
                .replace("<center>", &format!("<center>{}", lanes(400))),
            "it has 20200 km of lanes, more than 1500 km",
        ),
        (
            straight().replace("length=\"40\" id", "length=\"inf\" id"),
            "road 7: <road> has length=\"inf\"",
        ),
        (straight().replace("a=\"3\"", "a=\"3x\""), "road 7: <width> has a=\"3x\""),
        (
            straight().replace("id=\"-2\"", "id=\"-1\""),
            "road 7: the section at s = 0 has lane -1 twice",
        ),
        (
            straight().replace("<lanes>", "<lanes><include file=\"/etc/passwd\"/>"),
            "line 4 includes \"/etc/passwd\", and no other file is read",
        ),
        (
            road_of(&two_pieces("2000", "900", "1")),
            "road 7: the <geometry> at s = 20 begins at (2000.00, 900.00), 2174.95 m from the end \
             of the one before, expected (20.00, 0.00)",
        ),
        (
            road_of(&two_pieces("20", "0.6", "0")),
            "road 7: the <geometry> at s = 20 begins at (20.00, 0.60), 0.60 m from the end",
        ),
        (
            road_of(&two_pieces("20", "0", "1")),
            "road 7: the <geometry> at s = 20 heads 57.3° away from the end of the one before",
        ),
        (
            road_of(&two_pieces("20", "0", "0").replace("s=\"20\"", "s=\"25\"")),
            "road 7: the <geometry> at s = 0 ends at s = 20.000, but the next begins at s = 25",
        ),
        (
            road_of(&line.replace("s=\"0\"", "s=\"5\"")),
            "road 7: its first <geometry> begins at s = 5, expected 0",
        ),
        (
            road_of(&line.replace(
                "<line/>",
                "<paramPoly3 bU=\"9\" cU=\"0\" dU=\"0\" bV=\"0\" cV=\"0\" dV=\"0\"/>",
            )),
            "road 7: the <geometry> at s = 0 has a length of 40 m, but its curve of 9.00 m",
        ),
        (
            straight().replace("length=\"40\" id", "length=\"400\" id"),
            "road 7: its length is 400 m, but its <planView> ends at s = 40.000",
        ),
        (
            straight().replace("length=\"40\" id", "length=\"39\" id"),
            "road 7: its length is 39 m, but its <planView> ends at s = 40.000",
        ),
        (
            straight()
                .replace("<lanes>", &format!("<lanes>{}", "<laneOffset s=\"0\"/>".repeat(10_001))),
            "road 7: it has more than 10000 <laneOffset> in a list",
        ),
        (without_sections(), "road 7: its <lanes> has no <laneSection>"),
        (
            straight().replace("<laneSection s=\"0\"", "<laneSection s=\"20\""),
            "road 7: its first <laneSection> begins at s = 20, expected 0",
        ),
        (
            straight().replace("a=\"3.5\"", "a=\"-3.5\""),
            "road 7: lane -1 of the section at s = 0 has a width of -3.50 m, expected 0 or more",
        ),
        (
            straight().replace("a=\"3\" b=\"0\"", "a=\"3\" b=\"-0.1\""),
            "road 7: lane 1 of the section at s = 0 has a width of -1.00 m, expected 0 or more",
        ),
        (
            straight().replace(
                "<header revMajor=\"1\" revMinor=\"4\"/>",
                "<road id=\"7\" length=\"1\"/>",
            ),
            "road 7: it has no <planView>",
        ),
    ];
    for (text, expected) in cases {
        let message = parse(&text).expect_err(expected);
        let start = format!("some/town.xodr is not an OpenDRIVE road network: {expected}");
        assert!(message.starts_with(&start), "{message}\n{start}");
    }
}

#[test]
fn no_prefix_and_no_flipped_byte_of_a_network_panics() {
    let text = straight();
    for k in 0..text.len() {
        let _ = RoadNetwork::parse("cut", &text[..k]);
        let mut bytes = text.clone().into_bytes();
        for flip in [0x01, 0x10, 0x40] {
            bytes[k] ^= flip;
            let _ = parse_network(Path::new("bad.xodr"), &bytes);
            bytes[k] ^= flip;
        }
    }
}

const TOWNS: [&str; 3] = ["Town01", "Town07", "Town10HD"];

fn carla(what: &str) -> Option<std::path::PathBuf> {
    echoloop_needs::data_folder(what).map(|folder| folder.join("carla_xodr"))
}

/// A row of the oracle: road, section, lane; then s, x, y, z, pitch, yaw, roll, width.
type Row = ((String, usize, i32), Vec<f64>);

fn rows(text: &str) -> Vec<Row> {
    let rows = text.lines().skip(1).map(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |k: usize| cells[k].parse::<f64>().expect("a number");
        let key = (cells[0].to_owned(), number(1) as usize, number(2) as i32);
        (key, (3..11).map(number).collect())
    });
    rows.collect()
}

/// Degrees between two angles.
fn apart_deg(a: f64, b: f64) -> f64 {
    let turn = (a - b).rem_euclid(360.0);
    turn.min(360.0 - turn)
}

#[test]
fn waypoints_of_carlas_towns_equal_those_of_carla() {
    let Some(folder) = carla("CARLA's waypoints") else { return };
    for town in TOWNS {
        let network = load_network(&folder.join(format!("{town}.xodr"))).expect(town);
        let file = folder.join(format!("oracle_{town}_waypoints10m.csv"));
        let oracle = rows(&std::fs::read_to_string(file).expect("an oracle"));
        let ours = network.waypoints(10.0);
        assert_eq!(ours.len(), oracle.len(), "{town}");
        let key = |at: &Waypoint| {
            let lane = &network.lanes[at.lane];
            (lane.road.clone(), lane.section, lane.id, (at.s_m * 1e3).round() as i64)
        };
        let ours: std::collections::HashMap<_, _> = ours.iter().map(|at| (key(at), at)).collect();
        let mut worst = [0.0_f64; 4];
        for ((road, section, lane), row) in oracle {
            let key = (road, section, lane, (row[0] * 1e3).round() as i64);
            let at = ours.get(&key).unwrap_or_else(|| panic!("{town} lacks {key:?}"));
            let carlas = [row[1], -row[2], row[3]];
            let away = (0..3).map(|i| (at.at[i] - carlas[i]).powi(2)).sum::<f64>().sqrt();
            let yaw = apart_deg(-at.heading_rad.to_degrees(), row[5]);
            let pitch = apart_deg(at.rise.to_degrees(), row[4]);
            let wide = (at.width_m - row[7]).abs();
            for (worst, new) in worst.iter_mut().zip([away, yaw, pitch, wide]) {
                *worst = worst.max(new);
            }
        }
        eprintln!("{town}: {} roads, worst m, deg, deg, m: {worst:?}", network.roads());
        assert!(worst[0] < 0.01 && worst[1] < 0.02 && worst[2] < 0.02 && worst[3] < 0.02, "{town}");
    }
}

#[test]
fn links_of_lanes_of_carlas_towns_equal_those_of_carla() {
    let Some(folder) = carla("CARLA's topology") else { return };
    for town in TOWNS {
        let network = load_network(&folder.join(format!("{town}.xodr"))).expect(town);
        let text = std::fs::read_to_string(folder.join(format!("oracle_{town}_topology.json")))
            .expect("an oracle");
        let mut theirs = segments(&text);
        let ours = network.topology();
        assert_eq!(ours.len(), theirs.len(), "{town}");
        let mut worst: f64 = 0.0;
        for pair in ours {
            let ends = pair.map(|at| [at.at[0], -at.at[1], at.at[2]]);
            let gap = |their: &[[f64; 3]; 2]| {
                let square =
                    |k: usize| (0..3).map(|i| (ends[k][i] - their[k][i]).powi(2)).sum::<f64>();
                square(0).max(square(1)).sqrt()
            };
            let nearest =
                (0..theirs.len()).min_by(|a, b| gap(&theirs[*a]).total_cmp(&gap(&theirs[*b])));
            let pair = theirs.swap_remove(nearest.expect("as many"));
            worst = worst.max(gap(&pair));
        }
        eprintln!("{town}: worst end {worst} m");
        assert!(worst < 0.01, "{town}: {worst}");
    }
}

/// The numbers below "topology", six a segment.
fn segments(json: &str) -> Vec<[[f64; 3]; 2]> {
    let (_, list) = json.split_once("\"topology\":").expect("a topology");
    let numbers: Vec<f64> = list
        .split(|c: char| !(c.is_ascii_digit() || "+-.e".contains(c)))
        .filter_map(|word| word.parse().ok())
        .collect();
    let point = |c: &[f64]| [c[0], c[1], c[2]];
    numbers.chunks_exact(6).map(|c| [point(&c[..3]), point(&c[3..])]).collect()
}
