//! The five figures of a set of parameters: their names, units and digits in every table.

use echoloop_closed_loop::evaluation::gain::{Difference, Estimate, Figures};

use super::format::{NONE, fixed, signed, with_unit};

/// A figure as a column.
#[derive(Debug)]
pub(crate) struct Column {
    /// Index among the figures [`in_order`].
    pub(crate) index: usize,
    /// Name in files.
    pub(crate) key: &'static str,
    /// Name in text.
    pub(crate) symbol: &'static str,
    pub(crate) head: &'static str,
    /// Pairs that the figure is taken over.
    pub(crate) over: &'static str,
    unit: &'static str,
    difference_unit: &'static str,
    /// Units of the column in one of the figure's.
    scale: f64,
    decimals: usize,
    more_is_better: bool,
}

/// The figures in the order of the columns.
pub(crate) fn in_order<T: Copy>(figures: &Figures<T>) -> [T; 5] {
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
    key: "recall_pct",
    symbol: "recall",
    head: "Recall",
    over: "pairs that succeed",
    unit: "%",
    difference_unit: "points",
    scale: 1.0,
    decimals: 1,
    more_is_better: true,
};
const TRANSLATION: Column = Column {
    index: 1,
    key: "mean_translation_m",
    symbol: "mean e_t",
    head: "Mean translation error",
    over: "over successes",
    unit: "cm",
    difference_unit: "cm",
    scale: 100.0,
    decimals: 2,
    more_is_better: false,
};
const ROTATION: Column = Column {
    index: 2,
    key: "mean_rotation_deg",
    symbol: "mean e_R",
    head: "Mean rotation error",
    unit: "°",
    difference_unit: "°",
    scale: 1.0,
    decimals: 3,
    ..TRANSLATION
};
pub(crate) static COLUMNS: [Column; 5] = [
    RECALL,
    TRANSLATION,
    ROTATION,
    Column {
        index: 3,
        key: "median_translation_m",
        symbol: "median e_t",
        head: "Median translation error",
        over: "over all pairs",
        ..TRANSLATION
    },
    Column {
        index: 4,
        key: "median_rotation_deg",
        symbol: "median e_R",
        head: "Median rotation error",
        over: "over all pairs",
        ..ROTATION
    },
];

/// Direction of a difference, if it is significant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    Better,
    Worse,
    NotShown,
    /// No difference, since a figure is missing.
    Unknown,
}

impl Verdict {
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Better => "better",
            Self::Worse => "worse",
            Self::NotShown | Self::Unknown => "no difference shown",
        }
    }
}

impl Column {
    pub(crate) fn verdict(&self, difference: &Difference) -> Verdict {
        match difference.estimate.value {
            d if !d.is_finite() => Verdict::Unknown,
            _ if !difference.is_shown => Verdict::NotShown,
            d if (d > 0.0) == self.more_is_better => Verdict::Better,
            _ => Verdict::Worse,
        }
    }

    /// `0.30 cm`, for a page.
    pub(crate) fn value(&self, figures: &Figures<Estimate>) -> String {
        let value = self.scale * in_order(figures)[self.index].value;
        with_unit(&fixed(value, self.decimals), self.unit)
    }

    /// Ends of the interval without a unit, for a page; `None` where there is none.
    pub(crate) fn interval(&self, figures: &Figures<Estimate>) -> Option<String> {
        let ends = in_order(figures)[self.index].interval;
        let [low, high] = ends.map(|end| fixed(self.scale * end, self.decimals));
        ends.iter().all(|end| end.is_finite()).then(|| format!("{low} to {high}"))
    }

    /// `−0.18 cm (−0.25 to −0.12)`, for a page.
    pub(crate) fn change(&self, difference: &Difference) -> String {
        let Estimate { value, interval } = difference.estimate;
        let number = |value: f64| signed(self.scale * value, self.decimals);
        let [low, high] = interval.map(number);
        let value = with_unit(&number(value), self.difference_unit);
        match interval.iter().all(|end| end.is_finite()) {
            true => format!("{value} ({low} to {high})"),
            false => value,
        }
    }

    /// `0.30 cm`, for text.
    pub(crate) fn number(&self, value: f64) -> String {
        self.plain(value, self.unit, &|value| format!("{value:.*}", self.decimals))
    }

    /// `0.30 cm (0.21 to 0.42)`, for text; with `sign` as a difference.
    pub(crate) fn text(&self, Estimate { value, interval }: Estimate, sign: bool) -> String {
        let digits = self.decimals;
        let (unit, number): (_, &dyn Fn(f64) -> String) = match sign {
            true => (self.difference_unit, &|value| format!("{value:+.digits$}")),
            false => (self.unit, &|value| format!("{value:.digits$}")),
        };
        if !value.is_finite() {
            return NONE.to_owned();
        }
        let [low, high] = interval.map(|end| number(self.scale * end));
        format!("{} ({low} to {high})", self.plain(value, unit, number))
    }

    fn plain(&self, value: f64, unit: &str, number: &dyn Fn(f64) -> String) -> String {
        let gap = if unit == "°" { "" } else { " " };
        match value.is_finite() {
            true => format!("{}{gap}{unit}", number(self.scale * value)),
            false => NONE.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_figure_has_its_unit_and_its_interval_and_a_difference_its_sign() {
        let estimate = Estimate { value: 0.003, interval: [0.002, 0.0042] };
        assert_eq!(COLUMNS[1].text(estimate, false), "0.30 cm (0.20 to 0.42)");
        let fewer = Estimate { value: -2.5, interval: [-7.5, 0.0] };
        assert_eq!(COLUMNS[0].text(fewer, true), "-2.5 points (-7.5 to +0.0)");
        let none = Estimate { value: f64::NAN, interval: [f64::NAN; 2] };
        assert_eq!(COLUMNS[2].text(none, false), "–");
    }

    #[test]
    fn a_verdict_depends_on_the_column_s_direction_and_on_significance() {
        for (column, value, is_shown, verdict) in [
            (0, 5.0, true, Verdict::Better),
            (1, 5.0, true, Verdict::Worse),
            (2, -0.1, true, Verdict::Better),
            (1, 5.0, false, Verdict::NotShown),
            (2, f64::NAN, false, Verdict::Unknown),
        ] {
            let estimate = Estimate { value, interval: [value - 1.0, value + 1.0] };
            assert_eq!(COLUMNS[column].verdict(&Difference { estimate, is_shown }), verdict);
        }
    }
}
