//! A scan of waveforms that the host has: sent in parts, several of them under way, each answered
//! by its number with the echoes of the beams that end in it.
//!
//! What is lost is sent again under new numbers, from where the sensor says that it goes on; when
//! it is echoes that were lost, from the beginning of their beam. Waveforms are made anew for that:
//! they depend on scan, beam and shot alone.

use std::collections::VecDeque;
use std::io;

use echoloop_dsp::{Echoes, Settings};
use echoloop_link::packed::{codes_in, pack};
use echoloop_link::{
    BEAMS_PER_REPORT, Command, MAX_FRAME, Nack, PACKED_BYTES, Place, Report, Room,
};

use super::{Client, ClientError};
use crate::transport::Transport;

/// Parts under way at most, whatever a sensor has room for: what follows a lost one has to leave
/// the line before it is sent again.
const MOST_UNDER_WAY: u16 = 4;

/// Makes all codes of a shot, by beam and shot.
pub type Shoot<'a> = dyn FnMut(u32, u32, &mut [u16]) -> io::Result<()> + 'a;

impl<T: Transport> Client<T> {
    /// Has the sensor find the echoes of waveforms that are made here, as scan `frame`, beam by
    /// beam. Each shot has as many codes as the settings committed last make.
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
        let row = Row::new(&settings, self.identity.pattern.beams(), bits, shoot);
        if row.codes.len() as u32 > room.codes {
            return Err(ClientError::Room { room: room.codes, needed: row.codes.len() as u32 });
        }
        Feed::new(frame, room, row).run(self)
    }
}

/// Codes of a scan, one after the other.
struct Row<'a> {
    beams: u32,
    shots: u16,
    bits: u32,
    shoot: &'a mut Shoot<'a>,
    /// Beam and shot whose codes these are.
    made: Option<(u32, u16)>,
    codes: Vec<u16>,
}

/// A part of a scan.
struct Part {
    from: Place,
    to: Place,
    /// Beams that end in it.
    ended: usize,
    packed: Vec<u8>,
    /// Of its frame, once it is sent.
    sequence: u16,
}

impl<'a> Row<'a> {
    fn new(settings: &Settings, beams: u32, bits: u32, shoot: &'a mut Shoot<'_>) -> Self {
        let samples = settings.pre_trigger_samples() + settings.bins as u32;
        let codes = vec![0; samples as usize];
        Self { beams, shots: settings.shots as u16, bits, shoot, made: None, codes }
    }

    /// As much as a frame holds.
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
        let length = pack(&row, self.bits, &mut packed).unwrap_or(0); // as many as it holds
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

/// What became of the answers that came.
enum Step {
    /// They were taken, as far as they were answers to parts under way.
    On,
    /// Something was lost: what follows is sent again from here.
    Back(Place),
}

/// A scan on its way.
struct Feed<'a> {
    frame: u32,
    /// Parts that may be under way.
    window: usize,
    row: Row<'a>,
    /// What the next part begins with.
    next: Place,
    /// Made while others are under way.
    ready: Option<Part>,
    under_way: VecDeque<Part>,
    scan: Vec<Echoes>,
    /// Times it went back since anything was taken.
    tries: u32,
}

impl<'a> Feed<'a> {
    fn new(frame: u32, room: Room, row: Row<'a>) -> Self {
        Self {
            frame,
            window: room.frames.clamp(1, MOST_UNDER_WAY).into(),
            scan: Vec::with_capacity(row.beams as usize),
            row,
            next: Place::default(),
            ready: None,
            under_way: VecDeque::new(),
            tries: 0,
        }
    }

    fn run<T: Transport>(mut self, client: &mut Client<T>) -> Result<Vec<Echoes>, ClientError> {
        while self.scan.len() < self.row.beams as usize {
            self.make_ready()?;
            if self.under_way.len() < self.window
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
        self.under_way.push_back(part);
        Ok(())
    }

    /// Gives up what is under way, and goes on from `place`. What is on the line comes before what
    /// is sent next, so its answers are waited for: on a slow one they take longer than a timeout.
    fn go_back<T: Transport>(
        &mut self,
        client: &mut Client<T>,
        place: Place,
    ) -> Result<(), ClientError> {
        (self.tries, self.next, self.ready) = (self.tries + 1, place, None);
        let mut given_up: VecDeque<u16> =
            self.under_way.drain(..).map(|part| part.sequence).collect();
        while !given_up.is_empty() {
            let answers = client.listen(|of| given_up.contains(&of))?;
            let Some((newest, _)) = answers.last() else { break };
            let at = given_up.iter().position(|of| of == newest).unwrap_or_default();
            given_up.drain(..=at);
        }
        Ok(())
    }

    /// Waits for answers to what is under way.
    fn hear<T: Transport>(&mut self, client: &mut Client<T>) -> Result<Step, ClientError> {
        let numbers: Vec<u16> = self.under_way.iter().map(|part| part.sequence).collect();
        let answers = client.listen(|of| numbers.contains(&of))?;
        if answers.is_empty() {
            let first = self.under_way.front().map_or(self.next, |part| part.from);
            self.under_way.clear(); // nothing of it has been heard for long enough
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
        let Some(at) = self.under_way.iter().position(|part| part.sequence == sequence) else {
            return Ok(Step::On); // answered twice
        };
        let Part { from, ended, .. } = self.under_way[at];
        let before: usize = self.under_way.drain(..=at).take(at).map(|part| part.ended).sum();
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
            // Those before it were taken, or it would not be; the answers were lost.
            return Ok(Step::Back(self.first_missing()));
        }
        self.scan.extend(beams);
        self.tries = 0;
        Ok(Step::On)
    }

    /// Where to go on when the sensor would at `place`.
    fn resumed_at(&self, place: Place) -> Place {
        let missing = self.first_missing();
        if place.beam == missing.beam { place } else { missing }
    }

    /// The first beam whose echoes are not here.
    fn first_missing(&self) -> Place {
        Place::of_beam(self.scan.len() as u32)
    }
}
