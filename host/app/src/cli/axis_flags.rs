//! `--tune` and `--fix`: what a search moves, axis by axis.

use clap::Args;

use crate::experiment::config::{AxisChoice, Override};

/// Flags of commands that search, or serve a search.
#[derive(Clone, Debug, Default, Args)]
pub(super) struct AxisFlags {
    /// Search this parameter: lidar.shots, or within bounds lidar.power=1..100, which ,log or
    /// ,linear may follow; may be repeated.
    #[arg(long = "tune", value_name = "NAME[=LO..HI]", value_parser = tuned)]
    tune: Vec<Override>,
    /// Leave this parameter where it starts: registration.voxel_m, or at a value,
    /// registration.voxel_m=0.3; may be repeated.
    #[arg(long, value_name = "NAME[=VALUE]", value_parser = fixed)]
    fix: Vec<Fixed>,
}

#[derive(Clone, Debug)]
struct Fixed {
    axis: Override,
    value: Option<Override>,
}

impl AxisFlags {
    /// As changes of the configuration, the later ones last.
    pub(super) fn overrides(&self) -> Vec<Override> {
        let fixed =
            self.fix.iter().flat_map(|fixed| [Some(fixed.axis.clone()), fixed.value.clone()]);
        self.tune.iter().cloned().map(Some).chain(fixed).flatten().collect()
    }
}

fn tuned(text: &str) -> Result<Override, String> {
    let (name, choice) = text.split_once('=').unwrap_or((text, "free"));
    let choice: AxisChoice = choice.trim().parse()?;
    axis(name, choice)
}

fn fixed(text: &str) -> Result<Fixed, String> {
    let (name, value) = match text.split_once('=') {
        Some((name, _)) => (name, Some(text.parse()?)),
        None => (text, None),
    };
    Ok(Fixed { axis: axis(name, AxisChoice::Fixed)?, value })
}

/// The choice for a parameter, which lies in a section: whether there is one, the configuration
/// says.
fn axis(name: &str, choice: AxisChoice) -> Result<Override, String> {
    let name = name.trim();
    match name.split_once('.') {
        Some(("lidar" | "registration", key)) if !key.is_empty() && !key.contains('.') => {
            Ok(Override::flag(&format!("tune.axes.{name}"), choice.to_string()))
        }
        _ => Err("expected a parameter, as lidar.power or registration.voxel_m".into()),
    }
}
