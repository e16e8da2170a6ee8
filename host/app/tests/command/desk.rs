//! A tuning run with axes of the user's choice, extended, begun at an earlier result, or driven by
//! another optimiser.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::Stdio;

use crate::fixture::{CommandOutput, Fixture};
use serde_json::{Value, json};

const RUN: &str = "runs/latest";

/// Lines of a journal without the first: one a generation.
fn generations(fixture: &Fixture) -> Vec<Value> {
    let text = fixture.read("runs/latest/history.jsonl");
    text.lines().skip(1).map(|line| serde_json::from_str(line).expect("a line")).collect()
}

#[test]
fn only_the_axes_that_the_user_chose_are_moved_and_within_the_user_s_bounds() {
    let fixture = Fixture::new();
    fixture.tune(&[
        "--protocol=default",
        "--tune=lidar.power=60..80,linear",
        "--tune=registration.voxel_m=0.1..2",
        "--fix=lidar.gain=3",
        "--fix=registration.max_pair_distance_m=0.7",
    ]);
    let config = fixture.read("runs/latest/config.toml");
    for part in ["power = \"60..80,linear\"", "voxel_m = \"0.1..2\"", "gain = \"fixed\""] {
        assert!(config.contains(part), "{part}: {config}");
    }
    let generations = generations(&fixture);
    assert_eq!(generations.len(), (2 + 2) + (1 + 1) + 1 + 1, "halves twice, registration, both");
    for candidate in generations.iter().flat_map(|g| g["candidates"].as_array().unwrap()) {
        let values = candidate["values"].as_object().unwrap();
        let names: Vec<&str> = values.keys().map(String::as_str).collect();
        assert_eq!(names, ["lidar.power", "registration.voxel_m"]);
        assert!((60.0..=80.0).contains(&values["lidar.power"].as_f64().unwrap()));
    }
    let result = fixture.result();
    assert_eq!(result["tuned"]["lidar.gain"], 3.0);
    assert_eq!(result["tuned"]["registration.max_pair_distance_m"], 0.7);
}

#[test]
fn an_axis_that_makes_no_sense_is_refused_before_anything_is_made() {
    let fixture = Fixture::new();
    let table: [(&str, &[&str]); 11] = [
        ("--tune=lidar.shots=1..3", &["tune.axes.lidar.shots", "powers of two"]),
        ("--tune=lidar.power=100..1", &["--tune", "expected bounds that rise, found 100 to 1"]),
        ("--tune=lidar.power=1..500", &["tune.axes.lidar.power", "what the sensor takes", "100 W"]),
        ("--tune=lidar.power=1..50", &["the start, 75, is outside 1 to 50"]),
        ("--tune=lidar.powr", &["in --tune lidar.powr: there is no parameter `lidar.powr`"]),
        ("--tune=powr", &["--tune", "expected a parameter, as lidar.power"]),
        ("--tune=lidar.timing=0..2", &["tune.axes.lidar.timing", "it chooses from"]),
        ("--tune=registration.feature_radius_m", &["it is no setting of icp"]),
        ("--fix=registration.voxel", &["no parameter `registration.voxel`"]),
        ("--fix=lidar.power=500", &["power 500 W is above its maximum 100 W"]),
        ("--set=tune.axes.lidar.power=maybe", &["expected fixed, free, or bounds"]),
    ];
    for (flag, parts) in table {
        fixture.refuses(&["tune", "-c", "small.toml", flag], parts);
    }
    let twice = ["tune", "--fix=lidar.power=60", "--tune=lidar.power=50..70"];
    fixture.refuses(&twice, &["expected lidar.power once"]);
}

#[test]
fn a_finished_run_is_extended_to_what_it_would_have_been() {
    for strategy in ["--strategy=paper", "--strategy=fast"] {
        let (whole, extended) = (Fixture::new(), Fixture::new());
        extended.tuned(&[strategy]);
        let before = generations(&extended);
        extended.succeed(&["tune", "-q", "--resume", RUN, "--generations", "6"]);
        let after = generations(&extended);
        assert_eq!(after[..before.len()], before, "what was done is kept");
        assert!(after.len() > before.len(), "{strategy}");
        assert_eq!(extended.result()["generations"], after.len());
        // As if that many had been asked for; of several searches only the last goes on.
        let set = match strategy {
            "--strategy=paper" => "tune.generations=6",
            _ => "tune.extended_to=6",
        };
        whole.tune(&[strategy, "--set", set]);
        let [mut a, mut b] = [&whole, &extended].map(Fixture::result);
        assert_eq!(a["tuned"].take(), b["tuned"].take(), "{strategy}");
        let again = extended.succeed(&["tune", "-q", "--resume", RUN]);
        assert!(again.stdout.contains("recall"), "{}", again.stdout);
        assert_eq!(generations(&extended), after, "there is nothing left to do");
        extended.refuses(
            &["tune", "--resume", RUN, "--generations", "5"],
            &["--generations 5", "the run is to have 6 already"],
        );
    }
}

#[test]
fn every_command_begins_with_what_a_run_tuned() {
    let fixture = Fixture::new();
    fixture.tune(&["--fix=lidar.power=40", "--tune=lidar.shots"]);
    let tuned = fixture.result()["tuned"].clone();
    let shown: Value = fixture.succeed(&["config", "--json", "--run", RUN]).json();
    assert_eq!(shown["lidar"]["power"], 40.0);
    assert_eq!(shown["lidar"]["shots"], tuned["lidar.shots"]);
    assert_eq!(shown["registration"]["voxel_m"], tuned["registration.voxel_m"]);
    let file = fixture.succeed(&["config", "--json", "-c", "runs/latest/tuned.toml"]).json();
    assert_eq!(file, shown);

    let again = fixture.succeed(&["evaluate", "-q", "--json", "--run", RUN]).json();
    assert_eq!(again["summary"], fixture.result()["tuned_summary"]);
    let sensor = fixture.succeed(&["sensor", "--json", "--run", RUN]).json();
    assert_eq!(sensor["settings"]["power"], 40.0);
    fixture.succeed(&["scan", "-q", "--run", RUN, "-o", "a.ply"]);
    fixture.succeed(&["scan", "-q", "-c", "runs/latest/tuned.toml", "-o", "b.ply"]);
    assert!(fixture.bytes("a.ply") == fixture.bytes("b.ply"), "the same scan");

    fixture.succeed(&["pairs", "-q", "--run", RUN, "-o", "pairs"]);
    let clouds = ["pairs/000_target.ply", "pairs/000_source.ply"];
    let register = |more: &[&str]| {
        let own = [&["register", clouds[0], clouds[1], "--json"], more].concat();
        fixture.run(&own).json()
    };
    let found = register(&["--run", RUN]);
    assert_eq!(
        (&found["method"], &found["voxel_m"]),
        (&json!("icp"), &tuned["registration.voxel_m"])
    );
    assert_eq!(register(&["--run", RUN, "--voxel-m", "0.25"])["voxel_m"], 0.25);
    fixture
        .refuses(&["register", clouds[0], clouds[1], "--run", RUN, "--method", "fgr"], &["--run"]);

    // A warm start: what is tuned next begins where the run before ended.
    fixture.succeed(&["tune", "-q", "--run", RUN, "--seed", "5", "--generations", "1"]);
    assert_eq!(fixture.result()["default"], tuned);
    assert_eq!(fixture.result()["seed"], 5);
    let other = fixture.succeed(&["config", "--run", RUN, "--set", "registration.method=fgr"]);
    assert!(other.stderr.contains("so fgr starts at its own settings"), "{}", other.stderr);
    assert!(other.stdout.contains("power = 40"), "{}", other.stdout);
}

#[test]
fn a_search_begins_at_the_best_of_its_start_and_what_was_tuned_elsewhere() {
    let fixture = Fixture::new();
    fixture.tune(&["--protocol=default", "--fix=lidar.power=60"]);
    let elsewhere = fs::canonicalize(fixture.path(RUN)).expect("a run");
    fixture.write("dark.json", r#"{"parameters": {"lidar.power": 0.012, "lidar.timing": "cfd"}}"#);
    let starts = ["--warm-start", "dark.json", "--warm-start", elsewhere.to_str().expect("UTF-8")];
    let dim = [
        "--set=lidar.power=0.02",
        "--set=tune.error_mean=geometric",
        "--objective=error",
        "--tune=lidar.power=0.01..100,log",
    ];
    fixture.tune(&[&dim[..], &starts].concat());
    let found = fixture.result();
    assert_eq!(found["default"]["lidar.power"], 0.02, "the start is what is compared with");
    let finalists = found["finalists"].as_array().expect("finalists");
    let fitness = |origin: &str| {
        let one = finalists.iter().find(|one| one["origin"] == origin).expect(origin);
        one["fitness"].as_f64().expect("a number")
    };
    assert!(fitness("warm start 2") < fitness("start"));
    assert!(fitness("warm start 2") < fitness("warm start 1"));
    // Registration is searched with the sensor as the better one has it.
    let all = generations(&fixture);
    let first = all.iter().find(|generation| generation["stage"] == "registration");
    let first = first.expect("a search of registration");
    for candidate in first["candidates"].as_array().expect("candidates") {
        assert_eq!(candidate["values"]["lidar.power"], 60.0);
    }
    // Who begins with what this run tuned has nothing of where it came from.
    let gicp = ["evaluate", "-q", "--run", RUN, "--method", "gicp"];
    fixture.succeed(&gicp);
    let tuned = fixture.succeed(&["config", "--run", RUN]);
    assert!(!tuned.stdout.contains("warm_starts"), "{}", tuned.stdout);
    // The run has them itself: nothing of where they came from is asked for again.
    fs::remove_file(fixture.path("dark.json")).expect("a file");
    fs::remove_dir_all(elsewhere).expect("a folder");
    fixture.succeed(&["tune", "-q", "--resume", RUN, "--generations", "6"]);
    assert!(generations(&fixture).len() > found["generations"].as_u64().expect("a count") as usize);
}

#[test]
fn what_the_examples_have_tuned_is_a_candidate_and_a_warm_start() {
    let fixture = Fixture::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/tuned");
    let files = ["structured", "semi-structured", "unstructured"]
        .map(|kind| folder.join(format!("icp-{kind}.json")).to_string_lossy().into_owned());
    for file in &files {
        let judged = ["evaluate", "-q", "--json", "-c", "small.toml", "--candidate", file];
        let judged = fixture.succeed(&judged).json();
        let given: Value = serde_json::from_slice(&fs::read(file).expect("a file")).expect("JSON");
        let power_w = &given["parameters"]["lidar.power"];
        assert_eq!(&judged["parameters"]["lidar.power"], power_w, "{file}");
    }
    let starts: Vec<&str> = files.iter().flat_map(|file| ["--warm-start", file.as_str()]).collect();
    fixture.tune(&[&["--generations=1"], &starts[..]].concat());
    let found = fixture.result();
    let raced = |origin: String| {
        found["finalists"].as_array().expect("finalists").iter().any(|one| one["origin"] == origin)
    };
    assert!((1..=3).all(|number| raced(format!("warm start {number}"))), "{}", found["finalists"]);
}

#[test]
fn a_warm_start_that_is_none_is_refused_before_anything_is_made() {
    let fixture = Fixture::new();
    fixture.write("axis.json", r#"{"parameters": {"lidar.powr": 1}}"#);
    fixture.write("count.json", r#"{"parameters": {"lidar.shots": 1.5}}"#);
    fixture.write("text.json", r#"{"parameters": {"lidar.power": "much"}}"#);
    fixture.write("good.json", r#"{"parameters": {"lidar.power": 10}}"#);
    let table: [(&[&str], &[&str]); 7] = [
        (&["--warm-start=none.json"], &["cannot read none.json"]),
        (&["--warm-start=axis.json"], &["tune.warm_starts, 1", "unknown parameter `lidar.powr`"]),
        (
            &["--warm-start=good.json", "--warm-start=count.json"],
            &["tune.warm_starts, 2", "lidar.shots = 1.5 must be a whole number"],
        ),
        (&["--warm-start=-", "--warm-start=-"], &["standard input can be read once"]),
        (&["--warm-start=text.json"], &["text.json", "lidar.power = \"much\" must be a number"]),
        (&["--set=tune.warm_starts=[{\"lidar.power\" = nan}]"], &["lidar.power = NaN", "finite"]),
        (&["--warm-start=good.json", "--strategy=paper"], &["tune.warm_starts = 1", "one start"]),
    ];
    for (flags, parts) in table {
        fixture.refuses(&[&["tune", "-c", "small.toml"], flags].concat(), parts);
    }
}

#[test]
fn what_is_fixed_or_bounded_stays_so_where_a_pulse_has_too_much_energy() {
    let fixture = Fixture::new();
    let width = "--tune=lidar.pulse_width=5..20";
    let (_, answers) = stream(
        &fixture,
        &["--set=tune.protocol=default", "--fix=lidar.power=75", width],
        "{\"point\": [1]}\n",
    );
    let parameters = &answers[1]["parameters"];
    assert_eq!(
        (&parameters["lidar.power"], &answers[1]["repaired"]),
        (&json!(75.0), &json!(["pulse_width"]))
    );
    fixture.tune(&["--protocol=default", "--tune=lidar.power=60..100", width]);
    for generation in generations(&fixture) {
        for candidate in generation["candidates"].as_array().unwrap() {
            assert!(candidate["values"]["lidar.power"].as_f64().unwrap() >= 60.0, "{candidate}");
        }
    }
    fixture.succeed(&["config", "--run", RUN]);
}

#[test]
fn a_run_that_was_extended_and_interrupted_has_no_page_until_it_has_ended() {
    let fixture = Fixture::new();
    fixture.tuned(&["--strategy=paper"]);
    let journal = fixture.read("runs/latest/history.jsonl");
    fixture.succeed(&["tune", "-q", "--resume", RUN, "--generations", "3"]);
    fixture.succeed(&["report", "-q", RUN, "-o", "whole.html"]);
    fixture.write("runs/latest/history.jsonl", journal);
    fixture.refuses(&["report", RUN], &["was extended and interrupted", "--resume"]);
}

#[test]
fn a_folder_that_holds_no_result_is_refused_by_name() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("empty")).expect("a folder");
    fs::create_dir(fixture.path("half")).expect("a folder");
    fixture.write("half/config.toml", "");
    for command in ["scan", "evaluate", "tune", "sensor", "config"] {
        fixture.refuses(&[command, "--run", "empty"], &["empty/config.toml"]);
        fixture.refuses(&[command, "--run", "half"], &["half/result.json"]);
        fixture.refuses(&[command, "--run", "half", "-c", "small.toml"], &["--run", "--config"]);
    }
    fixture.write("half/result.json", "{\"tuned\": {\"lidar.powr\": 3}}");
    fixture.refuses(&["scan", "--run", "half"], &["half/result.json", "lidar.powr"]);
}

/// A stream on the small configuration: what is said to it, and all that it answers.
fn stream(fixture: &Fixture, more: &[&str], lines: &str) -> (CommandOutput, Vec<Value>) {
    let own = ["evaluate", "--stream", "-q", "-c", "small.toml", "--pairs", "test"];
    let mut command = fixture.command(&[&own, more].concat());
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("echoloop starts");
    let mut input = child.stdin.take().expect("an input");
    input.write_all(lines.as_bytes()).expect("it reads");
    drop(input);
    let output = CommandOutput::from_output(child.wait_with_output().expect("it ends"));
    let answers = output.stdout.lines().map(|line| serde_json::from_str(line).expect("JSON"));
    let answers = answers.collect();
    (output, answers)
}

#[test]
fn a_stream_answers_every_line_and_goes_on_after_what_it_cannot_judge() {
    let fixture = Fixture::new();
    let lines = "{\"parameters\": {\"lidar.power\": 50}, \"id\": [7]}\n\nnonsense\n\
                 {\"parameters\": {\"lidar.power\": 500}}\n{\"parameters\": {\"lidar.powr\": 5}}\n\
                 {\"parameters\": {\"lidar.pulse_width\": 20}}\n{\"point\": [0.5]}\n{}\n\
                 {\"parameters\": {\"lidar.timing\": \"late\"}}\n{\"power\": 3, \"id\": 9}\n\
                 {\"parameters\": {\"lidar.power\": 50}}";
    let (output, answers) = stream(&fixture, &[], lines);
    assert_eq!(output.code, Some(0), "{}", output.stderr);
    let [greeting, first, rest @ .., last] = &answers[..] else { panic!("{answers:?}") };
    assert_eq!((&greeting["pairs"], &greeting["count"]), (&json!("test"), &json!(3)));
    assert_eq!(greeting["axes"][0]["name"], "lidar.power");
    assert_eq!((&first["id"], &first["line"]), (&json!([7]), &json!(1)));
    let said: Vec<(u64, &str, &str)> = rest
        .iter()
        .map(|answer| {
            let kind = if answer["error"].is_string() { "error" } else { "infeasible" };
            (answer["line"].as_u64().unwrap(), kind, answer[kind].as_str().expect("a reason"))
        })
        .collect();
    let expected = [
        (3, "error", "expected"),
        (4, "infeasible", "lidar.power 500 W is above its maximum 100 W"),
        (5, "error", "unknown parameter `lidar.powr`"),
        (6, "infeasible", "pulse energy limit"),
        (7, "error", "point has 1 numbers, expected 18"),
        (8, "error", "expected either parameters or point"),
        (9, "error", "must be one of"),
        (10, "error", "unknown field `power`"),
    ];
    assert_eq!(said.len(), expected.len(), "{said:?}");
    for ((line, kind, reason), (at, expected, part)) in said.iter().zip(expected) {
        assert!((*line, *kind) == (at, expected) && reason.contains(part), "{line} {reason}");
    }
    assert_eq!(rest.last().map(|answer| &answer["id"]), Some(&json!(9)));
    assert_eq!((&last["summary"], &last["fitness"]), (&first["summary"], &first["fitness"]));

    // The numbers are those of one evaluation of the same candidate.
    fixture.write("a.json", "{\"parameters\": {\"lidar.power\": 50}}");
    let own = ["evaluate", "-q", "--json", "-c", "small.toml", "--pairs", "test"];
    let alone = fixture.succeed(&[&own[..], &["--candidate", "a.json"]].concat()).json();
    assert_eq!(alone["summary"], first["summary"]);
    assert_eq!(alone["parameters"], first["parameters"]);
}

#[test]
fn a_point_of_the_cube_is_what_its_axes_make_of_it_and_repaired_where_it_must_be() {
    let fixture = Fixture::new();
    let axes = [
        "--set=tune.protocol=default",
        "--tune=lidar.power=1..100,log",
        "--tune=lidar.pulse_width",
        "--set=tune.objective=error",
        "--set=tune.error_mean=arithmetic",
    ];
    let (_, answers) = stream(
        &fixture,
        &axes,
        "{\"point\": [0.5, 0]}\n{\"point\": [1, 1]}\n\
                                               {\"point\": [2, 0]}\n",
    );
    let names: Vec<&Value> =
        answers[0]["axes"].as_array().unwrap().iter().map(|a| &a["name"]).collect();
    assert_eq!(names, ["lidar.power", "lidar.pulse_width"]);
    assert_eq!(answers[1]["parameters"]["lidar.power"], 10.0);
    assert_eq!(answers[1]["fitness"], answers[1]["summary"]["mean_frobenius"]);
    assert_eq!(answers[2]["repaired"], json!(["power"]));
    assert!(answers[3]["infeasible"].as_str().unwrap().contains("from 0 to 1"), "{answers:?}");
}

#[test]
fn an_answer_comes_before_the_next_line_is_asked_for() {
    let fixture = Fixture::new();
    let mut command = fixture.command(&["evaluate", "--stream", "-q", "-c", "small.toml"]);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("a start");
    let mut input = child.stdin.take().expect("an input");
    let mut output = BufReader::new(child.stdout.take().expect("an output")).lines();
    let mut next = || -> Value {
        serde_json::from_str(&output.next().expect("a line").expect("text")).expect("JSON")
    };
    assert_eq!(next()["pairs"], "train");
    for power in [40, 60] {
        writeln!(input, "{{\"parameters\": {{\"lidar.power\": {power}}}}}").expect("it reads");
        assert_eq!(next()["parameters"]["lidar.power"], f64::from(power));
    }
    drop(input);
    assert!(child.wait().expect("it ends").success());
}

#[test]
fn a_table_has_a_row_for_each_pair_as_it_is_stored() {
    let fixture = Fixture::new();
    let table = fixture.tune(&["--format=csv", "--protocol=default"]).stdout;
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["set", "pair", "translation_m"]);
    let result = fixture.result();
    let of = |set: &str, summary: &str| {
        let errors = result[summary]["errors"].as_array().unwrap();
        let own = rows.iter().filter(|row| row[0] == set);
        for (row, error) in own.clone().zip(errors) {
            assert_eq!(row[2].parse::<f64>().unwrap(), error["translation_m"].as_f64().unwrap());
        }
        assert_eq!((own.count(), errors.len()), (3, 3));
    };
    of("default", "default_summary");
    of("tuned", "tuned_summary");
    let evaluated = fixture.succeed(&["evaluate", "-q", "--run", RUN, "--format=csv"]).stdout;
    assert_eq!(evaluated.lines().count(), 1 + 3);
    assert!(evaluated.lines().nth(1).unwrap().starts_with("test,0,"), "{evaluated}");
}

#[test]
fn one_axis_is_a_search_too_with_as_many_candidates_as_can_be_compared() {
    for strategy in ["--strategy=fast", "--strategy=paper"] {
        let fixture = Fixture::new();
        let one = ["--protocol=default", "--tune=lidar.gain", "--population=0", strategy];
        fixture.tune(&one);
        for generation in generations(&fixture) {
            assert_eq!(generation["candidates"].as_array().map(Vec::len), Some(2), "{strategy}");
        }
        let result = fixture.result();
        let (tuned, default) = (&result["tuned"], &result["default"]);
        let all = tuned.as_object().expect("parameters");
        let moved = all.iter().filter(|(name, value)| default[name.as_str()] != **value);
        assert!(moved.into_iter().all(|(name, _)| name == "lidar.gain"), "{strategy}: {tuned}");
    }
}
