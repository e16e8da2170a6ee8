//! `echoloop roads` and towns on roads: what they print and write, and what they refuse.

use crate::fixture::Fixture;

/// A straight road of 40 m.
const STRAIGHT: &str = r#"<OpenDRIVE><header revMajor="1" revMinor="4"/>
<road name="" length="40" id="7" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="40"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"#;

#[test]
fn roads_of_ours_are_written_and_read_back() {
    let fixture = Fixture::new();
    let drawn = fixture.succeed(&["roads", "old-town", "-o", "ours.xodr", "--json"]).json();
    let read =
        fixture.succeed(&["roads", "ours.xodr", "-o", "ours.csv", "--step", "10", "--json"]).json();
    assert_eq!((&drawn["topology"], &drawn["lanes"]), (&read["topology"], &read["lanes"]));
    assert!(drawn["roads"].as_u64() > Some(100) && drawn["remarks"] == serde_json::json!([]));
    let rows = fixture.read("ours.csv");
    let mut rows = rows.lines();
    let head = "road_id,section_id,lane_id,s,x,y,z,heading_deg,rise,width,in_junction";
    assert_eq!(rows.next(), Some(head));
    assert!(rows.count() > 300);
}

#[test]
fn a_broken_network_is_refused_by_file_and_road_and_leaves_nothing() {
    let fixture = Fixture::new();
    let piece = "<geometry s=\"0\" x=\"0\" y=\"0\" hdg=\"0\" length=\"40\"><line/></geometry>";
    let far = "<geometry s=\"20\" x=\"2000\" y=\"900\" hdg=\"1\" length=\"20\"><line/></geometry>";
    let gap = piece.replace("length=\"40\"", "length=\"20\"") + far;
    let at = |part: &str| STRAIGHT.find(part).expect("it is there");
    let bare = STRAIGHT[..at("<laneSection")].to_owned() + &STRAIGHT[at("</lanes>")..];
    let files = [
        ("gap.xodr", STRAIGHT.replace(piece, &gap), "road 7: the <geometry> at s = 20"),
        (
            "kink.xodr",
            STRAIGHT.replace(piece, &gap.replace("x=\"2000\" y=\"900\"", "x=\"20\" y=\"0\"")),
            "57.3°",
        ),
        ("short.xodr", STRAIGHT.replace("length=\"40\" id", "length=\"400\" id"), "ends at s = 40"),
        ("width.xodr", STRAIGHT.replace("a=\"3.5\"", "a=\"-3.5\""), "road 7: lane -1"),
        ("lanes.xodr", bare, "no <laneSection>"),
        ("curve.xodr", STRAIGHT.replace("<line/>", "<helix/>"), "road 7"),
        ("nan.xodr", STRAIGHT.replace("hdg=\"0\"", "hdg=\"nan\""), "road 7"),
        ("long.xodr", STRAIGHT.replace("length=\"40\" id", "length=\"5e5\" id"), "500 km"),
        ("none.xodr", "<OpenDRIVE/>".into(), "no road"),
        ("text.xodr", "not XML".into(), "it is not XML"),
    ];
    for (name, text, part) in &files {
        fixture.write(name, text);
        fixture.refuses(&["roads", name, "-o", "way.csv"], &[name, part]);
        fixture.refuses(&["scan", "--scene", name, "-o", "cloud.ply"], &[name, part]);
        assert!(!fixture.path("way.csv").exists() && !fixture.path("cloud.ply").exists(), "{name}");
    }
    fixture.refuses(&["roads", "absent.xodr"], &["absent.xodr"]);
    fixture.refuses(&["roads", "rocky-valley"], &["rocky-valley", "no roads"]);
    fixture.refuses(&["roads", "yard.obj"], &["yard.obj", "no road network"]);
    fixture.refuses(&["roads", "old-town", "-o", "way.txt"], &["way.txt", ".csv or .xodr"]);
    fixture.refuses(&["roads", "old-town", "--step", "5"], &["--step", "-o FILE.csv"]);
    fixture.refuses(&["roads", "old-town", "--step", "5", "-o", "a.xodr"], &["--step", ".csv"]);
    fixture.write("good.xodr", STRAIGHT);
    fixture.refuses(&["roads", "good.xodr", "-o", "out.xodr"], &["out.xodr", "old-town"]);
    fixture.refuses(
        &["scan", "--scene", "good.xodr", "--set", "scene.dressing=wild"],
        &["scene.dressing", "structured, semi-structured"],
    );
}

#[test]
fn roads_far_away_have_waypoints_and_no_town() {
    let fixture = Fixture::new();
    fixture.write("far.xodr", STRAIGHT.replace("x=\"0\"", "x=\"9000\""));
    let said = fixture.succeed(&["roads", "far.xodr", "-o", "far.csv"]).stdout;
    assert!(said.ends_with("\nwrote far.csv\n"), "{said}");
    assert_eq!(fixture.read("far.csv").lines().count(), 21);
    let expected = ["no town", "far.xodr", "road 7 reaches 9040 m", "5000 m"];
    fixture.refuses(&["scan", "--scene", "far.xodr", "-o", "cloud.ply"], &expected);
}

#[test]
fn a_link_to_a_road_that_is_not_there_is_a_remark() {
    let fixture = Fixture::new();
    let link =
        r#"<link><successor elementType="road" elementId="99" contactPoint="start"/></link>"#;
    fixture.write("link.xodr", STRAIGHT.replace("<planView>", &format!("{link}<planView>")));
    let read = fixture.succeed(&["roads", "link.xodr", "--json"]).json();
    let said = "road 7: its successor is road \"99\", which is not there";
    assert_eq!(read["remarks"], serde_json::json!([said]));
}

#[test]
fn a_town_of_carlas_without_its_file_says_where_it_would_be() {
    let fixture = Fixture::new();
    let command = |args: &[&str]| {
        let mut command = fixture.command(args);
        command.env_remove("ECHOLOOP_DATA");
        command.output().expect("it runs")
    };
    for args in [["scan", "--scene", "town07"], ["evaluate", "--scene", "town07"]] {
        let output = command(&args);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("ECHOLOOP_DATA") && said.contains("Town07.xodr"), "{said}");
    }
}

#[test]
fn a_town_on_the_roads_of_a_file_is_scanned() {
    let fixture = Fixture::new();
    fixture.write("street.xodr", STRAIGHT);
    let scanned = fixture
        .succeed(&[
            "scan",
            "--scene",
            "street.xodr",
            "--set",
            "scene.dressing=semi-structured",
            "--set",
            "scanner.pattern=grid",
            "--set",
            "scanner.columns=48",
            "-o",
            "cloud.ply",
            "--json",
        ])
        .json();
    assert!(scanned.is_object(), "{scanned}");
    assert!(fixture.path("cloud.ply").exists());
}
