//! What may be chosen: enums, each converted once from the number that is on the wire.

/// An enum whose variants are numbered from 0, in the order of the wire, with a name each.
macro_rules! choices {
    ($(
        $(#[$attribute:meta])*
        $choice:ident { $($(#[$variant_attribute:meta])* $variant:ident = $name:literal,)* }
    )*) => {$(
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $choice {
            $($(#[$variant_attribute])* $variant,)*
        }

        impl $choice {
            /// Every choice by rising code.
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            /// Their names in configuration files and messages, in that order.
            pub const NAMES: &[&str] = &[$($name),*];

            /// The number that stands for it in [`Settings`](crate::Settings).
            pub const fn code(self) -> i32 {
                self as i32
            }

            /// The choice of a number; `None` where there is none of that number.
            pub fn from_code(code: i32) -> Option<Self> {
                usize::try_from(code).ok().and_then(|code| Self::ALL.get(code)).copied()
            }
        }
    )*};
}

choices! {
    /// What smooths the waveform before peaks are sought.
    DenoiseFilter {
        /// Nothing.
        None = "none",
        /// A Gaussian half as wide as the pulse.
        Gaussian = "gaussian",
        /// The emitted pulse itself.
        Matched = "matched",
    }
    /// What the waveform's zero is.
    AmbientEstimator {
        /// The median of the waveform.
        Median = "median",
        /// The mean of the samples before the trigger.
        PreTrigger = "pre-trigger",
        /// The black level.
        None = "none",
    }
    /// What of an echo is timed.
    TimingMethod {
        /// Where it rises to the threshold.
        RisingEdge = "rising-edge",
        /// Its top, by a parabola.
        Parabola = "parabola",
        /// Where it rises to half of its height.
        ConstantFraction = "cfd",
        /// Its top without the parabola's bias, or its edges when it is clipped.
        WalkCorrected = "walk-corrected",
    }
    /// Whether the shots of a beam begin at different moments of a sample period.
    Dither {
        /// All at one.
        Off = "off",
        /// At two or four, as there are shots.
        On = "on",
    }
    /// Which echoes are kept when there are more than asked for.
    EchoChoice {
        /// The strongest.
        Strongest = "strongest",
        /// The nearest.
        First = "first",
        /// The farthest.
        Last = "last",
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
}
