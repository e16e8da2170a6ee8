//! The image in QEMU against the same program in process.
#![allow(clippy::unwrap_used, reason = "tests")]
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use echoloop_dsp::{Hardware, ScanPattern, Settings};
use echoloop_host::client::{Client, Patience};
use echoloop_host::frontend::{Receiver, WaveformFrontEnd};
use echoloop_host::transport::InProcess;
use echoloop_sim::board::PcSensor;
use echoloop_sim::qemu::{Machine, Qemu, QemuOptions};
use echoloop_sim::scanner::{Return, SceneResponse};

#[test]
fn first_light() {
    let beams = 2048;
    let scene = Arc::new(SceneResponse {
        beams: (0..=beams).collect(),
        returns: (0..beams).map(|b| Return { range_m: 5.0 + b as f32 / 40.0, strength_per_m2: 1e-3 }).collect(),
    });
    let pattern = ScanPattern { columns: 64, rows: 32, ..ScanPattern::default() };
    let front = || WaveformFrontEnd::new(Receiver::default(), Arc::clone(&scene), 1);
    let mut pc =
        Client::connect(InProcess(PcSensor::new(front(), pattern, Hardware::REFERENCE)), Patience::default()).unwrap();
    pc.configure(&Settings::default()).unwrap();
    let expected = pc.scan(1).unwrap();
    for machine in Machine::ALL {
        let options = QemuOptions::new(machine, Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")));
        let qemu = Qemu::start(&options, front(), pattern, Hardware::REFERENCE).unwrap();
        let patience = Patience { timeout: Duration::from_secs(2), tries: 3 };
        let start = std::time::Instant::now();
        let mut client = Client::connect(qemu, patience).unwrap();
        println!("{machine:?}: {:?} in {:?}", client.identity(), start.elapsed());
        client.configure(&Settings::default()).unwrap();
        let start = std::time::Instant::now();
        let scan = client.scan(1).unwrap();
        println!(
            "scan in {:?}, {} echoes, log {} bytes",
            start.elapsed(),
            scan.iter().map(|e| e.len()).sum::<usize>(),
            std::fs::metadata(client.transport_mut().log_file()).map_or(0, |m| m.len())
        );
        assert_eq!(scan, expected);
    }
}
