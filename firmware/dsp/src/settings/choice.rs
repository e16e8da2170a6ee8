//! Settings that choose between methods: one enum each, decoded once from the number on the wire.
//!
//! A new choice of the detector is an enum in the call of `choices!` here and its row in the call
//! of `parameters!` in `parameters.rs`; `DetectorConfig::new` hands it to the stage that reads it.

use crate::settings::reason::Reason;
use crate::settings::refusal::Refusal;
use crate::settings::{ParameterId, Settings};

/// Declares a choice: an enum whose variants are numbered from 0 in the order of the wire, each
/// with its name.
macro_rules! choice {
    (
        $(#[$attribute:meta])*
        $choice:ident { $($(#[$variant_attribute:meta])* $variant:ident = $name:literal,)* }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $choice {
            $($(#[$variant_attribute])* $variant,)*
        }

        impl $choice {
            /// Every choice by rising code.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// Their names in configuration files and messages, in the same order.
            pub const NAMES: &[&str] = &[$($name),*];

            /// Number that stands for it in [`Settings`].
            pub const fn code(self) -> i32 {
                self as i32
            }

            /// The choice with this number; `None` where no choice has it.
            pub fn from_code(code: i32) -> Option<Self> {
                usize::try_from(code).ok().and_then(|code| Self::ALL.get(code)).copied()
            }
        }
    };
}

/// Declares the choices of the detector, and [`Choices`], which has a field for each of them.
macro_rules! choices {
    ($(
        $(#[$attribute:meta])*
        $field:ident: $choice:ident of $id:ident { $($variants:tt)* }
    )*) => {
        /// The detector's choices of a set of settings, decoded.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Choices {
            $($(#[$attribute])* pub $field: $choice,)*
        }

        impl Settings {
            /// Decodes every choice of the detector.
            ///
            /// # Errors
            ///
            /// [`Refusal`] of the first number that stands for no choice.
            pub fn choices(&self) -> Result<Choices, Refusal> {
                Ok(Choices { $($field: self.choice(ParameterId::$id, $choice::from_code)?,)* })
            }
        }

        $(choice! { $(#[$attribute])* $choice { $($variants)* } })*
    };
}

impl Settings {
    fn choice<T>(
        &self,
        field: ParameterId,
        from_code: impl FnOnce(i32) -> Option<T>,
    ) -> Result<T, Refusal> {
        let value = self.get(field).unwrap_or_default();
        from_code(value).ok_or(Refusal { field, value, reason: Reason::NotAChoice })
    }
}

choices! {
    /// Filter that smooths the waveform before the search for peaks.
    denoise: DenoiseFilter of Denoise {
        /// No filter.
        None = "none",
        /// A Gaussian half as wide as the pulse.
        Gaussian = "gaussian",
        /// The emitted pulse itself.
        Matched = "matched",
    }
    /// Estimator of the ambient light, the waveform's zero.
    ambient: AmbientEstimator of Ambient {
        /// The median of the waveform.
        Median = "median",
        /// The mean of the samples before the trigger.
        PreTrigger = "pre-trigger",
        /// The black level.
        None = "none",
    }
    /// Point of an echo that its time is taken from.
    timing: TimingMethod of Timing {
        /// The crossing of the threshold on its rising edge: the weaker it is, the later.
        RisingEdge = "rising-edge",
        /// Its top, by a parabola.
        Parabola = "parabola",
        /// The crossing of half its height on its rising edge, or its edges when it is clipped.
        ConstantFraction = "cfd",
        /// Its top without the parabola's bias, or its edges when it is clipped.
        WalkCorrected = "walk-corrected",
    }
    /// Rule for which echoes are kept when there are more than asked for.
    echoes: EchoChoice of EchoChoice {
        /// The strongest; the air before the sensor is weaker than any surface.
        Strongest = "strongest",
        /// The nearest.
        First = "first",
        /// The farthest.
        Last = "last",
    }
}

// Not a choice of the detector: it sets when shots are sampled.
choice! {
    /// Dither of the shots of a beam against the sampling clock.
    Dither {
        /// All shots begin at the same moment of a sample period.
        Off = "off",
        /// Shots begin at two or four moments of a sample period, as many as there are shots.
        On = "on",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_its_choice_and_other_numbers_are_none() {
        for (code, &method) in (0..).zip(TimingMethod::ALL) {
            assert_eq!(method.code(), code);
            assert_eq!(TimingMethod::from_code(code), Some(method));
        }
        for code in [i32::MIN, -1, 4, i32::MAX] {
            assert_eq!(TimingMethod::from_code(code), None);
        }
    }

    #[test]
    fn a_number_that_stands_for_no_choice_is_refused() {
        assert_eq!(Settings::default().choices().unwrap().denoise, DenoiseFilter::Matched);
        let settings = Settings { timing: 4, ..Settings::default() };
        assert_eq!(settings.choices().unwrap_err().field, ParameterId::Timing);
    }
}
