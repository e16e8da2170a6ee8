//! The whole pipeline.

use echoloop_dsp::MAX_SAMPLES;

use super::config::BitTrue;
use super::near::Level;
use super::noise::Noise;
use super::numbers::nearest;
use super::peaks::{choose, peaks, separate};
use super::refine::Waveform;
use super::split;
use super::values::{Echo, Peak, Threshold};

impl BitTrue {
    /// Sum of several shots, scaled as the codes of one.
    pub fn accumulate(&self, shots: &[Vec<u16>]) -> Vec<u16> {
        let length = shots.first().map_or(0, Vec::len);
        // Four sums of 16 bits each.
        let lane = |n: usize, lane: usize| {
            let codes = shots.iter().skip(lane).step_by(4).map(|codes| f64::from(codes[n]));
            codes.sum::<f64>().min(65_535.0)
        };
        let sum = |n: usize| (0..4).map(|k| lane(n, k)).sum::<f64>();
        (0..length).map(|n| nearest(sum(n) / self.sum_divisor).min(65_535.0) as u16).collect()
    }

    /// Echoes of the codes before the trigger, if the settings ask for them, and of the window.
    pub fn process(&self, codes: &[u16]) -> Vec<Echo> {
        self.process_with(codes, None)
    }

    /// Echoes of single shots, as many as the settings ask for.
    pub fn process_shots(&self, shots: &[Vec<u16>]) -> Vec<Echo> {
        let windows: Vec<&[u16]> = shots.iter().map(|codes| &codes[self.pre_trigger..]).collect();
        self.process_with(&self.accumulate(shots), Some(&windows))
    }

    fn process_with(&self, codes: &[u16], shots: Option<&[&[u16]]>) -> Vec<Echo> {
        let (before, codes) = codes.split_at(self.pre_trigger.min(codes.len()));
        let codes = &codes[..codes.len().min(MAX_SAMPLES)];
        let statistics = self.with_ambient(self.statistics(self.of_full_gain(codes)), before);
        let noise = Noise { sigma: statistics.sigma, shot: self.shot_noise };
        let x = self.baseline(codes, statistics.ambient);
        let (y, f) = (self.filter(&x), self.exact(&x));
        let wave = Waveform { codes, x: &x, y: &y, f: &f, shots, level: None };
        let threshold = self.threshold(&statistics);
        let (found, hidden) = self.split(&wave, peaks(&y, threshold.level), &threshold, &noise);
        let strength = |peak: &Peak| match found.len() {
            1 => 0.0,
            _ => self.strength(&wave, (*peak, &found), &threshold, &noise),
        };
        let separate = separate(&found, self.min_separation, strength);
        let echo = |peak: Peak| {
            let sharp = hidden.contains(&peak.index);
            match self.near(&wave, peak, (&threshold, &noise)) {
                Some((Level { x, y, summit }, threshold, noise)) => {
                    let f = self.exact(&x);
                    let level = Some((peak.index, statistics.ambient));
                    let wave = Waveform { x: &x, y: &y, f: &f, level, ..wave };
                    let peak = if sharp { peak } else { summit };
                    self.seen(&wave, peak, (&threshold, &noise), sharp)
                }
                None => self.seen(&wave, peak, (&threshold, &noise), sharp),
            }
        };
        choose(&separate, self.echoes, self.choice, strength).into_iter().filter_map(echo).collect()
    }

    /// The echo of a peak; `sharp` when another peak hides it.
    fn seen(
        &self,
        wave: &Waveform<'_>,
        peak: Peak,
        (threshold, noise): (&Threshold, &Noise),
        sharp: bool,
    ) -> Option<Echo> {
        let refined = self.refine(wave, peak, threshold, noise);
        let refined = if sharp { self.sharpen(wave, peak, refined) } else { refined };
        self.echo(&refined, threshold, wave.level.map_or(peak.index, |(at, _)| at))
    }

    /// Peaks including those hidden under others, and the indices of overlapping ones.
    fn split(
        &self,
        wave: &Waveform<'_>,
        found: Vec<Peak>,
        threshold: &Threshold,
        noise: &Noise,
    ) -> (Vec<Peak>, Vec<usize>) {
        let Some(sharpener) = self.sharpener.as_ref().filter(|_| !found.is_empty()) else {
            return (found, Vec::new());
        };
        let may_hide = |peak: Peak| {
            self.is_broad(wave.y, peak, threshold.level)
                && self.clipped_run(wave.codes, peak.index).is_none()
        };
        split::split(sharpener, wave.x, wave.y, noise.sigma, threshold.level, &found, may_hide)
    }
}
