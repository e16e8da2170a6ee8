//! Classes of the style sheet in place of plotters' colours, so that dark mode and print follow.

use plotters::style::RGBColor;

/// Classes of all plots. While plotters draws, each is encoded as a colour of its own.
#[rustfmt::skip]
pub(super) const CLASSES: [&str; 50] = [
    "grid", "frame", "tick", "axis", "limit", "default", "best", "median", "mean-point", "band",
    "held-out", "sigma", "mean", "spread", "tuned", "slope good", "slope bad", "dot-default",
    "dot-default hollow", "dot-tuned", "dot-tuned hollow", "curve-default", "curve-tuned", "cell",
    "plus", "minus", "value", "value strong", "name", "bar-back", "bar", "whisker",
    "own-title", "candidate", "bar strong-bar", "curve-lidar", "curve-registration",
    "ring-lidar", "ring-registration", "cloud-target", "cloud-source", "key-target", "key-source",
    "middle", "unlearned", "beam-none", "beam-near", "beam-middle", "beam-far", "beam-farthest",
];

/// Colour that encodes `class` until [`themed`] puts the class in its place.
pub(super) fn ink(class: &str) -> RGBColor {
    let index = CLASSES.iter().position(|known| *known == class);
    RGBColor(0xEC, 0x40, index.expect("plots use classes of the theme only") as u8)
}

/// Content of an SVG by plotters with classes in place of colours, and without attributes that the
/// style sheet sets.
pub(super) fn themed(svg: &str) -> String {
    let content = svg.split_once('>').map_or(svg, |(_, content)| content).replace('\n', "");
    let plain = [
        " opacity=\"1\"",
        " stroke-width=\"1\"",
        " font-family=\"sans-serif\"",
        " font-size=\"100\"",
    ]
    .iter()
    .fold(content, |text, attribute| text.replace(attribute, ""));
    CLASSES.iter().fold(plain, |text, class| {
        let RGBColor(r, g, b) = ink(class);
        ["fill", "stroke"].iter().fold(text, |text, attribute| {
            text.replace(
                &format!("{attribute}=\"#{r:02X}{g:02X}{b:02X}\""),
                &format!("class=\"{class}\""),
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_style_sheet_knows_every_class() {
        let style = include_str!("report.css");
        for class in CLASSES.iter().flat_map(|classes| classes.split(' ')) {
            assert!(style.contains(&format!(".{class}")), "{class}");
        }
    }

    #[test]
    fn attributes_become_classes_but_text_stays() {
        let svg = "<svg width=\"1\">\n<line opacity=\"1\" stroke=\"#EC4001\" x1=\"0\"/>\n\
                   <text>#EC4001</text></svg>\n";
        assert_eq!(themed(svg), "<line class=\"frame\" x1=\"0\"/><text>#EC4001</text></svg>");
    }
}
