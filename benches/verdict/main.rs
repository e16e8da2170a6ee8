//! The verdicts of `register` on pairs of known motion.
//!
//! usage: verdict FOLDER..., each of `echoloop pairs`, `extruded.py` or `maps.py`; registers every
//! pair by `auto` from the identity, as `register` does. Prints the number of right motions (0.5 m,
//! 2.5°), of those refused, of wrong ones accepted, and of scans that leave a direction open.

use std::path::Path;

use echoloop_benches::pairs::{Pair, read_pairs};
use echoloop_clouds::pose::{Pose, rotation_error_deg, translation_error_m};
use echoloop_registration::{
    ConfigError, FgrMode, Method, Registration, StopReason, Suggestions, build,
};
use rayon::prelude::*;

/// A pair's outcome: whether the motion is right, and the reason of its end.
type Judged = (bool, StopReason);

fn judged(Pair { target, source, truth }: &Pair) -> Result<Judged, ConfigError> {
    let config = Suggestions::new(target, source).method(Method::Auto, FgrMode::Annealed, None);
    let outcome = build(&config, None)?.register(target, source, &Pose::identity());
    let found = &outcome.target_from_source;
    let is_right =
        translation_error_m(found, truth) <= 0.5 && rotation_error_deg(found, truth) <= 2.5;
    Ok((is_right, outcome.stop))
}

fn main() -> echoloop_benches::Result<()> {
    println!("| folder | pairs | right | of them refused | wrong accepted | degenerate |");
    println!("|---|---|---|---|---|---|");
    for folder in std::env::args().skip(1) {
        let pairs = read_pairs(Path::new(&folder))?;
        let all: Vec<Judged> = pairs.par_iter().map(judged).collect::<Result<_, _>>()?;
        let count = |of: fn(&Judged) -> bool| all.iter().filter(|judged| of(judged)).count();
        println!(
            "| {folder} | {} | {} | {} | {} | {} |",
            all.len(),
            count(|(is_right, _)| *is_right),
            count(|(is_right, stop)| *is_right && !stop.is_success()),
            count(|(is_right, stop)| !is_right && stop.is_success()),
            count(|(_, stop)| *stop == StopReason::Degenerate),
        );
    }
    Ok(())
}
