//! Default against tuned on the held-out pairs: the headline, its three figures, and the table.

use echoloop_closed_loop::config::DataConfig;
use echoloop_closed_loop::evaluation::gain::{Difference, Estimate, Figures};
use echoloop_closed_loop::evaluation::summary::Summary;
use echoloop_closed_loop::run_folder::run::RunResult;

use crate::columns::{COLUMNS, Column, Verdict, in_order};
use crate::format::{escape, fixed, significant, with_unit};
use crate::page;
use crate::plot::{Caption, drawing};

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
    /// Number of held-out pairs.
    pub pairs: usize,
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
            pairs: summary.pairs,
            figures: Figures::of(summary, data),
            gain: (kind == RowKind::Tuned)
                .then(|| Figures::between(&result.default_summary, summary, data)),
        };
        Self { rows: judged(result).map(row).collect(), data: *data }
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

/// Columns of the headline: recall and both means.
fn headline_columns() -> std::slice::Iter<'static, Column> {
    COLUMNS[..3].iter()
}

impl EvaluationRow {
    /// Difference of a column from the default row, if it is known.
    fn gain(&self, column: &Column) -> Option<Difference> {
        self.gain.as_ref().map(|gain| in_order(gain)[column.index])
    }
}

/// Recall and both means before and after tuning, then the significant differences, then tiles;
/// empty without both rows.
pub(super) fn headline(table: &EvaluationTable, parameters: usize, generations: usize) -> String {
    let first = |kind| table.rows.iter().find(|row| row.kind == kind);
    let Some((default, tuned)) = first(RowKind::Default).zip(first(RowKind::Tuned)) else {
        return String::new();
    };
    let parameters = match parameters {
        0 => "Tuning".to_owned(),
        1 => "Tuning one parameter".to_owned(),
        count => format!("Tuning {count} parameters"),
    };
    let generations = match generations {
        0 => String::new(),
        count => format!(" over {count} generations"),
    };
    let changes: Vec<String> = headline_columns().map(|c| change_text(c, default, tuned)).collect();
    let tile = |column: &Column| {
        format!(
            "<div class=\"tile\"><p class=\"what\">{}, {}</p><p class=\"big\"><s>{}</s> \
             <b>{}</b></p>{}</div>",
            column.head,
            column.over,
            column.value(&default.figures),
            column.value(&tuned.figures),
            difference(column, tuned)
        )
    };
    format!(
        "<p class=\"headline\">{parameters}{generations}: {}, on {} held-out pairs.</p>{}\
         <div class=\"tiles\">{}</div>\n",
        changes.join(", "),
        tuned.pairs,
        verdict(tuned),
        headline_columns().map(tile).collect::<String>()
    )
}

/// `recall 87.5 % (73.9 to 94.5) → 100.0 % (91.2 to 100.0)`.
fn change_text(column: &Column, default: &EvaluationRow, tuned: &EvaluationRow) -> String {
    let [(was, before), (is, after)] = [default, tuned].map(|row| {
        let within = column.interval(&row.figures);
        let within = within.map_or_else(String::new, |ends| format!(" <small>({ends})</small>"));
        (column.value(&row.figures), within)
    });
    format!("{} {was}{before} → <em>{is}</em>{after}", column.head.to_lowercase())
}

/// Differences that are better, worse and not significant, a sentence each.
fn verdict(tuned: &EvaluationRow) -> String {
    if tuned.gain.is_none() {
        return String::new();
    }
    let names = |verdict: Verdict| {
        let of = move |column: &Column| {
            let gain = tuned.gain(column).filter(|gain| column.verdict(gain) == verdict)?;
            let name = column.head.to_lowercase();
            Some(match verdict {
                Verdict::NotShown => name,
                _ => format!("{name} {}", column.change(&gain)),
            })
        };
        headline_columns().filter_map(of).collect::<Vec<String>>()
    };
    let [better, worse, same] = [Verdict::Better, Verdict::Worse, Verdict::NotShown].map(names);
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
        let on = tuned.pairs;
        sentences.push(format!("No difference in {} could be shown on {on} pairs.", listed(&same)));
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

/// The table with differences from the default row; empty without rows.
pub(super) fn section(table: &EvaluationTable) -> String {
    self::table("Default against tuned", &criterion(table), table)
}

/// The table under a heading and a lead, which is HTML; empty without rows.
pub(crate) fn table(heading: &str, lead: &str, table: &EvaluationTable) -> String {
    if table.rows.is_empty() {
        return String::new();
    }
    let heads = COLUMNS.iter().map(|c| format!("{}<small>{}</small>", c.head, c.over));
    let rows: String = table.rows.iter().map(table_row).collect();
    format!(
        "<section id=\"evaluation\"><h2>{heading}</h2><p class=\"lead\">{lead}</p>{}</section>\n",
        page::table("figures", "Evaluation", ["Parameters".into()].into_iter().chain(heads), &rows)
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
    let cell = |column: &Column| {
        let change = difference(column, row);
        let bar = if column.index == 0 { recall_bar(row) } else { String::new() };
        let within = column.interval(&row.figures).map_or_else(String::new, |interval| {
            format!("<span class=\"within\">{interval}</span>")
        });
        format!(
            "<td data-head=\"{}, {}\"><span class=\"value\">{}</span>{within}{bar}{change}</td>",
            column.head,
            column.over,
            column.value(&row.figures)
        )
    };
    format!(
        "<tr class=\"{class}\"><th scope=\"row\">{}<small>{} pairs</small></th>{}</tr>",
        escape(&row.label),
        row.pairs,
        COLUMNS.iter().map(cell).collect::<String>()
    )
}

/// Difference of a row from the default one, with its verdict.
fn difference(column: &Column, row: &EvaluationRow) -> String {
    let Some(difference) = row.gain(column) else { return String::new() };
    let verdict = column.verdict(&difference);
    let class = match verdict {
        Verdict::Unknown => return String::new(),
        Verdict::NotShown => "not-shown",
        Verdict::Better | Verdict::Worse => verdict.words(),
    };
    let change = column.change(&difference);
    format!("<span class=\"change {class}\">{change} <i>{}</i></span>", verdict.words())
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
    drawing(&Caption::default(), [104.0, 12.0], &bar_label(interval), |canvas| {
        canvas.block("bar-back", [[2.0, 3.0], [across(1.0), 9.0]])?;
        canvas.block("bar", [[2.0, 3.0], [across(recall), 9.0]])?;
        interval.map_or(Ok(()), |ends| canvas.whisker("whisker", ends.map(across), 6.0, 2.5))
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

    fn table(gain: [Difference; 5]) -> EvaluationTable {
        let row = |kind, means: [f64; 3]| {
            let intervals = [[90.0, 99.0], [0.002, 0.009], [0.01, 0.05]];
            let [recall, translation, rotation] =
                std::array::from_fn(|i| Estimate { value: means[i], interval: intervals[i] });
            let unknown = Estimate { value: f64::NAN, interval: [0.0; 2] };
            EvaluationRow {
                label: String::new(),
                kind,
                pairs: 40,
                figures: figures([recall, translation, rotation, unknown, unknown]),
                gain: None,
            }
        };
        let tuned = row(RowKind::Tuned, [100.0, 0.007, 0.02]);
        let rows = vec![
            row(RowKind::Default, [97.5, 0.005, 0.03]),
            EvaluationRow { gain: Some(figures(gain)), ..tuned },
        ];
        EvaluationTable { rows, ..EvaluationTable::default() }
    }

    #[test]
    fn the_headline_has_recall_and_both_means_with_intervals_and_the_worse_figures() {
        let shown = |value: f64| gain(value, [0.5 * value, 1.5 * value], true);
        let chance = gain(2.5, [0.0, 7.5], false);
        let html = headline(&table([chance, shown(0.002), shown(-0.01), chance, chance]), 2, 3);
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
        let html = headline(&table([gain(2.5, [-1.0, 7.5], false); 5]), 2, 3);
        let expected = "Nothing was proven.</strong> No difference in recall, mean translation \
                        error or mean rotation error could be shown on 40 pairs.";
        assert!(html.contains(expected), "{html}");
    }
}
