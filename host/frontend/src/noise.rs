//! Keys and streams of a shot's random numbers.
//!
//! Sample n of a shot is a pure function of (seed, scan, beam, shot, n): the same on any number of
//! threads, in any order, and for all candidates of an optimiser.

use echoloop_random::{Key, Stream, split_mix_64};

use crate::board::Trigger;

/// Key of a shot's noise. That of a beam's first shot does not depend on how many shots follow.
pub fn noise_key(seed: u64, trigger: Trigger) -> Key {
    let Trigger { frame, beam, shot } = trigger;
    let mut key = split_mix_64(split_mix_64(seed) ^ (u64::from(frame) << 32 | u64::from(beam)));
    if shot > 0 {
        key = split_mix_64(key ^ u64::from(shot));
    }
    Key::new(key)
}

/// Key of the samples before a shot's trigger, from the shot's key.
pub fn before_the_trigger(key: Key) -> Key {
    Key::new(split_mix_64(!key.bits()))
}

/// Purpose of a stream. The numbers are part of every published result: never renumber.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// Jitter of the pulse.
    Timing = 1,
    /// Dead and weak channels.
    Channels = 2,
    /// Positions and sizes of drops and flakes.
    Hydrometeors = 3,
    /// Photon counts of the compatibility mode, in the window.
    Photons = 4,
    /// Photon counts of the compatibility mode, before the trigger.
    PhotonsBefore = 5,
    /// Vibration of the sensor.
    Shaking = 6,
    /// Moments of another LiDAR's pulses.
    OtherLidar = 7,
}

impl Purpose {
    /// Stream of one shot.
    pub(crate) fn for_shot(self, seed: u64, trigger: Trigger) -> Stream {
        let Trigger { frame, beam, shot } = trigger;
        self.for_number(seed, u64::from(frame) << 32 | u64::from(beam)).part(shot.into())
    }

    /// Stream of a numbered item: a beam, a channel, a scan.
    pub(crate) fn for_number(self, seed: u64, number: u64) -> Stream {
        Stream::new(seed, self as u64, number)
    }
}

/// Stream of the vibration of one column of beams, or of one beam, by its number.
pub fn shaking(seed: u64, number: u64) -> Stream {
    Purpose::Shaking.for_number(seed, number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shot_and_every_purpose_has_its_own_stream() {
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
    fn every_shot_has_its_own_noise_in_and_before_its_window() {
        let key = |frame, beam, shot| noise_key(1, Trigger { frame, beam, shot });
        let first = key(0, 0, 0);
        let keys = [first, key(1, 0, 0), key(0, 1, 0), key(0, 0, 1), before_the_trigger(first)];
        for (i, a) in keys.iter().enumerate() {
            assert!(keys[i + 1..].iter().all(|b| a != b));
        }
    }
}
