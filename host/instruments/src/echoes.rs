//! Echoes of recorded waveforms, in ns and in the file's units.

use std::ops::Range;

use echoloop_dsp::template::Template;
use echoloop_dsp::{Flags, MAX_SAMPLES};
use rayon::prelude::*;
use serde::Serialize;

use super::background;
use super::codes::Codes;
use super::finder::colour::Colour;
use super::finder::scale::Bank;
use super::finder::{
    Dropped, EchoFinder, FinderConfig, FoundEcho, Pulse, Reason, Threshold, from_samples, samples,
};
use super::noise::Noise;
use super::response::{Candidate, Explained, Record, Response, Split, Verdict, at_rest};
use super::rows::{Rows, without_padding};

/// Settings of the search for echoes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Time between samples, ns.
    pub sample_ns: f64,
    /// Least height of an echo, in σ of the noise.
    pub snr: f64,
    /// Least height of an echo, as a share of the strongest of its record.
    pub floor: f64,
    /// Greatest number of echoes of a waveform; the strongest are kept.
    pub max_echoes: usize,
    /// Least distance of two echoes, ns.
    pub min_separation_ns: f64,
}

/// Option out of its bounds.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value} must be {expected}")]
pub struct BadOption {
    /// Name of the field.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Range that it may have.
    pub expected: &'static str,
}

impl Options {
    /// Refuses an option out of its bounds.
    ///
    /// # Errors
    ///
    /// [`BadOption`] names the first.
    pub fn check(&self) -> Result<(), BadOption> {
        let Self { sample_ns, snr, floor, min_separation_ns, .. } = *self;
        let checks = [
            ("sample_ns", sample_ns, 1e-6..=1e9, "0.000001 to 1000000000"),
            ("snr", snr, 1.0..=250.0, "1 to 250"),
            ("floor", floor, 0.0..=1.0, "0 to 1"),
            ("min_separation_ns", min_separation_ns, 0.0..=f64::MAX, "0 or more"),
        ];
        let bad = checks.into_iter().find(|(_, value, bounds, _)| !bounds.contains(value));
        let refused = |(name, value, _, expected)| Err(BadOption { name, value, expected });
        bad.map_or(Ok(()), refused)
    }
}

/// One echo.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Echo {
    /// Time from the row's first sample to the echo's peak, ns.
    pub time_ns: f64,
    /// Height above ambient, in the input's units.
    pub amplitude: f64,
    /// Full width at half maximum, ns.
    pub width_ns: f64,
    /// Height in σ of the noise.
    pub snr: f64,
    /// Names of [`Flags`], and [`POSSIBLE_REPEAT`].
    pub flags: Vec<&'static str>,
}

/// Flag of an echo that may be the instrument's repeat of one before it: nothing in the recording
/// tells it from a target.
pub const POSSIBLE_REPEAT: &str = "possible-repeat";

/// Echoes of one row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Waveform {
    /// Index of the row, from 0.
    pub waveform: usize,
    /// Time from the first sample of the outgoing pulse's row to its peak, ns; `None` without one.
    pub outgoing_peak_ns: Option<f64>,
    /// Change of the background within the record that was taken out, in the input's units.
    pub background: f64,
    /// Expected number of echoes that noise alone makes in a record at rest as long as this: see
    /// [`Noise`].
    pub false_alarms: f64,
    /// Echoes by rising time.
    pub echoes: Vec<Echo>,
    /// Tops above the threshold that are no echoes.
    #[serde(skip)]
    pub dropped: Vec<DroppedTop>,
}

/// A top that is no echo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DroppedTop {
    /// Time from the row's first sample, ns.
    pub time_ns: f64,
    /// Height above ambient, in the input's units.
    pub amplitude: f64,
    /// Why it is none.
    pub reason: Reason,
}

/// Tops of a record: echoes so far, and those that are none.
#[derive(Default)]
struct Tops {
    found: Vec<FoundEcho>,
    dropped: Vec<Dropped>,
}

impl Tops {
    fn drop_if(&mut self, reason: Reason, mut is_none: impl FnMut(&mut FoundEcho) -> bool) {
        let Self { found, dropped } = self;
        found.retain_mut(|echo| {
            let goes = is_none(echo);
            if goes {
                dropped.push(Dropped { time: echo.time, amplitude: echo.amplitude, reason });
            }
            !goes
        });
    }
}

/// Samples that two pieces of a long record share.
const OVERLAP: usize = 600;

/// Increase of false alarms where each record's pulse is chosen by its highest value after ten
/// filters: 0.8·snr − 1.15, measured at 3.5 and 4 in white and coloured noise
/// (benches/record/waveforms.md).
const MORE: f64 = 0.8;
const LESS: f64 = 1.15;

/// Distance of two echoes that merge into one lobe, widths of the response.
const MERGED: f64 = 1.2;

/// Width of the pulse over that of the response: surfaces widened the echoes that the response is
/// estimated from.
const PULSE_OF_RESPONSE: f64 = 0.7;

/// Finder of the echoes of many rows. Its results do not depend on the number of threads.
#[derive(Clone, Debug)]
pub struct Finder {
    options: Options,
    noise: Option<Noise>,
    /// Rate of crossings after each filter of [`Bank`].
    crossings: Vec<f64>,
    response: Option<Response>,
}

impl Finder {
    /// A finder without a response.
    pub fn new(options: Options) -> Self {
        Self { options, noise: None, crossings: crossings(&Noise::white()), response: None }
    }

    /// Sets the noise of the recording. Without it a record's noise counts as white.
    #[must_use]
    pub fn with_noise(self, noise: Option<Noise>) -> Self {
        let of_filters = crossings(noise.as_ref().unwrap_or(&Noise::white()));
        Self { noise, crossings: of_filters, ..self }
    }

    /// Sets the instrument's response, whose own tops are not reported as echoes, and the noise
    /// that it knows.
    #[must_use]
    pub fn with_response(self, response: Option<Response>) -> Self {
        let noise = response.as_ref().and_then(|response| response.noise.clone());
        let noise = noise.or_else(|| self.noise.clone());
        Self { response, ..self.with_noise(noise) }
    }

    /// The response, if there is one.
    pub fn response(&self) -> Option<&Response> {
        self.response.as_ref()
    }

    /// Finds the echoes of every row; `outgoing` holds the emitted pulse of each row, or one for
    /// all, or nothing.
    ///
    /// A row of `outgoing` without a pulse counts as absent.
    pub fn find(&self, rows: &[Vec<f64>], outgoing: &[Vec<f64>]) -> Vec<Waveform> {
        let codes = |row: &Vec<f64>| Codes::from_samples(without_padding(row));
        let pulse = |i| (outgoing.len() > i).then(|| codes(&outgoing[i]));
        self.find_codes(0..rows.len(), |i| codes(&rows[i]), outgoing.len(), pulse)
    }

    /// As [`Finder::find`], for some rows of a file, with indices as in the file.
    pub fn find_some(
        &self,
        rows: &Rows,
        outgoing: Option<&Rows>,
        part: Range<usize>,
    ) -> Vec<Waveform> {
        let pulses = outgoing.map_or(0, Rows::len);
        let pulse = |i| outgoing.filter(|outgoing| outgoing.len() > i).map(|o| o.codes(i));
        self.find_codes(part, |i| rows.codes(i), pulses, pulse)
    }

    /// Echoes of some rows. A single pulse belongs to all rows; of several, each row has its own.
    fn find_codes(
        &self,
        part: Range<usize>,
        codes: impl Fn(usize) -> Codes + Sync,
        pulses: usize,
        pulse: impl Fn(usize) -> Option<Codes> + Sync,
    ) -> Vec<Waveform> {
        let read = |memory: &mut EchoFinder, i| emitted(memory, &pulse(i)?);
        let of_all = (pulses == 1).then(|| read(&mut finder(), 0));
        let row = |memory: &mut Box<EchoFinder>, i| {
            let pulse = of_all.unwrap_or_else(|| read(memory, i));
            self.row(memory, i, &codes(i), pulse)
        };
        part.into_par_iter().map_init(finder, row).collect()
    }

    fn row(
        &self,
        finder: &mut EchoFinder,
        waveform: usize,
        codes: &Codes,
        pulse: Option<Pulse>,
    ) -> Waveform {
        let known = pulse.or_else(|| self.known_pulse());
        let width = known.map(|pulse| samples(pulse.width));
        let sigma = self.known_sigma(codes);
        let in_codes = |codes: &Codes| sigma.map(|sigma| codes.sigma_of(sigma));
        let mut rest = at_rest(codes, self.colour(), in_codes(codes));
        let levelled = background::levelled(finder, codes, rest.1, width, self.colour());
        let (codes, change) = levelled.as_ref().map_or((codes, 0.0), |(codes, by)| (codes, *by));
        if levelled.is_some() {
            rest = at_rest(codes, self.colour(), in_codes(codes));
        }
        let sigma = in_codes(codes);
        let search = FinderConfig { sigma, ..self.search(codes.shift, known) };
        let (mut false_alarms, mut tops) = (0.0, Tops::default());
        pieces(finder, &codes.codes, &search, &mut tops, |samples, threshold| {
            let snr = f64::from(threshold.snr) / 256.0;
            let rate = self.crossings.get(threshold.view).copied().unwrap_or_default();
            let looks = if search.pulse.is_some() { 1.0 } else { (MORE * snr - LESS).max(1.0) };
            false_alarms += looks * samples as f64 * rate * (-0.5 * snr * snr).exp();
        });
        let is_beside_gap =
            |echo: &mut FoundEcho| codes.is_beside_gap(samples(echo.top).round() as usize);
        tops.drop_if(Reason::Gap, is_beside_gap);
        if let Some(response) = &self.response {
            let floor = self.options.floor;
            let record = Record { x: &rest.0, sigma: rest.1, unit: codes.unit, floor };
            self.drop_explained(response, codes, &record, &mut tops);
        }
        let highest = tops.found.iter().map(|echo| echo.amplitude).max().unwrap_or_default();
        tops.drop_if(Reason::Floor, |echo| {
            (echo.amplitude as f64) < self.options.floor * highest as f64
                && codes.codes.len() > MAX_SAMPLES
        });
        tops.found.sort_by_key(|echo| echo.amplitude);
        let mut surplus = tops.found.len().saturating_sub(self.options.max_echoes);
        tops.drop_if(Reason::Surplus, |_| {
            let is_surplus = surplus > 0;
            surplus = surplus.saturating_sub(1);
            is_surplus
        });
        let Tops { mut found, dropped } = tops;
        found.sort_by_key(|echo| echo.time);
        let dropped = dropped.into_iter().map(|top| DroppedTop {
            time_ns: self.ns(top.time),
            amplitude: shortened(codes.to_units(top.amplitude)),
            reason: top.reason,
        });
        let dropped = dropped.collect();
        let echo = |echo| Echo { flags: self.flags(echo, &found), ..self.echo(echo, codes) };
        let echoes = found.iter().map(echo).collect();
        let outgoing_peak_ns = pulse.map(|pulse| self.ns(pulse.time));
        let false_alarms = shortened(false_alarms);
        let background = shortened(change);
        Waveform { waveform, outgoing_peak_ns, background, false_alarms, echoes, dropped }
    }

    /// Drops the tops that the response explains, and adds what it shows without one. An echo that
    /// took in other tops gets the time and width of all together.
    fn drop_explained(&self, response: &Response, codes: &Codes, record: &Record, tops: &mut Tops) {
        let candidate = |echo: &FoundEcho| Candidate {
            time: samples(echo.time),
            height: codes.of_height(echo.amplitude),
            width: samples(echo.width),
        };
        let candidates: Vec<Candidate> = tops.found.iter().map(candidate).collect();
        let Explained { verdicts, splits, missed } = response.explain(record, &candidates);
        let hidden = split(codes, tops, &splits);
        let mut verdicts = verdicts.into_iter();
        tops.drop_if(Reason::Response, |echo| match verdicts.next() {
            Some(Verdict::Whole { time, width }) => {
                (echo.time, echo.width) = (from_samples(time), from_samples(width));
                false
            }
            verdict => verdict == Some(Verdict::Explained),
        });
        tops.found.extend(hidden);
        for missed in &missed {
            let echo = fitted(&missed.echo, codes, 256.0 * missed.snr, Flags::default());
            if missed.snr >= self.options.snr && self.may_be_added(&echo, codes, response, tops) {
                tops.found.push(echo);
            }
        }
        tops.found.sort_by_key(|echo| echo.time);
        flag_merged(&mut tops.found, from_samples(MERGED * response.width()));
    }

    /// True when an echo without a top passes what tops have passed before.
    fn may_be_added(&self, echo: &FoundEcho, codes: &Codes, of: &Response, tops: &Tops) -> bool {
        let near = from_samples(of.width() / 2.0);
        let apart = from_samples(self.options.min_separation_ns / self.options.sample_ns);
        let highest = tops.found.iter().map(|echo| echo.amplitude).max().unwrap_or_default();
        echo.amplitude as f64 >= self.options.floor * highest as f64
            && !codes.is_beside_gap(samples(echo.time).round() as usize)
            && tops.found.iter().all(|other| (other.time - echo.time).abs() >= apart)
            && tops.dropped.iter().all(|top| (top.time - echo.time).abs() >= near)
    }

    /// Names of an echo's flags.
    fn flags(&self, echo: &FoundEcho, all: &[FoundEcho]) -> Vec<&'static str> {
        let may_repeat = self.response.as_ref().is_some_and(|response| {
            let candidate = |echo: &FoundEcho| (samples(echo.time), echo.amplitude as f64);
            all.iter().any(|before| response.may_repeat(candidate(before), candidate(echo)))
        });
        Flags::names(echo.flags).chain(may_repeat.then_some(POSSIBLE_REPEAT)).collect()
    }

    /// The width of an emitted pulse that was not recorded, from the response.
    fn known_pulse(&self) -> Option<Pulse> {
        let width = PULSE_OF_RESPONSE * self.response.as_ref()?.width();
        Some(Pulse { width: from_samples(width), ..Pulse::default() })
    }

    /// σ of a record's samples, in the file's units, where the recording tells it better than the
    /// record. A longer record has pieces, each with its own.
    fn known_sigma(&self, codes: &Codes) -> Option<f64> {
        let noise = self.noise.as_ref().filter(|_| codes.codes.len() <= MAX_SAMPLES)?;
        noise.of_record(codes)
    }

    /// Colour of the noise, where it is not white.
    fn colour(&self) -> Option<Colour> {
        self.noise.as_ref()?.colour
    }

    fn search(&self, code_shift: u32, pulse: Option<Pulse>) -> FinderConfig {
        let samples = (self.options.min_separation_ns / self.options.sample_ns).round();
        FinderConfig {
            code_shift,
            snr_threshold: (self.options.snr * 256.0).round() as u32,
            floor: (self.options.floor * 32_768.0).round() as u32,
            min_separation: samples as u32,
            pulse,
            colour: self.colour(),
            ..FinderConfig::DEFAULT
        }
    }

    fn echo(&self, echo: &FoundEcho, codes: &Codes) -> Echo {
        Echo {
            time_ns: self.ns(echo.time),
            amplitude: shortened(codes.to_units(echo.amplitude)),
            width_ns: self.ns(echo.width),
            snr: rounded(f64::from(echo.snr) / 256.0, 2),
            flags: Vec::new(),
        }
    }

    /// Q16.16 samples as ns, to seven digits.
    fn ns(&self, time: i64) -> f64 {
        shortened(samples(time) * self.options.sample_ns)
    }
}

/// Rate of crossings of noise after each filter of [`Bank`].
fn crossings(noise: &Noise) -> Vec<f64> {
    let taps = |template: &Template| template.taps().iter().map(|&tap| f64::from(tap)).collect();
    let taps: Vec<Vec<f64>> = Bank::default().templates().map(taps).collect();
    taps.iter().map(|taps| noise.crossings(taps)).collect()
}

fn finder() -> Box<EchoFinder> {
    Box::new(EchoFinder::new())
}

/// Gives the echoes that were split their own places, and returns the hidden ones.
fn split(codes: &Codes, tops: &mut Tops, splits: &[Split]) -> Vec<FoundEcho> {
    let mut hidden = Vec::new();
    for Split { index, parts } in splits {
        let Some(echo) = tops.found.get_mut(*index) else { continue };
        let whole = *echo;
        let part = |part: &Candidate| {
            let share = part.height * codes.scale() / (whole.amplitude as f64).max(1.0);
            fitted(part, codes, f64::from(whole.snr) * share, whole.flags)
        };
        *echo = part(&parts[0]);
        hidden.push(part(&parts[1]));
    }
    hidden
}

/// An echo by its fit alone, in the lobe of another or beside it; `snr` is Q24.8.
fn fitted(part: &Candidate, codes: &Codes, snr: f64, flags: Flags) -> FoundEcho {
    let time = from_samples(part.time);
    FoundEcho {
        time,
        top: time,
        centre: time,
        amplitude: (part.height * codes.scale()).round() as i64,
        width: from_samples(part.width),
        snr: snr as u32,
        flags: flags | Flags::MERGED,
    }
}

/// Flags echoes whose neighbour is nearer than `near`, Q16.16 samples.
fn flag_merged(echoes: &mut [FoundEcho], near: i64) {
    for k in 1..echoes.len() {
        if echoes[k].time - echoes[k - 1].time < near {
            echoes[k - 1].flags |= Flags::MERGED;
            echoes[k].flags |= Flags::MERGED;
        }
    }
}

/// The emitted pulse in its record; `None` without one.
fn emitted(finder: &mut EchoFinder, codes: &Codes) -> Option<Pulse> {
    Pulse::from_record(finder, &codes.codes, codes.shift)
}

/// True when a row holds an emitted pulse.
pub fn shows_pulse(finder: &mut EchoFinder, rows: &Rows, row: usize) -> bool {
    emitted(finder, &rows.codes(row)).is_some()
}

/// Echoes of a record of any length. One longer than the DSP's memory is searched in pieces of
/// [`MAX_SAMPLES`] that share [`OVERLAP`] samples; an echo is taken from the piece in whose inner
/// part it lies. A piece whose highest code is below the record's cannot be clipped.
fn pieces(
    finder: &mut EchoFinder,
    codes: &[u16],
    search: &FinderConfig,
    tops: &mut Tops,
    mut searched: impl FnMut(usize, Threshold),
) {
    let step = MAX_SAMPLES - OVERLAP;
    let mut start = 0;
    let highest = codes.iter().max();
    loop {
        let end = (start + MAX_SAMPLES).min(codes.len());
        let is_lower = codes[start..end].iter().max() < highest;
        let from = if start == 0 { i64::MIN } else { (OVERLAP as i64 / 2) << 16 };
        let to =
            if end == codes.len() { i64::MAX } else { ((MAX_SAMPLES - OVERLAP / 2) as i64) << 16 };
        let in_record = |time: i64| time + ((start as i64) << 16);
        for echo in finder.echoes(&codes[start..end], search) {
            if (from..to).contains(&echo.time) {
                let clipped = if is_lower { Flags::SATURATED.0 } else { 0 };
                let flags = Flags(echo.flags.0 & !clipped);
                let (time, top, centre) =
                    (in_record(echo.time), in_record(echo.top), in_record(echo.centre));
                tops.found.push(FoundEcho { time, top, centre, flags, ..echo });
            }
        }
        let dropped = finder.dropped().iter().filter(|top| (from..to).contains(&top.time));
        let dropped = dropped.map(|top| Dropped { time: in_record(top.time), ..*top });
        tops.dropped.extend(dropped);
        let inner = if end == codes.len() { end - start } else { step };
        searched(inner, finder.threshold());
        if end == codes.len() {
            return;
        }
        start += step;
    }
}

/// Rounds to a number of decimals.
fn rounded(value: f64, decimals: i32) -> f64 {
    let scale = 10f64.powi(decimals);
    let scaled = (value * scale).round() / scale;
    if scaled.is_finite() { scaled } else { value }
}

/// Rounds to seven significant digits.
fn shortened(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    rounded(value, 6 - value.abs().log10().floor() as i32)
}
