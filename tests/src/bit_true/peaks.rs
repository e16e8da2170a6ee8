//! Local maxima, separated and chosen.

use echoloop_dsp::choice::EchoChoice;

use super::values::Peak;

/// Candidates held.
const CANDIDATES: usize = 32;

/// What counts as a fall or a rise, whole LSB.
pub fn hysteresis(height: f64, threshold: f64) -> f64 {
    (threshold / 2.0).floor().max((height / 16.0).floor())
}

/// Local maxima by rising index, the 32 highest (of equals the first).
pub fn peaks(y: &[f64], threshold: f64) -> Vec<Peak> {
    let found =
        climbs(y, threshold, (threshold / 2.0).floor(), |height| hysteresis(height, threshold));
    let mut strongest = by(&found, |p| p.height);
    strongest.truncate(CANDIDATES);
    strongest.sort_by_key(|p| p.index);
    strongest
}

/// Climbs from valley to peak to valley; below `rest` it waits for the threshold again.
pub fn climbs(y: &[f64], threshold: f64, rest: f64, hysteresis: impl Fn(f64) -> f64) -> Vec<Peak> {
    let mut found = Vec::new();
    let mut samples = y.iter().copied().enumerate().map(|(index, height)| Peak { index, height });
    let Some(mut top) = samples.find(|s| s.height >= threshold) else { return found };
    loop {
        // Up, until it has fallen far enough from the top.
        let fallen = samples.by_ref().find(|s| {
            if s.height > top.height {
                top = *s;
            }
            s.height < top.height - hysteresis(top.height)
        });
        found.push(top);
        let Some(fallen) = fallen else { return found };
        // Down, until it has risen far enough from the valley, or from rest to the threshold.
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

/// By a strength, greatest first, of equals the first.
fn by(peaks: &[Peak], strength: impl Fn(&Peak) -> f64) -> Vec<Peak> {
    let mut peaks = peaks.to_vec();
    peaks.sort_by(|a, b| strength(b).total_cmp(&strength(a)).then(a.index.cmp(&b.index)));
    peaks
}

/// Greedily, strongest first: whatever lies nearer than `min_separation` to one kept goes. By
/// rising index.
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

/// At most `count` of peaks that stand by rising index.
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
