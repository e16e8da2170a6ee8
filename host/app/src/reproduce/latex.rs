//! The table as LaTeX.

use std::fmt::{Display, Write as _};

use clap::ValueEnum;

use super::written::real_figures;
use echoloop_closed_loop::config::preset::Protocol;
use echoloop_study::{
    FIGURES, Part, RealRow, Row, Scene, Sheet, Table, TableMethod, paper, remarks, search,
    subtitle, tuned, tuned_by,
};

/// LaTeX: a `tabular` for each search, with translation, rotation and recall as in the paper's
/// table, the best of a method and scene bold, the paper's figures in grey below; then one for
/// cases tuned by hand, switches and real clouds. Needs the packages booktabs and xcolor.
pub(super) fn latex(table: &Table) -> String {
    let mut text = format!("% {}\n", subtitle(table));
    for remark in remarks(table) {
        let _ = writeln!(text, "% {remark}");
    }
    for sheet in table.sheets() {
        match sheet.part {
            Part::Search(ranges, strategy) => {
                let _ = write!(text, "\n% {}\n{LATEX_HEAD}", search(ranges, strategy));
                for &protocol in Protocol::value_variants() {
                    latex_rows(&mut text, protocol, &sheet.rows);
                }
                text.push_str(LATEX_END);
            }
            Part::ByHand => latex_beside(&mut text, "Set by hand", &sheet),
            Part::Switches => latex_beside(&mut text, "Switch", &sheet),
        }
    }
    if !table.real.is_empty() {
        let _ = write!(text, "\n% real clouds\n{LATEX_REAL_HEAD}");
        table.real.iter().for_each(|row| latex_real_row(&mut text, row));
        text.push_str(LATEX_END);
    }
    text
}

const LATEX_END: &str = "\\bottomrule\n\\end{tabular}\n";

/// Rows: each figure, then its reference in grey.
fn latex_beside(text: &mut String, head: &str, sheet: &Sheet<'_>) {
    let figures = "RTE [cm] & & RRE [$^\\circ$] & & Recall [\\%] &";
    let _ = write!(
        text,
        "\n% {}, beside each what it is without\n\\begin{{tabular}}{{lllll*{{6}}{{r}}}}\n\
         \\toprule\n{head} & Ranges & Method & Scene & Tuned & {figures} \\\\\n\\midrule\n",
        head.to_lowercase()
    );
    for row in &sheet.rows {
        let other = sheet.other(row).and_then(|other| other.figures.as_ref());
        let own = latex_own(Some(row), [false; 3]).into_iter().zip(LATEX_ORDER);
        let figures = own.flat_map(|(own, i)| {
            let theirs = other.map(|other| FIGURES[i].numbers(other)[0]).filter(|v| v.is_finite());
            [own, theirs.map_or("--".into(), |value| grey(FIGURES[i].digits(value)))]
        });
        // Columns of both kinds of sheets: the one by hand has none for what was tuned.
        let names = sheet.names(row).into_iter().take(4).chain([tuned_by(&row.cell)]);
        let fields: Vec<String> = names.chain(figures).collect();
        let _ = writeln!(text, "{} \\\\", fields.join(" & "));
    }
    text.push_str(LATEX_END);
}

fn grey(text: impl Display) -> String {
    format!("\\textcolor{{gray}}{{{text}}}")
}

const LATEX_REAL_HEAD: &str = "\
\\begin{tabular}{llrrr}
\\toprule
Method & Settings & RTE [cm] & RRE [$^\\circ$] & Found \\\\
\\midrule
";

fn latex_real_row(text: &mut String, row: &RealRow) {
    let [_, rte_cm, rre_deg] = real_figures(row);
    let mean = |value: f64| if value.is_finite() { format!("{value:.2}") } else { "--".into() };
    let _ = writeln!(
        text,
        "{} & {} & {} & {} & {} of {} \\\\",
        row.method.title(),
        row.settings,
        mean(rte_cm),
        mean(rre_deg),
        row.found,
        row.pairs.len()
    );
}

const LATEX_HEAD: &str = "\
\\begin{tabular}{ll*{9}{r}}
\\toprule
& & \\multicolumn{3}{c}{Structured} & \\multicolumn{3}{c}{Semi-structured} \
& \\multicolumn{3}{c}{Unstructured} \\\\
Tuned & Method & RTE [cm] & RRE [$^\\circ$] & Recall [\\%] & RTE [cm] & RRE [$^\\circ$] \
& Recall [\\%] & RTE [cm] & RRE [$^\\circ$] & Recall [\\%] \\\\
\\midrule
";

/// Indices in [`FIGURES`] in the paper's order of columns.
const LATEX_ORDER: [usize; 3] = [1, 2, 0];

fn latex_rows(text: &mut String, protocol: Protocol, rows: &[&Row]) {
    for &method in TableMethod::value_variants() {
        let is_of = |row: &&&Row| (row.cell.protocol, row.cell.method) == (protocol, method);
        let of_method: Vec<&Row> = rows.iter().filter(is_of).copied().collect();
        let Some(first) = of_method.first() else { continue };
        let (mut own, mut theirs) = (Vec::new(), Vec::new());
        for &scene in Scene::value_variants() {
            let row = of_method.iter().find(|row| row.cell.scene == scene).copied();
            own.extend(latex_own(row, row.map_or([false; 3], |row| is_best(row, rows))));
            let figures = paper(protocol, method, scene);
            theirs.extend(LATEX_ORDER.map(|i| grey(FIGURES[i].paper(&figures))));
        }
        let (tuned, own) = (tuned(&first.cell), own.join(" & "));
        let _ = writeln!(text, "{tuned} & {} & {own} \\\\", method.title());
        let _ = writeln!(text, "& & {} \\\\", theirs.join(" & "));
    }
}

/// For each figure, true when no other row of its method and scene is better; false without others.
fn is_best(row: &Row, rows: &[&Row]) -> [bool; 3] {
    let is_rival = |other: &&&Row| {
        let same = (other.cell.method, other.cell.scene) == (row.cell.method, row.cell.scene);
        same && other.cell != row.cell
    };
    let value = |row: &Row, i: usize| {
        let value = row.figures.as_ref().map_or(f64::NAN, |figures| FIGURES[i].numbers(figures)[0]);
        // The greatest recall is best.
        if i == 0 { -value } else { value }
    };
    std::array::from_fn(|i| {
        let rivals: Vec<f64> = rows.iter().filter(is_rival).map(|other| value(other, i)).collect();
        let own = value(row, i);
        let known = || rivals.iter().filter(|rival| rival.is_finite());
        own.is_finite() && known().next().is_some() && known().all(|rival| own <= *rival)
    })
}

/// Each figure with its interval, by [`LATEX_ORDER`]; bold where `best` (by [`FIGURES`]).
fn latex_own(row: Option<&Row>, best: [bool; 3]) -> [String; 3] {
    LATEX_ORDER.map(|i| match row.and_then(|row| row.figures.as_ref()) {
        Some(figures) => {
            let [value, low, high] = FIGURES[i].numbers(figures);
            let [text, low_text, high_text] = [value, low, high].map(|v| FIGURES[i].digits(v));
            let text = if best[i] { format!("\\textbf{{{text}}}") } else { text };
            match (value.is_finite(), low.is_finite()) {
                (true, true) => format!("{text} {{\\scriptsize [{low_text}, {high_text}]}}"),
                (true, false) => text,
                _ => "--".into(),
            }
        }
        None => "--".into(),
    })
}
