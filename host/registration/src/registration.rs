//! What every method is: two clouds and a start in, an outcome out.

use crate::Outcome;
use echoloop_clouds::Cloud;
use echoloop_clouds::Pose;

/// Finds the motion that lays `source` on `target`: `f_reg` of Eq. 2.
pub trait Registration: Send + Sync {
    /// Never fails: a poor match is an [`Outcome`] that says why it stopped. Both clouds are in the
    /// frames of their sensors. `initial` is where to start, `target_from_source`; methods that
    /// search the whole space ignore it.
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome;
}

impl<R: Registration + ?Sized> Registration for Box<R> {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        self.as_ref().register(target, source, initial)
    }
}
