//! Imperfections of single shots and channels: timing jitter, dead and weak channels.

use crate::board::{Analog, Trigger};
use crate::noise::Purpose;
use crate::receiver::Receiver;

/// A channel of the detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Channel {
    /// Its converter reads 0.
    Dead,
    /// It receives this fraction of the light; 1 when it is intact.
    Alive(f64),
}

impl Receiver {
    /// State of the channel that receives a beam: the channel of the beam's row if rows are known,
    /// else one for each beam.
    ///
    /// The state is drawn once per channel and is the same in every scan.
    pub fn channel(&self, beam: u32) -> Channel {
        if self.dead_channels == 0.0 && self.weak_channels == 0.0 {
            return Channel::Alive(1.0);
        }
        let listed = self.channels.get(beam as usize).map(|channel| u32::from(*channel));
        let in_turn = || beam.checked_rem(self.rows.into()).unwrap_or(beam);
        let row = listed.unwrap_or_else(in_turn);
        let lot = Purpose::Channels.for_number(self.channel_seed, row.into()).uniform(0);
        if lot < self.dead_channels {
            Channel::Dead
        } else if lot < self.dead_channels + self.weak_channels {
            Channel::Alive(libm::pow(10.0, -self.weak_channel_db / 10.0))
        } else {
            Channel::Alive(1.0)
        }
    }

    /// Settings as they affect this shot: a weak channel is less power, a late pulse an earlier
    /// window. `None` for a dead channel.
    pub(crate) fn hear(&self, analog: &Analog, seed: u64, trigger: Trigger) -> Option<Analog> {
        let Channel::Alive(light) = self.channel(trigger.beam) else { return None };
        let mut heard = Analog { power_w: analog.power_w * light, ..*analog };
        if self.timing_jitter_ns > 0.0 {
            let late = Purpose::Timing.for_shot(seed, trigger).normal(0);
            heard.delay_ns -= self.timing_jitter_ns * late;
        }
        Some(heard)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANALOG: Analog = Analog::USUAL;

    #[test]
    fn the_fractions_of_dead_and_weak_channels_are_those_of_the_configuration() {
        let receiver = Receiver {
            dead_channels: 0.1,
            weak_channels: 0.2,
            weak_channel_db: 3.0,
            ..Receiver::default()
        };
        let count = |channel: Channel| {
            (0..20_000).filter(|&beam| receiver.channel(beam) == channel).count()
        };
        let weak = Channel::Alive(libm::pow(10.0, -0.3));
        for (channel, expected) in
            [(Channel::Dead, 2_000.0), (weak, 4_000.0), (Channel::Alive(1.0), 14_000.0)]
        {
            let got = count(channel) as f64;
            assert!((got - expected).abs() < 4.0 * expected.sqrt(), "{channel:?}: {got}");
        }
    }

    #[test]
    fn beams_of_a_row_share_its_channel() {
        let receiver = Receiver { dead_channels: 0.3, rows: 16, ..Receiver::default() };
        assert!((0..16).any(|row| receiver.channel(row) == Channel::Dead));
        for beam in 0..16 * 20 {
            assert_eq!(receiver.channel(beam), receiver.channel(beam % 16), "beam {beam}");
        }
    }

    #[test]
    fn a_listed_beam_has_its_channel_from_the_list() {
        let plain = Receiver { dead_channels: 0.3, rows: 16, ..Receiver::default() };
        let listed = Receiver { channels: [7, 7, 0, 15].into(), ..plain.clone() };
        for (beam, channel) in [(0, 7), (1, 7), (2, 0), (3, 15)] {
            assert_eq!(listed.channel(beam), plain.channel(channel));
        }
        assert!((0..16).any(|row| plain.channel(row) != plain.channel(7)));
    }

    #[test]
    fn an_intact_sensor_leaves_the_settings_unchanged() {
        let trigger = Trigger { frame: 3, beam: 4, shot: 1 };
        assert_eq!(Receiver::default().hear(&ANALOG, 9, trigger), Some(ANALOG));
    }

    #[test]
    fn every_shot_has_its_own_delay_with_the_configured_spread() {
        let receiver = Receiver { timing_jitter_ns: 0.25, ..Receiver::default() };
        let late = |beam, shot| {
            let trigger = Trigger { frame: 0, beam, shot };
            receiver.hear(&ANALOG, 9, trigger).unwrap().delay_ns - 11.0
        };
        assert!(late(0, 0) != late(0, 1));
        let rms = ((0..40_000).map(|beam| late(beam, 0).powi(2)).sum::<f64>() / 40_000.0).sqrt();
        assert!((rms / 0.25 - 1.0).abs() < 0.015, "{rms}"); // four standard errors of 0.35 %
    }
}
