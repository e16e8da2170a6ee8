//! `echoloop scene`.

use std::path::{Path, PathBuf};

use clap::Args;
use echoloop_parameters::{Bounds, Kind};
use echoloop_registration::pose::{Pose, to_rows};
use echoloop_sim::picture::{Picture, draw};
use echoloop_sim::scene::Material;
use echoloop_sim::viewpoint::Split;
use serde_json::{Value, json};

use super::common::{Common, ConfigSource, on_threads};
use super::exit::{self, Failure, print};
use super::number::{flag, number_as};
use super::progress::Progress;
use super::report::is_standard_output;
use echoloop_closed_loop::checksum::Checksum;
use echoloop_closed_loop::config::RunConfig;
use echoloop_closed_loop::dataset::survey::{Survey, SurveyedPair};
use echoloop_closed_loop::dataset::{Overlaps, towns};
use echoloop_closed_loop::run_folder::files::Output;
use echoloop_report::{ScenePage, ShownPair, fixed, grouped, picture_png};

/// Flags of `scene`.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneArgs {
    /// What to show: as --scene.
    #[arg(value_name = "KIND|FILE", conflicts_with = "scene")]
    what: Option<String>,
    #[command(flatten)]
    source: ConfigSource,
    #[command(flatten)]
    common: Common,
    /// Which of scene.towns, by its seed [default: the first].
    #[arg(long, value_name = "SEED", value_parser = super::number::seed)]
    town: Option<u64>,
    /// Write a page in three dimensions, to open in a browser; `-`: to standard output, instead of
    /// the facts.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a still picture (PNG), from above and beside.
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
    /// Pixels of the picture across; down it has five eighths of them.
    #[arg(long, value_name = "PIXELS", default_value_t = STILL_PX, requires = "picture",
          value_parser = number_as::<usize>(flag(Kind::Whole, Bounds::between(16.0, 8192.0))))]
    width: usize,
}

/// Pixels across of the still picture in a page.
const STILL_PX: usize = 960;

pub(super) fn run(args: &SceneArgs) -> Result<(), Failure> {
    let mut source = args.source.clone();
    source.scene = args.what.clone().or(source.scene);
    let config = source.load(Vec::new())?;
    let outputs = Outputs::of(args)?; // now: large scenes take long
    on_threads(args.common.threads, || show(args, &config, &outputs))?
}

/// The files that are to be written, seen to be free.
struct Outputs {
    page: Option<Output>,
    picture: Option<Output>,
}

impl Outputs {
    fn of(args: &SceneArgs) -> Result<Self, Failure> {
        let page = args.output.as_deref().filter(|path| !is_standard_output(path));
        let picture = args.picture.as_deref().map(picture_output).transpose()?;
        Ok(Self { page: page.map(Output::at).transpose()?, picture })
    }
}

fn picture_output(path: &Path) -> Result<Output, Failure> {
    let output = Output::at(path)?;
    let is_png = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("png"));
    match is_png || output.is_stream() {
        true => Ok(output),
        false => Err(Failure::usage(format_args!(
            "--picture {}: expected a name that ends in .png",
            path.display()
        ))),
    }
}

fn show(args: &SceneArgs, config: &RunConfig, outputs: &Outputs) -> Result<(), Failure> {
    let progress = Progress::new(args.common.quiet);
    let survey = surveyed(args, config, &progress)?;
    if let Some(output) = &outputs.picture {
        output.write(&png(&survey, args.width)?)?;
    }
    if args.output.is_some() {
        let html = page(&survey, config, &progress)?;
        match &outputs.page {
            Some(output) => output.write(html.as_bytes())?,
            None => return print(&html),
        }
    }
    if !args.common.quiet {
        survey.missing.iter().for_each(|why| progress.say(&format!("remark: {why}")));
    }
    print(&told(args, config, &survey)?)
}

fn surveyed(args: &SceneArgs, config: &RunConfig, progress: &Progress) -> Result<Survey, Failure> {
    let towns = towns(config);
    let index = match args.town {
        None => 0,
        Some(town) => towns.iter().position(|&seed| seed == town).ok_or_else(|| {
            let towns = listed(&towns);
            Failure::usage(format_args!("--town {town}: the configuration has the towns {towns}"))
        })?,
    };
    progress.begin("viewpoints", (config.data.train_pairs + config.data.test_pairs) as u64);
    let survey = Survey::of(config, index, &|found, _| progress.at(found as u64));
    progress.end();
    Ok(survey?)
}

fn listed(seeds: &[u64]) -> String {
    seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", ")
}

fn still(survey: &Survey, width: usize) -> Picture {
    draw(&survey.place.scene, &survey.place.caster, [width, (width * 5).div_ceil(8)])
}

/// Pixels across of the picture whose checksum a picture has.
const SMALL_PX: usize = 96;

/// The picture. Its `Source` is a checksum of the scene and one of a small picture of it: by them a
/// picture can be told to be of this scene, and drawn as we draw.
fn png(survey: &Survey, width: usize) -> Result<Vec<u8>, Failure> {
    let [scene, _] = survey.checksums();
    let small = Checksum::of(&[still(survey, SMALL_PX).pixels.as_flattened()]);
    let source = format!("{scene} {small}");
    let said = [("Title", &*survey.place.scene.name), ("Source", &*source)];
    picture_png(&still(survey, width), &said).map_err(Failure::run)
}

fn page(survey: &Survey, config: &RunConfig, progress: &Progress) -> Result<String, Failure> {
    progress.begin("picture", 1);
    let still = still(survey, STILL_PX);
    progress.end();
    let Survey { place, missing, .. } = survey;
    let page = ScenePage {
        title: place.scene.name.clone(),
        subtitle: "A scene, and the pairs of places from which it is scanned.".into(),
        facts: facts(config, survey),
        scene: &place.scene,
        pairs: survey.pairs.iter().map(|pair| shown(survey, pair)).collect(),
        still: &still,
        notes: missing.iter().map(ToString::to_string).collect(),
    };
    page.to_html().map_err(Failure::run)
}

/// What is printed, and stands above a page.
fn facts(config: &RunConfig, survey: &Survey) -> Vec<(String, String)> {
    let (low, high) = survey.place.scene.mesh.bounds().unwrap_or_default();
    let side = |k: usize| fixed(f64::from(high[k]) - f64::from(low[k]), 1);
    let count = |split: Split| survey.of_split(split).count();
    let (train, test) = (count(Split::Train), count(Split::Test));
    let overlap = |split: Split| {
        let Overlaps { overlap: [least, _, median, _, most], .. } = survey.overlaps(split);
        format!("{least:.2} to {most:.2}, median {median:.2}")
    };
    let [scene, pairs] = survey.checksums().map(|sum| sum.to_string());
    let town = survey.town.map(|town| {
        let all = listed(&towns(config));
        ("town", if survey.towns > 1 { format!("{town} of {all}") } else { town.to_string() })
    });
    let apart = survey.least_apart_m().map(|least_m| format!("{} m", fixed(least_m, 2)));
    let facts = [
        ("scene", config.scene.source.clone()),
        ("triangles", grouped(survey.place.scene.mesh.triangles.len())),
        ("extent", format!("{} × {} × {} m", side(0), side(1), side(2))),
        ("viewpoints", (2 * survey.pairs.len()).to_string()),
        ("pairs", format!("{train} training, {test} held-out")),
        ("overlap, training", overlap(Split::Train)),
        ("overlap, held-out", overlap(Split::Test)),
        ("nearest training and held-out", apart.unwrap_or_else(|| "–".into())),
        ("seed", config.seed.to_string()),
        ("checksum of the scene", scene),
        ("checksum of the poses", pairs),
    ];
    let facts = facts.into_iter().flat_map(|fact| match fact.0 {
        "scene" => [Some(fact), town.clone()],
        _ => [Some(fact), None],
    });
    facts.flatten().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn name_of(split: Split) -> &'static str {
    match split {
        Split::Train => "training",
        Split::Test => "held-out",
    }
}

fn shown(survey: &Survey, pair: &SurveyedPair) -> ShownPair {
    let (baseline, turn) = (fixed(pair.baseline_m(), 2), fixed(pair.turn_deg(), 1));
    let is_held_out = pair.split == Split::Test;
    let other = name_of(if is_held_out { Split::Train } else { Split::Test });
    let nearest = survey
        .nearest_other_m(pair)
        .map(|apart_m| format!("; {} m from the nearest {other} viewpoint", fixed(apart_m, 1)));
    let [first, second] = pair.viewpoints;
    let at = |pose: &Pose| pose.translation.vector.into();
    let ahead = |pose: &Pose| (pose.rotation * nalgebra::Vector3::x()).into();
    ShownPair {
        name: format!("{} pair {}", name_of(pair.split), pair.number),
        brief: format!("{baseline} m, {turn}°"),
        told: format!(
            "viewpoints {first} and {second}, {baseline} m apart, turned by {turn}°, overlap \
             {:.2}{}.",
            pair.overlap,
            nearest.unwrap_or_default()
        ),
        is_held_out,
        at_m: pair.world_from_sensor.each_ref().map(at),
        ahead: pair.world_from_sensor.each_ref().map(ahead),
    }
}

fn told(args: &SceneArgs, config: &RunConfig, survey: &Survey) -> Result<String, Failure> {
    if args.common.json {
        let document = document(args, config, survey);
        return exit::json(&document);
    }
    let line = |(name, value): &(String, String)| format!("{name:<31}{value}\n");
    let facts: String = facts(config, survey).iter().map(line).collect();
    let files = args.picture.iter().chain(&args.output);
    let wrote: String = files.map(|path| format!("wrote {}\n", path.display())).collect();
    Ok(facts + &wrote)
}

fn document(args: &SceneArgs, config: &RunConfig, survey: &Survey) -> Value {
    let scene = &survey.place.scene;
    let [of_scene, of_poses] = survey.checksums().map(|sum| sum.to_string());
    let pair = |pair: &SurveyedPair| {
        let rows = |pose: &Pose| to_rows(pose).as_chunks::<4>().0.to_vec();
        json!({
            "set": pair.split.to_string(), "number": pair.number, "viewpoints": pair.viewpoints,
            "baseline_m": pair.baseline_m(), "turn_deg": pair.turn_deg(), "overlap": pair.overlap,
            "nearest_other_m": survey.nearest_other_m(pair),
            "world_from_first": rows(&pair.world_from_sensor[0]),
            "world_from_second": rows(&pair.world_from_sensor[1]),
        })
    };
    json!({
        "format": 1, "scene": scene.name, "source": config.scene.source, "town": survey.town,
        "triangles": scene.mesh.triangles.len(),
        "bounds_m": scene.mesh.bounds().map(|(low, high)| [low, high]),
        "materials": materials(survey), "seed": config.seed,
        "scene_checksum": of_scene, "poses_checksum": of_poses,
        "least_apart_m": survey.least_apart_m(),
        "missing": survey.missing.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "page": args.output, "picture": args.picture,
        "pairs": survey.pairs.iter().map(pair).collect::<Vec<_>>(),
    })
}

/// Those that the scene has, with their triangles.
fn materials(survey: &Survey) -> Vec<Value> {
    let scene = &survey.place.scene;
    let mut counts = vec![0_usize; scene.materials.len()];
    scene.mesh.materials.iter().for_each(|&material| counts[usize::from(material)] += 1);
    let listed = scene.materials.iter().zip(counts).filter(|(_, count)| *count > 0);
    let material = |(material, count): (&Material, usize)| {
        json!({
            "name": material.name, "reflectance_905nm": material.reflectance_905nm,
            "triangles": count,
        })
    };
    listed.map(material).collect()
}
