//! The page of an instrument's response.

use super::axis::Axis;
use super::page::{document, facts, header};
use super::plot::{Caption, Frame, Px, Sample, chart, legend};

const SIZE: Px = [880.0, 310.0];

/// Half the range of the second plot, over the response's top: the tail after the lobe is low.
const CLOSE_UP: f64 = 0.15;

/// A response to draw; lags, levels and spreads are of equal length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResponsePage {
    /// Heading, the name of the instrument.
    pub title: String,
    /// Names and values above the plots.
    pub facts: Vec<(String, String)>,
    /// Lags from the top, ns.
    pub lag_ns: Vec<f64>,
    /// Levels over the top's.
    pub level: Vec<f64>,
    /// σ of single echoes around it, over their height.
    pub spread: Vec<f64>,
}

impl ResponsePage {
    /// The page, complete.
    pub fn to_html(&self) -> String {
        let keys = [
            ("best", Sample::Line, "response"),
            ("band", Sample::Area, "single echoes, one σ either way"),
        ];
        let whole = self.plot(Axis::around(self.level.iter().copied()), "level");
        let close = self.plot(Axis::between(-CLOSE_UP, CLOSE_UP, false), "level, close up");
        let sections = format!(
            "{}<section id=\"response\"><figure>{whole}{close}{}</figure></section>\n",
            header(&self.title, &facts(&self.facts)),
            legend(&keys)
        );
        document(&self.title, &sections, "")
    }

    fn plot(&self, y: Axis, y_title: &str) -> String {
        let around = |sign: f64| {
            self.level.iter().zip(&self.spread).map(|(l, s)| l + sign * s).collect::<Vec<_>>()
        };
        let (low, high) = (around(-1.0), around(1.0));
        let label = format!("Line plot of the response: {y_title} over the lag from its top.");
        let caption = Caption::default();
        let x_title = "ns after the top";
        let frame = Frame { caption, size: SIZE, label: &label, y_title, x_title };
        let ends = (self.lag_ns.first().copied(), self.lag_ns.last().copied());
        let x = Axis::between(ends.0.unwrap_or(0.0), ends.1.unwrap_or(1.0), false);
        chart(&frame, x, y, |chart| {
            chart.band("band", &self.lag_ns, &low, &high)?;
            chart.line("best", &self.lag_ns, &self.level)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_response_is_drawn_twice_and_one_without_points_is_still_a_page() {
        let page = ResponsePage {
            title: "a <b>".into(),
            facts: vec![("width".into(), "5 ns".into())],
            lag_ns: vec![-1.0, 0.0, 1.0],
            level: vec![0.1, 1.0, 0.3],
            spread: vec![0.01; 3],
        };
        let html = page.to_html();
        assert_eq!(html.matches("Line plot of the response").count(), 2);
        assert!(html.contains("a &lt;b&gt;") && html.contains("<dd>5 ns</dd>"));
        let empty = ResponsePage::default().to_html();
        assert!(empty.ends_with("</html>\n") && !empty.contains("NaN"));
    }
}
