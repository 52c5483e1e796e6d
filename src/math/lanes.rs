//! Eight lanes in vectors of 256 bits.
//!
//! Only code that is compiled for AVX2 may use these types, and so only where the processor was asked whether it has it:
//! like all of [`super::real`] they say nothing of that themselves.
#![expect(unsafe_code, reason = "vector instructions that not every processor has")]

use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::real::{Double, Mask, Real, Vector, Word};

/// How many lanes.
pub const LANES: usize = 8;

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

/// Eight vectors of three numbers.
#[derive(Clone, Copy, Debug)]
pub struct Vectors {
    x: Reals,
    y: Reals,
    z: Reals,
}

/// Eight numbers in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Row(pub [f32; LANES]);

impl Reals {
    /// From memory.
    #[inline(always)]
    pub fn load(row: &Row) -> Reals {
        // SAFETY: a row is 32 bytes, aligned to 32; callers have AVX2, as the module demands.
        Reals(unsafe { _mm256_load_ps(row.0.as_ptr()) })
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self) -> Row {
        let mut row = Row::default();
        // SAFETY: as in `load`.
        unsafe { _mm256_store_ps(row.0.as_mut_ptr(), self.0) };
        row
    }
}

impl Yes {
    /// The first so many lanes.
    #[inline(always)]
    pub fn first(count: usize) -> Yes {
        let row = Row(std::array::from_fn(|i| if i < count { 1.0 } else { 0.0 }));
        Reals::load(&row).eq(Reals::of(1.0))
    }

    /// A bit for each lane.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        // SAFETY: callers have AVX2, as the module demands.
        unsafe { _mm256_movemask_ps(self.0) as u32 }
    }
}

impl Doubles {
    /// From memory.
    #[inline(always)]
    pub fn load(numbers: &[f64; LANES]) -> Doubles {
        // SAFETY: eight numbers lie there; callers have AVX2, as the module demands.
        unsafe { Doubles(_mm256_loadu_pd(numbers.as_ptr()), _mm256_loadu_pd(numbers.as_ptr().add(4))) }
    }

    /// To memory.
    #[inline(always)]
    pub fn store(self) -> [f64; LANES] {
        let mut numbers = [0.0; LANES];
        // SAFETY: as in `load`.
        unsafe {
            _mm256_storeu_pd(numbers.as_mut_ptr(), self.0);
            _mm256_storeu_pd(numbers.as_mut_ptr().add(4), self.1);
        }
        numbers
    }
}

#[inline(always)]
fn load(row: &Row) -> __m256 {
    Reals::load(row).0
}

/// Eight records of eight numbers as eight rows, or the other way round.
#[inline(always)]
pub fn transposed(r: [&Row; LANES]) -> [Reals; 8] {
    // SAFETY: callers have AVX2, as the module demands.
    unsafe {
        let [a, b, c, d, e, f, g, h] = r;
        let r = [load(a), load(b), load(c), load(d), load(e), load(f), load(g), load(h)];
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

/// Defines operators of two vectors by one instruction each.
macro_rules! operators {
    ($($of:ident: $trait:ident $name:ident $instruction:ident),*) => {$(
        impl $trait for $of {
            type Output = $of;
            #[inline(always)]
            fn $name(self, other: $of) -> $of {
                // SAFETY: callers have AVX2, as the module demands.
                $of(unsafe { $instruction(self.0, other.0) })
            }
        }
    )*};
}

operators!(Reals: Add add _mm256_add_ps, Reals: Sub sub _mm256_sub_ps, Reals: Mul mul _mm256_mul_ps,
           Reals: Div div _mm256_div_ps, Yes: BitAnd bitand _mm256_and_ps, Yes: BitOr bitor _mm256_or_ps);

/// Defines operators of two vectors of doubles by one instruction for each half.
macro_rules! by_halves {
    ($($trait:ident $name:ident $instruction:ident),*) => {$(
        impl $trait for Doubles {
            type Output = Doubles;
            #[inline(always)]
            fn $name(self, other: Doubles) -> Doubles {
                // SAFETY: callers have AVX2, as the module demands.
                unsafe { Doubles($instruction(self.0, other.0), $instruction(self.1, other.1)) }
            }
        }
    )*};
}

by_halves!(Add add _mm256_add_pd, Mul mul _mm256_mul_pd, Div div _mm256_div_pd);

impl Neg for Reals {
    type Output = Reals;
    #[inline(always)]
    fn neg(self) -> Reals {
        // SAFETY: callers have AVX2, as the module demands.
        Reals(unsafe { _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)) })
    }
}

impl Not for Yes {
    type Output = Yes;
    #[inline(always)]
    fn not(self) -> Yes {
        // SAFETY: callers have AVX2, as the module demands.
        Yes(unsafe { _mm256_xor_ps(self.0, Yes::of(true).0) })
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
    #[inline(always)]
    fn of(yes: bool) -> Yes {
        // SAFETY: callers have AVX2, as the module demands.
        Yes(unsafe { _mm256_castsi256_ps(_mm256_set1_epi32(if yes { -1 } else { 0 })) })
    }
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// Defines methods by expressions of instructions on what the arguments hold.
macro_rules! methods {
    ($($name:ident($($arg:ident: $ty:ty),*) -> $out:ident = $body:expr;)*) => {$(
        #[inline(always)]
        fn $name($($arg: $ty),*) -> $out {
            // SAFETY: callers have AVX2, as the module demands.
            $out(unsafe { $body })
        }
    )*};
}

impl Real for Reals {
    type Mask = Yes;
    type Word = Words;
    type Vec3 = Vectors;
    type Double = Doubles;

    methods! {
        of(x: f32) -> Reals = _mm256_set1_ps(x);
        select(mask: Yes, yes: Reals, no: Reals) -> Reals = _mm256_blendv_ps(no.0, yes.0, mask.0);
    }
    #[inline(always)]
    fn sqrt(self) -> Reals {
        // SAFETY: callers have AVX2, as the module demands; so for all below.
        Reals(unsafe { _mm256_sqrt_ps(self.0) })
    }
    #[inline(always)]
    fn abs(self) -> Reals {
        // SAFETY: see `sqrt`.
        Reals(unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0) })
    }
    #[inline(always)]
    fn copysign(self, sign: Reals) -> Reals {
        // SAFETY: see `sqrt`.
        Reals(unsafe { _mm256_or_ps(self.abs().0, _mm256_and_ps(_mm256_set1_ps(-0.0), sign.0)) })
    }
    #[inline(always)]
    fn min(self, bound: Reals) -> Reals {
        // SAFETY: see `sqrt`.
        Reals(unsafe { _mm256_min_ps(self.0, bound.0) })
    }
    #[inline(always)]
    fn max(self, bound: Reals) -> Reals {
        // SAFETY: see `sqrt`.
        Reals(unsafe { _mm256_max_ps(self.0, bound.0) })
    }
    #[inline(always)]
    fn clamp(self, least: f32, most: f32) -> Reals {
        // The instructions return their second operand where one is NaN.
        // SAFETY: see `sqrt`.
        Reals(unsafe { _mm256_min_ps(_mm256_set1_ps(most), _mm256_max_ps(_mm256_set1_ps(least), self.0)) })
    }
    #[inline(always)]
    fn lt(self, other: Reals) -> Yes {
        // SAFETY: see `sqrt`.
        Yes(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn le(self, other: Reals) -> Yes {
        // SAFETY: see `sqrt`.
        Yes(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn eq(self, other: Reals) -> Yes {
        // SAFETY: see `sqrt`.
        Yes(unsafe { _mm256_cmp_ps::<_CMP_EQ_OQ>(self.0, other.0) })
    }
    #[inline(always)]
    fn each(self, f: impl Fn(f32) -> f32) -> Reals {
        Reals::load(&Row(self.store().0.map(f)))
    }
    #[inline(always)]
    fn each_with(self, other: Reals, f: impl Fn(f32, f32) -> f32) -> Reals {
        let (a, b) = (self.store().0, other.store().0);
        Reals::load(&Row(std::array::from_fn(|i| f(a[i], b[i]))))
    }
    #[inline(always)]
    fn bits(self) -> Words {
        // SAFETY: see `sqrt`.
        Words(unsafe { _mm256_castps_si256(self.0) })
    }
    #[inline(always)]
    fn truncated(self) -> Words {
        // SAFETY: see `sqrt`.
        Words(unsafe { _mm256_cvttps_epi32(self.0) })
    }
    #[inline(always)]
    fn double(self) -> Doubles {
        // SAFETY: see `sqrt`.
        unsafe {
            let (first, last) = (_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            Doubles(_mm256_cvtps_pd(first), _mm256_cvtps_pd(last))
        }
    }
}

impl Double for Doubles {
    type Real = Reals;

    #[inline(always)]
    fn of(x: f64) -> Doubles {
        // SAFETY: callers have AVX2, as the module demands; so for all below.
        let all = unsafe { _mm256_set1_pd(x) };
        Doubles(all, all)
    }
    #[inline(always)]
    fn single(self) -> Reals {
        // SAFETY: see `of`.
        Reals(unsafe { _mm256_set_m128(_mm256_cvtpd_ps(self.1), _mm256_cvtpd_ps(self.0)) })
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
    }
    #[inline(always)]
    fn add(self, other: Words) -> Words {
        // SAFETY: callers have AVX2, as the module demands; so for all below.
        Words(unsafe { _mm256_add_epi32(self.0, other.0) })
    }
    #[inline(always)]
    fn sub(self, other: Words) -> Words {
        // SAFETY: see `add`.
        Words(unsafe { _mm256_sub_epi32(self.0, other.0) })
    }
    #[inline(always)]
    fn mul(self, other: Words) -> Words {
        // SAFETY: see `add`.
        Words(unsafe { _mm256_mullo_epi32(self.0, other.0) })
    }
    #[inline(always)]
    fn xor(self, other: Words) -> Words {
        // SAFETY: see `add`.
        Words(unsafe { _mm256_xor_si256(self.0, other.0) })
    }
    #[inline(always)]
    fn and(self, other: Words) -> Words {
        // SAFETY: see `add`.
        Words(unsafe { _mm256_and_si256(self.0, other.0) })
    }
    #[inline(always)]
    fn shr<const BITS: u32>(self) -> Words {
        // SAFETY: see `add`.
        Words(unsafe { _mm256_srl_epi32(self.0, _mm_cvtsi32_si128(BITS as i32)) })
    }
    #[inline(always)]
    fn negative(self) -> Words {
        // SAFETY: see `add`.
        Words(unsafe { _mm256_srai_epi32::<31>(self.0) })
    }
    #[inline(always)]
    fn eq(self, other: Words) -> Yes {
        // SAFETY: see `add`.
        Yes(unsafe { _mm256_castsi256_ps(_mm256_cmpeq_epi32(self.0, other.0)) })
    }
    #[inline(always)]
    fn select(mask: Yes, yes: Words, no: Words) -> Words {
        Reals::select(mask, yes.as_bits(), no.as_bits()).bits()
    }
    #[inline(always)]
    fn number(self) -> Reals {
        // SAFETY: see `add`.
        Reals(unsafe { _mm256_cvtepi32_ps(self.0) })
    }
    #[inline(always)]
    fn as_bits(self) -> Reals {
        // SAFETY: see `add`.
        Reals(unsafe { _mm256_castsi256_ps(self.0) })
    }
}

impl Vector for Vectors {
    type Scalar = Reals;

    #[inline(always)]
    fn new(x: Reals, y: Reals, z: Reals) -> Vectors {
        Vectors { x, y, z }
    }
    #[inline(always)]
    fn x(self) -> Reals {
        self.x
    }
    #[inline(always)]
    fn y(self) -> Reals {
        self.y
    }
    #[inline(always)]
    fn z(self) -> Reals {
        self.z
    }
}

/// Defines operators of vectors by those of their components.
macro_rules! by_component {
    ($($trait:ident $name:ident),*) => {$(
        impl $trait for Vectors {
            type Output = Vectors;
            #[inline(always)]
            fn $name(self, other: Vectors) -> Vectors {
                Vectors::new(self.x.$name(other.x), self.y.$name(other.y), self.z.$name(other.z))
            }
        }
    )*};
}

/// Defines operators of a vector and a number.
macro_rules! by_number {
    ($($trait:ident $name:ident),*) => {$(
        impl $trait<Reals> for Vectors {
            type Output = Vectors;
            #[inline(always)]
            fn $name(self, other: Reals) -> Vectors {
                Vectors::new(self.x.$name(other), self.y.$name(other), self.z.$name(other))
            }
        }
    )*};
}

by_component!(Add add, Sub sub, Mul mul);
by_number!(Mul mul, Div div);

impl Neg for Vectors {
    type Output = Vectors;
    #[inline(always)]
    fn neg(self) -> Vectors {
        Vectors::new(-self.x, -self.y, -self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Zeros, small and large numbers, infinities and NaN, in an order that brings all of them beside each other.
    fn pairs() -> Vec<(Row, Row)> {
        let special = [0.0, -0.0, 1.0, -2.5, 1e-40, -1e30, 3e38, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.7];
        (0..special.len())
            .map(|shift| {
                let at = |i: usize| special[i % special.len()];
                (Row(std::array::from_fn(at)), Row(std::array::from_fn(|i| at(i + shift + i * shift))))
            })
            .collect()
    }

    /// Bits, but that any NaN is as good as another.
    fn bits(x: f32) -> u32 {
        let bits = x.to_bits();
        if bits & 0x7fff_ffff > 0x7f80_0000 { u32::MAX } else { bits }
    }

    #[test]
    fn every_operation_is_in_every_lane_what_it_is_for_one_number() {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return;
        }
        let check = |name: &str, (x, y): &(Row, Row), wide: Reals, one: &dyn Fn(f32, f32) -> f32| {
            for lane in 0..LANES {
                let (a, b) = (x.0[lane], y.0[lane]);
                assert_eq!(bits(wide.store().0[lane]), bits(one(a, b)), "{name}: {a} {b}");
            }
        };
        for pair in pairs() {
            let (a, b) = (Reals::load(&pair.0), Reals::load(&pair.1));
            let yes = |mask: Yes| Reals::select(mask, Reals::of(1.0), Reals::of(2.0));
            let said = |yes: bool| if yes { 1.0 } else { 2.0 };
            check("sum", &pair, a + b, &|a, b| a + b);
            check("difference", &pair, a - b, &|a, b| a - b);
            check("product", &pair, a * b, &|a, b| a * b);
            check("quotient", &pair, a / b, &|a, b| a / b);
            check("negative", &pair, -a, &|a, _| -a);
            check("root", &pair, a.sqrt(), &|a, _| f32::sqrt(a));
            check("size", &pair, a.abs(), &|a, _| f32::abs(a));
            check("sign", &pair, a.copysign(b), &|a, b| f32::copysign(a, b));
            check("lesser", &pair, a.min(Reals::of(0.5)), &|a, _| f32::min(a, 0.5));
            check("greater", &pair, a.max(Reals::of(0.5)), &|a, _| f32::max(a, 0.5));
            check("between", &pair, Real::clamp(a, -1.0, 1.0), &|a, _| f32::clamp(a, -1.0, 1.0));
            check("less", &pair, yes(a.lt(b)), &|a, b| said(a < b));
            check("at most", &pair, yes(a.le(b)), &|a, b| said(a <= b));
            check("greater than", &pair, yes(a.gt(b)), &|a, b| said(a > b));
            check("at least", &pair, yes(a.ge(b)), &|a, b| said(a >= b));
            check("equal", &pair, yes(Real::eq(a, b)), &|a, b| said(a == b));
            check("finite", &pair, yes(a.is_finite()), &|a, _| said(f32::is_finite(a)));
            check("not", &pair, yes(!a.lt(b)), &|a, b| {
                said(!matches!(a.partial_cmp(&b), Some(std::cmp::Ordering::Less)))
            });
            check("each", &pair, a.each(f32::exp), &|a, _| f32::exp(a));
            check("each with", &pair, a.each_with(b, f32::powf), &f32::powf);
        }
    }

    #[test]
    fn doubles_are_in_every_lane_what_they_are_alone() {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return;
        }
        let check = |name: &str, wide: [f64; LANES], one: [f64; LANES]| {
            for (a, b) in wide.into_iter().zip(one) {
                assert!(a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()), "{name}: {a} is not {b}");
            }
        };
        for (first, second) in pairs() {
            let (a, b) = (Reals::load(&first).double(), Reals::load(&second).double());
            let (x, y) = (first.0.map(f64::from), second.0.map(f64::from));
            let both = |f: fn(f64, f64) -> f64| std::array::from_fn::<f64, LANES, _>(|i| f(x[i], y[i]));
            check("the same number", a.store(), x);
            check("sum", (a + b).store(), both(|a, b| a + b));
            check("product", (a * b).store(), both(|a, b| a * b));
            check("quotient", (a / b).store(), both(|a, b| a / b));
            let third = Doubles::of(1.0) / Doubles::of(3.0);
            let single = (a * third).single().store().0.map(f64::from);
            check("single", single, x.map(|a| f64::from((a * (1.0 / 3.0)) as f32)));
            check("greater", Doubles::select(a.gt(b), a, b).store(), both(|a, b| if a > b { a } else { b }));
            let more = Reals::select(a.gt(b), Reals::of(1.0), Reals::of(0.0)).store().0.map(f64::from);
            check("mask", more, both(|a, b| f64::from(u8::from(a > b))));
            check("memory", Doubles::load(&x).store(), x);
        }
    }

    #[test]
    fn words_wrap_and_shift_as_one_does() {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return;
        }
        let some = [0, 1, 0xffff_ffff, 0x8000_0000, 0x7fff_ffff, 12_345, 1_664_525, 0xdead_beef];
        let (a, b) = (some, [3, 0xffff_ffff, 2, 0x8000_0000, 7, 1_013_904_223, 0xdead_beef, 5]);
        let words = |w: [u32; 8]| Reals::load(&Row(w.map(f32::from_bits))).bits();
        let out = |w: Words| w.as_bits().store().0.map(f32::to_bits);
        let (x, y) = (words(a), words(b));
        let both = |f: fn(u32, u32) -> u32| std::array::from_fn::<u32, 8, _>(|i| f(a[i], b[i]));
        assert_eq!(out(x.add(y)), both(u32::wrapping_add));
        assert_eq!(out(x.sub(y)), both(u32::wrapping_sub));
        assert_eq!(out(x.mul(y)), both(u32::wrapping_mul));
        assert_eq!(out(x.xor(y)), both(|a, b| a ^ b));
        assert_eq!(out(x.and(y)), both(|a, b| a & b));
        assert_eq!(out(x.shr::<8>()), a.map(|a| a >> 8));
        assert_eq!(out(x.negative()), a.map(|a| if a >> 31 == 1 { u32::MAX } else { 0 }));
        assert_eq!(x.shr::<8>().number().store().0, a.map(|a| (a >> 8) as f32));
        let floats = Row([0.0, -1.9, 255.99, -256.0, 3.5, 1e6, -0.2, 7.0]);
        assert_eq!(out(Reals::load(&floats).truncated()), floats.0.map(|x| x as i32 as u32));
    }

    #[test]
    fn rows_become_columns() {
        if !std::arch::is_x86_feature_detected!("avx2") {
            return;
        }
        let rows: [Row; LANES] = std::array::from_fn(|i| Row(std::array::from_fn(|k| (10 * i + k) as f32)));
        for (k, column) in transposed(rows.each_ref()).into_iter().enumerate() {
            assert_eq!(column.store().0, std::array::from_fn(|i| (10 * i + k) as f32));
        }
        assert_eq!(Yes::first(3).bits(), 0b111);
        assert_eq!(Yes::first(8).bits(), 0xff);
    }
}
