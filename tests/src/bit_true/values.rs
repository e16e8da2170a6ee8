//! Values passed between the stages, with conversions from the DSP's types.

use echoloop_dsp::statistics::Statistics as DspStatistics;

use super::edges::Edges;
use super::noise::Noise;

/// Median, deviation (codes), ambient (Q1.15), σ̂ (Q13.19).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// m, median.
    pub median: f64,
    /// d, median absolute deviation.
    pub deviation: f64,
    /// a, ambient level.
    pub ambient: f64,
    /// σ̂, noise of a sample.
    pub sigma: f64,
}

/// σ_y (Q13.19), T (Q1.15) and the ambient level that the baseline stage removed (Q1.15).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Threshold {
    /// σ_y, noise behind the filter.
    pub sigma: f64,
    /// T, threshold.
    pub level: f64,
    /// a, saturated to Q1.15.
    pub ambient: f64,
}

/// A local maximum of the filter's output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Index of the sample.
    pub index: usize,
    /// Value of the sample.
    pub height: f64,
}

/// A peak between samples: time, its σ and width in Q16.16 samples, height and amplitude in Q1.15.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refined {
    /// Time since sample 0.
    pub time: f64,
    /// Height of the parabola's vertex.
    pub height: f64,
    /// Width at half height.
    pub width: f64,
    /// Amplitude without clipping.
    pub amplitude: f64,
    /// σ of the time.
    pub sigma: f64,
    /// Flags as on the wire.
    pub flags: u8,
}

/// An echo in wire units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Echo {
    /// Range, U24.8 mm.
    pub range: f64,
    /// Amplitude, U1.15.
    pub amplitude: f64,
    /// Width, U12.4 ns.
    pub width: f64,
    /// SNR, U8.8.
    pub snr: f64,
    /// σ of the range, U8.8 mm.
    pub deviation: f64,
    /// Reflectivity, U6.10.
    pub reflectivity: f64,
    /// Flags as on the wire.
    pub flags: u8,
}

impl From<DspStatistics> for Statistics {
    fn from(s: DspStatistics) -> Self {
        Self {
            median: s.median.into(),
            deviation: s.deviation.into(),
            ambient: s.ambient.into(),
            sigma: s.sigma.into(),
        }
    }
}

impl From<echoloop_dsp::detect::Threshold> for Threshold {
    fn from(t: echoloop_dsp::detect::Threshold) -> Self {
        Self { sigma: t.sigma.into(), level: t.level.into(), ambient: t.ambient.into() }
    }
}

impl From<echoloop_dsp::peak::Peak> for Peak {
    fn from(p: echoloop_dsp::peak::Peak) -> Self {
        Self { index: p.index.into(), height: p.height.into() }
    }
}

impl From<echoloop_dsp::refine::Refined> for Refined {
    fn from(r: echoloop_dsp::refine::Refined) -> Self {
        Self {
            time: r.time as f64,
            height: r.height.into(),
            width: r.width as f64,
            amplitude: r.amplitude as f64,
            sigma: r.sigma.into(),
            flags: r.flags.0,
        }
    }
}

impl From<echoloop_dsp::noise::Noise> for Noise {
    fn from(n: echoloop_dsp::noise::Noise) -> Self {
        Self { sigma: n.sigma.into(), shot: n.shot.into() }
    }
}

impl From<echoloop_dsp::edges::Edges> for Edges {
    fn from(e: echoloop_dsp::edges::Edges) -> Self {
        Self { time: e.time as f64, amplitude: e.amplitude as f64, sigma: e.sigma.into() }
    }
}

impl From<echoloop_dsp::Echo> for Echo {
    fn from(e: echoloop_dsp::Echo) -> Self {
        Self {
            range: e.range.into(),
            amplitude: e.amplitude.into(),
            width: e.width.into(),
            snr: e.snr.into(),
            deviation: e.deviation.into(),
            reflectivity: e.reflectivity.into(),
            flags: e.flags.0,
        }
    }
}
