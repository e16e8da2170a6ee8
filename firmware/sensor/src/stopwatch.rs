//! Times of scans, and their deadline.

use echoloop_link::Times;

/// Adds up the time that the sensor is busy with each scan.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stopwatch {
    times: Times,
    scan: Option<Scan>,
}

/// Scan that is being timed.
#[derive(Clone, Copy, Debug)]
struct Scan {
    /// Count of the scan since the start.
    number: u32,
    busy_us: u32,
    /// True when the scan has been counted: beams that are asked for again are no new scan.
    counted: bool,
}

impl Stopwatch {
    /// Restarts with a deadline in µs; 0: none.
    pub(crate) fn set_deadline(&mut self, deadline_us: u32) {
        *self = Self { times: Times { deadline_us, ..Times::default() }, scan: None };
    }

    /// Times that scans have taken. `clock` is true when the board has one.
    pub(crate) fn times(&self, clock: bool) -> Times {
        Times { clock, ..self.times }
    }

    /// Adds time that the sensor was busy with a scan; `whole` is true when all its beams are
    /// measured.
    pub(crate) fn add(&mut self, number: u32, busy_us: u32, whole: bool) {
        let begun = Scan { number, busy_us: 0, counted: false };
        let mut scan = self.scan.filter(|scan| scan.number == number).unwrap_or(begun);
        scan.busy_us = scan.busy_us.saturating_add(busy_us);
        if whole && !scan.counted {
            self.count(scan.busy_us);
            scan.counted = true;
        }
        self.scan = Some(scan);
    }

    fn count(&mut self, busy_us: u32) {
        let Times { deadline_us, scans, late, last_us, longest_us, .. } = &mut self.times;
        *scans = scans.wrapping_add(1);
        *late = late.wrapping_add(u32::from(*deadline_us > 0 && busy_us > *deadline_us));
        *last_us = busy_us;
        *longest_us = busy_us.max(*longest_us);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scan_s_time_is_that_of_all_its_parts() {
        let mut stopwatch = Stopwatch::default();
        stopwatch.set_deadline(100);
        for (number, parts) in [(1, [40, 30, 30]), (2, [40, 30, 31]), (3, [1, 1, 1])] {
            for (i, us) in parts.into_iter().enumerate() {
                stopwatch.add(number, us, i == 2);
            }
        }
        let expected =
            Times { clock: true, deadline_us: 100, scans: 3, late: 1, last_us: 3, longest_us: 101 };
        assert_eq!(stopwatch.times(true), expected);
    }

    #[test]
    fn beams_asked_for_again_are_no_second_scan() {
        let mut stopwatch = Stopwatch::default();
        stopwatch.set_deadline(5);
        stopwatch.add(1, 4, true);
        stopwatch.add(1, 4, true);
        assert_eq!((stopwatch.times(true).scans, stopwatch.times(true).late), (1, 0));
    }

    #[test]
    fn half_a_scan_does_not_count_nor_add_to_the_next_one_s_time() {
        let mut stopwatch = Stopwatch::default();
        stopwatch.set_deadline(5);
        stopwatch.add(1, 4, false);
        assert_eq!(stopwatch.times(true).scans, 0);
        stopwatch.add(2, 4, true);
        assert_eq!((stopwatch.times(true).late, stopwatch.times(true).last_us), (0, 4));
    }

    #[test]
    fn without_a_deadline_nothing_is_late() {
        let mut stopwatch = Stopwatch::default();
        stopwatch.add(1, u32::MAX, false);
        stopwatch.add(1, u32::MAX, true);
        let Times { late, longest_us, .. } = stopwatch.times(true);
        assert_eq!((late, longest_us), (0, u32::MAX), "what is too long for a word is the longest");
    }

    #[test]
    fn a_deadline_begins_a_new_count() {
        let mut stopwatch = Stopwatch::default();
        stopwatch.add(1, 7, true);
        stopwatch.set_deadline(3);
        let expected = Times { clock: false, deadline_us: 3, ..Times::default() };
        assert_eq!(stopwatch.times(false), expected);
    }
}
