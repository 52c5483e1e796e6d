//! Vectors of two halves, for widths that the processor's instructions do not have: pairs of
//! numbers, pairs of those, and so on.
//!
//! Results have the same bits as those of any other vector of as many lanes.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use super::{F32x8, Lanes, Vec3xN};
use crate::math::real::{Double, Mask, Outlined, Real, Word};

/// The first half of the lanes, and the second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pair<T>(T, T);

/// Implements binary operators of pairs half by half.
macro_rules! by_halves {
    ($($trait:ident $name:ident),*) => {$(
        impl<T: $trait<Output = T>> $trait for Pair<T> {
            type Output = Pair<T>;
            #[inline(always)]
            fn $name(self, other: Pair<T>) -> Pair<T> {
                Pair(self.0.$name(other.0), self.1.$name(other.1))
            }
        }
    )*};
}

by_halves!(Add add, Sub sub, Mul mul, Div div, BitAnd bitand, BitOr bitor);

impl<T: Neg<Output = T>> Neg for Pair<T> {
    type Output = Pair<T>;
    #[inline(always)]
    fn neg(self) -> Pair<T> {
        Pair(-self.0, -self.1)
    }
}

impl<T: Not<Output = T>> Not for Pair<T> {
    type Output = Pair<T>;
    #[inline(always)]
    fn not(self) -> Pair<T> {
        Pair(!self.0, !self.1)
    }
}

impl<M: Mask> Mask for Pair<M> {
    const LANES: u32 = 2 * M::LANES;

    #[inline(always)]
    fn splat(yes: bool) -> Pair<M> {
        Pair(M::splat(yes), M::splat(yes))
    }
    #[inline(always)]
    fn first(count: usize) -> Pair<M> {
        let half = M::LANES as usize;
        Pair(
            M::first(count.min(half)),
            M::first(count.saturating_sub(half)),
        )
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.bits() | self.1.bits() << M::LANES
    }
}

/// Implements methods whose arguments are all pairs, half by half.
macro_rules! methods {
    ($($name:ident($($arg:ident: $type:ty),*) -> $out:ty;)*) => {$(
        #[inline(always)]
        fn $name($($arg: $type),*) -> $out {
            Pair(T::$name($($arg.0),*), T::$name($($arg.1),*))
        }
    )*};
}

/// As [`methods`], with the receiver `self`.
macro_rules! receiver_methods {
    ($($name:ident($($arg:ident: $type:ty),*) -> $out:ty;)*) => {$(
        #[inline(always)]
        fn $name(self $(, $arg: $type)*) -> $out {
            Pair(T::$name(self.0 $(, $arg.0)*), T::$name(self.1 $(, $arg.1)*))
        }
    )*};
}

impl<T: Real> Real for Pair<T> {
    type Mask = Pair<T::Mask>;
    type Word = Pair<T::Word>;
    type Vec3 = Vec3xN<Pair<T>>;
    type Double = Pair<T::Double>;

    receiver_methods! {
        sqrt() -> Pair<T>;
        abs() -> Pair<T>;
        floor() -> Pair<T>;
        copysign(sign: Pair<T>) -> Pair<T>;
        min(bound: Pair<T>) -> Pair<T>;
        max(bound: Pair<T>) -> Pair<T>;
        lt(other: Pair<T>) -> Pair<T::Mask>;
        le(other: Pair<T>) -> Pair<T::Mask>;
        eq(other: Pair<T>) -> Pair<T::Mask>;
        bits() -> Pair<T::Word>;
        truncated() -> Pair<T::Word>;
        double() -> Pair<T::Double>;
    }
    methods! {
        select(mask: Pair<T::Mask>, yes: Pair<T>, no: Pair<T>) -> Pair<T>;
    }
    inlined! {
        splat(x: f32) -> Pair<T> = Pair(T::splat(x), T::splat(x));
        clamp(self, least: f32, most: f32) -> Pair<T> =
            Pair(self.0.clamp(least, most), self.1.clamp(least, most));
        map_lanes(self, f: impl Fn(f32) -> f32) -> Pair<T> =
            Pair(self.0.map_lanes(&f), self.1.map_lanes(&f));
        zip_lanes(self, other: Pair<T>, f: impl Fn(f32, f32) -> f32) -> Pair<T> =
            Pair(self.0.zip_lanes(other.0, &f), self.1.zip_lanes(other.1, &f));
    }
    #[inline(always)]
    fn outline<K: Outlined>(computation: K) -> K::Output {
        T::outline(computation)
    }
}

impl<T: Double> Double for Pair<T> {
    type Real = Pair<T::Real>;

    receiver_methods! {
        sqrt() -> Pair<T>;
        single() -> Pair<T::Real>;
        gt(other: Pair<T>) -> Pair<<T::Real as Real>::Mask>;
    }
    methods! {
        select(mask: Pair<<T::Real as Real>::Mask>, yes: Pair<T>, no: Pair<T>) -> Pair<T>;
    }
    inlined! {
        splat(x: f64) -> Pair<T> = Pair(T::splat(x), T::splat(x));
        lookup(table: &[f64; 32], indices: Pair<<T::Real as Real>::Word>) -> Pair<T> =
            Pair(T::lookup(table, indices.0), T::lookup(table, indices.1));
    }
}

impl<T: Word> Word for Pair<T> {
    type Real = Pair<T::Real>;

    receiver_methods! {
        add(other: Pair<T>) -> Pair<T>;
        sub(other: Pair<T>) -> Pair<T>;
        mul(other: Pair<T>) -> Pair<T>;
        xor(other: Pair<T>) -> Pair<T>;
        and(other: Pair<T>) -> Pair<T>;
        or(other: Pair<T>) -> Pair<T>;
        sign_mask() -> Pair<T>;
        eq(other: Pair<T>) -> Pair<<T::Real as Real>::Mask>;
        to_float() -> Pair<T::Real>;
        bits_to_float() -> Pair<T::Real>;
    }
    methods! {
        select(mask: Pair<<T::Real as Real>::Mask>, yes: Pair<T>, no: Pair<T>) -> Pair<T>;
    }
    inlined! {
        splat(x: u32) -> Pair<T> = Pair(T::splat(x), T::splat(x));
        shr<const BITS: u32>(self) -> Pair<T> = Pair(self.0.shr::<BITS>(), self.1.shr::<BITS>());
        shl<const BITS: u32>(self) -> Pair<T> = Pair(self.0.shl::<BITS>(), self.1.shl::<BITS>());
        map_lanes(self, f: impl Fn(u32) -> u32) -> Pair<T> =
            Pair(self.0.map_lanes(&f), self.1.map_lanes(&f));
    }
}

/// Implements [`Lanes`] for pairs of a type with `$half` lanes.
macro_rules! lanes {
    ($(Pair<$type:ty>: $half:literal = $all:literal;)*) => {$(
        impl Lanes<$all> for Pair<$type> {
            #[inline(always)]
            fn load(numbers: &[f32; $all]) -> Self {
                let [a, b] = halves::<_, $half, $all>(*numbers);
                Pair(Lanes::load(&a), Lanes::load(&b))
            }
            #[inline(always)]
            fn store(self) -> [f32; $all] {
                joined::<_, $half, $all>([self.0.store(), self.1.store()])
            }
            #[inline(always)]
            fn load_doubles(numbers: &[f64; $all]) -> Self::Double {
                let [a, b] = halves::<_, $half, $all>(*numbers);
                Pair(<$type>::load_doubles(&a), <$type>::load_doubles(&b))
            }
            #[inline(always)]
            fn store_doubles(numbers: Self::Double) -> [f64; $all] {
                let halves = [numbers.0, numbers.1].map(<$type>::store_doubles);
                joined::<_, $half, $all>(halves)
            }
            #[inline(always)]
            fn transpose_load(rows: [&F32x8; $all]) -> [Self; 8] {
                let [a, b] = halves::<_, $half, $all>(rows);
                let (a, b) = (<$type>::transpose_load(a), <$type>::transpose_load(b));
                std::array::from_fn(|i| Pair(a[i], b[i]))
            }
            #[inline(always)]
            fn transpose_store(columns: [Self; 8]) -> [F32x8; $all] {
                let halves = [columns.map(|c| c.0), columns.map(|c| c.1)];
                joined::<_, $half, $all>(halves.map(<$type>::transpose_store))
            }
        }
    )*};
}

/// Splits an array of `ALL` items into two of `HALF` each.
#[inline(always)]
fn halves<T: Copy, const HALF: usize, const ALL: usize>(items: [T; ALL]) -> [[T; HALF]; 2] {
    [
        std::array::from_fn(|i| items[i]),
        std::array::from_fn(|i| items[HALF + i]),
    ]
}

/// Joins two arrays: the inverse of [`halves`].
#[inline(always)]
fn joined<T: Copy, const HALF: usize, const ALL: usize>(halves: [[T; HALF]; 2]) -> [T; ALL] {
    std::array::from_fn(|i| halves[i / HALF][i % HALF])
}

lanes! {
    Pair<f32>: 1 = 2;
    Pair<Pair<f32>>: 2 = 4;
    Pair<Pair<Pair<f32>>>: 4 = 8;
    Pair<Pair<Pair<Pair<f32>>>>: 8 = 16;
}

#[cfg(target_arch = "x86_64")]
lanes! {
    Pair<super::x8::F32xN>: 8 = 16;
}
