//! The page of many registered pairs.

use echoloop_clouds::Cloud;

use super::page::{document, facts, figure_cell, header, row, subtitle, table};
use super::sections::clouds::views;
use super::sections::{CAMERA, VIEWER};

/// Pairs as a table, and one of them in three dimensions.
#[derive(Clone, Debug, Default)]
pub struct RegisteredPage {
    /// Heading.
    pub title: String,
    /// Names and values above the table.
    pub facts: Vec<(String, String)>,
    /// Heads of the columns, the pair's name first.
    pub heads: Vec<String>,
    /// Cells of each pair, under the heads.
    pub rows: Vec<Vec<String>>,
    /// Pair to look at.
    pub shown: Option<ShownPair>,
}

/// A pair in three dimensions, as given and registered.
#[derive(Clone, Debug, Default)]
pub struct ShownPair {
    /// Its name, and why it is shown.
    pub lead: String,
    /// Error as given and registered, in words.
    pub off: [String; 2],
    /// Target and source as given, and with the source on the target.
    pub clouds: [[Cloud; 2]; 2],
}

impl RegisteredPage {
    /// The page, complete; the same data gives the same bytes.
    pub fn to_html(&self) -> String {
        let body = |cells: &Vec<String>| {
            let (name, rest) = cells.split_first().map_or(("", &[][..]), |(n, rest)| (n, rest));
            let cell = |(head, cell): (&String, &String)| figure_cell(head, cell);
            row(name, self.heads.iter().skip(1).zip(rest).map(cell))
        };
        let rows: String = self.rows.iter().map(body).collect();
        let heads = self.heads.iter().map(|head| super::format::escape(head).to_string());
        let below = subtitle("Pairs of clouds, registered.") + &facts(&self.facts);
        let shown = self.shown.as_ref().map(|pair| {
            let [given, registered] = pair.off.clone();
            views(&pair.lead, [("As given", given), ("Registered", registered)], &pair.clouds)
        });
        let sections = [
            header(&self.title, &below),
            shown.clone().unwrap_or_default(),
            format!(
                "<section id=\"pairs\"><h2>Every pair</h2>{}</section>\n",
                table("figures", "Every pair", heads, &rows)
            ),
        ];
        let script = if shown.is_some() { [CAMERA, VIEWER].concat() } else { String::new() };
        document(&self.title, &sections.concat(), &script)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_no_html_and_a_page_without_a_pair_has_no_script() {
        let page = RegisteredPage {
            title: "a <b> folder".into(),
            heads: vec!["pair".into(), "error".into()],
            rows: vec![vec!["<i>".into(), "0.1 m & more".into()]],
            ..RegisteredPage::default()
        };
        let html = page.to_html();
        assert!(html.contains("a &lt;b&gt; folder") && html.contains("&lt;i&gt;"));
        assert!(html.contains("0.1 m &amp; more") && !html.contains("<canvas"));
        let cloud = Cloud::new(vec![[1.0, 2.0, 3.0].into()]);
        let clouds = [[cloud.clone(), cloud.clone()], [cloud.clone(), cloud]];
        let shown = ShownPair { lead: "the <worst>".into(), clouds, ..ShownPair::default() };
        let html = RegisteredPage { shown: Some(shown), ..page }.to_html();
        assert!(html.contains("view-before") && html.contains("the &lt;worst&gt;: the target"));
    }
}
