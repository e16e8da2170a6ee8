//! Compiles a function for several vector units and chooses the best at run time.
//!
//! ```
//! #[inline(always)]
//! fn sum_inline(values: &[f32]) -> f32 {
//!     values.iter().sum()
//! }
//!
//! echoloop_dispatch::dispatch! {
//!     /// Sum, with the widest vectors of this processor.
//!     pub fn sum(values: &[f32]) -> f32 = sum_inline;
//! }
//!
//! assert_eq!(sum(&[1.0, 2.0]), 3.0);
//! ```
//!
//! The second build is for x86-64-v3 (AVX2). Rust never fuses a multiplication and an addition on
//! its own, so both builds give the same bits. There is no third build for AVX-512: LLVM's code for
//! it has been slower on loops like ours. Loops in intrinsics can use it, after [`has_avx512`].
//!
//! The crate `multiversion` supports more processors. But it repeats the features at each function,
//! hides the plain build that our tests compare with, and does not choose between functions that
//! are written in intrinsics, as [`dispatch!`] does.

#![cfg_attr(not(target_arch = "x86_64"), no_std)]

/// True when this processor runs the x86-64-v3 build: `avx2,bmi1,bmi2,lzcnt`.
#[inline]
pub fn has_v3() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("lzcnt")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// True when this processor runs loops in AVX-512 intrinsics: `avx512f,avx512bw,avx512vnni`.
///
/// All three have come together since 2019 (Cascade Lake, Zen 4). A processor that has them also
/// runs the x86-64-v3 build.
#[inline]
pub fn has_avx512() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        has_v3()
            && std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512bw")
            && std::arch::is_x86_feature_detected!("avx512vnni")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

/// Proof that the processor has x86-64-v3. A function that takes it can use intrinsics and still be
/// safe to call.
///
/// ```compile_fail
/// let forged = echoloop_dispatch::V3(());
/// ```
///
/// ```compile_fail,E0133
/// let unfounded = echoloop_dispatch::V3::here();
/// ```
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, Debug)]
pub struct V3(());

#[cfg(target_arch = "x86_64")]
impl V3 {
    /// Functions compiled for these features call it without `unsafe`.
    ///
    /// # Safety
    ///
    /// From any other function, [`has_v3`] must have returned true before.
    #[inline]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    pub fn here() -> Self {
        Self(())
    }
}

/// Declares functions that run the best build of their body for the processor.
///
/// | form | builds besides the plain one |
/// |---|---|
/// | `fn f(x: T) -> R = body;` | `body` for [`has_v3`]; it must be `#[inline(always)]` |
/// | `… = body, with: plain, v3_with: wide;` | `body(x, wide)`; the plain one is `body(x, plain)` |
/// | `… = body, v3: other;` | `other`, a safe function with [`has_v3`]'s features |
/// | `… = body, v3: other, avx512: wide;` | also `wide`, a safe one with [`has_avx512`]'s |
///
/// The plain build is `body` itself, for tests to compare with.
#[macro_export]
macro_rules! dispatch {
    ($(
        $(#[$attribute:meta])*
        $visibility:vis fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $result:ty)?
            = $body:path
            $(, with: $plain:expr, v3_with: $vector:expr)?
            $(, v3: $other:path $(, avx512: $wide:path)?)?;
    )*) => {$(
        $(#[$attribute])*
        $visibility fn $name($($argument: $type),*) $(-> $result)? {
            $crate::return_wide!([$($($wide)?)?] [$($result)?] $($argument: $type),*);
            #[cfg(target_arch = "x86_64")]
            if $crate::has_v3() {
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
                fn v3($($argument: $type),*) $(-> $result)? {
                    $crate::one_of!([$($other)?] [$body])($($argument,)* $($vector)?)
                }
                // SAFETY: the features that it is compiled for have just been found.
                return unsafe { v3($($argument),*) };
            }
            $body($($argument,)* $($plain)?)
        }
    )*};
}

/// Calls `wide` and returns its result if the processor has AVX-512; does nothing without `wide`.
#[doc(hidden)]
#[macro_export]
macro_rules! return_wide {
    ([$wide:path] [$($result:ty)?] $($argument:ident: $type:ty),*) => {
        #[cfg(target_arch = "x86_64")]
        if $crate::has_avx512() {
            #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
            fn avx512($($argument: $type),*) $(-> $result)? {
                $wide($($argument),*)
            }
            // SAFETY: the features that it is compiled for have just been found.
            return unsafe { avx512($($argument),*) };
        }
    };
    ([] $($rest:tt)*) => {};
}

/// The first of one or two paths, `other` before `body`.
#[doc(hidden)]
#[macro_export]
macro_rules! one_of {
    ([$other:path] [$body:path]) => {
        $other
    };
    ([] [$body:path]) => {
        $body
    };
}

#[cfg(test)]
mod tests {
    use super::{has_avx512, has_v3};

    #[inline(always)]
    fn plain(values: &[u32]) -> (u32, bool) {
        (values.iter().sum(), false)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    fn vectors(values: &[u32]) -> (u32, bool) {
        (values.iter().sum(), true)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
    fn wide(values: &[u32]) -> (u32, bool) {
        (values.iter().sum::<u32>() + 1, true)
    }

    dispatch! {
        fn compiled_twice(values: &[u32]) -> (u32, bool) = plain;
        fn written_twice(values: &[u32]) -> (u32, bool) = plain, v3: vectors;
        fn written_thrice(values: &[u32]) -> (u32, bool) = plain, v3: vectors, avx512: wide;
    }

    #[test]
    fn the_build_that_runs_is_the_one_for_this_processor() {
        let values = [1, 2, 3];
        assert_eq!(compiled_twice(&values), (6, false));
        assert_eq!(written_twice(&values), (6, has_v3()));
        assert_eq!(written_thrice(&values), (6 + u32::from(has_avx512()), has_v3()));
    }
}
