//! The verdicts of `register` on pairs of known motion.
//!
//! usage: verdict FOLDER..., each of `echoloop pairs` or of `extruded.py`; registers every pair by
//! `auto` from the identity, as `register` does. Prints the number of right motions (0.5 m, 2.5°),
//! of those refused, of wrong ones accepted, and of scans that leave a direction open.

use std::error::Error;
use std::path::Path;

use echoloop_clouds::pose::{Pose, read_pose, rotation_error_deg, translation_error_m};
use echoloop_clouds::read_cloud;
use echoloop_registration::{FgrMode, Method, Registration, StopReason, Suggestions, build};
use rayon::prelude::*;

/// A pair's outcome: whether the motion is right, and the reason of its end.
type Judged = (bool, StopReason);

fn judged(folder: &Path, name: &str) -> Result<Judged, String> {
    let at = |end: &str| folder.join(format!("{name}_{end}"));
    let cloud = |end: &str| read_cloud(&at(end)).map(|(cloud, _)| cloud);
    let read = || -> Result<_, Box<dyn Error>> {
        let truth = read_pose(&at("target_from_source.txt"))?;
        Ok((cloud("target.ply")?, cloud("source.ply")?, truth))
    };
    let (target, source, truth) = read().map_err(|error| error.to_string())?;
    let config = Suggestions::new(&target, &source).method(Method::Auto, FgrMode::Annealed, None);
    let method = build(&config, None).map_err(|error| error.to_string())?;
    let outcome = method.register(&target, &source, &Pose::identity());
    let found = &outcome.target_from_source;
    let is_right =
        translation_error_m(found, &truth) <= 0.5 && rotation_error_deg(found, &truth) <= 2.5;
    Ok((is_right, outcome.stop))
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("| folder | pairs | right | of them refused | wrong accepted | degenerate |");
    println!("|---|---|---|---|---|---|");
    for folder in std::env::args().skip(1) {
        let folder = Path::new(&folder);
        let text = std::fs::read_to_string(folder.join("pairs.json"))?;
        let document: serde_json::Value = serde_json::from_str(&text)?;
        let entries = document["pairs"].as_array().ok_or("pairs.json lists no pairs")?;
        let name = |entry: &serde_json::Value| entry["name"].as_str().map(str::to_owned);
        let names: Vec<String> =
            entries.iter().map(name).collect::<Option<_>>().ok_or("a pair has no name")?;
        let all: Vec<Judged> =
            names.par_iter().map(|name| judged(folder, name)).collect::<Result<_, _>>()?;
        let count = |of: fn(&Judged) -> bool| all.iter().filter(|judged| of(judged)).count();
        println!(
            "| {} | {} | {} | {} | {} | {} |",
            folder.display(),
            all.len(),
            count(|(is_right, _)| *is_right),
            count(|(is_right, stop)| *is_right && !stop.is_success()),
            count(|(is_right, stop)| !is_right && stop.is_success()),
            count(|(_, stop)| *stop == StopReason::Degenerate),
        );
    }
    Ok(())
}
