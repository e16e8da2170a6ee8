//! The paper's table: an end by force loses nothing, other folders are left alone, one cell's
//! failure is not the others', and nothing that is judged on reaches what is chosen.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;

use crate::fixture::Fixture;
use echoloop_closed_loop::run_folder::journal::Journal;
use serde_json::{Value, json};

/// Cells that take a moment each.
const SMALL: [&str; 21] = [
    "reproduce",
    "-q",
    "--scene",
    "structured",
    "--ranges",
    "outdoor",
    "--strategy",
    "fast",
    "--train-pairs",
    "3",
    "--generations",
    "3",
    "--set",
    "scene.towns=[1]",
    "--set",
    "scanner.columns=48",
    "--set",
    "scanner.rows=16",
    "--set",
    "tune.population=4",
    "--pairs=3",
];

fn small<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&SMALL, more].concat()
}

fn table(fixture: &Fixture, folder: &str) -> Value {
    serde_json::from_slice(&fixture.bytes(&format!("{folder}/table.json"))).expect("a table")
}

/// Each cell with a part of it.
fn of_rows(table: &Value, part: &str) -> BTreeMap<String, Value> {
    let rows = table["rows"].as_array().expect("rows").iter();
    rows.map(|row| (row["cell"].to_string(), row.pointer(part).cloned().unwrap_or_default()))
        .collect()
}

#[test]
fn killed_at_any_moment_it_goes_on_and_the_table_is_the_same_on_one_thread_and_two() {
    let fixture = Fixture::new();
    let cells = ["--method", "mac"];
    fixture.succeed(&small(&[&cells[..], &["--runs", "whole", "--threads", "1"]].concat()));
    let killed = small(&[&cells[..], &["--runs", "killed", "--threads", "2"]].concat());
    let mut child = fixture.command(&killed).stdout(Stdio::null()).spawn().expect("it starts");
    let journal = fixture.path("killed/runs/outdoor-fast-lidar-mac-structured/history.jsonl");
    let lines = || fs::read_to_string(&journal).unwrap_or_default().lines().count();
    while lines() < 3 && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().expect("SIGKILL");
    child.wait().expect("it ends");
    let done = || fs::read_dir(fixture.path("killed/cells")).expect("cells").count();
    let before = done();
    assert!((1..4).contains(&before), "{before} cells done when it was killed");
    fixture.succeed(&killed);
    assert_eq!(done(), 4);
    for name in [
        "table.json",
        "report.html",
        "runs/outdoor-fast-joint-mac-structured/history.jsonl",
        "runs/outdoor-fast-joint-mac-structured/result.json",
        "cells/outdoor-fast-joint-mac-structured.json",
    ] {
        let [whole, killed] = ["whole", "killed"].map(|of| fixture.bytes(&format!("{of}/{name}")));
        assert!(whole == killed, "{name} is another after a kill, or on other threads");
    }
    // Nothing is left to do, and a run is one that other commands know.
    let again = fixture.succeed(&small(&[&cells[..], &["--runs", "whole", "--json"]].concat()));
    assert_eq!(again.stdout.as_bytes(), fixture.bytes("whole/table.json"));
    fixture.succeed(&["report", "whole/runs/outdoor-fast-joint-mac-structured"]);
}

#[test]
fn what_is_judged_on_reaches_neither_the_search_nor_the_choice() {
    let fixture = Fixture::new();
    let methods = "fgr,mac";
    let more = |pairs, runs| small(&["--method", methods, "--pairs", pairs, "--runs", runs]);
    // The last of a flag given twice is not taken: the small one is left out.
    let with = |pairs: &'static str, runs: &'static str| {
        let mut arguments = more(pairs, runs);
        arguments.retain(|argument| *argument != "--pairs=3");
        arguments
    };
    fixture.succeed(&with("3", "three"));
    fixture.succeed(&with("5", "five"));
    let tables = ["three", "five"].map(|folder| table(&fixture, folder));
    for part in ["/made/parameters", "/made/origin", "/made/registrations"] {
        let [three, five] = tables.each_ref().map(|table| of_rows(table, part));
        assert_eq!(three, five, "{part} hangs on the held-out pairs");
    }
    let [three, five] = tables.each_ref().map(|table| of_rows(table, "/figures"));
    assert!(three != five, "other pairs were judged on");
    let searches = ["lidar", "registration", "joint"]
        .into_iter()
        .flat_map(|protocol| methods.split(',').map(move |method| format!("{protocol}-{method}")));
    for search in searches {
        let run = format!("runs/outdoor-fast-{search}-structured/history.jsonl");
        let generations = |folder: &str| {
            let (_, generations) =
                Journal::read(&fixture.path(folder).join(&run)).expect("a journal");
            serde_json::to_vec(&generations).expect("they are written")
        };
        assert!(generations("three") == generations("five"), "{search}: another search");
    }
}

#[test]
fn a_folder_of_another_seed_or_other_settings_is_refused_with_both_values_and_stays() {
    let fixture = Fixture::new();
    let start = ["--method", "icp", "--protocol", "default", "--runs", "table"];
    fixture.succeed(&small(&start));
    fixture.refuses(
        &small(&[&start[..], &["--seed", "7"]].concat()),
        &["table", "seed is 1 there and 7 now", "--runs"],
    );
    fixture.refuses(
        &small(&[&start[..], &["--set", "data.tilt_range_deg=3"]].concat()),
        &["data.tilt_range_deg is 2.0 there and 3.0 now"],
    );
    fixture.refuses(&small(&[&start[..], &["--quick"]].concat()), &["--quick is false there"]);
    for name in ["plan.json", "cells/outdoor-default-icp-structured.json"] {
        let name = format!("table/{name}");
        let older = fixture.read(&name).replace("\"version\": \"", "\"version\": \"0.0.1-");
        fixture.write(&name, older);
    }
    fixture.refuses(&small(&start), &["version is 0.0.1-", "there and "]);
    // To look at it, whoever made it, is no harm.
    let seen = fixture.succeed(&small(&[&start[..], &["--table"]].concat()));
    assert!(seen.stdout.contains("1 of 1 cells done"), "{}", seen.stdout);
}

#[test]
fn a_cell_that_fails_is_told_and_kept_the_others_go_on_and_it_is_tried_again() {
    let fixture = Fixture::new();
    let cells = ["--method", "icp", "--protocol", "lidar,registration", "--runs", "table"];
    let in_the_way = "table/runs/outdoor-fast-lidar-icp-structured";
    fs::create_dir_all(fixture.path("table/runs")).expect("a folder");
    // A folder of something else is none of ours.
    fixture.refuses(&small(&cells), &["table", "plan.json"]);
    fs::remove_dir_all(fixture.path("table")).expect("it goes");
    fixture.succeed(&small(&["--method", "icp", "--protocol", "default", "--runs", "table"]));
    fs::create_dir_all(fixture.path("table/runs")).expect("a folder");
    fixture.write(in_the_way, "in the way");
    let output = fixture.run(&small(&cells));
    assert_eq!(output.code, Some(1), "{}", output.stderr);
    assert!(output.stderr.contains("1 of 2 cells failed"), "{}", output.stderr);
    assert!(output.stderr.contains("outdoor-fast-lidar-icp-structured"), "{}", output.stderr);
    assert!(output.stdout.contains("failed") && output.stdout.contains("1 of 2 cells done"));
    let errors = of_rows(&table(&fixture, "table"), "/error");
    assert_eq!(errors.values().filter(|error| error.is_string()).count(), 1);
    fs::remove_file(fixture.path(in_the_way)).expect("it goes");
    let output = fixture.succeed(&small(&cells));
    assert!(output.stdout.contains("2 of 2 cells done"), "{}", output.stdout);
    assert!(!fixture.path("table/cells/outdoor-fast-lidar-icp-structured.failed").exists());
}

#[test]
fn a_record_that_is_broken_or_of_something_else_is_its_cell_s_failure_and_stays_as_it_is() {
    let fixture = Fixture::new();
    let cells = ["--method", "icp,mac", "--protocol", "default", "--runs", "table"];
    fixture.succeed(&small(&cells));
    let [icp, mac] = ["icp", "mac"].map(|method| {
        let name = format!("table/cells/outdoor-default-{method}-structured.json");
        (fixture.read(&name), name)
    });
    let changes: [(&str, String); 4] = [
        ("EOF", icp.0[..icp.0.len() / 2].to_owned()),
        ("seed is 7 in it and 1 in the table", icp.0.replace("\"seed\": 1", "\"seed\": 7")),
        ("cell is MAC", mac.0.clone()),
        ("build is ", icp.0.replace("\"build\": \"", "\"build\": \"0")),
    ];
    for (told, text) in changes {
        assert_ne!(text, icp.0, "{told}");
        fixture.write(&icp.1, &text);
        let output = fixture.run(&small(&cells));
        assert_eq!(output.code, Some(1), "{told}: {}", output.stderr);
        assert!(output.stderr.contains(told), "no {told:?}: {}", output.stderr);
        assert!(output.stderr.contains("outdoor-default-icp-structured.json"), "{told}");
        assert!(output.stdout.contains("1 of 2 cells done"), "{told}: {}", output.stdout);
        assert_eq!(fixture.read(&icp.1), text, "{told}: it was written over");
    }
    fs::remove_file(fixture.path(&icp.1)).expect("it goes");
    fixture.succeed(&small(&cells));
    assert_eq!(fixture.read(&icp.1), icp.0, "the same cell again");
}

#[test]
fn a_search_that_finds_nothing_is_a_cell_that_keeps_its_start() {
    let fixture = Fixture::new();
    // So little light that no scan has points enough.
    let dark = ["--set", "lidar.power=0.00001", "--set", "emitter.energy_limit_nj=0.001"];
    let cells = ["--method", "icp", "--protocol", "registration", "--runs", "table"];
    for strategy in ["fast", "paper"] {
        let both = SMALL.map(|word| if word == "fast" { strategy } else { word });
        fixture.succeed(&[&both[..], &cells, &dark].concat());
        let name = format!("table/cells/outdoor-{strategy}-registration-icp-structured.json");
        let record: Value = serde_json::from_slice(&fixture.bytes(&name)).expect("a record");
        assert_eq!(record["origin"], "start", "{strategy}");
        assert_eq!(record["summary"]["recall_pct"], 0.0, "{strategy}");
        assert!(record["registrations"].as_u64().is_some_and(|made| made > 10), "{strategy}");
    }
}

#[test]
fn the_table_stands_beside_the_paper_s_in_every_form_and_names_seed_version_and_scans() {
    let fixture = Fixture::new();
    let cells = small(&["--method", "icp", "--runs", "table", "--seed", "5"]);
    // Aloud, it says how far it is.
    let aloud: Vec<&str> = cells.iter().copied().filter(|word| *word != "-q").collect();
    let output = fixture.succeed(&[&aloud[..], &["-o", "page.html"]].concat());
    for said in ["4 cells, 0 of them done before", "cell 1 of 4: ICP, structured, nothing tuned"] {
        assert!(output.stderr.contains(said), "no {said:?}: {}", output.stderr);
    }
    assert!(output.stderr.contains("time left not known yet"), "{}", output.stderr);
    let last = output.stderr.lines().find(|line| line.starts_with("cell 4 of 4: "));
    assert!(last.is_some_and(|line| line.ends_with(" left")), "{}", output.stderr);
    assert!(output.stderr.contains("4 cells took "), "{}", output.stderr);
    let text = output.stdout;
    let joint = text.lines().find(|line| line.starts_with("ICP") && line.contains(" joint"));
    let joint = joint.expect("a row");
    assert!(
        joint.contains("100 %") && joint.contains("1 cm") && joint.ends_with("0.1°"),
        "{joint}"
    );
    assert!(text.contains("tuning both together is best") && text.contains("seed 5"), "{text}");
    assert_eq!(fixture.bytes("page.html"), fixture.bytes("table/report.html"));
    let form = |form| fixture.succeed(&[&cells[..], &["--format", form]].concat()).stdout;
    let json: Value = serde_json::from_str(&form("json")).expect("JSON");
    assert_eq!(json["plan"]["seed"], 5);
    assert_eq!(json["plan"]["version"], env!("CARGO_PKG_VERSION"));
    let scans = of_rows(&json, "/made/content/scans");
    assert!(scans.values().all(|sum| sum.as_str().is_some_and(|sum| sum.len() == 16)));
    let csv = form("csv");
    assert_eq!(csv.lines().count(), 5, "a head and four protocols: {csv}");
    assert!(csv.starts_with("ablation,ranges,strategy,tuned,method,scene,seed,pairs,recall_pct,"));
    let fields = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let head = fields(csv.lines().next().expect("a head"));
    let field = |tuned: &str, name: &str| {
        let place = |name: &str| head.iter().position(|own| own == name).expect("a column");
        let of = |line: &Vec<String>| line[place("tuned")] == tuned;
        csv.lines().map(fields).find(of).expect("a line")[place(name)].clone()
    };
    assert_eq!(field("joint", "version"), env!("CARGO_PKG_VERSION"));
    assert_eq!(field("joint", "build"), json["plan"]["build"].as_str().expect("a build"));
    let beside = &json["paired"].as_array().expect("pairs")[2]; // registration alone
    assert_eq!(beside["other"]["protocol"], "registration");
    let ratio = field("joint", "rte_ratio").parse().ok();
    assert_eq!(ratio, beside["translation_ratio"]["value"].as_f64());
    assert_eq!(field("joint", "lost"), beside["lost"].to_string());
    assert_eq!(field("registration", "rte_ratio"), "");
    let latex = form("latex");
    assert!(latex.contains("\\begin{tabular}") && latex.contains("joint & ICP & "), "{latex}");
    let ends = latex.lines().filter(|line| line.ends_with("\\\\")).count();
    assert_eq!(ends, 2 + 2 * 4, "two lines of heads, two a protocol: {latex}");
    let errors_m = of_rows(&json, "/figures/mean_translation_m/value");
    let least_m = errors_m.values().filter_map(Value::as_f64).fold(f64::INFINITY, f64::min);
    assert!(latex.contains(&format!("\\textbf{{{:.2}}}", 100.0 * least_m)), "{least_m}: {latex}");
}

#[test]
fn switches_make_a_second_table_beside_the_cells_without_them() {
    let fixture = Fixture::new();
    let cells = small(&["--method", "icp", "--protocol", "registration", "--runs", "table"]);
    fixture.succeed(&cells);
    let switches = "other-town,other-kind,quarter-density,ideal-detector,rain-and-motion,os1-64";
    let switched = [&cells[..], &["--ablation", switches]].concat();
    let output = fixture.run(&switched);
    // Sixteen rows are none of an OS1-64's.
    assert_eq!(output.code, Some(1), "{}", output.stderr);
    assert!(output.stderr.contains("scanner.rows = 16 must be left out"), "{}", output.stderr);
    assert!(output.stdout.contains("One thing switched"), "{}", output.stdout);
    for switch in
        ["other-town", "other-kind", "quarter-density", "ideal-detector", "rain-and-motion"]
    {
        let row = output.stdout.lines().find(|line| line.starts_with(switch)).expect(switch);
        assert!(!row.ends_with('–'), "nothing beside it: {row}");
    }
    let name = |ablation: &str| {
        format!("table/cells/{ablation}outdoor-fast-registration-icp-structured.json")
    };
    let record = |ablation: &str| -> Value {
        serde_json::from_slice(&fixture.bytes(&name(ablation))).expect("a record")
    };
    let plain = record("");
    for (elsewhere, source, towns) in
        [("other-town-", "structured", [101]), ("other-kind-", "semi-structured", [1])]
    {
        let other = record(elsewhere);
        assert_eq!(plain["configuration"], other["configuration"], "it is judged in the same town");
        assert_ne!(plain["content"]["scans"], other["content"]["scans"], "and tuned in another");
        assert_eq!(other["trained_in"], json!({"source": source, "towns": towns}));
    }
    assert!(plain.get("trained_in").is_none(), "where it is tuned where it is judged");
    let latex = fixture.run(&[&switched[..], &["--format", "latex"]].concat()).stdout;
    let of_switches = latex.split_once("\nSwitch & ").expect("a table of switches").1;
    for switch in switches.split(',').filter(|switch| *switch != "os1-64") {
        let row = of_switches.lines().find(|line| line.starts_with(switch)).expect(switch);
        assert_eq!((row.matches('&').count(), row.matches("textcolor").count()), (10, 3), "{row}");
    }
    assert_ne!(record("ideal-detector-")["summary"], plain["summary"], "another found the echoes");
    assert!(!Path::new(&fixture.path(&name("os1-64-"))).exists());
}

#[test]
fn a_warm_start_of_the_cells_races_in_each_search_and_what_is_none_fails_its_cell() {
    let fixture = Fixture::new();
    let dim = ["--set", "lidar.power=0.02", "--protocol", "default,joint", "--runs", "table"];
    let warm = r#"tune.warm_starts=[{"lidar.power" = 60.0, "registration.kernel_width" = 0.1}]"#;
    let asked = small(&[&dim[..], &["--method", "icp,mac", "--set", warm]].concat());
    let output = fixture.run(&asked);
    // MAC has no kernel.
    assert_eq!(output.code, Some(1), "{}", output.stderr);
    let refused = "tune.warm_starts, 1: unknown parameter `registration.kernel_width`";
    assert!(output.stderr.contains(refused), "{}", output.stderr);
    let mut done: Vec<_> = fs::read_dir(fixture.path("table/cells"))
        .expect("cells")
        .map(|cell| cell.expect("a cell").file_name().into_string().expect("UTF-8"))
        .collect();
    done.sort();
    let expected = [
        "outdoor-default-icp-structured.json",
        "outdoor-default-mac-structured.json",
        "outdoor-fast-joint-icp-structured.json",
        "outdoor-fast-joint-mac-structured.failed",
    ];
    assert_eq!(done, expected, "what is not searched takes no warm start");
    let run = "table/runs/outdoor-fast-joint-icp-structured/result.json";
    let result: Value = serde_json::from_slice(&fixture.bytes(run)).expect("a result");
    let finalists = result["finalists"].as_array().expect("finalists");
    let fitness = |origin: &str| {
        let one = finalists.iter().find(|one| one["origin"] == origin).expect(origin);
        one["fitness"].as_f64().expect("a number")
    };
    assert!(fitness("warm start 1") < fitness("start"), "the start has no light");
}

#[test]
fn what_the_cells_set_themselves_is_refused_with_the_flag_for_it() {
    let fixture = Fixture::new();
    for (set, flag) in [
        ("scene.source=structured", "--scene"),
        ("registration.mode=open3d", "--method"),
        ("tune.protocol=joint", "--protocol"),
    ] {
        fixture.refuses(&["reproduce", "--set", set], &[set.split('=').next().unwrap(), flag]);
    }
    let switched = ["reproduce", "--ranges", "paper", "--ablation", "registration-ranges"];
    fixture.refuses(&switched, &["--ablation registration-ranges", "--ranges outdoor"]);
    fixture.refuses(&["reproduce", "--pairs", "0"], &["--pairs"]);
    fixture.refuses(&["reproduce", "--table", "--runs", "none"], &["none", "plan.json"]);
}
