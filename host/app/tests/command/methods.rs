//! Registration methods from the command line: what they find, what they print, what they refuse.

use crate::fixture::Fixture;
use echoloop_clouds::pose::{Pose, read_pose, rotation_error_deg, to_rows, translation_error_m};
use echoloop_registration::{Kind, SETTINGS};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde_json::Value;

/// Two scans of a street, `target.ply` and `source.ply`, eight metres apart and of any heading, and
/// the motion between them.
fn scans(fixture: &Fixture) -> Pose {
    let set = "data.train_pairs=1 data.test_pairs=1 data.baseline_m=8 data.heading_range_deg=180 \
               scene.towns=[1] scanner.pattern=grid scanner.azimuth_deg=360 scanner.columns=720 \
               scanner.rows=64 scanner.elevation_deg=60";
    let mut arguments = vec!["pairs", "-q", "-o", "scans", "--seed", "5"];
    arguments.extend(set.split_whitespace().flat_map(|set| ["--set", set]));
    fixture.succeed(&arguments);
    for name in ["target.ply", "source.ply"] {
        fixture.write(name, fixture.bytes(&format!("scans/000_{name}")));
    }
    read_pose(&fixture.path("scans/000_target_from_source.txt")).expect("a pose")
}

fn motion(document: &Value) -> Pose {
    let rows = document["target_from_source"].as_array().expect("four rows");
    let number = |row: usize, column: usize| rows[row][column].as_f64().expect("a number");
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(number));
    Pose::from_parts(
        Vector3::from_fn(|row, _| number(row, 3)).into(),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

#[test]
fn global_methods_find_an_unknown_heading_and_refinement_sharpens_it() {
    let fixture = Fixture::new();
    let truth = scans(&fixture);
    for method in ["fgr", "mac"] {
        let run = |more: &[&str]| {
            let arguments =
                ["register", "-q", "--json", "target.ply", "source.ply", "--method", method];
            fixture.succeed(&[&arguments, more].concat()).json()
        };
        let (coarse, fine) = (run(&[]), run(&["--refine"]));
        let error = |document: &Value| {
            let found = motion(document);
            (translation_error_m(&found, &truth), rotation_error_deg(&found, &truth))
        };
        assert!(error(&coarse).0 < 0.3 && error(&coarse).1 < 1.5, "{method}: {:?}", error(&coarse));
        assert!(error(&fine).0 < 0.03 && error(&fine).1 < 0.1, "{method}: {:?}", error(&fine));
        for document in [&coarse, &fine] {
            let count = |key: &str| {
                document[key].as_u64().unwrap_or_else(|| panic!("{method} counts {key}"))
            };
            assert!(count("inliers") > 20 && count("inliers") <= count("matches"), "{document}");
            assert_eq!(document["method"], method);
        }
        assert!(
            fine["unobservable_directions"].is_u64() && coarse["unobservable_directions"].is_null()
        );
        assert!(fine["covariance"].is_array() && coarse["covariance"].is_null());
    }
}

#[test]
fn the_same_seed_gives_the_same_document_on_one_thread_and_two() {
    let fixture = Fixture::new();
    scans(&fixture);
    for method in ["gicp", "fgr", "mac"] {
        let document = |threads: &str| {
            let arguments =
                ["register", "-q", "--json", "target.ply", "source.ply", "--method", method];
            let mut document =
                fixture.run(&[&arguments[..], &["--threads", threads]].concat()).json();
            document.as_object_mut().expect("an object").remove("cpu_s");
            document
        };
        assert_eq!(document("1"), document("2"), "{method}");
    }
}

#[test]
fn the_document_lists_every_setting_of_the_method_and_flags_change_them() {
    let fixture = Fixture::new();
    scans(&fixture);
    let flags: [(&str, &[(&str, f64)]); 4] = [
        (
            "icp",
            &[
                ("voxel_m", 0.4),
                ("translation_tolerance_m", 0.002),
                ("max_pair_distance_m", 2.5),
                ("degeneracy_threshold", 0.01),
            ],
        ),
        ("gicp", &[("voxel_m", 0.4), ("normal_neighbours", 12.0), ("first_pair_distance_m", 5.0)]),
        (
            "fgr",
            &[
                ("voxel_m", 0.5),
                ("feature_radius_m", 2.25),
                ("feature_neighbours", 60.0),
                ("max_tuples", 500.0),
            ],
        ),
        (
            "mac",
            &[
                ("voxel_m", 0.6),
                ("normal_radius_m", 1.5),
                ("max_matches", 900.0),
                ("max_iterations", 7.0),
            ],
        ),
    ];
    for (method, given) in flags {
        let mut arguments: Vec<String> =
            ["register", "-q", "--json", "target.ply", "source.ply", "--method", method]
                .map(str::to_owned)
                .to_vec();
        for (key, value) in given {
            arguments.extend([format!("--{}", key.replace('_', "-")), value.to_string()]);
        }
        let output = fixture.run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        let first = "{\"format\":1,\"target_from_source\":[[";
        assert!(output.stdout.starts_with(first), "{}", output.stdout);
        let document = output.json();
        for (key, value) in given {
            assert_eq!(document[*key].as_f64(), Some(*value), "{method} {key}: {document}");
        }
        for setting in SETTINGS.iter().filter(|setting| !document[setting.key].is_null()) {
            let is_count = setting.kind == Kind::Whole;
            assert_eq!(document[setting.key].is_u64(), is_count, "{}: {document}", setting.key);
        }
    }
}

#[test]
fn icp_starts_from_its_own_document_a_matrix_or_a_kitti_row() {
    let fixture = Fixture::new();
    let truth = scans(&fixture);
    let run = |initial: &str| {
        let arguments = ["register", "-q", "--json", "target.ply", "source.ply", "--method", "icp"];
        let start = ["--initial", initial];
        let mut document = fixture.succeed(&[&arguments[..], &start[..]].concat()).json();
        document.as_object_mut().expect("an object").remove("cpu_s");
        document
    };
    let from_matrix = run("scans/000_target_from_source.txt");
    let numbers = to_rows(&truth).map(|v| v.to_string());
    fixture.write("row.txt", numbers[..12].join(" ") + "\n");
    let rows = to_rows(&truth);
    let mut document = from_matrix.clone();
    document["target_from_source"] = rows.chunks(4).collect();
    fixture.write("found.json", document.to_string());
    for initial in ["row.txt", "found.json"] {
        assert_eq!(run(initial), from_matrix, "{initial}");
    }
    let error = translation_error_m(&motion(&from_matrix), &truth);
    assert!(error < 0.03, "{error}");
}

#[test]
fn a_start_that_holds_no_motion_is_refused_with_what_was_found_and_what_was_expected() {
    let fixture = Fixture::new();
    fixture.write("a.xyz", "1 2 3\n");
    let rows = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let turned = rows.replace("[[1", "[[-1");
    let table: [(&str, &[&str]); 7] = [
        ("1 0 0 0 0 1 0 0 0 0 1", &["found 11 numbers", "(16)", "(12)"]),
        ("1 0 0 0 0 1 0 0 0 0 one 0", &["expected a number", "\"one\""]),
        ("1 0 0 0 0 1 0 0 0 0 2 0", &["not orthonormal"]),
        ("{\"rows\": 1}", &["without target_from_source", "4 rows of 4 numbers"]),
        ("{\"target_from_source\": [[1, 0, 0, 0]]}", &["1 × 4 numbers", "4 rows of 4 numbers"]),
        ("{\"target_from_source\": ", &["found no JSON", "line 1"]),
        (&format!("{{\"target_from_source\": {turned}}}"), &["mirrors"]),
    ];
    for (text, parts) in table {
        fixture.write("start.json", text);
        let parts = [parts, &["start.json"]].concat();
        fixture.refuses(&["register", "a.xyz", "a.xyz", "--initial", "start.json"], &parts);
    }
    let absent = ["register", "a.xyz", "a.xyz", "--initial", "absent.json"];
    fixture.refuses(&absent, &["absent.json"]);
}

#[test]
fn flags_that_do_not_go_together_are_refused_by_name() {
    let fixture = Fixture::new();
    fixture.write("a.xyz", "1 2 3\n");
    let table: [(&[&str], &[&str]); 9] = [
        (&["--refine"], &["--refine", "auto"]),
        (&["--feature-radius-m", "2"], &["--feature-radius-m", "auto"]),
        (&["--method", "gicp", "--max-tuples", "9"], &["--max-tuples", "gicp"]),
        (&["--method", "mac", "--mode", "open3d"], &["--mode", "mac"]),
        (&["--method", "mac", "--seed", "3"], &["--seed", "mac"]),
        (&["--method", "fgr", "--initial", "a.xyz"], &["--initial", "fgr"]),
        (&["--method", "fgr", "--voxel-m", "0"], &["voxel_m is 0", "above 0"]),
        (
            &["--method", "fgr", "--normal-radius-m", "3", "--feature-radius-m", "1"],
            &["feature_radius_m", "3.3"],
        ),
        (&["--method", "mac", "--max-matches", "2"], &["max_matches is 2"]),
    ];
    for (flags, parts) in table {
        fixture.refuses(&[&["register", "a.xyz", "a.xyz"], flags].concat(), parts);
    }
    for command in ["tune", "evaluate"] {
        let refused = |more: &[&str], parts: &[&str]| {
            fixture.refuses(&[&[command, "-c", "small.toml"], more].concat(), parts)
        };
        refused(&["--refine"], &["registration.refine", "icp"]);
        refused(&["--method", "mac", "--mode", "open3d"], &["registration.mode", "mac"]);
        refused(
            &["--set", "registration.feature_radius_m=2"],
            &["registration.feature_radius_m", "icp"],
        );
        refused(
            &[
                "--method",
                "fgr",
                "--set",
                "registration.normal_radius_m=3",
                "--set",
                "registration.feature_radius_m=2",
            ],
            &["registration.feature_radius_m", "3.3"],
        );
    }
}

#[test]
fn clouds_that_no_method_can_register_end_with_one_and_a_reason() {
    let fixture = Fixture::new();
    let line: String = (0..300).map(|i| format!("{} 1 0\n", f64::from(i) * 0.1)).collect();
    let floor: String =
        (0..900).map(|i| format!("{} {} -1.8\n", f64::from(i % 30), f64::from(i / 30))).collect();
    fixture.write("line.xyz", line);
    fixture.write("floor.xyz", floor);
    fixture.write("point.xyz", "1 2 3\n");
    fixture.write("same.xyz", "1 2 3\n".repeat(500));
    for method in ["icp", "gicp", "fgr", "mac"] {
        for name in ["line.xyz", "floor.xyz", "point.xyz", "same.xyz"] {
            let output = fixture.run(&["register", "--json", name, name, "--method", method]);
            assert_eq!(
                output.code,
                Some(1),
                "{method} {name}: {} {}",
                output.stdout,
                output.stderr
            );
            assert!(
                output.stderr.contains("not registered: "),
                "{method} {name}: {}",
                output.stderr
            );
            assert!(motion(&output.json()).translation.vector.iter().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn every_method_can_be_tuned_and_judged_again() {
    let fixture = Fixture::new();
    for (method, axes) in [("gicp", 8), ("fgr", 6), ("mac", 6), ("auto", 1)] {
        let own = ["--method", method, "--protocol", "registration", "--generations", "2"];
        fixture.succeed(&[&["tune", "-q", "-c", "small.toml"], &own[..]].concat());
        let result: Value =
            serde_json::from_str(&fixture.read("runs/latest/result.json")).expect("JSON");
        let icp = if ["fgr", "mac"].contains(&method) { ", then icp" } else { "" };
        assert_eq!(result["method"], format!("{method}{icp}"));
        let tuned = result["tuned"].as_object().expect("values");
        assert_eq!(
            tuned.keys().filter(|key| key.starts_with("registration.")).count(),
            axes,
            "{method}"
        );
        let again = fixture.succeed(&["evaluate", "-q", "--json", "--run", "runs/latest"]).json();
        assert_eq!(
            again["summary"]["recall_pct"], result["tuned_summary"]["recall_pct"],
            "{method}"
        );
    }
}

#[test]
fn open3ds_way_of_fgr_is_named_in_the_result_and_the_report() {
    let fixture = Fixture::new();
    fixture.succeed(&[
        "tune",
        "-q",
        "-c",
        "small.toml",
        "--method",
        "fgr",
        "--mode",
        "open3d",
        "--protocol",
        "default",
    ]);
    let result: Value =
        serde_json::from_str(&fixture.read("runs/latest/result.json")).expect("JSON");
    assert_eq!(result["method"], "fgr as Open3D runs it");
    assert!(fixture.read("runs/latest/report.html").contains("Open3D 0.20"));
}
