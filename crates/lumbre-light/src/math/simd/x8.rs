//! Vectors of eight lanes: 256 bits, AVX2.
#![expect(
    unsafe_code,
    reason = "vector instructions that not every processor has"
)]

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::{F32x8, Lanes, Vec3xN};
use crate::math::real::{Double, Mask, Outlined, Real, Word};

/// Number of lanes.
const LANES: usize = 8;

/// Eight `f32` lanes.
#[derive(Clone, Copy, Debug)]
pub struct F32xN(__m256);

/// Eight booleans: all bits of a lane set, or none.
#[derive(Clone, Copy, Debug)]
pub struct MaskN(__m256);

/// Eight 32-bit words.
#[derive(Clone, Copy, Debug)]
pub struct U32xN(__m256i);

/// Eight `f64`: lanes 0 to 3, and lanes 4 to 7.
#[derive(Clone, Copy, Debug)]
pub struct F64xN(__m256d, __m256d);

impl Lanes<LANES> for F32xN {
    methods! {
        load(numbers: &[f32; LANES]) -> F32xN = _mm256_loadu_ps(numbers.as_ptr());
    }
    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: the array holds eight numbers; the caller enabled the instruction set.
        unsafe { _mm256_storeu_ps(numbers.as_mut_ptr(), self.0) };
        numbers
    }
    #[inline(always)]
    fn load_doubles(numbers: &[f64; LANES]) -> F64xN {
        // SAFETY: as in `store`.
        unsafe {
            F64xN(
                _mm256_loadu_pd(numbers.as_ptr()),
                _mm256_loadu_pd(numbers.as_ptr().add(4)),
            )
        }
    }
    #[inline(always)]
    fn store_doubles(doubles: F64xN) -> [f64; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: as in `store`.
        unsafe {
            _mm256_storeu_pd(numbers.as_mut_ptr(), doubles.0);
            _mm256_storeu_pd(numbers.as_mut_ptr().add(4), doubles.1);
        }
        numbers
    }
    #[inline(always)]
    fn transpose_load([a, b, c, d, e, f, g, h]: [&F32x8; LANES]) -> [F32xN; 8] {
        transposed([
            load_row(a),
            load_row(b),
            load_row(c),
            load_row(d),
            load_row(e),
            load_row(f),
            load_row(g),
            load_row(h),
        ])
    }
    #[inline(always)]
    fn transpose_store([a, b, c, d, e, f, g, h]: [F32xN; 8]) -> [F32x8; LANES] {
        let [a, b, c, d, e, f, g, h] = transposed([a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0]);
        [
            store_row(a),
            store_row(b),
            store_row(c),
            store_row(d),
            store_row(e),
            store_row(f),
            store_row(g),
            store_row(h),
        ]
    }
}

/// Loads a row.
#[inline(always)]
fn load_row(row: &F32x8) -> __m256 {
    // SAFETY: a row is 32 bytes aligned to 32; the caller enabled the instruction set.
    unsafe { _mm256_load_ps(row.0.as_ptr()) }
}

/// Stores a row.
#[inline(always)]
fn store_row(column: F32xN) -> F32x8 {
    let mut row = F32x8::default();
    // SAFETY: as in `load_row`.
    unsafe { _mm256_store_ps(row.0.as_mut_ptr(), column.0) };
    row
}

/// Transposes an 8 x 8 matrix given by its rows.
#[inline(always)]
fn transposed(r: [__m256; 8]) -> [F32xN; 8] {
    // SAFETY: the caller enabled the instruction set, as the module requires.
    unsafe {
        let low = |i: usize| _mm256_unpacklo_ps(r[i], r[i + 1]);
        let high = |i: usize| _mm256_unpackhi_ps(r[i], r[i + 1]);
        let pairs = [
            low(0),
            high(0),
            low(2),
            high(2),
            low(4),
            high(4),
            low(6),
            high(6),
        ];
        let near = |i: usize| _mm256_shuffle_ps::<0x44>(pairs[i], pairs[i + 2]);
        let far = |i: usize| _mm256_shuffle_ps::<0xee>(pairs[i], pairs[i + 2]);
        let fours = [
            near(0),
            far(0),
            near(1),
            far(1),
            near(4),
            far(4),
            near(5),
            far(5),
        ];
        let first = |i: usize| F32xN(_mm256_permute2f128_ps::<0x20>(fours[i], fours[i + 4]));
        let second = |i: usize| F32xN(_mm256_permute2f128_ps::<0x31>(fours[i], fours[i + 4]));
        [
            first(0),
            first(1),
            first(2),
            first(3),
            second(0),
            second(1),
            second(2),
            second(3),
        ]
    }
}

operators!(
    F32xN: Add add _mm256_add_ps,
    F32xN: Sub sub _mm256_sub_ps,
    F32xN: Mul mul _mm256_mul_ps,
    F32xN: Div div _mm256_div_ps,
    MaskN: BitAnd bitand _mm256_and_ps,
    MaskN: BitOr bitor _mm256_or_ps
);

by_halves!(Add add _mm256_add_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

impl Neg for F32xN {
    type Output = F32xN;
    methods! {
        neg(self) -> F32xN = _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0));
    }
}

impl Not for MaskN {
    type Output = MaskN;
    methods! {
        not(self) -> MaskN = _mm256_xor_ps(self.0, MaskN::splat(true).0);
    }
}

impl Default for MaskN {
    #[inline(always)]
    fn default() -> MaskN {
        MaskN::splat(false)
    }
}

impl PartialEq for MaskN {
    #[inline(always)]
    fn eq(&self, other: &MaskN) -> bool {
        self.bits() == other.bits()
    }
}

impl Mask for MaskN {
    const LANES: u32 = LANES as u32;

    methods! {
        splat(yes: bool) -> MaskN =
            _mm256_castsi256_ps(_mm256_set1_epi32(if yes { -1 } else { 0 }));
    }
    #[inline(always)]
    fn first(count: usize) -> MaskN {
        F32xN::load(&std::array::from_fn(|i| if i < count { 1.0 } else { 0.0 }))
            .eq(F32xN::splat(1.0))
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

impl Real for F32xN {
    type Mask = MaskN;
    type Word = U32xN;
    type Vec3 = Vec3xN<F32xN>;
    type Double = F64xN;

    methods! {
        splat(x: f32) -> F32xN = _mm256_set1_ps(x);
        select(mask: MaskN, yes: F32xN, no: F32xN) -> F32xN = _mm256_blendv_ps(no.0, yes.0, mask.0);
        sqrt(self) -> F32xN = _mm256_sqrt_ps(self.0);
        abs(self) -> F32xN = _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0);
        floor(self) -> F32xN = _mm256_floor_ps(self.0);
        copysign(self, sign: F32xN) -> F32xN =
            _mm256_or_ps(self.abs().0, _mm256_and_ps(_mm256_set1_ps(-0.0), sign.0));
        min(self, bound: F32xN) -> F32xN = _mm256_min_ps(self.0, bound.0);
        max(self, bound: F32xN) -> F32xN = _mm256_max_ps(self.0, bound.0);
        // The instructions return their second operand if either is NaN.
        clamp(self, least: f32, most: f32) -> F32xN =
            _mm256_min_ps(_mm256_set1_ps(most), _mm256_max_ps(_mm256_set1_ps(least), self.0));
        lt(self, other: F32xN) -> MaskN = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0);
        le(self, other: F32xN) -> MaskN = _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0);
        eq(self, other: F32xN) -> MaskN = _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0);
        bits(self) -> U32xN = _mm256_castps_si256(self.0);
        truncated(self) -> U32xN = _mm256_cvttps_epi32(self.0);
    }
    #[inline(always)]
    fn map_lanes(self, f: impl Fn(f32) -> f32) -> F32xN {
        F32xN::load(&self.store().map(f))
    }
    #[inline(always)]
    fn zip_lanes(self, other: F32xN, f: impl Fn(f32, f32) -> f32) -> F32xN {
        let (a, b) = (self.store(), other.store());
        F32xN::load(&std::array::from_fn(|i| f(a[i], b[i])))
    }
    #[inline(always)]
    fn double(self) -> F64xN {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        unsafe {
            let (first, last) = (
                _mm256_castps256_ps128(self.0),
                _mm256_extractf128_ps::<1>(self.0),
            );
            F64xN(_mm256_cvtps_pd(first), _mm256_cvtps_pd(last))
        }
    }
    #[inline(always)]
    fn outline<K: Outlined>(computation: K) -> K::Output {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        unsafe { super::CompiledApart::run_avx2(computation) }
    }
}

impl Double for F64xN {
    type Real = F32xN;

    methods! {
        single(self) -> F32xN = _mm256_set_m128(_mm256_cvtpd_ps(self.1), _mm256_cvtpd_ps(self.0));
    }
    #[inline(always)]
    fn splat(x: f64) -> F64xN {
        // SAFETY: the caller enabled the instruction set; the same holds for all below.
        let all = unsafe { _mm256_set1_pd(x) };
        F64xN(all, all)
    }
    #[inline(always)]
    fn sqrt(self) -> F64xN {
        // SAFETY: see `splat`.
        unsafe { F64xN(_mm256_sqrt_pd(self.0), _mm256_sqrt_pd(self.1)) }
    }
    #[inline(always)]
    fn lookup(table: &[f64; 32], indices: U32xN) -> F64xN {
        let table = table.as_ptr();
        // SAFETY: as in `splat`; the indices are below the length of the table.
        unsafe {
            let indices = _mm256_and_si256(indices.0, _mm256_set1_epi32(31));
            let last = _mm256_extracti128_si256::<1>(indices);
            F64xN(
                _mm256_i32gather_pd::<8>(table, _mm256_castsi256_si128(indices)),
                _mm256_i32gather_pd::<8>(table, last),
            )
        }
    }
    #[inline(always)]
    fn gt(self, other: F64xN) -> MaskN {
        // SAFETY: see `splat`.
        unsafe {
            let first = _mm256_castpd_ps(_mm256_cmp_pd::<_CMP_GT_OQ>(self.0, other.0));
            let last = _mm256_castpd_ps(_mm256_cmp_pd::<_CMP_GT_OQ>(self.1, other.1));
            // Half of each lane's mask is enough; the shuffle interleaves pairs of the two halves.
            let halves = _mm256_castps_pd(_mm256_shuffle_ps::<0x88>(first, last));
            MaskN(_mm256_castpd_ps(_mm256_permute4x64_pd::<0xd8>(halves)))
        }
    }
    #[inline(always)]
    fn select(mask: MaskN, yes: F64xN, no: F64xN) -> F64xN {
        // SAFETY: see `splat`.
        unsafe {
            let mask = _mm256_castps_si256(mask.0);
            let first = _mm256_cvtepi32_epi64(_mm256_castsi256_si128(mask));
            let last = _mm256_cvtepi32_epi64(_mm256_extracti128_si256::<1>(mask));
            F64xN(
                _mm256_blendv_pd(no.0, yes.0, _mm256_castsi256_pd(first)),
                _mm256_blendv_pd(no.1, yes.1, _mm256_castsi256_pd(last)),
            )
        }
    }
}

impl Word for U32xN {
    type Real = F32xN;

    methods! {
        splat(x: u32) -> U32xN = _mm256_set1_epi32(x as i32);
        add(self, other: U32xN) -> U32xN = _mm256_add_epi32(self.0, other.0);
        sub(self, other: U32xN) -> U32xN = _mm256_sub_epi32(self.0, other.0);
        mul(self, other: U32xN) -> U32xN = _mm256_mullo_epi32(self.0, other.0);
        xor(self, other: U32xN) -> U32xN = _mm256_xor_si256(self.0, other.0);
        and(self, other: U32xN) -> U32xN = _mm256_and_si256(self.0, other.0);
        or(self, other: U32xN) -> U32xN = _mm256_or_si256(self.0, other.0);
        sign_mask(self) -> U32xN = _mm256_srai_epi32::<31>(self.0);
        eq(self, other: U32xN) -> MaskN = _mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, other.0));
        to_float(self) -> F32xN = _mm256_cvtepi32_ps(self.0);
        bits_to_float(self) -> F32xN = _mm256_castsi256_ps(self.0);
    }
    #[inline(always)]
    fn shr<const BITS: u32>(self) -> U32xN {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        U32xN(unsafe { _mm256_srl_epi32(self.0, _mm_cvtsi32_si128(BITS as i32)) })
    }
    #[inline(always)]
    fn shl<const BITS: u32>(self) -> U32xN {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        U32xN(unsafe { _mm256_sll_epi32(self.0, _mm_cvtsi32_si128(BITS as i32)) })
    }
    #[inline(always)]
    fn map_lanes(self, f: impl Fn(u32) -> u32) -> U32xN {
        F32xN::load_words(&F32xN::store_words(self).map(f))
    }
    #[inline(always)]
    fn select(mask: MaskN, yes: U32xN, no: U32xN) -> U32xN {
        F32xN::select(mask, yes.bits_to_float(), no.bits_to_float()).bits()
    }
}
