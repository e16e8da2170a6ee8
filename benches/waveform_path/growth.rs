//! Growth of the cost with one quantity at a time.

use std::time::Instant;

use echoloop_benches::Result;
use echoloop_benches::waveforms::{BATCH, Stage, client, settings};
use echoloop_dsp::Settings;

/// A row of a table.
struct Row {
    name: String,
    stage: Stage,
}

impl Row {
    fn new(name: String, settings: Settings, echoes: usize) -> Result<Self> {
        let stage = Stage::with_returns(
            Settings { echoes: echoes.clamp(1, 4) as i32, ..settings },
            echoes,
        )?;
        Ok(Self { name, stage })
    }
}

pub(crate) fn print(quick: bool) -> Result<()> {
    let rounds = if quick { 20 } else { 100 };
    println!("### Samples, at 13 taps and one echo\n");
    let sizes = [300, 600, 1_200, 2_400].map(|samples| (samples, 4_900_000 / samples as i32));
    let rows = sizes.map(|(samples, width)| {
        Row::new(format!("{samples} samples"), settings(samples, width), 1)
    });
    table(rows.into_iter().collect::<Result<_>>()?, rounds);

    println!("\n### Taps, at 2,400 samples and one echo\n");
    let mut rows = Vec::new();
    for width_ps in [2_000, 4_000, 8_000, 16_000, 20_000] {
        let mut row = Row::new(String::new(), settings(2_400, width_ps), 1)?;
        row.name = format!("{} taps", row.stage.pipeline().config().template.taps().len());
        rows.push(row);
    }
    table(rows, rounds);

    println!("\n### Echoes, at 800 samples and 13 taps, all of them wanted\n");
    let rows = [0, 1, 2, 3, 4]
        .map(|echoes| Row::new(format!("{echoes} echoes"), settings(800, 6_200), echoes));
    table(rows.into_iter().collect::<Result<_>>()?, rounds);

    println!("\n### Beams, at 800 samples and two echoes, through sensor and link\n");
    beams(if quick { 3 } else { 10 })
}

/// Rows take turns; the fastest round of each counts, because other programs only add to the time.
fn table(mut rows: Vec<Row>, rounds: usize) {
    const STAGES: [&str; 4] =
        ["pipeline v3", "pipeline baseline", "front end v3", "front end baseline"];
    let mut best = vec![[f64::INFINITY; STAGES.len()]; rows.len()];
    for _ in 0..rounds {
        for (row, best) in rows.iter_mut().zip(&mut best) {
            for (name, best) in STAGES.iter().zip(best) {
                let clock = Instant::now();
                if row.stage.run(name).is_ok() {
                    *best = best.min(clock.elapsed().as_secs_f64() * 1e9 / BATCH as f64);
                }
            }
        }
    }
    println!("| | {} |\n|---|{}", STAGES.join(" | "), "---|".repeat(STAGES.len()));
    for (row, cost) in rows.iter().zip(&best) {
        let cells =
            cost.iter().zip(&best[0]).map(|(ns, first)| format!("{ns:.0} ns, {:.2}", ns / first));
        println!("| {} | {} |", row.name, cells.collect::<Vec<_>>().join(" | "));
    }
}

fn beams(rounds: usize) -> Result<()> {
    let mut clients = Vec::new();
    for columns in [8, 32, 128, 250] {
        let (beams, client) = client(columns)?;
        clients.push((beams, client, f64::INFINITY));
    }
    for frame in 0..rounds as u32 {
        for (_, client, best) in &mut clients {
            let clock = Instant::now();
            client.scan(frame)?;
            *best = best.min(clock.elapsed().as_secs_f64() * 1e3);
        }
    }
    println!("| | a scan | a beam |\n|---|---|---|");
    let first = clients[0].2;
    for (beams, _, ms) in &clients {
        println!(
            "| {beams} beams | {ms:.1} ms, {:.2} | {:.2} µs |",
            ms / first,
            1e3 * ms / f64::from(*beams)
        );
    }
    Ok(())
}
