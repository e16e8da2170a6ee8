//! Pipeline: the stages in order, from codes to echoes.

use core::ops::Range;

use crate::clipped::dithered_edges::DitheredEdges;
use crate::config::DetectorConfig;
use crate::limits::{MAX_SAMPLES, MAX_TAPS};
use crate::loops::SampleLoops;
use crate::rising_gain::near::Near;
use crate::settings::Settings;
use crate::settings::hardware::Hardware;
use crate::settings::refusal::Refusal;
use crate::stages::accumulate::Accumulator;
use crate::stages::detect::Threshold;
use crate::stages::echo::{Echo, Echoes};
use crate::stages::filter::{self, PADDING};
use crate::stages::noise::Noise;
use crate::stages::peak::{Peak, Peaks};
use crate::stages::refine::{Chosen, Refined, Refiner, Waveform};
use crate::stages::split::{Overlapping, Sharpener, Splitter};
use crate::stages::statistics::Statistics;

/// Working memory for a waveform and its shots: about 30 kB, reused for every waveform.
///
/// The contents left from the waveform before save time but never change a result.
#[derive(Clone, Debug)]
pub struct Scratch {
    /// x with zeros around it: half a template before, the rest behind.
    padded: [i16; MAX_SAMPLES + MAX_TAPS + PADDING],
    y: [i16; MAX_SAMPLES],
    peaks: Peaks,
    statistics: Statistics,
    shots: Accumulator,
    /// Samples of `padded` that are not zero: `start..end`.
    filled: (usize, usize),
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

impl Scratch {
    /// Empty memory.
    pub const fn new() -> Self {
        Self {
            padded: [0; MAX_SAMPLES + MAX_TAPS + PADDING],
            y: [0; MAX_SAMPLES],
            peaks: Peaks::new(),
            statistics: Statistics { median: 0, deviation: 0, ambient: 0, sigma: 0 },
            shots: Accumulator::new(),
            filled: (0, 0),
        }
    }

    /// Accumulator of the shots of a waveform. The [`Pipeline::process`] that follows reads
    /// dithered shots from it once more.
    pub fn shots(&mut self) -> &mut Accumulator {
        &mut self.shots
    }

    /// Ambient light and noise of the last waveform.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    fn x(&self) -> &[i16] {
        let (start, end) = self.filled;
        self.padded.get(start..end).unwrap_or_default()
    }

    fn x_mut(&mut self) -> &mut [i16] {
        let (start, end) = self.filled;
        self.padded.get_mut(start..end).unwrap_or_default()
    }

    /// The filter's output for the last waveform of `samples` samples.
    pub fn filtered(&self, samples: usize) -> &[i16] {
        self.y.get(..samples).unwrap_or(&self.y)
    }
}

/// Threshold, noise and gain that an echo is refined with.
#[derive(Clone, Copy)]
struct Conditions<'a> {
    threshold: &'a Threshold,
    noise: &'a Noise,
    near: Option<Near<'a>>,
    /// Sample whose gain the samples around it have been brought to.
    level: Option<usize>,
    /// True when the accumulator holds all shots of the waveform.
    dithered: bool,
}

/// The echo detector: a configuration and the order of the stages.
#[derive(Clone, Debug)]
pub struct Pipeline {
    config: DetectorConfig,
}

impl Pipeline {
    /// Configures the stages.
    ///
    /// # Errors
    ///
    /// [`Refusal`] of the first field that [`Settings::check`] does not take.
    pub fn new(settings: &Settings, hardware: &Hardware) -> Result<Self, Refusal> {
        Ok(Self { config: DetectorConfig::new(settings, hardware)? })
    }

    /// Constants of the stages.
    pub fn config(&self) -> &DetectorConfig {
        &self.config
    }

    /// Finds the echoes of one waveform. `codes` begins with the [`DetectorConfig::codes`] −
    /// [`DetectorConfig::samples`] codes before the trigger; with several shots all codes come from
    /// [`Accumulator::read`](crate::stages::accumulate::Accumulator::read). Samples beyond
    /// [`MAX_SAMPLES`] are ignored; an empty waveform has no echo.
    ///
    /// `loops` runs the loops over every sample; [`Portable`](crate::loops::Portable) works
    /// everywhere. Inlined into its caller, so that a board can compile all of it for the vector
    /// unit that it has found at run time.
    #[inline(always)]
    pub fn process(&self, loops: impl SampleLoops, codes: &[u16], scratch: &mut Scratch) -> Echoes {
        let config = &self.config;
        let (before, codes) = codes.split_at_checked(config.pre_trigger).unwrap_or((codes, &[]));
        let codes = codes.get(..MAX_SAMPLES).unwrap_or(codes);
        let statistics = loops
            .statistics(self.of_full_gain(codes), config.code_shift, &scratch.statistics)
            .with_ambient(config.ambient, before, config.code_shift, config.black);
        scratch.statistics = statistics;
        self.filter(loops, codes, &statistics, scratch);
        let dithered = scratch.shots.take(config.shots);
        let threshold = Threshold::new(config, &statistics);
        let y = scratch.y.get(..codes.len()).unwrap_or_default();
        loops.peaks(y, threshold.level, &mut scratch.peaks);
        if scratch.peaks.is_empty() {
            return Echoes::new();
        }
        self.report(loops, codes, scratch, &threshold, dithered)
    }

    /// Samples that ambient and noise are measured from: those of full gain, or all where there are
    /// none.
    #[inline(never)]
    fn of_full_gain<'a>(&self, codes: &'a [u16]) -> &'a [u16] {
        let full = self.config.ramp.as_ref().and_then(|ramp| codes.get(ramp.samples()..));
        full.filter(|full| !full.is_empty()).unwrap_or(codes)
    }

    /// Removes the baseline and filters, into `scratch.y[..codes.len()]`.
    #[inline(always)]
    fn filter(
        &self,
        loops: impl SampleLoops,
        codes: &[u16],
        statistics: &Statistics,
        scratch: &mut Scratch,
    ) {
        let config = &self.config;
        let start = config.template.half();
        let end = start.saturating_add(codes.len());
        let (old_start, old_end) = scratch.filled;
        // The last waveform may have begun earlier or ended later: zeros there again.
        scratch.padded.get_mut(old_start.min(start)..start).unwrap_or_default().fill(0);
        scratch.padded.get_mut(end..old_end.max(end)).unwrap_or_default().fill(0);
        scratch.filled = (start, end);
        let x = scratch.padded.get_mut(start..end).unwrap_or_default();
        loops.remove_baseline(
            codes,
            config.clip_code,
            config.code_shift,
            statistics.ambient_q15(),
            x,
        );
        if let Some(near) = self.near(statistics.ambient_q15()) {
            loops.remove_near_baseline(&near, codes, 0..near.ramp.samples(), x);
        }
        let y = scratch.y.get_mut(..codes.len().next_multiple_of(16)).unwrap_or_default();
        loops.correlate(config.template.taps_in_pairs(), &scratch.padded, y);
    }

    /// Near gain of a waveform with this ambient light.
    fn near(&self, ambient: i16) -> Option<Near<'_>> {
        let config = &self.config;
        config.ramp.as_ref().map(|ramp| Near { ramp, config, ambient })
    }

    /// Turns candidates into echoes. Not inlined: there are rarely more than a few.
    #[inline(never)]
    fn report(
        &self,
        loops: impl SampleLoops,
        codes: &[u16],
        scratch: &mut Scratch,
        threshold: &Threshold,
        dithered: bool,
    ) -> Echoes {
        let noise = Noise::new(&scratch.statistics, self.config.shot_noise);
        let Some(near) = self.near(threshold.ambient) else {
            let seen = Conditions { threshold, noise: &noise, near: None, level: None, dithered };
            let refiner = self.refiner(codes, scratch, seen);
            return self.echoes(&refiner, scratch);
        };
        let seen = Conditions { threshold, noise: &noise, near: Some(near), level: None, dithered };
        self.echoes_of_rising_gain(loops, codes, scratch, (seen, near))
    }

    #[inline(always)]
    fn echoes(&self, refiner: &Refiner<'_>, scratch: &Scratch) -> Echoes {
        let (chosen, overlapping) = self.choose(refiner, &scratch.peaks);
        let mut echoes = Echoes::new();
        for peak in chosen {
            let hidden = overlapping.contains(&peak.index);
            if let Some(echo) = self.echo(refiner, scratch, peak, hidden) {
                let _ = echoes.push(echo); // choose() gives no more than fit
            }
        }
        echoes
    }

    /// Echoes where the gain rises, each with threshold, noise and gain of its own.
    #[inline(never)]
    fn echoes_of_rising_gain(
        &self,
        loops: impl SampleLoops,
        codes: &[u16],
        scratch: &mut Scratch,
        (seen, near): (Conditions<'_>, Near<'_>),
    ) -> Echoes {
        let (chosen, overlapping) =
            self.choose(&self.refiner(codes, scratch, seen), &scratch.peaks);
        let mut echoes = Echoes::new();
        for &peak in &chosen {
            let hidden = overlapping.contains(&peak.index);
            let echo = match near.holds(peak.index.into()) {
                true => self.near_echo(loops, codes, scratch, (seen, near), (peak, hidden)),
                false => self.echo(&self.refiner(codes, scratch, seen), scratch, peak, hidden),
            };
            if let Some(echo) = echo {
                let _ = echoes.push(echo); // choose() gives no more than fit
            }
        }
        echoes
    }

    /// Peaks that become echoes, and indices of those hidden in others.
    #[inline(always)]
    fn choose(&self, refiner: &Refiner<'_>, peaks: &Peaks) -> (Chosen, Overlapping) {
        let Some(sharpener) = &self.config.sharpener else {
            return (refiner.chosen(peaks), Overlapping::new());
        };
        let mut peaks = peaks.clone();
        let overlapping = Self::split(sharpener, refiner, &mut peaks);
        (refiner.chosen(&peaks), overlapping)
    }

    /// Echo before the ramp's end. The samples around it are brought to one gain and filtered
    /// again, then put back as they were.
    fn near_echo(
        &self,
        loops: impl SampleLoops,
        codes: &[u16],
        scratch: &mut Scratch,
        (full, near): (Conditions<'_>, Near<'_>),
        (peak, hidden): (Peak, bool),
    ) -> Option<Echo> {
        let n = peak.index.into();
        let noise = near.noise(n, full.noise);
        let threshold = near.threshold(n, &noise, full.threshold);
        let around = self.refiner(codes, scratch, full).around(peak);
        loops.level(&near, n, around.clone(), scratch.x_mut());
        self.filter_again(loops, around.clone(), scratch);
        let level = if hidden { peak } else { self.summit(scratch, peak) };
        let here = Conditions { threshold: &threshold, noise: &noise, level: Some(n), ..full };
        let echo = self.echo(&self.refiner(codes, scratch, here), scratch, level, hidden);
        loops.remove_near_baseline(&near, codes, around.clone(), scratch.x_mut());
        self.filter_again(loops, around, scratch);
        echo
    }

    /// Filters again where all taps lie within the range `x`.
    fn filter_again(&self, loops: impl SampleLoops, x: Range<usize>, scratch: &mut Scratch) {
        let template = &self.config.template;
        let (start, end) = scratch.filled;
        let samples = end.saturating_sub(start);
        // Beyond either end of the waveform there are zeros, at every gain.
        let first = if x.start == 0 { 0 } else { x.start.saturating_add(template.half()) };
        let last = match x.end < samples {
            true => x.end.saturating_sub(template.half()),
            false => samples,
        };
        let y = scratch.y.get_mut(first..last).unwrap_or_default();
        let padded = scratch.padded.get(first..).unwrap_or_default();
        loops.correlate_all(template.taps_in_pairs(), padded, y);
    }

    /// Peak moved to the first sample of its plateau in y, at most K samples earlier.
    fn summit(&self, scratch: &Scratch, peak: Peak) -> Peak {
        let height = |n: u16| scratch.y.get(usize::from(n)).copied().unwrap_or(0);
        let mut index = peak.index;
        for _ in 0..self.config.reach {
            match index.checked_sub(1) {
                Some(before) if height(before) >= height(index) => index = before,
                _ => break,
            }
        }
        Peak { index, height: height(index) }
    }

    #[inline(always)]
    fn echo(
        &self,
        refiner: &Refiner<'_>,
        scratch: &Scratch,
        peak: Peak,
        hidden: bool,
    ) -> Option<Echo> {
        let (taps, samples) = (self.config.template.taps(), refiner.waveform.codes.len());
        let mut refined =
            refiner.refine(|n| filter::exact(taps, &scratch.padded, samples, n), peak);
        if hidden {
            self.sharpen(refiner, peak, &mut refined);
        }
        let seen_at = refiner.level.unwrap_or(peak.index.into());
        Echo::from_peak(&self.config, &refined, refiner.threshold, seen_at)
    }

    fn refiner<'a>(
        &'a self,
        codes: &'a [u16],
        scratch: &'a Scratch,
        seen: Conditions<'a>,
    ) -> Refiner<'a> {
        let Conditions { threshold, noise, near, level, dithered } = seen;
        let config = &self.config;
        let y = scratch.y.get(..codes.len()).unwrap_or_default();
        let dithered =
            config.dithered.as_ref().filter(|_| dithered).map(|read_with| DitheredEdges {
                config: read_with,
                shots: &scratch.shots,
                before: config.pre_trigger,
                samples: codes.len(),
                ambient: threshold.ambient,
                noise,
                level: near.zip(level),
            });
        let waveform = Waveform { codes, x: scratch.x(), y };
        Refiner { config, waveform, threshold, noise, dithered, near, level }
    }

    /// Adds the peaks hidden in broad ones and returns their indices. A sharpened sample costs as
    /// much as a filtered one, so narrow echoes are skipped; so are clipped ones, because the
    /// sharpener gives a flat top horns.
    #[inline(never)]
    fn split(sharpener: &Sharpener, refiner: &Refiner<'_>, peaks: &mut Peaks) -> Overlapping {
        let Waveform { x, y, .. } = refiner.waveform;
        let (sigma, level) = (refiner.noise.sigma, refiner.threshold.level);
        let splitter = Splitter { sharpener, x, y, sigma, level };
        let mut overlapping = Overlapping::new();
        *peaks = splitter.split(peaks, |peak| refiner.may_overlap(peak), &mut overlapping);
        overlapping
    }

    #[inline(never)]
    fn sharpen(&self, refiner: &Refiner<'_>, peak: Peak, refined: &mut Refined) {
        if let Some(sharpener) = &self.config.sharpener {
            refiner.sharpen(|n| sharpener.exact(refiner.waveform.x, n), peak, refined);
        }
    }
}

const _: () = assert!(MAX_SAMPLES.is_multiple_of(16), "the filter writes whole blocks");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::{Portable, Scalar};
    use crate::settings::PARAMETERS;

    /// Darkness, saturation, a step, spikes and a ramp, whatever the ADC's resolution.
    fn waveforms() -> [[u16; MAX_SAMPLES + 1]; 5] {
        let step = core::array::from_fn(|n| if n < MAX_SAMPLES / 2 { 0 } else { u16::MAX });
        let spikes = core::array::from_fn(|n| if n % 40 == 7 { 0x3fff } else { 100 });
        let ramp = core::array::from_fn(|n| (27 * n) as u16);
        [[0; MAX_SAMPLES + 1], [u16::MAX; MAX_SAMPLES + 1], step, spikes, ramp]
    }

    #[test]
    fn no_hardware_and_no_codes_panic_or_overflow() {
        let mut scratch = Scratch::new();
        for adc_bits in [0, 7, 8, 14, 15, 16, 31, 32, u32::MAX] {
            for (range_min_mm, range_max_mm) in
                [(1_000, 120_000), (0, 0), (9, 2), (u32::MAX, u32::MAX), (0, u32::MAX)]
            {
                let hardware = Hardware {
                    adc_bits,
                    range_min_mm,
                    range_max_mm,
                    energy_limit_pj: u32::MAX,
                    unit_echo_milli: adc_bits,
                    shot_noise_ppm: range_min_mm,
                };
                let Ok(pipeline) = Pipeline::new(&Settings::default(), &hardware) else { continue };
                for codes in waveforms() {
                    for length in [0, 1, 2, 3, 17, 800, MAX_SAMPLES + 1] {
                        let portable = pipeline.process(Portable, &codes[..length], &mut scratch);
                        assert_eq!(
                            pipeline.process(Scalar, &codes[..length], &mut scratch),
                            portable
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn no_value_of_a_setting_panics_or_overflows() {
        for parameter in &PARAMETERS {
            for value in [i32::MIN, -1, 0, parameter.min, parameter.max, 3, 31, 32, i32::MAX] {
                let mut settings = Settings::default();
                settings.set(parameter.id, Some(value));
                if let Ok(pipeline) = Pipeline::new(&settings, &Hardware::REFERENCE) {
                    pipeline.process(Portable, &waveforms()[3], &mut Scratch::new());
                }
            }
        }
    }
}
