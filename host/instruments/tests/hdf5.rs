//! HDF5 files as the HDF Group's library writes them: `hdf5/make.py`.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::{Path, PathBuf};

use echoloop_instruments::{
    Finder, Kind, Options, Rows, Selection, parse_waveforms, read_waveforms,
};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hdf5").join(name)
}

fn read(name: &str, kind: Kind, dataset: Option<&str>) -> Result<Rows, String> {
    let selection = Selection { name: dataset.map(str::to_owned), kind };
    let path = file(name);
    let rows = read_waveforms(&path, &selection).map_err(|e| e.to_string());
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(parse_waveforms(&path, bytes, &selection).map_err(|e| e.to_string()), rows);
    rows
}

/// Times of the echoes of each row, ns.
fn echoes(rows: &Rows, outgoing: Option<&Rows>) -> Vec<Vec<f64>> {
    let options =
        Options { sample_ns: 1.0, snr: 6.0, floor: 0.05, max_echoes: 8, min_separation_ns: 0.0 };
    let found = Finder::new(options).find_some(rows, outgoing, 0..rows.len());
    found.iter().map(|row| row.echoes.iter().map(|echo| echo.time_ns.round()).collect()).collect()
}

#[test]
fn shots_of_a_beam_are_cut_out_of_its_samples() {
    let rows = read("gedi.h5", Kind::Received, Some("BEAM0000")).unwrap();
    let lengths: Vec<usize> = (0..rows.len()).map(|row| rows.row(row).len()).collect();
    assert_eq!(lengths, [120, 130, 140]);
    assert_eq!((rows.row(0)[0], rows.row(2)[0]), (200.0, 200.0), "not the 7 between the shots");
    assert_eq!(echoes(&rows, None), [vec![40.0], vec![50.0, 90.0], vec![60.0]]);
    assert_eq!(rows.axis().map(|axis| (axis.step, axis.is_in_seconds)), Some((1e-9, true)));
    assert!(rows.remarks().is_empty(), "{:?}", rows.remarks());
    let same = read("gedi.h5", Kind::Received, Some("/BEAM0000/rxwaveform")).unwrap();
    assert_eq!(same, rows);
}

#[test]
fn emitted_pulses_are_those_of_the_group() {
    let rows = read("gedi.h5", Kind::Received, Some("BEAM0101")).unwrap();
    let pulses = read("gedi.h5", Kind::Emitted, Some("BEAM0101")).unwrap();
    assert_eq!((pulses.len(), pulses.row(1).len()), (2, 60));
    assert_eq!(echoes(&pulses, None), [[20.0], [21.0]]);
    assert_eq!(echoes(&rows, Some(&pulses)), [[45.0], [70.0]]);
    let beside = |dataset| read("gedi.h5", Kind::EmittedBeside, Some(dataset));
    assert_eq!(beside("BEAM0101"), Ok(pulses.clone()));
    assert_eq!(beside("BEAM0101/rxwaveform"), Ok(pulses));
    assert!(read("lvis.h5", Kind::EmittedBeside, Some("RXWAVE")).unwrap().row(0).len() == 60);
}

#[test]
fn a_shot_a_row_is_found_by_its_name() {
    let rows = read("lvis.h5", Kind::Received, None).unwrap();
    assert_eq!(echoes(&rows, None), [vec![50.0], vec![60.0, 100.0]]);
    assert!(rows.row(1)[140..].iter().all(|value| value.is_nan()));
    assert_eq!(
        rows.remarks(),
        ["10 samples of 65000 are taken for missing", "waveforms of dataset /RXWAVE"]
    );
    let pulses = read("lvis.h5", Kind::Emitted, None).unwrap();
    assert_eq!(echoes(&pulses, None), [[20.0], [21.0]]);
}

#[test]
fn a_choice_that_is_open_or_void_is_refused_with_the_names() {
    let table = [
        ("gedi.h5", None, "2 datasets of waveforms: --dataset names one of /BEAM0000/rxwaveform, "),
        ("gedi.h5", Some("BEAM9999"), "/BEAM9999 does not exist; there are BEAM0000, BEAM0101, "),
        ("gedi.h5", Some("BEAM0000/xyz"), "/BEAM0000/xyz does not exist; there are rx"),
        ("gedi.h5", Some("BEAM0000/rxwaveform/x"), "/BEAM0000/rxwaveform does not exist"),
        ("gedi.h5", Some("METADATA"), "--dataset names one of none"),
        ("lvis.h5", Some("cube"), "dataset /cube: expected one or two dimensions, found 3"),
        ("empty.h5", None, "dataset /RXWAVE: RXWAVE: resource limit: read of 1000000000000 "),
        ("make.py", Some("RXWAVE"), "expected HDF5, the only files with datasets"),
    ];
    let several = read("gedi.h5", Kind::Emitted, None).expect_err("two beams");
    assert!(several.contains("--outgoing-dataset names one of /BEAM0000/tx"), "{several}");
    for (name, dataset, part) in table {
        let problem = read(name, Kind::Received, dataset).expect_err(part);
        assert!(problem.contains(part), "{problem}");
    }
}

#[test]
fn a_cut_file_is_refused_or_reads_as_the_whole_and_a_changed_one_does_not_panic() {
    let whole = std::fs::read(file("gedi.h5")).unwrap();
    let selection = Selection { name: Some("BEAM0000".into()), kind: Kind::Received };
    let read = |bytes: &[u8]| parse_waveforms(Path::new("any"), bytes.to_vec(), &selection).ok();
    let rows = read(&whole);
    let cuts: Vec<_> = (8..whole.len()).step_by(97).filter_map(|end| read(&whole[..end])).collect();
    assert!(cuts.iter().all(|cut| Some(cut) == rows.as_ref()));
    assert!(cuts.len() < whole.len() / 97, "some cut");
    for at in (8..whole.len()).step_by(13) {
        let mut changed = whole.clone();
        changed[at] ^= 0xff;
        read(&changed);
    }
}
