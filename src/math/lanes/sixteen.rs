//! Sixteen lanes in vectors of 512 bits.
#![expect(unsafe_code, reason = "vector instructions that not every processor has")]

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::{Lanes, Row, Vectors};
use crate::math::real::{Double, Mask, Real, Word};

/// How many lanes.
const LANES: usize = 16;

/// Sixteen numbers.
#[derive(Clone, Copy, Debug)]
pub struct Reals(__m512);

/// Sixteen times yes or no: a bit for each lane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Yes(__mmask16);

/// Sixteen words.
#[derive(Clone, Copy, Debug)]
pub struct Words(__m512i);

/// Sixteen numbers of double precision: the first eight lanes, and the others.
#[derive(Clone, Copy, Debug)]
pub struct Doubles(__m512d, __m512d);

impl Lanes<LANES> for Reals {
    methods! {
        load(numbers: &[f32; LANES]) -> Reals = _mm512_loadu_ps(numbers.as_ptr());
    }
    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: sixteen numbers lie there; callers have the instructions, as the module demands.
        unsafe { _mm512_storeu_ps(numbers.as_mut_ptr(), self.0) };
        numbers
    }
    #[inline(always)]
    fn load_doubles(numbers: &[f64; LANES]) -> Doubles {
        // SAFETY: as in `store`.
        unsafe { Doubles(_mm512_loadu_pd(numbers.as_ptr()), _mm512_loadu_pd(numbers.as_ptr().add(8))) }
    }
    #[inline(always)]
    fn store_doubles(doubles: Doubles) -> [f64; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: as in `store`.
        unsafe {
            _mm512_storeu_pd(numbers.as_mut_ptr(), doubles.0);
            _mm512_storeu_pd(numbers.as_mut_ptr().add(8), doubles.1);
        }
        numbers
    }
    #[inline(always)]
    fn transposed([a, b, c, d, e, f, g, h, i, j, k, l, m, n, o, p]: [&Row; LANES]) -> [Reals; 8] {
        let [x0, x1, x2, x3] = fours([both(a, e), both(b, f), both(c, g), both(d, h)]);
        let [y0, y1, y2, y3] = fours([both(i, m), both(j, n), both(k, o), both(l, p)]);
        [
            first(x0, y0),
            first(x1, y1),
            first(x2, y2),
            first(x3, y3),
            last(x0, y0),
            last(x1, y1),
            last(x2, y2),
            last(x3, y3),
        ]
    }
    #[inline(always)]
    fn stored([a, b, c, d, e, f, g, h]: [Reals; 8]) -> [Row; LANES] {
        let x = fours([halves::<0>(a, e), halves::<0>(b, f), halves::<0>(c, g), halves::<0>(d, h)]);
        let y = fours([halves::<1>(a, e), halves::<1>(b, f), halves::<1>(c, g), halves::<1>(d, h)]);
        let ([a, b, c, d], [e, f, g, h]) = (x, y);
        [
            low(a),
            low(b),
            low(c),
            low(d),
            high(a),
            high(b),
            high(c),
            high(d),
            low(e),
            low(f),
            low(g),
            low(h),
            high(e),
            high(f),
            high(g),
            high(h),
        ]
    }
}

/// A row, and behind it another.
#[inline(always)]
fn both(a: &Row, b: &Row) -> __m512 {
    // SAFETY: a row is 32 bytes, aligned to 32; callers have the instructions, as the module demands; so for all below.
    unsafe {
        _mm512_insertf32x8::<1>(_mm512_castps256_ps512(_mm256_load_ps(a.0.as_ptr())), _mm256_load_ps(b.0.as_ptr()))
    }
}

/// In each part of 128 bits the rows as columns.
#[inline(always)]
fn fours([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: see `both`.
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

/// Of the parts of 128 bits the first and the third of each.
#[inline(always)]
fn first(a: __m512, b: __m512) -> Reals {
    // SAFETY: see `both`.
    Reals(unsafe { _mm512_shuffle_f32x4::<0b10_00_10_00>(a, b) })
}

/// Of the parts of 128 bits the second and the fourth of each.
#[inline(always)]
fn last(a: __m512, b: __m512) -> Reals {
    // SAFETY: see `both`.
    Reals(unsafe { _mm512_shuffle_f32x4::<0b11_01_11_01>(a, b) })
}

/// Of the parts of 128 bits in turn one of each: the first and the second, or the third and the fourth.
#[inline(always)]
fn halves<const WHICH: i64>(a: Reals, b: Reals) -> __m512 {
    // SAFETY: see `both`.
    unsafe {
        let from = 4 * WHICH;
        let places = _mm512_setr_epi64(from, from + 1, from + 8, from + 9, from + 2, from + 3, from + 10, from + 11);
        _mm512_castpd_ps(_mm512_permutex2var_pd(_mm512_castps_pd(a.0), places, _mm512_castps_pd(b.0)))
    }
}

/// The first half.
#[inline(always)]
fn low(of: __m512) -> Row {
    let mut row = Row::default();
    // SAFETY: see `both`.
    unsafe { _mm256_store_ps(row.0.as_mut_ptr(), _mm512_castps512_ps256(of)) };
    row
}

/// The second half.
#[inline(always)]
fn high(of: __m512) -> Row {
    let mut row = Row::default();
    // SAFETY: see `both`.
    unsafe { _mm256_store_ps(row.0.as_mut_ptr(), _mm512_extractf32x8_ps::<1>(of)) };
    row
}

operators!(Reals: Add add _mm512_add_ps, Reals: Sub sub _mm512_sub_ps, Reals: Mul mul _mm512_mul_ps,
           Reals: Div div _mm512_div_ps, Yes: BitAnd bitand _kand_mask16, Yes: BitOr bitor _kor_mask16);

by_halves!(Add add _mm512_add_pd, Mul mul _mm512_mul_pd, Div div _mm512_div_pd);

impl Neg for Reals {
    type Output = Reals;
    methods! {
        neg(self) -> Reals = _mm512_xor_ps(self.0, _mm512_set1_ps(-0.0));
    }
}

impl Not for Yes {
    type Output = Yes;
    methods! {
        not(self) -> Yes = _knot_mask16(self.0);
    }
}

impl Mask for Yes {
    #[inline(always)]
    fn of(yes: bool) -> Yes {
        Yes(if yes { __mmask16::MAX } else { 0 })
    }
    #[inline(always)]
    fn first(count: usize) -> Yes {
        Yes(((1_u32 << count) - 1) as __mmask16)
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }
}

impl Real for Reals {
    type Mask = Yes;
    type Word = Words;
    type Vec3 = Vectors<Reals>;
    type Double = Doubles;

    methods! {
        of(x: f32) -> Reals = _mm512_set1_ps(x);
        select(mask: Yes, yes: Reals, no: Reals) -> Reals = _mm512_mask_blend_ps(mask.0, no.0, yes.0);
        sqrt(self) -> Reals = _mm512_sqrt_ps(self.0);
        abs(self) -> Reals = _mm512_andnot_ps(_mm512_set1_ps(-0.0), self.0);
        copysign(self, sign: Reals) -> Reals =
            _mm512_or_ps(self.abs().0, _mm512_and_ps(_mm512_set1_ps(-0.0), sign.0));
        min(self, bound: Reals) -> Reals = _mm512_min_ps(self.0, bound.0);
        max(self, bound: Reals) -> Reals = _mm512_max_ps(self.0, bound.0);
        // The instructions return their second operand where one is NaN.
        clamp(self, least: f32, most: f32) -> Reals =
            _mm512_min_ps(_mm512_set1_ps(most), _mm512_max_ps(_mm512_set1_ps(least), self.0));
        lt(self, other: Reals) -> Yes = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(self.0, other.0);
        le(self, other: Reals) -> Yes = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, other.0);
        eq(self, other: Reals) -> Yes = _mm512_cmp_ps_mask::<_CMP_EQ_OQ>(self.0, other.0);
        bits(self) -> Words = _mm512_castps_si512(self.0);
        truncated(self) -> Words = _mm512_cvttps_epi32(self.0);
    }
    #[inline(always)]
    fn each(self, f: impl Fn(f32) -> f32) -> Reals {
        Reals::load(&self.store().map(f))
    }
    #[inline(always)]
    fn each_with(self, other: Reals, f: impl Fn(f32, f32) -> f32) -> Reals {
        let (a, b) = (self.store(), other.store());
        Reals::load(&std::array::from_fn(|i| f(a[i], b[i])))
    }
    #[inline(always)]
    fn double(self) -> Doubles {
        // SAFETY: callers have the instructions, as the module demands.
        unsafe {
            let (first, last) = (_mm512_castps512_ps256(self.0), _mm512_extractf32x8_ps::<1>(self.0));
            Doubles(_mm512_cvtps_pd(first), _mm512_cvtps_pd(last))
        }
    }
}

impl Double for Doubles {
    type Real = Reals;

    methods! {
        single(self) -> Reals =
            _mm512_insertf32x8::<1>(_mm512_castps256_ps512(_mm512_cvtpd_ps(self.0)), _mm512_cvtpd_ps(self.1));
        gt(self, other: Doubles) -> Yes = _mm512_kunpackb(
            __mmask16::from(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.1, other.1)),
            __mmask16::from(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, other.0)),
        );
    }
    #[inline(always)]
    fn of(x: f64) -> Doubles {
        // SAFETY: callers have the instructions, as the module demands; so for all below.
        let all = unsafe { _mm512_set1_pd(x) };
        Doubles(all, all)
    }
    #[inline(always)]
    fn select(mask: Yes, yes: Doubles, no: Doubles) -> Doubles {
        let [first, last] = mask.0.to_le_bytes();
        // SAFETY: see `of`.
        unsafe { Doubles(_mm512_mask_blend_pd(first, no.0, yes.0), _mm512_mask_blend_pd(last, no.1, yes.1)) }
    }
}

impl Word for Words {
    type Real = Reals;

    methods! {
        of(x: u32) -> Words = _mm512_set1_epi32(x as i32);
        add(self, other: Words) -> Words = _mm512_add_epi32(self.0, other.0);
        sub(self, other: Words) -> Words = _mm512_sub_epi32(self.0, other.0);
        mul(self, other: Words) -> Words = _mm512_mullo_epi32(self.0, other.0);
        xor(self, other: Words) -> Words = _mm512_xor_si512(self.0, other.0);
        and(self, other: Words) -> Words = _mm512_and_si512(self.0, other.0);
        negative(self) -> Words = _mm512_srai_epi32::<31>(self.0);
        eq(self, other: Words) -> Yes = _mm512_cmpeq_epi32_mask(self.0, other.0);
        select(mask: Yes, yes: Words, no: Words) -> Words = _mm512_mask_blend_epi32(mask.0, no.0, yes.0);
        number(self) -> Reals = _mm512_cvtepi32_ps(self.0);
        as_bits(self) -> Reals = _mm512_castsi512_ps(self.0);
    }
    #[inline(always)]
    fn shr<const BITS: u32>(self) -> Words {
        // SAFETY: callers have the instructions, as the module demands.
        Words(unsafe { _mm512_srl_epi32(self.0, _mm_cvtsi32_si128(BITS as i32)) })
    }
}
