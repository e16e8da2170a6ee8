//! Figures of several panels with a caption. On a page the panels wrap to its width; a file holds
//! all of them in rows.

use super::chosen::ChosenRange;
use super::figure::Figure;
use super::format::{escape, file_name, with_code};
use super::overlay::Overlay;
use super::plot::{Caption, Key, legend};
use super::sections::correlation::Moved;
use super::shares::Shares;
use super::sheet::{Sheet, composed};
use super::strips::Strips;

/// A figure.
#[derive(Clone, Debug, Default)]
pub struct Plate {
    /// Name of its file and anchor of its section: letters, digits and dashes.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Caption: sentences about the content and its cells.
    pub caption: String,
    /// Missing cells and the command that makes them; empty when complete.
    pub missing: String,
    /// Number of panels in a row of its file.
    pub columns: usize,
    /// Panels, row by row.
    pub panels: Vec<Panel>,
}

/// A part of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Name, unique on the page.
    pub name: String,
    /// Heading.
    pub title: String,
    /// Content.
    pub drawing: PanelDrawing,
}

/// Content of a panel.
#[derive(Clone, Debug)]
pub enum PanelDrawing {
    /// Cumulative distributions of the error.
    Shares(Shares),
    /// The error of every pair, row by row.
    Strips(Strips),
    /// Correlations of the parameters of a search.
    Moved(Moved),
    /// Two clouds from above.
    Overlay(Overlay),
    /// Chosen values of a parameter within its range.
    Chosen(ChosenRange),
}

impl Plate {
    /// The figure as a section of a page.
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

    /// The figure as a drawing that stands alone.
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

    /// True when the panels have many names and need the full width of the page.
    fn is_map(&self) -> bool {
        matches!(self.panels.first().map(|panel| &panel.drawing), Some(PanelDrawing::Moved(_)))
    }

    /// Legend of the panels.
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
