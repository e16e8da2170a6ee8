//! Which random numbers a shot has.
//!
//! Sample n of a shot is a pure function of (seed, scan, beam, shot, n): the same on any number of
//! threads, in any order, and for every candidate that asks.

use echoloop_random::{Key, Stream, split_mix_64};

use crate::board::Trigger;

/// The key of a shot's noise. The first shot of a beam has the beam's own, whether others follow or
/// not.
pub fn noise_key(seed: u64, trigger: Trigger) -> Key {
    let Trigger { frame, beam, shot } = trigger;
    let mut key = split_mix_64(split_mix_64(seed) ^ (u64::from(frame) << 32 | u64::from(beam)));
    if shot > 0 {
        key = split_mix_64(key ^ u64::from(shot));
    }
    Key::new(key)
}

/// The key of the samples before this shot's window.
pub fn before_the_trigger(key: Key) -> Key {
    Key::new(split_mix_64(!key.bits()))
}

/// What a stream is for. Values are part of every published result: never renumber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// When the pulse leaves.
    Timing = 1,
    /// Which channels are dead or weak.
    Channels = 2,
    /// Where drops and flakes hang.
    Hydrometeors = 3,
    /// Photon counts of the compatibility mode, in the window.
    Photons = 4,
    /// The same before the trigger.
    PhotonsBefore = 5,
    /// How the sensor shakes.
    Shaking = 6,
}

impl Purpose {
    /// The stream of one shot.
    pub(crate) fn for_shot(self, seed: u64, trigger: Trigger) -> Stream {
        let Trigger { frame, beam, shot } = trigger;
        self.for_number(seed, u64::from(frame) << 32 | u64::from(beam)).part(shot.into())
    }

    /// The stream of anything that has a number.
    pub(crate) fn for_number(self, seed: u64, number: u64) -> Stream {
        Stream::new(seed, self as u64, number)
    }
}

/// The stream of what shakes as one in a scan, by its number.
pub fn shaking(seed: u64, number: u64) -> Stream {
    Purpose::Shaking.for_number(seed, number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shot_and_every_purpose_has_a_stream_of_its_own() {
        let at = |purpose: Purpose, frame, beam, shot| {
            purpose.for_shot(1, Trigger { frame, beam, shot }).uniform(0)
        };
        let streams = [
            at(Purpose::Timing, 0, 0, 0),
            at(Purpose::Photons, 0, 0, 0),
            at(Purpose::Timing, 1, 0, 0),
            at(Purpose::Timing, 0, 1, 0),
            at(Purpose::Timing, 0, 0, 1),
        ];
        for (i, a) in streams.iter().enumerate() {
            assert!(streams[i + 1..].iter().all(|b| a != b));
        }
    }

    #[test]
    fn every_shot_has_noise_of_its_own_in_and_before_its_window() {
        let key = |frame, beam, shot| noise_key(1, Trigger { frame, beam, shot });
        let first = key(0, 0, 0);
        let keys = [first, key(1, 0, 0), key(0, 1, 0), key(0, 0, 1), before_the_trigger(first)];
        for (i, a) in keys.iter().enumerate() {
            assert!(keys[i + 1..].iter().all(|b| a != b));
        }
    }
}
