//! The page of several runs side by side.

use super::compared::{Against, Compared, ComparedRun, Differing};
use crate::format::{NONE, escape};
use crate::page::{self, document, facts, header, notes, row};
use crate::sections::cost::{self, cells};
use crate::sections::evaluation;
use crate::{Costs, EvaluationRow, EvaluationTable, RowKind};

impl Compared {
    /// The page, complete.
    pub fn to_html(&self) -> String {
        let runs = &self.runs;
        let title = format!("Echoloop: {} runs compared", runs.len());
        let first = runs.first().map_or("", |run| run.run.as_str());
        let about: Vec<_> = runs.iter().map(|run| (run.run.clone(), fact(run))).collect();
        let remarks = notes(runs.iter().filter_map(|run| Some(escape(&remark(run, first)?))));
        let lead = "Tuned parameters on held-out pairs. Differences are from the first run, pair \
                    by pair where the pairs are the same.";
        let rows = runs.iter().map(evaluation_row).collect();
        let sections = [
            header(&title, &(facts(&about) + &remarks)),
            evaluation::table(
                "Side by side",
                lead,
                &EvaluationTable { rows, ..Default::default() },
            ),
            cost::section(&costs(runs)),
            self.differing("Settings that differ", &self.settings),
            self.differing("Tuned parameters that differ", &self.parameters),
        ];
        document(&title, &sections.concat(), "")
    }

    fn differing(&self, title: &str, values: &Differing) -> String {
        let table = match values.is_empty() {
            true => "<p class=\"lead\">None.</p>".to_owned(),
            false => {
                let names = self.runs.iter().map(|run| escape(&run.run));
                let cell = |value: &Option<String>| {
                    format!("<td>{}</td>", escape(value.as_deref().unwrap_or(NONE)))
                };
                let rows: String = values
                    .iter()
                    .map(|(name, values)| row(name, values.iter().map(cell)))
                    .collect();
                page::table("plain", title, ["name".to_owned()].into_iter().chain(names), &rows)
            }
        };
        format!("<section><h2>{title}</h2>{table}</section>\n")
    }
}

fn fact(run: &ComparedRun) -> String {
    format!(
        "{}, {}, {}, seed {}, {} registrations, {} held-out pairs",
        run.scene, run.method, run.protocol, run.seed, run.registrations, run.pairs
    )
}

fn remark(run: &ComparedRun, first: &str) -> Option<String> {
    match &run.against_first {
        Against::OtherPairs { other_pairs: why } => Some(format!(
            "{} and {first} have other held-out pairs, or count success otherwise ({why}), so no \
             differences are shown.",
            run.run
        )),
        Against::Itself | Against::Paired(_) => None,
    }
}

fn evaluation_row(run: &ComparedRun) -> EvaluationRow {
    let (kind, gain) = match &run.against_first {
        Against::Itself => (RowKind::Default, None),
        Against::Paired(gain) => (RowKind::Tuned, Some(**gain)),
        Against::OtherPairs { .. } => (RowKind::Reference, None),
    };
    let (label, pairs, figures) = (run.run.clone(), run.pairs, run.tuned);
    EvaluationRow { label, kind, pairs, figures, gain }
}

fn costs(runs: &[ComparedRun]) -> Costs {
    let row = |run: &ComparedRun| Some((run.run.clone(), cells(&run.cost?)));
    Costs {
        rows: runs.iter().filter_map(row).collect(),
        verdict: "Of the tuned parameters, in the mean over scans of the held-out pairs.".into(),
    }
}
