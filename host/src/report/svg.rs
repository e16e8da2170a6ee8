//! The few SVG elements the plots need, as text. Colours and fonts are the style sheet's.

use super::format::escape;

/// A point on the drawing, in its units, y down.
pub(super) type Px = [f64; 2];

/// A drawing under way.
pub(super) struct Svg {
    size: Px,
    label: String,
    body: String,
}

impl Svg {
    /// `label` is what a screen reader says.
    pub(super) fn new(size: Px, label: &str) -> Self {
        Self {
            size,
            label: escape(label),
            body: String::new(),
        }
    }

    pub(super) fn line(&mut self, class: &str, [x1, y1]: Px, [x2, y2]: Px) {
        self.body += &format!(
            "<path class=\"{class}\" d=\"M{} {}L{} {}\"/>",
            n(x1),
            n(y1),
            n(x2),
            n(y2)
        );
    }

    /// Straight strokes through `points`, closed on request.
    pub(super) fn path(&mut self, class: &str, points: &[Px], close: bool) {
        let mut strokes = String::new();
        for (i, [x, y]) in points.iter().enumerate() {
            strokes += &format!("{}{} {}", if i == 0 { 'M' } else { 'L' }, n(*x), n(*y));
        }
        let end = if close { "Z" } else { "" };
        self.body += &format!("<path class=\"{class}\" d=\"{strokes}{end}\"/>");
    }

    /// A rectangle from its upper left corner.
    pub(super) fn rect(&mut self, class: &str, [x, y]: Px, [width, height]: Px, opacity: f64) {
        let opacity = if opacity < 1.0 {
            format!(" fill-opacity=\"{opacity:.2}\"")
        } else {
            String::new()
        };
        self.body += &format!(
            "<rect class=\"{class}\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"{opacity}/>",
            n(x),
            n(y),
            n(width),
            n(height)
        );
    }

    pub(super) fn dot(&mut self, class: &str, [x, y]: Px, radius: f64) {
        self.body += &format!(
            "<circle class=\"{class}\" cx=\"{}\" cy=\"{}\" r=\"{}\"/>",
            n(x),
            n(y),
            n(radius)
        );
    }

    pub(super) fn text(&mut self, class: &str, [x, y]: Px, text: &str) {
        self.body += &format!(
            "<text class=\"{class}\" x=\"{}\" y=\"{}\">{}</text>",
            n(x),
            n(y),
            escape(text)
        );
    }

    /// Text that runs up and to the right from where it starts.
    pub(super) fn slanted_text(&mut self, class: &str, [x, y]: Px, text: &str) {
        self.body += &format!(
            "<text class=\"{class}\" transform=\"translate({} {}) rotate(-45)\">{}</text>",
            n(x),
            n(y),
            escape(text)
        );
    }

    /// What `draw` draws shows `hint` under the pointer.
    pub(super) fn hinted(&mut self, hint: &str, draw: impl FnOnce(&mut Self)) {
        self.body += &format!("<g><title>{}</title>", escape(hint));
        draw(self);
        self.body += "</g>";
    }

    pub(super) fn finish(self) -> String {
        let [width, height] = self.size;
        format!(
            "<svg role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {} {}\">{}</svg>",
            self.label,
            n(width),
            n(height),
            self.body
        )
    }
}

/// A coordinate to a tenth, short.
fn n(value: f64) -> String {
    let tenths = (value * 10.0).round() as i64;
    match tenths % 10 {
        0 => (tenths / 10).to_string(),
        _ => (tenths as f64 / 10.0).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_short_and_finite() {
        let cases = [
            (1.0, "1"),
            (1.26, "1.3"),
            (-0.04, "0"),
            (-0.5, "-0.5"),
            (f64::NAN, "0"),
        ];
        for (value, text) in cases {
            assert_eq!(n(value), text);
        }
    }
}
