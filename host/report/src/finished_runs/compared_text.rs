//! Compared runs as text and as CSV.

use super::compared::{Against, Compared, ComparedRun, Differing};
use crate::columns::{COLUMNS, Column, in_order};
use crate::text_table::{aligned, finished};
use echoloop_closed_loop::cost::CostKind;
use echoloop_closed_loop::evaluation::gain::{Difference, Estimate};

impl Compared {
    /// The table as text, then each run against the first, settings and parameters that differ.
    pub fn text(&self) -> String {
        let first = &self.runs[0].run;
        let against = self.runs.iter().map(|run| against(run, first));
        [table(self), "\nParentheses: 95 % intervals.\n".into()]
            .into_iter()
            .chain(against)
            .chain([differing("settings", self, &self.settings)])
            .chain([differing("parameters", self, &self.parameters)])
            .collect()
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

fn table(compared: &Compared) -> String {
    let names = COLUMNS.iter().map(|column| column.symbol);
    let head = ["run", "pairs"].into_iter().chain(names).chain(["energy"]);
    let mut rows: Vec<Vec<String>> = vec![head.map(str::to_owned).collect()];
    rows.extend(compared.runs.iter().map(|run| {
        let figures = COLUMNS.iter().zip(in_order(&run.tuned));
        let figures = figures.map(|(column, estimate)| column.text(estimate, false));
        let energy = run.cost.map(|cost| CostKind::Energy.text(CostKind::Energy.of(&cost)));
        let begin = [run.run.clone(), run.pairs.to_string()].into_iter();
        begin.chain(figures).chain([energy.unwrap_or_else(|| "–".into())]).collect()
    }));
    aligned(&rows)
}

fn differing(what: &str, compared: &Compared, table: &Differing) -> String {
    if table.is_empty() {
        return format!("\nNo {what} differ.\n");
    }
    let names = compared.runs.iter().map(|run| run.run.clone());
    let head = [format!("{what} that differ")].into_iter().chain(names).collect();
    let rows = table.iter().map(|(name, values)| {
        let values = values.iter().map(|value| value.clone().unwrap_or_else(|| "–".into()));
        [name.clone()].into_iter().chain(values).collect()
    });
    format!("\n{}", aligned(&[head].into_iter().chain(rows).collect::<Vec<Vec<String>>>()))
}

/// Differences of a run from the first.
fn against(run: &ComparedRun, first: &str) -> String {
    match &run.against_first {
        Against::Itself => String::new(),
        Against::OtherPairs { other_pairs: why } => format!(
            "\n{} against {first}: no differences pair by pair, for pairs or what counts as \
             success are not the same ({why}).\n",
            run.run
        ),
        Against::Paired(differences) => {
            let each = COLUMNS.iter().zip(in_order(differences));
            let lines = each.map(|(column, difference)| {
                let change = column.text(difference.estimate, true);
                let verdict = column.verdict(&difference).words();
                format!("  {:<11} {change}: {verdict}\n", column.symbol)
            });
            let lines: String = lines.collect();
            format!("\n{} against {first}, pair by pair on {} pairs:\n{lines}", run.run, run.pairs)
        }
    }
}

fn csv_head(compared: &Compared) -> Vec<String> {
    let mut head: Vec<String> =
        ["run", "scene", "method", "protocol", "seed", "registrations", "pairs"]
            .map(str::to_owned)
            .to_vec();
    for Column { key, .. } in &COLUMNS {
        head.extend([key.to_string(), format!("{key}_low"), format!("{key}_high")]);
    }
    head.extend(["energy_j".to_owned(), "paired".to_owned()]);
    for Column { key, .. } in &COLUMNS {
        head.extend(["", "_low", "_high", "_shown"].map(|part| format!("difference_{key}{part}")));
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
            line.extend(std::iter::repeat_n(String::new(), 4 * COLUMNS.len()));
        }
    }
    let values = compared.settings.values().chain(compared.parameters.values());
    line.extend(values.map(|values| values[number].clone().unwrap_or_default()));
    line
}
