//! `echoloop register` of many pairs: each as alone, kept as it is done, and named when it fails.

use std::fs;

use crate::fixture::Fixture;
use serde_json::Value;

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
