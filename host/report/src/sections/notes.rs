//! Remarks.

use echoloop_closed_loop::config::FgrMode;

use crate::finished_runs::Known;
use crate::page::notes_section;

/// Remarks on a finished run.
pub(super) fn section(config: &Known) -> String {
    let mut notes = vec![
        "Every scan went through the sensor's firmware: settings and echoes as frames of its \
         link, echoes by its fixed-point detector."
            .to_owned(),
        "A registration that finds nothing counts as its initial guess, the identity.".to_owned(),
        "The held-out pairs are of other viewpoints of the same towns.".to_owned(),
    ];
    if config.registration.mode == FgrMode::Open3d {
        notes.push(
            "FGR as Open3D 0.20 runs it from Python with its defaults: without graduated \
             non-convexity, from a wrong start. It is the paper's baseline, not the published \
             method; that is mode annealed."
                .to_owned(),
        );
    }
    if config.tune.error_cap > 0.0 {
        notes.push(format!(
            "The search caps a pair's error at {} (the paper does not; tune.error_cap = 0 is its \
             way). The tables do not.",
            config.tune.error_cap
        ));
    }
    notes_section(&notes)
}
