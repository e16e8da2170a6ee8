//! `echoloop report` and `echoloop compare`: runs that are over, told from their folders alone.

use std::fs;

use crate::fixture::Fixture;
use serde_json::Value;

const RUN: &str = "runs/0001-yard-icp-joint";

/// The yard is gone, so that whoever traces it fails.
fn without_the_yard(fixture: &Fixture) {
    fs::remove_file(fixture.path("yard.obj")).expect("removed");
}

#[test]
fn a_run_s_page_is_written_again_from_its_folder_alone_and_says_who_made_it() {
    let fixture = Fixture::new();
    fixture.tune(&["--seed", "3"]);
    let tuned = fixture.bytes(&format!("{RUN}/report.html"));
    without_the_yard(&fixture);
    fixture.write(&format!("{RUN}/report.html"), "lost");
    fixture.succeed(&["report", RUN, "-q"]);
    let page = fixture.read(&format!("{RUN}/report.html"));
    assert!(page.as_bytes() == tuned, "`report` writes what `tune` wrote, byte for byte");
    let printed = fixture.succeed(&["report", "runs/latest", "-o", "-"]);
    assert!(printed.stdout.as_bytes() == tuned && printed.stderr.is_empty());

    let about: Value =
        serde_json::from_str(&fixture.read(&format!("{RUN}/about.json"))).expect("JSON");
    let session = &about["sessions"][0];
    let command = "echoloop tune -c small.toml -q --seed 3";
    assert_eq!(session["command"], command);
    for text in [command, env!("CARGO_PKG_VERSION"), session["begun"].as_str().expect("a date")] {
        assert!(page.contains(text), "the page does not say {text}");
    }
    let config = fixture.read(&format!("{RUN}/config.toml"));
    let escaped = config.replace('"', "&quot;");
    assert!(config.contains("seed = 3") && page.contains(&escaped), "the whole configuration");
    for word in ["0.1.0", "echoloop tune", "about.json"] {
        let result = fixture.read(&format!("{RUN}/result.json"));
        assert!(!result.contains(word), "result.json holds {word}");
    }
    assert!(fixture.read(&format!("{RUN}/README.txt")).contains("about.json"));
}

#[test]
fn whoever_goes_on_with_a_run_is_named_too() {
    let fixture = Fixture::new();
    fixture.tuned(&[]);
    fixture.succeed(&["tune", "-q", "--resume", RUN]);
    let page = fixture.read(&format!("{RUN}/report.html"));
    for command in ["echoloop tune -c small.toml -q", &format!("echoloop tune -q --resume {RUN}")] {
        assert!(page.contains(&format!("<code>{command}</code>")), "{command}");
    }
    fixture.write(&format!("{RUN}/about.json"), "{");
    fixture.refuses(&["tune", "-q", "--resume", RUN], &["about.json"]);
    fs::remove_file(fixture.path(&format!("{RUN}/about.json"))).expect("removed");
    let printed = fixture.succeed(&["report", RUN, "-o", "-"]);
    assert!(printed.stdout.contains("does not say who made it"));
}

#[test]
fn every_chart_of_the_page_is_a_file_that_stands_alone() {
    let fixture = Fixture::new();
    fixture.tuned(&[]);
    without_the_yard(&fixture);
    let said = fixture.succeed(&["report", RUN, "--figures", "charts/of run"]).stdout;
    let page = fixture.read(&format!("{RUN}/report.html"));
    let charts = page.matches(" data-figure=\"").count();
    assert!(charts > 20 && said.contains(&format!("{charts} charts")), "{charts}: {said}");
    let files: Vec<_> = fs::read_dir(fixture.path("charts/of run"))
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().into_string().expect("UTF-8"))
        .collect();
    assert_eq!(files.len(), 2 * charts, "{files:?}");
    for name in files {
        let bytes = fixture.bytes(&format!("charts/of run/{name}"));
        match name.ends_with(".svg") {
            true => {
                let svg = String::from_utf8(bytes).expect("UTF-8");
                assert!(svg.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\""));
                for foreign in ["var(", "url(", "href", "vector-effect", "display"] {
                    assert!(!svg.contains(foreign), "{name} holds {foreign}");
                }
            }
            false => {
                assert!(bytes.starts_with(b"\x89PNG\r\n\x1a\n") && bytes.len() > 1_500, "{name}");
            }
        }
    }
}

#[test]
fn what_is_no_finished_run_is_refused_by_name() {
    let fixture = Fixture::new();
    fixture.refuses(&["report", "absent"], &["absent", "no result.json"]);
    fixture.refuses(&["report", "small.toml"], &["small.toml", "no result.json"]);
    fixture.tuned(&[]);
    let result = format!("{RUN}/result.json");
    let whole = fixture.read(&result);
    for (damaged, said) in [
        ("{", "result.json: EOF"),
        ("{}", "result.json: no result of a run"),
        (&whole.replacen("\"format\": 1", "\"format\": 7", 1), "of format 7"),
        (&whole.replacen("\"seed\": 1", "\"seed\": \"x\"", 1), "result.json: "),
        (&whole.replacen("\"background\"", "\"back\"", 1), "an earlier version wrote it"),
    ] {
        fixture.write(&result, damaged);
        fixture.refuses(&["report", RUN], &[said]);
    }
    for (path, forged, said) in [
        ("/background/axes/0/max", serde_json::json!(-1e9), "background.axes: lidar.power goes "),
        ("/background/axes/0/max", serde_json::json!(1e300), "background.axes: lidar.power goes "),
        ("/background/correlations", serde_json::json!([[1.0]]), "correlation matrix holds 1 "),
        ("/default_summary/errors/0/points/0", serde_json::json!(u64::MAX), "before.ply: holds "),
    ] {
        let mut document: Value = serde_json::from_str(&whole).expect("JSON");
        *document.pointer_mut(path).expect(path) = forged;
        if path.contains("points") {
            // The pair that is shown is the one of the largest error.
            document["default_summary"]["errors"][0]["frobenius"] = serde_json::json!(1e9);
        }
        fixture.write(&result, document.to_string());
        fixture.refuses(&["report", RUN], &[said]);
    }
    fixture.write(&result, &whole);
    let after = format!("{RUN}/after.ply");
    let cloud = fixture.bytes(&after);
    fixture.write(&after, "ply\n");
    fixture.refuses(&["report", RUN], &["after.ply"]);
    let one = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
               property float z\nend_header\n1 2 3\n";
    fixture.write(&after, one);
    fixture.refuses(&["report", RUN], &["after.ply: holds 1 points, and result.json says "]);
    fixture.write(&after, cloud);
    let history = format!("{RUN}/history.jsonl");
    let journal = fixture.read(&history);
    fixture.write(&history, &journal[..journal.len() - 9]);
    fixture.refuses(&["report", RUN], &["history.jsonl: line ", "cut off"]);
    fixture.write(&history, &journal);
    fixture.refuses(&["report", RUN, "-o", "absent/page.html"], &["absent/page.html"]);
    fixture.refuses(&["report", RUN, "--figures", "small.toml"], &["small.toml"]);
    fixture.succeed(&["report", RUN]);
}

/// Two runs on the same pairs, from starts that differ, as so short a search may keep them; and one
/// with another seed.
fn three_runs(fixture: &Fixture) {
    fixture.tuned(&["--generations", "1", "--population", "2"]);
    fixture.tune(&["--generations", "2", "--population", "3", "--set", "lidar.power=60"]);
    fixture.tune(&["--generations", "1", "--population", "2", "--seed", "7"]);
}

const THREE: [&str; 3] = [RUN, "runs/0002-yard-icp-joint", "runs/0003-yard-icp-joint"];

#[test]
fn runs_stand_side_by_side_with_differences_where_their_pairs_are_the_same() {
    let fixture = Fixture::new();
    three_runs(&fixture);
    without_the_yard(&fixture);
    let compare =
        |more: &[&str]| fixture.succeed(&[&["compare"], &THREE[..], more].concat()).stdout;
    let text = compare(&[]);
    for part in [
        "recall",
        "mean e_R",
        "energy",
        "runs/0002-yard-icp-joint against runs/0001-yard-icp-joint, pair by pair on 3 pairs:",
        "  recall      ",
        "no difference shown",
        "runs/0003-yard-icp-joint against runs/0001-yard-icp-joint: no differences pair by pair, \
         for pairs or what counts as success are not the same (seed is 7 here and 1 in the first)",
        "settings that differ",
        "tune.generations",
        "parameters that differ",
        "lidar.power",
    ] {
        assert!(text.contains(part), "{part:?} is not in\n{text}");
    }
    assert!(!text.contains("scene.source"), "what is the same is left out: {text}");

    let json: Value = serde_json::from_str(&compare(&["--json"])).expect("JSON");
    let summary = |run: &str| -> Value {
        let result: Value =
            serde_json::from_str(&fixture.read(&format!("{run}/result.json"))).expect("JSON");
        result["tuned_summary"].clone()
    };
    for (run, name) in json["runs"].as_array().expect("runs").iter().zip(THREE) {
        assert_eq!(run["run"], name);
        assert_eq!(run["tuned"]["recall_pct"]["value"], summary(name)["recall_pct"]);
        assert_eq!(run["cost"], summary(name)["cost"]);
    }
    assert!(json["runs"][0]["against_first"].is_null());
    assert_eq!(json["runs"][1]["against_first"]["recall_pct"]["is_shown"], false);
    assert!(json["runs"][2]["against_first"]["other_pairs"].is_string());
    assert_eq!(json["settings"]["seed"], serde_json::json!(["1", "1", "7"]));

    let csv = compare(&["--format", "csv"]);
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    let column = |name: &str| rows[0].iter().position(|head| *head == name).expect(name);
    assert_eq!(rows.len(), 4);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()), "{csv}");
    let paired: Vec<&str> = rows[1..].iter().map(|row| row[column("paired")]).collect();
    assert_eq!(paired, ["", "yes", "no"]);
    let seeds: Vec<&str> = rows[1..].iter().map(|row| row[column("setting seed")]).collect();
    assert_eq!(seeds, ["1", "1", "7"]);
    let recall: f64 = rows[2][column("recall_pct")].parse().expect("a number");
    assert_eq!(recall, summary(THREE[1])["recall_pct"].as_f64().expect("a number"));

    let page = compare(&["-o", "-"]);
    for part in ["3 runs compared", "Side by side", "tune.generations", "other held-out pairs"] {
        assert!(page.contains(part), "the page does not say {part}");
    }
    assert_eq!(page.matches("<td data-head=\"Recall").count(), 3);
    assert!(compare(&["-o", "page.html"]).contains("recall"), "the table too");
    assert!(fixture.read("page.html") == page);
    let Some(page) = crate::browser::open("compared.html", &page, &[]) else { return };
    page.assert_no_complaints();
}

#[test]
fn what_cannot_be_compared_is_refused_by_name() {
    let fixture = Fixture::new();
    fixture.tuned(&["--generations", "1", "--population", "2"]);
    fixture.refuses(&["compare", RUN], &["two runs or more"]);
    fixture.refuses(&["compare", RUN, "absent"], &["absent", "no result.json"]);
    let other = "runs/other";
    fs::create_dir(fixture.path(other)).expect("a folder");
    for name in ["config.toml", "result.json"] {
        fixture.write(&format!("{other}/{name}"), fixture.bytes(&format!("{RUN}/{name}")));
    }
    // Neither journal nor clouds are needed.
    fixture.succeed(&["compare", RUN, other]);
    let result = fixture.read(&format!("{other}/result.json"));
    let newer = result.replacen("\"format\": 1", "\"format\": 2", 1);
    fixture.write(&format!("{other}/result.json"), newer);
    fixture.refuses(&["compare", RUN, other], &["runs/other/result.json: of format 2"]);
    fixture.write(&format!("{other}/result.json"), &result);
    fixture.write(&format!("{other}/config.toml"), "seed = \"x\"\n");
    fixture.refuses(&["compare", RUN, other], &["runs/other/config.toml: "]);
    fixture.refuses(&["compare", RUN, other, "--json", "--format", "csv"], &["--format"]);
}
