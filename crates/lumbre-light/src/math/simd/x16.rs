//! Vectors of sixteen lanes: 512 bits, AVX-512.
#![expect(
    unsafe_code,
    reason = "vector instructions that not every processor has"
)]

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::{F32x8, Lanes, Vec3xN};
use crate::math::real::{Double, Mask, Outlined, Real, Word};

/// Number of lanes.
const LANES: usize = 16;

/// Sixteen `f32` lanes.
#[derive(Clone, Copy, Debug)]
pub struct F32xN(__m512);

/// Sixteen booleans: one bit per lane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaskN(__mmask16);

/// Sixteen 32-bit words.
#[derive(Clone, Copy, Debug)]
pub struct U32xN(__m512i);

/// Sixteen `f64`: lanes 0 to 7, and lanes 8 to 15.
#[derive(Clone, Copy, Debug)]
pub struct F64xN(__m512d, __m512d);

impl Lanes<LANES> for F32xN {
    methods! {
        load(numbers: &[f32; LANES]) -> F32xN = _mm512_loadu_ps(numbers.as_ptr());
    }
    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: the array holds sixteen numbers; the caller enabled the instruction set.
        unsafe { _mm512_storeu_ps(numbers.as_mut_ptr(), self.0) };
        numbers
    }
    #[inline(always)]
    fn load_doubles(numbers: &[f64; LANES]) -> F64xN {
        // SAFETY: as in `store`.
        unsafe {
            F64xN(
                _mm512_loadu_pd(numbers.as_ptr()),
                _mm512_loadu_pd(numbers.as_ptr().add(8)),
            )
        }
    }
    #[inline(always)]
    fn store_doubles(doubles: F64xN) -> [f64; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: as in `store`.
        unsafe {
            _mm512_storeu_pd(numbers.as_mut_ptr(), doubles.0);
            _mm512_storeu_pd(numbers.as_mut_ptr().add(8), doubles.1);
        }
        numbers
    }
    #[inline(always)]
    fn transpose_load(
        [a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p]: [&F32x8; LANES],
    ) -> [F32xN; 8] {
        let [x0, x1, x2, x3] = transposed_quarters([
            load_two_rows(a, e),
            load_two_rows(b, f),
            load_two_rows(c, g),
            load_two_rows(d, h),
        ]);
        let [y0, y1, y2, y3] = transposed_quarters([
            load_two_rows(i, m),
            load_two_rows(j, n),
            load_two_rows(k, o),
            load_two_rows(l, p),
        ]);
        [
            join_even_quarters(x0, y0),
            join_even_quarters(x1, y1),
            join_even_quarters(x2, y2),
            join_even_quarters(x3, y3),
            join_odd_quarters(x0, y0),
            join_odd_quarters(x1, y1),
            join_odd_quarters(x2, y2),
            join_odd_quarters(x3, y3),
        ]
    }
    #[inline(always)]
    fn transpose_store([a, b, c, d, e, f, g, h]: [F32xN; 8]) -> [F32x8; LANES] {
        let x = transposed_quarters([
            interleave_quarters::<0>(a, e),
            interleave_quarters::<0>(b, f),
            interleave_quarters::<0>(c, g),
            interleave_quarters::<0>(d, h),
        ]);
        let y = transposed_quarters([
            interleave_quarters::<1>(a, e),
            interleave_quarters::<1>(b, f),
            interleave_quarters::<1>(c, g),
            interleave_quarters::<1>(d, h),
        ]);
        let ([a, b, c, d], [e, f, g, h]) = (x, y);
        [
            store_low(a),
            store_low(b),
            store_low(c),
            store_low(d),
            store_high(a),
            store_high(b),
            store_high(c),
            store_high(d),
            store_low(e),
            store_low(f),
            store_low(g),
            store_low(h),
            store_high(e),
            store_high(f),
            store_high(g),
            store_high(h),
        ]
    }
}

/// Loads two rows: the first into the lower half, the second into the upper half.
#[inline(always)]
fn load_two_rows(a: &F32x8, b: &F32x8) -> __m512 {
    // SAFETY: a row is 32 bytes aligned to 32; the caller enabled the instruction set, here and in
    // all functions below.
    unsafe {
        _mm512_insertf32x8::<1>(
            _mm512_castps256_ps512(_mm256_load_ps(a.0.as_ptr())),
            _mm256_load_ps(b.0.as_ptr()),
        )
    }
}

/// Transposes the 4 x 4 matrix in each quarter of 128 bits.
#[inline(always)]
fn transposed_quarters([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: see `load_two_rows`.
    unsafe {
        let (ab, cd) = (_mm512_unpacklo_ps(a, b), _mm512_unpacklo_ps(c, d));
        let (ab_high, cd_high) = (_mm512_unpackhi_ps(a, b), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0x44>(ab, cd),
            _mm512_shuffle_ps::<0xee>(ab, cd),
            _mm512_shuffle_ps::<0x44>(ab_high, cd_high),
            _mm512_shuffle_ps::<0xee>(ab_high, cd_high),
        ]
    }
}

/// Joins quarters 0 and 2, of 128 bits each, of both vectors.
#[inline(always)]
fn join_even_quarters(a: __m512, b: __m512) -> F32xN {
    // SAFETY: see `load_two_rows`.
    F32xN(unsafe { _mm512_shuffle_f32x4::<0b10_00_10_00>(a, b) })
}

/// Joins quarters 1 and 3, of 128 bits each, of both vectors.
#[inline(always)]
fn join_odd_quarters(a: __m512, b: __m512) -> F32xN {
    // SAFETY: see `load_two_rows`.
    F32xN(unsafe { _mm512_shuffle_f32x4::<0b11_01_11_01>(a, b) })
}

/// Interleaves the quarters of both vectors: quarters 0 and 1 with `UPPER` = 0, quarters 2 and 3
/// with `UPPER` = 1.
#[inline(always)]
fn interleave_quarters<const UPPER: i64>(a: F32xN, b: F32xN) -> __m512 {
    // SAFETY: see `load_two_rows`.
    unsafe {
        let from = 4 * UPPER;
        let indices = _mm512_setr_epi64(
            from,
            from + 1,
            from + 8,
            from + 9,
            from + 2,
            from + 3,
            from + 10,
            from + 11,
        );
        _mm512_castpd_ps(_mm512_permutex2var_pd(
            _mm512_castps_pd(a.0),
            indices,
            _mm512_castps_pd(b.0),
        ))
    }
}

/// Stores the lower half of a vector.
#[inline(always)]
fn store_low(v: __m512) -> F32x8 {
    let mut row = F32x8::default();
    // SAFETY: see `load_two_rows`.
    unsafe { _mm256_store_ps(row.0.as_mut_ptr(), _mm512_castps512_ps256(v)) };
    row
}

/// Stores the upper half of a vector.
#[inline(always)]
fn store_high(v: __m512) -> F32x8 {
    let mut row = F32x8::default();
    // SAFETY: see `load_two_rows`.
    unsafe { _mm256_store_ps(row.0.as_mut_ptr(), _mm512_extractf32x8_ps::<1>(v)) };
    row
}

operators!(
    F32xN: Add add _mm512_add_ps,
    F32xN: Sub sub _mm512_sub_ps,
    F32xN: Mul mul _mm512_mul_ps,
    F32xN: Div div _mm512_div_ps,
    MaskN: BitAnd bitand _kand_mask16,
    MaskN: BitOr bitor _kor_mask16
);

by_halves!(Add add _mm512_add_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd);

impl Neg for F32xN {
    type Output = F32xN;
    methods! {
        neg(self) -> F32xN = _mm512_xor_ps(self.0, _mm512_set1_ps(-0.0));
    }
}

impl Not for MaskN {
    type Output = MaskN;
    methods! {
        not(self) -> MaskN = _knot_mask16(self.0);
    }
}

impl Mask for MaskN {
    const LANES: u32 = LANES as u32;

    #[inline(always)]
    fn splat(yes: bool) -> MaskN {
        MaskN(if yes { __mmask16::MAX } else { 0 })
    }
    #[inline(always)]
    fn first(count: usize) -> MaskN {
        MaskN(((1_u32 << count) - 1) as __mmask16)
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl Real for F32xN {
    type Mask = MaskN;
    type Word = U32xN;
    type Vec3 = Vec3xN<F32xN>;
    type Double = F64xN;

    methods! {
        splat(x: f32) -> F32xN = _mm512_set1_ps(x);
        select(mask: MaskN, yes: F32xN, no: F32xN) -> F32xN =
            _mm512_mask_blend_ps(mask.0, no.0, yes.0);
        sqrt(self) -> F32xN = _mm512_sqrt_ps(self.0);
        abs(self) -> F32xN = _mm512_andnot_ps(_mm512_set1_ps(-0.0), self.0);
        floor(self) -> F32xN =
            _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(self.0);
        copysign(self, sign: F32xN) -> F32xN =
            _mm512_or_ps(self.abs().0, _mm512_and_ps(_mm512_set1_ps(-0.0), sign.0));
        min(self, bound: F32xN) -> F32xN = _mm512_min_ps(self.0, bound.0);
        max(self, bound: F32xN) -> F32xN = _mm512_max_ps(self.0, bound.0);
        // The instructions return their second operand if either is NaN.
        clamp(self, least: f32, most: f32) -> F32xN =
            _mm512_min_ps(_mm512_set1_ps(most), _mm512_max_ps(_mm512_set1_ps(least), self.0));
        lt(self, other: F32xN) -> MaskN = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0);
        le(self, other: F32xN) -> MaskN = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0);
        eq(self, other: F32xN) -> MaskN = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0);
        bits(self) -> U32xN = _mm512_castps_si512(self.0);
        truncated(self) -> U32xN = _mm512_cvttps_epi32(self.0);
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
                _mm512_castps512_ps256(self.0),
                _mm512_extractf32x8_ps::<1>(self.0),
            );
            F64xN(_mm512_cvtps_pd(first), _mm512_cvtps_pd(last))
        }
    }
    #[inline(always)]
    fn outline<K: Outlined>(computation: K) -> K::Output {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        unsafe { super::CompiledApart::run_avx512(computation) }
    }
}

impl Double for F64xN {
    type Real = F32xN;

    methods! {
        single(self) -> F32xN =
            _mm512_insertf32x8::<1>(
                _mm512_castps256_ps512(_mm512_cvtpd_ps(self.0)),
                _mm512_cvtpd_ps(self.1),
            );
        gt(self, other: F64xN) -> MaskN = _mm512_kunpackb(
            __mmask16::from(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.1, other.1)),
            __mmask16::from(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, other.0)),
        );
    }
    #[inline(always)]
    fn splat(x: f64) -> F64xN {
        // SAFETY: the caller enabled the instruction set; the same holds for all below.
        let all = unsafe { _mm512_set1_pd(x) };
        F64xN(all, all)
    }
    #[inline(always)]
    fn sqrt(self) -> F64xN {
        // SAFETY: see `splat`.
        unsafe { F64xN(_mm512_sqrt_pd(self.0), _mm512_sqrt_pd(self.1)) }
    }
    #[inline(always)]
    fn lookup(table: &[f64; 32], indices: U32xN) -> F64xN {
        let table = table.as_ptr();
        // SAFETY: as in `splat`; the indices are below the length of the table.
        unsafe {
            let indices = _mm512_and_si512(indices.0, _mm512_set1_epi32(31));
            let last = _mm512_extracti64x4_epi64::<1>(indices);
            F64xN(
                _mm512_i32gather_pd::<8>(_mm512_castsi512_si256(indices), table),
                _mm512_i32gather_pd::<8>(last, table),
            )
        }
    }
    #[inline(always)]
    fn select(mask: MaskN, yes: F64xN, no: F64xN) -> F64xN {
        let [first, last] = mask.0.to_le_bytes();
        // SAFETY: see `splat`.
        unsafe {
            F64xN(
                _mm512_mask_blend_pd(first, no.0, yes.0),
                _mm512_mask_blend_pd(last, no.1, yes.1),
            )
        }
    }
}

impl Word for U32xN {
    type Real = F32xN;

    methods! {
        splat(x: u32) -> U32xN = _mm512_set1_epi32(x as i32);
        add(self, other: U32xN) -> U32xN = _mm512_add_epi32(self.0, other.0);
        sub(self, other: U32xN) -> U32xN = _mm512_sub_epi32(self.0, other.0);
        mul(self, other: U32xN) -> U32xN = _mm512_mullo_epi32(self.0, other.0);
        xor(self, other: U32xN) -> U32xN = _mm512_xor_si512(self.0, other.0);
        and(self, other: U32xN) -> U32xN = _mm512_and_si512(self.0, other.0);
        or(self, other: U32xN) -> U32xN = _mm512_or_si512(self.0, other.0);
        sign_mask(self) -> U32xN = _mm512_srai_epi32::<31>(self.0);
        eq(self, other: U32xN) -> MaskN = _mm512_cmpeq_epi32_mask(self.0, other.0);
        select(mask: MaskN, yes: U32xN, no: U32xN) -> U32xN =
            _mm512_mask_blend_epi32(mask.0, no.0, yes.0);
        to_float(self) -> F32xN = _mm512_cvtepi32_ps(self.0);
        bits_to_float(self) -> F32xN = _mm512_castsi512_ps(self.0);
    }
    #[inline(always)]
    fn shr<const BITS: u32>(self) -> U32xN {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        U32xN(unsafe { _mm512_srl_epi32(self.0, _mm_cvtsi32_si128(BITS as i32)) })
    }
    #[inline(always)]
    fn shl<const BITS: u32>(self) -> U32xN {
        // SAFETY: the caller enabled the instruction set, as the module requires.
        U32xN(unsafe { _mm512_sll_epi32(self.0, _mm_cvtsi32_si128(BITS as i32)) })
    }
    #[inline(always)]
    fn map_lanes(self, f: impl Fn(u32) -> u32) -> U32xN {
        F32xN::load_words(&F32xN::store_words(self).map(f))
    }
}
