//! `echoloop echoes` on waveforms with known echoes, on files that are wrong, and on the records of
//! others.

use std::fs;
use std::path::PathBuf;

use crate::fixture::Fixture;
use echoloop_needs::data;
use echoloop_random::Generator;
use serde_json::Value;

/// Runs the command on rows and gives the lines it prints.
fn echoes(fixture: &Fixture, rows: &[Vec<f64>], more: &[&str]) -> Vec<Value> {
    fixture.write("waves.csv", csv(rows));
    let output =
        fixture.succeed(&[&["echoes", "waves.csv", "--sample-ns", "1", "--json"], more].concat());
    let lines: Vec<Value> =
        output.stdout.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    assert_eq!(lines.len(), rows.len(), "one line a waveform");
    lines
}

fn csv(rows: &[Vec<f64>]) -> String {
    let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
    rows.iter().map(line).collect()
}

fn list<'v>(waveform: &'v Value, key: &str) -> Vec<&'v Value> {
    waveform["echoes"].as_array().expect("a list").iter().map(|echo| &echo[key]).collect()
}

fn numbers(waveform: &Value, key: &str) -> Vec<f64> {
    list(waveform, key).iter().map(|value| value.as_f64().expect("a number")).collect()
}

fn has_flag(waveform: &Value, echo: usize, flag: &str) -> bool {
    list(waveform, "flags")[echo].as_array().expect("a list").iter().any(|name| name == flag)
}

/// Gaussian echoes of (time, amplitude, width at half maximum) on an ambient, as whole numbers.
fn record(samples: usize, ambient: f64, echoes: &[(f64, f64, f64)]) -> Vec<f64> {
    let value = |n: usize, &(time, amplitude, width): &(f64, f64, f64)| {
        amplitude * (-4.0 * 2f64.ln() * ((n as f64 - time) / width).powi(2)).exp()
    };
    (0..samples)
        .map(|n| (ambient + echoes.iter().map(|echo| value(n, echo)).sum::<f64>()).round())
        .collect()
}

/// A pulse that rises fast and falls slowly, peaking at a time: amplitude 1.
fn skewed(n: f64, peak: f64) -> f64 {
    let t = (n - peak + 6.0).max(0.0) / 6.0;
    (t * (1.0 - t).exp()).powi(4)
}

#[test]
fn an_echo_is_told_with_its_time_amplitude_and_width() {
    let fixture = Fixture::new();
    let found = echoes(&fixture, &[record(80, 200.0, &[(37.3, 500.0, 8.0)])], &[]);
    assert_eq!(found[0]["waveform"], 0);
    assert_eq!(found[0]["outgoing_peak_ns"], Value::Null);
    let (time, amplitude, width) = (
        numbers(&found[0], "time_ns"),
        numbers(&found[0], "amplitude"),
        numbers(&found[0], "width_ns"),
    );
    assert!(
        (time[0] - 37.3).abs() < 0.05
            && (amplitude[0] - 500.0).abs() < 8.0
            && (width[0] - 8.0).abs() < 0.2,
        "{found:?}"
    );
    assert_eq!(list(&found[0], "flags"), [&Value::Array(vec![])]);
}

#[test]
fn times_and_widths_are_in_the_samples_nanoseconds_and_amplitudes_in_the_file_s_units() {
    let fixture = Fixture::new();
    let row: Vec<f64> =
        record(80, 200.0, &[(37.3, 5000.0, 8.0)]).iter().map(|v| v * 1e-4 - 3.0).collect();
    fixture.write("waves.csv", csv(&[row]));
    let output = fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "0.5", "--json"]);
    let found = output.json();
    assert!((numbers(&found, "time_ns")[0] - 37.3 / 2.0).abs() < 0.03, "{found}");
    assert!((numbers(&found, "amplitude")[0] - 0.5).abs() < 0.005, "{found}");
    assert!((numbers(&found, "width_ns")[0] - 4.0).abs() < 0.1, "{found}");
}

#[test]
fn a_few_samples_are_enough() {
    let fixture = Fixture::new();
    let rows = [
        vec![0., 0., 10., 20., 10., 0., 0.],
        vec![0., 0., 0., 100., 0., 0., 0., 0.],
        vec![9., 9., 40., 80., 80., 40., 9., 9.],
    ];
    let found = echoes(&fixture, &rows, &[]);
    let times: Vec<_> = found.iter().map(|waveform| numbers(waveform, "time_ns")).collect();
    assert_eq!(times, [[3.0], [3.0], [3.5]]);
}

#[test]
fn zeros_that_pad_a_row_change_nothing() {
    let fixture = Fixture::new();
    let row = record(60, 210.0, &[(30.0, 400.0, 12.0), (48.0, 150.0, 12.0)]);
    let mut padded = row.clone();
    padded.resize(208, 0.0);
    let found = echoes(&fixture, &[row, padded], &[]);
    assert_eq!(found[0]["echoes"], found[1]["echoes"]);
    assert_eq!(numbers(&found[0], "time_ns").len(), 2);
}

#[test]
fn a_clipped_top_s_time_is_its_middle_and_it_is_flagged() {
    let fixture = Fixture::new();
    let clipped: Vec<f64> =
        record(90, 20.0, &[(41.4, 3000.0, 12.0)]).iter().map(|v| v.min(1023.0)).collect();
    let tailed: Vec<f64> =
        (0..90).map(|n| (20.0 + 3000.0 * skewed(f64::from(n), 40.0)).round().min(1023.0)).collect();
    let edges = |row: &[f64]| {
        let top = |&(_, &v): &(usize, &f64)| v == 1023.0;
        let first = row.iter().enumerate().find(top).expect("clipped").0;
        let last = row.iter().enumerate().rev().find(top).expect("clipped").0;
        (first + last) as f64 / 2.0
    };
    let middles = [edges(&clipped), edges(&tailed)];
    for (found, middle) in echoes(&fixture, &[clipped, tailed], &[]).iter().zip(middles) {
        assert_eq!(numbers(found, "time_ns"), [middle], "{found}");
        assert!(has_flag(found, 0, "saturated"));
        assert!((numbers(found, "amplitude")[0] - 1003.0).abs() < 3.0, "{found}");
    }
}

#[test]
fn a_clipped_top_that_wavers_is_one_echo_at_its_middle() {
    let fixture = Fixture::new();
    let row = |k: usize| {
        let time = 50.0 + k as f64 / 10.0;
        let clipped = |(n, v): (usize, &f64)| match v.min(249.0) {
            top if top == 249.0 => top - ((7 * n + 3 * k) % 4) as f64,
            v => v,
        };
        record(120, 12.0, &[(time, 900.0, 7.0)]).iter().enumerate().map(clipped).collect()
    };
    let rows: Vec<Vec<f64>> = (0..10).map(row).collect();
    for (k, found) in echoes(&fixture, &rows, &[]).iter().enumerate() {
        let times = numbers(found, "time_ns");
        assert!(times.len() == 1 && has_flag(found, 0, "saturated"), "{found}");
        assert!((times[0] - 50.0 - k as f64 / 10.0).abs() <= 0.5, "{found}");
    }
}

#[test]
fn a_plateau_below_the_top_is_timed_by_its_middle_without_the_flag() {
    let fixture = Fixture::new();
    let mut row = vec![5.0; 60];
    row[20..25].copy_from_slice(&[40.0, 90.0, 90.0, 90.0, 30.0]);
    row[40..43].copy_from_slice(&[60.0, 140.0, 55.0]);
    let found = echoes(&fixture, &[row], &[]);
    assert_eq!(numbers(&found[0], "time_ns")[0], 22.0);
    assert!(
        !has_flag(&found[0], 0, "saturated") && !has_flag(&found[0], 1, "saturated"),
        "{found:?}"
    );
}

#[test]
fn overlapping_echoes_come_apart_and_are_flagged() {
    let fixture = Fixture::new();
    let found =
        echoes(&fixture, &[record(90, 10.0, &[(35.0, 800.0, 8.0), (45.5, 600.0, 8.0)])], &[]);
    let times = numbers(&found[0], "time_ns");
    assert!(
        times.len() == 2 && (times[0] - 35.0).abs() < 0.3 && (times[1] - 45.5).abs() < 0.3,
        "{found:?}"
    );
    let close =
        echoes(&fixture, &[record(90, 10.0, &[(35.0, 800.0, 8.0), (43.6, 700.0, 8.0)])], &[]);
    assert!(has_flag(&close[0], 0, "merged") && has_flag(&close[0], 1, "merged"), "{close:?}");
}

#[test]
fn an_echo_that_the_record_cuts_off_is_flagged_and_one_whose_top_lies_outside_is_none() {
    let fixture = Fixture::new();
    let found = echoes(
        &fixture,
        &[record(43, 10.0, &[(40.0, 800.0, 8.0)]), record(40, 10.0, &[(40.5, 800.0, 8.0)])],
        &[],
    );
    assert!(
        (numbers(&found[0], "time_ns")[0] - 40.0).abs() < 0.3
            && has_flag(&found[0], 0, "truncated"),
        "{found:?}"
    );
    assert_eq!(found[1]["echoes"], Value::Array(vec![]));
}

#[test]
fn ringing_after_a_strong_echo_is_no_echo() {
    let fixture = Fixture::new();
    let ring = |n: f64| {
        if n < 30.0 {
            0.0
        } else {
            -0.2 * (-(n - 30.0) / 15.0).exp() * ((n - 30.0) / 8.0 * std::f64::consts::PI).sin()
        }
    };
    let row = |second: f64| -> Vec<f64> {
        let echo = record(160, 300.0, &[(25.0, 2000.0, 6.0), (100.0, second, 6.0)]);
        echo.iter().zip(0..).map(|(v, n)| (v + 2000.0 * ring(f64::from(n))).round()).collect()
    };
    let found = echoes(&fixture, &[row(0.0), row(400.0)], &[]);
    assert_eq!(numbers(&found[0], "time_ns").len(), 1, "{found:?}");
    assert_eq!(numbers(&found[1], "time_ns").len(), 2, "a real echo stays: {found:?}");
}

#[test]
fn what_the_outgoing_pulse_repeats_is_no_echo() {
    let fixture = Fixture::new();
    let pulse = |at: f64, amplitude: f64| [(at, amplitude, 5.0), (at + 14.0, amplitude / 8.0, 5.0)];
    let row = record(120, 200.0, &[pulse(30.0, 900.0), pulse(70.0, 500.0)].concat());
    fixture.write("out.csv", csv(&[record(60, 200.0, &pulse(25.0, 700.0))]));
    let without = echoes(&fixture, std::slice::from_ref(&row), &[]);
    assert_eq!(numbers(&without[0], "time_ns").len(), 4);
    let found = echoes(&fixture, &[row], &["--outgoing", "out.csv"]);
    let times = numbers(&found[0], "time_ns");
    assert!(
        times.len() == 2 && (times[0] - 30.0).abs() < 0.1 && (times[1] - 70.0).abs() < 0.1,
        "{found:?}"
    );
}

#[test]
fn an_asymmetric_pulse_is_timed_by_its_peak() {
    let fixture = Fixture::new();
    let row = |at: f64, amplitude: f64| -> Vec<f64> {
        (0..100).map(|n| (200.0 + amplitude * skewed(f64::from(n), at)).round()).collect()
    };
    fixture.write("out.csv", csv(&[row(22.0, 3000.0)]));
    let rows: Vec<_> = [30.0, 30.3, 41.7].iter().map(|&at| row(at, 2000.0)).collect();
    let found = echoes(&fixture, &rows, &["--outgoing", "out.csv"]);
    for (waveform, at) in found.iter().zip([30.0, 30.3, 41.7]) {
        assert!(
            (waveform["outgoing_peak_ns"].as_f64().expect("a number") - 22.0).abs() < 0.15,
            "{waveform}"
        );
        assert!((numbers(waveform, "time_ns")[0] - at).abs() < 0.15, "{waveform}");
    }
}

#[test]
fn outgoing_rows_are_one_each_or_one_for_all() {
    let fixture = Fixture::new();
    let rows = vec![record(60, 10.0, &[(30.0, 300.0, 6.0)]); 3];
    let pulse = |at: f64| record(50, 10.0, &[(at, 300.0, 6.0)]);
    fixture.write("each.csv", csv(&[pulse(20.0), vec![7.0; 50], pulse(24.0)]));
    let found = echoes(&fixture, &rows, &["--outgoing", "each.csv"]);
    let peaks: Vec<_> =
        found.iter().map(|waveform| waveform["outgoing_peak_ns"].as_f64()).collect();
    assert_eq!(peaks[1], None, "a row without a pulse counts as absent");
    assert!(
        (peaks[0].expect("a pulse") - 20.0).abs() < 0.1
            && (peaks[2].expect("a pulse") - 24.0).abs() < 0.1
    );
    let output =
        fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "1", "--outgoing", "each.csv"]);
    assert!(output.stderr.contains("each.csv: row 2 shows no pulse"), "{}", output.stderr);
    fixture.write("two.csv", csv(&[pulse(20.0), pulse(24.0)]));
    let arguments = ["echoes", "waves.csv", "--sample-ns", "1", "--outgoing", "two.csv"];
    fixture.refuses(&arguments, &["two.csv: expected 1 row or 3, as waves.csv has, found 2"]);
}

#[test]
fn waveforms_without_an_echo_give_none() {
    let fixture = Fixture::new();
    let ramp = (0..40).map(f64::from).collect();
    let step = (0..14).map(|n| if n < 6 { 0.0 } else { 100.0 }).collect();
    let rows = [
        vec![5.0],
        vec![],
        vec![7.0; 100],
        vec![1023.0; 60],
        vec![0.0; 30],
        vec![1.0, 9.0],
        vec![3.0, 1.0, 2.0],
        ramp,
        step,
    ];
    for waveform in echoes(&fixture, &rows, &[]) {
        assert_eq!(waveform["echoes"], Value::Array(vec![]), "{waveform}");
    }
}

#[test]
fn files_that_are_wrong_are_refused_with_their_place() {
    let fixture = Fixture::new();
    let header =
        |shape: &str| format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}");
    let npy = |shape: &str, data: &[f32]| -> Vec<u8> {
        let header = header(shape);
        let bytes: Vec<u8> = data.iter().flat_map(|v| v.to_le_bytes()).collect();
        [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &bytes]
            .concat()
    };
    let files: [(&str, Vec<u8>, &str); 9] = [
        (
            "nan.csv",
            b"1,2,3\n4,NaN,6\n".to_vec(),
            "nan.csv: row 2, column 2: expected a finite number, found 'NaN'",
        ),
        (
            "inf.csv",
            b"1,-inf\n".to_vec(),
            "inf.csv: row 1, column 2: expected a finite number, found '-inf'",
        ),
        (
            "word.csv",
            b"1,2\n3,four\n".to_vec(),
            "word.csv: row 2, column 2: expected a finite number, found 'four'",
        ),
        (
            "head.csv",
            b"V1,V2\n1,2\n".to_vec(),
            "head.csv: row 1, column 1: expected a finite number, found 'V1' (the first line",
        ),
        ("empty.csv", Vec::new(), "empty.csv: expected at least one row, found none"),
        ("binary.csv", vec![0xff, 0xfe, 0], "binary.csv: expected CSV"),
        (
            "nan.npy",
            npy("(2, 2)", &[1.0, 2.0, f32::NAN, 4.0]),
            "nan.npy: row 2, column 1: expected a finite number, found NaN",
        ),
        (
            "short.npy",
            npy("(2, 2)", &[1.0]),
            "short.npy: not a .npy array of waveforms: expected 2 × 2 numbers of 4 bytes, found 4 \
             bytes",
        ),
        ("cube.npy", npy("(1, 1, 1)", &[1.0]), "expected one or two dimensions, found 3"),
    ];
    for (name, content, message) in files {
        fixture.write(name, content);
        fixture.refuses(&["echoes", name, "--sample-ns", "1", "--json"], &[message]);
        fixture.write("good.csv", "1,2,9,2,1\n");
        fixture
            .refuses(&["echoes", "good.csv", "--sample-ns", "1", "--outgoing", name], &[message]);
    }
    fixture.refuses(&["echoes", "absent.csv", "--sample-ns", "1"], &["absent.csv"]);
}

/// Runs the command on a text and gives the waveforms, and what it says.
fn of_text(fixture: &Fixture, text: &str, more: &[&str]) -> (Vec<Value>, String) {
    fixture.write("waves.csv", text);
    let output = fixture.succeed(&[&["echoes", "waves.csv", "--json"], more].concat());
    let lines = output.stdout.lines().map(|line| serde_json::from_str(line).expect(line));
    (lines.collect(), output.stderr)
}

const NS: [&str; 2] = ["--sample-ns", "1"];

#[test]
fn missing_samples_are_said_and_make_no_echo() {
    let fixture = Fixture::new();
    let row = record(300, 200.0, &[(80.0, 300.0, 7.0)]);
    let expected = numbers(&echoes(&fixture, std::slice::from_ref(&row), &[])[0], "time_ns");
    assert_eq!(expected.len(), 1);
    for (missing, said) in [
        ("65535", "3 samples of 65535 are taken for missing"),
        ("-9999", "3 samples of -9999 are taken for missing"),
        ("", "3 empty cells are missing samples"),
    ] {
        let cell = |(n, value): (usize, &f64)| match n {
            200..203 => missing.to_owned(),
            _ => value.to_string(),
        };
        let text = row.iter().enumerate().map(cell).collect::<Vec<_>>().join(",");
        let (found, stderr) = of_text(&fixture, &text, &NS);
        assert_eq!(numbers(&found[0], "time_ns"), expected, "{missing:?}");
        assert!(stderr.contains(said), "{stderr}");
    }
}

#[test]
fn falling_echoes_are_found_by_their_depth_and_said() {
    let fixture = Fixture::new();
    let rising = record(300, 1000.0, &[(80.0, 900.0, 7.0), (140.0, 300.0, 7.0)]);
    let falling: Vec<f64> = rising.iter().map(|value| 4000.0 - value).collect();
    let expected = echoes(&fixture, &[rising], &[]);
    let text = csv(&[falling]);
    let (found, stderr) = of_text(&fixture, &text, &NS);
    assert_eq!(found, expected);
    assert!(stderr.contains("echoes fall below the ambient"), "{stderr}");
    let (told, stderr) = of_text(&fixture, &text, &[&NS[..], &["--polarity=negative"]].concat());
    assert!(told == expected && !stderr.contains("fall below"), "{stderr}");
    let (kept, _) = of_text(&fixture, &text, &[&NS[..], &["--polarity=positive"]].concat());
    assert_ne!(kept, expected);
}

#[test]
fn waveforms_one_below_the_other_are_read_and_their_times_agree_with_the_flag() {
    let fixture = Fixture::new();
    let rows = [record(200, 10.0, &[(60.0, 90.0, 7.0)]), record(200, 10.0, &[(90.0, 80.0, 7.0)])];
    let expected = echoes(&fixture, &rows, &[]);
    let lines = |line: &dyn Fn(usize) -> String| (0..200).map(line).collect::<String>();
    let one = lines(&|n| format!("{}\n", rows[0][n]));
    let (found, stderr) = of_text(&fixture, &one, &NS);
    assert_eq!(found, expected[..1]);
    assert!(stderr.contains("one waveform of 200 samples"), "{stderr}");
    // Microseconds, which the flag tells; without it they might be anything.
    let timed = lines(&|n| format!("{},{},{}\n", 1e-3 * n as f64, rows[0][n], rows[1][n]));
    assert_eq!(of_text(&fixture, &timed, &NS).0, expected);
    fixture.refuses(&["echoes", "waves.csv"], &["--sample-ns", "steps of 0.001", "unknown unit"]);
    fixture.refuses(&["echoes", "waves.csv", "--sample-ns", "2"], &["is not what waves.csv says"]);
    // An oscilloscope's are seconds.
    let seconds = lines(&|n| format!("{:e},{},{}\n", 1e-9 * n as f64, rows[0][n], rows[1][n]));
    for head in [
        "LECROYWR64Xi,1,Waveform\nSegments,1,SegmentSize,200\nTime,Ampl,Ampl\n",
        "Model,MSO54\nTIME,CH1,CH2\n",
    ] {
        let (found, _) = of_text(&fixture, &format!("{head}{seconds}"), &[]);
        assert_eq!(found, expected, "{head}");
        fixture.refuses(&["echoes", "waves.csv", "--sample-ns", "1000"], &["steps of", " s"]);
    }
    fixture.write("waves.csv", csv(&rows));
    fixture.refuses(&["echoes", "waves.csv"], &["--sample-ns is missing"]);
}

#[test]
fn options_that_make_no_sense_are_refused_by_name() {
    let fixture = Fixture::new();
    fixture.write("waves.csv", "1,2,9,2,1\n");
    fixture.refuses(&["echoes", "waves.csv"], &["--sample-ns"]);
    for (flag, values) in [
        ("--sample-ns", ["0", "-1", "nan", "inf"]),
        ("--snr", ["0", "-5", "nan", "1e9"]),
        ("--floor", ["-0.1", "1.1", "nan", "inf"]),
        ("--min-separation-ns", ["-1", "nan", "inf", "1e400"]),
    ] {
        for value in values {
            let sampled: &[&str] = if flag == "--sample-ns" { &[] } else { &["--sample-ns", "1"] };
            fixture.refuses(&[&["echoes", "waves.csv", flag, value], sampled].concat(), &[flag]);
        }
    }
}

#[test]
fn options_choose_among_the_echoes() {
    let fixture = Fixture::new();
    let row = record(
        200,
        10.0,
        &[(30.0, 300.0, 6.0), (60.0, 900.0, 6.0), (90.0, 60.0, 6.0), (140.0, 20.0, 6.0)],
    );
    let times = |more: &[&str]| {
        numbers(&echoes(&fixture, std::slice::from_ref(&row), more)[0], "time_ns").len()
    };
    assert_eq!(times(&[]), 3);
    assert_eq!(times(&["--floor", "0.01"]), 4);
    assert_eq!(times(&["--floor", "0.5"]), 1);
    assert_eq!(times(&["--max-echoes", "2"]), 2);
    let only = &echoes(&fixture, std::slice::from_ref(&row), &["--max-echoes", "1"])[0];
    assert!((numbers(only, "time_ns")[0] - 60.0).abs() < 0.1, "the strongest: {only}");
    assert_eq!(times(&["--max-echoes", "0"]), 0);
    assert_eq!(times(&["--min-separation-ns", "35"]), 1);
}

#[test]
fn a_numpy_array_reads_as_the_same_numbers_in_text_do() {
    let fixture = Fixture::new();
    let row = record(60, 200.0, &[(30.0, 400.0, 6.0)]);
    let header = "{'descr': '<u2', 'fortran_order': False, 'shape': (60,), }\n";
    let data: Vec<u8> = row.iter().flat_map(|&v| (v as u16).to_le_bytes()).collect();
    fixture.write(
        "waves.npy",
        [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &data]
            .concat(),
    );
    let output = fixture.succeed(&["echoes", "waves.npy", "--sample-ns", "1", "--json"]);
    assert_eq!(output.json(), echoes(&fixture, &[row], &[])[0]);
}

#[test]
fn a_record_longer_than_the_dsp_s_memory_is_found_whole() {
    let fixture = Fixture::new();
    let times: Vec<f64> = (0..60).map(|i| 40.0 + 131.25 * f64::from(i)).collect();
    let all: Vec<_> = times.iter().map(|&t| (t, 700.0, 7.0)).collect();
    let found = echoes(&fixture, &[record(8000, 50.0, &all)], &["--max-echoes", "100"]);
    let got = numbers(&found[0], "time_ns");
    assert_eq!(got.len(), times.len());
    assert!(got.iter().zip(&times).all(|(a, b)| (a - b).abs() < 0.05), "{got:?}");
}

#[test]
fn the_number_of_threads_changes_nothing_and_people_get_a_table() {
    let fixture = Fixture::new();
    let rows: Vec<_> = (0..40)
        .map(|i| record(90, 30.0, &[(20.0 + f64::from(i), 500.0, 6.0), (70.0, 90.0, 9.0)]))
        .collect();
    assert_eq!(
        echoes(&fixture, &rows, &["--threads", "1"]),
        echoes(&fixture, &rows, &["--threads", "3"])
    );
    let output = fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "1"]);
    assert!(
        output.stdout.starts_with("waveform")
            && output.stdout.ends_with("80 echoes in 40 waveforms\n"),
        "{}",
        output.stdout
    );
}

/// Rows of an instrument of 8 bits whose pulse of 6 ns is repeated at 9 % after 23.4 ns, one wide
/// or narrow echo a row; every fourth row has another one behind it.
fn ringing_rows(rows: usize) -> Vec<Vec<f64>> {
    let row = |i: usize| {
        let i = i as f64;
        let (at, high, width) = (30.0 + (i * 0.37) % 7.0, 120.0 + (i * 13.0) % 110.0, 6.0);
        let width = if i % 3.0 == 0.0 { 2.0 * width } else { width };
        let mut echoes = vec![(at, high, width), (at + 23.4, 0.09 * high, width)];
        if i % 4.0 == 1.0 {
            echoes.push((at + 40.0 + i % 5.0, 0.5 * high, 6.0));
        }
        record(130, 12.0, &echoes)
    };
    (0..rows).map(row).collect()
}

fn count(found: &[Value]) -> Vec<usize> {
    found.iter().map(|waveform| numbers(waveform, "time_ns").len()).collect()
}

#[test]
fn what_the_instrument_repeats_after_every_echo_is_no_echo() {
    let fixture = Fixture::new();
    let rows = ringing_rows(160);
    let truth: Vec<usize> = (0..160).map(|i| 1 + usize::from(i % 4 == 1)).collect();
    assert_eq!(count(&echoes(&fixture, &rows, &[])), truth);
    let without = count(&echoes(&fixture, &rows, &["--no-response"]));
    assert!(without.iter().sum::<usize>() > truth.iter().sum::<usize>() + 150, "{without:?}");
}

#[test]
fn tops_that_are_no_echoes_are_counted_and_listed_with_the_reason() {
    let fixture = Fixture::new();
    fixture.write("waves.csv", csv(&ringing_rows(160)));
    let explain = |more: &[&str]| {
        fixture.succeed(
            &[&["echoes", "waves.csv", "--sample-ns", "1", "--explain", "1"], more].concat(),
        )
    };
    let output = explain(&[]);
    // Row 1: an echo at 30.37, its repeat 23.4 later, and a second echo 41 later.
    let listed: Vec<&str> = output.stdout.lines().filter(|line| line.contains("no echo")).collect();
    let times: Vec<f64> =
        listed.iter().filter_map(|line| line.split_whitespace().nth(1)?.parse().ok()).collect();
    assert!(
        times.iter().any(|time| (time - 53.77).abs() < 1.5)
            && listed.iter().all(|line| line.contains("response of other echoes")),
        "{}",
        output.stdout
    );
    assert!(output.stderr.contains("explained by the response of other echoes"));
    let kept = explain(&["--max-echoes", "1"]);
    assert!(kept.stdout.contains("no echo: more than --max-echoes"), "{}", kept.stdout);
    let beyond = ["echoes", "waves.csv", "--sample-ns", "1", "--explain", "160"];
    fixture.refuses(&beyond, &["--explain 160", "160 rows"]);
}

#[test]
fn a_background_that_steps_is_said_and_makes_no_echo() {
    let fixture = Fixture::new();
    let row = |i: u32| -> Vec<f64> {
        let echo = record(300, 200.0, &[(80.0 + f64::from(i) / 10.0, 1000.0, 6.0)]);
        let step = |n: usize| if n < 150 { 0.0 } else { 300.0 };
        echo.iter()
            .enumerate()
            .map(|(n, v)| v + step(n) + f64::from((n as u32 * 7 + i) % 5))
            .collect()
    };
    let rows: Vec<Vec<f64>> = (0..10).map(row).collect();
    fixture.write("waves.csv", csv(&rows));
    let output = fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "1"]);
    assert!(output.stdout.ends_with("10 echoes in 10 waveforms\n"), "{}", output.stdout);
    assert!(output.stderr.contains("background changes in 10 of 10 rows"), "{}", output.stderr);
}

#[test]
fn the_response_is_told_drawn_written_and_read_again() {
    let fixture = Fixture::new();
    let rows = ringing_rows(160);
    let more = ["--write-response", "response.csv", "--plot-response", "response.html"];
    let found = echoes(&fixture, &rows, &more);
    let told = fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "1"]).stderr;
    assert!(
        told.contains("response: from ") && told.contains("+9.") && told.contains("at 23."),
        "{told}"
    );
    assert!(fixture.read("response.html").contains("Response of waves.csv"));
    assert_eq!(count(&echoes(&fixture, &rows, &["--response", "response.csv"])), count(&found));
    let one = std::slice::from_ref(&rows[0]);
    assert_eq!(count(&echoes(&fixture, one, &[])), [2], "a row alone tells no response");
    assert_eq!(count(&echoes(&fixture, one, &["--response", "response.csv"])), [1]);
    // Times of the file are nanoseconds, whatever the samples are.
    fixture.write("twice.csv", csv(&rows));
    let read = ["echoes", "twice.csv", "--sample-ns", "2", "--response", "response.csv"];
    assert!(fixture.succeed(&read).stderr.contains("width 6."));
}

#[test]
fn two_walls_at_a_steady_distance_are_two_echoes_flagged_and_said() {
    let fixture = Fixture::new();
    // Both walls at the same place in every row, or the second a nanosecond nearer or farther.
    for (distance, level, off) in [(14.0, 0.08, 0.0), (30.0, 0.3, 1.0), (50.0, 0.9, 0.0)] {
        let row = |k: u32| {
            let time = 80.0 + f64::from(k * 7 % 10) / 10.0;
            let second = time + distance + off * (f64::from(k * 13 % 21) / 10.0 - 1.0);
            let jitter = f64::from(k * 29 % 11);
            record(240, 200.0, &[(time, 1000.0 + jitter, 6.0), (second, level * 1000.0, 6.0)])
        };
        let rows: Vec<Vec<f64>> = (0..60).map(row).collect();
        let found = echoes(&fixture, &rows, &[]);
        assert_eq!(count(&found), [2; 60], "{distance} ns apart");
        assert!(found.iter().all(|waveform| has_flag(waveform, 1, "possible-repeat")));
        assert!(found.iter().all(|waveform| !has_flag(waveform, 0, "possible-repeat")));
        let output = fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "1"]);
        assert!(output.stderr.contains("second targets at a steady distance"), "{}", output.stderr);
    }
}

#[test]
fn noise_behind_a_lone_wall_is_not_said_to_be_second_targets() {
    let fixture = Fixture::new();
    let row = |k: u64| {
        let noise = Generator::new(7, k).normals(300);
        let wall = record(300, 200.0, &[(80.0, 300.0, 6.0)]);
        wall.iter().zip(noise).map(|(code, noise)| (code + 4.0 * noise).round()).collect()
    };
    let rows: Vec<Vec<f64>> = (0..60).map(row).collect();
    assert_eq!(count(&echoes(&fixture, &rows, &[])), [1; 60]);
    let output = fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "1"]);
    assert!(!output.stderr.contains("second targets"), "{}", output.stderr);
}

#[test]
fn the_outgoing_pulse_tells_a_repeat_from_a_second_wall() {
    let fixture = Fixture::new();
    let rows: Vec<Vec<f64>> = (0..60u32)
        .map(|k| {
            let time = 80.0 + f64::from(k * 7 % 10) / 10.0;
            record(240, 200.0, &[(time, 1000.0, 6.0), (time + 30.0, 120.0, 6.0)])
        })
        .collect();
    let pulse = |repeat| record(120, 10.0, &[(40.0, 600.0, 6.0), (70.0, repeat, 6.0)]);
    let with = |fixture: &Fixture, repeat| {
        fixture.write("out.csv", csv(&[pulse(repeat)]));
        echoes(fixture, &rows, &["--outgoing", "out.csv"])
    };
    assert_eq!(count(&with(&fixture, 72.0)), [1; 60], "it repeats as much itself");
    let walls = with(&fixture, 0.0);
    assert_eq!(count(&walls), [2; 60]);
    assert!(walls.iter().all(|waveform| has_flag(waveform, 1, "possible-repeat")));
    // Heights that vary would tell the instrument, were it not for the pulse.
    let varied: Vec<Vec<f64>> = (0..60u32)
        .map(|k| {
            let high = 300.0 + 30.0 * f64::from(k * 17 % 60);
            record(240, 200.0, &[(80.0, high, 6.0), (110.0, 0.12 * high, 6.0)])
        })
        .collect();
    assert_eq!(count(&echoes(&fixture, &varied, &[])), [1; 60]);
    fixture.write("out.csv", csv(&[pulse(0.0)]));
    assert_eq!(count(&echoes(&fixture, &varied, &["--outgoing", "out.csv"])), [2; 60]);
}

#[test]
fn a_recording_that_shows_no_response_gives_what_it_gave_without_one() {
    let fixture = Fixture::new();
    let rows = [vec![], vec![7.0; 90], record(90, 10.0, &[(30.0, 500.0, 6.0), (52.0, 60.0, 6.0)])];
    for rows in [&rows[2..], &rows[..2], &rows[..]] {
        assert_eq!(echoes(&fixture, rows, &[]), echoes(&fixture, rows, &["--no-response"]));
        let plain = ["echoes", "waves.csv", "--sample-ns", "1"];
        let said = fixture.succeed(&plain).stderr;
        assert!(said.contains("40 are needed to tell the instrument's response"), "{said}");
        assert_eq!(fixture.succeed(&[&plain[..], &["--quiet"]].concat()).stderr, "");
        let asked = [&plain[..], &["--write-response", "response.csv"]].concat();
        fixture.refuses(&asked, &["40 are needed"]);
    }
}

#[test]
fn a_piece_that_was_left_out_hides_echoes_and_makes_none() {
    let fixture = Fixture::new();
    let whole = record(160, 210.0, &[(30.0, 400.0, 9.0), (80.0, 90.0, 9.0), (120.0, 200.0, 9.0)]);
    let cut = |gap: std::ops::Range<usize>| {
        let sample = |(i, &v): (usize, &f64)| if gap.contains(&i) { 0.0 } else { v };
        whole.iter().enumerate().map(sample).collect::<Vec<_>>()
    };
    // Between two echoes; over the second; from its top on; over its rise.
    let rows = [cut(48..64), cut(65..95), cut(81..95), cut(60..80), cut(62..63)];
    let found = echoes(&fixture, &rows, &["--no-response"]);
    assert_eq!(count(&found), [3, 2, 2, 2, 3]);
    let heights = numbers(&found[0], "amplitude");
    assert!((heights[0] - 400.0).abs() < 6.0 && (heights[1] - 90.0).abs() < 6.0, "{heights:?}");
}

#[test]
fn fewer_strong_echoes_tell_the_response_when_one_asks_for_it() {
    let fixture = Fixture::new();
    let rows = ringing_rows(24);
    let truth: Vec<usize> = (0..24).map(|i| 1 + usize::from(i % 4 == 1)).collect();
    let plain = echoes(&fixture, &rows, &[]);
    assert_eq!(plain, echoes(&fixture, &rows, &["--no-response"]));
    let said = fixture.succeed(&["echoes", "waves.csv", "--sample-ns", "1"]).stderr;
    assert!(said.contains("(--least-echoes 24 makes do with them)"), "{said}");
    assert_eq!(count(&echoes(&fixture, &rows, &["--least-echoes", "24"])), truth);
    assert_eq!(echoes(&fixture, &rows, &["--least-echoes", "25"]), plain);
    let few = ["echoes", "waves.csv", "--sample-ns", "1", "--least-echoes", "15"];
    fixture.refuses(&few, &["--least-echoes", "expected a whole number, 16 or more"]);
}

#[test]
fn a_response_longer_than_the_rows_is_as_good_as_its_part() {
    let fixture = Fixture::new();
    let point = |k: i32| {
        let level = (-4.0 * 2f64.ln() * (f64::from(k) / 12.0).powi(2)).exp();
        vec![f64::from(k) / 2.0, level]
    };
    fixture.write("long.csv", csv(&(-400..4000).map(point).collect::<Vec<_>>()));
    let rows = [record(40, 10.0, &[(14.0, 500.0, 6.0), (26.0, 300.0, 6.0)]), vec![1.0, 9.0, 2.0]];
    let found = echoes(&fixture, &rows, &["--response", "long.csv"]);
    assert_eq!(count(&found), [2, 1]);
}

#[test]
fn a_file_that_is_no_response_is_refused_with_its_name() {
    let fixture = Fixture::new();
    fixture.write("waves.csv", csv(&ringing_rows(3)));
    fixture.write("row.csv", "1,2,3,4,5,6,7\n");
    fixture.write("flat.csv", "0,1\n1,1\n2,1\n3,1\n4,1\n5,1\n");
    fixture.write("nan.csv", "0,1\n1,nan\n");
    for (name, message) in [
        ("row.csv", "row.csv: expected 5 to 100000 rows of a response, found 1"),
        ("flat.csv", "flat.csv: expected levels of a pulse"),
        ("nan.csv", "nan.csv: row 2, column 2: expected a finite number, found 'nan'"),
        ("absent.csv", "absent.csv"),
    ] {
        let arguments = ["echoes", "waves.csv", "--sample-ns", "1", "--response", name];
        fixture.refuses(&arguments, &[message]);
    }
    let both =
        ["echoes", "waves.csv", "--sample-ns", "1", "--response", "row.csv", "--no-response"];
    fixture.refuses(&both, &["--no-response"]);
}

/// Number of pairs of places within `tolerance`, matched greedily by distance.
fn paired(found: &[f64], truth: &[f64], tolerance: f64) -> usize {
    let mut pairs: Vec<_> = found
        .iter()
        .enumerate()
        .flat_map(|(i, a)| truth.iter().enumerate().map(move |(j, b)| ((a - b).abs(), i, j)))
        .filter(|pair| pair.0 <= tolerance)
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut used, mut met) = (vec![false; found.len()], vec![false; truth.len()]);
    for (_, i, j) in pairs {
        if !used[i] && !met[j] {
            (used[i], met[j]) = (true, true);
        }
    }
    met.iter().filter(|&&hit| hit).count()
}

/// A gzipped table without its header, by the `gzip` of the system.
fn unzipped(path: &PathBuf) -> Vec<Vec<f64>> {
    let output =
        std::process::Command::new("gzip").arg("-dc").arg(path).output().expect("gzip runs");
    assert!(output.status.success(), "{}", path.display());
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().expect(cell)).collect())
        .collect()
}

#[test]
fn nine_of_ten_published_components_of_neon_are_found_with_few_extra_echoes() {
    let Some(folder) = data("waveforms_neon") else { return };
    let fixture = Fixture::new();
    let rows = unzipped(&folder.join("return_1_250.csv.gz"));
    fixture.write("outgoing.csv", csv(&unzipped(&folder.join("outg_1_250.csv.gz"))));
    let mut truth = vec![Vec::new(); rows.len()];
    for line in
        fs::read_to_string(folder.join("decomposition_1_250.csv")).expect("a table").lines().skip(1)
    {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().expect(cell)).collect();
        truth[cells[0] as usize - 1].push(cells[2] - 1.0); // its samples count from 1
    }
    let published: usize = truth.iter().map(Vec::len).sum();
    for (name, more) in
        [("alone", &[] as &[&str]), ("with the outgoing pulse", &["--outgoing", "outgoing.csv"])]
    {
        let (mut hits, mut extra) = (0, 0);
        for (waveform, truth) in
            echoes(&fixture, &rows, more).iter().zip(&truth).filter(|(_, truth)| !truth.is_empty())
        {
            let found = numbers(waveform, "time_ns");
            let hit = paired(&found, truth, 2.0);
            (hits, extra) = (hits + hit, extra + found.len() - hit);
        }
        println!("NEON {name}: {hits} of {published} within 2 ns, {extra} extra");
        assert!(hits * 100 >= published * 90, "{name}: {hits} of {published}");
        assert!(extra <= 28, "{name}: {extra} extra echoes");
    }
}

#[test]
fn hand_checked_peaks_are_found_in_their_places() {
    let Some(file) = data("waveform_peaks_adapt/waveforms_expected_peaks.json") else { return };
    let records: Vec<Value> =
        serde_json::from_str(&fs::read_to_string(file).expect("a file")).expect("JSON");
    let whole = |r: &&Value| {
        r["expected_count"].as_u64() == r["expected_peaks"].as_array().map(|p| p.len() as u64)
    };
    let guesses: Vec<&Value> =
        records.iter().filter(|r| r["calls"] == "guess_peaks").filter(whole).collect();
    let rows: Vec<Vec<f64>> = guesses
        .iter()
        .map(|r| {
            r["samples"]
                .as_array()
                .expect("samples")
                .iter()
                .map(|v| v.as_f64().expect("a number"))
                .collect()
        })
        .collect();
    let fixture = Fixture::new();
    let (mut hits, mut extra, mut strong, mut strong_hits) = (0, 0, 0, 0);
    for ((waveform, record), row) in echoes(&fixture, &rows, &[]).iter().zip(&guesses).zip(&rows) {
        let place = |peak: &Value| peak["location"][0].as_f64().expect("a place");
        let expected: Vec<f64> =
            record["expected_peaks"].as_array().expect("peaks").iter().map(place).collect();
        let found = numbers(waveform, "time_ns");
        let hit = paired(&found, &expected, 2.0);
        (hits, extra) = (hits + hit, extra + found.len() - hit);
        let top = row.iter().copied().fold(0.0, f64::max);
        let high: Vec<f64> =
            expected.iter().copied().filter(|&at| row[at as usize] >= top / 2.0).collect();
        (strong, strong_hits) = (strong + high.len(), strong_hits + paired(&found, &high, 2.0));
    }
    println!(
        "ADAPT: {hits} peaks, {extra} extra; {strong_hits} of {strong} at least half as high as \
         the highest"
    );
    assert!(hits >= 60, "{hits}");
    assert!(extra <= 3, "{extra}");
    assert!(strong_hits * 100 >= strong * 85, "{strong_hits} of {strong}");
}
