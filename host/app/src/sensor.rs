//! `echoloop sensor`.

use clap::Args;
use echoloop_dsp::{Kind, PARAMETERS, Parameter, ParameterId, Settings};
use echoloop_link::{Counters, Greeting, settings_hash};

use super::choice::described;
use super::common::{ConfigSource, Setup};
use super::exit::{self, Failure};
use super::parameter_table::choices;
use echoloop_closed_loop::config::{Lidar, RunConfig};
use echoloop_sensors::client::Identity;
use echoloop_sensors::pattern::{described as beams_of, document};
use echoloop_sensors::sensor::Model;

/// Flags of `sensor`.
#[derive(Clone, Debug, Args)]
pub(crate) struct SensorArgs {
    #[command(flatten)]
    setup: Setup,
    /// Also save the settings: the sensor begins with them from its next start on.
    #[arg(long, conflicts_with = "forget")]
    save: bool,
    /// Drop what the sensor has saved: it begins with its defaults from its next start on.
    #[arg(long)]
    forget: bool,
}

pub(super) fn run(args: &SensorArgs) -> Result<(), Failure> {
    let config = args.setup.source.load(Vec::new())?;
    let sensors = args.setup.sensor.sensors(Model::from(&config))?;
    let identity = sensors.identity()?;
    let (settings, counters) = sensors.with(|sensor| {
        let own = sensor.client().read_settings()?;
        let settings = asked(&args.setup.source, &config, own);
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
    let name = described(&sensors, &identity);
    if args.setup.common.json {
        return print_json(args, (&name, &identity), &settings, &counters);
    }
    print_text(&name, &identity, &settings, &counters);
    print!("{}", args.told(&settings));
    Ok(())
}

impl SensorArgs {
    /// What became of what the sensor keeps, in a line.
    fn told(&self, settings: &Settings) -> String {
        match (self.save, self.forget) {
            (true, _) => format!("\nsaved {:#010x}: {}\n", settings_hash(settings), own(settings)),
            (_, true) => "\nforgot what was saved: its next start is with its defaults\n".into(),
            _ => String::new(),
        }
    }
}

/// The settings that are not the defaults.
fn changed(settings: &Settings) -> impl Iterator<Item = &'static Parameter> {
    let (settings, usual) = (*settings, Settings::default());
    PARAMETERS.iter().filter(move |p| settings.get(p.id) != usual.get(p.id))
}

/// Settings as far as they are not the defaults, in words.
fn own(settings: &Settings) -> String {
    let one = |p: &Parameter| {
        let said = format!("{} = {} {}", p.name, shown(p, settings.get(p.id)), p.unit);
        said.trim_end().to_owned()
    };
    match changed(settings).map(one).collect::<Vec<_>>() {
        none if none.is_empty() => "all settings are the defaults".into(),
        all if all.len() == PARAMETERS.len() => all.join(", "),
        some => format!("{}; all others are the defaults", some.join(", ")),
    }
}

fn print_json(
    args: &SensorArgs,
    (name, identity): (&str, &Identity),
    settings: &Settings,
    counters: &Counters,
) -> Result<(), Failure> {
    let saved = args.save.then(|| changed(settings).map(|p| p.name).collect::<Vec<_>>());
    let document = serde_json::json!({
        "format": 1,
        "sensor": name,
        "build": identity.build,
        "protocol": Greeting::OURS.protocol,
        "schema": format!("{:#018x}", Greeting::OURS.schema),
        "hardware": identity.hardware,
        "pattern": document(&identity.pattern),
        "hash": format!("{:#010x}", settings_hash(settings)),
        "settings": Lidar(*settings),
        "saved": saved,
        "forgot": args.forget,
        "counters": counters,
    });
    exit::print(&exit::json(&document)?)?;
    Ok(())
}

fn print_text(name: &str, identity: &Identity, settings: &Settings, counters: &Counters) {
    let Greeting { protocol, schema, .. } = Greeting::OURS;
    println!("{name}, protocol {protocol}, schema {schema:#018x}");
    let h = identity.hardware;
    let [from_m, to_m, limit_nj] =
        [h.range_min_mm, h.range_max_mm, h.energy_limit_pj].map(|v| f64::from(v) / 1e3);
    println!("{} bits, {from_m} to {to_m} m, pulses up to {limit_nj} nJ", h.adc_bits);
    println!("beams: {}", beams_of(&identity.pattern));
    println!("\nsettings {:#010x}", settings_hash(settings));
    for parameter in &PARAMETERS {
        println!(
            "{:<22} {:>14}  {}",
            parameter.name,
            shown(parameter, settings.get(parameter.id)),
            range(parameter)
        );
    }
    println!("\n{}", counted(counters));
}

/// What the sensor has counted, in a line; of what goes wrong on a line only what did.
fn counted(counters: &Counters) -> String {
    let usual = [
        (counters.frames, "frames"),
        (counters.refusals, "refused"),
        (counters.restarts, "restarts"),
    ];
    let wrong = [
        (counters.crc_failures, "with a wrong checksum"),
        (counters.cobs_failures, "that were not COBS"),
        (counters.overflows, "too long"),
        (counters.unintelligible, "that were no command"),
        (counters.stale, "out of date"),
        (counters.rollbacks, "trials undone"),
        (counters.echoes, "of its own, given back by the line"),
    ];
    let shown = usual.iter().chain(wrong.iter().filter(|(count, _)| *count > 0));
    shown.map(|(count, what)| format!("{count} {what}")).collect::<Vec<_>>().join(", ")
}

/// The sensor's own settings with what was asked for laid over.
fn asked(source: &ConfigSource, config: &RunConfig, own: Settings) -> Settings {
    if source.config.is_some() || source.run.is_some() {
        return config.lidar.0;
    }
    let mut settings = own;
    for id in source.set.iter().filter_map(|set| set.key("lidar")).filter_map(ParameterId::by_name)
    {
        settings.set(id, config.lidar.0.get(id));
    }
    settings
}

fn shown(parameter: &Parameter, code: Option<i32>) -> String {
    match (code, parameter.kind) {
        (None, _) => "follows".into(),
        (Some(code), Kind::Choice { names, .. }) => {
            names.get(code as usize).unwrap_or(&"?").to_string()
        }
        (Some(code), _) => parameter.to_unit(code).to_string(),
    }
}

fn range(parameter: &Parameter) -> String {
    match parameter.kind {
        Kind::Choice { .. } => choices(parameter).join(", "),
        Kind::PowerOfTwo => format!("1 to {}, powers of two", parameter.max),
        _ => format!(
            "{} to {} {}",
            parameter.to_unit(parameter.min),
            parameter.to_unit(parameter.max),
            parameter.unit
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_went_wrong_on_the_line_is_said_where_something_did() {
        let counters = Counters { frames: 12, restarts: 1, ..Counters::default() };
        assert_eq!(counted(&counters), "12 frames, 0 refused, 1 restarts");
        let bad = Counters { crc_failures: 3, echoes: 2, ..counters };
        let said = "12 frames, 0 refused, 1 restarts, 3 with a wrong checksum, \
                    2 of its own, given back by the line";
        assert_eq!(counted(&bad), said);
    }
}
