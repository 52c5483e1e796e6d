//! Eight lanes in vectors of 256 bits.
#![expect(unsafe_code, reason = "vector instructions that not every processor has")]

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::{Lanes, Row, Vectors};
use crate::math::real::{Double, Mask, Real, Word};

/// How many lanes.
const LANES: usize = 8;

/// Eight numbers.
#[derive(Clone, Copy, Debug)]
pub struct Reals(__m256);

/// Eight times yes or no: all bits of a lane, or none.
#[derive(Clone, Copy, Debug)]
pub struct Yes(__m256);

/// Eight words.
#[derive(Clone, Copy, Debug)]
pub struct Words(__m256i);

/// Eight numbers of double precision: the first four lanes, and the others.
#[derive(Clone, Copy, Debug)]
pub struct Doubles(__m256d, __m256d);

impl Lanes<LANES> for Reals {
    methods! {
        load(numbers: &[f32; LANES]) -> Reals = _mm256_loadu_ps(numbers.as_ptr());
    }
    #[inline(always)]
    fn store(self) -> [f32; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: eight numbers lie there; callers have the instructions, as the module demands.
        unsafe { _mm256_storeu_ps(numbers.as_mut_ptr(), self.0) };
        numbers
    }
    #[inline(always)]
    fn load_doubles(numbers: &[f64; LANES]) -> Doubles {
        // SAFETY: as in `store`.
        unsafe { Doubles(_mm256_loadu_pd(numbers.as_ptr()), _mm256_loadu_pd(numbers.as_ptr().add(4))) }
    }
    #[inline(always)]
    fn store_doubles(doubles: Doubles) -> [f64; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: as in `store`.
        unsafe {
            _mm256_storeu_pd(numbers.as_mut_ptr(), doubles.0);
            _mm256_storeu_pd(numbers.as_mut_ptr().add(4), doubles.1);
        }
        numbers
    }
    #[inline(always)]
    fn transposed([a, b, c, d, e, f, g, h]: [&Row; LANES]) -> [Reals; 8] {
        turned([loaded(a), loaded(b), loaded(c), loaded(d), loaded(e), loaded(f), loaded(g), loaded(h)])
    }
    #[inline(always)]
    fn stored([a, b, c, d, e, f, g, h]: [Reals; 8]) -> [Row; LANES] {
        let [a, b, c, d, e, f, g, h] = turned([a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0]);
        [row(a), row(b), row(c), row(d), row(e), row(f), row(g), row(h)]
    }
}

#[inline(always)]
fn loaded(row: &Row) -> __m256 {
    // SAFETY: a row is 32 bytes, aligned to 32; callers have the instructions, as the module demands.
    unsafe { _mm256_load_ps(row.0.as_ptr()) }
}

#[inline(always)]
fn row(of: Reals) -> Row {
    let mut row = Row::default();
    // SAFETY: as in `loaded`.
    unsafe { _mm256_store_ps(row.0.as_mut_ptr(), of.0) };
    row
}

/// Rows as columns.
#[inline(always)]
fn turned(r: [__m256; 8]) -> [Reals; 8] {
    // SAFETY: callers have the instructions, as the module demands.
    unsafe {
        let low = |i: usize| _mm256_unpacklo_ps(r[i], r[i + 1]);
        let high = |i: usize| _mm256_unpackhi_ps(r[i], r[i + 1]);
        let pairs = [low(0), high(0), low(2), high(2), low(4), high(4), low(6), high(6)];
        let near = |i: usize| _mm256_shuffle_ps::<0x44>(pairs[i], pairs[i + 2]);
        let far = |i: usize| _mm256_shuffle_ps::<0xee>(pairs[i], pairs[i + 2]);
        let fours = [near(0), far(0), near(1), far(1), near(4), far(4), near(5), far(5)];
        let first = |i: usize| Reals(_mm256_permute2f128_ps::<0x20>(fours[i], fours[i + 4]));
        let second = |i: usize| Reals(_mm256_permute2f128_ps::<0x31>(fours[i], fours[i + 4]));
        [first(0), first(1), first(2), first(3), second(0), second(1), second(2), second(3)]
    }
}

operators!(Reals: Add add _mm256_add_ps, Reals: Sub sub _mm256_sub_ps, Reals: Mul mul _mm256_mul_ps,
           Reals: Div div _mm256_div_ps, Yes: BitAnd bitand _mm256_and_ps, Yes: BitOr bitor _mm256_or_ps);

by_halves!(Add add _mm256_add_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

impl Neg for Reals {
    type Output = Reals;
    methods! {
        neg(self) -> Reals = _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0));
    }
}

impl Not for Yes {
    type Output = Yes;
    methods! {
        not(self) -> Yes = _mm256_xor_ps(self.0, Yes::of(true).0);
    }
}

impl Default for Yes {
    #[inline(always)]
    fn default() -> Yes {
        Yes::of(false)
    }
}

impl PartialEq for Yes {
    #[inline(always)]
    fn eq(&self, other: &Yes) -> bool {
        self.bits() == other.bits()
    }
}

impl Mask for Yes {
    methods! {
        of(yes: bool) -> Yes = _mm256_castsi256_ps(_mm256_set1_epi32(if yes { -1 } else { 0 }));
    }
    #[inline(always)]
    fn first(count: usize) -> Yes {
        Reals::load(&std::array::from_fn(|i| if i < count { 1.0 } else { 0.0 })).eq(Reals::of(1.0))
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: callers have the instructions, as the module demands.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

impl Real for Reals {
    type Mask = Yes;
    type Word = Words;
    type Vec3 = Vectors<Reals>;
    type Double = Doubles;

    methods! {
        of(x: f32) -> Reals = _mm256_set1_ps(x);
        select(mask: Yes, yes: Reals, no: Reals) -> Reals = _mm256_blendv_ps(no.0, yes.0, mask.0);
        sqrt(self) -> Reals = _mm256_sqrt_ps(self.0);
        abs(self) -> Reals = _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0);
        copysign(self, sign: Reals) -> Reals =
            _mm256_or_ps(self.abs().0, _mm256_and_ps(_mm256_set1_ps(-0.0), sign.0));
        min(self, bound: Reals) -> Reals = _mm256_min_ps(self.0, bound.0);
        max(self, bound: Reals) -> Reals = _mm256_max_ps(self.0, bound.0);
        // The instructions return their second operand where one is NaN.
        clamp(self, least: f32, most: f32) -> Reals =
            _mm256_min_ps(_mm256_set1_ps(most), _mm256_max_ps(_mm256_set1_ps(least), self.0));
        lt(self, other: Reals) -> Yes = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0);
        le(self, other: Reals) -> Yes = _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0);
        eq(self, other: Reals) -> Yes = _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0);
        bits(self) -> Words = _mm256_castps_si256(self.0);
        truncated(self) -> Words = _mm256_cvttps_epi32(self.0);
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
            let (first, last) = (_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            Doubles(_mm256_cvtps_pd(first), _mm256_cvtps_pd(last))
        }
    }
}

impl Double for Doubles {
    type Real = Reals;

    methods! {
        single(self) -> Reals = _mm256_set_m128(_mm256_cvtpd_ps(self.1), _mm256_cvtpd_ps(self.0));
    }
    #[inline(always)]
    fn of(x: f64) -> Doubles {
        // SAFETY: callers have the instructions, as the module demands; so for all below.
        let all = unsafe { _mm256_set1_pd(x) };
        Doubles(all, all)
    }
    #[inline(always)]
    fn gt(self, other: Doubles) -> Yes {
        // SAFETY: see `of`.
        unsafe {
            let first = _mm256_castpd_ps(_mm256_cmp_pd::<_CMP_GT_OQ>(self.0, other.0));
            let last = _mm256_castpd_ps(_mm256_cmp_pd::<_CMP_GT_OQ>(self.1, other.1));
            // Half of each lane says all of it; the shuffle leaves pairs of the two in turn.
            let halves = _mm256_castps_pd(_mm256_shuffle_ps::<0x88>(first, last));
            Yes(_mm256_castpd_ps(_mm256_permute4x64_pd::<0xd8>(halves)))
        }
    }
    #[inline(always)]
    fn select(mask: Yes, yes: Doubles, no: Doubles) -> Doubles {
        // SAFETY: see `of`.
        unsafe {
            let mask = _mm256_castps_si256(mask.0);
            let first = _mm256_cvtepi32_epi64(_mm256_castsi256_si128(mask));
            let last = _mm256_cvtepi32_epi64(_mm256_extracti128_si256::<1>(mask));
            Doubles(
                _mm256_blendv_pd(no.0, yes.0, _mm256_castsi256_pd(first)),
                _mm256_blendv_pd(no.1, yes.1, _mm256_castsi256_pd(last)),
            )
        }
    }
}

impl Word for Words {
    type Real = Reals;

    methods! {
        of(x: u32) -> Words = _mm256_set1_epi32(x as i32);
        add(self, other: Words) -> Words = _mm256_add_epi32(self.0, other.0);
        sub(self, other: Words) -> Words = _mm256_sub_epi32(self.0, other.0);
        mul(self, other: Words) -> Words = _mm256_mullo_epi32(self.0, other.0);
        xor(self, other: Words) -> Words = _mm256_xor_si256(self.0, other.0);
        and(self, other: Words) -> Words = _mm256_and_si256(self.0, other.0);
        negative(self) -> Words = _mm256_srai_epi32::<31>(self.0);
        eq(self, other: Words) -> Yes = _mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, other.0));
        number(self) -> Reals = _mm256_cvtepi32_ps(self.0);
        as_bits(self) -> Reals = _mm256_castsi256_ps(self.0);
    }
    #[inline(always)]
    fn shr<const BITS: u32>(self) -> Words {
        // SAFETY: callers have the instructions, as the module demands.
        Words(unsafe { _mm256_srl_epi32(self.0, _mm_cvtsi32_si128(BITS as i32)) })
    }
    #[inline(always)]
    fn select(mask: Yes, yes: Words, no: Words) -> Words {
        Reals::select(mask, yes.as_bits(), no.as_bits()).bits()
    }
}
