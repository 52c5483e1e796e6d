//! Numbers, one or several at once: what equations are written in that are to be evaluated for one path, or for the paths
//! in all lanes of a vector.
//!
//! [`f32`] is one lane. Every operation is the correctly rounded one of IEEE 754 in every lane, without fused
//! multiplication, so that an equation gives a lane the bits that it gives the number alone. What depends on a comparison
//! is written with [`Real::select`], or behind [`Mask::any`] where no lane may need it; for one lane that is a branch.
//!
//! Words are compared and mixed as they are for random numbers and for steps in the last place.

use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

use glam::Vec3;

/// Numbers of single precision.
pub trait Real:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// What a comparison says of each.
    type Mask: Mask;
    /// As many words of 32 bits.
    type Word: Word<Real = Self>;
    /// As many vectors.
    type Vec3: Vector<Scalar = Self>;
    /// As many numbers of double precision.
    type Double: Double<Real = Self>;

    /// The same number in every lane.
    fn of(x: f32) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Without its sign.
    fn abs(self) -> Self;
    /// With the sign of another.
    fn copysign(self, sign: Self) -> Self;
    /// The lesser; `bound` where `self` is NaN, and `bound` must not be.
    fn min(self, bound: Self) -> Self;
    /// The greater; `bound` where `self` is NaN, and `bound` must not be.
    fn max(self, bound: Self) -> Self;
    /// Between two bounds; NaN stays.
    fn clamp(self, least: f32, most: f32) -> Self;
    /// Where it is less.
    fn lt(self, other: Self) -> Self::Mask;
    /// Where it is less or equal.
    fn le(self, other: Self) -> Self::Mask;
    /// Where it is greater.
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }
    /// Where it is greater or equal.
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }
    /// Where it is equal.
    fn eq(self, other: Self) -> Self::Mask;
    /// Where it is neither infinite nor NaN.
    #[inline(always)]
    fn is_finite(self) -> Self::Mask {
        self.abs().lt(Self::of(f32::INFINITY))
    }
    /// `yes` where the mask is set, else `no`.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// A function of a number, lane by lane: for what no vector instruction does.
    fn each(self, f: impl Fn(f32) -> f32) -> Self;
    /// A function of two.
    fn each_with(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self;
    /// The bits.
    fn bits(self) -> Self::Word;
    /// The whole part of numbers within the range of 32 bits with sign.
    fn truncated(self) -> Self::Word;
    /// The same number in double precision.
    fn double(self) -> Self::Double;
}

/// Numbers of double precision.
pub trait Double: Copy + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// Numbers of as many lanes.
    type Real: Real<Double = Self>;

    /// The same number in every lane.
    fn of(x: f64) -> Self;
    /// The nearest number of single precision.
    fn single(self) -> Self::Real;
    /// Where it is greater.
    fn gt(self, other: Self) -> <Self::Real as Real>::Mask;
    /// `yes` where the mask is set, else `no`.
    fn select(mask: <Self::Real as Real>::Mask, yes: Self, no: Self) -> Self;
}

/// Yes or no in every lane.
pub trait Mask:
    Copy + Debug + Default + PartialEq + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self>
{
    /// The same in every lane.
    fn of(yes: bool) -> Self;
    /// In the first so many lanes.
    fn first(count: usize) -> Self;
    /// A bit for each lane, the first the lowest.
    fn bits(self) -> u32;
    /// Whether it is yes in any lane.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// Words of 32 bits; sums and products wrap around.
pub trait Word: Copy {
    /// Numbers of as many lanes.
    type Real: Real<Word = Self>;

    /// The same word in every lane.
    fn of(x: u32) -> Self;
    /// Sum.
    fn add(self, other: Self) -> Self;
    /// Difference.
    fn sub(self, other: Self) -> Self;
    /// Product.
    fn mul(self, other: Self) -> Self;
    /// Bits that are set in one of the two.
    fn xor(self, other: Self) -> Self;
    /// Bits that are set in both.
    fn and(self, other: Self) -> Self;
    /// Shifted right by so many bits; zeros come in.
    fn shr<const BITS: u32>(self) -> Self;
    /// All bits set where the uppermost is, else none.
    fn negative(self) -> Self;
    /// Where it is equal.
    fn eq(self, other: Self) -> <Self::Real as Real>::Mask;
    /// `yes` where the mask is set, else `no`.
    fn select(mask: <Self::Real as Real>::Mask, yes: Self, no: Self) -> Self;
    /// The number; words are at most 2^24.
    fn number(self) -> Self::Real;
    /// The number with these bits.
    fn as_bits(self) -> Self::Real;
}

/// Vectors of three numbers, with sums in the order of `glam`.
pub trait Vector:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<Self::Scalar, Output = Self>
    + Mul<Self, Output = Self>
    + Div<Self::Scalar, Output = Self>
{
    /// Its components.
    type Scalar: Real<Vec3 = Self>;

    /// From its components.
    fn new(x: Self::Scalar, y: Self::Scalar, z: Self::Scalar) -> Self;
    /// The first component.
    fn x(self) -> Self::Scalar;
    /// The second component.
    fn y(self) -> Self::Scalar;
    /// The third component.
    fn z(self) -> Self::Scalar;

    /// The same vector in every lane.
    #[inline(always)]
    fn of(v: Vec3) -> Self {
        Self::new(Self::Scalar::of(v.x), Self::Scalar::of(v.y), Self::Scalar::of(v.z))
    }
    /// A vector whose components are all the same.
    #[inline(always)]
    fn all(x: Self::Scalar) -> Self {
        Self::new(x, x, x)
    }
    /// Scalar product.
    #[inline(always)]
    fn dot(self, other: Self) -> Self::Scalar {
        self.x() * other.x() + self.y() * other.y() + self.z() * other.z()
    }
    /// Vector product.
    #[inline(always)]
    fn cross(self, other: Self) -> Self {
        Self::new(
            self.y() * other.z() - other.y() * self.z(),
            self.z() * other.x() - other.z() * self.x(),
            self.x() * other.y() - other.x() * self.y(),
        )
    }
    /// Squared length.
    #[inline(always)]
    fn length_squared(self) -> Self::Scalar {
        self.dot(self)
    }
    /// Length.
    #[inline(always)]
    fn length(self) -> Self::Scalar {
        self.dot(self).sqrt()
    }
    /// The unit vector of its direction, or `fallback` where it has none.
    #[inline(always)]
    fn normalize_or(self, fallback: Self) -> Self {
        let scale = Self::Scalar::of(1.0) / self.length();
        Self::select(scale.is_finite() & scale.gt(Self::Scalar::of(0.0)), self * scale, fallback)
    }
    /// `yes` where the mask is set, else `no`.
    #[inline(always)]
    fn select(mask: <Self::Scalar as Real>::Mask, yes: Self, no: Self) -> Self {
        Self::new(
            Self::Scalar::select(mask, yes.x(), no.x()),
            Self::Scalar::select(mask, yes.y(), no.y()),
            Self::Scalar::select(mask, yes.z(), no.z()),
        )
    }
    /// Where all components are finite.
    #[inline(always)]
    fn is_finite(self) -> <Self::Scalar as Real>::Mask {
        self.x().is_finite() & self.y().is_finite() & self.z().is_finite()
    }
    /// Where all components are the other's.
    #[inline(always)]
    fn same(self, other: Self) -> <Self::Scalar as Real>::Mask {
        self.x().eq(other.x()) & self.y().eq(other.y()) & self.z().eq(other.z())
    }
    /// The sum of the components.
    #[inline(always)]
    fn element_sum(self) -> Self::Scalar {
        self.x() + self.y() + self.z()
    }
    /// A function of each component.
    #[inline(always)]
    fn map(self, f: impl Fn(Self::Scalar) -> Self::Scalar) -> Self {
        Self::new(f(self.x()), f(self.y()), f(self.z()))
    }
}

impl Mask for bool {
    #[inline(always)]
    fn of(yes: bool) -> bool {
        yes
    }
    #[inline(always)]
    fn first(count: usize) -> bool {
        count > 0
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

impl Word for u32 {
    type Real = f32;

    #[inline(always)]
    fn of(x: u32) -> u32 {
        x
    }
    #[inline(always)]
    fn add(self, other: u32) -> u32 {
        self.wrapping_add(other)
    }
    #[inline(always)]
    fn sub(self, other: u32) -> u32 {
        self.wrapping_sub(other)
    }
    #[inline(always)]
    fn mul(self, other: u32) -> u32 {
        self.wrapping_mul(other)
    }
    #[inline(always)]
    fn xor(self, other: u32) -> u32 {
        self ^ other
    }
    #[inline(always)]
    fn and(self, other: u32) -> u32 {
        self & other
    }
    #[inline(always)]
    fn shr<const BITS: u32>(self) -> u32 {
        self >> BITS
    }
    #[inline(always)]
    fn negative(self) -> u32 {
        ((self as i32) >> 31) as u32
    }
    #[inline(always)]
    fn eq(self, other: u32) -> bool {
        self == other
    }
    #[inline(always)]
    fn select(mask: bool, yes: u32, no: u32) -> u32 {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn number(self) -> f32 {
        self as f32
    }
    #[inline(always)]
    fn as_bits(self) -> f32 {
        f32::from_bits(self)
    }
}

impl Real for f32 {
    type Mask = bool;
    type Word = u32;
    type Vec3 = Vec3;
    type Double = f64;

    #[inline(always)]
    fn of(x: f32) -> f32 {
        x
    }
    #[inline(always)]
    fn sqrt(self) -> f32 {
        f32::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> f32 {
        f32::abs(self)
    }
    #[inline(always)]
    fn copysign(self, sign: f32) -> f32 {
        f32::copysign(self, sign)
    }
    #[inline(always)]
    fn min(self, bound: f32) -> f32 {
        f32::min(self, bound)
    }
    #[inline(always)]
    fn max(self, bound: f32) -> f32 {
        f32::max(self, bound)
    }
    #[inline(always)]
    fn clamp(self, least: f32, most: f32) -> f32 {
        f32::clamp(self, least, most)
    }
    #[inline(always)]
    fn lt(self, other: f32) -> bool {
        self < other
    }
    #[inline(always)]
    fn le(self, other: f32) -> bool {
        self <= other
    }
    #[inline(always)]
    fn eq(self, other: f32) -> bool {
        self == other
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        f32::is_finite(self)
    }
    #[inline(always)]
    fn select(mask: bool, yes: f32, no: f32) -> f32 {
        if mask { yes } else { no }
    }
    #[inline(always)]
    fn each(self, f: impl Fn(f32) -> f32) -> f32 {
        f(self)
    }
    #[inline(always)]
    fn each_with(self, other: f32, f: impl Fn(f32, f32) -> f32) -> f32 {
        f(self, other)
    }
    #[inline(always)]
    fn bits(self) -> u32 {
        self.to_bits()
    }
    #[inline(always)]
    fn truncated(self) -> u32 {
        self as i32 as u32
    }
    #[inline(always)]
    fn double(self) -> f64 {
        f64::from(self)
    }
}

impl Double for f64 {
    type Real = f32;

    #[inline(always)]
    fn of(x: f64) -> f64 {
        x
    }
    #[inline(always)]
    fn single(self) -> f32 {
        self as f32
    }
    #[inline(always)]
    fn gt(self, other: f64) -> bool {
        self > other
    }
    #[inline(always)]
    fn select(mask: bool, yes: f64, no: f64) -> f64 {
        if mask { yes } else { no }
    }
}

impl Vector for Vec3 {
    type Scalar = f32;

    #[inline(always)]
    fn new(x: f32, y: f32, z: f32) -> Vec3 {
        Vec3::new(x, y, z)
    }
    #[inline(always)]
    fn x(self) -> f32 {
        self.x
    }
    #[inline(always)]
    fn y(self) -> f32 {
        self.y
    }
    #[inline(always)]
    fn z(self) -> f32 {
        self.z
    }
}
