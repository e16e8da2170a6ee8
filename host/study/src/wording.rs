//! Wording and number formats of the table, the same in text and page.

use super::axes::name_of;
use super::cell::Cell;
use super::paired::Paired;
use super::paper::PaperFigures;
use super::table::{Row, Table, Verdict};
use echoloop_closed_loop::config::preset::{Preset, Protocol, Strategy};
use echoloop_closed_loop::evaluation::gain::{Estimate, Figures};

/// A figure of the table: how it is read, and its unit and scale in the table.
pub struct Figure {
    /// Head of its column.
    pub title: &'static str,
    /// Name in files.
    pub key: &'static str,
    unit: &'static str,
    scale: f64,
    decimals: usize,
    read: fn(&Figures<Estimate>) -> Estimate,
    paper: fn(&PaperFigures) -> f64,
}

/// The figures, in the table's order.
pub const FIGURES: [Figure; 3] = [
    Figure {
        title: "Recall",
        key: "recall_pct",
        unit: " %",
        scale: 1.0,
        decimals: 1,
        read: |figures| figures.recall_pct,
        paper: |paper| paper.recall_pct,
    },
    Figure {
        title: "RTE",
        key: "rte_cm",
        unit: " cm",
        scale: 100.0,
        decimals: 2,
        read: |figures| figures.mean_translation_m,
        paper: |paper| paper.translation_cm,
    },
    Figure {
        title: "RRE",
        key: "rre_deg",
        unit: "°",
        scale: 1.0,
        decimals: 3,
        read: |figures| figures.mean_rotation_deg,
        paper: |paper| paper.rotation_deg,
    },
];

impl Figure {
    /// Our value and the ends of its interval, in the table's unit.
    pub fn numbers(&self, figures: &Figures<Estimate>) -> [f64; 3] {
        let Estimate { value, interval: [low, high] } = (self.read)(figures);
        [value, low, high].map(|number| self.scale * number)
    }

    /// Our value with its unit; a dash where there is none, as for means without a success.
    pub fn value(&self, figures: &Figures<Estimate>) -> String {
        let [value, ..] = self.numbers(figures);
        let digits = self.decimals;
        if value.is_finite() { format!("{value:.digits$}{}", self.unit) } else { "–".into() }
    }

    /// The interval, as `1.20 to 1.44`; empty where there is none.
    pub fn within(&self, figures: &Figures<Estimate>) -> String {
        let [_, low, high] = self.numbers(figures);
        let digits = self.decimals;
        match low.is_finite() && high.is_finite() {
            true => format!("{low:.digits$} to {high:.digits$}"),
            false => String::new(),
        }
    }

    /// A number in the table's unit, without the unit.
    pub fn digits(&self, number: f64) -> String {
        let digits = self.decimals;
        format!("{number:.digits$}")
    }

    /// The paper's value.
    pub fn paper(&self, paper: &PaperFigures) -> f64 {
        (self.paper)(paper)
    }

    /// The paper's value with its unit and digits.
    pub fn theirs(&self, paper: &PaperFigures) -> String {
        format!("{}{}", self.paper(paper), self.unit)
    }
}

/// Heading of a search's rows.
pub fn search(ranges: Preset, strategy: Option<Strategy>) -> String {
    let of = match ranges {
        Preset::Outdoor => "ranges for outdoors",
        Preset::Paper => "the paper's ranges",
    };
    let by = match strategy {
        Some(Strategy::Fast) => ", searched our way (fast)",
        Some(Strategy::Paper) => ", searched the paper's way",
        None => "",
    };
    format!("{of}{by}")
}

/// Text in place of the figures of a cell without any.
pub fn absent(row: &Row) -> &'static str {
    if row.error.is_some() { "failed" } else { "not run" }
}

/// Finished cells, pairs and seed.
pub fn subtitle(table: &Table) -> String {
    let all = table.rows.len();
    let done = table.rows.iter().filter(|row| row.figures.is_some()).count();
    let pairs = table.rows.iter().find_map(|row| row.made.as_ref()).map(|made| made.pairs);
    let pairs = pairs.map_or_else(String::new, |pairs| format!(", {pairs} held-out pairs each"));
    format!("{done} of {all} cells done{pairs}, seed {}", table.plan.seed)
}

/// Remarks needed to read the table.
pub fn remarks(table: &Table) -> Vec<String> {
    let mut remarks = Vec::new();
    if table.plan.quick {
        remarks.push(
            "This is the small table of --quick: few pairs, few generations. It shows the shape of \
             the whole one and proves nothing."
                .to_owned(),
        );
    }
    remarks.push(
        "Recall is the share of held-out pairs within 0.5 m and 2.5° (ICP) or 1 m and 5° (FGR, \
         MAC). RTE and RRE are means over the pairs found alone, so where recall differs they are \
         means over different pairs."
            .to_owned(),
    );
    remarks.push(
        "Intervals are 95 %: Wilson's for recall, a bootstrap over pairs for the means. They do \
         not cover differences between seeds."
            .to_owned(),
    );
    remarks.push(
        "Both FGR rows stand beside the paper's one: FGR (Open3D) runs as Open3D's Python defaults \
         do, which the paper most likely measured; FGR (published) anneals as its authors say."
            .to_owned(),
    );
    remarks.extend(verdicts(table));
    remarks.extend(paired(table));
    if !table.real.is_empty() {
        remarks.push(
            "Real clouds are registered from the identity. Their true motions were used only to \
             measure the errors, not to choose the settings."
                .to_owned(),
        );
    }
    remarks
}

/// A sentence for each search. `sentence` gets its heading and a predicate for its cells.
fn of_searches(
    table: &Table,
    sentence: impl Fn(&str, &dyn Fn(&Cell) -> bool) -> Option<String>,
) -> Vec<String> {
    let of = |(ranges, strategy): (Preset, Option<Strategy>)| {
        let is_of =
            |cell: &Cell| (cell.ranges, cell.strategy, cell.ablation) == (ranges, strategy, None);
        sentence(&search(ranges, strategy), &is_of)
    };
    table.searches().into_iter().filter_map(of).collect()
}

/// Joint tuning against registration alone, on pairs that both find.
fn paired(table: &Table) -> Vec<String> {
    of_searches(table, |search, is_of| {
        let is_it = |paired: &&Paired| {
            is_of(&paired.cell) && paired.other.protocol == Protocol::Registration
        };
        let each: Vec<String> = table.paired.iter().filter(is_it).filter_map(ratio_text).collect();
        (!each.is_empty()).then(|| {
            format!(
                "On the pairs that both find, with {search}, the ratio of RTE with both tuned to \
                 RTE with registration alone (geometric mean) is: {}.",
                each.join("; ")
            )
        })
    })
}

fn ratio_text(paired: &Paired) -> Option<String> {
    let Estimate { value, interval: [low, high] } = paired.translation_ratio?;
    let (method, scene) = (paired.cell.method.title(), name_of(paired.cell.scene));
    Some(format!(
        "{method} {scene} {value:.2} ({low:.2} to {high:.2}; {} found by both, {} gained, {} lost)",
        paired.both, paired.gained, paired.lost
    ))
}

/// Sentences that count the cells where joint tuning is best or its interval holds the best.
fn verdicts(table: &Table) -> Vec<String> {
    of_searches(table, |search, is_of| {
        let is_known = |verdict: &&Verdict| is_of(&verdict.cell) && verdict.holds().is_some();
        let known: Vec<&Verdict> = table.joint.iter().filter(is_known).collect();
        let best = known.iter().filter(|verdict| verdict.holds() == Some(true)).count();
        let not: Vec<String> = known.iter().filter_map(|verdict| lost(verdict)).collect();
        let behind = match not.is_empty() {
            true => String::new(),
            false => format!(" It is not in {}.", not.join("; ")),
        };
        (!known.is_empty()).then(|| {
            format!(
                "With {search}, tuning both together is best, or the best lies within its \
                 interval, in {best} of {} cells.{behind}",
                known.len()
            )
        })
    })
}

/// Cell where joint tuning is behind, with the figures concerned.
fn lost(verdict: &Verdict) -> Option<String> {
    let named =
        [("recall", verdict.recall), ("RTE", verdict.translation), ("RRE", verdict.rotation)];
    let behind: Vec<&str> =
        named.iter().filter(|(_, holds)| *holds == Some(false)).map(|(name, _)| *name).collect();
    let cell = &verdict.cell;
    (!behind.is_empty())
        .then(|| format!("{} {} ({})", cell.method.title(), name_of(cell.scene), behind.join(", ")))
}
