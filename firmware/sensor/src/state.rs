//! State of the sensor between two frames of its link.

use echoloop_dsp::{Pipeline, ScanPattern, Settings};
use echoloop_link::Place;

/// Settings, and the pipeline configured for them.
pub(crate) struct Configured {
    pub(crate) settings: Settings,
    pub(crate) pipeline: Pipeline,
    /// Scan pattern with the aim of the settings.
    pub(crate) pattern: ScanPattern,
    /// True when the front end has the settings.
    pub(crate) front_end_set: bool,
}

/// Progress of a scan whose codes come over the link. The current shot is in the sensor's codes,
/// the shots before it in its sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Intake {
    pub(crate) frame: u32,
    pub(crate) next: Place,
}
