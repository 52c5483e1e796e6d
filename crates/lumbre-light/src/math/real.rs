//! Scalar and SIMD number traits. Code generic over [`Real`] runs on `f32`, or on a vector with one
//! `f32` per lane.
//!
//! Invariant: results are bit-identical per lane for any number of lanes; [`f32`] is the case of
//! one lane. Every operation is the correctly rounded one of IEEE 754, and there is no fused
//! multiply-add.
//!
//! Code that depends on a comparison uses [`Real::select`]. It may skip work that no lane needs
//! with [`Mask::any`], which for one lane is a branch.
//!
//! [`Word`] has the 32-bit integers for random numbers and for steps by units in the last place.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use glam::Vec3;

/// A computation that is compiled as a function of its own: see [`Real::outline`].
pub trait Outlined {
    /// The result of the computation.
    type Output;

    /// Runs the computation. Must be `#[inline(always)]`.
    fn run(self) -> Self::Output;
}

/// A single-precision number in each lane.
pub trait Real:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A boolean per lane: the result of a comparison.
    type Mask: Mask;
    /// A 32-bit word per lane.
    type Word: Word<Real = Self>;
    /// A three-component vector per lane.
    type Vec3: Vector<Scalar = Self>;
    /// A double-precision number per lane.
    type Double: Double<Real = Self>;

    /// Returns the same number in every lane.
    fn splat(x: f32) -> Self;
    /// Returns the square root.
    fn sqrt(self) -> Self;
    /// Returns the absolute value.
    fn abs(self) -> Self;
    /// Returns the greatest integer that is not above the number.
    fn floor(self) -> Self;
    /// Returns the number with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// Returns the lesser number; `bound` if `self` is NaN. `bound` must not be NaN.
    fn min(self, bound: Self) -> Self;
    /// Returns the greater number; `bound` if `self` is NaN. `bound` must not be NaN.
    fn max(self, bound: Self) -> Self;
    /// Clamps to `least..=most`; NaN stays NaN.
    fn clamp(self, least: f32, most: f32) -> Self;
    /// Returns where `self < other`.
    fn lt(self, other: Self) -> Self::Mask;
    /// Returns where `self <= other`.
    fn le(self, other: Self) -> Self::Mask;
    /// Returns where `self > other`.
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }
    /// Returns where `self >= other`.
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }
    /// Returns where `self == other`.
    fn eq(self, other: Self) -> Self::Mask;
    /// Returns where the number is neither infinite nor NaN.
    #[inline(always)]
    fn is_finite(self) -> Self::Mask {
        self.abs().lt(Self::splat(f32::INFINITY))
    }
    /// Returns `yes` where the mask is set, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Applies a scalar function lane by lane, for functions without a vector instruction.
    fn map_lanes(self, f: impl Fn(f32) -> f32) -> Self;
    /// Applies a scalar function of two numbers lane by lane.
    fn zip_lanes(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self;
    /// Returns the bit pattern.
    fn bits(self) -> Self::Word;
    /// Returns the integral part. The number must fit a 32-bit signed integer.
    fn truncated(self) -> Self::Word;
    /// Converts to double precision.
    fn double(self) -> Self::Double;
    /// Runs a computation as a function of its own, compiled for the instruction set of these
    /// vectors. All other functions are compiled into their callers, over and over.
    fn outline<K: Outlined>(computation: K) -> K::Output;
}

/// A double-precision number in each lane.
pub trait Double: Copy + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// The single-precision type of as many lanes.
    type Real: Real<Double = Self>;

    /// Returns the same number in every lane.
    fn splat(x: f64) -> Self;
    /// Returns the square root.
    fn sqrt(self) -> Self;
    /// Returns the entries of a table at the indices of which the lowest five bits are given.
    fn lookup(table: &[f64; 32], indices: <Self::Real as Real>::Word) -> Self;
    /// Rounds to the nearest single-precision number.
    fn single(self) -> Self::Real;
    /// Returns where `self > other`.
    fn gt(self, other: Self) -> <Self::Real as Real>::Mask;
    /// Returns `yes` where the mask is set, else `no`.
    fn select(mask: <Self::Real as Real>::Mask, yes: Self, no: Self) -> Self;
}

/// A boolean in each lane.
pub trait Mask:
    Copy
    + Debug
    + Default
    + PartialEq
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + Not<Output = Self>
{
    /// Number of lanes.
    const LANES: u32;

    /// Returns the same boolean in every lane.
    fn splat(yes: bool) -> Self;
    /// Returns a mask whose first `count` lanes are set.
    fn first(count: usize) -> Self;
    /// Returns one bit per lane; lane 0 is the lowest bit.
    fn bits(self) -> u32;
    /// Returns whether any lane is set.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// A 32-bit word in each lane; sums and products wrap around.
pub trait Word: Copy {
    /// The single-precision type of as many lanes.
    type Real: Real<Word = Self>;

    /// Returns the same word in every lane.
    fn splat(x: u32) -> Self;
    /// Returns the wrapping sum.
    fn add(self, other: Self) -> Self;
    /// Returns the wrapping difference.
    fn sub(self, other: Self) -> Self;
    /// Returns the wrapping product.
    fn mul(self, other: Self) -> Self;
    /// Returns the bitwise exclusive or.
    fn xor(self, other: Self) -> Self;
    /// Returns the bitwise and.
    fn and(self, other: Self) -> Self;
    /// Returns the bitwise or.
    fn or(self, other: Self) -> Self;
    /// Shifts right by `BITS`, filling with zeros.
    fn shr<const BITS: u32>(self) -> Self;
    /// Shifts left by `BITS`, filling with zeros.
    fn shl<const BITS: u32>(self) -> Self;
    /// Rotates left by 16 bits.
    #[inline(always)]
    fn swap_halves(self) -> Self {
        self.shl::<16>().or(self.shr::<16>())
    }
    /// Reverses the order of the bits.
    #[inline(always)]
    fn reverse_bits(self) -> Self {
        let x = self.swap_groups::<1>(0x5555_5555);
        let x = x.swap_groups::<2>(0x3333_3333);
        let x = x.swap_groups::<4>(0x0f0f_0f0f);
        let x = x.swap_groups::<8>(0x00ff_00ff);
        x.swap_halves()
    }
    /// Swaps neighbouring groups of `BITS` bits; `lower` has the bits of every second group,
    /// beginning with the lowest.
    #[inline(always)]
    fn swap_groups<const BITS: u32>(self, lower: u32) -> Self {
        let lower = Self::splat(lower);
        self.shr::<BITS>()
            .and(lower)
            .or(self.and(lower).shl::<BITS>())
    }
    /// Applies a scalar function lane by lane.
    fn map_lanes(self, f: impl Fn(u32) -> u32) -> Self;
    /// Returns all ones where the highest bit is set, else zero.
    fn sign_mask(self) -> Self;
    /// Returns where the words are equal.
    fn eq(self, other: Self) -> <Self::Real as Real>::Mask;
    /// Returns `yes` where the mask is set, else `no`.
    fn select(mask: <Self::Real as Real>::Mask, yes: Self, no: Self) -> Self;
    /// Converts to a number; the word must be at most 2^24.
    fn to_float(self) -> Self::Real;
    /// Reinterprets the bits as a number.
    fn bits_to_float(self) -> Self::Real;
}

/// A three-component vector in each lane; components are summed in `glam`'s order.
pub trait Vector:
    Copy
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<Self::Scalar, Output = Self>
    + Mul<Self, Output = Self>
    + Div<Self::Scalar, Output = Self>
{
    /// The type of a component.
    type Scalar: Real<Vec3 = Self>;

    /// Builds a vector from its components.
    fn new(x: Self::Scalar, y: Self::Scalar, z: Self::Scalar) -> Self;
    /// Returns the first component.
    fn x(self) -> Self::Scalar;
    /// Returns the second component.
    fn y(self) -> Self::Scalar;
    /// Returns the third component.
    fn z(self) -> Self::Scalar;

    /// Returns the same vector in every lane.
    #[inline(always)]
    fn broadcast(v: Vec3) -> Self {
        Self::new(
            Self::Scalar::splat(v.x),
            Self::Scalar::splat(v.y),
            Self::Scalar::splat(v.z),
        )
    }
    /// Returns a vector whose components are all `x`.
    #[inline(always)]
    fn splat(x: Self::Scalar) -> Self {
        Self::new(x, x, x)
    }
    /// Returns the scalar product.
    #[inline(always)]
    fn dot(self, other: Self) -> Self::Scalar {
        self.x() * other.x() + self.y() * other.y() + self.z() * other.z()
    }
    /// Returns the cross product.
    #[inline(always)]
    fn cross(self, other: Self) -> Self {
        Self::new(
            self.y() * other.z() - other.y() * self.z(),
            self.z() * other.x() - other.z() * self.x(),
            self.x() * other.y() - other.x() * self.y(),
        )
    }
    /// Returns the squared length.
    #[inline(always)]
    fn length_squared(self) -> Self::Scalar {
        self.dot(self)
    }
    /// Returns the length.
    #[inline(always)]
    fn length(self) -> Self::Scalar {
        self.dot(self).sqrt()
    }
    /// Returns the unit vector along this one, or `fallback` where that is not finite.
    #[inline(always)]
    fn normalize_or(self, fallback: Self) -> Self {
        let scale = Self::Scalar::splat(1.0) / self.length();
        Self::select(
            scale.is_finite() & scale.gt(Self::Scalar::splat(0.0)),
            self * scale,
            fallback,
        )
    }
    /// Returns `yes` where the mask is set, else `no`.
    #[inline(always)]
    fn select(mask: <Self::Scalar as Real>::Mask, yes: Self, no: Self) -> Self {
        Self::new(
            Self::Scalar::select(mask, yes.x(), no.x()),
            Self::Scalar::select(mask, yes.y(), no.y()),
            Self::Scalar::select(mask, yes.z(), no.z()),
        )
    }
    /// Returns where all components are finite.
    #[inline(always)]
    fn is_finite(self) -> <Self::Scalar as Real>::Mask {
        self.x().is_finite() & self.y().is_finite() & self.z().is_finite()
    }
    /// Returns where all components equal those of `other`.
    #[inline(always)]
    fn same(self, other: Self) -> <Self::Scalar as Real>::Mask {
        self.x().eq(other.x()) & self.y().eq(other.y()) & self.z().eq(other.z())
    }
    /// Returns the sum of the components.
    #[inline(always)]
    fn element_sum(self) -> Self::Scalar {
        self.x() + self.y() + self.z()
    }
    /// Returns the square roots of the components.
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::new(self.x().sqrt(), self.y().sqrt(), self.z().sqrt())
    }
    /// Returns the vector with no component above `most`.
    #[inline(always)]
    fn at_most(self, most: Self::Scalar) -> Self {
        Self::new(self.x().min(most), self.y().min(most), self.z().min(most))
    }
    /// Returns the vector with no component below `least`.
    #[inline(always)]
    fn at_least(self, least: Self::Scalar) -> Self {
        Self::new(
            self.x().max(least),
            self.y().max(least),
            self.z().max(least),
        )
    }
}

impl Mask for bool {
    const LANES: u32 = 1;

    inlined! {
        splat(yes: bool) -> bool = yes;
        first(count: usize) -> bool = count > 0;
        bits(self) -> u32 = u32::from(self);
    }
}

impl Word for u32 {
    type Real = f32;

    inlined! {
        splat(x: u32) -> u32 = x;
        add(self, other: u32) -> u32 = self.wrapping_add(other);
        sub(self, other: u32) -> u32 = self.wrapping_sub(other);
        mul(self, other: u32) -> u32 = self.wrapping_mul(other);
        xor(self, other: u32) -> u32 = self ^ other;
        and(self, other: u32) -> u32 = self & other;
        or(self, other: u32) -> u32 = self | other;
        shr<const BITS: u32>(self) -> u32 = self >> BITS;
        shl<const BITS: u32>(self) -> u32 = self << BITS;
        reverse_bits(self) -> u32 = u32::reverse_bits(self);
        map_lanes(self, f: impl Fn(u32) -> u32) -> u32 = f(self);
        sign_mask(self) -> u32 = ((self as i32) >> 31) as u32;
        eq(self, other: u32) -> bool = self == other;
        select(mask: bool, yes: u32, no: u32) -> u32 = if mask { yes } else { no };
        to_float(self) -> f32 = self as f32;
        bits_to_float(self) -> f32 = f32::from_bits(self);
    }
}

impl Real for f32 {
    type Mask = bool;
    type Word = u32;
    type Vec3 = Vec3;
    type Double = f64;

    inlined! {
        splat(x: f32) -> f32 = x;
        sqrt(self) -> f32 = f32::sqrt(self);
        abs(self) -> f32 = f32::abs(self);
        copysign(self, sign: f32) -> f32 = f32::copysign(self, sign);
        min(self, bound: f32) -> f32 = f32::min(self, bound);
        max(self, bound: f32) -> f32 = f32::max(self, bound);
        clamp(self, least: f32, most: f32) -> f32 = f32::clamp(self, least, most);
        lt(self, other: f32) -> bool = self < other;
        le(self, other: f32) -> bool = self <= other;
        eq(self, other: f32) -> bool = self == other;
        is_finite(self) -> bool = f32::is_finite(self);
        select(mask: bool, yes: f32, no: f32) -> f32 = if mask { yes } else { no };
        map_lanes(self, f: impl Fn(f32) -> f32) -> f32 = f(self);
        zip_lanes(self, other: f32, f: impl Fn(f32, f32) -> f32) -> f32 = f(self, other);
        bits(self) -> u32 = self.to_bits();
        truncated(self) -> u32 = self as i32 as u32;
        double(self) -> f64 = f64::from(self);
    }
    #[inline(always)]
    fn floor(self) -> f32 {
        // The baseline instruction set has no instruction for it, and the library's function is a
        // call. Greater numbers are integers; the sign is that of zero.
        if self.abs() < 8_388_608.0 {
            let truncated = self as i32 as f32;
            let below = truncated - f32::from(u8::from(truncated > self));
            below.copysign(self)
        } else {
            self
        }
    }
    #[inline(never)]
    fn outline<K: Outlined>(computation: K) -> K::Output {
        computation.run()
    }
}

impl Double for f64 {
    type Real = f32;

    inlined! {
        splat(x: f64) -> f64 = x;
        sqrt(self) -> f64 = f64::sqrt(self);
        lookup(table: &[f64; 32], indices: u32) -> f64 = table[indices as usize % 32];
        single(self) -> f32 = self as f32;
        gt(self, other: f64) -> bool = self > other;
        select(mask: bool, yes: f64, no: f64) -> f64 = if mask { yes } else { no };
    }
}

impl Vector for Vec3 {
    type Scalar = f32;

    inlined! {
        new(x: f32, y: f32, z: f32) -> Vec3 = Vec3::new(x, y, z);
        x(self) -> f32 = self.x;
        y(self) -> f32 = self.y;
        z(self) -> f32 = self.z;
    }
}
