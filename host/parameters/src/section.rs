//! A section of a configuration: a struct whose fields are keys.

/// Defines a section.
///
/// A row is a field: its type, its unit, its bounds, and a sentence that is its documentation too.
/// Attributes stand before it. Fields that are no keys of this section follow in braces of their
/// own, after `beside`.
///
/// The struct has `KEYS`, in the order of the rows, and `check_keys`, which refuses the first that
/// is out of bounds.
#[macro_export]
macro_rules! section {
    (
        $(#[$about:meta])*
        pub struct $name:ident in $section:literal {
            $(
                $(#[$attribute:meta])*
                $field:ident: $type:ty, $unit:literal, $bounds:expr, $help:literal;
            )*
        }
        $(beside {
            $($(#[$own_attribute:meta])* $own_visibility:vis $own:ident: $own_type:ty,)*
        })?
    ) => {
        $(#[$about])*
        pub struct $name {
            $(
                #[doc = $help]
                $(#[$attribute])*
                pub $field: $type,
            )*
            $($($(#[$own_attribute])* $own_visibility $own: $own_type,)*)?
        }

        impl $name {
            /// Its keys.
            pub const KEYS: &'static [$crate::Parameter] = &[$($crate::Parameter {
                key: concat!($section, ".", stringify!($field)),
                unit: $unit,
                kind: <$type as $crate::Value>::KIND,
                bounds: $bounds,
                help: $help,
            }),*];

            /// Checks each key by itself.
            ///
            /// # Errors
            ///
            /// `Refused` names the first key out of bounds.
            pub fn check_keys(&self) -> Result<(), $crate::Refused> {
                let mut keys = Self::KEYS.iter();
                $(
                    if let Some(key) = keys.next() {
                        key.check(&self.$field)?;
                    }
                )*
                Ok(())
            }
        }
    };
}
