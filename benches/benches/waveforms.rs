//! Speed of the waveform path: `cargo bench -p echoloop-benches --bench waveforms`. Throughput is
//! in samples.
//!
//! `pipeline/…` goes from ADC codes to echoes, with 1,024 samples and 15 taps (16 with the filter's
//! zero): compiled for the baseline processor, vectorised by the compiler for x86-64-v3, and with
//! loops in intrinsics. `front_end/…` goes from returns to ADC codes. `scan/…` is a whole scan by
//! the sensor, link included, on one core.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use echoloop_dsp::{Echoes, Grid, Hardware, Pipeline, ScanPattern, Scratch, Settings};
use echoloop_frontend::{Analog, Exposure, Trigger};
use echoloop_frontend::{
    Receiver, ShotBuffers, WaveformFrontEnd, noise_key, synthesise, synthesise_baseline,
};
use echoloop_frontend::{Return, SceneResponse};
use echoloop_kernels::{process, process_baseline, process_compiled};
use echoloop_sensors::boards::pc::PcSensor;
use echoloop_sensors::client::{Client, RetryPolicy};
use echoloop_sensors::transport::InProcess;

const SAMPLES: usize = 1024;

const ANALOG: Analog = Analog {
    power_w: 60.0,
    pulse_width_ns: 6.2,
    gain_db: 0.0,
    sample_period_ns: 0.775,
    delay_ns: 12.87,
    ..Analog::USUAL
};

/// Scene with two returns per beam, from strong to none.
fn returns(beam: u32) -> [Return; 2] {
    let near = 8.0 + f64::from(beam % 64);
    let strength = |range_m: f64| Return {
        range_m: range_m as f32,
        strength_per_m2: (0.1 / range_m.powi(2)) as f32,
    };
    [strength(near), strength(near + 13.0)]
}

fn exposure<'a>(receiver: &'a Receiver, returns: &'a [Return], beam: u32) -> Exposure<'a> {
    let key = noise_key(1, Trigger { frame: 0, beam, shot: 0 });
    Exposure { receiver, analog: &ANALOG, returns, background: &[], key }
}

fn waveforms() -> Vec<Vec<u16>> {
    let mut buffers = ShotBuffers::default();
    (0..256)
        .map(|beam| {
            let mut codes = vec![0; SAMPLES];
            let (receiver, returns) = (Receiver::default(), returns(beam));
            synthesise(&exposure(&receiver, &returns, beam), &mut buffers, &mut codes);
            codes
        })
        .collect()
}

fn pipeline(c: &mut Criterion) {
    let settings = Settings {
        bins: SAMPLES as i32,
        pulse_width_ps: 6_200,
        power_uw: 60_000_000,
        ..Settings::default()
    };
    let Ok(pipeline) = Pipeline::new(&settings, &Hardware::REFERENCE) else { return };
    let waveforms = waveforms();
    let mut scratch = Scratch::new();
    let mut group = c.benchmark_group("pipeline");
    group.throughput(Throughput::Elements((SAMPLES * waveforms.len()) as u64));
    type Build = fn(&Pipeline, &[u16], &mut Scratch) -> Echoes;
    let builds: [(&str, Build); 3] = [
        ("baseline/1024", process_baseline),
        ("v3 as compiled/1024", process_compiled),
        ("fastest/1024", process),
    ];
    for (name, build) in builds {
        group.bench_function(name, |b| {
            b.iter(|| {
                waveforms
                    .iter()
                    .map(|w| build(&pipeline, black_box(w), &mut scratch).len())
                    .sum::<usize>()
            });
        });
    }
}

fn front_end(c: &mut Criterion) {
    let receiver = Receiver::default();
    let (mut buffers, mut codes) = (ShotBuffers::default(), vec![0; SAMPLES]);
    let mut group = c.benchmark_group("front_end");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    for (name, build) in
        [("baseline/1024", synthesise_baseline as Synthesise), ("fastest/1024", synthesise)]
    {
        let mut beam = 0;
        group.bench_function(name, |b| {
            b.iter(|| {
                beam += 1;
                let returns = returns(beam);
                build(&exposure(&receiver, &returns, beam), &mut buffers, black_box(&mut codes));
            });
        });
    }
}

type Synthesise = fn(&Exposure<'_>, &mut ShotBuffers, &mut [u16]);

fn scan(c: &mut Criterion) {
    let pattern = ScanPattern::Grid(Grid { columns: 250, rows: 128, ..Grid::default() });
    let beams = pattern.beams();
    let scene = SceneResponse {
        beams: (0..=beams).map(|beam| 2 * beam).collect(),
        returns: (0..beams).flat_map(returns).collect(),
    };
    let front_end = WaveformFrontEnd::new(Receiver::default(), Arc::new(scene), 1);
    let sensor = PcSensor::new(front_end, pattern, Hardware::REFERENCE);
    let Ok(mut client) = Client::connect(InProcess(sensor), RetryPolicy::default()) else { return };
    let mut group = c.benchmark_group("scan");
    group.sample_size(10).throughput(Throughput::Elements(u64::from(beams) * 800));
    let mut frame = 0;
    group.bench_function("32000 beams x 800 samples", |b| {
        b.iter(|| {
            frame += 1;
            client.scan(frame).map_or(0, |scan| scan.len())
        });
    });
}

criterion_group!(benches, pipeline, front_end, scan);
criterion_main!(benches);
