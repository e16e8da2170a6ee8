//! The paper's figures: each curve, dot, colour and cloud is that of its cell, what is missing is
//! said with the command that runs it, and a folder always gives the same bytes.

use std::collections::BTreeMap;
use std::fs;

use crate::fixture::Fixture;
use crate::svg::{line, log_value, number, of_class, panel, ticks};
use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::parameters::Values;
use echoloop_study::Record;
use serde_json::{Value, json};

/// Cells of a moment each, of which some pairs fail.
const SMALL: [&str; 18] = [
    "--method",
    "icp",
    "--scene",
    "structured",
    "--ranges",
    "outdoor",
    "--strategy",
    "fast",
    "--train-pairs=3",
    "--generations=4",
    "--pairs=4",
    "--seed=2",
    "--set=scene.towns=[1]",
    "--set=scanner.columns=48",
    "--set=scanner.rows=16",
    "--set=tune.population=4",
    "--runs",
    "table",
];

fn reproduce<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["reproduce", "-q"][..], &SMALL, more].concat()
}

fn record(fixture: &Fixture, tuned: &str) -> Record {
    let name = format!("table/cells/outdoor-{tuned}-icp-structured.json");
    serde_json::from_slice(&fixture.bytes(&name)).expect("a record")
}

/// The protocols as files have them, and the classes of their curves.
const CURVES: [(&str, &str); 4] = [
    ("default", "curve-default"),
    ("fast-lidar", "curve-lidar"),
    ("fast-registration", "curve-registration"),
    ("fast-joint", "curve-tuned"),
];

fn is_found(error: &PairError, record: &Record) -> bool {
    error.translation_m <= record.data.success_translation_m
        && error.rotation_deg <= record.data.success_rotation_deg
}

/// A part of an error, in the figures' unit.
type Read = fn(&PairError) -> f64;

/// The errors of all pairs, smallest first.
fn errors(record: &Record, read: Read) -> Vec<f64> {
    let mut errors: Vec<f64> = record.summary.errors.iter().map(read).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

/// Writes cells anew with errors of no two alike, as searches that choose the same have them.
fn set_apart(fixture: &Fixture) {
    for ((tuned, _), factor) in CURVES.into_iter().zip([1.0, 1.9, 2.7, 1.3]) {
        let mut record = record(fixture, tuned);
        for error in &mut record.summary.errors {
            error.translation_m *= factor;
            error.rotation_deg *= factor;
        }
        record.summary = Summary::from_errors(record.summary.errors, &record.data);
        let name = format!("table/cells/outdoor-{tuned}-icp-structured.json");
        fixture.write(&name, serde_json::to_string(&record).expect("a record"));
    }
}

/// Every curve against its cell: it rises where a pair's error lies, a failed one's too, and ends
/// at all of them.
fn curves_are_the_cells(fixture: &Fixture, page: &str) {
    let parts: [(&str, Read); 2] = [
        ("translation", |error| 100.0 * error.translation_m),
        ("rotation", |error| error.rotation_deg),
    ];
    let mut recalls = Vec::new();
    for (part, read) in parts {
        let svg = panel(page, &format!("errors-outdoor-fast-icp-structured-{part}"));
        let levels = ticks(svg, true);
        let level = |share: f64| {
            let at =
                |value: f64| levels.iter().find(|(tick, _)| *tick == value).expect("a level").1;
            at(0.0)[1] + (at(100.0)[1] - at(0.0)[1]) * share / 100.0
        };
        let across = ticks(svg, false);
        for (tuned, class) in CURVES {
            let record = record(fixture, tuned);
            let corners = line(svg, class);
            let end = corners.last().expect("an end")[1];
            assert!((end - level(100.0)).abs() < 12.0, "{tuned} {part} ends at {end}");
            let steps = corners.windows(2).filter(|step| step[1][1] < step[0][1]);
            let rises: Vec<f64> = steps.map(|step| log_value(&across, step[0][0])).collect();
            let expected = errors(&record, read);
            assert_eq!(rises.len(), expected.len(), "{tuned} {part}");
            for (rise, error) in rises.iter().zip(&expected) {
                assert!((rise / error - 1.0).abs() < 0.02, "{tuned} {part}: {rise}, not {error}");
            }
            recalls.push(record.summary.recall_pct);
        }
    }
    assert!(recalls.iter().any(|recall| *recall < 100.0), "no pair failed");
}

/// The rows of Fig. 1 against their cells: a dot a pair at its error, hollow where it failed.
fn rows_are_the_cells(fixture: &Fixture, page: &str) {
    let svg = panel(page, "by-hand-outdoor-fast-structured-translation");
    let across: Vec<_> = ticks(svg, false);
    let rows = [
        ("default", "default", false),
        ("hand-dense", "1 dense", false),
        ("hand-sparse", "2 sparse", false),
        ("hand-careful", "3 careful", false),
        ("fast-joint", "joint", true),
    ];
    let mut dots: BTreeMap<(bool, bool), Vec<f64>> = BTreeMap::new();
    for (tuned, name, is_joint) in rows {
        let record = record(fixture, tuned);
        assert!(svg.contains(name), "no row {name}");
        for error in &record.summary.errors {
            let of = dots.entry((is_joint, is_found(error, &record))).or_default();
            of.push(100.0 * error.translation_m);
        }
    }
    for ((is_joint, is_found), mut expected) in dots {
        let class = if is_joint { "dot-tuned" } else { "dot-default" };
        let class = if is_found { class.to_owned() } else { format!("{class} hollow") };
        let places = of_class(svg, &class, "cx").into_iter().map(number);
        let mut drawn: Vec<f64> = places.map(|x| log_value(&across, x)).collect();
        assert_eq!(drawn.len(), expected.len(), "{class}");
        drawn.sort_by(f64::total_cmp);
        expected.sort_by(f64::total_cmp);
        for (drawn, expected) in drawn.iter().zip(&expected) {
            assert!((drawn / expected - 1.0).abs() < 0.02, "{class}: {drawn}, not {expected}");
        }
    }
}

/// Every searched parameter has a panel, and a mark where each search chose it.
fn marks_are_the_cells(fixture: &Fixture, page: &str) {
    let joint: Value = serde_json::from_slice(
        &fixture.bytes("table/runs/outdoor-fast-joint-icp-structured/result.json"),
    )
    .expect("a result");
    let axes = joint["background"]["axes"].as_array().expect("axes");
    assert!(axes.len() > 15, "{} axes", axes.len());
    let [both, sensor, registration] = ["joint", "lidar", "registration"]
        .map(|tuned| record(fixture, &format!("fast-{tuned}")).parameters);
    for axis in axes {
        let name = axis["name"].as_str().expect("a name");
        let svg =
            panel(page, &format!("chosen-outdoor-fast-icp-{}", name.replace(['.', '_'], "-")));
        let [min, max] = ["min", "max"].map(|end| axis[end].as_f64().expect("an end"));
        let share = |value: f64| match axis["scale"].as_str() {
            Some("log" | "power-of-two") => (value / min).ln() / (max / min).ln(),
            _ => (value - min) / (max - min),
        };
        let track = &of_class(svg, "grid", "points");
        let track: Vec<&str> = track[0].split_whitespace().collect();
        let end = |corner: &str| number(corner.split_once(',').expect("x,y").0);
        let (left, right) = (end(track[0]), end(track[1]));
        let is_at = |class: &str, values: &Values| {
            let [x] = of_class(svg, class, "cx")[..] else {
                panic!("one {class} of {name}: {svg}")
            };
            let expected = left + (right - left) * share(values[name]);
            assert!((number(x) - expected).abs() < 3.0, "{class} of {name}: {x}, not {expected}");
        };
        is_at("dot-tuned", &both);
        match name.starts_with("lidar.") {
            true => is_at("ring-lidar", &sensor),
            false => is_at("ring-registration", &registration),
        }
    }
}

/// Five overlays, whose errors are those of the cells; before registration a pair lies apart by its
/// motion.
fn overlays_are_the_cells(fixture: &Fixture, page: &str) {
    let joint = record(fixture, "fast-joint");
    let mut errors: Vec<&PairError> = joint.summary.errors.iter().collect();
    errors.sort_by(|a, b| a.frobenius.total_cmp(&b.frobenius));
    let shown = errors[1]; // the middle of four: the better of two
    assert!(page.contains(&format!("structured pair {}", shown.pair)), "which pair is seen");
    let steps = ["default", "LiDAR tuned", "registration tuned", "both tuned"];
    for (step, (tuned, _)) in steps.into_iter().zip(CURVES) {
        let error = &record(fixture, tuned).summary.errors[shown.pair];
        let title = format!(
            "structured, {step}: {:.1} cm, {:.2}°",
            100.0 * error.translation_m,
            error.rotation_deg
        );
        assert!(page.contains(&title), "{title}");
    }
    let apart = page.split_once("structured, before: ").expect("a title").1;
    let apart = number(apart.split_once(" cm").expect("a length").0);
    assert!((190.0..210.0).contains(&apart), "pairs are 2 m apart, not {apart} cm");
    for step in ["before", "default", "lidar-tuned", "registration-tuned", "both-tuned"] {
        let svg = panel(page, &format!("overlay-outdoor-fast-icp-structured-{step}"));
        for class in ["cloud-target", "cloud-source"] {
            let [dots] = of_class(svg, class, "d")[..] else { panic!("one cloud {class}") };
            let count = dots.matches('M').count();
            assert!(count > 50, "{step}: {count} points of {class}");
        }
    }
}

#[test]
fn every_figure_is_of_its_cells_and_the_same_each_time_and_in_the_page() {
    let fixture = Fixture::new();
    let output = fixture.succeed(&reproduce(&["--by-hand", "--figures", "a/figures"]));
    let names = [
        "by-hand-outdoor-fast",
        "errors-outdoor-fast",
        "interactions-outdoor-fast-icp-structured",
        "overlays-outdoor-fast-icp",
        "parameters-outdoor-fast-icp",
    ];
    let mut written: Vec<String> = fs::read_dir(fixture.path("a/figures"))
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().into_string().expect("a name"))
        .collect();
    written.sort();
    let expected: Vec<String> =
        names.iter().flat_map(|name| ["png", "svg"].map(|end| format!("{name}.{end}"))).collect();
    assert_eq!(written, expected);
    assert!(output.stdout.contains("figures  5, each .svg and .png, in a/figures"));
    assert!(!output.stdout.contains("Left out") && !output.stdout.contains("missing"));

    let page = fixture.read("table/report.html");
    marks_are_the_cells(&fixture, &page);
    overlays_are_the_cells(&fixture, &page);
    // A file has the panels of the page as they stand there.
    let panels = page.split("data-figure=\"").skip(1).map(|rest| rest.split_once('"').expect("").0);
    let files = names.map(|name| fixture.read(&format!("a/figures/{name}.svg"))).concat();
    let mut count = 0;
    for name in panels {
        assert!(files.contains(panel(&page, name)), "{name} is in no file");
        count += 1;
    }
    assert_eq!(files.matches("viewBox=").count(), count + names.len(), "nor is more in one");

    let again =
        reproduce(&["--by-hand", "--table", "--figures", "b", "-o", "page.html", "--threads", "1"]);
    fixture.succeed(&again);
    assert!(fixture.read("page.html") == page, "another page");
    for name in expected {
        let [a, b] = ["a/figures", "b"].map(|folder| fixture.bytes(&format!("{folder}/{name}")));
        assert!(a == b, "{name} has other bytes the second time");
    }

    set_apart(&fixture);
    fixture.succeed(&reproduce(&["--table", "-o", "apart.html"]));
    let page = fixture.read("apart.html");
    curves_are_the_cells(&fixture, &page);
    rows_are_the_cells(&fixture, &page);
    assert!(
        !page.contains("class=\"cloud-"),
        "clouds that are not those of the cells are not drawn"
    );
    assert!(page.contains("comes out otherwise"));
}

#[test]
fn a_correlation_is_red_where_positive_blue_where_negative_and_grey_where_it_is_chance() {
    let fixture = Fixture::new();
    fixture.succeed(&reproduce(&["--protocol", "default,joint"]));
    let path = "table/runs/outdoor-fast-joint-icp-structured/result.json";
    let mut result: Value = serde_json::from_slice(&fixture.bytes(path)).expect("a result");
    let names = result["background"]["correlated"].as_array().expect("names").len();
    let mut square: Vec<Vec<f64>> =
        (0..names).map(|i| (0..names).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    for (row, column, r) in [(1, 0, 0.97), (2, 0, -0.98), (names - 1, 1, 1e-6)] {
        (square[row][column], square[column][row]) = (r, r);
    }
    result["background"]["correlations"] = json!(square);
    fixture.write(path, result.to_string());
    fixture.succeed(&reproduce(&["--table", "-o", "page.html"]));
    let page = fixture.read("page.html");
    let svg = panel(&page, "interactions-outdoor-fast-icp-structured-map");
    let corners = |class: &str| {
        let [xs, ys] = ["x", "y"].map(|side| of_class(svg, class, side));
        xs.into_iter().zip(ys).collect::<Vec<_>>()
    };
    let grey = corners("unlearned");
    assert_eq!(grey.len(), names * (names - 1) / 2 - 2, "all but two are grey");
    let ([plus], [minus]) = (&corners("plus")[..], &corners("minus")[..]) else {
        panic!("one red, one blue: {svg}")
    };
    // Both lie in the first column, red in the first row and blue in the second.
    assert_eq!(plus.0, minus.0);
    assert!(number(plus.1) < number(minus.1));
    assert!(svg.contains("gain · power: 0.97<") && svg.contains("noise_floor · power: −0.98<"));
    assert!(svg.contains(": 0.00, not told from chance"));
    // A run that is broken is told, and takes neither the table nor other figures with it.
    fixture.write(path, "{");
    let output = fixture.succeed(&reproduce(&["--table", "--figures", "f"]));
    assert!(output.stdout.contains("cannot be read"), "{}", output.stdout);
    assert!(fixture.path("f/errors-outdoor-fast.svg").exists());
}

#[test]
fn pairs_of_every_way_to_search_are_looked_at() {
    let fixture = Fixture::new();
    let both = SMALL.map(|word| if word == "fast" { "fast,paper" } else { word });
    let more = ["--protocol", "default,joint", "--figures", "figures"];
    fixture.succeed(&[&["reproduce", "-q"][..], &both, &more].concat());
    for search in ["fast", "paper"] {
        let file = format!("figures/overlays-outdoor-{search}-icp.svg");
        assert!(fixture.path(&file).exists(), "{file}");
    }
}

#[test]
fn what_is_missing_is_said_and_the_command_that_is_named_brings_it() {
    let fixture = Fixture::new();
    let some = ["--protocol", "default,registration", "--figures", "figures"];
    fixture.succeed(&reproduce(&some));
    let all = reproduce(&["--table", "--figures", "figures"]);
    let output = fixture.succeed(&all);
    for figure in ["tuned by hand against ours", "how parameters interact", "registered clouds"] {
        let line = output.stdout.lines().find(|line| line.contains(figure)).expect(figure);
        assert!(line.starts_with("Left out: "), "{line}");
    }
    let page = |name: &str| {
        fixture.succeed(&reproduce(&["--table", "-o", name]));
        fixture.read(name)
    };
    let before = page("before.html");
    assert!(before.contains("2 of 4 cells are missing"));
    let svg = panel(&before, "errors-outdoor-fast-icp-structured-translation");
    assert!(svg.contains("curve-registration") && !svg.contains("curve-tuned"));
    assert!(!before.contains("id=\"overlays"), "nothing is tuned together");
    for line in output.stdout.lines().filter(|line| line.starts_with("Left out: ")) {
        let (_, command) = line.split_once("`echoloop ").expect("a command");
        let (command, _) = command.split_once('`').expect("its end");
        let words = command.split(' ').chain(["-q", "--runs", "table"]);
        let words: Vec<String> = words.map(|word| word.replace('\'', "")).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        assert!(words.contains(&"--seed") || !words.contains(&"--seed=1"));
        fixture.succeed(&words);
    }
    let after = fixture.succeed(&all);
    assert!(!after.stdout.contains("Left out"), "{}", after.stdout);
    assert!(page("after.html").contains("One of 4 cells is missing"), "lidar alone");
}

#[test]
fn figures_that_cannot_be_written_or_have_no_cell_are_refused_and_nothing_is_left() {
    let fixture = Fixture::new();
    let default = ["--protocol", "default"];
    let with = |more: &[&'static str]| reproduce(&[&default[..], more].concat());
    fixture.write("file", "a file");
    fixture.refuses(&with(&["--figures", "file"]), &["file", "figures"]);
    fixture.refuses(&with(&["--figures", "file/below"]), &["file/below", "figures"]);
    fixture.refuses(&with(&["--figures", "/proc/figures"]), &["/proc/figures"]);
    fixture.refuses(&with(&["--figures", "f", "--ablation", "rain"]), &["--ablation"]);
    fixture
        .refuses(&["reproduce", "--by-hand", "--method", "mac"], &["--by-hand", "--method", "icp"]);
    fixture.succeed(&with(&[]));
    fs::create_dir_all(fixture.path("f/errors-outdoor-fast.png")).expect("a folder in the way");
    let whole = reproduce(&["--table", "--figures", "f"]);
    fixture.refuses(&whole, &["errors-outdoor-fast.png", "a folder is in the way"]);
    let none = ["--table", "--figures", "g", "--method", "mac"];
    fixture.refuses(
        &[&["reproduce"][..], &none, &["--runs", "table"]].concat(),
        &["table", "no cell", "--method mac"],
    );
}

/// A window as wide as a telephone's with the page in it, and what lies beyond its edge.
const NARROW: &str = r#"<!doctype html><html><body>
<iframe id="page" width="400" height="60000" style="border:0"></iframe>
<script>
const page = document.getElementById("page");
page.addEventListener("load", () => {
  const inside = page.contentDocument, data = document.body.dataset;
  data.wide = inside.documentElement.scrollWidth;
  const charts = [...inside.querySelectorAll("svg[data-figure]")];
  data.charts = charts.length;
  const boxes = (chart) => [...chart.querySelectorAll("text")]
    .filter((text) => !text.closest(".alone"))
    .map((text) => [text.textContent, text.getBoundingClientRect()]);
  const touch = (a, b) => a.left < b.right - 1 && b.left < a.right - 1
    && a.top < b.bottom - 2 && b.top < a.bottom - 2;
  const found = [];
  let least = 1e9;
  for (const chart of charts) {
    const all = boxes(chart).filter(() => !chart.dataset.figure.startsWith("interactions"));
    all.forEach(([text, a], k) => {
      least = Math.min(least, a.height);
      all.slice(k + 1).forEach(([other, b]) => {
        if (touch(a, b)) found.push(chart.dataset.figure + ": " + text + " / " + other);
      });
    });
  }
  data.least = Math.floor(least);
  data.touching = found.length;
  data.found = found.slice(0, 5).join("; ");
});
page.srcdoc = PAGE;
</script></body></html>"#;

#[test]
fn at_400_pixels_no_figure_is_wider_than_the_page_and_no_text_lies_on_another() {
    let fixture = Fixture::new();
    fixture.succeed(&reproduce(&["--by-hand"]));
    let html = fixture.read("table/report.html");
    let text = serde_json::to_string(&html).expect("a string").replace("</", "<\\/");
    let Some(page) = crate::browser::open("figures.html", &NARROW.replace("PAGE", &text), &[])
    else {
        return;
    };
    page.assert_no_complaints();
    assert!(page.pixels("data-wide") <= 400, "the page is wider than the window");
    assert!(page.pixels("data-charts") > 20);
    assert_eq!(page.pixels("data-touching"), 0, "{:?}", page.body("data-found"));
    assert!(page.pixels("data-least") >= 9, "text of {} pixels", page.pixels("data-least"));
}
