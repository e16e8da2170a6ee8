//! The trait of all methods: two clouds and an initial guess in, an outcome out.

use echoloop_clouds::{Cloud, Pose};

use crate::Outcome;

/// A registration method: finds the motion that brings `source` onto `target`, `f_reg` of Eq. 2.
pub trait Registration: Send + Sync {
    /// Registers two clouds, each in the frame of its sensor. Never fails: a poor match is an
    /// [`Outcome`] with the reason of its end. `initial` is the initial guess of
    /// `target_from_source`, which global methods ignore.
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome;
}

impl<R: Registration + ?Sized> Registration for Box<R> {
    fn register(&self, target: &Cloud, source: &Cloud, initial: &Pose) -> Outcome {
        self.as_ref().register(target, source, initial)
    }
}
