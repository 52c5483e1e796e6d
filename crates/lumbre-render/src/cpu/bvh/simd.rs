//! Vectors of eight single-precision numbers for traversal, portable and with AVX2.
//!
//! Invariant: every operation of [`Simd8`] except `mul_add` is the correctly rounded one of IEEE 754.
//! Hits of all implementations therefore have the same bits, which
//! `crates/lumbre-render/tests/light/render/instructions.rs` checks. [`Isa`] selects the
//! implementation once per hierarchy. The vectorised path tracer uses the vectors of `math::simd`
//! instead.

use glam::Vec4;

#[cfg(target_arch = "x86_64")]
use lumbre_light::math::simd::Width;

/// Number of lanes.
pub const LANES: usize = 8;

/// Eight numbers in memory, aligned for vector loads.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct LaneArray(pub [f32; LANES]);

lumbre_light::named! {
    /// Instruction set that the traversal loop is compiled for.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Isa {
        /// Vectors of 128 bits, which every processor of the build target has.
        Portable = "portable",
        /// Vectors of 256 bits.
        Avx2 = "avx2",
        /// Vectors of 256 bits for a single ray, as with AVX2, and of 512 bits in the vectorised
        /// path tracer.
        Avx512 = "avx512",
    }
}

/// Environment variable that selects an instruction set by [`Isa::name`], for comparisons of speed,
/// for example `LUMBRE_ISA=portable`. Pictures have the same bits with all of them.
pub const ISA_VARIABLE: &str = "LUMBRE_ISA";

impl Isa {
    /// Returns the widest instruction set of this processor, or the one that [`ISA_VARIABLE`] names
    /// if the processor has it.
    pub fn detect() -> Isa {
        let available = Isa::available().iter().copied();
        let named = std::env::var_os(ISA_VARIABLE);
        let named = named.and_then(|name| available.clone().find(|isa| name == isa.name()));
        named.or(available.last()).unwrap_or(Isa::Portable)
    }

    /// Returns all instruction sets of this processor, the widest last.
    pub fn available() -> &'static [Isa] {
        #[cfg(target_arch = "x86_64")]
        if Width::sixteen().is_some() {
            return &[Isa::Portable, Isa::Avx2, Isa::Avx512];
        } else if Width::eight().is_some() {
            return &[Isa::Portable, Isa::Avx2];
        }
        &[Isa::Portable]
    }

    /// Returns the number of primitives up to which a scene without instances is one leaf, so that
    /// its rays are traced in lanes: more where there are more lanes
    /// (docs/notes/cpu.md). At most 85, since indices of corners are bytes.
    pub fn one_leaf(self) -> usize {
        match self {
            Isa::Portable | Isa::Avx2 => 5 * LANES,
            Isa::Avx512 => 8 * LANES,
        }
    }
}

/// Arithmetic on eight numbers. Comparisons return one bit per lane, which is 0 if either number is
/// NaN.
pub trait Simd8: Copy {
    /// Loads the numbers from memory.
    fn load(row: &LaneArray) -> Self;
    /// Converts eight bytes to numbers.
    fn from_bytes(bytes: &[u8; LANES]) -> Self;
    /// Stores the numbers to memory.
    fn store(self) -> LaneArray;
    /// Broadcasts a number to all lanes.
    fn splat(x: f32) -> Self;
    /// Returns the sums `self + other`.
    fn add(self, other: Self) -> Self;
    /// Returns the differences `self - other`.
    fn sub(self, other: Self) -> Self;
    /// Returns the products `self * other`.
    fn mul(self, other: Self) -> Self;
    /// Returns `self * factor + offset`, rounded once or twice. Only box tests use it, since its
    /// bits depend on the implementation.
    fn mul_add(self, factor: Self, offset: Self) -> Self;
    /// Returns the quotients `self / other`.
    fn div(self, other: Self) -> Self;
    /// Returns the lesser numbers; either one if one is NaN.
    fn min(self, other: Self) -> Self;
    /// Returns the greater numbers; either one if one is NaN.
    fn max(self, other: Self) -> Self;
    /// Returns the lanes where `self < other`.
    fn lt(self, other: Self) -> u32;
    /// Returns the lanes where `self <= other`.
    fn le(self, other: Self) -> u32;
    /// Returns the lanes where `self == other`.
    fn eq(self, other: Self) -> u32;
}

/// Implementation with two vectors of four numbers.
#[derive(Clone, Copy, Debug)]
pub struct Portable([Vec4; 2]);

impl Portable {
    /// Applies a function to both halves.
    #[inline(always)]
    fn zip_halves(self, other: Portable, f: impl Fn(Vec4, Vec4) -> Vec4) -> Portable {
        Portable([f(self.0[0], other.0[0]), f(self.0[1], other.0[1])])
    }

    /// Returns one bit per lane of a comparison of both halves.
    #[inline(always)]
    fn compare_halves(self, other: Portable, f: impl Fn(Vec4, Vec4) -> glam::BVec4A) -> u32 {
        f(self.0[0], other.0[0]).bitmask() | f(self.0[1], other.0[1]).bitmask() << 4
    }
}

impl Simd8 for Portable {
    #[inline(always)]
    fn load(row: &LaneArray) -> Portable {
        let [a, b, c, d, e, f, g, h] = row.0;
        Portable([Vec4::new(a, b, c, d), Vec4::new(e, f, g, h)])
    }
    #[inline(always)]
    fn from_bytes(bytes: &[u8; LANES]) -> Portable {
        let [a, b, c, d, e, f, g, h] = *bytes;
        Portable([
            Vec4::new(f32::from(a), f32::from(b), f32::from(c), f32::from(d)),
            Vec4::new(f32::from(e), f32::from(f), f32::from(g), f32::from(h)),
        ])
    }
    #[inline(always)]
    fn store(self) -> LaneArray {
        let ([a, b, c, d], [e, f, g, h]) = (self.0[0].to_array(), self.0[1].to_array());
        LaneArray([a, b, c, d, e, f, g, h])
    }
    lumbre_light::inlined! {
        splat(x: f32) -> Portable = Portable([Vec4::splat(x); 2]);
        add(self, other: Portable) -> Portable = self.zip_halves(other, |a, b| a + b);
        sub(self, other: Portable) -> Portable = self.zip_halves(other, |a, b| a - b);
        mul(self, other: Portable) -> Portable = self.zip_halves(other, |a, b| a * b);
        mul_add(self, factor: Portable, offset: Portable) -> Portable =
            self.mul(factor).add(offset);
        div(self, other: Portable) -> Portable = self.zip_halves(other, |a, b| a / b);
        min(self, other: Portable) -> Portable = self.zip_halves(other, Vec4::min);
        max(self, other: Portable) -> Portable = self.zip_halves(other, Vec4::max);
        lt(self, other: Portable) -> u32 = self.compare_halves(other, Vec4::cmplt);
        le(self, other: Portable) -> u32 = self.compare_halves(other, Vec4::cmple);
        eq(self, other: Portable) -> u32 = self.compare_halves(other, Vec4::cmpeq);
    }
}

#[cfg(target_arch = "x86_64")]
pub use x86::Avx2;

#[cfg(target_arch = "x86_64")]
#[expect(
    unsafe_code,
    reason = "vector instructions that not every processor supports"
)]
mod x86 {
    use std::arch::x86_64::*;

    use crate::cpu::bvh::simd::{LaneArray, Simd8};

    /// Implementation with one vector of eight numbers. Only functions compiled for AVX2
    /// and FMA may use it; [`super::Isa`] ensures that they run only if the processor has it.
    #[derive(Clone, Copy, Debug)]
    pub struct Avx2(__m256);

    /// Defines methods on two vectors by one instruction each.
    macro_rules! instructions {
        ($($name:ident => $instruction:ident),*) => {$(
            #[inline(always)]
            fn $name(self, other: Avx2) -> Avx2 {
                // SAFETY: needs AVX only, which the constructor of `self` required.
                Avx2(unsafe { $instruction(self.0, other.0) })
            }
        )*};
    }

    /// Defines comparisons by their predicates.
    macro_rules! comparisons {
        ($($name:ident => $predicate:ident),*) => {$(
            #[inline(always)]
            fn $name(self, other: Avx2) -> u32 {
                // SAFETY: needs AVX only, which the constructor of `self` required.
                unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<$predicate>(self.0, other.0)) as u32 }
            }
        )*};
    }

    impl Simd8 for Avx2 {
        #[inline(always)]
        fn load(row: &LaneArray) -> Avx2 {
            // SAFETY: the array is 32 bytes, aligned to 32; callers have AVX, as the type requires.
            Avx2(unsafe { _mm256_load_ps(row.0.as_ptr()) })
        }
        #[inline(always)]
        fn from_bytes(bytes: &[u8; 8]) -> Avx2 {
            // SAFETY: reads the eight bytes; callers have AVX2, as the type requires.
            Avx2(unsafe {
                let bytes = _mm_loadl_epi64(bytes.as_ptr().cast());
                _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes))
            })
        }
        #[inline(always)]
        fn store(self) -> LaneArray {
            let mut row = LaneArray([0.0; 8]);
            // SAFETY: as in `load`.
            unsafe { _mm256_store_ps(row.0.as_mut_ptr(), self.0) };
            row
        }
        #[inline(always)]
        fn splat(x: f32) -> Avx2 {
            // SAFETY: callers have AVX, as the type requires.
            Avx2(unsafe { _mm256_set1_ps(x) })
        }
        #[inline(always)]
        fn mul_add(self, factor: Avx2, offset: Avx2) -> Avx2 {
            // SAFETY: callers have FMA, as the type requires.
            Avx2(unsafe { _mm256_fmadd_ps(self.0, factor.0, offset.0) })
        }
        instructions!(add => _mm256_add_ps, sub => _mm256_sub_ps, mul => _mm256_mul_ps);
        instructions!(div => _mm256_div_ps, min => _mm256_min_ps, max => _mm256_max_ps);
        comparisons!(lt => _CMP_LT_OQ, le => _CMP_LE_OQ, eq => _CMP_EQ_OQ);
    }
}
