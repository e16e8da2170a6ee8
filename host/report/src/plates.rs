//! Figures of several panels with a caption: on a page the panels lie side by side as far as there
//! is room, in a file all together.

use super::chosen::ChosenRange;
use super::sections::correlation::Moved;
use super::figure::Figure;
use super::format::{escape, file_name, with_code};
use super::overlay::Overlay;
use super::plot::{Caption, Key, legend};
use super::shares::Shares;
use super::sheet::{Sheet, composed};
use super::strips::Strips;

/// A figure.
#[derive(Clone, Debug, Default)]
pub struct Plate {
    /// Letters, digits and dashes: its file's name, and where a page has it.
    pub name: String,
    /// Its heading.
    pub title: String,
    /// What is seen, and of which cells: sentences.
    pub caption: String,
    /// What is missing, and what would bring it; or nothing.
    pub missing: String,
    /// Panels in a row of its file.
    pub columns: usize,
    /// Its panels, row by row.
    pub panels: Vec<Panel>,
}

/// A part of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Different in each panel of a page.
    pub name: String,
    /// What it shows.
    pub title: String,
    /// How.
    pub drawing: PanelDrawing,
}

/// What a panel draws.
#[derive(Clone, Debug)]
pub enum PanelDrawing {
    /// Shares of pairs by error.
    Shares(Shares),
    /// The error of every pair, row by row.
    Strips(Strips),
    /// Which parameters a search moved together.
    Moved(Moved),
    /// Two clouds from above.
    Overlay(Overlay),
    /// Where in its range a parameter was chosen.
    Chosen(ChosenRange),
}

impl Plate {
    /// As a section of a page.
    pub(super) fn section(&self) -> String {
        let (name, title) = (escape(&self.name), escape(&self.title));
        let missing = match self.missing.as_str() {
            "" => String::new(),
            missing => format!("<p class=\"caution\">{}</p>", with_code(missing)),
        };
        let panels: String = self.panels.iter().map(Panel::element).collect();
        format!(
            "<section id=\"{name}\" class=\"plate\"><h2>{title}</h2><p class=\"lead\">{}</p>\
             {missing}<div class=\"panels panels-{}{}\">{panels}</div>{}</section>\n",
            escape(&self.caption),
            self.columns,
            if self.is_map() { " map" } else { "" },
            legend(self.keys())
        )
    }

    /// As a drawing that stands alone.
    pub(super) fn figure(&self) -> Result<Figure, String> {
        let panels: Vec<String> = self.panels.iter().map(Panel::svg).collect();
        composed(&Sheet {
            name: &self.name,
            title: &self.title,
            label: &format!("{}. {} {}", self.title, self.caption, self.missing),
            columns: self.columns,
            keys: self.keys(),
            panels: &panels,
        })
    }

    /// Whether its panels have many names, and need the page's width.
    fn is_map(&self) -> bool {
        matches!(self.panels.first().map(|panel| &panel.drawing), Some(PanelDrawing::Moved(_)))
    }

    /// What its marks mean.
    fn keys(&self) -> &'static [Key<'static>] {
        self.panels.first().map_or(&[], |panel| match &panel.drawing {
            PanelDrawing::Shares(_) => &super::shares::KEYS,
            PanelDrawing::Strips(_) => &super::strips::KEYS,
            PanelDrawing::Moved(_) => &super::sections::correlation::MOVED_KEYS,
            PanelDrawing::Overlay(_) => &super::overlay::KEYS,
            PanelDrawing::Chosen(_) => &super::chosen::KEYS,
        })
    }
}

impl Panel {
    fn element(&self) -> String {
        format!(
            "<figure><figcaption>{}</figcaption><div class=\"scroll\">{}</div></figure>",
            escape(&self.title),
            self.svg()
        )
    }

    fn svg(&self) -> String {
        let name = file_name(&self.name);
        let caption = Caption { name: &name, title: &self.title, keys: &[] };
        match &self.drawing {
            PanelDrawing::Shares(shares) => shares.svg(&caption),
            PanelDrawing::Strips(strips) => strips.svg(&caption),
            PanelDrawing::Moved(moved) => moved.svg(&caption),
            PanelDrawing::Overlay(overlay) => overlay.svg(&caption),
            PanelDrawing::Chosen(chosen) => chosen.svg(&caption),
        }
    }
}
