//! Where the beams go, with the default and tuned: the target scan of the shown pair.

use super::Report;
use crate::panorama::{Panorama, panels};

/// The two panoramas; nothing of beams that are gone with their file or were recorded, and for an
/// aim that the pattern refuses.
pub(super) fn section(report: &Report) -> String {
    let [[before, _], [after, _]] = &report.clouds;
    let result = &report.run.result;
    let panel = |title, values, cloud| {
        let beams = report.run.config.aimed(values)?;
        Some(Panorama::new(title, &beams, cloud))
    };
    let both = [panel("Default", &result.default, before), panel("Tuned", &result.tuned, after)];
    let [Some(before), Some(after)] = both else { return String::new() };
    format!(
        "<section id=\"beams\"><h2>Where the beams go</h2><p class=\"lead\">The target scan of the \
         pair below, as the sensor sees it: ahead in the middle, behind at both ends.</p>{}\
         </section>\n",
        panels(&[before, after], "echoes")
    )
}
