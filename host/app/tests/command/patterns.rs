//! Scan patterns from the command line.

use std::fmt::Write as _;
use std::fs;

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
