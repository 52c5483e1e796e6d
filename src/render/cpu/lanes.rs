//! Eight single-precision numbers at once, for every kind of processor.
//!
//! [`Lanes`] is the little arithmetic that traversal needs, and every operation is the correctly rounded one of IEEE 754,
//! without fused multiplication: so all implementations give the same bits, which is tested. Which of them runs is
//! decided once for each hierarchy by what the processor has: see [`Isa`].

use glam::Vec4;

#[cfg(target_arch = "x86_64")]
use crate::math::lanes::Width;

/// How many numbers.
pub const LANES: usize = 8;

/// Eight numbers in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Row(pub [f32; LANES]);

/// A set of instructions for which the traversal loop is compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// Vectors of 128 bits: what every processor of this build has.
    Portable,
    /// Vectors of 256 bits.
    Avx2,
    /// The same for one ray; vectors of 512 bits for many paths together.
    Avx512,
}

/// Names a set of instructions by [`Isa::name`], to compare them: `LUMBRE_ISA=portable`. Pictures have the same bits with all
/// of them.
pub const ISA_VARIABLE: &str = "LUMBRE_ISA";

impl Isa {
    /// The widest that this processor has, or the one that [`ISA_VARIABLE`] names, if it has that.
    pub fn detect() -> Isa {
        let available = Isa::available().iter().copied();
        let named = std::env::var_os(ISA_VARIABLE);
        let named = named.and_then(|name| available.clone().find(|isa| name == isa.name()));
        named.or(available.last()).unwrap_or(Isa::Portable)
    }

    /// All that this processor has, the widest last.
    pub fn available() -> &'static [Isa] {
        #[cfg(target_arch = "x86_64")]
        if Width::sixteen().is_some() {
            return &[Isa::Portable, Isa::Avx2, Isa::Avx512];
        } else if Width::eight().is_some() {
            return &[Isa::Portable, Isa::Avx2];
        }
        &[Isa::Portable]
    }

    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Isa::Portable => "portable",
            Isa::Avx2 => "avx2",
            Isa::Avx512 => "avx512",
        }
    }
}

/// Arithmetic on eight numbers. Comparisons return a bit for each lane, and are false where a number is NaN.
pub trait Lanes: Copy {
    /// From memory.
    fn load(row: &Row) -> Self;
    /// To memory.
    fn store(self) -> Row;
    /// The same number in every lane.
    fn splat(x: f32) -> Self;
    /// Sum.
    fn add(self, other: Self) -> Self;
    /// Difference.
    fn sub(self, other: Self) -> Self;
    /// Product.
    fn mul(self, other: Self) -> Self;
    /// Quotient.
    fn div(self, other: Self) -> Self;
    /// The lesser; either where one is NaN.
    fn min(self, other: Self) -> Self;
    /// The greater; either where one is NaN.
    fn max(self, other: Self) -> Self;
    /// Where it is less.
    fn lt(self, other: Self) -> u32;
    /// Where it is less or equal.
    fn le(self, other: Self) -> u32;
    /// Where it is equal.
    fn eq(self, other: Self) -> u32;
}

/// Two vectors of four.
#[derive(Clone, Copy, Debug)]
pub struct Portable([Vec4; 2]);

impl Portable {
    #[inline(always)]
    fn both(self, other: Portable, f: impl Fn(Vec4, Vec4) -> Vec4) -> Portable {
        Portable([f(self.0[0], other.0[0]), f(self.0[1], other.0[1])])
    }

    #[inline(always)]
    fn bits(self, other: Portable, f: impl Fn(Vec4, Vec4) -> glam::BVec4A) -> u32 {
        f(self.0[0], other.0[0]).bitmask() | f(self.0[1], other.0[1]).bitmask() << 4
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn load(row: &Row) -> Portable {
        let [a, b, c, d, e, f, g, h] = row.0;
        Portable([Vec4::new(a, b, c, d), Vec4::new(e, f, g, h)])
    }
    #[inline(always)]
    fn store(self) -> Row {
        let ([a, b, c, d], [e, f, g, h]) = (self.0[0].to_array(), self.0[1].to_array());
        Row([a, b, c, d, e, f, g, h])
    }
    #[inline(always)]
    fn splat(x: f32) -> Portable {
        Portable([Vec4::splat(x); 2])
    }
    #[inline(always)]
    fn add(self, other: Portable) -> Portable {
        self.both(other, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, other: Portable) -> Portable {
        self.both(other, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, other: Portable) -> Portable {
        self.both(other, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, other: Portable) -> Portable {
        self.both(other, |a, b| a / b)
    }
    #[inline(always)]
    fn min(self, other: Portable) -> Portable {
        self.both(other, Vec4::min)
    }
    #[inline(always)]
    fn max(self, other: Portable) -> Portable {
        self.both(other, Vec4::max)
    }
    #[inline(always)]
    fn lt(self, other: Portable) -> u32 {
        self.bits(other, Vec4::cmplt)
    }
    #[inline(always)]
    fn le(self, other: Portable) -> u32 {
        self.bits(other, Vec4::cmple)
    }
    #[inline(always)]
    fn eq(self, other: Portable) -> u32 {
        self.bits(other, Vec4::cmpeq)
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::Avx2;

#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "vector instructions that not every processor has")]
mod x86 {
    use std::arch::x86_64::*;

    use super::{Lanes, Row};

    /// A vector of eight. Only functions that are compiled for AVX2 may use it, and so only behind [`super::Isa`].
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(__m256);

    /// Defines methods of two vectors by one instruction each.
    macro_rules! instructions {
        ($($name:ident => $instruction:ident),*) => {$(
            #[inline(always)]
            fn $name(self, other: Avx2) -> Avx2 {
                // SAFETY: needs AVX only, which whoever made `self` has.
                Avx2(unsafe { $instruction(self.0, other.0) })
            }
        )*};
    }

    /// Defines comparisons.
    macro_rules! comparisons {
        ($($name:ident => $predicate:ident),*) => {$(
            #[inline(always)]
            fn $name(self, other: Avx2) -> u32 {
                // SAFETY: needs AVX only, which whoever made `self` has.
                unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<$predicate>(self.0, other.0)) as u32 }
            }
        )*};
    }

    impl Lanes for Avx2 {
        #[inline(always)]
        fn load(row: &Row) -> Avx2 {
            // SAFETY: a row is 32 bytes, aligned to 32; callers have AVX, as the type demands.
            Avx2(unsafe { _mm256_load_ps(row.0.as_ptr()) })
        }
        #[inline(always)]
        fn store(self) -> Row {
            let mut row = Row([0.0; 8]);
            // SAFETY: as in `load`.
            unsafe { _mm256_store_ps(row.0.as_mut_ptr(), self.0) };
            row
        }
        #[inline(always)]
        fn splat(x: f32) -> Avx2 {
            // SAFETY: callers have AVX, as the type demands.
            Avx2(unsafe { _mm256_set1_ps(x) })
        }
        instructions!(add => _mm256_add_ps, sub => _mm256_sub_ps, mul => _mm256_mul_ps, div => _mm256_div_ps,
                      min => _mm256_min_ps, max => _mm256_max_ps);
        comparisons!(lt => _CMP_LT_OQ, le => _CMP_LE_OQ, eq => _CMP_EQ_OQ);
    }
}
