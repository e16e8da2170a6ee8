//! Waveforms that come over the link instead of from a converter: the codes of a scan come in
//! parts.

use echoloop_dsp::{Echoes, PARAMETERS, ParameterId};
use echoloop_link::packed::{self, Codes};
use echoloop_link::{BEAMS_PER_REPORT, MAX_PAYLOAD, Nack, Place, Report};
use heapless::Vec;

use crate::app::App;
use crate::board::Board;
use crate::state::Intake;

/// Lowest number of samples of a shot.
#[expect(clippy::indexing_slicing, reason = "evaluated at compile time")]
const FEWEST: usize = PARAMETERS[ParameterId::WaveformResolution as usize].min as usize;

// A code has at least 8 bits: the beams that end in a frame fit a report.
const _: () = assert!(MAX_PAYLOAD / FEWEST < BEAMS_PER_REPORT);

impl<B: Board> App<B> {
    /// Takes a part of a scan and reports the echoes of the beams that end in it.
    ///
    /// A part that does not continue the last one changes nothing, so a part that comes twice does
    /// no harm. A beam may be restarted: its echoes are the same again.
    // Not inlined, like `measure`.
    #[inline(never)]
    pub(crate) fn take_codes(&mut self, frame: u32, from: Place, packed: &[u8]) -> Report {
        if let Err(reason) = self.accept(frame, from, packed) {
            return Report::Nack(reason);
        }
        let mut beams: Vec<Echoes, BEAMS_PER_REPORT> = Vec::new();
        let mut codes = packed::unpack(packed, self.board.hardware().adc_bits);
        while let Some(shot) = self.take_shot(&mut codes) {
            if let Some(echoes) = self.end_beam_with(shot) {
                let _ = beams.push(echoes); // no more end in it than fit, above
            }
            self.board.feed_watchdog();
        }
        self.measured(frame, from.beam, beams)
    }

    /// Accepts a part that continues the last one or restarts a beam.
    fn accept(&mut self, frame: u32, from: Place, packed: &[u8]) -> Result<(), Nack> {
        self.configure().map_err(|_| Nack::FrontEnd)?;
        let here = Intake { frame, next: from };
        if !from.begins_beam() && self.intake != Some(here) {
            return Err(Nack::Awaited { place: self.awaited(frame, from) });
        }
        self.check_end(from, packed)?;
        self.intake = Some(here);
        Ok(())
    }

    /// Fills the current shot and returns its number; `None` when there are not enough codes.
    fn take_shot(&mut self, codes: &mut Codes<'_>) -> Option<u32> {
        let (samples, next) = (self.samples()?, &mut self.intake.as_mut()?.next);
        let missing = self.codes.get_mut(usize::from(next.sample)..samples)?;
        let filled = codes.fill(missing);
        next.sample = next.sample.saturating_add(filled as u16); // at most MAX_CODES
        (filled == missing.len()).then_some(next.shot.into())
    }

    /// Ends a shot; returns the echoes of the beam when it was the last one.
    fn end_beam_with(&mut self, shot: u32) -> Option<Echoes> {
        self.end_shot(shot);
        let last = shot.saturating_add(1) >= self.shots()?;
        let next = &mut self.intake.as_mut()?.next;
        *next = match last {
            true => Place::of_beam(next.beam.saturating_add(1)),
            false => Place { shot: next.shot.saturating_add(1), sample: 0, ..*next },
        };
        if last { self.detect() } else { None }
    }

    /// Number of codes of a shot.
    fn samples(&self) -> Option<usize> {
        self.configured.as_ref().map(|c| c.pipeline.config().codes())
    }

    /// Number of shots of a beam.
    fn shots(&self) -> Option<u32> {
        self.configured.as_ref().map(|c| c.pipeline.config().shots)
    }

    /// Place at which the codes continue; in another scan, the beginning of its beam.
    fn awaited(&self, frame: u32, from: Place) -> Place {
        let here = self.intake.filter(|intake| intake.frame == frame);
        here.map_or(Place::of_beam(from.beam), |intake| intake.next)
    }

    /// Checks that a part ends within the scan.
    fn check_end(&self, from: Place, packed: &[u8]) -> Result<(), Nack> {
        let (Some(samples), Some(shots)) = (self.samples(), self.shots()) else {
            return Err(Nack::FrontEnd);
        };
        let before = (samples as u32).saturating_mul(from.shot.into());
        let codes = packed::codes_in(packed.len(), self.board.hardware().adc_bits) as u32;
        let end = before.saturating_add(from.sample.into()).saturating_add(codes);
        let of_beam = (samples as u32).saturating_mul(shots).max(1);
        let (touched, beams) = (end.div_ceil(of_beam), self.session.pattern().beams());
        match from.beam.saturating_add(touched) <= beams {
            true => Ok(()),
            false => Err(Nack::NoSuchBeams { beams }),
        }
    }
}
