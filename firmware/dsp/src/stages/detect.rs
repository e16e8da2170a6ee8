//! Thresholds and peaks.

use heapless::Vec;

use crate::config::DetectorConfig;
use crate::limits::{MAX_ECHOES, MAX_SAMPLES};
use crate::q::shift_round;
use crate::settings::choice::EchoChoice;
use crate::stages::peak::{Candidate, Candidates, Peak, Peaks};
use crate::stages::statistics::Statistics;

/// Detection threshold, with the noise and the ambient light it is derived from.
///
/// ```text
/// σ_y = σ̂ · r              noise after the filter
/// T   = max(g·N, (k + e)·σ_y, 1 LSB)      e: of noise that is clipped at 0, else 0 ([`dark`])
/// ```
///
/// | name | meaning | format |
/// |---|---|---|
/// | `σ_y` | filtered noise, nearest | Q13.19 |
/// | `k` | SNR threshold | Q8.8 |
/// | `T` | threshold on `y`, at most 1 − 2⁻¹⁵ | Q1.15: g·N, and (k + e)·σ_y + ½ LSB, nearest |
///
/// `y` is rounded to nearest: the half is for what a lower value has gained by it. Where σ_y is
/// about 1 LSB, as of many shots at a low gain, false alarms would be ten times as many. There the
/// nearest level may be half an LSB low, of 4 LSB an eighth: below 16 LSB it is the next one up.
///
/// N and k are the paper's two thresholds (Sec. 3.2): the higher one counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Threshold {
    /// σ_y, Q13.19.
    pub sigma: u32,
    /// T, Q1.15.
    pub level: i16,
    /// Ambient light that the baseline removed, Q1.15.
    pub ambient: i16,
}

/// Level below which the threshold is rounded up, LSB.
const COARSE: i64 = 16;

impl Threshold {
    /// Threshold for a waveform with these statistics.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "σ below 2³², r at most 2¹⁵, k below 2¹¹: products below 2⁴⁷"
    )]
    pub fn new(config: &DetectorConfig, statistics: &Statistics) -> Self {
        let noise_gain = i64::from(config.template.noise_gain);
        let sigma = shift_round(i64::from(statistics.sigma) * noise_gain, 15);
        let median = u32::from(statistics.median) << (config.code_shift + 4);
        let snr = config.snr_threshold + config.dark.excess(median, statistics.sigma);
        let by_noise = sigma * i64::from(snr) + (1 << 11);
        let up = if by_noise < COARSE << 12 { (1 << 12) - 1 } else { 1 << 11 };
        let by_noise = (by_noise + up) >> 12;
        let level = by_noise.max(i64::from(config.floor)).clamp(1, 0x7fff);
        Self { sigma: sigma as u32, level: level as i16, ambient: statistics.ambient_q15() }
    }
}

/// Fall from a peak, or rise from a valley, that separates two peaks of `y`: half the threshold or
/// a sixteenth of the height, whichever is more, both rounded down to whole LSB.
///
/// Noise, shot noise included, makes no second peak on an echo; two equal echoes split once the
/// valley between them is a sixteenth deep.
#[inline(always)]
pub fn hysteresis(height: i16, threshold: i16) -> i16 {
    (threshold >> 1).max(height >> 4)
}

enum State {
    Idle,
    Rising(Peak),
    Falling(i16),
}

/// Finds the local maxima of `y` at or above the threshold, with [`hysteresis`], by rising index.
///
/// ```text
/// idle     y ≥ T                         → rising
/// rising   y > peak: the new peak;   y < peak − h(peak): a peak is found → falling
/// falling  y < valley: the new valley;   y < T/2 → idle;   y ≥ T and y > valley + h(y) → rising
/// ```
///
/// T/2 is rounded down. The sample that ends a climb is the first valley, or makes the state idle
/// at once. A climb that the end of the waveform cuts off counts. Beyond
/// [`MAX_CANDIDATES`](crate::stages::peak::MAX_CANDIDATES) peaks the lowest are dropped, of equals
/// the last.
///
/// `reaches` answers as [`reaches`] does: true when any of the values is at or above the threshold.
/// Blocks for which it is false are skipped.
#[inline(always)]
#[expect(
    clippy::arithmetic_side_effects,
    reason = "the index of a value of y, which lies in memory"
)]
pub fn peaks(reaches: impl Fn(&[i16]) -> bool, y: &[i16], threshold: i16, found: &mut Peaks) {
    found.clear();
    let mut state = State::Idle;
    for (block, values) in y.chunks(BLOCK).enumerate() {
        if matches!(state, State::Idle) && !reaches(values) {
            continue;
        }
        for (i, &value) in values.iter().enumerate() {
            let here = Peak { index: (block * BLOCK + i) as u16, height: value };
            state = step(state, here, threshold, found);
        }
    }
    if let State::Rising(peak) = state {
        insert(found, peak);
    }
}

/// [`peaks`] that jumps from hill to hill: for processors that find the next sample at or above
/// the threshold faster than sample by sample. `first_reaching` returns the index of the first
/// such value, if there is one.
#[inline(always)]
#[expect(clippy::arithmetic_side_effects, reason = "indices of values of y, which lies in memory")]
pub fn peaks_of_hills(
    first_reaching: impl Fn(&[i16]) -> Option<usize>,
    y: &[i16],
    threshold: i16,
    found: &mut Peaks,
) {
    found.clear();
    let mut end = 0;
    while let Some(skipped) = y.get(end..).and_then(&first_reaching) {
        end = hill(y, end + skipped, threshold, found);
    }
}

/// Finds the peaks of one hill: from `first`, a value at or above the threshold, until [`peaks`]
/// would be idle again. Returns the index of the sample after it.
#[inline(always)]
#[expect(clippy::arithmetic_side_effects, reason = "indices of values of y, which lies in memory")]
fn hill(y: &[i16], first: usize, threshold: i16, found: &mut Peaks) -> usize {
    let mut state = State::Idle;
    for (index, &height) in y.iter().enumerate().skip(first) {
        state = step(state, Peak { index: index as u16, height }, threshold, found);
        if matches!(state, State::Idle) {
            return index + 1;
        }
    }
    if let State::Rising(peak) = state {
        insert(found, peak);
    }
    y.len()
}

/// True when any value is at or above the threshold. Reads all of them, which vectorises; stopping
/// early would not. The portable form of [`SampleLoops::reaches`](crate::SampleLoops::reaches).
#[inline(always)]
pub fn reaches(values: &[i16], threshold: i16) -> bool {
    values.iter().fold(false, |any, &v| any | (v >= threshold))
}

/// Number of samples that are skipped at a time while none reaches the threshold.
const BLOCK: usize = 32;

const _: () = assert!(MAX_SAMPLES <= u16::MAX as usize);

#[inline(always)]
#[expect(
    clippy::arithmetic_side_effects,
    reason = "below a peak's height by a sixteenth or half of it; sums in i32"
)]
fn step(state: State, here: Peak, threshold: i16, found: &mut Peaks) -> State {
    match state {
        State::Idle if here.height >= threshold => State::Rising(here),
        State::Idle => State::Idle,
        State::Rising(peak) if here.height > peak.height => State::Rising(here),
        State::Rising(peak) if here.height < peak.height - hysteresis(peak.height, threshold) => {
            insert(found, peak);
            fallen(here.height, threshold)
        }
        State::Rising(peak) => State::Rising(peak),
        State::Falling(valley) if here.height < valley => fallen(here.height, threshold),
        State::Falling(valley)
            if here.height >= threshold
                && i32::from(here.height)
                    > i32::from(valley) + i32::from(hysteresis(here.height, threshold)) =>
        {
            State::Rising(here)
        }
        State::Falling(valley) => State::Falling(valley),
    }
}

#[inline(always)]
fn fallen(valley: i16, threshold: i16) -> State {
    if valley < threshold >> 1 { State::Idle } else { State::Falling(valley) }
}

/// Adds a peak; when there is no room, the lowest of all is dropped (of equals, the last).
pub(crate) fn insert(found: &mut Peaks, peak: Peak) {
    if found.push(peak).is_ok() {
        return;
    }
    let weakest = found.iter().rev().min_by_key(|p| p.height).copied();
    if let Some(weakest) = weakest.filter(|w| w.height < peak.height) {
        found.retain(|p| *p != weakest);
        let _ = found.push(peak); // one has just gone
    }
}

/// Keeps, strongest first, each peak that lies at least `min_separation` samples from every
/// stronger one kept.
pub fn separate(found: &mut Candidates, min_separation: u32) {
    if found.len() < 2 {
        return;
    }
    let mut waiting = found.clone();
    let mut kept = Candidates::new();
    while let Some(strongest) = take(&mut waiting, strongest) {
        let index = strongest.peak.index;
        if kept.iter().all(|k| u32::from(k.peak.index.abs_diff(index)) >= min_separation) {
            let _ = kept.push(strongest); // no more than were found
        }
    }
    found.retain(|c| kept.contains(c));
}

/// Strongest candidate, of equals the first.
fn strongest(found: &[Candidate]) -> Option<Candidate> {
    found.iter().copied().reduce(|a, b| if b.strength > a.strength { b } else { a })
}

/// Removes and returns the candidate that `pick` chooses.
fn take(
    found: &mut Candidates,
    pick: impl Fn(&[Candidate]) -> Option<Candidate>,
) -> Option<Candidate> {
    let picked = pick(found)?;
    found.retain(|c| *c != picked);
    Some(picked)
}

/// Peaks that become echoes: at most `count`, chosen and ordered by `choice`.
pub fn choose(mut found: Candidates, count: usize, choice: EchoChoice) -> Vec<Peak, MAX_ECHOES> {
    let pick = |found: &[Candidate]| match choice {
        EchoChoice::First => found.first().copied(),
        EchoChoice::Last => found.last().copied(),
        EchoChoice::Strongest => strongest(found),
    };
    let mut chosen = Vec::new();
    while chosen.len() < count.min(MAX_ECHOES)
        && let Some(candidate) = take(&mut found, pick)
    {
        let _ = chosen.push(candidate.peak); // fewer than MAX_ECHOES
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::peak::MAX_CANDIDATES;

    fn find(y: &[i16], threshold: i16) -> Peaks {
        let mut found = Peaks::new();
        peaks(|values| reaches(values, threshold), y, threshold, &mut found);
        found
    }

    #[test]
    fn a_plateau_peaks_at_its_first_sample() {
        assert_eq!(find(&[0, 10, 50, 50, 50, 10, 0], 20)[..], [Peak { index: 2, height: 50 }]);
    }

    #[test]
    fn ripple_smaller_than_the_hysteresis_is_one_peak() {
        assert_eq!(find(&[0, 100, 95, 101, 96, 0], 20).len(), 1);
        assert_eq!(find(&[0, 100, 60, 101, 96, 0], 20).len(), 2);
    }

    #[test]
    fn an_echo_still_rising_at_the_end_is_found() {
        assert_eq!(find(&[0, 0, 30, 40], 20)[..], [Peak { index: 3, height: 40 }]);
    }

    #[test]
    fn the_weaker_of_two_close_peaks_goes_and_its_own_neighbour_stays() {
        let mut found = Candidates::new();
        for (index, strength) in [(10, 5), (14, 6), (18, 7)] {
            found.push(Candidate { peak: Peak { index, height: 9 }, strength }).unwrap();
        }
        separate(&mut found, 6);
        assert_eq!(found.iter().map(|c| c.peak.index).collect::<Vec<_, 4>>()[..], [10, 18]);
    }

    #[test]
    fn when_there_is_no_room_the_weakest_peak_goes() {
        let mut y = [0i16; 400];
        for i in 0..40 {
            y[10 * i + 5] = 100 + i as i16;
        }
        let found = find(&y, 20);
        assert_eq!(found.len(), MAX_CANDIDATES);
        assert!(found.iter().all(|p| p.height >= 108));
    }
}
