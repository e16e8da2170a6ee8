//! Speed of the waveform path: `cargo bench -p echoloop-benches --bench waveforms`. Throughput is
//! in samples.
//!
//! `pipeline/…` goes from ADC codes to echoes, with 1,024 samples and 15 taps (16 with the filter's
//! zero): compiled for the baseline processor, vectorised by the compiler for x86-64-v3, and with
//! loops in intrinsics. `front_end/…` goes from returns to ADC codes. `scan/…` is a whole scan by
//! the sensor, link included, on one core.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use echoloop_benches::waveforms::{BATCH, SAMPLES, Stage, client, settings};

/// Groups of the benches, and the stages of each by name.
const GROUPS: [(&str, &[(&str, &str)]); 2] = [
    (
        "pipeline",
        &[
            ("baseline/1024", "pipeline baseline"),
            ("v3 as compiled/1024", "pipeline v3 as compiled"),
            ("fastest/1024", "pipeline v3"),
        ],
    ),
    ("front_end", &[("baseline/1024", "front end baseline"), ("fastest/1024", "front end v3")]),
];

fn stages(c: &mut Criterion) {
    let Ok(mut stage) = Stage::new(settings(SAMPLES, 6_200)) else { return };
    for (name, stages) in GROUPS {
        let mut group = c.benchmark_group(name);
        group.throughput(Throughput::Elements((SAMPLES * BATCH) as u64));
        for (name, work) in stages {
            group.bench_function(*name, |b| b.iter(|| stage.run(work).is_ok()));
        }
    }
}

fn scan(c: &mut Criterion) {
    let Ok((beams, mut client)) = client(250) else { return };
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

criterion_group!(benches, stages, scan);
criterion_main!(benches);
