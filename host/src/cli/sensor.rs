//! `echoloop sensor`.

use clap::Args;
use echoloop_dsp::{Kind, PARAMETERS, Parameter, ParameterId, Settings};
use echoloop_link::{Greeting, settings_hash};

use super::choice::{SensorChoice, described};
use super::exit::Failure;
use super::figures::choices;
use super::{Common, ConfigSource};
use crate::config::{Config, Lidar};
use crate::sensor::Model;

/// Flags of `sensor`.
#[derive(Clone, Debug, Args)]
pub(crate) struct SensorArgs {
    #[command(flatten)]
    source: ConfigSource,
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    sensor: SensorChoice,
    /// Also save the settings: the sensor begins with them from its next start on.
    #[arg(long, conflicts_with = "forget")]
    save: bool,
    /// Drop what the sensor has saved: it begins with its defaults from its next start on.
    #[arg(long)]
    forget: bool,
}

pub(super) fn run(args: &SensorArgs) -> Result<(), Failure> {
    let config = args.source.load(Vec::new())?;
    let sensors = args.sensor.sensors(Model::of(&config))?;
    let identity = sensors.identity()?;
    let (settings, counters) = sensors.with(|sensor| {
        let own = sensor.client().read_settings()?;
        let settings = asked(&args.source, &config, own);
        if settings != own {
            sensor.configure(&settings)?;
        }
        match (args.save, args.forget) {
            (true, _) => drop(sensor.client().save()?),
            (_, true) => sensor.client().forget()?,
            _ => {}
        }
        Ok((sensor.client().read_settings()?, sensor.client().read_counters()?))
    })?;
    let hash = settings_hash(&settings);
    if args.common.json {
        let document = serde_json::json!({
            "format": 1, "sensor": described(&sensors, &identity), "build": identity.build, "protocol": Greeting::OURS.protocol,
            "schema": format!("{:#018x}", Greeting::OURS.schema), "hardware": identity.hardware,
            "pattern": identity.pattern, "hash": format!("{hash:#010x}"), "settings": Lidar(settings),
            "counters": counters,
        });
        println!("{}", serde_json::to_string_pretty(&document).map_err(Failure::run)?);
        return Ok(());
    }
    println!(
        "{}, protocol {}, schema {:#018x}",
        described(&sensors, &identity),
        Greeting::OURS.protocol,
        Greeting::OURS.schema
    );
    let h = identity.hardware;
    println!(
        "{} bits, {} to {} m, pulses up to {} nJ",
        h.adc_bits,
        f64::from(h.range_min_mm) / 1e3,
        f64::from(h.range_max_mm) / 1e3,
        f64::from(h.energy_limit_pj) / 1e3
    );
    println!("{} × {} beams", identity.pattern.columns, identity.pattern.rows);
    println!("\nsettings {hash:#010x}");
    for parameter in &PARAMETERS {
        println!("{:<22} {:>14}  {}", parameter.name, shown(parameter, settings.get(parameter.id)), range(parameter));
    }
    println!("\n{} frames, {} refused, {} restarts", counters.frames, counters.refusals, counters.restarts);
    Ok(())
}

/// The sensor's own settings with what was asked for laid over.
fn asked(source: &ConfigSource, config: &Config, own: Settings) -> Settings {
    if source.config.is_some() {
        return config.lidar.0;
    }
    let mut settings = own;
    for id in source.set.iter().filter_map(|set| set.key("lidar")).filter_map(ParameterId::by_name) {
        settings.set(id, config.lidar.0.get(id));
    }
    settings
}

fn shown(parameter: &Parameter, code: Option<i32>) -> String {
    match (code, parameter.kind) {
        (None, _) => "follows".into(),
        (Some(code), Kind::Choice { names, .. }) => names.get(code as usize).unwrap_or(&"?").to_string(),
        (Some(code), _) => parameter.to_unit(code).to_string(),
    }
}

fn range(parameter: &Parameter) -> String {
    match parameter.kind {
        Kind::Choice { .. } => choices(parameter).join(", "),
        Kind::PowerOfTwo { runs_to } => format!("1 to {runs_to}, powers of two"),
        _ => format!("{} to {} {}", parameter.to_unit(parameter.min), parameter.to_unit(parameter.max), parameter.unit),
    }
}
