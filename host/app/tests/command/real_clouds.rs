//! Tuned settings on clouds from files: those that a cell itself was judged on give the cell's own
//! errors, and a list that cannot be read is refused by name.

use std::collections::BTreeSet;

use crate::fixture::Fixture;
use serde_json::Value;

const SHARED: [&str; 14] = [
    "--seed",
    "5",
    "--set",
    "scene.towns=[1]",
    "--set",
    "scanner.pattern=grid",
    "--set",
    "scanner.columns=48",
    "--set",
    "scanner.rows=16",
    "--set",
    "data.train_pairs=3",
    "--set",
    "data.test_pairs=3",
];

fn cells<'a>(more: &[&'a str]) -> Vec<&'a str> {
    let own = [
        "reproduce",
        "-q",
        "--scene=structured",
        "--method=icp",
        "--protocol=default,registration",
        "--ranges=outdoor",
        "--strategy=fast",
        "--generations=4",
        "--runs=table",
    ];
    [&own[..], &SHARED, more].concat()
}

fn document(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

/// e_t of every pair, m.
fn translations(pairs: &Value) -> Vec<f64> {
    let pairs = pairs.as_array().expect("pairs").iter();
    pairs.map(|pair| pair["translation_m"].as_f64().expect("a number")).collect()
}

#[test]
fn on_the_clouds_that_a_cell_was_judged_on_its_settings_err_as_they_did_there() {
    let fixture = Fixture::new();
    fixture.succeed(&cells(&[]));
    let scan = ["pairs", "-q", "--scene=structured", "--method=icp", "-o", "clouds"];
    fixture.succeed(&[&scan[..], &SHARED].concat());
    let pair = |n: usize| {
        let motion = match n {
            1 => format!(
                "world_from_target = \"{n:03}_world_from_target.txt\"\n\
                 world_from_source = \"{n:03}_world_from_source.txt\"\n"
            ),
            _ => format!("target_from_source = \"{n:03}_target_from_source.txt\"\n"),
        };
        format!(
            "[[pair]]\nname = \"pair {n}\"\ntarget = \"{n:03}_target.ply\"\n\
             source = \"{n:03}_source.ply\"\n{motion}"
        )
    };
    fixture.write("real.toml", (0..3).map(pair).collect::<String>());
    let real = ["--table", "--real=real.toml", "--real-data=clouds"];
    let table = document(&fixture.succeed(&cells(&[&real[..], &["--json"]].concat())).stdout);
    let rows = table["real"].as_array().expect("rows");
    let settings: Vec<&str> = rows.iter().filter_map(|row| row["settings"].as_str()).collect();
    assert_eq!(
        settings,
        ["default, outdoor", "chosen from the clouds", "tuned, registration, structured, outdoor"]
    );
    // Registration's half leaves the sensor as it was, so the files' clouds are those that it was
    // judged on; coordinates are of single precision in both.
    for (row, cell) in [(0, "default"), (2, "fast-registration")] {
        let record = fixture.read(&format!("table/cells/outdoor-{cell}-icp-structured.json"));
        let record = document(&record);
        let judged = translations(&record["summary"]["errors"]);
        let found = translations(&rows[row]["pairs"]);
        for (judged, found) in judged.iter().zip(&found) {
            assert!((judged - found).abs() < 1e-6, "{cell}: {judged} m there, {found} m here");
        }
        assert_eq!((judged.len(), found.len()), (3, 3));
    }
    let sums = |row: usize| -> Vec<&str> {
        let pairs = rows[row]["pairs"].as_array().expect("pairs").iter();
        pairs.map(|pair| pair["content"].as_str().expect("a checksum")).collect()
    };
    assert_eq!(sums(0), sums(2), "the same clouds");
    assert_eq!(BTreeSet::from_iter(sums(0)).len(), 3, "no pair's clouds are another's");
    let [default, tuned] = [0, 2].map(|row| translations(&rows[row]["pairs"]));
    assert_ne!(default, tuned, "the search chose nothing of its own: try another seed");
    let text = fixture.succeed(&cells(&real)).stdout;
    let line = text.lines().find(|line| line.contains("chosen from the clouds")).expect("a line");
    assert!(line.contains("of 3") && line.matches(" cm").count() >= 2, "{line}");
    let form = |form| fixture.succeed(&cells(&[&real[..], &["--format", form]].concat())).stdout;
    let csv = form("csv");
    let head: Vec<&str> = csv.lines().next().expect("a head").split(',').collect();
    let tuned: Vec<&str> = csv.lines().last().expect("lines").split(',').collect();
    let field = |name: &str| tuned[head.iter().position(|head| *head == name).expect(name)];
    assert_eq!(["tuned", "scene", "clouds"].map(field), ["registration", "structured", "real"]);
    let mean_cm = 100.0 * rows[2]["mean_translation_m"].as_f64().expect("some were found");
    assert_eq!(field("rte_cm").parse(), Ok(mean_cm));
    let of = |start: &str| csv.lines().filter(|line| line.starts_with(start)).count();
    assert_eq!(of(",outdoor,,default,icp,,"), 1, "{csv}");
    assert_eq!(of(",,,clouds,icp,,"), 1, "{csv}");
    let latex = form("latex");
    let (_, real) = latex.split_once("% real clouds").expect("a table of its own");
    let row = format!("ICP & tuned, registration, structured, outdoor & {mean_cm:.2} & ");
    assert!(real.contains(&row), "{real}");
}

#[test]
fn a_list_that_cannot_be_read_is_named_before_anything_is_run() {
    let fixture = Fixture::new();
    fixture.refuses(&cells(&["--real=none.toml"]), &["none.toml"]);
    for (text, said) in [
        ("", &["list.toml", "pair"][..]),
        ("pair = []\n", &["list.toml", "expected [[pair]]"]),
        ("[[pair]]\nname = \"a\"\ntarget = \"a.ply\"\n", &["list.toml", "source"]),
        (
            "[[pair]]\nname = \"a\"\ntarget = \"a.ply\"\nsource = \"b.ply\"\n",
            &["list.toml", "\"a\"", "expected target_from_source, or world_from_target and"],
        ),
        (
            "[[pair]]\nname = \"a\"\ntarget = \"a.ply\"\nsource = \"b.ply\"\n\
             target_from_source = \"t.txt\"\n",
            &["t.txt"],
        ),
        ("[[pair]]\nname = \"a\"\nturget = \"a.ply\"\n", &["list.toml", "turget"]),
    ] {
        fixture.write("list.toml", text);
        fixture.refuses(&cells(&["--real=list.toml"]), said);
    }
    fixture.write("t.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    fixture.write("b.ply", "no cloud");
    fixture.refuses(&cells(&["--real=list.toml"]), &["list.toml"]);
    fixture.refuses(&cells(&["--real-data=clouds"]), &["--real"]);
    assert!(!fixture.path("table").exists(), "nothing was run");
}
