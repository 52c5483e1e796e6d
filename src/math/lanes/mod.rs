//! Numbers in the lanes of vectors: eight of 256 bits, or sixteen of 512 bits.
//!
//! Code for them is written once, for any [`Lanes`], and is carried out for the [`Width`] that the processor has by
//! [`Width::run`]. Only what that calls may use these types, and must be inlined into it: like all of [`super::real`] they
//! say nothing of the processor themselves.
#![expect(unsafe_code, reason = "functions that are compiled for vector instructions that not every processor has")]

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::real::{Real, Vector};

/// Defines operators of two vectors by one instruction each.
macro_rules! operators {
    ($($of:ident: $trait:ident $name:ident $instruction:ident),*) => {$(
        impl $trait for $of {
            type Output = $of;
            #[inline(always)]
            fn $name(self, other: $of) -> $of {
                // SAFETY: callers have the instructions, as the module demands.
                $of(unsafe { $instruction(self.0, other.0) })
            }
        }
    )*};
}

/// Defines operators of two vectors of doubles by one instruction for each half.
macro_rules! by_halves {
    ($($trait:ident $name:ident $instruction:ident),*) => {$(
        impl $trait for Doubles {
            type Output = Doubles;
            #[inline(always)]
            fn $name(self, other: Doubles) -> Doubles {
                // SAFETY: callers have the instructions, as the module demands.
                unsafe { Doubles($instruction(self.0, other.0), $instruction(self.1, other.1)) }
            }
        }
    )*};
}

/// Defines methods by expressions of instructions.
macro_rules! methods {
    ($($name:ident($($arg:tt)*) -> $out:ident = $body:expr;)*) => {$(
        #[inline(always)]
        fn $name($($arg)*) -> $out {
            // SAFETY: callers have the instructions, as the module demands.
            $out(unsafe { $body })
        }
    )*};
}

mod eight;
mod sixteen;
#[cfg(test)]
mod tests;

/// Eight numbers in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Row(pub [f32; 8]);

/// `N` numbers, one in each lane of a vector.
pub trait Lanes<const N: usize>: Real {
    /// From memory.
    fn load(numbers: &[f32; N]) -> Self;
    /// To memory.
    fn store(self) -> [f32; N];
    /// From memory, in double precision.
    fn load_doubles(numbers: &[f64; N]) -> Self::Double;
    /// To memory, in double precision.
    fn store_doubles(numbers: Self::Double) -> [f64; N];
    /// What stands at each of the eight places of the lanes' rows.
    fn transposed(rows: [&Row; N]) -> [Self; 8];
    /// Eight numbers of each lane in a row of its own.
    fn stored(columns: [Self; 8]) -> [Row; N];
}

/// A vector of three numbers in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Vectors<R> {
    x: R,
    y: R,
    z: R,
}

/// How many lanes vectors have, on a processor that has such vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width(Count);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Count {
    Eight,
    Sixteen,
}

/// What is to be done in lanes.
pub trait AnyWidth {
    /// What comes of it.
    type Out;

    /// Does it: inlined by force, with all that it calls and gives lanes to.
    fn run<R: Lanes<N>, const N: usize>(self) -> Self::Out;
}

impl Width {
    /// Eight lanes, if the processor has AVX2 and its kin.
    pub fn eight() -> Option<Width> {
        let has = std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("lzcnt");
        has.then_some(Width(Count::Eight))
    }

    /// Sixteen lanes, if the processor has the parts of AVX-512 that the first servers had.
    pub fn sixteen() -> Option<Width> {
        let has = Width::eight().is_some()
            && std::arch::is_x86_feature_detected!("avx512f")
            && std::arch::is_x86_feature_detected!("avx512vl")
            && std::arch::is_x86_feature_detected!("avx512dq")
            && std::arch::is_x86_feature_detected!("avx512bw");
        has.then_some(Width(Count::Sixteen))
    }

    /// Does something with this many lanes.
    #[inline]
    pub fn run<W: AnyWidth>(self, work: W) -> W::Out {
        // SAFETY: a width is made only where the processor has its instructions.
        unsafe {
            match self.0 {
                Count::Eight => in_eight(work),
                Count::Sixteen => in_sixteen(work),
            }
        }
    }
}

#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt")]
fn in_eight<W: AnyWidth>(work: W) -> W::Out {
    work.run::<eight::Reals, 8>()
}

#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn in_sixteen<W: AnyWidth>(work: W) -> W::Out {
    work.run::<sixteen::Reals, 16>()
}

/// What a function makes of each lane. Unlike `map` of arrays it is always inlined.
#[inline(always)]
pub fn each<T: Copy, U: Copy, const N: usize>(lanes: [T; N], of: impl Fn(T) -> U) -> [U; N] {
    let mut made = [of(lanes[0]); N];
    for i in 1..N {
        made[i] = of(lanes[i]);
    }
    made
}

/// So many of a group as there are lanes. Lanes that have none do again what the first has, for nothing.
#[inline(always)]
pub fn filled<T: Copy, const N: usize>(group: &[T]) -> [T; N] {
    let mut lanes = [group[0]; N];
    for (lane, of) in lanes.iter_mut().zip(group) {
        *lane = *of;
    }
    lanes
}

/// The lanes whose bits are set.
#[inline(always)]
pub fn set(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < u32::BITS as usize).then_some(lane)
    })
}

impl<R: Real<Vec3 = Vectors<R>>> Vector for Vectors<R> {
    type Scalar = R;

    #[inline(always)]
    fn new(x: R, y: R, z: R) -> Vectors<R> {
        Vectors { x, y, z }
    }
    #[inline(always)]
    fn x(self) -> R {
        self.x
    }
    #[inline(always)]
    fn y(self) -> R {
        self.y
    }
    #[inline(always)]
    fn z(self) -> R {
        self.z
    }
}

/// Defines operators of vectors by those of their components.
macro_rules! by_component {
    ($($trait:ident $name:ident),*) => {$(
        impl<R: Real> $trait for Vectors<R> {
            type Output = Vectors<R>;
            #[inline(always)]
            fn $name(self, other: Vectors<R>) -> Vectors<R> {
                Vectors { x: self.x.$name(other.x), y: self.y.$name(other.y), z: self.z.$name(other.z) }
            }
        }
    )*};
}

/// Defines operators of a vector and a number.
macro_rules! by_number {
    ($($trait:ident $name:ident),*) => {$(
        impl<R: Real> $trait<R> for Vectors<R> {
            type Output = Vectors<R>;
            #[inline(always)]
            fn $name(self, other: R) -> Vectors<R> {
                Vectors { x: self.x.$name(other), y: self.y.$name(other), z: self.z.$name(other) }
            }
        }
    )*};
}

by_component!(Add add, Sub sub, Mul mul);
by_number!(Mul mul, Div div);

impl<R: Real> Neg for Vectors<R> {
    type Output = Vectors<R>;
    #[inline(always)]
    fn neg(self) -> Vectors<R> {
        Vectors { x: -self.x, y: -self.y, z: -self.z }
    }
}
