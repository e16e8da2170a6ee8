//! Axes of the table: methods and kinds of country.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use echoloop_closed_loop::config::{FgrMode, Method, Override};

/// A method of the table. FGR has two rows, as Open3D does not run it as published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TableMethod {
    /// Point-to-plane ICP.
    Icp,
    /// FGR as Open3D 0.20 runs it from Python, most likely the paper's.
    #[value(name = "fgr-open3d")]
    #[serde(rename = "fgr-open3d")]
    FgrOpen3d,
    /// FGR as published.
    Fgr,
    /// Maximal cliques.
    Mac,
}

impl TableMethod {
    /// Name in the table.
    pub fn title(self) -> &'static str {
        match self {
            Self::Icp => "ICP",
            Self::FgrOpen3d => "FGR (Open3D)",
            Self::Fgr => "FGR (published)",
            Self::Mac => "MAC",
        }
    }

    /// The method and FGR's mode, which other methods ignore.
    pub(super) fn method(self) -> (Method, FgrMode) {
        match self {
            Self::Icp => (Method::Icp, FgrMode::default()),
            Self::FgrOpen3d => (Method::Fgr, FgrMode::Open3d),
            Self::Fgr => (Method::Fgr, FgrMode::Annealed),
            Self::Mac => (Method::Mac, FgrMode::default()),
        }
    }

    /// Settings of a run of the method.
    pub(super) fn overrides(self) -> Vec<Override> {
        let (method, mode) = match self {
            Self::Icp => ("icp", None),
            Self::FgrOpen3d => ("fgr", Some("open3d")),
            Self::Fgr => ("fgr", Some("annealed")),
            Self::Mac => ("mac", None),
        };
        let method = Override::flag("registration.method", method);
        let mode = mode.map(|mode| Override::flag("registration.mode", mode));
        [method].into_iter().chain(mode).collect()
    }
}

/// A kind of country.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scene {
    /// Streets, facades, cars.
    Structured,
    /// Houses, gardens, trees.
    SemiStructured,
    /// Trees, bushes, rocks.
    Unstructured,
}

impl Scene {
    /// The next kind; after the last the first.
    pub fn next(self) -> Self {
        match self {
            Self::Structured => Self::SemiStructured,
            Self::SemiStructured => Self::Unstructured,
            Self::Unstructured => Self::Structured,
        }
    }
}

/// Name of a choice on the command line and in files.
pub fn name_of(value: impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}
