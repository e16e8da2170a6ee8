//! Compared runs as text and as CSV.

use super::compared::{Against, Compared, ComparedRun};
use crate::text_table::{aligned, finished};
use echoloop_closed_loop::cost::CostKind;
use echoloop_closed_loop::evaluation::gain::{Difference, Estimate, Figures};

/// A figure of a table. `scale` converts it to the unit that is printed.
struct Column {
    name: &'static str,
    unit: &'static str,
    scale: f64,
    decimals: usize,
}

const COLUMNS: [Column; 5] = [
    Column { name: "recall", unit: " %", scale: 1.0, decimals: 1 },
    Column { name: "mean e_t", unit: " cm", scale: 100.0, decimals: 2 },
    Column { name: "mean e_R", unit: "°", scale: 1.0, decimals: 3 },
    Column { name: "median e_t", unit: " cm", scale: 100.0, decimals: 2 },
    Column { name: "median e_R", unit: "°", scale: 1.0, decimals: 3 },
];

impl Column {
    /// `0.30 cm (0.21 to 0.42)`; with `sign` as a difference.
    fn text(&self, Estimate { value, interval }: Estimate, sign: bool) -> String {
        let number = |value: f64| {
            let (value, digits) = (self.scale * value, self.decimals);
            if sign { format!("{value:+.digits$}") } else { format!("{value:.digits$}") }
        };
        if !value.is_finite() {
            return "–".to_owned();
        }
        let [low, high] = interval.map(number);
        let unit = if sign && self.unit == " %" { " points" } else { self.unit };
        format!("{}{unit} ({low} to {high})", number(value))
    }
}

/// All figures in the columns' order.
fn in_order<T: Copy>(figures: &Figures<T>) -> [T; 5] {
    [
        figures.recall_pct,
        figures.mean_translation_m,
        figures.mean_rotation_deg,
        figures.median_translation_m,
        figures.median_rotation_deg,
    ]
}

impl Compared {
    /// The table as text, then each run against the first, settings and parameters that differ.
    pub fn text(&self) -> String {
        text(self)
    }

    /// CSV, a line a run: figures with their intervals, differences from the first where they are
    /// paired, then settings and parameters that differ.
    ///
    /// # Errors
    ///
    /// [`csv::Error`].
    pub fn csv(&self) -> Result<String, csv::Error> {
        let mut lines = csv::Writer::from_writer(Vec::new());
        lines.write_record(csv_head(self))?;
        for (number, run) in self.runs.iter().enumerate() {
            lines.write_record(csv_line(self, number, run))?;
        }
        finished(lines)
    }
}

fn text(compared: &Compared) -> String {
    let name = |run: &ComparedRun| run.run.clone();
    let head = ["run".to_owned(), "pairs".to_owned()].into_iter();
    let head = head.chain(COLUMNS.map(|column| column.name.to_owned()));
    let mut rows: Vec<Vec<String>> = vec![head.chain(["energy".to_owned()]).collect()];
    rows.extend(compared.runs.iter().map(|run| {
        let figures = COLUMNS.iter().zip(in_order(&run.tuned));
        let figures = figures.map(|(column, estimate)| column.text(estimate, false));
        let energy = run.cost.map(|cost| CostKind::Energy.text(CostKind::Energy.of(&cost)));
        let begin = [name(run), run.pairs.to_string()].into_iter();
        begin.chain(figures).chain([energy.unwrap_or_else(|| "–".into())]).collect()
    }));
    let names: Vec<String> = compared.runs.iter().map(name).collect();
    let mut text = aligned(&rows) + "\nParentheses: 95 % intervals.\n";
    for run in &compared.runs {
        text += &against(run, &names[0]);
    }
    for (what, table) in [("settings", &compared.settings), ("parameters", &compared.parameters)] {
        if table.is_empty() {
            text += &format!("\nNo {what} differ.\n");
            continue;
        }
        let head = [format!("{what} that differ")].into_iter().chain(names.iter().cloned());
        let rows = table.iter().map(|(name, values)| {
            let values = values.iter().map(|value| value.clone().unwrap_or_else(|| "–".into()));
            [name.clone()].into_iter().chain(values).collect()
        });
        let rows: Vec<Vec<String>> = [head.collect()].into_iter().chain(rows).collect();
        text += &format!("\n{}", aligned(&rows));
    }
    text
}

/// Differences of a run from the first.
fn against(run: &ComparedRun, first: &str) -> String {
    match &run.against_first {
        Against::Itself => String::new(),
        Against::OtherPairs(why) => format!(
            "\n{} against {first}: no differences pair by pair, for pairs or what counts as \
             success are not the same ({why}).\n",
            run.run
        ),
        Against::Paired(differences) => {
            let each = COLUMNS.iter().zip(in_order(differences));
            let lines = each.map(|(column, Difference { estimate, is_shown })| {
                let verdict = match (is_shown, (estimate.value > 0.0) == (column.name == "recall"))
                {
                    (false, _) => "no difference shown",
                    (true, true) => "better",
                    (true, false) => "worse",
                };
                format!("  {:<11} {}: {verdict}\n", column.name, column.text(estimate, true))
            });
            let lines: String = lines.collect();
            format!("\n{} against {first}, pair by pair on {} pairs:\n{lines}", run.run, run.pairs)
        }
    }
}

const CSV_FIGURES: [&str; 5] = [
    "recall_pct",
    "mean_translation_m",
    "mean_rotation_deg",
    "median_translation_m",
    "median_rotation_deg",
];

fn csv_head(compared: &Compared) -> Vec<String> {
    let mut head: Vec<String> =
        ["run", "scene", "method", "protocol", "seed", "registrations", "pairs"]
            .map(str::to_owned)
            .to_vec();
    for name in CSV_FIGURES {
        head.extend([name.to_owned(), format!("{name}_low"), format!("{name}_high")]);
    }
    head.extend(["energy_j".to_owned(), "paired".to_owned()]);
    for name in CSV_FIGURES {
        head.extend(["", "_low", "_high", "_shown"].map(|part| format!("difference_{name}{part}")));
    }
    head.extend(compared.settings.keys().map(|name| format!("setting {name}")));
    head.extend(compared.parameters.keys().map(|name| format!("tuned {name}")));
    head
}

fn csv_line(compared: &Compared, number: usize, run: &ComparedRun) -> Vec<String> {
    // Unknown numbers are empty cells.
    let cell = |value: f64| if value.is_finite() { value.to_string() } else { String::new() };
    let mut line = vec![
        run.run.clone(),
        run.scene.clone(),
        run.method.clone(),
        run.protocol.clone(),
        run.seed.to_string(),
        run.registrations.to_string(),
        run.pairs.to_string(),
    ];
    for Estimate { value, interval: [low, high] } in in_order(&run.tuned) {
        line.extend([value, low, high].map(cell));
    }
    line.push(run.cost.map_or_else(String::new, |cost| cell(cost.energy_j)));
    match &run.against_first {
        Against::Paired(differences) => {
            line.push("yes".into());
            for Difference { estimate, is_shown } in in_order(differences) {
                let [low, high] = estimate.interval;
                line.extend([estimate.value, low, high].map(cell));
                line.push(if is_shown { "yes" } else { "no" }.into());
            }
        }
        against => {
            line.push(if matches!(against, Against::Itself) { "" } else { "no" }.into());
            line.extend(std::iter::repeat_n(String::new(), 4 * CSV_FIGURES.len()));
        }
    }
    let values = compared.settings.values().chain(compared.parameters.values());
    line.extend(values.map(|values| values[number].clone().unwrap_or_default()));
    line
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
}
