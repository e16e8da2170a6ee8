//! What the sensor knows between two frames of its link.

use echoloop_dsp::{Pipeline, Settings};
use echoloop_link::Place;

/// What one set of settings turned into, and whose it is.
pub(crate) struct Configured {
    pub(crate) settings: Settings,
    pub(crate) pipeline: Pipeline,
    /// The front end has taken the settings.
    pub(crate) front_end_set: bool,
}

/// How far the row of a scan has come. The shot at hand lies in the sensor's codes, the shots
/// before it in its sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Intake {
    pub(crate) frame: u32,
    pub(crate) next: Place,
}
