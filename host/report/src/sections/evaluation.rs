//! Default against tuned on the held-out pairs: the headline, its three figures, and the table.

use echoloop_closed_loop::config::DataConfig;
use echoloop_closed_loop::evaluation::gain::{Difference, Estimate, Figures};
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::run_folder::run::RunResult;
use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;

use super::Report;
use crate::format::{escape, fixed, signed, significant, with_unit};
use crate::plot::{Caption, at, drawing};
use crate::theme::ink;

/// Figures of several sets of parameters on the same held-out pairs.
#[derive(Clone, Debug, Default)]
pub struct EvaluationTable {
    /// The first [`RowKind::Default`] row is the reference of differences; the first
    /// [`RowKind::Tuned`] row is the headline's.
    pub rows: Vec<EvaluationRow>,
    /// Bounds of a success.
    pub data: DataConfig,
}

/// Meaning of a row of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RowKind {
    /// The parameters before tuning.
    #[default]
    Default,
    /// The parameters after tuning, with differences from the default row.
    Tuned,
    /// Figures from elsewhere, such as the paper's, without differences.
    Reference,
}

/// One row of the [`EvaluationTable`].
#[derive(Clone, Debug, PartialEq)]
pub struct EvaluationRow {
    /// Name of the row, such as "tuned, joint".
    pub label: String,
    /// Meaning of the row.
    pub kind: RowKind,
    /// Number of held-out pairs, if known.
    pub pairs: Option<usize>,
    /// Figures with their 95 % intervals; NaN where unknown.
    pub figures: Figures<Estimate>,
    /// Differences from the default row on the same pairs, if known.
    pub gain: Option<Figures<Difference>>,
}

impl EvaluationTable {
    /// The summaries of a finished run.
    pub(super) fn of_run(result: &RunResult, data: &DataConfig) -> Self {
        let row = |(kind, label, summary): (RowKind, String, &Summary)| EvaluationRow {
            label,
            kind,
            pairs: Some(summary.pairs),
            figures: Figures::of(summary, data),
            gain: (kind == RowKind::Tuned)
                .then(|| Figures::between(&result.default_summary, summary, data)),
        };
        Self { rows: judged(result).map(row).collect(), data: *data }
    }

    fn first(&self, kind: RowKind) -> Option<&EvaluationRow> {
        self.rows.iter().find(|row| row.kind == kind)
    }

    /// The two rows of the headline: default and tuned.
    fn both(&self) -> Option<(&EvaluationRow, &EvaluationRow)> {
        self.first(RowKind::Default).zip(self.first(RowKind::Tuned))
    }
}

/// Rows of a run's tables, with name and summary: the plain method where the run used a variant of
/// it, the default parameters, the tuned ones.
pub fn judged(result: &RunResult) -> impl Iterator<Item = (RowKind, String, &Summary)> {
    let plain = result.plain_summary.as_ref();
    let plain = plain.map(|plain| (RowKind::Reference, format!("plain {}", result.method), plain));
    plain.into_iter().chain([
        (RowKind::Default, "default".to_owned(), &result.default_summary),
        (RowKind::Tuned, "tuned".to_owned(), &result.tuned_summary),
    ])
}

/// A column of the table.
struct Column {
    /// Index among the figures [`in_order`].
    index: usize,
    head: &'static str,
    /// Name within a sentence.
    name: &'static str,
    /// Pairs that the figure is taken over.
    over: &'static str,
    unit: &'static str,
    difference_unit: &'static str,
    /// Units of the column in one of the figure's.
    scale: f64,
    decimals: usize,
    more_is_better: bool,
}

/// The figures in the order of the columns.
fn in_order<T: Copy>(figures: &Figures<T>) -> [T; 5] {
    [
        figures.recall_pct,
        figures.mean_translation_m,
        figures.mean_rotation_deg,
        figures.median_translation_m,
        figures.median_rotation_deg,
    ]
}

const RECALL: Column = Column {
    index: 0,
    head: "Recall",
    name: "recall",
    over: "pairs that succeed",
    unit: "%",
    difference_unit: "points",
    scale: 1.0,
    decimals: 1,
    more_is_better: true,
};
const TRANSLATION: Column = Column {
    index: 1,
    head: "Mean translation error",
    name: "mean translation error",
    over: "over successes",
    unit: "cm",
    difference_unit: "cm",
    scale: 100.0,
    decimals: 2,
    more_is_better: false,
};
const ROTATION: Column = Column {
    index: 2,
    head: "Mean rotation error",
    name: "mean rotation error",
    unit: "°",
    difference_unit: "°",
    scale: 1.0,
    decimals: 3,
    ..TRANSLATION
};
const COLUMNS: [Column; 5] = [
    RECALL,
    TRANSLATION,
    ROTATION,
    Column {
        index: 3,
        head: "Median translation error",
        name: "median translation error",
        over: "over all pairs",
        ..TRANSLATION
    },
    Column {
        index: 4,
        head: "Median rotation error",
        name: "median rotation error",
        over: "over all pairs",
        ..ROTATION
    },
];

/// Columns of the headline: recall and both means.
const NAMED: [&Column; 3] = [&COLUMNS[0], &COLUMNS[1], &COLUMNS[2]];

/// Direction of a difference, if it is significant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Better,
    Worse,
    /// Not significant.
    NotShown,
    /// No difference, since a figure is missing.
    Unknown,
}

impl Verdict {
    /// Class of the style sheet, and text.
    fn words(self) -> [&'static str; 2] {
        match self {
            Self::Better => ["better", "better"],
            Self::Worse => ["worse", "worse"],
            Self::NotShown => ["not-shown", "no difference shown"],
            Self::Unknown => ["", ""],
        }
    }
}

impl Column {
    fn estimate(&self, row: &EvaluationRow) -> Estimate {
        let Estimate { value, interval } = in_order(&row.figures)[self.index];
        Estimate { value: self.scale * value, interval: interval.map(|end| self.scale * end) }
    }

    fn value(&self, row: &EvaluationRow) -> String {
        with_unit(&fixed(self.estimate(row).value, self.decimals), self.unit)
    }

    /// Ends of the interval without a unit; `None` where there is none.
    fn interval(&self, row: &EvaluationRow) -> Option<String> {
        let ends = self.estimate(row).interval;
        let [low, high] = ends.map(|end| fixed(end, self.decimals));
        ends.iter().all(|end| end.is_finite()).then(|| format!("{low} to {high}"))
    }

    /// Difference from the default row, if it is known.
    fn gain(&self, row: &EvaluationRow) -> Option<Difference> {
        row.gain.as_ref().map(|gain| in_order(gain)[self.index])
    }

    fn verdict(&self, difference: &Difference) -> Verdict {
        match difference.estimate.value {
            d if !d.is_finite() => Verdict::Unknown,
            _ if !difference.is_shown => Verdict::NotShown,
            d if (d > 0.0) == self.more_is_better => Verdict::Better,
            _ => Verdict::Worse,
        }
    }

    /// `−0.18 cm (−0.25 to −0.12)`.
    fn change(&self, difference: &Difference) -> String {
        let Estimate { value, interval } = difference.estimate;
        let number = |value: f64| signed(self.scale * value, self.decimals);
        let [low, high] = interval.map(number);
        let value = with_unit(&number(value), self.difference_unit);
        match interval.iter().all(|end| end.is_finite()) {
            true => format!("{value} ({low} to {high})"),
            false => value,
        }
    }
}

/// Recall and both means before and after tuning, then the significant differences.
pub(super) fn headline(report: &Report) -> String {
    let parameters = match report.parameters.len() {
        0 => "Tuning".to_owned(),
        1 => "Tuning one parameter".to_owned(),
        count => format!("Tuning {count} parameters"),
    };
    let generations = match report.convergence.generation.len() {
        0 => String::new(),
        count => format!(" over {count} generations"),
    };
    let table = &report.table;
    let Some((default, tuned)) = table.both() else {
        return format!(
            "<p class=\"headline\">{parameters}{generations}: not yet evaluated against the \
             defaults.</p>"
        );
    };
    let moves: Vec<String> = NAMED.iter().map(|column| moved(column, default, tuned)).collect();
    format!(
        "<p class=\"headline\">{parameters}{generations}: {}{}.</p>{}",
        moves.join(", "),
        on_pairs(tuned),
        verdict(tuned)
    )
}

/// `recall 87.5 % (73.9 to 94.5) → 100.0 % (91.2 to 100.0)`.
fn moved(column: &Column, default: &EvaluationRow, tuned: &EvaluationRow) -> String {
    let within = |row| {
        let interval = column.interval(row);
        interval.map_or_else(String::new, |interval| format!(" <small>({interval})</small>"))
    };
    format!(
        "{} {}{} → <em>{}</em>{}",
        column.name,
        column.value(default),
        within(default),
        column.value(tuned),
        within(tuned)
    )
}

fn on_pairs(row: &EvaluationRow) -> String {
    row.pairs.map_or(String::new(), |pairs| format!(", on {pairs} held-out pairs"))
}

/// Differences that are better, worse and not significant, a sentence each.
fn verdict(tuned: &EvaluationRow) -> String {
    if tuned.gain.is_none() {
        return String::new();
    }
    let those = |verdict: Verdict, text: &dyn Fn(&Column, &Difference) -> String| {
        let known = NAMED.iter().filter_map(|column| Some((column, column.gain(tuned)?)));
        let those = known.filter(|(column, gain)| column.verdict(gain) == verdict);
        those.map(|(column, gain)| text(column, &gain)).collect::<Vec<_>>()
    };
    let with_change = |column: &Column, difference: &Difference| {
        format!("{} {}", column.name, column.change(difference))
    };
    let better = those(Verdict::Better, &with_change);
    let worse = those(Verdict::Worse, &with_change);
    let same = those(Verdict::NotShown, &|column, _| column.name.to_owned());
    let on = tuned.pairs.map_or(String::new(), |pairs| format!(" on {pairs} pairs"));
    let mut sentences = Vec::new();
    if better.is_empty() && worse.is_empty() {
        sentences.push("<strong>Nothing was proven.</strong>".to_owned());
    }
    if !worse.is_empty() {
        sentences.push(format!("<b class=\"worse\">Worse:</b> {}.", worse.join(", ")));
    }
    if !better.is_empty() {
        sentences.push(format!("<b class=\"better\">Better:</b> {}.", better.join(", ")));
    }
    if !same.is_empty() {
        sentences.push(format!("No difference in {} could be shown{on}.", listed(&same)));
    }
    format!(
        "<p class=\"verdict\">{} In parentheses: 95\u{a0}% intervals, of differences pair by \
         pair.</p>",
        sentences.join(" ")
    )
}

/// `a`, `a or b`, `a, b or c`.
fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// Tiles of recall and both means, from default to tuned.
pub(super) fn tiles(table: &EvaluationTable) -> String {
    let Some((default, tuned)) = table.both() else {
        return String::new();
    };
    let tiles: String = NAMED
        .iter()
        .map(|column| {
            format!(
                "<div class=\"tile\"><p class=\"what\">{}, {}</p><p class=\"big\"><s>{}</s> \
                 <b>{}</b></p>{}</div>",
                column.head,
                column.over,
                column.value(default),
                column.value(tuned),
                difference(column, tuned)
            )
        })
        .collect();
    format!("<div class=\"tiles\">{tiles}</div>\n")
}

/// The table with differences from the default row; empty without rows.
pub(super) fn section(table: &EvaluationTable) -> String {
    self::table("Default against tuned", &criterion(table), table)
}

/// The table under a heading and a lead, which is HTML; empty without rows.
pub(crate) fn table(heading: &str, lead: &str, table: &EvaluationTable) -> String {
    if table.rows.is_empty() {
        return String::new();
    }
    let heads: String = COLUMNS
        .iter()
        .map(|c| format!("<th scope=\"col\">{}<small>{}</small></th>", c.head, c.over))
        .collect();
    let rows: String = table.rows.iter().map(table_row).collect();
    format!(
        "<section id=\"evaluation\"><h2>{heading}</h2><p class=\"lead\">{lead}</p>\
         <div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"Evaluation\"><table \
         class=\"figures\">\
         <thead><tr><th \
         scope=\"col\">Parameters</th>{heads}</tr></thead><tbody>{rows}</tbody></table></div>\
         </section>\n"
    )
}

fn criterion(table: &EvaluationTable) -> String {
    let DataConfig { success_translation_m, success_rotation_deg, .. } = table.data;
    format!(
        "A pair succeeds when its pose is within {} and {} of the truth. \
         Means count successes only, so they can grow when harder pairs begin to succeed; \
         medians count every pair. Intervals are of 95\u{a0}% for this number of pairs: Wilson’s \
         of recall, which the bar shows, a bootstrap over pairs of the others and of all \
         differences. \
         A difference counts as shown when its interval leaves zero out, and of recall when \
         McNemar’s exact test agrees.",
        with_unit(&significant(success_translation_m), "m"),
        with_unit(&significant(success_rotation_deg), "°")
    )
}

/// A row whose cells repeat the names of their columns: on a narrow page a row becomes a card.
fn table_row(row: &EvaluationRow) -> String {
    let class = match row.kind {
        RowKind::Default => "row-default",
        RowKind::Tuned => "row-tuned",
        RowKind::Reference => "row-reference",
    };
    let cells: String = COLUMNS
        .iter()
        .map(|column| {
            let change = difference(column, row);
            let bar = if column.index == 0 { recall_bar(row) } else { String::new() };
            let within = column.interval(row).map_or_else(String::new, |interval| {
                format!("<span class=\"within\">{interval}</span>")
            });
            format!(
                "<td data-head=\"{}, {}\"><span class=\"value\">{}</span>{within}{bar}{change}\
                 </td>",
                column.head,
                column.over,
                column.value(row)
            )
        })
        .collect();
    let pairs = row.pairs.map_or(String::new(), |n| format!("<small>{n} pairs</small>"));
    format!(
        "<tr class=\"{class}\"><th scope=\"row\">{}{pairs}</th>{cells}</tr>",
        escape(&row.label)
    )
}

fn difference(column: &Column, row: &EvaluationRow) -> String {
    let Some(difference) = column.gain(row) else { return String::new() };
    let [class, verdict] = column.verdict(&difference).words();
    if class.is_empty() {
        return String::new();
    }
    let change = column.change(&difference);
    format!("<span class=\"change {class}\">{change} <i>{verdict}</i></span>")
}

/// A bar of the recall with its interval as a whisker.
fn recall_bar(row: &EvaluationRow) -> String {
    let Estimate { value, interval } = row.figures.recall_pct;
    if !value.is_finite() {
        return String::new();
    }
    let recall = (value / 100.0).clamp(0.0, 1.0);
    let interval = interval.map(|end| end / 100.0);
    let interval = interval.iter().all(|end| end.is_finite()).then_some(interval);
    let across = |share: f64| 2.0 + 100.0 * share;
    drawing(&Caption::default(), [104.0, 12.0], &bar_label(interval), |canvas, _| {
        let bar = |class, share| {
            Rectangle::new([at([2.0, 3.0]), at([across(share), 9.0])], ink(class).filled())
        };
        canvas.draw(&bar("bar-back", 1.0))?;
        canvas.draw(&bar("bar", recall))?;
        let Some(ends) = interval else { return Ok(()) };
        let [left, right] = ends.map(across);
        for ends in
            [[[left, 6.0], [right, 6.0]], [[left, 3.5], [left, 8.5]], [[right, 3.5], [right, 8.5]]]
        {
            canvas.draw(&PathElement::new(ends.map(at), ink("whisker")))?;
        }
        Ok(())
    })
}

fn bar_label(interval: Option<[f64; 2]>) -> String {
    interval.map_or("recall".to_owned(), |[low, high]| {
        format!("95 % interval {} to {} %", fixed(low * 100.0, 0), fixed(high * 100.0, 0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain(value: f64, interval: [f64; 2], is_shown: bool) -> Difference {
        Difference { estimate: Estimate { value, interval }, is_shown }
    }

    #[test]
    fn a_verdict_depends_on_the_column_s_direction_and_on_significance() {
        let verdict = |column: usize, value, is_shown| {
            COLUMNS[column].verdict(&gain(value, [value - 1.0, value + 1.0], is_shown))
        };
        assert_eq!(verdict(0, 5.0, true), Verdict::Better);
        assert_eq!(verdict(1, 5.0, true), Verdict::Worse);
        assert_eq!(verdict(2, -0.1, true), Verdict::Better);
        assert_eq!(verdict(1, 5.0, false), Verdict::NotShown);
        assert_eq!(verdict(2, f64::NAN, false), Verdict::Unknown);
    }

    fn figures<T>(of: [T; 5]) -> Figures<T> {
        let [recall_pct, mean_translation_m, mean_rotation_deg, median_translation_m, last] = of;
        let median_rotation_deg = last;
        Figures {
            recall_pct,
            mean_translation_m,
            mean_rotation_deg,
            median_translation_m,
            median_rotation_deg,
        }
    }

    fn report(gain: [Difference; 5]) -> Report {
        let row = |kind, means: [f64; 3]| {
            let intervals = [[90.0, 99.0], [0.002, 0.009], [0.01, 0.05]];
            let [recall, translation, rotation] =
                std::array::from_fn(|i| Estimate { value: means[i], interval: intervals[i] });
            let unknown = Estimate { value: f64::NAN, interval: [0.0; 2] };
            EvaluationRow {
                label: String::new(),
                kind,
                pairs: Some(40),
                figures: figures([recall, translation, rotation, unknown, unknown]),
                gain: None,
            }
        };
        let tuned = row(RowKind::Tuned, [100.0, 0.007, 0.02]);
        let rows = vec![
            row(RowKind::Default, [97.5, 0.005, 0.03]),
            EvaluationRow { gain: Some(figures(gain)), ..tuned },
        ];
        let table = EvaluationTable { rows, ..EvaluationTable::default() };
        Report { table, ..Report::default() }
    }

    #[test]
    fn the_headline_has_recall_and_both_means_with_intervals_and_the_worse_figures() {
        let shown = |value: f64| gain(value, [0.5 * value, 1.5 * value], true);
        let chance = gain(2.5, [0.0, 7.5], false);
        let html = headline(&report([chance, shown(0.002), shown(-0.01), chance, chance]));
        for part in [
            "recall 97.5\u{a0}% <small>(90.0 to 99.0)</small> → <em>100.0\u{a0}%</em>",
            "mean translation error 0.50\u{a0}cm",
            "mean rotation error 0.030° <small>(0.010 to 0.050)</small>",
            "on 40 held-out pairs.",
            "Worse:</b> mean translation error +0.20\u{a0}cm (+0.10 to +0.30).",
            "Better:</b> mean rotation error −0.010°",
            "No difference in recall could be shown on 40 pairs.",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
        assert!(!html.contains("Nothing was proven"));
    }

    #[test]
    fn a_headline_without_significant_differences_says_so() {
        let html = headline(&report([gain(2.5, [-1.0, 7.5], false); 5]));
        let expected = "Nothing was proven.</strong> No difference in recall, mean translation \
                        error or mean rotation error could be shown on 40 pairs.";
        assert!(html.contains(expected), "{html}");
    }
}
