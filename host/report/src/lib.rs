//! Pages and figures: plain data in, one HTML file or picture out.
//!
//! To add a figure to the page of a run, touch three files:
//!
//! 1. a file in `sections`: its data, `of_run` (from a finished run), `section` (to HTML);
//! 2. `sections/mod.rs`: a field of [`Report`], filled in [`page`] and drawn in
//!    [`Report::to_html`];
//! 3. `host/app/tests/command/report/synthetic.rs`: made-up data, for the tests in a browser.
//!
//! To add a kind of panel to the figures of the study: a file with its data, `KEYS` and `svg`, a
//! variant of [`PanelDrawing`] in `plates.rs`, and a line here. A mark of a new colour needs a
//! class in `theme.rs` and `report.css` besides.
//!
//! Fill a [`Report`], call [`Report::to_html`], write the string to a file. The file refers to
//! nothing outside itself (a content security policy in its head forbids it), so it opens from
//! disk, by mail and in ten years. Plots are SVG whose colours come from the style sheet, so that
//! dark mode and print follow; only the 3D viewers are scripts. The same data gives the same bytes.

mod axis;
mod chosen;
mod error;
mod figure;
pub mod finished_runs;
mod format;
mod overlay;
mod packed;
mod page;
mod picture;
mod plates;
mod plot;
mod response;
mod ruler;
mod runs;
mod scene;
mod sections;
mod series;
mod shares;
mod sheet;
mod strips;
mod survey;
mod tables;
mod text_table;
mod theme;

pub use chosen::{ChosenLane, ChosenRange};
pub use error::ReportError;
pub use figure::{Figure, write_figures};
pub use format::{fixed, grouped, significant};
pub use overlay::Overlay;
pub use picture::picture_png;
pub use plates::{Panel, PanelDrawing, Plate};
pub use response::ResponsePage;
pub use runs::{DifferingTable, RunsPage};
pub use scene::{ScenePage, ShownPair};
pub use sections::*;
pub use series::Series;
pub use shares::{ShareCurve, Shares};
pub use strips::{StripRow, Strips};
pub use survey::{STILL_PX, SceneReport};
pub use tables::{FigureCell, FigureRow, FigureTable, TablesPage};
pub use text_table::{aligned, pair_errors_csv};

#[cfg(test)]
mod tests {
    use super::*;
    use echoloop_closed_loop::evaluation::objective::PairError;

    #[test]
    fn an_empty_report_is_still_a_page() {
        let html = Report::default().to_html().expect("nothing to contradict");
        assert!(html.starts_with("<!doctype html>") && html.ends_with("</html>\n"));
        assert!(!html.contains("NaN") && !html.contains("inf<"));
    }

    #[test]
    fn series_of_unequal_length_are_refused_by_name() {
        let report = Report {
            convergence: Convergence {
                generation: vec![0, 1],
                best: vec![1.0],
                ..Convergence::default()
            },
            ..Report::default()
        };
        let error = report.to_html().expect_err("one value for two generations");
        assert_eq!(
            error.to_string(),
            "best fitness holds 1 values, not one for each of 2 generations"
        );
    }

    #[test]
    fn text_is_escaped_in_every_section() {
        let evil = "<script>\"&'".to_owned();
        let trace =
            ParameterTrace { name: evil.clone(), unit: evil.clone(), ..ParameterTrace::default() };
        let error = PairError {
            pair: 0,
            translation_m: f64::NAN,
            rotation_deg: f64::NAN,
            frobenius: f64::NAN,
            points: [0; 2],
            stop: evil.clone(),
            iterations: 0,
        };
        let pair = PairErrors { label: evil.clone(), default: error.clone(), tuned: error };
        let report = Report {
            title: evil.clone(),
            subtitle: evil.clone(),
            facts: vec![(evil.clone(), evil.clone())],
            parameters: vec![trace],
            pair_errors: vec![pair],
            notes: vec![evil.clone()],
            correlation: Some(Correlation {
                names: vec![evil.clone()],
                matrix: vec![vec![1.0]],
                covariance_learned: None,
            }),
            ..Report::default()
        };
        let html = report.to_html().expect("consistent");
        assert!(!html.contains(&evil));
        assert!(html.contains("&lt;script&gt;&quot;&amp;&#39;"));
    }
}
