//! `echoloop register` of many pairs: each as alone, kept as it is done, and named when it fails.
//! `echoloop evaluate` of the same: judged as traced pairs are.

use std::fs;

use crate::fixture::{CommandOutput, Fixture};
use echoloop_closed_loop::run_folder::files::Lock;
use echoloop_clouds::pose::{Pose, from_rows, read_trajectory, to_kitti};
use echoloop_clouds::read_cloud;
use serde_json::{Value, json};

/// Folder `pairs` of three pairs with the truth of each, of a sensor that sees all around.
fn pairs(fixture: &Fixture) {
    let sensor = ["scanner.pattern=grid", "scanner.columns=720", "scanner.rows=48"];
    let all_around = "scanner.azimuth_deg=360";
    let few = ["scene.towns=[7]", "data.train_pairs=1", "data.test_pairs=3"];
    let keys = sensor.into_iter().chain([all_around]).chain(few);
    let sets: Vec<&str> = keys.flat_map(|key| ["--set", key]).collect();
    let scene = ["pairs", "-q", "--scene", "structured", "-o", "pairs"];
    fixture.succeed(&[&scene[..], &sets].concat());
}

fn lines(text: &str) -> Vec<Value> {
    text.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect()
}

#[test]
fn each_pair_of_a_folder_is_registered_as_alone_and_judged_by_its_truth() {
    let fixture = Fixture::new();
    pairs(&fixture);
    let all = ["register", "pairs", "--json", "--method", "icp"];
    let told = fixture.succeed(&[&all[..], &["--report", "page.html"]].concat());
    let records = lines(&told.stdout);
    let names: Vec<&str> = records.iter().filter_map(|record| record["name"].as_str()).collect();
    assert_eq!(names, ["000", "001", "002"]);
    for record in &records {
        let [target, source] =
            ["target", "source"].map(|key| record[key].as_str().expect("a path"));
        let alone = fixture.run(&["register", target, source, "-q", "--json", "--method", "icp"]);
        let alone = alone.json();
        for key in ["target_from_source", "converged", "iterations", "pairs", "rmse_m", "supported"]
        {
            assert_eq!(record[key], alone[key], "{key} of {target}");
        }
        assert!(record["translation_error_m"].as_f64().expect("an error") < 0.1, "{record}");
    }
    assert!(told.stderr.contains("of 3, within 0.5 m and 2.5° of the truth"), "{}", told.stderr);
    let page = fixture.read("page.html");
    let worst = records.iter().max_by(|a, b| {
        let error = |of: &Value| of["translation_error_m"].as_f64().expect("an error");
        error(a).total_cmp(&error(b))
    });
    let worst = worst.and_then(|worst| worst["name"].as_str()).expect("three pairs");
    assert!(page.contains(&format!("{worst}, the worst of all: the target stands still")));
    assert!(names.iter().all(|name| page.contains(&format!("<th scope=\"row\">{name}</th>"))));
    // A table says the same, with one thread too.
    let rows: Vec<String> =
        (0..3).map(|n| format!("00{n},pairs/00{n}_target.ply,pairs/00{n}_source.ply\n")).collect();
    fixture.write("list.csv", format!("name,target,source\n{}", rows.concat()));
    let mut table = all.map(str::to_owned);
    table[1] = "list.csv".into();
    let table: Vec<&str> = table.iter().map(String::as_str).chain(["--threads", "1"]).collect();
    for (mut own, of_table) in records.into_iter().zip(lines(&fixture.succeed(&table).stdout)) {
        (own["translation_error_m"], own["rotation_error_deg"]) = (Value::Null, Value::Null);
        assert_eq!(own, of_table);
    }
}

#[test]
fn what_is_done_is_kept_and_the_rest_goes_on() {
    let fixture = Fixture::new();
    pairs(&fixture);
    let command = ["register", "pairs", "-q", "-o", "done"];
    let whole = fixture.succeed(&command);
    let kept = fixture.read("done/registered.jsonl");
    assert_eq!(kept.lines().count(), 4, "settings, and a line a pair");
    assert_eq!(whole.stdout.matches(",true,").count(), 3, "{}", whole.stdout);
    assert_eq!(fixture.succeed(&command).stdout, whole.stdout);
    assert_eq!(fixture.read("done/registered.jsonl"), kept, "nothing is done again");
    let laid = fixture.bytes("done/001.ply");
    // As if it had ended within the second line.
    let cut = kept.find('\n').and_then(|end| kept[end + 1..].find('\n').map(|n| end + n + 60));
    fixture.write("done/registered.jsonl", &kept[..cut.expect("lines")]);
    fs::remove_file(fixture.path("done/001.ply")).expect("laid");
    assert_eq!(fixture.succeed(&command).stdout, whole.stdout);
    let sorted = |text: &str| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines.sort();
        lines.dedup();
        lines
    };
    assert_eq!(sorted(&fixture.read("done/registered.jsonl")), sorted(&kept));
    assert_eq!(fixture.bytes("done/001.ply"), laid);
    fixture.refuses(
        &["register", "pairs", "-q", "-o", "done", "--voxel-m", "0.3"],
        &["done/registered.jsonl", "other settings", "voxel_m=0.3"],
    );
}

#[test]
fn an_output_that_is_an_input_is_refused_before_any_work() {
    let fixture = Fixture::new();
    let row = "1 0 0 0 0 1 0 0 0 0 1 0\n";
    ["drive", "apart"].iter().for_each(|name| {
        fs::create_dir(fixture.path(name)).expect("a folder");
    });
    let written = ["1.ply", "2.ply", "3.ply"].map(|name| format!("drive/{name}"));
    written.iter().for_each(|name| fixture.write(name, "a scan"));
    let refuses = |arguments: &[&str], file: &str| {
        let said = [&format!("{file}: is an input, and would be overwritten")[..]];
        fixture.refuses(&[&["register", "-q", "--method", "icp"], arguments].concat(), &said);
    };
    refuses(&["drive", "--sequence", "-o", "drive"], "drive/2.ply");
    refuses(&["drive", "--sequence", "-o", "apart/../drive/"], "drive/2.ply");
    // A table names the pair as its source lies in the folder.
    fixture.write("list.csv", "name,target,source\n3,drive/1.ply,drive/3.ply\n");
    refuses(&["list.csv", "-o", "drive"], "drive/3.ply");
    fixture.write("apart/poses_tum.txt", row.repeat(3));
    let truth = ["drive", "--sequence", "--truth", "apart/poses_tum.txt", "-o", "apart"];
    refuses(&truth, "apart/poses_tum.txt");
    refuses(&["list.csv", "--report", "list.csv"], "list.csv");
    assert!(written.iter().all(|name| fixture.read(name) == "a scan"));
    let left = |folder| fs::read_dir(fixture.path(folder)).expect("a folder").count();
    assert_eq!((left("drive"), left("apart")), (3, 1), "nothing is begun");
}

#[test]
fn one_process_at_a_time_keeps_a_folder() {
    let fixture = Fixture::new();
    fixture.succeed(&["pairs", "-q", "-c", "small.toml", "-o", "pairs"]);
    let command = ["register", "pairs", "-q", "--method", "icp", "-o", "deep/done"];
    fixture.succeed(&command);
    let whole = fixture.read("deep/done/registered.jsonl");
    let path = fixture.path("deep/done/registered.lock");
    assert!(!path.exists(), "released");
    let held = Lock::take(&path).expect("no other has it");
    fixture.refuses(&command, &["deep/done/registered.lock", "another process"]);
    drop(held);
    fixture.succeed(&command);
    assert_eq!(fixture.read("deep/done/registered.jsonl"), whole);
}

#[test]
fn a_pair_that_cannot_be_read_is_named_and_the_others_are_done() {
    let fixture = Fixture::new();
    pairs(&fixture);
    fixture.write("pairs/001_source.ply", "no cloud");
    let told = fixture.run(&["register", "pairs", "--method", "icp"]);
    assert_eq!(told.code, Some(2));
    assert!(told.stderr.contains("not tried: 001: pairs/001_source.ply: "), "{}", told.stderr);
    let rows: Vec<&str> = told.stdout.lines().collect();
    assert_eq!(rows.len(), 4, "a heading and three pairs");
    assert!(rows[0].starts_with("name,target,source,converged") && rows[3].starts_with("002,"));
    let columns = rows[0].split(',').count();
    assert!([rows[1], rows[3]].iter().all(|row| row.split(',').count() >= columns));
}

#[test]
fn a_pair_that_is_not_whole_is_named_and_the_others_are_done() {
    let fixture = Fixture::new();
    fixture.succeed(&["pairs", "-q", "-c", "small.toml", "-o", "pairs"]);
    fs::rename(fixture.path("pairs/000_source.ply"), fixture.path("lone.ply")).expect("renamed");
    fixture.write("pairs/001_source.pcd", "");
    let list = "name,target,source,truth\n\
                a,,lone.ply,\n\
                b,pairs/002_target.ply\n\
                c,pairs/002_target.ply,pairs/002_source.ply,pairs/002_target_from_source.txt\n";
    fixture.write("list.csv", list);
    let lone = "000: expected both 000_target.* and 000_source.*";
    let two = "001: expected one 001_source.*, found pairs/001_source.pcd and";
    let lacks = "a: row 1 lacks its target or source";
    let cells = "b: row 2: expected 4 cells, as its heading, found 2";
    for (path, whole, said) in [("pairs", "002", [lone, two]), ("list.csv", "c", [lacks, cells])] {
        let register = ["register", path, "--method", "icp", "--json"];
        let registered = fixture.run(&register);
        let judged = fixture.run(&["evaluate", "-c", "small.toml", "--pairs", path, "--json"]);
        for told in [&registered, &judged] {
            assert_eq!(told.code, Some(2), "{}", told.stderr);
            for said in said.iter().chain(&["2 pairs could not be tried"]) {
                assert!(told.stderr.contains(said), "{said} in {}", told.stderr);
            }
        }
        let records = lines(&registered.stdout);
        assert_eq!((records.len(), &records[2]["name"]), (3, &json!(whole)));
        assert!(records[2]["target_from_source"].is_array(), "{}", records[2]);
        let judged: Value = serde_json::from_str(&judged.stdout).expect("a document");
        assert_eq!(judged["names"], json!([whole]));
    }
}

#[test]
fn a_sequence_is_chained_to_a_trajectory() {
    let fixture = Fixture::new();
    pairs(&fixture);
    fs::create_dir(fixture.path("drive")).expect("a folder");
    let mut poses = String::new();
    for (scan, (name, pose)) in
        [("target", "target"), ("source", "source"), ("target", "target")].into_iter().enumerate()
    {
        let cloud = fixture.bytes(&format!("pairs/000_{name}.ply"));
        fixture.write(&format!("drive/{scan:06}.ply"), cloud);
        let rows = fixture.read(&format!("pairs/000_world_from_{pose}.txt"));
        let numbers: Vec<&str> = rows.split_whitespace().take(12).collect();
        poses += &(numbers.join(" ") + "\n");
    }
    fixture.write("drive/poses.txt", &poses);
    let all = ["register", "drive", "--sequence", "--truth", "drive/poses.txt", "--json"];
    let told = fixture.succeed(&[&all[..], &["-o", "done"]].concat());
    let records = lines(&told.stdout);
    assert_eq!(records.len(), 2);
    assert!(records.iter().all(|record| record["translation_error_m"].as_f64() < Some(0.05)));
    let trajectory = fixture.read("done/poses_kitti.txt");
    let last = trajectory.lines().last().expect("three poses");
    let last: Vec<f64> = last.split(' ').map(|number| number.parse().expect("a number")).collect();
    let back = [last[3], last[7], last[11]];
    assert!(back.iter().all(|metres| metres.abs() < 0.05), "there and back again: {back:?}");
    assert_eq!(fixture.read("done/poses_tum.txt").lines().count(), 3);
    assert!(!told.stderr.contains("motion not known"), "{}", told.stderr);
    // A scan of one point registers with none, and one that is no cloud is not tried.
    fixture.write("drive/000003.ply", fixture.bytes("drive/000002.ply"));
    fixture.write("drive/000004.ply", "no cloud");
    let point = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                 property float z\nend_header\n1 0 0\n";
    fixture.write("drive/000005.ply", point);
    fixture.write("drive/000006.ply", point);
    let gaps = fixture.run(&["register", "drive", "--sequence", "-o", "done"]);
    assert_eq!(gaps.code, Some(2), "{}", gaps.stderr);
    for said in [
        "motion not known: the pairs of scans 000004, 000005 could not be tried, and the \
         trajectory stands still there",
        "motion not known: the pairs of scans 000006 did not register, and the trajectory is",
    ] {
        assert!(gaps.stderr.contains(said), "{said} in {}", gaps.stderr);
    }
    let trajectory = fixture.read("done/poses_kitti.txt");
    let rows: Vec<&str> = trajectory.lines().collect();
    assert!(rows.len() == 7 && rows[3] == rows[4] && rows[4] == rows[5], "{trajectory}");
    ["3", "4", "5", "6"].iter().for_each(|scan| {
        fs::remove_file(fixture.path(&format!("drive/00000{scan}.ply"))).expect("removed");
    });
    fixture.write(
        "drive/two.txt",
        poses.lines().take(2).map(|line| format!("{line}\n")).collect::<String>(),
    );
    fixture.refuses(
        &["register", "drive", "--sequence", "--truth", "drive/two.txt"],
        &["drive/two.txt: expected 3 poses, one a scan, found 2"],
    );
}

#[test]
fn what_is_no_list_of_pairs_is_refused() {
    let fixture = Fixture::new();
    fs::create_dir(fixture.path("empty")).expect("a folder");
    fixture.refuses(&["register", "empty"], &["empty: expected NAME_target.*", "--sequence"]);
    fixture.refuses(&["register", "none.ply"], &["none.ply: expected a folder of pairs"]);
    fixture.write("list.csv", "target,sauce\n");
    fixture.refuses(&["register", "list.csv"], &["list.csv: expected a heading with target"]);
    fixture.refuses(&["register", "a.ply", "b.ply", "--sequence"], &["--sequence"]);
    fixture.refuses(&["register", "list.csv", "--initial", "a.txt"], &["--initial", "column"]);
    let format = ["register", "list.csv", "-o", "done", "--format", "pcd"];
    fixture.refuses(&format, &["--format goes with SOURCE"]);
    fixture.write("list.csv", "target,source,initial\na.ply,b.ply,guess.txt\n");
    fixture.refuses(&["register", "list.csv", "--method", "fgr"], &["takes no initial guess"]);
}

const EVALUATE: [&str; 4] = ["evaluate", "-q", "-c", "small.toml"];

/// Evaluates what lies at a path, and more.
fn evaluate(fixture: &Fixture, path: &str, more: &[&str]) -> CommandOutput {
    fixture.run(&[&EVALUATE[..], &["--pairs", path], more].concat())
}

fn errors(document: &Value) -> &[Value] {
    document["summary"]["errors"].as_array().expect("errors")
}

#[test]
fn written_pairs_are_judged_as_the_traced_ones() {
    let fixture = Fixture::new();
    fixture.write("voxel.json", r#"{"parameters": {"registration.voxel_m": 0.5}}"#);
    for (folder, more) in [
        ("icp", &["--method", "icp"][..]),
        ("gicp", &["--method", "gicp", "--candidate", "voxel.json"]),
        ("fgr", &["--method", "fgr", "--refine"]),
    ] {
        let method = &more[..2];
        fixture.succeed(&[&["pairs", "-q", "-c", "small.toml", "-o", folder], method].concat());
        let traced = evaluate(&fixture, "test", &[more, &["--json"]].concat()).json();
        let written = evaluate(&fixture, folder, &[more, &["--json"]].concat()).json();
        assert_eq!((errors(&traced).len(), errors(&written).len()), (3, 3));
        for (traced, written) in errors(&traced).iter().zip(errors(&written)) {
            for key in ["pair", "points", "stop", "iterations", "translation_m"] {
                assert_eq!(traced[key], written[key], "{key} of {folder}");
            }
            // The quaternion of the truth comes back from its matrix.
            let [traced, written] = [traced, written].map(|error| error["rotation_deg"].as_f64());
            let [traced, written] = [traced, written].map(|angle| angle.expect("an angle"));
            assert!((traced - written).abs() < 1e-12, "{folder}: {traced}° and {written}°");
        }
        for key in ["recall_pct", "mean_points", "median_translation_m"] {
            assert_eq!(traced["summary"][key], written["summary"][key], "{key} of {folder}");
        }
        assert_eq!(
            (&written["pairs"], &written["names"]),
            (&json!(folder), &json!(["000", "001", "002"]))
        );
        assert_eq!(written["parameters"]["lidar.power"], Value::Null, "no sensor is judged");
        let voxel = "registration.voxel_m";
        assert_eq!(written["parameters"][voxel], traced["parameters"][voxel]);
        assert!(written["summary"]["cost"].is_null() && written["set"].is_null());
    }
    // A pulse above the laser's limit, for which traced pairs are refused, is nothing to them.
    let bright = ["--set", "lidar.power=100"];
    let traced = evaluate(&fixture, "test", &bright);
    let limit = "above the pulse energy limit";
    assert!(traced.code == Some(2) && traced.stderr.contains(limit), "{}", traced.stderr);
    let [written, without] = [&bright[..], &[]]
        .map(|set| evaluate(&fixture, "icp", &[set, &["--json"]].concat()).json());
    assert_eq!(written, without);
    let text = evaluate(&fixture, "icp", &[]);
    assert!(text.stdout.contains(" % of 3 pairs of icp\n"), "{}", text.stdout);
    assert!(text.stdout.ends_with(" a scan\n"), "no costs: {}", text.stdout);
    let rows = evaluate(&fixture, "icp", &["--format", "csv"]).stdout;
    let first: Vec<&str> = rows.lines().map(|row| row.rsplit_once(',').expect("a row").0).collect();
    assert!(first[0].starts_with("set,pair,translation_m") && first[3].starts_with("icp,002,"));
    // A set's name is not a path.
    fs::rename(fixture.path("icp"), fixture.path("test")).expect("renamed");
    let set = evaluate(&fixture, "test", &[]);
    assert!(set.stdout.contains(" % of 3 test pairs\n"), "{}", set.stdout);
    // Bounds that nothing is within.
    let strict = ["--set", "data.success_translation_m=1e-9", "--require-recall", "1"];
    assert_eq!(evaluate(&fixture, "./test", &strict).code, Some(4));
}

#[test]
fn a_pair_that_cannot_be_judged_is_named_and_the_others_are_judged() {
    let fixture = Fixture::new();
    fixture.succeed(&["pairs", "-q", "-c", "small.toml", "-o", "pairs"]);
    let whole = evaluate(&fixture, "pairs", &["--json"]).json();
    fixture.write("pairs/001_source.ply", "no cloud");
    fs::remove_file(fixture.path("pairs/000_target_from_source.txt")).expect("the truth");
    let told = evaluate(&fixture, "pairs", &["--json", "--require-recall", "100"]);
    assert_eq!(told.code, Some(2), "{}", told.stderr);
    let truth = "not tried: 000: pairs/000_target.ply: expected its truth, in 000_target_from_";
    for said in [truth, "not tried: 001: pairs/001_source.ply: ", "2 pairs could not be tried"] {
        assert!(told.stderr.contains(said), "{}", told.stderr);
    }
    let left: Value = serde_json::from_str(&told.stdout).expect("a document");
    assert_eq!((&left["names"], errors(&left)), (&json!(["002"]), &errors(&whole)[2..]));
    fs::remove_file(fixture.path("pairs/002_target_from_source.txt")).expect("the truth");
    let none = evaluate(&fixture, "pairs", &["--json"]);
    assert_eq!((none.code, &*none.stdout), (Some(2), ""));
    assert!(none.stderr.contains("no pair could be tried"), "{}", none.stderr);
    // A table has its truths where it says.
    let row = "a,pairs/002_target.ply,pairs/002_source.ply,truth.txt\n";
    fixture.write("list.csv", format!("name,target,source,truth\n{row}"));
    fixture.write("truth.txt", "1 0 0 9 0 1 0 0 0 0 1 0\n");
    let table = evaluate(&fixture, "list.csv", &["--json"]).json();
    let far = errors(&table)[0]["translation_m"].as_f64().expect("an error");
    assert!(far > 8.0, "the scans are half a metre apart, and the table says 9: {far}");
}

#[test]
fn a_judged_pair_begins_at_its_guess_where_the_method_takes_one() {
    let fixture = Fixture::new();
    fixture.succeed(&["pairs", "-q", "-c", "small.toml", "-o", "pairs"]);
    let translation_m = |more: &[&str]| {
        let document = evaluate(&fixture, "pairs", &[&["--json"], more].concat()).json();
        errors(&document)[1]["translation_m"].as_f64().expect("an error")
    };
    let near_m = translation_m(&[]);
    fixture.write("pairs/001_initial.txt", "1 0 0 30 0 1 0 30 0 0 1 0\n");
    let far_m = translation_m(&[]);
    assert!(near_m < 0.5 && far_m > 5.0, "{near_m} m from the identity, {far_m} m from 42 m off");
    for method in ["fgr", "mac"] {
        fixture.refuses(
            &[&EVALUATE[..], &["--pairs", "pairs", "--method", method]].concat(),
            &[&format!("pairs: {method} searches everywhere, and takes no initial guess")],
        );
    }
    fs::remove_file(fixture.path("pairs/001_initial.txt")).expect("removed");
    let row = "a,pairs/002_target.ply,pairs/002_source.ply,pairs/002_target_from_source.txt";
    fixture.write("list.csv", format!("name,target,source,truth,initial\n{row},nofile.txt\n"));
    let told = evaluate(&fixture, "list.csv", &[]);
    assert_eq!(told.code, Some(2), "{}", told.stderr);
    assert!(told.stderr.contains("not tried: a: nofile.txt: "), "{}", told.stderr);
}

#[test]
fn pairs_that_are_neither_a_set_nor_files_are_refused() {
    let fixture = Fixture::new();
    fixture.succeed(&["pairs", "-q", "-c", "small.toml", "-o", "pairs"]);
    fixture.write("power.json", r#"{"parameters": {"lidar.power": 50}}"#);
    fixture.write("cloud.ply", "");
    fs::create_dir(fixture.path("empty")).expect("a folder");
    let refuses = |path: &str, more: &[&str], parts: &[&str]| {
        fixture.refuses(&[&EVALUATE[..], &["--pairs", path], more].concat(), parts);
    };
    refuses("tset", &[], &["'tset'", "expected train, test, or the path of a folder of pairs"]);
    refuses("cloud.ply", &[], &["cloud.ply: expected a folder of pairs, a table of them"]);
    refuses("empty", &[], &["empty: expected NAME_target.*", "or scans, here or in velodyne/"]);
    refuses("pairs", &["--stream"], &["--stream goes with --pairs train or test", "pairs"]);
    refuses("pairs", &["--sensor", "qemu"], &["--sensor goes with --pairs train or test"]);
    let candidate = ["--candidate", "power.json"];
    refuses("pairs", &candidate, &["power.json: lidar.power is of the sensor", "made already"]);
}

#[test]
#[cfg(unix)]
fn an_interrupted_evaluation_says_how_many_are_done_and_gives_no_summary() {
    use std::io::{BufRead, BufReader, Read};
    use std::process::{Command, Stdio};

    let fixture = Fixture::new();
    fixture.succeed(&["pairs", "-q", "-c", "small.toml", "-o", "p"]);
    let row = "p/000_target.ply,p/000_source.ply,p/000_target_from_source.txt\n";
    fixture.write("many.csv", format!("target,source,truth\n{}", row.repeat(3000)));
    let many = ["evaluate", "-c", "small.toml", "--pairs", "many.csv", "--threads", "1"];
    let mut child = fixture.command(&many);
    let mut child =
        child.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("echoloop starts");
    let mut said = BufReader::new(child.stderr.take().expect("a pipe"));
    let mut line = String::new();
    said.read_line(&mut line).expect("a line");
    assert!(line.contains("judging"), "{line}");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill runs").success());
    let mut rest = String::new();
    said.read_to_string(&mut rest).expect("the rest");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!((output.status.code(), &*output.stdout), (Some(130), &b""[..]), "{rest}");
    assert!(rest.contains("interrupted; ") && rest.contains(" pairs are done"), "{rest}");
}

/// `camera_from_velodyne`: z ahead and y down, 0.3 m before the velodyne and 0.1 m below it.
const TR: &str = "0 -1 0 0 0 0 -1 -0.1 1 0 0 -0.3";

/// Six scans along a bend, `own` as `scan --trajectory` writes them but as KITTI's `.bin`, and
/// `kitti/sequences/07` with poses of a camera.
fn drives(fixture: &Fixture) {
    let way: String = (0..6u8)
        .map(|n| {
            let (n, half) = (f64::from(n), f64::from(n) * 0.02);
            format!(
                "{n} {} {} 2 0 0 {} {}\n",
                1.0 + 0.3 * n,
                2.0 + 0.05 * n,
                half.sin(),
                half.cos()
            )
        })
        .collect();
    fixture.write("way.tum", way);
    let dense = ["scanner.columns=360", "scanner.rows=48", "scanner.azimuth_deg=360"];
    let dense: Vec<&str> = dense.into_iter().flat_map(|key| ["--set", key]).collect();
    let scan = ["scan", "-q", "-c", "small.toml", "--trajectory", "way.tum", "-o", "own"];
    fixture.succeed(&[&scan[..], &dense].concat());
    fs::create_dir_all(fixture.path("kitti/sequences/07/velodyne")).expect("folders");
    fs::create_dir(fixture.path("kitti/poses")).expect("a folder");
    for n in 0..6 {
        let ply = fixture.path(&format!("own/{n:06}.ply"));
        let (cloud, _) = read_cloud(&ply).expect("a scan");
        let numbers = cloud.points.iter().flat_map(|at| [at.x, at.y, at.z, 0.5]);
        let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
        fixture.write(&format!("own/{n:06}.bin"), &bytes);
        fixture.write(&format!("kitti/sequences/07/velodyne/{n:06}.bin"), &bytes);
        fs::remove_file(ply).expect("removed");
    }
    let tr: Vec<f64> = TR.split(' ').map(|number| number.parse().expect("a number")).collect();
    let rows = [&tr[..], &[0.0, 0.0, 0.0, 1.0]].concat().try_into().expect("16 numbers");
    let camera_from_velodyne = from_rows(&rows).expect("rigid");
    let own = read_trajectory(&fixture.path("own/poses.txt")).expect("poses");
    let of_camera: Vec<Pose> =
        own.iter().map(|velodyne| velodyne.pose * camera_from_velodyne.inverse()).collect();
    let first = of_camera[0];
    let poses = of_camera.iter().map(|pose| first.inv_mul(pose)).collect::<Vec<_>>();
    fixture.write("kitti/poses/07.txt", to_kitti(&poses));
    fixture.write("kitti/sequences/07/calib.txt", format!("P0: 7 0 0\nTr: {TR}\n"));
    fixture.write("kitti/sequences/07/times.txt", "0\n1\n2\n3\n4\n5\n");
}

#[test]
fn a_sequence_in_kitti_s_layout_is_judged_by_its_camera_s_poses() {
    let fixture = Fixture::new();
    drives(&fixture);
    let kitti = "kitti/sequences/07";
    let own = evaluate(&fixture, "own", &["--json"]).json();
    let of_camera = evaluate(&fixture, kitti, &["--json"]).json();
    // 0.3 m from scan to scan, and data.baseline_m = 0.5.
    let names = json!(["000000-000002", "000003-000005"]);
    assert_eq!((&own["names"], &of_camera["names"]), (&names, &names));
    for (own, of_camera) in errors(&own).iter().zip(errors(&of_camera)) {
        let [own, of_camera] = [own, of_camera].map(|error| error["frobenius"].as_f64());
        let (own, of_camera) = (own.expect("an error"), of_camera.expect("an error"));
        assert!((own - of_camera).abs() < 1e-9, "{own} and {of_camera}");
        assert!(own < 0.05, "{own}");
    }
    let far = evaluate(&fixture, kitti, &["--json", "--set", "data.baseline_m=1.2"]).json();
    assert_eq!(far["names"], json!(["000000-000004"]));
    // One by one, register finds the same truth.
    let poses = ["--truth", "kitti/poses/07.txt"];
    let told = fixture.succeed(
        &[&["register", kitti, "--sequence", "--json", "--method", "icp"][..], &poses].concat(),
    );
    let records = lines(&told.stdout);
    assert_eq!(records.len(), 5);
    let near = |record: &Value| record["translation_error_m"].as_f64() < Some(0.05);
    assert!(records.iter().all(near), "{}", told.stdout);
    // From within the folder of scans.
    let within = |arguments: &[&str]| {
        let mut command = fixture.command(arguments);
        let output = command.current_dir(fixture.path(kitti).join("velodyne")).output();
        CommandOutput::from_output(output.expect("echoloop starts"))
    };
    let here =
        within(&["evaluate", "-q", "-c", "../../../../small.toml", "--pairs", ".", "--json"]);
    assert_eq!(errors(&here.json()), errors(&of_camera));
    let here = ["register", ".", "--sequence", "--json", "--method", "icp", "--truth"];
    let here = within(&[&here[..], &["../../../poses/07.txt"]].concat());
    let of = |text: &str| -> Vec<Value> {
        lines(text).iter().map(|record| record["translation_error_m"].clone()).collect()
    };
    assert_eq!((of(&here.stdout), here.code), (of(&told.stdout), Some(0)), "{}", here.stderr);
    fixture.write("kitti/sequences/07/calib.txt", "P0: 7 0 0\n");
    let named = ["07/calib.txt: expected a line Tr: with camera_from_velodyne, found P0"];
    fixture.refuses(&[&EVALUATE[..], &["--pairs", kitti]].concat(), &named);
    fixture.refuses(&[&["register", kitti, "--sequence"][..], &poses].concat(), &named);
    fs::remove_file(fixture.path("kitti/poses/07.txt")).expect("removed");
    let missing = ["expected a pose of each scan in", "07/poses.txt or", "poses/07.txt"];
    fixture.refuses(&[&EVALUATE[..], &["--pairs", kitti]].concat(), &missing);
}
