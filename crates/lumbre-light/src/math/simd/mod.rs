//! SIMD vectors of `f32`: 8 lanes of 256 bits (AVX2), 16 lanes of 512 bits (AVX-512), or one lane:
//! a plain number.
//!
//! Code is written once, generic over [`Lanes`], as a [`SimdKernel`]. [`dispatch`] runs it with the
//! instruction set of a [`Width`].
//!
//! With the feature `every-width`, which tests use, every width exists on every processor: vectors
//! that it does not have are pairs (`pair.rs`) of narrower ones.
//!
//! Invariants: a [`Width`] exists only if the processor has its instruction set. The vector types
//! carry no target feature of their own, so only code that [`dispatch`] calls and that is inlined
//! into it may use them (`tests/library/laws/lanes.rs` checks this). Results are bit-identical per lane to
//! those of `f32`.
#![cfg_attr(
    target_arch = "x86_64",
    expect(
        unsafe_code,
        reason = "kernels are compiled for vector instructions that not every processor has"
    )
)]

#[cfg(target_arch = "x86_64")]
use super::real::Outlined;

/// Implements binary operators of vector types by one instruction each.
#[cfg(target_arch = "x86_64")]
macro_rules! operators {
    ($($vector:ident: $trait:ident $name:ident $instruction:ident),*) => {$(
        impl $trait for $vector {
            type Output = $vector;
            #[inline(always)]
            fn $name(self, other: $vector) -> $vector {
                // SAFETY: the caller enabled the instruction set, as the module requires.
                $vector(unsafe { $instruction(self.0, other.0) })
            }
        }
    )*};
}

/// Implements binary operators of `F64xN` by one instruction for each half.
#[cfg(target_arch = "x86_64")]
macro_rules! by_halves {
    ($($trait:ident $name:ident $instruction:ident),*) => {$(
        impl $trait for F64xN {
            type Output = F64xN;
            #[inline(always)]
            fn $name(self, other: F64xN) -> F64xN {
                // SAFETY: the caller enabled the instruction set, as the module requires.
                unsafe { F64xN($instruction(self.0, other.0), $instruction(self.1, other.1)) }
            }
        }
    )*};
}

/// Implements methods whose body is one expression of intrinsics.
#[cfg(target_arch = "x86_64")]
macro_rules! methods {
    ($($name:ident($($arg:tt)*) -> $out:ident = $body:expr;)*) => {$(
        #[inline(always)]
        fn $name($($arg)*) -> $out {
            // SAFETY: the caller enabled the instruction set, as the module requires.
            $out(unsafe { $body })
        }
    )*};
}

mod lanes;
#[cfg(any(test, feature = "every-width"))]
pub mod pair;
pub mod record;
#[cfg(test)]
mod tests;
mod x1;
#[cfg(target_arch = "x86_64")]
mod x16;
#[cfg(target_arch = "x86_64")]
mod x8;

pub use lanes::{
    F32x8, Lanes, Vec3xN, active_lanes, map_array, map_vectors, padded, store_vectors,
};

/// A vector width that this processor supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width(Vectors);

/// Vectors for which kernels are compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Vectors {
    /// One lane: plain numbers.
    One,
    /// Eight lanes without vector instructions.
    #[cfg(any(test, feature = "every-width"))]
    PortableEight,
    /// Sixteen lanes without vector instructions.
    #[cfg(any(test, feature = "every-width"))]
    PortableSixteen,
    /// Eight lanes of AVX2.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Two vectors of AVX2.
    #[cfg(all(target_arch = "x86_64", any(test, feature = "every-width")))]
    TwoAvx2,
    /// Sixteen lanes of AVX-512.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// A computation that runs on vectors of any width.
pub trait SimdKernel {
    /// The result of the kernel.
    type Output;

    /// Runs the kernel on vectors of `N` lanes. Must be `#[inline(always)]`, as must every function
    /// that it passes vectors to.
    fn run<R: Lanes<N>, const N: usize>(self) -> Self::Output;
}

impl Width {
    /// One lane, which every processor has.
    pub const ONE: Width = Width(Vectors::One);

    /// Returns the width of 8 lanes if the processor has AVX2, BMI1, BMI2 and LZCNT.
    pub fn eight() -> Option<Width> {
        #[cfg(target_arch = "x86_64")]
        if has_avx2() {
            return Some(Width(Vectors::Avx2));
        }
        #[cfg(any(test, feature = "every-width"))]
        return Some(Width(Vectors::PortableEight));
        #[cfg(not(any(test, feature = "every-width")))]
        None
    }

    /// Returns the width of 16 lanes if the processor has AVX-512 F, VL, DQ and BW, the subset of
    /// the first AVX-512 server processors.
    pub fn sixteen() -> Option<Width> {
        #[cfg(target_arch = "x86_64")]
        if has_avx512() {
            return Some(Width(Vectors::Avx512));
        }
        #[cfg(all(target_arch = "x86_64", any(test, feature = "every-width")))]
        if has_avx2() {
            return Some(Width(Vectors::TwoAvx2));
        }
        #[cfg(any(test, feature = "every-width"))]
        return Some(Width(Vectors::PortableSixteen));
        #[cfg(not(any(test, feature = "every-width")))]
        None
    }

    /// Returns all widths, the narrowest first.
    pub fn all() -> Vec<Width> {
        let wide = [Width::eight(), Width::sixteen()];
        std::iter::once(Width::ONE)
            .chain(wide.into_iter().flatten())
            .collect()
    }

    /// Returns the widest vectors that the processor has instructions for.
    pub fn native() -> Width {
        #[cfg(target_arch = "x86_64")]
        {
            if has_avx512() {
                return Width(Vectors::Avx512);
            } else if has_avx2() {
                return Width(Vectors::Avx2);
            }
        }
        Width::ONE
    }

    /// Returns the number of lanes.
    pub fn lanes(self) -> usize {
        match self.0 {
            Vectors::One => 1,
            #[cfg(any(test, feature = "every-width"))]
            Vectors::PortableEight => 8,
            #[cfg(any(test, feature = "every-width"))]
            Vectors::PortableSixteen => 16,
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx2 => 8,
            #[cfg(all(target_arch = "x86_64", any(test, feature = "every-width")))]
            Vectors::TwoAvx2 => 16,
            #[cfg(target_arch = "x86_64")]
            Vectors::Avx512 => 16,
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    std::arch::is_x86_feature_detected!("avx2")
        && std::arch::is_x86_feature_detected!("fma")
        && std::arch::is_x86_feature_detected!("bmi1")
        && std::arch::is_x86_feature_detected!("bmi2")
        && std::arch::is_x86_feature_detected!("lzcnt")
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    has_avx2()
        && std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512vl")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512bw")
}

/// Runs a kernel, compiled for the instruction set of a vector width.
#[inline]
pub fn dispatch<K: SimdKernel>(width: Width, kernel: K) -> K::Output {
    #[cfg(any(test, feature = "every-width"))]
    use pair::Pair;
    match width.0 {
        Vectors::One => kernel.run::<f32, 1>(),
        #[cfg(any(test, feature = "every-width"))]
        Vectors::PortableEight => kernel.run::<Pair<Pair<Pair<f32>>>, 8>(),
        #[cfg(any(test, feature = "every-width"))]
        Vectors::PortableSixteen => kernel.run::<Pair<Pair<Pair<Pair<f32>>>>, 16>(),
        // SAFETY: a `Width` exists only if the processor has its instruction set.
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx2 => unsafe { kernel.run_avx2() },
        // SAFETY: as above.
        #[cfg(all(target_arch = "x86_64", any(test, feature = "every-width")))]
        Vectors::TwoAvx2 => unsafe { kernel.run_two_avx2() },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Vectors::Avx512 => unsafe { kernel.run_avx512() },
    }
}

/// Kernels compiled for vector instructions. The compiler puts a method of a trait into the same
/// unit as its type, and a generic function of this module into the one of this module: as
/// functions, all kernels of a program would be compiled one after the other.
#[cfg(target_arch = "x86_64")]
trait Compiled: SimdKernel + Sized {
    /// Runs the kernel on 8 lanes. The processor must have AVX2, BMI1, BMI2 and LZCNT.
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    unsafe fn run_avx2(self) -> Self::Output {
        self.run::<x8::F32xN, 8>()
    }

    /// Runs the kernel on 16 lanes, each vector in two parts, with the instructions of 8 lanes.
    #[cfg(any(test, feature = "every-width"))]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    unsafe fn run_two_avx2(self) -> Self::Output {
        self.run::<pair::Pair<x8::F32xN>, 16>()
    }

    /// Runs the kernel on 16 lanes. The processor must also have AVX-512 F, VL, DQ and BW.
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,avx512f,avx512vl,avx512dq,avx512bw")]
    unsafe fn run_avx512(self) -> Self::Output {
        self.run::<x16::F32xN, 16>()
    }
}

#[cfg(target_arch = "x86_64")]
impl<K: SimdKernel> Compiled for K {}

/// Implements [`Real::outline`], as methods for the reason of [`Compiled`].
#[cfg(target_arch = "x86_64")]
trait CompiledApart: Outlined + Sized {
    /// Runs the computation of eight lanes.
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
    #[inline(never)]
    unsafe fn run_avx2(self) -> Self::Output {
        self.run()
    }

    /// Runs the computation of sixteen lanes.
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,avx512f,avx512vl,avx512dq,avx512bw")]
    #[inline(never)]
    unsafe fn run_avx512(self) -> Self::Output {
        self.run()
    }
}

#[cfg(target_arch = "x86_64")]
impl<K: Outlined> CompiledApart for K {}
