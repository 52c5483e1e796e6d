//! The trait of vectors of lanes, three-component vectors of them, and functions of all lanes.

use std::ops::{Add, Div, Mul, Neg, Sub};

use glam::Vec3;

use crate::math::real::{Mask, Real, Vector, Word};

/// A row: eight `f32` in memory, aligned for vector loads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct F32x8(pub [f32; 8]);

/// A vector of `N` lanes of `f32`, with loads and stores.
pub trait Lanes<const N: usize>: Real {
    /// Loads one number per lane.
    fn load(numbers: &[f32; N]) -> Self;
    /// Stores one number per lane.
    fn store(self) -> [f32; N];
    /// Loads one word per lane.
    #[inline(always)]
    fn load_words(words: &[u32; N]) -> Self::Word {
        Self::load(&map_array(*words, f32::from_bits)).bits()
    }
    /// Stores one word per lane.
    #[inline(always)]
    fn store_words(words: Self::Word) -> [u32; N] {
        map_array(words.bits_to_float().store(), f32::to_bits)
    }
    /// Loads one double-precision number per lane.
    fn load_doubles(numbers: &[f64; N]) -> Self::Double;
    /// Stores one double-precision number per lane.
    fn store_doubles(numbers: Self::Double) -> [f64; N];
    /// Loads one row of eight numbers per lane, transposed: vector `k` holds number `k` of each
    /// row.
    fn transpose_load(rows: [&F32x8; N]) -> [Self; 8];
    /// Stores one row of eight numbers per lane: the inverse of [`Lanes::transpose_load`].
    fn transpose_store(columns: [Self; 8]) -> [F32x8; N];
}

/// A three-component vector in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Vec3xN<R> {
    x: R,
    y: R,
    z: R,
}

/// Applies a function to each element of an array. Unlike `array::map` it is always inlined.
#[inline(always)]
pub fn map_array<T: Copy, U: Copy, const N: usize>(values: [T; N], f: impl Fn(T) -> U) -> [U; N] {
    let mut mapped = [f(values[0]); N];
    for i in 1..N {
        mapped[i] = f(values[i]);
    }
    mapped
}

/// Returns the vector of each lane.
#[inline(always)]
pub fn store_vectors<R: Lanes<N>, const N: usize>(vectors: R::Vec3) -> [Vec3; N] {
    let [x, y, z] = [
        vectors.x().store(),
        vectors.y().store(),
        vectors.z().store(),
    ];
    std::array::from_fn(|lane| Vec3::new(x[lane], y[lane], z[lane]))
}

/// Applies a scalar function to the lane index and the vector of each lane of `wanted`, for
/// functions without vector instructions. Results of other lanes are 0.
#[inline(always)]
pub fn map_vectors<R: Lanes<N>, const N: usize, const K: usize>(
    vectors: R::Vec3,
    wanted: R::Mask,
    f: impl Fn(usize, Vec3) -> [f32; K],
) -> [R; K] {
    let vectors = store_vectors::<R, N>(vectors);
    let mut results = [[0.0; N]; K];
    for lane in active_lanes(wanted.bits()) {
        let numbers = f(lane, vectors[lane]);
        for (result, number) in results.iter_mut().zip(numbers) {
            result[lane] = number;
        }
    }
    let mut loaded = [R::splat(0.0); K];
    for (result, numbers) in loaded.iter_mut().zip(&results) {
        *result = R::load(numbers);
    }
    loaded
}

/// Returns a group of 1 to `N` items, one per lane. Unused lanes repeat the first item; the caller
/// discards their results.
#[inline(always)]
pub fn padded<T: Copy, const N: usize>(group: &[T]) -> [T; N] {
    let mut lanes = [group[0]; N];
    for (lane, item) in lanes.iter_mut().zip(group) {
        *lane = *item;
    }
    lanes
}

/// Returns the indices of the lanes whose bits are set, lowest first.
#[inline(always)]
pub fn active_lanes(mut bits: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (lane < u32::BITS as usize).then_some(lane)
    })
}

impl<R: Real<Vec3 = Vec3xN<R>>> Vector for Vec3xN<R> {
    type Scalar = R;

    inlined! {
        new(x: R, y: R, z: R) -> Vec3xN<R> = Vec3xN { x, y, z };
        x(self) -> R = self.x;
        y(self) -> R = self.y;
        z(self) -> R = self.z;
    }
}

/// Implements binary operators of two vectors component by component.
macro_rules! by_component {
    ($($trait:ident $name:ident),*) => {$(
        impl<R: Real> $trait for Vec3xN<R> {
            type Output = Vec3xN<R>;
            #[inline(always)]
            fn $name(self, other: Vec3xN<R>) -> Vec3xN<R> {
                Vec3xN {
                    x: self.x.$name(other.x),
                    y: self.y.$name(other.y),
                    z: self.z.$name(other.z),
                }
            }
        }
    )*};
}

/// Implements binary operators of a vector and a scalar.
macro_rules! by_number {
    ($($trait:ident $name:ident),*) => {$(
        impl<R: Real> $trait<R> for Vec3xN<R> {
            type Output = Vec3xN<R>;
            #[inline(always)]
            fn $name(self, other: R) -> Vec3xN<R> {
                Vec3xN { x: self.x.$name(other), y: self.y.$name(other), z: self.z.$name(other) }
            }
        }
    )*};
}

by_component!(Add add, Sub sub, Mul mul);

by_number!(Mul mul, Div div);

impl<R: Real> Neg for Vec3xN<R> {
    type Output = Vec3xN<R>;
    #[inline(always)]
    fn neg(self) -> Vec3xN<R> {
        Vec3xN {
            x: -self.x,
            y: -self.y,
            z: -self.z,
        }
    }
}
