//! Pages and figures: plain data in, one HTML file or picture out.
//!
//! To add a figure to the page of a run, touch two files: one in `sections`, whose `section` takes
//! what it draws from the [`Report`], and `sections/mod.rs`, where [`Report::to_html`] calls it.
//!
//! To add a kind of panel to the figures of the study: a file with its data, `KEYS` and `svg`, a
//! variant of [`PanelDrawing`] in `plates.rs`, and a line here. A mark of a new colour needs a
//! class in `theme.rs` and `report.css` besides.
//!
//! Read a [`Report`], call [`Report::to_html`], write the string to a file. The file refers to
//! nothing outside itself (a content security policy in its head forbids it), so it opens from
//! disk, by mail and in ten years. Plots are SVG whose colours come from the style sheet, so that
//! dark mode and print follow; only the 3D viewers are scripts. The same data gives the same bytes.

mod axis;
mod chosen;
mod columns;
mod figure;
pub mod finished_runs;
mod format;
mod overlay;
mod packed;
mod page;
mod panorama;
mod picture;
mod plates;
mod plot;
mod registered;
mod response;
mod ruler;
mod scene;
mod sections;
mod shares;
mod strips;
mod survey;
mod tables;
mod text_table;
mod theme;

pub use chosen::{ChosenLane, ChosenRange};
pub use figure::{Figure, write_figures};
pub use format::{fixed, grouped, significant};
pub use overlay::Overlay;
pub use picture::picture_png;
pub use plates::{Panel, PanelDrawing, Plate};
pub use registered::{RegisteredPage, ShownPair};
pub use response::ResponsePage;
pub use sections::*;
pub use shares::Shares;
pub use strips::{StripRow, Strips};
pub use survey::{STILL_PX, SceneReport};
pub use tables::{FigureCell, FigureRow, FigureTable, TablesPage};
pub use text_table::{aligned, named_pair_errors_csv, pair_errors_csv};

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::finished_runs::tests::{finished_run, result};
    use echoloop_closed_loop::parameters::{Scale, Values};
    use echoloop_closed_loop::run_folder::provenance::Session;
    use echoloop_closed_loop::run_folder::run::{AxisRecord, Background};

    /// A report of arbitrary errors, without a search.
    pub(crate) fn report(origin: &str) -> Report {
        Report {
            table: EvaluationTable::default(),
            run: finished_run(result(origin, Values::new())),
            background: Background::default(),
            generations: Vec::new(),
            importance: Importance::default(),
            clouds: Default::default(),
        }
    }

    #[test]
    fn a_run_without_a_search_is_still_a_page() {
        let html = report("start").to_html();
        assert!(html.starts_with("<!doctype html>") && html.ends_with("</html>\n"));
        assert!(!html.contains("NaN") && !html.contains("inf<"));
    }

    #[test]
    fn text_is_escaped_in_every_section() {
        let evil = "<script>\"&'".to_owned();
        let mut report = report(&evil);
        let axis = AxisRecord {
            name: evil.clone(),
            unit: evil.clone(),
            scale: Scale::Log,
            min: 1.0,
            max: 2.0,
        };
        report.background = Background {
            beams: evil.clone(),
            places: vec![evil.clone(); 8],
            correlated: vec![evil.clone(), evil.clone()],
            correlations: vec![vec![1.0, 0.5]; 2],
            axes: vec![axis],
            ..Background::default()
        };
        report.run.about.sessions =
            vec![Session { command: evil.clone(), begun: evil.clone(), ..Session::default() }];
        report.run.config_text = evil.clone();
        (report.run.result.scene, report.run.result.protocol) = (evil.clone(), evil.clone());
        report.importance.verdict = evil.clone();
        report.importance.chosen = vec![evil.clone(), evil.clone()];
        let html = report.to_html();
        assert!(!html.contains(&evil));
        assert!(html.matches("&lt;script&gt;&quot;&amp;&#39;").count() > 20);
        let commands = "<td><code>unknown</code></td><td><code>&lt;script&gt;";
        assert!(html.contains(commands), "{html}");
        assert!(html.contains("<summary>The whole configuration</summary>"));
    }
}
