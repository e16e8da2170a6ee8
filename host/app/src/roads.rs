//! `echoloop roads`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};
use echoloop_parameters::{Bounds, Kind};
use echoloop_sim::roads::{LaneKind, RoadNetwork, Waypoint, load_network};
use serde_json::{Value, json};

use super::common::Common;
use super::exit::{self, Failure};
use super::number::{flag, read};
use echoloop_closed_loop::dataset::source::Source;
use echoloop_closed_loop::run_folder::files::Output;

/// Default of `--step`, m.
const STEP_M: f64 = 2.0;

/// Flags of `roads`.
#[derive(Clone, Debug, Args)]
pub(crate) struct RoadsArgs {
    #[command(flatten)]
    common: Common,
    /// An OpenDRIVE file (.xodr), or the name of a town on roads, as town01 or old-town.
    #[arg(value_name = "TOWN|FILE", value_hint = ValueHint::FilePath)]
    source: String,
    /// Metres from waypoint to waypoint in the .csv, along each road; 2 where not given.
    #[arg(long, value_name = "METRES", value_parser = step)]
    step: Option<f64>,
    /// File to write: waypoints as .csv; of a town of ours its roads as .xodr.
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    output: Option<PathBuf>,
}

fn step(text: &str) -> Result<f64, String> {
    read(&flag(Kind::Number, Bounds::between(0.1, 1000.0)), text)
}

/// Content of `--output`, by the ending of its name.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Written {
    Waypoints,
    Roads,
}

impl Written {
    fn at(path: &Path) -> Result<Self, Failure> {
        match path.extension().and_then(|end| end.to_str()) {
            Some("csv") => Ok(Self::Waypoints),
            Some("xodr") => Ok(Self::Roads),
            _ => {
                let what = "its name must end in .csv or .xodr";
                Err(Failure::usage(format!("{}: {what}", path.display())))
            }
        }
    }
}

pub(super) fn run(args: &RoadsArgs) -> Result<(), Failure> {
    let written = args.output.as_deref().map(Written::at).transpose()?;
    if args.step.is_some() && written != Some(Written::Waypoints) {
        return Err(Failure::usage("--step is of waypoints: expected -o FILE.csv with it"));
    }
    let output = args.output.as_deref().map(Output::at).transpose()?;
    let (network, drawn) = network(&args.source)?;
    if let (Some(output), Some(written), Some(path)) = (output, written, &args.output) {
        let text = match written {
            Written::Waypoints => waypoints(&network, args.step.unwrap_or(STEP_M)),
            Written::Roads => drawn.ok_or_else(|| {
                let of = "roads are written of old-town, garden-suburb and hillside";
                Failure::usage(format!("{}: {of}; others have a file", path.display()))
            })?,
        };
        output.write(text.as_bytes())?;
    }
    if args.common.json {
        return exit::print(&exit::json(&document(&network))?);
    }
    let wrote = args.output.iter().map(|path| format!("wrote {}\n", path.display()));
    exit::print(&(lines(&network) + &wrote.collect::<String>()))
}

/// Roads of a town or a file; for a drawn town, also their OpenDRIVE text.
fn network(source: &str) -> Result<(RoadNetwork, Option<String>), Failure> {
    let found = Source::of(source);
    let drawn = match &found {
        Source::Town(town) => town.drawn(),
        Source::Roads(_) => None,
        _ => {
            let what = "is no road network: expected FILE.xodr or a town on roads";
            return Err(Failure::usage(format!("{} {what}", echoloop_files::one_line(source))));
        }
    };
    let network = match (&drawn, found.file()) {
        (Some(text), _) => RoadNetwork::parse(source, text).map_err(Failure::usage)?,
        (None, Some(path)) => load_network(&path).map_err(Failure::usage)?,
        (None, None) => {
            let what = "has no roads, or its file is not known: ECHOLOOP_DATA names the folder in \
                        which carla_xodr lies";
            return Err(Failure::usage(format!("{source} {what}")));
        }
    };
    Ok((network, drawn))
}

fn counted(network: &RoadNetwork) -> Vec<(&'static str, usize)> {
    let count = |kind| network.lanes.iter().filter(|lane| lane.kind == kind).count();
    let named = LaneKind::NAMED.map(|(kind, name)| (name, count(kind)));
    named.into_iter().filter(|(_, n)| *n > 0).collect()
}

fn lines(network: &RoadNetwork) -> String {
    let (low, high) = network.bounds();
    let mut text = format!(
        "{}: {} roads of {:.2} km, {:.0} m × {:.0} m\n",
        network.name,
        network.roads(),
        network.length_m / 1000.0,
        high[0] - low[0],
        high[1] - low[1]
    );
    let lanes: Vec<String> =
        counted(network).iter().map(|(kind, n)| format!("{n} {kind}")).collect();
    let _ = writeln!(text, "lanes: {}", lanes.join(", "));
    let _ = writeln!(
        text,
        "{} lead from lane to lane; {} lights and signs, {} objects",
        network.topology().len(),
        network.signs.len(),
        network.props.len()
    );
    if !network.remarks.is_empty() {
        let _ = writeln!(text, "{} remarks, listed by --json", network.remarks.len());
    }
    text
}

fn document(network: &RoadNetwork) -> Value {
    let lanes: serde_json::Map<String, Value> =
        counted(network).into_iter().map(|(kind, n)| (kind.into(), n.into())).collect();
    let topology: Vec<[[f64; 3]; 2]> =
        network.topology().iter().map(|pair| pair.map(|place| place.at)).collect();
    json!({
        "format": 1,
        "name": network.name,
        "roads": network.roads(),
        "length_m": network.length_m,
        "lanes": lanes,
        "remarks": network.remarks,
        "topology": topology,
    })
}

/// CSV of waypoints: right-handed metres, degrees counter-clockwise from x.
fn waypoints(network: &RoadNetwork, step_m: f64) -> String {
    let mut text =
        String::from("road_id,section_id,lane_id,s,x,y,z,heading_deg,rise,width,in_junction\n");
    for Waypoint { lane, s_m, at: [x, y, z], heading_rad, rise, width_m } in
        network.waypoints(step_m)
    {
        let lane = &network.lanes[lane];
        let _ = writeln!(
            text,
            "{},{},{},{s_m:.3},{x:.4},{y:.4},{z:.4},{:.4},{rise:.6},{width_m:.3},{}",
            lane.road,
            lane.section,
            lane.id,
            heading_rad.to_degrees(),
            u8::from(lane.in_junction)
        );
    }
    text
}
