//! A choice: an enum whose values have a name and a line of help each, written once.

/// Defines a choice. The documentation of a value is its line of help; its name is that of the
/// command line, of files and of reports. The value after `by default` is the default.
///
/// ```
/// # use echoloop_parameters::choice;
/// choice! {
///     /// State of a lamp.
///     pub enum Lamp by default Off {
///         /// It shines.
///         On = "on",
///         /// It does not.
///         Off = "off",
///     }
/// }
/// assert_eq!((Lamp::NAMES, Lamp::default().summary()), (["on", "off"], "It does not"));
/// ```
#[macro_export]
macro_rules! choice {
    (
        $(#[$about:meta])*
        pub enum $choice:ident by default $default:ident {
            $($(#[doc = $help:literal])+ $value:ident = $name:literal,)+
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $choice {
            $(
                $(#[doc = $help])+
                #[serde(rename = $name)]
                $value,
            )+
        }

        impl $choice {
            /// All values.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Their names.
            pub const NAMES: [&'static str; Self::ALL.len()] = [$($name),+];

            /// The bound of a key: one of the names.
            pub const BOUNDS: $crate::Bounds = $crate::Bounds::OneOf(&Self::NAMES);

            /// Name on the command line, in files and in reports.
            pub const fn name(self) -> &'static str {
                Self::NAMES[self as usize]
            }

            /// Line of help, without the full stop.
            pub fn summary(self) -> &'static str {
                let help = [$(concat!($($help),+)),+][self as usize];
                help.trim_start().trim_end_matches('.')
            }
        }

        impl Default for $choice {
            fn default() -> Self {
                Self::$default
            }
        }

        impl $crate::Value for $choice {}
    };
}
