//! The headline, its three figures and the table of default against tuned.

use plotters::element::{PathElement, Rectangle};
use plotters::style::Color;

use super::{Difference, EvaluationRow, EvaluationTable, Report, RowKind};
use crate::format::{escape, fixed, signed, significant, with_unit};
use crate::plot::{Caption, at, drawing};
use crate::theme::ink;

/// A column of figures: how to read it and which way is better.
struct Column {
    /// Where a row has its interval and its difference.
    index: usize,
    head: &'static str,
    /// As in a sentence.
    name: &'static str,
    over: &'static str,
    unit: &'static str,
    difference_unit: &'static str,
    decimals: usize,
    more_is_better: bool,
    read: fn(&EvaluationRow) -> f64,
}

const RECALL: Column = Column {
    index: 0,
    head: "Recall",
    name: "recall",
    over: "pairs that succeed",
    unit: "%",
    difference_unit: "points",
    decimals: 1,
    more_is_better: true,
    read: |row| row.recall_pct,
};
const TRANSLATION: Column = Column {
    index: 1,
    head: "Mean translation error",
    name: "mean translation error",
    over: "over successes",
    unit: "cm",
    difference_unit: "cm",
    decimals: 2,
    more_is_better: false,
    read: |row| row.mean_translation_cm,
};
const ROTATION: Column = Column {
    index: 2,
    head: "Mean rotation error",
    name: "mean rotation error",
    unit: "°",
    difference_unit: "°",
    decimals: 3,
    read: |row| row.mean_rotation_deg,
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
        read: |row| row.median_translation_cm,
        ..TRANSLATION
    },
    Column {
        index: 4,
        head: "Median rotation error",
        name: "median rotation error",
        over: "over all pairs",
        read: |row| row.median_rotation_deg,
        ..ROTATION
    },
];

/// What the headline names.
const NAMED: [&Column; 3] = [&COLUMNS[0], &COLUMNS[1], &COLUMNS[2]];

/// What a difference comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Better,
    Worse,
    /// Chance could have done it.
    NotShown,
    /// There is no difference to speak of: a figure is missing.
    Unknown,
}

impl Verdict {
    /// Its class, and what it says.
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
    fn value(&self, row: &EvaluationRow) -> String {
        with_unit(&fixed((self.read)(row), self.decimals), self.unit)
    }

    /// From and to of an interval, without a unit; nothing where there is none.
    fn interval(&self, row: &EvaluationRow) -> Option<String> {
        let ends = row.intervals[self.index];
        let [low, high] = ends.map(|end| fixed(end, self.decimals));
        ends.iter().all(|end| end.is_finite()).then(|| format!("{low} to {high}"))
    }

    fn verdict(&self, difference: &Difference) -> Verdict {
        match difference.value {
            d if !d.is_finite() => Verdict::Unknown,
            _ if !difference.is_shown => Verdict::NotShown,
            d if (d > 0.0) == self.more_is_better => Verdict::Better,
            _ => Verdict::Worse,
        }
    }

    /// `−0.18 cm (−0.25 to −0.12)`.
    fn change(&self, difference: &Difference) -> String {
        let [low, high] = difference.interval.map(|end| signed(end, self.decimals));
        let value = with_unit(&signed(difference.value, self.decimals), self.difference_unit);
        match difference.interval.iter().all(|end| end.is_finite()) {
            true => format!("{value} ({low} to {high})"),
            false => value,
        }
    }
}

/// What was tuned and what came of it: recall and both means, before and after, then what of that
/// is more than chance.
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

/// What got better, what got worse and what cannot be told, a sentence each.
fn verdict(tuned: &EvaluationRow) -> String {
    let Some(gain) = &tuned.gain else { return String::new() };
    let of = |asked: Verdict, text: &dyn Fn(&Column, &Difference) -> String| {
        let those = NAMED.iter().filter(|column| column.verdict(&gain[column.index]) == asked);
        those.map(|column| text(column, &gain[column.index])).collect::<Vec<_>>()
    };
    let with_change = |column: &Column, difference: &Difference| {
        format!("{} {}", column.name, column.change(difference))
    };
    let (better, worse) = (of(Verdict::Better, &with_change), of(Verdict::Worse, &with_change));
    let same = of(Verdict::NotShown, &|column, _| column.name.to_owned());
    let on = tuned.pairs.map_or(String::new(), |pairs| format!(" on {pairs} pairs"));
    let mut said = Vec::new();
    if better.is_empty() && worse.is_empty() {
        said.push("<strong>Nothing was proven.</strong>".to_owned());
    }
    if !worse.is_empty() {
        said.push(format!("<b class=\"worse\">Worse:</b> {}.", worse.join(", ")));
    }
    if !better.is_empty() {
        said.push(format!("<b class=\"better\">Better:</b> {}.", better.join(", ")));
    }
    if !same.is_empty() {
        said.push(format!("No difference in {} could be shown{on}.", listed(&same)));
    }
    format!(
        "<p class=\"verdict\">{} In parentheses: 95\u{a0}% intervals, of differences pair by \
         pair.</p>",
        said.join(" ")
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

/// Recall and both means, large, from default to tuned.
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

/// The table with differences to the default row, or nothing without rows.
pub(crate) fn section(table: &EvaluationTable) -> String {
    self::table("Default against tuned", &criterion(table), table)
}

/// The same under another heading.
pub(super) fn table(heading: &str, lead: &str, table: &EvaluationTable) -> String {
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
    let within = &table.success_within;
    let rule = match within.translation_m.is_finite() && within.rotation_deg.is_finite() {
        true => format!(
            "A pair succeeds when its pose is within {} and {} of the truth. ",
            with_unit(&significant(within.translation_m), "m"),
            with_unit(&significant(within.rotation_deg), "°")
        ),
        false => String::new(),
    };
    format!(
        "{rule}Means count successes only, so they can grow when harder pairs begin to succeed; \
         medians count every pair. Intervals are of 95\u{a0}% for this number of pairs: Wilson’s \
         of recall, which the bar shows, a bootstrap over pairs of the others and of all \
         differences. \
         A difference counts as shown when its interval leaves zero out, and of recall when \
         McNemar’s exact test agrees."
    )
}

/// The columns' names stand in each cell too: on a narrow page a row is a card.
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
    let Some(difference) = row.gain.as_ref().map(|gain| &gain[column.index]) else {
        return String::new();
    };
    let [class, verdict] = column.verdict(difference).words();
    if class.is_empty() {
        return String::new();
    }
    format!("<span class=\"change {class}\">{} <i>{verdict}</i></span>", column.change(difference))
}

fn recall_bar(row: &EvaluationRow) -> String {
    if !row.recall_pct.is_finite() {
        return String::new();
    }
    let recall = (row.recall_pct / 100.0).clamp(0.0, 1.0);
    let interval = row.intervals[RECALL.index].map(|end| end / 100.0);
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
        Difference { value, interval, is_shown }
    }

    #[test]
    fn a_verdict_knows_which_way_is_better_and_believes_no_chance() {
        let verdict = |column: usize, value, is_shown| {
            COLUMNS[column].verdict(&gain(value, [value - 1.0, value + 1.0], is_shown))
        };
        assert_eq!(verdict(0, 5.0, true), Verdict::Better);
        assert_eq!(verdict(1, 5.0, true), Verdict::Worse);
        assert_eq!(verdict(2, -0.1, true), Verdict::Better);
        assert_eq!(verdict(1, 5.0, false), Verdict::NotShown);
        assert_eq!(verdict(2, f64::NAN, false), Verdict::Unknown);
    }

    fn report(gain: [Difference; 5]) -> Report {
        let row =
            |kind, [recall_pct, mean_translation_cm, mean_rotation_deg]: [f64; 3]| EvaluationRow {
                kind,
                pairs: Some(40),
                recall_pct,
                mean_translation_cm,
                mean_rotation_deg,
                intervals: [[90.0, 99.0], [0.2, 0.9], [0.01, 0.05], [0.0; 2], [0.0; 2]],
                ..EvaluationRow::default()
            };
        let tuned = row(RowKind::Tuned, [100.0, 0.7, 0.02]);
        let rows = vec![
            row(RowKind::Default, [97.5, 0.5, 0.03]),
            EvaluationRow { gain: Some(gain), ..tuned },
        ];
        let table = EvaluationTable { rows, ..EvaluationTable::default() };
        Report { table, ..Report::default() }
    }

    #[test]
    fn the_headline_names_recall_and_both_means_with_intervals_and_what_got_worse() {
        let shown = |value: f64| gain(value, [0.5 * value, 1.5 * value], true);
        let chance = gain(2.5, [0.0, 7.5], false);
        let html = headline(&report([chance, shown(0.2), shown(-0.01), chance, chance]));
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
    fn where_nothing_is_proven_the_headline_says_so() {
        let html = headline(&report([gain(2.5, [-1.0, 7.5], false); 5]));
        let said = "Nothing was proven.</strong> No difference in recall, mean translation error \
                    or mean rotation error could be shown on 40 pairs.";
        assert!(html.contains(said), "{html}");
    }
}
