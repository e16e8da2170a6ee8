//! What a file need not say.

/// Whether a value is the default of its type: then it is not written.
pub(super) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}
