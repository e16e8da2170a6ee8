//! Standalone charts: each chart of a page as SVG with its own colours, and as PNG.
//!
//! Charts are cut out of the page, so that none is missing and none differs. On a page a chart has
//! classes, and its colours come from the style sheet; here the rules of those classes go with it,
//! with the light theme's values in place of variables. On a page lines keep their width at any
//! size of the chart; here everything scales, so widths are in the drawing's own units.

use std::path::Path;
use std::sync::{Arc, LazyLock};

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::fontdb::Database;
use resvg::usvg::{Options, Tree};

use super::plot::FINE;
use super::theme::CLASSES;
use echoloop_closed_loop::run_folder::files::{
    FileError, PART, beside, is_free_for_a_file, make_folders, replace,
};

/// A chart that stands alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Figure {
    /// Name of letters, digits and dashes, fit for a file.
    pub name: String,
    /// The drawing as SVG.
    pub svg: String,
    /// The drawing as PNG, at twice its natural size.
    pub png: Vec<u8>,
}

/// Pixels of the PNG per pixel of the drawing at natural size.
const PNG_SCALE: f32 = 2.0;

const STYLE: &str = include_str!("report.css");

/// Font of all charts: DejaVu Sans with the letters that charts use. It is part of the program, so
/// that a machine without fonts draws the same picture.
const FONT: &[u8] = include_bytes!("font/dejavu-sans-subset.ttf");
const FONT_NAME: &str = "DejaVu Sans";

/// Writes figures as SVG and as PNG into a folder, which is made where there is none. Nothing is
/// written where anything but a file is in the way of one.
///
/// # Errors
///
/// [`FileError`].
pub fn write_figures(figures: &[Figure], folder: &Path) -> Result<(), FileError> {
    let places = |name: &str| ["svg", "png"].map(|ending| folder.join(format!("{name}.{ending}")));
    for path in figures.iter().flat_map(|figure| places(&figure.name)) {
        is_free_for_a_file(&path)?;
        is_free_for_a_file(&beside(&path, PART))?;
    }
    make_folders(folder)?;
    for Figure { name, svg, png } in figures {
        let [drawing, picture] = places(name);
        replace(&drawing, svg.as_bytes())?;
        replace(&picture, png)?;
    }
    Ok(())
}

/// Every chart of a page, in its order.
///
/// # Errors
///
/// A text about the first chart that cannot be drawn.
pub(super) fn figures(html: &str) -> Result<Vec<Figure>, String> {
    let figure = |chart: &str| {
        let name = attribute(chart, "data-figure").unwrap_or_default();
        let parts = box_of(chart).zip(attribute(chart, "aria-label")).zip(chart.split_once('>'));
        let ((view, label), (_, content)) =
            parts.ok_or_else(|| format!("the chart {name} has no box"))?;
        Figure::new(name, view, label, content)
    };
    charts(html).map(figure).collect()
}

/// Named charts, without `<svg ` and `</svg>`. All text of a page is escaped, so no other `<svg`
/// occurs.
fn charts(html: &str) -> impl Iterator<Item = &str> {
    let pieces = html.split("<svg ").skip(1);
    let charts = pieces.filter_map(|piece| Some(piece.split_once("</svg>")?.0));
    charts.filter(|chart| attribute(chart, "data-figure").is_some())
}

/// Value of an attribute of the opening tag.
fn attribute<'a>(chart: &'a str, name: &str) -> Option<&'a str> {
    let tag = chart.split_once('>')?.0;
    Some(tag.split_once(&format!("{name}=\""))?.1.split_once('"')?.0)
}

/// Left, top, width and height of a chart that stands alone.
pub(super) fn box_of(chart: &str) -> Option<[f64; 4]> {
    let sides =
        attribute(chart, "data-box")?.split(' ').map(str::parse).collect::<Result<Vec<_>, _>>();
    sides.ok()?.try_into().ok()
}

impl Figure {
    /// SVG content within a box, on paper. `label` is HTML.
    pub(super) fn new(
        name: &str,
        [left, top, width, height]: [f64; 4],
        label: &str,
        content: &str,
    ) -> Result<Self, String> {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" \
             viewBox=\"{left} {top} {width} {height}\" role=\"img\"><title>{label}</title>\
             <style>{}</style><rect class=\"paper\" x=\"{left}\" y=\"{top}\" \
             width=\"{width}\" height=\"{height}\"/>{content}</svg>\n",
            width / FINE,
            height / FINE,
            *RULES
        );
        let png = png(&svg).map_err(|error| format!("the chart {name}: {error}"))?;
        Ok(Self { name: name.to_owned(), svg, png })
    }
}

/// The style sheet's rules for drawings, `@media` left out.
static RULES: LazyLock<String> = LazyLock::new(|| {
    let plain = STYLE.split("\n@media").map(|part| match part.split_once("\n}\n") {
        Some((_, after)) if !part.starts_with(':') => after,
        _ => part,
    });
    let plain = without_comments(&plain.collect::<String>());
    let rules = plain.split('}').filter_map(|rule| {
        let (selectors, body) = rule.split_once('{')?;
        let (selectors, body) = (of_drawings(selectors), standalone_body(body));
        (!selectors.is_empty() && !body.is_empty()).then(|| format!("{selectors}{{{body}}}"))
    });
    // Invisible areas keep the hints under the pointer.
    let hints = ".hint-area{fill:none;pointer-events:all}";
    rules.chain([format!(".paper{{fill:{}}}{hints}", variable("surface"))]).collect()
});

fn without_comments(style: &str) -> String {
    let pieces = style.split("/*").enumerate();
    pieces
        .map(|(i, piece)| if i == 0 { piece } else { piece.split_once("*/").map_or("", |p| p.1) })
        .collect()
}

/// The selectors of a rule that begin in a drawing: `svg text`, `.grid`, but not
/// `.legend svg`.
fn of_drawings(selectors: &str) -> String {
    let is_class = |word: &str| {
        let mut names = word.split('.').skip(1);
        word.starts_with('.')
            && names.all(|name| CLASSES.iter().any(|c| c.split(' ').any(|part| part == name)))
    };
    let is_ours = |selector: &&str| match selector.split_once(' ') {
        Some(("svg", inner)) => !inner.contains(' '),
        Some(_) => false,
        None => is_class(selector),
    };
    selectors.split(',').map(str::trim).filter(is_ours).collect::<Vec<_>>().join(",")
}

/// Declarations with variables replaced by values, and lengths in drawing units.
fn standalone_body(body: &str) -> String {
    let declarations = body.split(';').filter_map(|d| d.trim().split_once(": "));
    let alone = declarations.filter_map(|(name, value)| match name {
        "vector-effect" | "font-variant-numeric" | "display" => None,
        "font-family" => Some(format!("{name}:\"{FONT_NAME}\",sans-serif")),
        "stroke-width" | "stroke-dasharray" => Some(format!("{name}:{}", in_units(value))),
        _ => Some(format!("{name}:{}", resolved(value))),
    });
    alone.collect::<Vec<_>>().join(";")
}

fn in_units(lengths: &str) -> String {
    let numbers = lengths.split(' ').filter_map(|number| number.parse::<f64>().ok());
    numbers.map(|number| (FINE * number).to_string()).collect::<Vec<_>>().join(" ")
}

fn resolved(value: &str) -> String {
    let name = value.strip_prefix("var(--").and_then(|rest| rest.strip_suffix(')'));
    name.map_or_else(|| value.to_owned(), variable)
}

/// Value of a variable in the light theme, which comes first in the style sheet.
fn variable(name: &str) -> String {
    let found = STYLE.split_once(&format!("--{name}: ")).and_then(|(_, rest)| rest.split_once(';'));
    found.map_or_else(String::new, |(value, _)| value.to_owned())
}

fn png(svg: &str) -> Result<Vec<u8>, String> {
    let tree = Tree::from_str(svg, &OPTIONS).map_err(|error| error.to_string())?;
    let size = tree.size();
    let [width, height] = [size.width(), size.height()].map(|s| (PNG_SCALE * s).ceil() as u32);
    let mut pixels = Pixmap::new(width, height).ok_or("it has no size")?;
    resvg::render(&tree, Transform::from_scale(PNG_SCALE, PNG_SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| error.to_string())
}

static OPTIONS: LazyLock<Options<'static>> = LazyLock::new(|| {
    let mut fonts = Database::new();
    fonts.load_font_data(FONT.to_vec());
    fonts.set_sans_serif_family(FONT_NAME);
    Options { fontdb: Arc::new(fonts), font_family: FONT_NAME.into(), ..Options::default() }
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_for_drawings_have_every_class_and_no_variable() {
        let rules = &*RULES;
        for class in CLASSES.iter().flat_map(|classes| classes.split(' ')) {
            assert!(rules.contains(&format!(".{class}")), "{class}: {rules}");
        }
        assert!(rules.contains("svg text{font-family:\"DejaVu Sans\",sans-serif;font-size:120px"));
        assert!(rules.contains(".default{stroke:#767f8e;stroke-width:15;stroke-dasharray:60 40}"));
        for foreign in ["var(", "vector-effect", ".legend", ".figures", "@media", "width:100%"] {
            assert!(!rules.contains(foreign), "{foreign}: {rules}");
        }
        assert!(rules.contains(".paper{fill:#ffffff}"));
    }

    #[test]
    fn a_standalone_chart_is_mostly_background() {
        let figures = crate::tests::report("start").figures().expect("drawn");
        assert_eq!(figures.len(), 6);
        for Figure { name, svg, png } in figures {
            let pixels = Pixmap::decode_png(&png).expect("a PNG");
            let width: f32 = svg.split('"').nth(3).expect("a width").parse().expect("a number");
            assert_eq!(pixels.width(), (PNG_SCALE * width).ceil() as u32);
            let paper = pixels.pixels().iter().filter(|p| p.red() == 255 && p.alpha() == 255);
            let share = paper.count() as f64 / pixels.pixels().len() as f64;
            assert!((0.75..0.999).contains(&share), "{name}: {share} is paper");
        }
    }

    #[test]
    fn the_font_has_every_letter_that_a_chart_may_write() {
        let drawn = |letter: char| {
            let text = format!("<text x=\"20\" y=\"90\" font-size=\"60\">{letter}</text>");
            let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"120\" height=\"120\">";
            png(&format!("{svg}{text}</svg>")).expect("a drawing")
        };
        let missing = drawn('\u{4e00}');
        let letters = "0Aaz%~äöüéñß‖−→±°✕µσΔ×·≤≥²⁶’–Øλθ";
        for letter in letters.chars() {
            assert!(drawn(letter) != missing, "{letter}");
        }
    }
}
