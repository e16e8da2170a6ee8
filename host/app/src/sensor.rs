//! `echoloop sensor`.

use clap::Args;
use echoloop_dsp::{PARAMETERS, ParameterId, Settings};
use echoloop_link::{Counters, Greeting, settings_hash};

use super::common::{ConfigSource, Setup};
use super::exit::{self, Failure};
use echoloop_closed_loop::config::{Lidar, RunConfig};
use echoloop_sensors::client::Identity;
use echoloop_sensors::pattern::document;
use echoloop_sensors::sensor::Model;
use echoloop_sensors::wording::{
    changed_settings, counters_text, range_text, settings_text, value_text,
};

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
        let own = sensor.client.read_settings()?;
        let settings = wanted(&args.setup.source, &config, own);
        if settings != own {
            sensor.configure(&settings)?;
        }
        match (args.save, args.forget) {
            (true, _) => drop(sensor.client.save()?),
            (_, true) => sensor.client.forget()?,
            _ => {}
        }
        Ok((sensor.client.read_settings()?, sensor.client.read_counters()?))
    })?;
    let name = sensors.described(&identity);
    if args.setup.common.json {
        return print_json(args, (&name, &identity), &settings, &counters);
    }
    print_text(&name, &identity, &settings, &counters);
    print!("{}", args.outcome(&settings));
    Ok(())
}

impl SensorArgs {
    /// Result of --save or --forget, in a line.
    fn outcome(&self, settings: &Settings) -> String {
        match (self.save, self.forget) {
            (true, _) => {
                format!("\nsaved {:#010x}: {}\n", settings_hash(settings), settings_text(settings))
            }
            (_, true) => "\nforgot what was saved: its next start is with its defaults\n".into(),
            _ => String::new(),
        }
    }
}

fn print_json(
    args: &SensorArgs,
    (name, identity): (&str, &Identity),
    settings: &Settings,
    counters: &Counters,
) -> Result<(), Failure> {
    let saved = args.save.then(|| changed_settings(settings).map(|p| p.name).collect::<Vec<_>>());
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
    exit::print_json(&document)
}

fn print_text(name: &str, identity: &Identity, settings: &Settings, counters: &Counters) {
    let Greeting { protocol, schema, .. } = Greeting::OURS;
    println!("{name}, protocol {protocol}, schema {schema:#018x}");
    let h = identity.hardware;
    let [from_m, to_m, limit_nj] =
        [h.range_min_mm, h.range_max_mm, h.energy_limit_pj].map(|v| f64::from(v) / 1e3);
    println!("{} bits, {from_m} to {to_m} m, pulses up to {limit_nj} nJ", h.adc_bits);
    println!("beams: {}", identity.pattern);
    println!("\nsettings {:#010x}", settings_hash(settings));
    for parameter in &PARAMETERS {
        println!(
            "{:<22} {:>14}  {}",
            parameter.name,
            value_text(parameter, settings.get(parameter.id)),
            range_text(parameter)
        );
    }
    println!("\n{}", counters_text(counters));
}

/// The sensor's own settings, with those of the flags or the file laid over.
fn wanted(source: &ConfigSource, config: &RunConfig, own: Settings) -> Settings {
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
