//! Scan of waveforms that the host makes. They are sent in parts, several of them in flight; each
//! is answered by its number with the echoes of the beams that end in it.
//!
//! Lost parts are sent again under new numbers, from the place that the sensor awaits; after lost
//! echoes, from the beginning of their beam. Their waveforms are made again, which depend on scan,
//! beam and shot alone.

use std::collections::VecDeque;
use std::io;

use echoloop_dsp::{Echoes, Settings};
use echoloop_link::packed::{codes_in, pack};
use echoloop_link::{
    BEAMS_PER_REPORT, Command, MAX_FRAME, Nack, PACKED_BYTES, Place, Report, Room,
};

use super::{Client, ClientError};
use crate::transport::Transport;

/// Most parts in flight, whatever room a sensor has: those after a lost one have to leave the line
/// before it is sent again.
const MOST_IN_FLIGHT: u16 = 4;

/// Writes all codes of a shot, by beam and shot.
pub type Shoot<'a> = dyn FnMut(u32, u32, &mut [u16]) -> io::Result<()> + 'a;

impl<T: Transport> Client<T> {
    /// Sends waveforms made by `shoot` as scan `frame`, and returns the echoes of each beam. A shot
    /// has as many codes as the settings committed last say.
    ///
    /// # Errors
    ///
    /// [`ClientError::Room`] when the sensor cannot hold a shot, else as [`Client::scan`]; or from
    /// `shoot`.
    pub fn scan_waveforms(
        &mut self,
        frame: u32,
        room: Room,
        shoot: &mut Shoot<'_>,
    ) -> Result<Vec<Echoes>, ClientError> {
        let settings = self.settings()?;
        let bits = self.identity.hardware.adc_bits;
        let row = Row::new(&settings, self.pattern.beams(), bits, shoot);
        if row.codes.len() as u32 > room.codes {
            return Err(ClientError::Room { room: room.codes, needed: row.codes.len() as u32 });
        }
        Feed::new(frame, room, row).run(self)
    }
}

/// Codes of a scan in their order, made shot by shot.
struct Row<'a> {
    beams: u32,
    shots: u16,
    bits: u32,
    shoot: &'a mut Shoot<'a>,
    /// Beam and shot of the codes below.
    made: Option<(u32, u16)>,
    codes: Vec<u16>,
}

/// Part of a scan that fits a frame.
struct Part {
    from: Place,
    to: Place,
    /// Number of beams that end in it.
    ended: usize,
    packed: Vec<u8>,
    /// Number of its frame, once it is sent.
    sequence: u16,
}

impl<'a> Row<'a> {
    fn new(settings: &Settings, beams: u32, bits: u32, shoot: &'a mut Shoot<'_>) -> Self {
        let samples = settings.pre_trigger_samples() + settings.bins as u32;
        let codes = vec![0; samples as usize];
        Self { beams, shots: settings.shots as u16, bits, shoot, made: None, codes }
    }

    /// Part from a place on, as much as a frame holds.
    fn part(&mut self, from: Place) -> io::Result<Part> {
        let (mut to, mut ended) = (from, 0);
        let mut left = codes_in(PACKED_BYTES, self.bits);
        let mut row = Vec::with_capacity(left);
        while left > 0 && to.beam < self.beams && ended < BEAMS_PER_REPORT {
            self.make(to.beam, to.shot)?;
            let rest = &self.codes[usize::from(to.sample)..];
            let taken = &rest[..rest.len().min(left)];
            row.extend(taken);
            left -= taken.len();
            if taken.len() < rest.len() {
                to.sample += taken.len() as u16;
                continue;
            }
            to = self.after_shot(to);
            ended += usize::from(to.begins_beam());
        }
        let mut packed = vec![0; PACKED_BYTES];
        let length = pack(&row, self.bits, &mut packed).unwrap_or(0); // never too many: `codes_in`
        packed.truncate(length);
        Ok(Part { from, to, ended, packed, sequence: 0 })
    }

    fn make(&mut self, beam: u32, shot: u16) -> io::Result<()> {
        if self.made != Some((beam, shot)) {
            self.made = None;
            (self.shoot)(beam, shot.into(), &mut self.codes)?;
            self.made = Some((beam, shot));
        }
        Ok(())
    }

    fn after_shot(&self, Place { beam, shot, .. }: Place) -> Place {
        match shot + 1 {
            next if next < self.shots => Place { beam, shot: next, sample: 0 },
            _ => Place::of_beam(beam + 1),
        }
    }
}

/// Next step after the answers that came.
enum Step {
    /// Continue: answers to parts in flight were taken.
    On,
    /// Something was lost: send again from here.
    Back(Place),
}

/// Scan being sent.
struct Feed<'a> {
    frame: u32,
    /// Most parts in flight.
    window: usize,
    row: Row<'a>,
    /// Place that the next part begins at.
    next: Place,
    /// Next part, made while others are in flight.
    ready: Option<Part>,
    in_flight: VecDeque<Part>,
    scan: Vec<Echoes>,
    /// Number of times it went back since the last echoes were taken.
    tries: u32,
}

impl<'a> Feed<'a> {
    fn new(frame: u32, room: Room, row: Row<'a>) -> Self {
        Self {
            frame,
            window: room.frames.clamp(1, MOST_IN_FLIGHT).into(),
            scan: Vec::with_capacity(row.beams as usize),
            row,
            next: Place::default(),
            ready: None,
            in_flight: VecDeque::new(),
            tries: 0,
        }
    }

    fn run<T: Transport>(mut self, client: &mut Client<T>) -> Result<Vec<Echoes>, ClientError> {
        while self.scan.len() < self.row.beams as usize {
            self.make_ready()?;
            if self.in_flight.len() < self.window
                && let Some(part) = self.ready.take()
            {
                self.send(client, part)?;
                continue;
            }
            match self.hear(client)? {
                Step::On => {}
                Step::Back(_) if self.tries + 1 >= client.retry_policy.tries => {
                    return Err(client.silent("waveforms"));
                }
                Step::Back(place) => self.go_back(client, place)?,
            }
        }
        Ok(self.scan)
    }

    fn make_ready(&mut self) -> io::Result<()> {
        if self.ready.is_none() && self.next.beam < self.row.beams {
            let part = self.row.part(self.next)?;
            self.next = part.to;
            self.ready = Some(part);
        }
        Ok(())
    }

    fn send<T: Transport>(
        &mut self,
        client: &mut Client<T>,
        mut part: Part,
    ) -> Result<(), ClientError> {
        let Part { from, packed, .. } = &part;
        let command = Command::Waveforms { frame: self.frame, from: *from, packed };
        let mut frame = [0; MAX_FRAME];
        let bytes = client.numbered(&command, &mut frame)?;
        client.transport.send(bytes)?;
        part.sequence = client.sequence;
        self.in_flight.push_back(part);
        Ok(())
    }

    /// Gives up all parts in flight, and continues from `place`. First waits for their answers: on
    /// a slow line those of the next part come after them, later than a timeout.
    fn go_back<T: Transport>(
        &mut self,
        client: &mut Client<T>,
        place: Place,
    ) -> Result<(), ClientError> {
        (self.tries, self.next, self.ready) = (self.tries + 1, place, None);
        let mut given_up: VecDeque<u16> =
            self.in_flight.drain(..).map(|part| part.sequence).collect();
        while !given_up.is_empty() {
            let answers = client.listen(|of| given_up.contains(&of))?;
            let Some((newest, _)) = answers.last() else { break };
            let at = given_up.iter().position(|of| of == newest).unwrap_or_default();
            given_up.drain(..=at);
        }
        Ok(())
    }

    /// Waits for answers to parts in flight.
    fn hear<T: Transport>(&mut self, client: &mut Client<T>) -> Result<Step, ClientError> {
        let numbers: Vec<u16> = self.in_flight.iter().map(|part| part.sequence).collect();
        let answers = client.listen(|of| numbers.contains(&of))?;
        if answers.is_empty() {
            let first = self.in_flight.front().map_or(self.next, |part| part.from);
            self.in_flight.clear(); // none was answered within the timeout
            return Ok(Step::Back(first));
        }
        for (sequence, report) in answers {
            if let back @ Step::Back(_) = self.take(client, sequence, report)? {
                return Ok(back);
            }
        }
        Ok(Step::On)
    }

    fn take<T: Transport>(
        &mut self,
        client: &mut Client<T>,
        sequence: u16,
        report: Report,
    ) -> Result<Step, ClientError> {
        let Some(at) = self.in_flight.iter().position(|part| part.sequence == sequence) else {
            return Ok(Step::On); // answered twice
        };
        let Part { from, ended, .. } = self.in_flight[at];
        let before: usize = self.in_flight.drain(..=at).take(at).map(|part| part.ended).sum();
        match report {
            Report::Nack(Nack::Awaited { place }) => return Ok(Step::Back(self.resumed_at(place))),
            Report::Nack(reason) => {
                client.unsure |= reason == Nack::NotReady;
                return Err(ClientError::Nack(reason));
            }
            _ => {}
        }
        let beams = client.beams(report, self.frame, from.beam, ended)?;
        if before > 0 {
            // The sensor took the parts before it, or it would not take this one: answers were
            // lost.
            return Ok(Step::Back(self.first_missing()));
        }
        self.scan.extend(beams);
        self.tries = 0;
        Ok(Step::On)
    }

    /// Place to continue from when the sensor awaits `place`.
    fn resumed_at(&self, place: Place) -> Place {
        let missing = self.first_missing();
        if place.beam == missing.beam { place } else { missing }
    }

    /// First beam without echoes.
    fn first_missing(&self) -> Place {
        Place::of_beam(self.scan.len() as u32)
    }
}
