//! The page of tables of figures.

use super::figure::Figure;
use super::format::{escape, with_code};
use super::page::{self, SAVE, document, facts, header, notes, row, subtitle};
use super::plates::Plate;

/// Tables one below the other, then figures.
#[derive(Clone, Debug, Default)]
pub struct TablesPage {
    /// Heading of the page.
    pub title: String,
    /// A sentence under the heading.
    pub subtitle: String,
    /// Names and values.
    pub facts: Vec<(String, String)>,
    /// Remarks, a sentence each.
    pub remarks: Vec<String>,
    /// The tables.
    pub tables: Vec<FigureTable>,
    /// The figures.
    pub plates: Vec<Plate>,
}

/// One table.
#[derive(Clone, Debug, Default)]
pub struct FigureTable {
    /// Heading.
    pub title: String,
    /// A sentence under the heading.
    pub lead: String,
    /// Heads of the columns, first that of the rows' names.
    pub heads: Vec<String>,
    /// Rows.
    pub rows: Vec<FigureRow>,
}

/// A row.
#[derive(Clone, Debug, Default)]
pub struct FigureRow {
    /// Name.
    pub name: String,
    /// True when the row is emphasised.
    pub strong: bool,
    /// Cells.
    pub cells: Vec<FigureCell>,
}

/// A figure with its interval and a figure to compare it with.
#[derive(Clone, Debug, Default)]
pub struct FigureCell {
    /// Value with its unit.
    pub value: String,
    /// Interval; may be empty.
    pub within: String,
    /// Figure from elsewhere, such as the paper's; may be empty.
    pub beside: String,
}

impl TablesPage {
    /// The page, complete.
    pub fn to_html(&self) -> String {
        let remarks = notes(self.remarks.iter().map(|remark| with_code(remark)));
        let below = subtitle(&self.subtitle) + &facts(&self.facts) + &remarks;
        let tables: String = self.tables.iter().map(section).collect();
        let plates: String = self.plates.iter().map(Plate::section).collect();
        let script = if plates.is_empty() { "" } else { SAVE };
        document(&self.title, &[header(&self.title, &below), tables, plates].concat(), script)
    }

    /// Every figure, standing alone.
    ///
    /// # Errors
    ///
    /// A text about the first that cannot be drawn.
    pub fn figures(&self) -> Result<Vec<Figure>, String> {
        self.plates.iter().map(Plate::figure).collect()
    }
}

fn section(table: &FigureTable) -> String {
    let title = escape(&table.title);
    let rows: String = table.rows.iter().map(|line| table_row(line, &table.heads)).collect();
    format!(
        "<section><h2>{title}</h2><p class=\"lead\">{}</p>{}</section>\n",
        escape(&table.lead),
        page::table("figures", &title, table.heads.iter().map(|head| escape(head)), &rows)
    )
}

fn table_row(line: &FigureRow, heads: &[String]) -> String {
    let row = row(&line.name, line.cells.iter().zip(&heads[1.min(heads.len())..]).map(cell));
    if line.strong { row.replacen("<tr", "<tr class=\"row-tuned\"", 1) } else { row }
}

/// A cell that repeats its column's name: on a narrow page a row becomes a card.
fn cell((cell, head): (&FigureCell, &String)) -> String {
    let small = |class: &str, text: &str| match text {
        "" => String::new(),
        text => format!("<span class=\"{class}\">{}</span>", escape(text)),
    };
    format!(
        "<td data-head=\"{}\"><span class=\"value\">{}</span>{}{}</td>",
        escape(head),
        escape(&cell.value),
        small("within", &cell.within),
        small("change", &cell.beside)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_on_the_page_escaped_and_each_cell_names_its_column() {
        let cell = |value: &str| FigureCell {
            value: value.into(),
            within: "1 to 3".into(),
            beside: "paper 4".into(),
        };
        let page = TablesPage {
            title: "<T>".into(),
            facts: vec![("seed".into(), "7".into())],
            remarks: vec!["a & b".into()],
            tables: vec![FigureTable {
                title: "One".into(),
                heads: ["", "A<", "B"].map(str::to_owned).to_vec(),
                rows: vec![FigureRow {
                    name: "row".into(),
                    strong: true,
                    cells: vec![cell("2"), cell("5")],
                }],
                ..FigureTable::default()
            }],
            ..TablesPage::default()
        };
        let html = page.to_html();
        assert!(html.contains("<h1>&lt;T&gt;</h1>") && html.contains("a &amp; b"));
        let first = "<td data-head=\"A&lt;\"><span class=\"value\">2</span>";
        assert!(html.contains(first) && html.contains("data-head=\"B\"><span class=\"value\">5"));
        assert!(html.contains("<tr class=\"row-tuned\"><th scope=\"row\">row</th>"));
    }
}
