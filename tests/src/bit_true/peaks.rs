//! Detection of local maxima, their separation and choice.

use echoloop_dsp::choice::EchoChoice;

use super::values::Peak;

/// Capacity for candidates.
const CANDIDATES: usize = 32;

/// Least fall or rise that counts, whole LSB.
pub fn hysteresis(height: f64, threshold: f64) -> f64 {
    (threshold / 2.0).floor().max((height / 16.0).floor())
}

/// The 32 highest local maxima, of equal ones the first, by index.
pub fn peaks(y: &[f64], threshold: f64) -> Vec<Peak> {
    let found =
        climbs(y, threshold, (threshold / 2.0).floor(), |height| hysteresis(height, threshold));
    let mut strongest = by(&found, |p| p.height);
    strongest.truncate(CANDIDATES);
    strongest.sort_by_key(|p| p.index);
    strongest
}

/// Local maxima by index. Once the values fall below `rest`, they must reach the threshold again.
pub fn climbs(y: &[f64], threshold: f64, rest: f64, hysteresis: impl Fn(f64) -> f64) -> Vec<Peak> {
    let mut found = Vec::new();
    let mut samples = y.iter().copied().enumerate().map(|(index, height)| Peak { index, height });
    let Some(mut top) = samples.find(|s| s.height >= threshold) else { return found };
    loop {
        // Upwards, until the values have fallen far enough from the top.
        let fallen = samples.by_ref().find(|s| {
            if s.height > top.height {
                top = *s;
            }
            s.height < top.height - hysteresis(top.height)
        });
        found.push(top);
        let Some(fallen) = fallen else { return found };
        // Downwards, until they have risen far enough from the valley, or from rest to the
        // threshold.
        let mut valley = fallen.height;
        let mut resting = valley < rest;
        let risen = samples.by_ref().find(|s| {
            if !resting && s.height < valley {
                valley = s.height;
                resting = valley < rest;
                return false;
            }
            s.height >= threshold && (resting || s.height > valley + hysteresis(s.height))
        });
        let Some(risen) = risen else { return found };
        top = risen;
    }
}

/// Peaks sorted by strength, strongest first; equal ones by index.
fn by(peaks: &[Peak], strength: impl Fn(&Peak) -> f64) -> Vec<Peak> {
    let mut peaks = peaks.to_vec();
    peaks.sort_by(|a, b| strength(b).total_cmp(&strength(a)).then(a.index.cmp(&b.index)));
    peaks
}

/// Drops peaks nearer than `min_separation` to a stronger one that is kept. By index.
pub fn separate(peaks: &[Peak], min_separation: f64, strength: impl Fn(&Peak) -> f64) -> Vec<Peak> {
    let mut kept: Vec<Peak> = Vec::new();
    for peak in by(peaks, strength) {
        if !kept.iter().any(|k| (k.index.abs_diff(peak.index) as f64) < min_separation) {
            kept.push(peak);
        }
    }
    kept.sort_by_key(|p| p.index);
    kept
}

/// Chooses at most `count` of the peaks, which are sorted by index.
pub fn choose(
    peaks: &[Peak],
    count: usize,
    choice: EchoChoice,
    strength: impl Fn(&Peak) -> f64,
) -> Vec<Peak> {
    let mut order = match choice {
        EchoChoice::First => peaks.to_vec(),
        EchoChoice::Last => peaks.iter().rev().copied().collect(),
        _ => by(peaks, strength),
    };
    order.truncate(count);
    order
}
