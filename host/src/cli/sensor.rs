//! `echoloop sensor`.

use std::sync::Arc;

use clap::Args;
use echoloop_dsp::{Hardware, Kind, PARAMETERS, Parameter};
use echoloop_link::Greeting;
use echoloop_sim::board::PcSensor;
use echoloop_sim::scanner::SceneResponse;

use super::exit::Failure;
use super::figures::choices;
use super::{Common, ConfigSource};
use crate::client::{Client, Patience};
use crate::config::Lidar;
use crate::frontend::WaveformFrontEnd;
use crate::transport::InProcess;

/// Flags of `sensor`. `--set lidar.power=50` and the like are sent to the sensor, which checks them itself.
#[derive(Clone, Debug, Args)]
pub(crate) struct SensorArgs {
    #[command(flatten)]
    source: ConfigSource,
    #[command(flatten)]
    common: Common,
}

pub(super) fn run(args: &SensorArgs) -> Result<(), Failure> {
    let config = args.source.load(Vec::new())?;
    let hardware = Hardware { adc_bits: config.receiver.adc_bits, ..Hardware::REFERENCE };
    let nothing = Arc::new(SceneResponse::default());
    let front_end = WaveformFrontEnd::new(config.receiver.clone(), nothing, config.seed);
    let sensor = PcSensor::new(front_end, config.scanner.pattern(), hardware);
    let mut client = Client::connect(InProcess(sensor), Patience::default())?;
    let hash = client.configure(&config.lidar.0)?;
    let settings = client.read_settings()?;
    let counters = client.read_counters()?;
    let identity = client.identity();
    if args.common.json {
        let document = serde_json::json!({
            "format": 1, "build": identity.build, "protocol": Greeting::OURS.protocol,
            "schema": format!("{:#018x}", Greeting::OURS.schema), "hardware": identity.hardware,
            "pattern": identity.pattern, "hash": format!("{hash:#010x}"), "settings": Lidar(settings),
            "counters": counters,
        });
        println!("{}", serde_json::to_string_pretty(&document).map_err(Failure::run)?);
        return Ok(());
    }
    println!("{}, protocol {}, schema {:#018x}", identity.build, Greeting::OURS.protocol, Greeting::OURS.schema);
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
    println!("\n{} frames, {} refused", counters.frames, counters.refusals);
    Ok(())
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
