//! One run as one HTML file: what was tuned, what it gained, and two clouds to look at.
//!
//! Fill a [`Report`], call [`Report::to_html`], write the string down. Each section of the page is
//! a file here with a function `section`; a new one is data in `data`, such a file, and a line in
//! `page`.
//!
//! Plain data in, one string out. The file refers to nothing outside itself (a content security
//! policy in its head forbids it), so it opens from disk, by mail and in ten years. Plots are SVG
//! whose colours come from the style sheet, so that dark mode and print follow; only the 3D viewers
//! are scripts. The same data gives the same bytes.

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
mod tables;
mod theme;

pub use chosen::{ChosenLane, ChosenRange};
pub use sections::clouds::MAX_LAYER_POINTS;
pub use sections::correlation::Moved;
pub use sections::{
    Bar, CloudLayer, Convergence, Correlation, Costs, Difference, EvaluationRow, EvaluationTable,
    Front, FrontDot, Identity, Importance, PairClouds, PairError, ParameterTrace, PoseError,
    Report, RowKind, Slice,
};
pub use error::ReportError;
pub use figure::Figure;
pub use format::{fixed, grouped, significant};
pub use overlay::Overlay;
pub use picture::picture_png;
pub use plates::{Panel, PanelDrawing, Plate};
pub use response::ResponsePage;
pub use runs::{DifferingTable, RunsPage};
pub use scene::{ScenePage, ShownPair};
pub use series::Series;
pub use shares::{ShareCurve, Shares};
pub use strips::{StripRow, Strips};
pub use tables::{FigureCell, FigureRow, FigureTable, TablesPage};

impl Report {
    /// The page, complete.
    ///
    /// Values that are not finite are shown as a dash, gaps or marks at the edge of the plot; empty
    /// parts are left out.
    ///
    /// # Errors
    ///
    /// [`ReportError::Length`] when series that belong together differ in length.
    pub fn to_html(&self) -> Result<String, ReportError> {
        self.check()?;
        Ok(page::page(self))
    }

    /// Every chart of the page, standing alone.
    ///
    /// # Errors
    ///
    /// As of [`Self::to_html`], and [`ReportError::Drawing`].
    pub fn figures(&self) -> Result<Vec<Figure>, ReportError> {
        figure::figures(&self.to_html()?).map_err(ReportError::Drawing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn text_is_escaped_wherever_it_stands() {
        let evil = "<script>\"&'".to_owned();
        let trace =
            ParameterTrace { name: evil.clone(), unit: evil.clone(), ..ParameterTrace::default() };
        let pair = PairError { label: evil.clone(), ..PairError::default() };
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
