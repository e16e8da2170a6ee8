//! Test of a record's tops: echoes, or explained by the response of other echoes.

use super::curve::FLAT;
use super::estimate::LOBE;
use super::fit::{Fit, Part, samples};
use super::hidden::Split;
use super::missed::Missed;
use super::model::Response;

/// Least improvement of the fit by an echo, over noise and the model's error.
const SIGNIFICANT: f64 = 2.0;

/// Least height over noise and the spread of the other echoes.
const CLEAR: f64 = 5.5;

/// Least height over the other echoes' response there, after its lobe.
const OVER_REPEATS: f64 = 0.5;

/// Least height over that of the highest echo, unless less is asked for.
const LEAST: f64 = 0.03;

/// Greatest distance of a fitted echo from its top, over the greater of both widths.
const NEAR: f64 = 0.6;

/// Error of the Gaussian surface for an echo much wider than the response, over its height.
const SURFACE_ERROR: f64 = 0.05;

/// Least depth of a valley between two echoes, over noise and over the lower top.
const VALLEY_OVER_NOISE: f64 = 10.0;
const VALLEY: f64 = 0.05;

/// A top of a record: time and width in samples, height in codes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    pub(crate) time: f64,
    pub(crate) height: f64,
    pub(crate) width: f64,
}

/// Outcome of the test of a top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// An echo.
    Echo,
    /// An echo that took in other tops, with the time and width of all together, samples.
    Whole {
        /// Time of the fitted top.
        time: f64,
        /// Full width at half maximum.
        width: f64,
    },
    /// No echo: the response of other echoes explains it.
    Explained,
}

/// What became of a record's tops, and the echoes without one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Explained {
    /// Verdict of each top, in the order given.
    pub(crate) verdicts: Vec<Verdict>,
    /// Tops of two echoes.
    pub(crate) splits: Vec<Split>,
    /// Echoes without a top.
    pub(crate) missed: Vec<Missed>,
}

/// A record: samples without ambient, codes of `unit`, whose own noise is `sigma` codes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Record<'a> {
    pub(crate) x: &'a [f64],
    pub(crate) sigma: f64,
    pub(crate) unit: f64,
    /// Least height of an echo over the highest, as asked for.
    pub(crate) floor: f64,
}

impl Response {
    /// Verdict of each top, in the order given.
    ///
    /// Each top is fitted as the response on a surface. Then each top c, from the lowest to the
    /// second highest, is taken out, and its neighbours are fitted without it (residual R₁) and
    /// with it (R₂):
    ///
    /// ```text
    /// significant   √((R₁ − R₂)/Σ h²) ≥ 2·√(σ_A² + e²)
    /// e²            = Σ A²·(spread² + (0.05·k·h)²)   at c, over the other echoes
    /// clear         A_c ≥ 5.5·√(σ_A² + Σ A²·spread²), ½·Σ A·h after the lobe, 0.03·max A
    ///               or --floor's, if less
    /// two           a valley beside c, at least max(10·σ, 5 % of c) deep, of which the others make
    ///               less than half
    /// c stays       if it is clear, and either significant with its fit near its top, or two
    /// ```
    ///
    /// σ and σ_A are the noise of a sample and of a height; k grows from 0 to 1 with the surface.
    /// The neighbours take over the light of a top that goes. The lowest go first: of two wrong
    /// tops that explain the same light, each alone would look necessary.
    ///
    /// Then what is left may be echoes without a top, see [`Missed`], and lobes of two echoes are
    /// split, see [`Split`].
    pub(crate) fn explain(&self, record: &Record<'_>, candidates: &[Candidate]) -> Explained {
        if candidates.is_empty() || record.x.is_empty() {
            return Explained {
                verdicts: vec![Verdict::Echo; candidates.len()],
                ..Default::default()
            };
        }
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        order.sort_by(|&a, &b| candidates[b].height.total_cmp(&candidates[a].height));
        let mut work = Work::new(self, record, candidates);
        work.fit_each(&order);
        for &index in order[1..].iter().rev() {
            work.decide(index);
        }
        let missed = work.add_missed();
        let splits = work.split_all(candidates.len());
        Explained { verdicts: work.verdicts(candidates.len()), splits, missed }
    }
}

/// State of a candidate.
#[derive(Clone, Copy, Debug)]
pub(super) struct State {
    pub(super) part: Part,
    pub(super) stays: bool,
    /// True when it took in another top of its lobe.
    pub(super) grew: bool,
}

/// Fits of all candidates of a record.
pub(super) struct Work<'a> {
    pub(super) response: &'a Response,
    x: &'a [f64],
    pub(super) candidates: Vec<Candidate>,
    /// σ, codes.
    pub(super) noise: f64,
    /// σ_A, codes.
    pub(super) height_noise: f64,
    /// Least height over the highest.
    least: f64,
    /// Record minus all parts, codes.
    pub(super) residual: Vec<f64>,
    pub(super) states: Vec<State>,
}

impl<'a> Work<'a> {
    fn new(response: &'a Response, record: &Record<'a>, candidates: &[Candidate]) -> Self {
        let (noise, height_noise) = response.noise_in(record.sigma, record.unit);
        let state = State { part: Part::NONE, stays: true, grew: false };
        Self {
            response,
            x: record.x,
            candidates: candidates.to_vec(),
            noise,
            height_noise,
            least: LEAST.min(record.floor),
            residual: record.x.to_vec(),
            states: vec![state; candidates.len()],
        }
    }

    /// Fits each to the residual of the others, the highest first, in three rounds.
    fn fit_each(&mut self, order: &[usize]) {
        // A lone one is fitted to what is there already.
        let rounds = if order.len() == 1 { 1 } else { 3 };
        for round in 0..rounds {
            for &index in order {
                let part = match round {
                    0 => self.first_guess(index),
                    _ => self.taken(index),
                };
                let part = self.fit_one(part, self.candidates[index].time);
                self.put(index, part);
            }
        }
    }

    fn first_guess(&self, index: usize) -> Part {
        let candidate = &self.candidates[index];
        let here = candidate.time.round().clamp(0.0, (self.residual.len() - 1) as f64) as usize;
        Part {
            height: self.residual[here].max(0.2 * candidate.height),
            time: candidate.time,
            surface: self.response.family.surface(candidate.width),
        }
    }

    /// Fits one part to the residual around `time`.
    fn fit_one(&self, part: Part, time: f64) -> Part {
        let family = &self.response.family;
        let reach = 0.7 * family.width(part.surface);
        let range = samples(time - reach..time + reach, self.residual.len());
        let leash = self.response.width() / 4.0;
        let mut parts = [part];
        Fit { family, x: &self.residual, range, leash }.run(&mut parts);
        parts[0]
    }

    /// Takes a part out of the model.
    pub(super) fn taken(&mut self, index: usize) -> Part {
        let part = self.states[index].part;
        part.add(&self.response.family, 1.0, &mut self.residual);
        self.states[index].part = Part::NONE;
        part
    }

    /// Puts a part into the model.
    pub(super) fn put(&mut self, index: usize, part: Part) {
        part.add(&self.response.family, -1.0, &mut self.residual);
        self.states[index].part = part;
    }

    /// Decides whether a top stays.
    pub(super) fn decide(&mut self, index: usize) {
        let candidate = self.candidates[index];
        let group = self.neighbours(index);
        let own = self.taken(index);
        self.states[index].stays = false;
        let around: Vec<Part> = group.iter().map(|&i| self.taken(i)).collect();
        let (without, with, improvement) = self.both(&around, own, &candidate);
        let part = with[with.len() - 1];
        let noise = self.height_noise.hypot(self.model_error(&without, candidate.time));
        let near = NEAR * candidate.width.max(self.response.width());
        let is_in_place = (part.time - candidate.time).abs() <= near;
        let is_needed = improvement >= SIGNIFICANT * noise && is_in_place;
        // A valley counts even where the fit misses the top: then the top's own place and height
        // do.
        let seen = Part {
            height: part.height.max(candidate.height / 2.0),
            time: candidate.time,
            surface: part.surface,
        };
        let stays = is_needed && self.is_clear(&part, &without)
            || self.has_valley(&candidate, &without) && self.is_clear(&seen, &without);
        for (&i, part) in group.iter().zip(if stays { &with } else { &without }) {
            let lobe = self.response.family.width(part.surface) / 2.0;
            self.states[i].grew |= !stays && (part.time - candidate.time).abs() < lobe;
            self.put(i, *part);
        }
        if stays {
            self.put(index, part);
            self.states[index].stays = true;
        }
    }

    /// Fits of the neighbours without a top, and with it as the last part; and √((R₁ − R₂)/Σ h²).
    fn both(&self, around: &[Part], own: Part, top: &Candidate) -> (Vec<Part>, Vec<Part>, f64) {
        let family = &self.response.family;
        let begun = [around, &[own]].concat();
        let x = &self.residual;
        let fit = |leash| Fit { family, x, range: self.range(&begun), leash };
        let mut without = around.to_vec();
        let left_without = fit(f64::INFINITY).run(&mut without);
        // Sums of pulses have many local minima, so three starts: the parts as they are, narrow
        // ones, and the fit without the top plus a new part.
        let new = Part { height: 0.3 * top.height, time: top.time, surface: FLAT };
        let starts = [
            begun.clone(),
            begun.iter().map(|part| part.narrow()).collect(),
            [&without[..], &[new]].concat(),
        ];
        let fitted = starts.into_iter().map(|mut parts| {
            let left = fit(self.response.width() / 2.0).run(&mut parts);
            (left, parts)
        });
        let best = fitted.min_by(|a, b| a.0.total_cmp(&b.0));
        let (left_with, with) = best.unwrap_or((left_without, begun.clone()));
        let gain = (left_without - left_with).max(0.0) / self.response.energy();
        (without, with, gain.sqrt())
    }

    /// A part as time, height and width.
    pub(super) fn candidate(&self, part: Part) -> Candidate {
        let width = self.response.family.width(part.surface);
        Candidate { time: part.time, height: part.height, width }
    }

    /// Nearest echo that stays on either side of a top, if it reaches the top.
    pub(super) fn neighbours(&self, index: usize) -> Vec<usize> {
        let candidate = &self.candidates[index];
        let apart = |i: usize| (self.states[i].part.time - candidate.time).abs();
        let reaches = |i: &usize| {
            let width = self.response.family.width(self.states[*i].part.surface);
            apart(*i) < 1.3 * (width + candidate.width)
        };
        let beside = |is_before: bool| {
            self.others(index)
                .filter(|&i| (self.states[i].part.time < candidate.time) == is_before)
                .min_by(|&a, &b| apart(a).total_cmp(&apart(b)))
                .filter(reaches)
        };
        [beside(true), beside(false)].into_iter().flatten().collect()
    }

    /// Indices of the other echoes that stay.
    pub(super) fn others(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.states.len()).filter(move |&i| i != index && self.states[i].stays)
    }

    /// Parts in the model that stay, and the given ones.
    fn with_rest<'b>(&'b self, parts: &'b [Part]) -> impl Iterator<Item = Part> + 'b {
        let in_model = self.states.iter().filter(|state| state.stays).map(|state| state.part);
        in_model.filter(|part| part.height > 0.0).chain(parts.iter().copied())
    }

    /// e: error of the model at a time, codes.
    fn model_error(&self, parts: &[Part], time: f64) -> f64 {
        let family = &self.response.family;
        let error = |part: Part| {
            let lag = time - part.time;
            let rough = (part.surface - FLAT).max(0.0);
            let share = SURFACE_ERROR * rough / (rough + 6.0);
            let of_surface = share * family.shape(part.surface).at(lag).value;
            part.height * self.response.spread_at(lag).hypot(of_surface)
        };
        self.with_rest(parts).map(error).fold(0.0, f64::hypot)
    }

    /// True when a part is high enough over noise and over the response of the others.
    pub(super) fn is_clear(&self, own: &Part, around: &[Part]) -> bool {
        let family = &self.response.family;
        let lobe = LOBE * self.response.width();
        let (mut repeats, mut noise, mut highest) = (0.0, self.height_noise, 0.0f64);
        for part in self.with_rest(around) {
            let lag = own.time - part.time;
            if lag > lobe {
                repeats += part.height * family.shape(FLAT).at(lag).value;
            }
            noise = noise.hypot(part.height * self.response.spread_at(lag));
            highest = highest.max(part.height);
        }
        own.height >= (OVER_REPEATS * repeats).max(CLEAR * noise).max(self.least * highest)
    }

    /// True when the record has a valley beside a top that the others do not make.
    fn has_valley(&self, candidate: &Candidate, around: &[Part]) -> bool {
        let reach = (self.response.width() / 6.0).max(1.0);
        let near = samples(candidate.time - reach..candidate.time + reach, self.x.len());
        let by_height = |a: &usize, b: &usize| self.x[*a].total_cmp(&self.x[*b]);
        let Some(top) = near.max_by(by_height) else { return false };
        let times = || self.with_rest(around).map(|part| part.time);
        let last = self.x.len() - 1;
        let left = times().filter(|&t| t < candidate.time).fold(0.0, f64::max) as usize;
        let right = times().filter(|&t| t > candidate.time).fold(last as f64, f64::min) as usize;
        let valleys = [
            (left.min(top)..top).min_by(by_height),
            (top + 1..(right + 1).min(self.x.len())).min_by(by_height),
        ];
        let model = |n: usize| self.modelled(around, n);
        let (mut seen, mut made) = (f64::INFINITY, f64::INFINITY);
        for n in valleys.into_iter().flatten() {
            seen = seen.min(self.x[top] - self.x[n]);
            made = made.min(model(top) - model(n));
        }
        let least = (VALLEY_OVER_NOISE * self.noise).max(VALLEY * candidate.height);
        seen.is_finite() && seen >= least && made < 0.5 * seen
    }

    /// Value of the model at a sample, with parts that are not in it.
    fn modelled(&self, parts: &[Part], sample: usize) -> f64 {
        let more = parts.iter().map(|part| part.at(&self.response.family, sample));
        self.x[sample] - self.residual[sample] + more.sum::<f64>()
    }

    /// Samples within 1.3 widths of any part.
    pub(super) fn range(&self, parts: &[Part]) -> std::ops::Range<usize> {
        let reach = |part: &Part| 1.3 * self.response.family.width(part.surface);
        let first = parts.iter().map(|p| p.time - reach(p)).fold(f64::INFINITY, f64::min);
        let last = parts.iter().map(|p| p.time + reach(p)).fold(0.0, f64::max);
        samples(first..last, self.x.len())
    }

    /// Of the first of the states, which are those of tops.
    fn verdicts(&self, tops: usize) -> Vec<Verdict> {
        let verdict = |state: &State| match (state.stays, state.grew) {
            (false, _) => Verdict::Explained,
            (true, false) => Verdict::Echo,
            (true, true) => Verdict::Whole {
                time: state.part.time,
                width: self.response.family.width(state.part.surface),
            },
        };
        self.states[..tops].iter().map(verdict).collect()
    }
}
