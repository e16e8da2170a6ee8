//! Figures of several panels with a caption. On a page the panels wrap to its width; a file holds
//! all of them in rows.

use super::chosen::ChosenRange;
use super::figure::{Figure, box_of};
use super::format::{escape, file_name, with_code};
use super::overlay::Overlay;
use super::plot::{Caption, FINE, Key, legend, own_legend, own_text};
use super::sections::correlation::Moved;
use super::shares::Shares;
use super::strips::Strips;

/// Room beside the panels of a file, and above them, pixels.
const EDGE: f64 = 10.0;
const HEAD: f64 = 30.0;

/// Greatest mean width of a title's letters, pixels.
const TITLE_LETTER: f64 = 7.8;

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

    /// The figure as a drawing that stands alone, its panels in rows. Each column is as wide as its
    /// widest panel, each row as high as its highest.
    pub(super) fn figure(&self) -> Result<Figure, String> {
        let Self { name, title, caption, missing, .. } = self;
        let columns = self.columns.max(1);
        let panels: Vec<String> = self.panels.iter().map(Panel::svg).collect();
        let boxes = panels.iter().map(|panel| box_of(panel)).collect::<Option<Vec<_>>>();
        let boxes = boxes.ok_or_else(|| format!("a panel of {name} has no box"))?;
        let widths = greatest(boxes.iter().enumerate().map(|(k, sides)| (k % columns, sides[2])));
        let heights = greatest(boxes.iter().enumerate().map(|(k, sides)| (k / columns, sides[3])));
        let before = |sides: &[f64], k: usize| sides[..k].iter().sum::<f64>();
        let mut drawn = own_text([EDGE + 4.0, 20.0], "own-title", title);
        for (k, (panel, [left, top, wide, high])) in panels.iter().zip(&boxes).enumerate() {
            let x = FINE * EDGE + before(&widths, k % columns);
            let y = FINE * HEAD + before(&heights, k / columns);
            let content = panel.split_once('>').map_or("", |(_, content)| content);
            drawn += &format!(
                "<svg x=\"{x}\" y=\"{y}\" width=\"{wide}\" height=\"{high}\" \
                 viewBox=\"{left} {top} {wide} {high}\">{content}"
            );
        }
        let titled = TITLE_LETTER * title.chars().count() as f64;
        let width = (widths.iter().sum::<f64>() / FINE).max(titled) + 2.0 * EDGE;
        let below = HEAD + heights.iter().sum::<f64>() / FINE + 14.0;
        let (legend, high) = own_legend(self.keys(), width - 2.0 * EDGE, below);
        drawn += &format!("<g transform=\"translate({} 0)\">{legend}</g>", FINE * EDGE);
        let label = escape(&format!("{title}. {caption} {missing}"));
        Figure::new(name, [0.0, 0.0, FINE * width, FINE * (below + high)], &label, &drawn)
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

/// Greatest side of each index.
fn greatest(sides: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
    let mut greatest = Vec::new();
    for (k, side) in sides {
        greatest.resize(greatest.len().max(k + 1), 0.0);
        greatest[k] = f64::max(greatest[k], side);
    }
    greatest
}
