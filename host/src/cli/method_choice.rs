//! `--method`: which registration method a run uses.

use clap::Args;

use crate::config::{FgrMode, Method, Override};

/// Flags of every command that registers scans of its own.
#[derive(Clone, Debug, Args)]
pub(super) struct MethodChoice {
    /// Registration method; global ones (fgr, mac) get scans 5 m apart unless data.baseline_m says otherwise.
    #[arg(long)]
    method: Option<Method>,
    /// Of fgr: as published, or as Open3D 0.20 runs it from Python, the paper's baseline.
    #[arg(long)]
    mode: Option<FgrMode>,
    /// Finish what a global method finds with point-to-plane ICP.
    #[arg(long)]
    refine: bool,
}

impl MethodChoice {
    /// As changes of the configuration.
    pub(super) fn overrides(&self) -> Vec<Override> {
        let method = self.method.map(|method| Override::flag("registration.method", name_of(method)));
        let mode = self.mode.map(|mode| Override::flag("registration.mode", name_of(mode)));
        let refine = self.refine.then(|| Override::flag("registration.refine", true));
        method.into_iter().chain(mode).chain(refine).collect()
    }
}

/// A value's name on the command line, which is also its name in the file.
pub(super) fn name_of(value: impl clap::ValueEnum) -> toml::Value {
    value.to_possible_value().map(|v| v.get_name().to_owned()).unwrap_or_default().into()
}
