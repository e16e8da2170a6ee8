//! Rate of waveforms sent to a sensor over a serial line, relative to the line's capacity.
//!
//! ```sh
//! cargo run --release -p echoloop-benches --bin line
//! ```
//!
//! Host and sensor have a pseudo-terminal each. A relay between them delays bytes as a line of that
//! speed would. The sensor is the firmware on this PC.

#[cfg(unix)]
mod relay;

#[cfg(unix)]
fn main() {
    measured::run();
}

#[cfg(not(unix))]
fn main() {
    eprintln!("error: pseudo-terminals are Unix's");
    std::process::exit(2);
}

#[cfg(unix)]
mod measured {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;
    use std::time::Instant;

    use clap::Parser;
    use echoloop_dsp::{Grid, ScanPattern, Settings};
    use echoloop_frontend::{Receiver, Return, SceneResponse};
    use echoloop_sensors::boards::pc::{PcSensor, hardware_for};
    use echoloop_sensors::sensor::{Detector, Model, Sensor, View};
    use echoloop_sensors::serve::serve;
    use echoloop_sensors::transport::Serial;

    use crate::relay::{Ends, Relay};

    /// Waveforms over a serial line.
    #[derive(Parser)]
    struct Arguments {
        /// Speeds of the line, baud.
        #[arg(long, default_values_t = [115_200, 921_600, 12_000_000])]
        baud: Vec<u32>,
        /// Samples of a waveform.
        #[arg(long, default_values_t = [200, 800, 2_400])]
        samples: Vec<i32>,
        /// Approximate duration of each scan, s.
        #[arg(long, default_value_t = 5.0)]
        seconds: f64,
    }

    pub(crate) fn run() {
        let arguments = Arguments::parse();
        println!("| baud | samples | beams | s | codes, kbit/s | line, kbit/s | of it |");
        println!("|---|---|---|---|---|---|---|");
        for &baud in &arguments.baud {
            for &samples in &arguments.samples {
                row(baud, samples, arguments.seconds);
            }
        }
    }

    /// Capacity of the line, kbit/s: eight of ten bits are data.
    fn limit_kbit_s(baud: u32) -> f64 {
        0.8e-3 * f64::from(baud)
    }

    fn row(baud: u32, samples: i32, seconds: f64) {
        let beam_kbit = 12e-3 * f64::from(samples);
        let beams = (seconds * limit_kbit_s(baud) / beam_kbit).clamp(8.0, 100_000.0);
        let model = model(beams as u32);
        let taken_s = scan_s(&model, samples, baud);
        let kbit_s = beam_kbit * f64::from(model.pattern.beams()) / taken_s;
        println!(
            "| {baud} | {samples} | {} | {taken_s:.2} | {kbit_s:.0} | {:.0} | {:.1} % |",
            model.pattern.beams(),
            limit_kbit_s(baud),
            100.0 * kbit_s / limit_kbit_s(baud)
        );
    }

    /// Pattern of about this many beams; a row has at most 1,000.
    fn model(beams: u32) -> Model {
        let receiver = Receiver::default();
        let hardware = hardware_for(&receiver);
        let rows = beams.div_ceil(1_000);
        let (columns, rows) = ((beams / rows) as u16, rows as u16);
        let pattern = ScanPattern::Grid(Grid { columns, rows, ..Grid::default() });
        Model { receiver, pattern, hardware, detector: Detector::Firmware }
    }

    /// Scene with a wall in every beam.
    fn scene(beams: u32) -> Arc<SceneResponse> {
        let wall = |range_m: f32| Return { range_m, strength_per_m2: 0.1 / range_m.powi(2) };
        let returns = (0..beams).map(|beam| wall(5.0 + (beam % 90) as f32)).collect();
        Arc::new(SceneResponse {
            beams: (0..=beams).collect(),
            returns,
            ..SceneResponse::default()
        })
    }

    /// Duration of a scan after configuration.
    fn scan_s(model: &Model, samples: i32, baud: u32) -> f64 {
        let Ends { relay, host, board } = Relay::between_terminals(baud);
        let stop = AtomicBool::new(false);
        thread::scope(|scope| {
            scope.spawn(|| relay.run(&stop));
            scope.spawn(|| {
                let mut sensor = PcSensor::new(model.front_end(), model.pattern, model.hardware);
                let mut line = Serial::from_open_port(board, "board").expect("a port");
                // At the end, the relay may stop first.
                let _ = serve(&mut line, &mut sensor, &|| stop.load(Ordering::Relaxed));
            });
            let line = Serial::from_open_port(host, "host").expect("a port");
            let line = Box::new(line);
            let mut sensor = Sensor::fed(line, model, Serial::retry_policy(baud)).expect("hello");
            // A pulse that even the fewest samples resolve.
            let (pulse_width_ps, power_uw) = (15_000, 20_000_000);
            let wide = Settings { pulse_width_ps, power_uw, ..Settings::default() };
            let settings = Settings { bins: samples, ..wide };
            sensor.configure(&settings).expect("settings");
            let scene = scene(model.pattern.beams());
            let view = View { scene: &scene, noise_seed: 1, scan: 1, viewpoint: 1 };
            let begun = Instant::now();
            let echoes = sensor.scan(&view).expect("a scan");
            let taken_s = begun.elapsed().as_secs_f64();
            assert!(2 * echoes.iter().flatten().count() > echoes.len(), "it sees the wall");
            let counters = sensor.client.read_counters().expect("counters");
            assert_eq!((counters.crc_failures, counters.stale), (0, 0), "nothing was lost");
            stop.store(true, Ordering::Relaxed);
            taken_s
        })
    }
}
