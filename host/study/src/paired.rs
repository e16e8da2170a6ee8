//! Comparison of two protocols on the same held-out pairs.
//!
//! Where recall differs, means over successes cover different pairs: a higher recall has more hard
//! ones. So errors are compared on the pairs that both find, and pairs that one finds are counted.

use serde::Serialize;

use super::cell::Cell;
use super::record::Record;
use echoloop_closed_loop::evaluation::objective::PairError;
use echoloop_closed_loop::evaluation::summary::succeeds;
use echoloop_statistics::Estimate;

/// Lower bound of an error in a ratio, m.
const FLOOR_M: f64 = 1e-4;

/// Joint tuning compared with another protocol of the same method, scene, range and strategy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Paired {
    /// The cell of joint tuning.
    pub cell: Cell,
    /// The cell of the other protocol.
    pub other: Cell,
    /// Pairs that both find.
    pub both: usize,
    /// Pairs that joint tuning alone finds.
    pub gained: usize,
    /// Pairs that the other alone finds.
    pub lost: usize,
    /// Ratio of e_t of joint tuning to the other's on the pairs that both find: geometric mean with
    /// its 95 % interval by bootstrap over pairs. Below 1 joint tuning is better.
    pub translation_ratio: Option<Estimate>,
}

/// Each cell of joint tuning compared with every other protocol on the same pairs.
pub(super) fn paired(records: &[&Record]) -> Vec<Paired> {
    let joint = records.iter().filter(|record| record.cell.is_joint());
    joint
        .flat_map(|joint| {
            let of = |other: &Cell| records.iter().find(|record| record.cell == *other);
            let found: Vec<&Record> = joint.cell.others().iter().filter_map(of).copied().collect();
            found.into_iter().filter_map(move |other| compare(joint, other))
        })
        .collect()
}

/// Cells of a scene and a method share their held-out pairs; `None` where the counts differ, as in
/// a folder filled by hand.
fn compare(joint: &Record, other: &Record) -> Option<Paired> {
    let (own, theirs) = (&joint.summary.errors, &other.summary.errors);
    if own.len() != theirs.len() {
        return None;
    }
    let found = |error: &PairError| succeeds(error, &joint.data);
    let count = |wanted: (bool, bool)| {
        own.iter().zip(theirs).filter(|(a, b)| (found(a), found(b)) == wanted).count()
    };
    let ratios: Vec<f64> = own
        .iter()
        .zip(theirs)
        .filter(|(a, b)| found(a) && found(b))
        .map(|(a, b)| {
            libm::log(a.translation_m.max(FLOOR_M)) - libm::log(b.translation_m.max(FLOOR_M))
        })
        .collect();
    let mean = |indices: &[usize]| {
        libm::exp(indices.iter().map(|&i| ratios[i]).sum::<f64>() / indices.len() as f64)
    };
    let ratio = || Estimate::by_bootstrap(ratios.len(), &mean);
    let translation_ratio = (!ratios.is_empty()).then(ratio);
    Some(Paired {
        cell: joint.cell,
        other: other.cell,
        both: ratios.len(),
        gained: count((true, false)),
        lost: count((false, true)),
        translation_ratio,
    })
}

#[cfg(test)]
mod tests {
    use super::super::record::fixture::{start, summary};
    use super::*;
    use echoloop_closed_loop::config::DataConfig;
    use echoloop_closed_loop::config::preset::{Protocol, Strategy};
    use echoloop_closed_loop::dataset::fingerprint::Content;
    use echoloop_closed_loop::parameters::Values;

    fn record(protocol: Protocol, errors_m: &[f64]) -> Record {
        Record {
            format: Record::FORMAT,
            cell: Cell {
                strategy: (protocol != Protocol::Default).then_some(Strategy::Fast),
                protocol,
                ..start("icp", "structured")
            },
            seed: 1,
            version: String::new(),
            build: None,
            configuration: String::new(),
            trained_in: None,
            content: Content::default(),
            origin: String::new(),
            generations: 0,
            registrations: 0,
            parameters: Values::default(),
            data: DataConfig::default(),
            summary: summary(errors_m),
        }
    }

    #[test]
    fn only_pairs_that_both_find_are_compared_and_what_one_finds_is_counted() {
        let joint = record(Protocol::Joint, &[0.01, 0.02, 0.40, 9.0]);
        let registration = record(Protocol::Registration, &[0.02, 0.04, 9.0, 0.01]);
        let start = record(Protocol::Default, &[0.01, 0.02, 9.0, 9.0]);
        let found = paired(&[&start, &registration, &joint]);
        let others: Vec<Protocol> = found.iter().map(|paired| paired.other.protocol).collect();
        assert_eq!(others, [Protocol::Default, Protocol::Registration]);
        let [to_start, to_registration] = &found[..] else { panic!("{found:?}") };
        let counts = |paired: &Paired| (paired.both, paired.gained, paired.lost);
        assert_eq!((counts(to_start), counts(to_registration)), ((2, 1, 0), (2, 1, 1)));
        let ratio = |paired: &Paired| paired.translation_ratio.unwrap().value;
        assert!((ratio(to_registration) - 0.5).abs() < 1e-12);
        assert!((ratio(to_start) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn where_no_pair_is_found_by_both_there_is_no_ratio_and_other_pairs_are_not_compared() {
        let joint = record(Protocol::Joint, &[9.0, 0.02]);
        let lidar = record(Protocol::Lidar, &[0.02, 9.0]);
        let found = paired(&[&lidar, &joint]);
        assert_eq!(found[0].translation_ratio, None);
        assert_eq!((found[0].both, found[0].gained, found[0].lost), (0, 1, 1));
        let fewer = record(Protocol::Lidar, &[0.02]);
        assert_eq!(paired(&[&fewer, &joint]), []);
    }
}
