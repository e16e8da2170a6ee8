//! `--tune` and `--fix`: axes of a search.

use clap::Args;
use echoloop_files::one_line;

use super::exit::Failure;
use echoloop_closed_loop::config::{AxisChoice, Override};

/// Flags of commands that search, or that evaluate for a search.
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
    /// Changes of the configuration.
    ///
    /// # Errors
    ///
    /// [`Failure`] where one parameter is named twice.
    pub(super) fn overrides(&self) -> Result<Vec<Override>, Failure> {
        let axes = self.tune.iter().chain(self.fix.iter().map(|fixed| &fixed.axis));
        let mut names: Vec<String> = axes.map(Override::path).collect();
        names.sort();
        if let Some([name, ..]) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            let name = name.strip_prefix(AXES).unwrap_or(name);
            return Err(Failure::usage(format_args!(
                "--tune and --fix: expected {} once, found it twice",
                one_line(name)
            )));
        }
        let fixed =
            self.fix.iter().flat_map(|fixed| [Some(fixed.axis.clone()), fixed.value.clone()]);
        Ok(self.tune.iter().cloned().map(Some).chain(fixed).flatten().collect())
    }
}

fn tuned(text: &str) -> Result<Override, String> {
    let (name, choice) = text.split_once('=').unwrap_or((text, "free"));
    let choice: AxisChoice = choice.trim().parse()?;
    axis("--tune", text, name, choice)
}

fn fixed(text: &str) -> Result<Fixed, String> {
    let (name, value) = match text.split_once('=') {
        Some((name, _)) => (name, Some(text.parse::<Override>()?.written(&written("--fix", text)))),
        None => (text, None),
    };
    Ok(Fixed { axis: axis("--fix", text, name, AxisChoice::Fixed)?, value })
}

/// Section of the choices in the configuration.
const AXES: &str = "tune.axes.";

/// A flag as the user wrote it.
fn written(flag: &str, text: &str) -> String {
    format!("{flag} {text}")
}

/// A choice for a parameter; its name is checked with the configuration.
fn axis(flag: &str, text: &str, name: &str, choice: AxisChoice) -> Result<Override, String> {
    let name = name.trim();
    match name.split_once('.') {
        Some(("lidar" | "registration", key)) if !key.is_empty() && !key.contains('.') => {
            let choice = Override::flag(&format!("{AXES}{name}"), choice.to_string());
            Ok(choice.written(&written(flag, text)))
        }
        _ => Err("expected a parameter, as lidar.power or registration.voxel_m".into()),
    }
}
