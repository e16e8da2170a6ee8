//! An enum whose values have names and a line of help each, written once.

/// An enum with `ALL`, `name` and `summary`: a value's line of help is its documentation, and its
/// name is that of files, too.
macro_rules! choice {
    (
        $(#[$about:meta])*
        $choice:ident { $($(#[$attribute:meta])* $value:ident $name:literal $summary:literal)+ }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum $choice {
            $(
                #[doc = concat!($summary, ".")]
                #[serde(rename = $name)]
                $(#[$attribute])*
                $value,
            )+
        }

        impl $choice {
            /// All of them.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Name on the command line, in files and in reports.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name,)+
                }
            }

            /// A line of help.
            pub fn summary(self) -> &'static str {
                match self {
                    $(Self::$value => $summary,)+
                }
            }
        }
    };
}

pub(super) use choice;
