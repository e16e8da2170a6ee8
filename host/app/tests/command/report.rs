//! The page as a browser sees it. Without Chromium only the text is checked, loudly; with `CI` set,
//! that is a failure.

mod synthetic;

use crate::browser::open;
use echoloop_report::Report;

/// A view that works lights some ten thousand pixels; a camera that looks past the clouds lights
/// none.
const LIT_AT_LEAST: u32 = 5_000;

#[test]
fn both_views_show_points_and_the_console_stays_silent() {
    let html = synthetic::report(1).to_html();
    let Some(page) = open("report.html", &html, &[]) else {
        return;
    };
    page.assert_silent();
    for name in ["data-lit-before", "data-lit-after"] {
        let lit = page.pixels(name);
        eprintln!("{name}: {lit} pixels");
        assert!(lit > LIT_AT_LEAST, "{name} is {lit}");
    }
}

/// Presses, drags and clicks, and notes after each step whether each view changed.
const HANDS: &str = r#"<script>
const views = ["before", "after"].map((name) => document.getElementById("view-" + name));
const seen = () => views.map((view) => view.toDataURL());
window.requestAnimationFrame = (draw) => setTimeout(draw, 1); // a headless browser stops drawing frames by itself
const frame = () => new Promise((done) => setTimeout(done, 5));
const key = (key, shiftKey) => views[0].dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey }));
const drag = (buttons) => {
  views[1].setPointerCapture = () => {};
  const move = (type, clientX) => views[1].dispatchEvent(new PointerEvent(type, { pointerId: 1, clientX, buttons }));
  move("pointerdown", 10), move("pointermove", 60), move("pointerup", 60);
};
const set = (id, value) => {
  const input = document.getElementById(id);
  if (input.type === "checkbox") input.checked = value; else input.value = value;
  input.dispatchEvent(new Event("input"));
};
const steps = {
  orbit: () => key("ArrowLeft"), pan: () => key("ArrowUp", true), zoom: () => key("+"), drag: () => drag(1),
  slide: () => drag(2), toggle: () => set("show-source", false), height: () => set("colour-by", "1"),
  size: () => set("point-size", "2"),
  above: () => document.getElementById("view-top").click(), reset: () => key("0"),
};
(async () => {
  const start = seen();
  for (const [name, step] of Object.entries(steps)) {
    const before = seen();
    step();
    await frame();
    const changed = seen().filter((view, k) => view !== before[k]).length;
    document.body.dataset[name] = changed;
  }
  set("show-source", true), set("colour-by", "0"), set("point-size", "1");
  await frame();
  document.body.dataset.back = seen().filter((view, k) => view === start[k]).length;
})();
</script></body>"#;

#[test]
fn whatever_moves_one_view_moves_both() {
    let html = synthetic::report(1).to_html();
    let html = html.replace("</body>", HANDS);
    let Some(page) = open("hands.html", &html, &[]) else {
        return;
    };
    page.assert_silent();
    let steps = [
        "orbit", "pan", "zoom", "drag", "slide", "toggle", "height", "size", "above", "reset",
        "back",
    ];
    for step in steps {
        assert_eq!(page.body(&format!("data-{step}")), Some("2"), "{step}");
    }
}

#[test]
fn without_webgl_a_text_takes_the_place_of_the_views() {
    let html = synthetic::report(1).to_html();
    let Some(page) = open("fallback.html", &html, &["--disable-3d-apis"]) else {
        return;
    };
    assert_eq!((page.body("data-webgl"), page.body("data-ready")), (Some("0"), Some("1")));
    assert_eq!(page.dom.matches("<p class=\"fallback\">This view needs WebGL2").count(), 2);
}

/// Presses every button that saves a chart, and looks at what would be saved.
const SAVED: &str = r#"<script>
const saved = [];
HTMLAnchorElement.prototype.click = function () { saved.push([this.download, this.href]); };
const buttons = [...document.querySelectorAll(".save button")];
const charts = [...document.querySelectorAll("svg[data-figure]")];
buttons.forEach((button) => button.click());
const picture = (address) => new Promise((done) => {
  const image = new Image();
  image.onload = () => done(image), image.onerror = () => done(null);
  image.src = address;
});
const inked = (image) => {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width, image.height];
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) count += data[i] !== data[0] || data[i + 3] !== 255;
  return count;
};
const wait = async () => { for (let i = 0; i < 500 && saved.length < buttons.length; i++) await new Promise((done) => setTimeout(done, 10)); };
(async () => {
  await wait();
  const note = document.body.dataset;
  [note.charts, note.buttons, note.saved] = [charts.length, buttons.length, saved.length];
  note.names = new Set(saved.map(([name]) => name)).size;
  let [alone, drawn, least] = [0, 0, 1e9];
  for (const [name, address] of saved) {
    if (name.endsWith(".svg")) {
      const text = decodeURIComponent(address.split(",").slice(1).join(","));
      const parsed = new DOMParser().parseFromString(text, "image/svg+xml");
      alone += !parsed.querySelector("parsererror") && !/var\(|class=|vector-effect|url\(/.test(text) && text.includes("xmlns=");
    }
    const image = await picture(address);
    if (!image || image.width < 100) continue;
    drawn++;
    least = Math.min(least, inked(image));
  }
  [note.alone, note.drawn, note.least] = [alone, drawn, least];
})();
</script></body>"#;

#[test]
fn every_chart_is_saved_as_svg_and_as_png_and_stands_alone() {
    let html = synthetic::report(1).to_html();
    let Some(page) = open("saved.html", &html.replace("</body>", SAVED), &[]) else {
        return;
    };
    page.assert_silent();
    let charts = page.pixels("data-charts");
    assert!(charts > 20, "{charts} charts");
    for (name, count) in [
        ("data-buttons", 2 * charts),
        ("data-saved", 2 * charts),
        ("data-names", 2 * charts),
        ("data-alone", charts),
        ("data-drawn", 2 * charts),
    ] {
        assert_eq!(page.pixels(name), count, "{name}");
    }
    assert!(page.pixels("data-least") > 500, "one is nearly blank");
}

#[test]
fn charts_from_the_command_line_have_their_title_legend_and_ink() {
    let figures = synthetic::report(1).figures().expect("drawn");
    let named = |name: &str| figures.iter().find(|figure| figure.name == name).expect(name);
    for (name, texts) in [
        ("fitness", &["Convergence", "median candidate", "generation"][..]),
        ("importance", &["noise_floor", "95 % interval", "40.0\u{a0}%"]),
        ("slice-noise-floor", &["Slice along noise_floor", "chosen", "candidates"]),
        ("parameter-voxel", &["voxel, m", "± one standard deviation"]),
        ("correlations", &["What moved together"]),
        ("pairs", &["default, failure", "bound of success"]),
    ] {
        let svg = &named(name).svg;
        for text in texts {
            assert!(svg.contains(text), "{name} does not say {text}");
        }
    }
    for figure in &figures {
        assert!(figure.png.len() > 2_000, "{} is nearly blank", figure.name);
    }
}

/// A window as wide as a telephone's with the page in it, and what of the page it can show.
const NARROW: &str = r#"<!doctype html><html><body><iframe id="page" width="400" height="40000" style="border:0"></iframe>
<script>
const page = document.getElementById("page");
page.addEventListener("load", () => {
  const inside = page.contentDocument, data = document.body.dataset;
  const seen = (mark) => [...inside.querySelectorAll(mark)].filter((element) => {
    const box = element.getBoundingClientRect();
    const at = inside.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    return box.width > 20 && box.height > 8 && box.left >= 0 && box.right <= 400 && element.contains(at);
  }).length;
  data.width = inside.documentElement.clientWidth;
  data.wide = inside.documentElement.scrollWidth;
  data.better = seen('#evaluation .change.better');
  data.worse = seen('#evaluation .change.worse');
  data.verdict = seen(".verdict .worse");
  data.heads = inside.defaultView.getComputedStyle(inside.querySelector('#evaluation td'), "::before").content;
});
page.srcdoc = PAGE;
</script></body></html>"#;

#[test]
fn at_400_pixels_the_table_shows_what_got_worse_beside_what_got_better() {
    let html = synthetic::report(1).to_html();
    let text = serde_json::to_string(&html).expect("a string").replace("</", "<\\/");
    let Some(page) = open("narrow.html", &NARROW.replace("PAGE", &text), &[]) else {
        return;
    };
    let number = |name: &str| page.pixels(name);
    assert_eq!(number("data-width"), 400);
    assert!(number("data-wide") <= 400, "the page is wider than the window");
    // Three rows are tuned: in each one figure got better, one worse.
    assert_eq!((number("data-better"), number("data-worse")), (3, 3));
    assert_eq!(number("data-verdict"), 1, "the headline says what got worse");
    assert!(page.body("data-heads").is_some_and(|head| head.contains("Recall")));
}

#[test]
fn the_page_refers_to_nothing_outside_itself() {
    let html = synthetic::report(1).to_html();
    for reference in
        ["http://", "https://", "src=", "url(", "@import", "import(", "fetch(", "XMLHttp"]
    {
        assert!(!html.contains(reference), "the page holds {reference}");
    }
    assert_eq!(html.matches("href=").count(), 1, "only the empty icon");
}

#[test]
fn every_colour_is_the_style_sheets() {
    let html = synthetic::report(1).to_html();
    let (_, body) = html.split_once("<body>").expect("a body");
    let (body, _) = body.rsplit_once("<script>").expect("a script, which saves charts");
    for colour in ["#EC40", "fill=\"#", "stroke=\"#", "font-family", "font-size"] {
        assert!(!body.contains(colour), "a drawing holds {colour}");
    }
}

#[test]
fn the_same_data_give_the_same_bytes() {
    let [a, b] = [1, 1].map(|seed| synthetic::report(seed).to_html());
    assert!(a == b);
    eprintln!(
        "a report of 30 generations, 12 parameters, 20 pairs and 48,000 points: {} bytes",
        a.len()
    );
}

#[test]
fn a_report_of_nothing_but_gaps_is_drawn() {
    let mut report = synthetic::report(2);
    blank(&mut report);
    let html = report.to_html();
    for text in ["NaN", "inf\"", "inf "] {
        assert!(!html.contains(text), "the page holds {text}");
    }
    let Some(page) = open("gaps.html", &html, &[]) else {
        return;
    };
    page.assert_silent();
}

/// Replaces every number by one that is not finite.
fn blank(report: &mut Report) {
    for generation in &mut report.generations {
        generation.sigma = f64::INFINITY;
        generation.mean.fill(f64::NAN);
        generation.candidates.iter_mut().for_each(|candidate| candidate.fitness = f64::INFINITY);
    }
    for row in &mut report.table.rows {
        row.figures.recall_pct.value = f64::NAN;
        row.figures.mean_translation_m.value = f64::INFINITY;
    }
    let result = &mut report.run.result;
    result.finalists.iter_mut().for_each(|finalist| finalist.fitness = f64::NAN);
    result.default.values_mut().for_each(|value| *value = f64::NAN);
    result.tuned.values_mut().for_each(|value| *value = f64::NEG_INFINITY);
    let summaries = [&mut result.default_summary, &mut result.tuned_summary];
    for error in summaries.into_iter().flat_map(|summary| &mut summary.errors) {
        *error = synthetic::error(f64::NAN, f64::NAN);
    }
    report.background.correlations.iter_mut().for_each(|row| row.fill(f64::NAN));
    report.clouds[0][0].points.fill([f32::NAN; 3].into());
    report.clouds[1] = Default::default();
}
