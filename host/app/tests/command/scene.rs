//! `echoloop scene`: its facts, its picture, and its page as a browser sees it. Without Chromium
//! only the text is checked, loudly; with `CI` set, that is a failure.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use crate::browser::{Opened, open};
use crate::fixture::Fixture;
use echoloop_needs::data;

const EYES: &str = include_str!("scene/eyes.js");
const LOOK: &str = include_str!("scene/look.js");
const HANDS: &str = include_str!("scene/hands.js");
/// Folder of the pictures that `docs/scenes.md` shows, each called as its scene.
const PICTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/pictures");
const WIDTHS: &str = include_str!("scene/widths.html");

/// The page of the yard with the small configuration's pairs.
static YARD: LazyLock<String> = LazyLock::new(|| {
    let fixture = Fixture::new();
    fixture.succeed(&["scene", "-q", "-c", "small.toml", "-o", "page.html"]);
    fixture.read("page.html")
});

fn with_script(html: &str, script: &str) -> String {
    html.replace("</body>", &format!("<script>{EYES}{script}</script></body>"))
}

/// The page with a script of ours, which reached its end.
fn opened(name: &str, html: &str, flags: &[&str]) -> Option<Opened> {
    let page = open(name, html, flags)?;
    page.assert_no_complaints();
    assert_eq!((page.body("data-error"), page.body("data-ended")), (None, Some("1")), "{name}");
    Some(page)
}

#[test]
fn a_town_is_drawn_with_its_materials_and_its_pairs_and_its_page_is_below_10_mb() {
    let fixture = Fixture::new();
    fixture.succeed(&["scene", "-q", "-o", "page.html"]);
    let html = fixture.read("page.html");
    eprintln!("the page of the default scene: {} bytes", html.len());
    assert!((500_000..10_000_000).contains(&html.len()), "{} bytes", html.len());
    let size = ["--window-size=1400,1000"];
    let Some(page) = opened("town.html", &with_script(&html, LOOK), &size) else {
        return;
    };
    let number = |name: &str| page.pixels(&format!("data-{name}"));
    assert!((40..=100).contains(&number("drawn")), "{} % of the view", number("drawn"));
    assert!(number("colours") > 1000, "{} colours", number("colours"));
    assert!(number("across") > 900, "{} pixels at 1400", number("across"));
    let (seen, listed) = (number("materials"), number("listed"));
    eprintln!("{seen} of {listed} materials are seen from above and beside");
    assert!(seen >= 12 && seen <= listed, "{seen} of {listed} materials are seen");
    assert_eq!(number("left"), 0, "with all hidden nothing is drawn");
    for step in ["train", "held-out", "orbit", "reflectance"] {
        assert!(number(step) > 50, "{step} changes {} pixels", number(step));
    }
}

#[test]
fn every_hand_moves_the_view_and_a_pair_is_found_by_its_dot_and_by_its_name() {
    let Some(page) = opened("yard-hands.html", &with_script(&YARD, HANDS), &[]) else {
        return;
    };
    let steps = [
        "orbit", "pan", "zoom", "drag", "slide", "pinch", "wheel", "above", "select", "stand",
        "next", "leave", "previous", "reset",
    ];
    for step in steps {
        let changed = page.pixels(&format!("data-{step}"));
        assert!(changed > 20, "{step} changes {changed} pixels");
    }
    // Four training pairs, then three held-out ones.
    let told = page.body("data-told").expect("what was selected");
    for part in ["above ;", "select 1;", "stand 1;", "next 2;", "leave ;", "previous 6;"] {
        assert!(told.contains(part), "{part} {told}");
    }
    assert_eq!(page.body("data-back"), Some("0"), "0 leads back to the first view");
    let body = |name: &str| page.body(&format!("data-{name}"));
    assert_eq!(body("chosen"), Some("training pair 0"));
    assert!(body("says").is_some_and(|text| text.contains("viewpoints 1 and 2, ")), "{told}");
    assert_eq!((body("unnamed"), body("hovered")), (Some(""), Some("training pair 0")));
    assert_eq!((body("clicked"), body("hands")), (Some("0"), Some("there")));
}

#[test]
fn at_400_and_at_1400_pixels_nothing_lies_beyond_the_edge() {
    let text = serde_json::to_string(&*YARD).expect("a string").replace("</", "<\\/");
    let size = ["--window-size=1440,6200"];
    let Some(page) = opened("yard-widths.html", &WIDTHS.replace("PAGE", &text), &size) else {
        return;
    };
    for (width, beside) in [(400, 0), (1400, 1)] {
        assert_eq!(page.pixels(&format!("data-seen{width}")), 7, "{width}");
        assert!(page.pixels(&format!("data-wide{width}")) <= width, "wider than {width}");
        assert_eq!(page.pixels(&format!("data-beside{width}")), beside, "the list at {width}");
    }
}

#[test]
fn without_webgl_a_still_picture_stays_and_says_why() {
    let Some(page) = open("yard-still.html", &YARD, &["--disable-3d-apis"]) else {
        return;
    };
    assert_eq!((page.body("data-webgl"), page.body("data-ready")), (Some("0"), Some("1")));
    let shown = |tag: &str| {
        let (_, rest) = page.dom.split_once(&format!("id=\"{tag}\"")).expect(tag);
        !rest.split('>').next().unwrap_or_default().contains("hidden")
    };
    assert_eq!(["still", "no-view", "view-scene"].map(shown), [true, true, false]);
}

#[test]
fn the_page_refers_to_nothing_outside_itself_and_names_what_it_shows() {
    for reference in ["http://", "https://", "url(", "@import", "import(", "fetch(", "XMLHttp"] {
        assert!(!YARD.contains(reference), "the page holds {reference}");
    }
    assert_eq!(YARD.matches("src=").count(), YARD.matches("src=\"data:image/png;base64,").count());
    assert_eq!(YARD.matches("href=").count(), 1, "only the empty icon");
    for text in ["4 training, 3 held-out", "<dt>seed</dt><dd>1</dd>", "held-out pair 2", "0.3<"] {
        assert!(YARD.contains(text), "the page does not say {text}");
    }
    assert!(YARD.contains("default-src 'none'"));
}

#[test]
fn page_and_picture_are_the_same_bytes_on_one_thread_and_on_two() {
    let fixture = Fixture::new();
    for threads in ["1", "2"] {
        let (page, picture) = (format!("{threads}.html"), format!("{threads}.png"));
        let files = ["-o", &page, "--picture", &picture, "--width", "160"];
        let arguments = ["scene", "-q", "-c", "small.toml", "--threads", threads];
        fixture.succeed(&[&arguments[..], &files].concat());
    }
    assert!(fixture.bytes("1.html") == fixture.bytes("2.html"));
    assert!(fixture.bytes("1.html") == YARD.as_bytes());
    let picture = fixture.bytes("1.png");
    assert!(picture == fixture.bytes("2.png") && picture.len() > 1000);
    assert_eq!(picture[16..24], [0, 0, 0, 160, 0, 0, 0, 100], "width and height");
}

/// Text in a picture on its scene and its drawing.
fn source(png: &[u8]) -> String {
    let key = b"Source\0";
    let at = png.windows(key.len()).position(|bytes| bytes == key).expect("a Source");
    // After the keyword: two numbers, then two texts that are empty.
    String::from_utf8_lossy(&png[at + key.len() + 4..][..33]).into_owned()
}

/// Compares the source that each picture names with that of the scene as it is now.
fn pictures_are_of_today_s_scenes(scenes: &[&str]) {
    let fixture = Fixture::new();
    for scene in scenes {
        let few = ["--set", "data.train_pairs=1", "--set", "data.test_pairs=1"];
        let small = ["-q", "--picture", "now.png", "--width", "16"];
        fixture.succeed(&[&["scene", scene], &small[..], &few].concat());
        let old = fs::read(Path::new(PICTURES).join(format!("{scene}.png"))).expect("a picture");
        let now = fixture.bytes("now.png");
        assert_eq!(source(&old), source(&now), "{scene}: run cargo xtask pictures");
    }
}

#[test]
fn the_pictures_of_the_three_kinds_are_of_the_scenes_as_they_are_now() {
    pictures_are_of_today_s_scenes(&["structured", "semi-structured", "unstructured"]);
}

#[test]
#[ignore = "nine places of several square kilometres"]
fn the_pictures_of_the_named_towns_are_of_the_scenes_as_they_are_now() {
    if data("carla_xodr").is_none() {
        return;
    }
    let files = fs::read_dir(PICTURES).expect("the pictures").map(|file| file.expect("a file"));
    let scenes: Vec<String> = files
        .map(|file| file.path().file_stem().expect("a name").to_string_lossy().into_owned())
        .filter(|scene| !scene.ends_with("structured"))
        .collect();
    assert!(scenes.len() >= 9, "{scenes:?}");
    pictures_are_of_today_s_scenes(&scenes.iter().map(String::as_str).collect::<Vec<_>>());
}

#[test]
fn without_a_file_the_facts_are_printed_as_text_and_as_a_document() {
    let fixture = Fixture::new();
    let text = fixture.succeed(&["scene", "yard.obj", "-q", "-c", "small.toml"]).stdout;
    for part in ["triangles", "162", "4 training, 3 held-out", "80.0 × 80.0 × 7.0 m", "seed"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let told = fixture.succeed(&["scene", "-q", "--json", "-c", "small.toml"]).json();
    let pairs = told["pairs"].as_array().expect("pairs");
    assert_eq!((pairs.len(), &told["triangles"]), (7, &serde_json::json!(162)));
    let nearest = |pair: &serde_json::Value| pair["nearest_other_m"].as_f64().expect("metres");
    let least = pairs.iter().map(nearest).fold(f64::INFINITY, f64::min);
    assert_eq!(told["least_apart_m"].as_f64(), Some(least));
    assert!(least >= 7.9, "{least} m: 0.4 of a cell of a quarter of the place");
    // The pairs are those that `pairs` writes.
    fixture.succeed(&["pairs", "-q", "-c", "small.toml", "-o", "pairs"]);
    let written = fixture.read("pairs/001_world_from_source.txt");
    let rows = &pairs[5]["world_from_second"];
    for (row, line) in written.lines().enumerate() {
        for (column, number) in line.split(' ').enumerate() {
            assert_eq!(rows[row][column].as_f64(), number.parse().ok(), "{row}, {column}");
        }
    }
}

#[test]
fn a_mesh_where_no_pair_fits_is_shown_and_says_why_there_are_none() {
    let fixture = Fixture::new();
    let rock = "v 0 0 0\nv 3 0 0\nv 0 3 0\nv 1 1 9\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    fixture.write("rock.obj", rock);
    let alone = ["scene", "rock.obj", "--set", "scene.ground=none", "-o", "rock.html"];
    let output = fixture.succeed(&alone);
    assert!(output.stderr.contains("remark: rock"), "{}", output.stderr);
    assert!(output.stdout.contains("0 training, 0 held-out"), "{}", output.stdout);
    let html = fixture.read("rock.html");
    assert!(html.contains("There are none.") && html.contains("has no viable viewpoint"));
    let script = "ready().then(() => { note.drawn = new Set(pixels()).size; note.ended = 1; });";
    if let Some(page) = opened("rock.html", &with_script(&html, script), &[]) {
        assert!(page.pixels("data-drawn") > 2, "the rock is drawn");
    }
}

#[test]
fn what_cannot_be_shown_or_written_is_refused_before_anything_is_done() {
    let fixture = Fixture::new();
    fixture.write("bad.obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n");
    for (arguments, parts) in [
        (&["scene", "village", "-o", "page.html"][..], &["village"][..]),
        (&["scene", "bad.obj", "-o", "page.html"], &["bad.obj"]),
        (&["scene", "yard.obj", "--scene", "structured"], &["--scene"]),
        (&["scene", "yard.obj", "-o", "absent/page.html"], &["absent/page.html"]),
        (&["scene", "yard.obj", "--picture", "page.jpg"], &["page.jpg", ".png"]),
        (&["scene", "yard.obj", "--width", "100"], &["--picture"]),
        (&["scene", "yard.obj", "--picture", "a.png", "--width", "9000"], &["--width", "8192"]),
        (&["scene", "--town", "9"], &["--town 9", "1, 2, 3"]),
    ] {
        fixture.refuses(arguments, parts);
    }
}
