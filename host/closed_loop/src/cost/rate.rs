//! Scans a second that a processor, a line and the light allow.

use echoloop_dsp::{DetectorConfig, Echo, Echoes, Hardware, Refusal, ScanPattern, Settings};
use serde::Serialize;

use super::{Processor, Scanner};

/// Speeds of serial lines, bits a second; a byte takes ten.
const LINES: [u32; 3] = [115_200, 921_600, 12_000_000];

/// Sensor whose rate is estimated.
#[derive(Clone, Copy, Debug)]
pub struct RateOf<'a> {
    /// Its settings.
    pub settings: &'a Settings,
    /// Its hardware.
    pub hardware: Hardware,
    /// Its scan pattern.
    pub pattern: &'a ScanPattern,
    /// Time that a configuration gives a scan, s; 0: as the pattern needs.
    pub duration_s: f64,
    /// Scans a second that are wanted.
    pub hz: f64,
    /// Cycles that a processor takes for an instruction.
    pub cycles_per_instruction: f64,
    /// Echoes of each beam.
    pub echoes: u32,
}

/// Rate of one processor.
#[derive(Clone, Debug, Serialize)]
pub struct ProcessorRate {
    /// The processor.
    #[serde(flatten)]
    pub processor: Processor,
    /// Instructions of the detector a beam.
    pub instructions_a_beam: f64,
    /// Scans a second at that clock.
    pub scans_a_second: f64,
    /// Clock for the scans a second that are wanted, MHz.
    pub clock_mhz_needed: f64,
}

/// Rate of one serial line.
#[derive(Clone, Debug, Serialize)]
pub struct LineRate {
    /// Bits a second.
    pub baud: u32,
    /// Scans a second.
    pub scans_a_second: f64,
}

/// All that limits the rate of a sensor.
#[derive(Clone, Debug, Serialize)]
pub struct Rate {
    /// Version of this format.
    pub format: u32,
    /// Scans a second that are wanted.
    pub hz: f64,
    /// Beams of a scan.
    pub beams: u32,
    /// Samples of a waveform.
    pub samples: i32,
    /// Taps of the filter.
    pub taps: usize,
    /// Shots of a beam.
    pub shots: i32,
    /// Echoes of a beam.
    pub echoes_a_beam: u32,
    /// Cycles for an instruction.
    pub cycles_per_instruction: f64,
    /// Processors, slowest part first.
    pub processors: Vec<ProcessorRate>,
    /// Scans a second of one converter: a shot waits until light of the one before could be back.
    pub light_scans_a_second: f64,
    /// Bytes of a scan on the link.
    pub bytes_a_scan: f64,
    /// Serial lines.
    pub lines: Vec<LineRate>,
}

impl RateOf<'_> {
    /// Estimates the rate.
    ///
    /// # Errors
    ///
    /// [`Refusal`] of settings that the detector refuses.
    pub fn estimate(&self) -> Result<Rate, Refusal> {
        let Self { settings, hardware, hz, cycles_per_instruction, echoes, .. } = *self;
        let detector = DetectorConfig::new(settings, &hardware)?;
        let beams = self.pattern.beams();
        let on = |processor: &Processor| {
            let instructions_a_beam = processor.instructions(settings, &hardware, echoes)?;
            let cycles = instructions_a_beam * cycles_per_instruction * f64::from(beams);
            Some(ProcessorRate {
                processor: *processor,
                instructions_a_beam,
                scans_a_second: 1e6 * processor.clock_mhz / cycles,
                clock_mhz_needed: 1e-6 * cycles * hz,
            })
        };
        let scanner = Scanner::new(hardware, self.pattern, self.duration_s);
        let cost = scanner.cost(settings, &usual_scan(beams, echoes));
        let line =
            |baud: u32| LineRate { baud, scans_a_second: f64::from(baud) / (cost.bits * 1.25) };
        Ok(Rate {
            format: 1,
            hz,
            beams,
            samples: settings.bins,
            taps: detector.template.taps().len(),
            shots: settings.shots,
            echoes_a_beam: echoes,
            cycles_per_instruction,
            processors: Processor::ALL.iter().filter_map(on).collect(),
            light_scans_a_second: 1.0 / cost.seconds,
            bytes_a_scan: cost.bits / 8.0,
            lines: LINES.map(line).into(),
        })
    }
}

/// A scan of echoes whose numbers are as long on the link as usual.
fn usual_scan(beams: u32, echoes: u32) -> Vec<Echoes> {
    let echo = Echo {
        range: 30_000 << 8,
        amplitude: 4_096,
        width: 115,
        snr: 3_200,
        deviation: 2_048,
        reflectivity: 512,
        ..Echo::default()
    };
    let beam: Echoes = (0..echoes).map(|_| echo).collect();
    vec![beam; beams as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_scan_has_as_many_echoes_as_are_asked_for() {
        let scan = usual_scan(5, 3);
        assert!(scan.len() == 5 && scan.iter().all(|beam| beam.len() == 3));
    }
}
