//! Values as bytes, for the pipes between this program and its workers, which are the same program on the same machine:
//! numbers keep its byte order, and nothing says what it is.

use std::sync::Arc;

use glam::{Affine2, DAffine3, Mat3, Vec2, Vec3, Vec4};

/// Why bytes are not what they should be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("what came through the pipe makes no sense")]
pub struct Garbled;

/// Bytes that are being read.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    /// From the first byte.
    pub fn new(bytes: &'a [u8]) -> Reader<'a> {
        Reader { bytes }
    }

    /// The next so many bytes.
    ///
    /// # Errors
    /// When fewer are left.
    pub fn take(&mut self, length: usize) -> Result<&'a [u8], Garbled> {
        let (bytes, rest) = self.bytes.split_at_checked(length).ok_or(Garbled)?;
        self.bytes = rest;
        Ok(bytes)
    }

    /// A length of things, each of which takes at least one byte.
    fn length(&mut self) -> Result<usize, Garbled> {
        let length = usize::try_from(u64::take(self)?).map_err(|_| Garbled)?;
        if length > self.bytes.len() { Err(Garbled) } else { Ok(length) }
    }
}

/// A type that goes through a pipe.
pub trait Wire: Sized {
    /// Adds its bytes.
    fn put(&self, to: &mut Vec<u8>);

    /// Reads it back.
    ///
    /// # Errors
    /// When the bytes are not those of this type.
    fn take(from: &mut Reader<'_>) -> Result<Self, Garbled>;
}

/// All the bytes of a value.
pub fn encode(value: &impl Wire) -> Vec<u8> {
    let mut bytes = Vec::new();
    value.put(&mut bytes);
    bytes
}

/// The value that is all of these bytes.
///
/// # Errors
/// When they are no such value, or more than one.
pub fn decode<T: Wire>(bytes: &[u8]) -> Result<T, Garbled> {
    let mut from = Reader::new(bytes);
    let value = T::take(&mut from)?;
    if from.bytes.is_empty() { Ok(value) } else { Err(Garbled) }
}

macro_rules! numbers {
    ($($ty:ty),+) => { $(impl Wire for $ty {
        fn put(&self, to: &mut Vec<u8>) {
            to.extend_from_slice(&self.to_ne_bytes());
        }

        fn take(from: &mut Reader<'_>) -> Result<$ty, Garbled> {
            let bytes = from.take(size_of::<$ty>())?.try_into().map_err(|_| Garbled)?;
            Ok(<$ty>::from_ne_bytes(bytes))
        }
    })+ };
}

numbers!(u8, u32, u64, f32, f64);

macro_rules! vectors {
    ($($ty:ty),+) => { $(impl Wire for $ty {
        fn put(&self, to: &mut Vec<u8>) {
            self.to_array().put(to);
        }

        fn take(from: &mut Reader<'_>) -> Result<$ty, Garbled> {
            Ok(<$ty>::from_array(Wire::take(from)?))
        }
    })+ };
}

vectors!(Vec2, Vec3, Vec4);

macro_rules! matrices {
    ($($ty:ty: $n:literal),+) => { $(impl Wire for $ty {
        fn put(&self, to: &mut Vec<u8>) {
            self.to_cols_array().put(to);
        }

        fn take(from: &mut Reader<'_>) -> Result<$ty, Garbled> {
            let columns: [_; $n] = Wire::take(from)?;
            Ok(<$ty>::from_cols_array(&columns))
        }
    })+ };
}

matrices!(Affine2: 6, Mat3: 9, DAffine3: 12);

impl Wire for bool {
    fn put(&self, to: &mut Vec<u8>) {
        to.push(u8::from(*self));
    }

    fn take(from: &mut Reader<'_>) -> Result<bool, Garbled> {
        match u8::take(from)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Garbled),
        }
    }
}

impl Wire for usize {
    fn put(&self, to: &mut Vec<u8>) {
        (*self as u64).put(to);
    }

    fn take(from: &mut Reader<'_>) -> Result<usize, Garbled> {
        usize::try_from(u64::take(from)?).map_err(|_| Garbled)
    }
}

impl Wire for String {
    fn put(&self, to: &mut Vec<u8>) {
        self.len().put(to);
        to.extend_from_slice(self.as_bytes());
    }

    fn take(from: &mut Reader<'_>) -> Result<String, Garbled> {
        let length = from.length()?;
        String::from_utf8(from.take(length)?.to_vec()).map_err(|_| Garbled)
    }
}

impl<T: Wire> Wire for Option<T> {
    fn put(&self, to: &mut Vec<u8>) {
        self.is_some().put(to);
        if let Some(value) = self {
            value.put(to);
        }
    }

    fn take(from: &mut Reader<'_>) -> Result<Option<T>, Garbled> {
        bool::take(from)?.then(|| T::take(from)).transpose()
    }
}

impl<T: Wire> Wire for Vec<T> {
    fn put(&self, to: &mut Vec<u8>) {
        self.len().put(to);
        self.iter().for_each(|value| value.put(to));
    }

    fn take(from: &mut Reader<'_>) -> Result<Vec<T>, Garbled> {
        let length = from.length()?;
        let mut values = Vec::with_capacity(length);
        for _ in 0..length {
            values.push(T::take(from)?);
        }
        Ok(values)
    }
}

impl<T: Wire + Copy, const N: usize> Wire for [T; N] {
    fn put(&self, to: &mut Vec<u8>) {
        self.iter().for_each(|value| value.put(to));
    }

    fn take(from: &mut Reader<'_>) -> Result<[T; N], Garbled> {
        const { assert!(N > 0) };
        let mut values = [T::take(from)?; N];
        for value in &mut values[1..] {
            *value = T::take(from)?;
        }
        Ok(values)
    }
}

impl<T: Wire> Wire for Arc<T> {
    fn put(&self, to: &mut Vec<u8>) {
        T::put(self, to);
    }

    fn take(from: &mut Reader<'_>) -> Result<Arc<T>, Garbled> {
        T::take(from).map(Arc::new)
    }
}

impl<T: Wire> Wire for Arc<[T]> {
    fn put(&self, to: &mut Vec<u8>) {
        self.len().put(to);
        self.iter().for_each(|value| value.put(to));
    }

    fn take(from: &mut Reader<'_>) -> Result<Arc<[T]>, Garbled> {
        Vec::take(from).map(Arc::from)
    }
}

impl<T: Wire> Wire for Box<T> {
    fn put(&self, to: &mut Vec<u8>) {
        T::put(self, to);
    }

    fn take(from: &mut Reader<'_>) -> Result<Box<T>, Garbled> {
        T::take(from).map(Box::new)
    }
}

/// Many bytes at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blob(pub Vec<u8>);

impl Wire for Blob {
    fn put(&self, to: &mut Vec<u8>) {
        self.0.len().put(to);
        to.extend_from_slice(&self.0);
    }

    fn take(from: &mut Reader<'_>) -> Result<Blob, Garbled> {
        let length = from.length()?;
        Ok(Blob(from.take(length)?.to_vec()))
    }
}

/// Structs as their fields one after another. A field that is not named here does not compile.
macro_rules! structs {
    ($($ty:ident { $($field:ident),+ $(,)? })+) => { $(impl $crate::render::worker::wire::Wire for $ty {
        fn put(&self, to: &mut Vec<u8>) {
            let $ty { $($field),+ } = self;
            $($crate::render::worker::wire::Wire::put($field, to);)+
        }

        fn take(
            from: &mut $crate::render::worker::wire::Reader<'_>,
        ) -> Result<$ty, $crate::render::worker::wire::Garbled> {
            Ok($ty { $($field: $crate::render::worker::wire::Wire::take(from)?),+ })
        }
    })+ };
}

/// Words as their place in a list of all of them.
macro_rules! words {
    ($($ty:ty: $all:expr),+ $(,)?) => { $(impl $crate::render::worker::wire::Wire for $ty {
        fn put(&self, to: &mut Vec<u8>) {
            $crate::render::worker::wire::Wire::put(&$all.iter().position(|one| one == self).unwrap_or(usize::MAX), to);
        }

        fn take(
            from: &mut $crate::render::worker::wire::Reader<'_>,
        ) -> Result<$ty, $crate::render::worker::wire::Garbled> {
            let place = <usize as $crate::render::worker::wire::Wire>::take(from)?;
            $all.get(place).copied().ok_or($crate::render::worker::wire::Garbled)
        }
    })+ };
}

pub(super) use {structs, words};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_and_half_of_one_does_not() {
        type All = Vec<Option<(Vec3, String)>>;
        let _: Option<All> = None;
        let value = (vec![Some(Vec3::new(1.0, -0.0, f32::NAN)), None], "è".to_owned());
        let bytes = [encode(&value.0), encode(&value.1), encode(&Blob(vec![1, 2])), encode(&[7u64, u64::MAX])].concat();
        let mut from = Reader::new(&bytes);
        let back: Vec<Option<Vec3>> = Wire::take(&mut from).unwrap();
        assert_eq!(format!("{back:?}"), format!("{:?}", value.0));
        assert_eq!(String::take(&mut from).unwrap(), value.1);
        assert_eq!(Blob::take(&mut from).unwrap(), Blob(vec![1, 2]));
        assert_eq!(<[u64; 2]>::take(&mut from).unwrap(), [7, u64::MAX]);
        assert!(u8::take(&mut from).is_err());
        assert!(decode::<[u64; 2]>(&encode(&[1u64, 2])[..15]).is_err());
        assert!(decode::<u8>(&[1, 2]).is_err());
    }

    #[test]
    fn a_length_that_cannot_be_is_refused_before_memory_is_asked_for() {
        let mut bytes = encode(&u64::MAX);
        bytes.push(1);
        assert!(decode::<Vec<u8>>(&bytes).is_err() && decode::<String>(&bytes).is_err());
        assert!(decode::<Blob>(&encode(&(1u64 << 40))).is_err());
        assert!(decode::<bool>(&[2]).is_err());
    }
}
