//! Columns below a header: a name and a value a line; or exports of oscilloscopes, which say what
//! they are, then have a time and values a line.
//!
//! LeCroy's spreadsheet format has several segments one below the other, each with times of its
//! own; Tektronix writes what it says of itself before the columns (MSO, DPO) or beside them (TDS):
//!
//! ```text
//! LECROYWR64Xi,1234,Waveform          Model,MSO54            Record Length,2.5e+03,,-2e-07,0.02
//! Segments,2,SegmentSize,3            Sample Interval,4e-10  Sample Interval,4e-10,,-1.996e-07,0
//! Segment,TrigTime,TimeSinceSegment1  TIME,CH1,CH2           Trigger Point,5e+02,,-1.992e-07,0.02
//! #1,24-Nov-2026 09:37:08,0           -2e-07,0.02,1.4        ,,,-1.988e-07,0.02
//! #2,24-Nov-2026 09:37:09,1.1         -1.996e-07,0,1.41
//! Time,Ampl
//! -1e-09,0.1
//! ```

use echoloop_files::one_line;

use super::axis::{ROUNDED, TimeAxis, even_step, uneven};
use super::read::no_number;
use super::rows::Rows;

/// Least number of lines of a segment.
const LEAST: usize = 8;

/// Greatest step of times in seconds whose unit is not named.
const LONGEST_S: f64 = 1e-4;

/// Waveforms of such a text, segment by segment, each with its columns in their order; `None` where
/// it is none. Times are in seconds, or in the unit beside or below their name.
///
/// # Errors
///
/// A cell that is no finite number below or at the end of such columns, by row and column.
pub(super) fn parse(text: &str) -> Option<Result<Rows, String>> {
    let (places, lines): (Vec<usize>, Vec<Vec<&str>>) = text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(place, line)| (place + 1, cells(line)))
        .unzip();
    let is_number = |cell: &&str| number(cell).is_some();
    let last = lines.last()?;
    let numbers = |line: &Vec<&str>| -> Vec<usize> {
        (0..line.len()).filter(|&k| is_number(&line[k])).collect()
    };
    let mut columns = numbers(last);
    let missing = |line: &Vec<&str>, columns: &[usize]| {
        columns.iter().copied().find(|&k| !line.get(k).is_some_and(is_number))
    };
    let refused = |line: usize, column: usize| {
        let found = lines[line].get(column).map_or("nothing".into(), |cell| format!("{cell:?}"));
        Some(Err(no_number(places[line], column + 1, &one_line(&found), "")))
    };
    // A cut last line must not take a column away.
    if let Some(before) = lines.len().checked_sub(2).filter(|before| *before >= LEAST)
        && let Some(column) = missing(last, &numbers(&lines[before]))
    {
        return refused(before + 1, column);
    }
    let is_data = |line: &Vec<&str>| missing(line, &columns).is_none();
    let first = lines.iter().rposition(|line| !is_data(line)).map_or(0, |before| before + 1);
    if let Some(other) = first.checked_sub(1) {
        let above = lines[..other].iter().rev().take_while(|line| is_data(line)).count();
        if let Some(column) = missing(&lines[other], &columns).filter(|_| above >= LEAST) {
            return refused(other, column);
        }
    }
    // A line of names says which column is the time; an index of the sample may stand before it,
    // and a line of units after it.
    let (mut unit_s, mut names_time, mut increment_s) = (None, false, None);
    for names in first.saturating_sub(2)..first {
        let below = |column: usize| lines[first - 1].get(column);
        if let Some(time) = lines[names].iter().position(|name| time_unit(name).is_some()) {
            columns.retain(|&k| k >= time);
            let beside = time_unit(lines[names][time]).and_then(unit);
            unit_s = beside.or(below(time).and_then(|cell| unit(cell)));
            names_time = true;
        }
        let is_increment = |name: &&str| name.eq_ignore_ascii_case("increment");
        if let Some(column) = lines[names].iter().position(is_increment) {
            increment_s = below(column).and_then(|cell| number(cell));
        }
    }
    let data = &lines[first..];
    let of =
        |k: usize| -> Vec<f64> { data.iter().filter_map(|line| number(line.get(k)?)).collect() };
    if first == 1 && data.len() >= LEAST && lines.iter().all(|line| line.len() == 1) {
        return Some(Ok(Rows::of_column(of(0))));
    }
    let (&time, values) = columns.split_first()?;
    let times: Vec<f64> = of(time).into_iter().map(|time| time * unit_s.unwrap_or(1.0)).collect();
    let values: Vec<Vec<f64>> = values.iter().map(|&k| of(k)).collect();
    let starts = (1..times.len()).filter(|&n| times[n] < times[n - 1]);
    let bounds: Vec<usize> = [0].into_iter().chain(starts).chain([times.len()]).collect();
    let (mut rows, mut step) = (Vec::new(), None);
    for bound in bounds.windows(2) {
        let own = bound[0]..bound[1];
        let of_segment = even_step(&times[own.clone()], ROUNDED).filter(|_| own.len() >= LEAST);
        let Some(of_segment) = of_segment else {
            if !names_time || times.len() < LEAST {
                return None;
            }
            // Without an uneven step it is the segment's end that comes too soon.
            let line = own.start + uneven(&times[own.clone()]).unwrap_or(own.len());
            let row = places[(first + line).min(places.len() - 1)];
            return Some(Err(format!(
                "row {row}, column {}: expected times that rise in even steps",
                time + 1
            )));
        };
        if (of_segment / *step.get_or_insert(of_segment) - 1.0).abs() > 0.01 {
            return None;
        }
        rows.extend(values.iter().map(|column| column[own.clone()].to_vec()));
    }
    let step = step.filter(|_| !rows.is_empty())?;
    let name = first.checked_sub(1).and_then(|names| lines[names].get(time));
    let is_index = !names_time && step == 1.0 && name.is_some_and(|name| is_index(name));
    // A name without a unit is that of seconds where these are such as waveforms have.
    let is_in_seconds = unit_s.is_some() || step < LONGEST_S;
    Some(Ok(match increment_s {
        Some(step) => Rows::in_columns(rows, TimeAxis { step, is_in_seconds: true }),
        None if is_index => Rows::of_rows(rows),
        None => Rows::in_columns(rows, TimeAxis { step, is_in_seconds }),
    }))
}

/// What stands behind `time` or `t` in a column's name, its unit as a rule; `None` of other names.
fn time_unit(name: &str) -> Option<&str> {
    let after = |start: &str| {
        let (begin, rest) = name.split_at_checked(start.len())?;
        begin.eq_ignore_ascii_case(start).then_some(rest)
    };
    let is_whole = |rest: &&str| !rest.starts_with(char::is_alphanumeric);
    after("time").or_else(|| after("t").filter(is_whole))
}

/// True of the name of a column that may number the samples.
fn is_index(name: &str) -> bool {
    ["", "#", "n", "i", "x", "index", "sample", "samples", "point", "points", "sequence", "bin"]
        .contains(&name.to_ascii_lowercase().as_str())
}

/// Seconds of a unit of time, as `ns`, ` (ns)`, `_us` or `[ms]`; `None` of anything else.
fn unit(text: &str) -> Option<f64> {
    let name: String = text.chars().filter(|letter| letter.is_alphabetic()).collect();
    match name.to_lowercase().as_str() {
        "s" => Some(1.0),
        "ms" => Some(1e-3),
        "us" | "µs" | "μs" => Some(1e-6),
        "ns" => Some(1e-9),
        "ps" => Some(1e-12),
        _ => None,
    }
}

fn cells(line: &str) -> Vec<&str> {
    line.split(',').map(|cell| cell.trim().trim_matches('"').trim()).collect()
}

fn number(cell: &str) -> Option<f64> {
    cell.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment(step: f64, channels: usize, offset: f64) -> String {
        let line = |n: usize| {
            let values =
                (0..channels).map(|c| format!(",{}", n as f64 + 100.0 * c as f64 + offset));
            format!("{:e}{}\n", (n as f64 - 3.0) * step, values.collect::<String>())
        };
        (0..9).map(line).collect()
    }

    #[test]
    fn the_segments_of_a_lecroy_are_waveforms() {
        let text = format!(
            "LECROYWR64Xi,1234,Waveform\r\nSegments,2,SegmentSize,9\nSegment,TrigTime,\
             TimeSinceSegment1\n#1,24-Nov-2026 09:37:08,0\n#2,24-Nov-2026 09:37:09,1.1\nTime,Ampl\n\
             {}{}",
            segment(1e-9, 1, 0.0),
            segment(1e-9, 1, 50.0)
        );
        let rows = parse(&text).unwrap().unwrap();
        assert_eq!((rows.len(), rows.row(0)[2], rows.row(1)[2]), (2, 2.0, 52.0));
        let axis = rows.axis().unwrap();
        assert!(axis.is_in_seconds && (axis.step - 1e-9).abs() < 1e-15);
    }

    #[test]
    fn a_tektronix_says_what_it_is_before_its_columns_or_beside_them() {
        let before = format!(
            "Model,MSO54\nSample Interval,4e-10\n\nTIME,CH1,CH2\n{}",
            segment(4e-10, 2, 0.0)
        );
        let rows = parse(&before).unwrap().unwrap();
        assert_eq!((rows.len(), rows.row(1)[4]), (2, 104.0));
        let about = ["Record Length,9", "Sample Interval,4e-10", "Source,CH1"];
        let beside: String = segment(4e-10, 1, 0.0)
            .lines()
            .enumerate()
            .map(|(n, line)| format!("{},,{line},\n", about.get(n).unwrap_or(&",")))
            .collect();
        let rows = parse(&beside).unwrap().unwrap();
        assert_eq!((rows.len(), rows.row(0).len(), rows.row(0)[8]), (1, 9, 8.0));
    }

    #[test]
    fn an_index_before_the_time_is_no_value() {
        let lines: String =
            (0..9).map(|n| format!("{n},{:e},{}\n", 4e-9 * f64::from(n), n % 4)).collect();
        let rows = parse(&format!("sample,time,ch1\n{lines}")).unwrap().unwrap();
        assert_eq!((rows.len(), rows.row(0)[5]), (1, 1.0));
        assert!((rows.axis().unwrap().step - 4e-9).abs() < 1e-15);
    }

    #[test]
    fn an_index_of_the_sample_is_no_time_and_a_time_without_a_unit_is_rarely_in_seconds() {
        let lines = |step: f64| segment(step, 1, 0.0);
        let axis = |text: String| {
            let rows = parse(&text).unwrap().unwrap();
            assert_eq!((rows.len(), rows.row(0)[5]), (1, 5.0), "{text}");
            rows.axis()
        };
        for name in ["sample", "", "#", "Index"] {
            assert_eq!(axis(format!("{name},counts\n{}", lines(1.0))), None, "{name}");
        }
        let rigol = "X,CH1,Start,Increment,\nSequence,Volt,-1.0e-7,5.0e-10\n";
        let expected = TimeAxis { step: 5e-10, is_in_seconds: true };
        assert_eq!(axis(format!("{rigol}{}", lines(1.0))), Some(expected));
        for (name, step, is_in_seconds) in [
            ("time", 0.5, false),
            ("t", 5e-10, true),
            ("range_m", 0.15, false),
            ("t (us)", 5e-4, true),
            ("x", 5e-10, true),
            ("total", 5e-4, false),
        ] {
            let axis = axis(format!("{name},counts\n{}", lines(step))).unwrap();
            assert_eq!(axis.is_in_seconds, is_in_seconds, "{name}");
            let unit_s = if name == "t (us)" { 1e-6 } else { 1.0 };
            assert!((axis.step / (step * unit_s) - 1.0).abs() < 1e-6, "{name}: {}", axis.step);
        }
    }

    #[test]
    fn a_name_and_a_value_a_line_are_one_waveform() {
        let lines: String = (0..9).map(|n| format!("{n}\n")).collect();
        let rows = parse(&format!("\"imp\"\n{lines}")).unwrap().unwrap();
        assert_eq!((rows.len(), rows.row(0)[8], rows.axis()), (1, 8.0, None));
        assert!(rows.remarks()[0].contains("one waveform of 9 samples"));
    }

    #[test]
    fn a_bad_cell_below_the_columns_is_named_and_loses_none() {
        let below = segment(1e-9, 2, 0.0);
        let table = [
            (format!("Time,A,B\n{below}1,,3\n{below}"), "row 11, column 2: "),
            (format!("Time,A,B\n{below}1,nan,3\n{below}"), "row 11, column 2: "),
            (format!("Time,A,B\n{below}\n6e-9,9\n"), "row 12, column 3: "),
            (format!("Time,A,B\n{below}Time,A,B\n{below}"), "row 11, column 1: "),
        ];
        for (text, part) in table {
            let problem = parse(&text).unwrap().expect_err(part);
            assert!(problem.starts_with(part), "{problem}");
        }
    }

    #[test]
    fn a_unit_stands_beside_the_time_or_below_it() {
        let below = segment(0.5, 1, 0.0);
        for names in ["Time (ns),A", "time_ns,A", "Time,Channel A\n(ns),(mV)", "TIME [ns],CH1"] {
            let rows = parse(&format!("{names}\n{below}")).unwrap().unwrap();
            assert!((rows.axis().unwrap().step - 5e-10).abs() < 1e-15, "{names}");
        }
        let seconds = parse(&format!("Time,Ampl\n{below}")).unwrap().unwrap();
        assert_eq!(seconds.axis().unwrap().step, 0.5);
    }

    #[test]
    fn a_text_without_even_times_is_none() {
        for text in ["", "V1,V2\n1,2\n", "Time,Ampl\n0,1\n1,2\n", "a\nb\n", "Time\n1\n2\n3\n"] {
            assert_eq!(parse(text), None, "{text}");
        }
        let uneven = segment(1e-9, 1, 0.0) + "1e-6,4\n";
        assert_eq!(parse(&format!("A,B\n{uneven}")), None);
        let named = parse(&format!("Time,Ampl\n{uneven}")).unwrap().expect_err("uneven");
        assert_eq!(named, "row 11, column 1: expected times that rise in even steps");
        // In the second of two segments, and times that fall.
        let second = segment(1e-9, 1, 0.0) + &uneven;
        let named = parse(&format!("Time,Ampl\n{second}")).unwrap().expect_err("uneven");
        assert!(named.starts_with("row 20, column 1: "), "{named}");
        let falling: String = (0..9).map(|n| format!("{},1\n", 9 - n)).collect();
        let named = parse(&format!("Time,Ampl\n{falling}")).unwrap().expect_err("falling");
        assert!(named.starts_with("row 3, column 1: "), "{named}");
        let two_steps = segment(1e-9, 1, 0.0) + &segment(2e-9, 1, 0.0);
        assert_eq!(parse(&format!("Time,Ampl\n{two_steps}")), None);
    }
}
