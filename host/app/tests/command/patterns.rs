//! Scan patterns from the command line.

use std::fmt::Write as _;
use std::fs;

use echoloop_closed_loop::config::load;

use crate::fixture::Fixture;

const HEADER: &str = "azimuth_deg,elevation_deg,time_s,channel\n";

/// A table that sees the ground ahead.
fn table() -> String {
    (0..400).fold(HEADER.to_owned(), |mut text, i| {
        let (azimuth, elevation) = (f64::from(i % 40) - 20.0, -4.0 - f64::from(i / 40));
        let _ = writeln!(text, "{azimuth},{elevation},{},{}", f64::from(i) * 1e-4, i % 8);
        text
    })
}

#[test]
fn every_pattern_scans_the_default_scene() {
    let fixture = Fixture::new();
    fs::write(fixture.path("mine.csv"), table()).expect("a file");
    for (pattern, own, beams) in [
        ("raster", "scanner.columns=96", 96 * 64),
        ("steered", "scanner.columns=60", 60 * 32),
        ("vlp-16", "scanner.columns=90", 90 * 16),
        ("vlp-32c", "scanner.columns=60", 60 * 32),
        ("vls-128", "scanner.columns=30", 30 * 128),
        ("hdl-64e", "scanner.columns=40", 40 * 64),
        ("os1-64", "scanner.columns=40", 40 * 64),
        ("os1-128", "scanner.columns=30", 30 * 128),
        ("livox-mid-40", "scanner.beams=2000", 2000),
        ("mine.csv", "motion.duration_s=0.1", 400),
    ] {
        let pattern = format!("scanner.pattern={pattern}");
        let scan = ["scan", "--json", "-o", "cloud.ply", "--set", &pattern, "--set", own];
        let told = fixture.succeed(&scan).json();
        assert_eq!(told["beams"], beams, "{pattern}");
        let points = told["points"].as_u64().expect("a number");
        assert!(points > beams as u64 / 5, "{pattern}: {points} points");
        assert!(fixture.path("cloud.ply").exists());
    }
}

#[test]
fn a_table_that_is_none_is_refused_with_its_line_and_costs_nothing() {
    let fixture = Fixture::new();
    let many: String = (0..200_000).fold(HEADER.to_owned(), |mut text, i| {
        let _ = writeln!(text, "1,2,{},0", f64::from(i) * 1e-6);
        text
    });
    for (text, said) in [
        ("azimuth_deg,elevation_deg,channel\n1,2,0\n".to_owned(), "line 1: no column time_s"),
        (HEADER.to_owned() + "1,2,0,0\n1,nan,0,0\n", "line 3: elevation_deg = nan must be"),
        (HEADER.to_owned(), "no beam"),
        (String::new(), "line 1: no column azimuth_deg"),
        (HEADER.to_owned() + "1,2,0,0\n3,4,0,0\n1,2,0,1\n", "line 4: the beam of line 2 again"),
        (many, "line 131074: more than 131072 beams"),
        (HEADER.to_owned() + "1,2,0.3,0\n", "line 2: time_s = 0.3 must be within motion.duration"),
    ] {
        fs::write(fixture.path("bad.csv"), text).expect("a file");
        for command in ["scan", "tune", "config"] {
            let set = ["--set", "scanner.pattern=bad.csv", "--set", "motion.duration_s=0.2"];
            fixture.refuses(&[&[command], &set[..]].concat(), &["bad.csv", said]);
        }
    }
    fixture
        .refuses(&["scan", "--set", "scanner.pattern=none.csv"], &["none.csv", "cannot be read"]);
    assert!(!fixture.path("runs").exists());
}

#[test]
fn a_configuration_that_is_printed_reads_back_with_its_pattern() {
    let fixture = Fixture::new();
    let help = fixture.succeed(&["config", "--help"]).stdout;
    for pattern in ["grid", "os1-64", "livox-mid-40"] {
        assert!(help.contains(pattern), "{help}");
        let set = format!("scanner.pattern={pattern}");
        let text = fixture.succeed(&["config", "--set", &set]).stdout;
        assert!(text.contains(&format!("pattern = \"{pattern}\"")), "{text}");
        assert_eq!(text.contains("rows = 64"), pattern == "grid", "{text}");
        fs::write(fixture.path("printed.toml"), &text).expect("a file");
        let again = fixture.succeed(&["config", "-c", "printed.toml"]).stdout;
        assert_eq!(again, text);
    }
}

const STEERED: &str = "scanner.pattern=steered";

#[test]
fn an_aim_that_the_mount_or_the_budget_does_not_allow_is_refused_with_the_bound() {
    let fixture = Fixture::new();
    let tune = |more: &[&'static str], parts: &[&str]| {
        fixture
            .refuses(&[&["tune", "-c", "small.toml", "--set", STEERED][..], more].concat(), parts);
    };
    for (set, said) in [
        (
            "lidar.elevation_span=91",
            "lidar.elevation_span 91 ° is beyond the mount, which reaches 90°",
        ),
        ("lidar.tilt=20", "lidar.tilt 20 ° is beyond the mount, which reaches 15°"),
        ("lidar.azimuth_span=0.5", "azimuth_span 0.5 ° is below its minimum 1 °"),
        ("lidar.rows=0", "rows 0 beams is below its minimum 1"),
        ("lidar.columns=2000", "columns 2000 beams are finer than the mount's step of 0.2°"),
        (
            "lidar.frame_time=200",
            "time of a scan: 200.0000 ms are used, and budget.frame_ms allows 100",
        ),
        ("lidar.power=75", "energy of a pulse: 375.0000 nJ are used"),
    ] {
        tune(&["--set", set], &[said]);
    }
    let many = ["--set", "lidar.columns=300", "--set", "lidar.rows=64"];
    let soon = [&many[..], &["--set", "lidar.frame_time=90"]].concat();
    tune(&soon, &["frame_time 90 ms is shorter than the shots of a scan, 96 ms"]);
    tune(&["--budget", "shots_per_s=1"], &["shots a second", "budget.shots_per_s allows 1.0000"]);
    tune(&["--budget", "none,light_mw=0.001"], &["light", "budget.light_mw allows 0.0010"]);
    tune(&["--budget", "watts=3"], &["--budget watts=3: expected none, unitree-l2, mid-360, or"]);
    tune(&["--budget", "light_mw=-1"], &["budget.light_mw", "0 to 10000"]);
    let grid = ["tune", "-c", "small.toml"];
    let aim = "tune.lidar = aim: the scan pattern is not steered";
    fixture.refuses(&[&grid[..], &["--lidar", "aim"]].concat(), &[aim]);
    let tilt = "lidar.tilt 5 ° is of no use: the scan pattern is not steered";
    fixture.refuses(&[&grid[..], &["--set", "lidar.tilt=5"]].concat(), &[tilt]);
    let free = ["--tune", "lidar.tilt"];
    fixture.refuses(&[&grid[..], &free].concat(), &["lidar.tilt", "is not steered"]);
}

#[test]
fn stored_pairs_of_a_steered_sensor_are_searched_with_the_beams_of_their_one_aim() {
    let fixture = Fixture::new();
    fixture.succeed(&["store", "-q", "-c", "small.toml", "--set", STEERED, "-o", "st.pairs"]);
    let tune = ["tune", "-q", "--stored", "st.pairs", "--lidar"];
    fixture.succeed(&[&tune[..], &["full"]].concat());
    fixture.refuses(&[&tune[..], &["aim"]].concat(), &["stored pairs have the beams of one aim"]);
    let free = ["usual", "--tune", "lidar.tilt"];
    fixture.refuses(&[&tune[..], &free].concat(), &["lidar.tilt", "the beams of one aim"]);
}

#[test]
fn a_rate_is_that_of_the_beams_as_they_are_aimed() {
    let fixture = Fixture::new();
    let aim = ["--set", "lidar.columns=10", "--set", "lidar.rows=8"];
    let rate = fixture.succeed(&[&["rate", "--json"], &aim[..]].concat()).json();
    assert_eq!(rate["beams"], 80);
    fixture.refuses(&["rate", "--set", "lidar.tilt=40"], &["tilt 40 ° is beyond the mount"]);
}

#[test]
fn a_steered_sensor_that_moves_is_not_served() {
    let fixture = Fixture::new();
    let moving = ["--set", "motion.duration_s=0.1", "--set", "motion.linear_m_s=[5,0,0]"];
    fixture.refuses(&[&["serve", "/dev/null"], &moving[..]].concat(), &["stands still"]);
}

#[test]
fn a_search_of_the_aim_keeps_within_the_budget_and_writes_what_it_chose() {
    let fixture = Fixture::new();
    let sets = ["--set", STEERED, "--set", "scanner.columns=32", "--set", "scanner.rows=16"];
    let tune = ["tune", "-c", "small.toml", "--lidar", "aim", "--protocol", "lidar", "--budget"];
    fixture.succeed(&[&tune[..], &["shots_per_s=5120"], &sets[..]].concat());
    let header = fixture.read("runs/latest/history.jsonl");
    let axes = ["shots", "azimuth_span", "elevation_span", "tilt", "rows"];
    let foveas = ["azimuth_fovea", "elevation_fovea"];
    let named: Vec<String> =
        axes.iter().chain(&foveas).map(|name| format!("\"lidar.{name}\"")).collect();
    let expected = format!("\"axes\":[{}]", named.join(","));
    assert!(header.contains(&expected), "the aim alone is searched");
    let tuned = load(Some(&fixture.path("runs/latest/tuned.toml")), &[]).expect("a configuration");
    let (device, settings) = (tuned.device(), tuned.lidar.0);
    assert_eq!(device.check(&settings), Ok(()));
    let beams = device.aimed(&settings).beams();
    let shots = beams * settings.shots as u32;
    assert!((480..=512).contains(&shots), "{shots} of 512 shots a scan are used");
}
