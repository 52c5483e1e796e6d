//! Serialisation of values for the pipes between a process and its workers. Both are the same
//! program on the same machine, so numbers keep its byte order and nothing is tagged with its type.

use std::sync::Arc;

use glam::{Affine2, DAffine3, Mat3, Vec2, Vec3, Vec4};

/// Error: bytes that are not the encoding of the expected type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("corrupt message from worker")]
pub struct CorruptMessage;

/// Reader over the bytes of a message.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Starts at the first byte.
    pub fn new(bytes: &'a [u8]) -> Reader<'a> {
        Reader { bytes }
    }

    /// Reads the next `length` bytes.
    ///
    /// # Errors
    /// Returns [`CorruptMessage`] if fewer are left.
    pub fn read_bytes(&mut self, length: usize) -> Result<&'a [u8], CorruptMessage> {
        let (bytes, rest) = self.bytes.split_at_checked(length).ok_or(CorruptMessage)?;
        self.bytes = rest;
        Ok(bytes)
    }

    /// Reads the length of a sequence, each of whose elements takes at least one byte.
    fn length(&mut self) -> Result<usize, CorruptMessage> {
        let length = usize::try_from(u64::read_from(self)?).map_err(|_| CorruptMessage)?;
        if length > self.bytes.len() {
            Err(CorruptMessage)
        } else {
            Ok(length)
        }
    }
}

/// Type that can be sent through a pipe.
pub trait Wire: Sized {
    /// Appends the encoding of the value.
    fn write_to(&self, to: &mut Vec<u8>);

    /// Reads a value back.
    ///
    /// # Errors
    /// Returns [`CorruptMessage`] if the bytes do not encode a value of this type.
    fn read_from(from: &mut Reader<'_>) -> Result<Self, CorruptMessage>;
}

/// Encodes a value.
pub fn encode(value: &impl Wire) -> Vec<u8> {
    let mut bytes = Vec::new();
    value.write_to(&mut bytes);
    bytes
}

/// Decodes a value from all of these bytes.
///
/// # Errors
/// Returns [`CorruptMessage`] if they encode no such value, or more than one.
pub fn decode<T: Wire>(bytes: &[u8]) -> Result<T, CorruptMessage> {
    let mut from = Reader::new(bytes);
    let value = T::read_from(&mut from)?;
    if from.bytes.is_empty() {
        Ok(value)
    } else {
        Err(CorruptMessage)
    }
}

macro_rules! numbers {
    ($($ty:ty),+) => { $(impl Wire for $ty {
        fn write_to(&self, to: &mut Vec<u8>) {
            to.extend_from_slice(&self.to_ne_bytes());
        }

        fn read_from(from: &mut Reader<'_>) -> Result<$ty, CorruptMessage> {
            let bytes = from.read_bytes(size_of::<$ty>())?.try_into().map_err(|_| CorruptMessage)?;
            Ok(<$ty>::from_ne_bytes(bytes))
        }
    })+ };
}

numbers!(u8, u32, u64, f32, f64);

macro_rules! vectors {
    ($($ty:ty),+) => { $(impl Wire for $ty {
        fn write_to(&self, to: &mut Vec<u8>) {
            self.to_array().write_to(to);
        }

        fn read_from(from: &mut Reader<'_>) -> Result<$ty, CorruptMessage> {
            Ok(<$ty>::from_array(Wire::read_from(from)?))
        }
    })+ };
}

vectors!(Vec2, Vec3, Vec4);

macro_rules! matrices {
    ($($ty:ty: $n:literal),+) => { $(impl Wire for $ty {
        fn write_to(&self, to: &mut Vec<u8>) {
            self.to_cols_array().write_to(to);
        }

        fn read_from(from: &mut Reader<'_>) -> Result<$ty, CorruptMessage> {
            let columns: [_; $n] = Wire::read_from(from)?;
            Ok(<$ty>::from_cols_array(&columns))
        }
    })+ };
}

matrices!(Affine2: 6, Mat3: 9, DAffine3: 12);

impl Wire for bool {
    fn write_to(&self, to: &mut Vec<u8>) {
        to.push(u8::from(*self));
    }

    fn read_from(from: &mut Reader<'_>) -> Result<bool, CorruptMessage> {
        match u8::read_from(from)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(CorruptMessage),
        }
    }
}

impl Wire for usize {
    fn write_to(&self, to: &mut Vec<u8>) {
        (*self as u64).write_to(to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<usize, CorruptMessage> {
        usize::try_from(u64::read_from(from)?).map_err(|_| CorruptMessage)
    }
}

impl Wire for String {
    fn write_to(&self, to: &mut Vec<u8>) {
        self.len().write_to(to);
        to.extend_from_slice(self.as_bytes());
    }

    fn read_from(from: &mut Reader<'_>) -> Result<String, CorruptMessage> {
        let length = from.length()?;
        String::from_utf8(from.read_bytes(length)?.to_vec()).map_err(|_| CorruptMessage)
    }
}

impl<T: Wire> Wire for Option<T> {
    fn write_to(&self, to: &mut Vec<u8>) {
        self.is_some().write_to(to);
        if let Some(value) = self {
            value.write_to(to);
        }
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Option<T>, CorruptMessage> {
        bool::read_from(from)?
            .then(|| T::read_from(from))
            .transpose()
    }
}

impl<T: Wire> Wire for Vec<T> {
    fn write_to(&self, to: &mut Vec<u8>) {
        self.len().write_to(to);
        self.iter().for_each(|value| value.write_to(to));
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Vec<T>, CorruptMessage> {
        let length = from.length()?;
        let mut values = Vec::with_capacity(length);
        for _ in 0..length {
            values.push(T::read_from(from)?);
        }
        Ok(values)
    }
}

impl<T: Wire + Copy, const N: usize> Wire for [T; N] {
    fn write_to(&self, to: &mut Vec<u8>) {
        self.iter().for_each(|value| value.write_to(to));
    }

    fn read_from(from: &mut Reader<'_>) -> Result<[T; N], CorruptMessage> {
        const { assert!(N > 0) };
        let mut values = [T::read_from(from)?; N];
        for value in &mut values[1..] {
            *value = T::read_from(from)?;
        }
        Ok(values)
    }
}

impl<T: Wire> Wire for Arc<T> {
    fn write_to(&self, to: &mut Vec<u8>) {
        T::write_to(self, to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Arc<T>, CorruptMessage> {
        T::read_from(from).map(Arc::new)
    }
}

impl<T: Wire> Wire for Arc<[T]> {
    fn write_to(&self, to: &mut Vec<u8>) {
        self.len().write_to(to);
        self.iter().for_each(|value| value.write_to(to));
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Arc<[T]>, CorruptMessage> {
        Vec::read_from(from).map(Arc::from)
    }
}

impl<T: Wire> Wire for Box<T> {
    fn write_to(&self, to: &mut Vec<u8>) {
        T::write_to(self, to);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Box<T>, CorruptMessage> {
        T::read_from(from).map(Box::new)
    }
}

/// Byte string that is copied as a whole.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blob(pub Vec<u8>);

impl Wire for Blob {
    fn write_to(&self, to: &mut Vec<u8>) {
        self.0.len().write_to(to);
        to.extend_from_slice(&self.0);
    }

    fn read_from(from: &mut Reader<'_>) -> Result<Blob, CorruptMessage> {
        let length = from.length()?;
        Ok(Blob(from.read_bytes(length)?.to_vec()))
    }
}

/// Implements [`Wire`] for structs field by field. A struct with an unlisted field does not
/// compile.
macro_rules! structs {
    ($($ty:ident {
        $($field:ident),+ $(,)?
    })+) => { $(impl $crate::worker::wire::Wire for $ty {
        fn write_to(&self, to: &mut Vec<u8>) {
            let $ty { $($field),+ } = self;
            $($crate::worker::wire::Wire::write_to($field, to);)+
        }

        fn read_from(
            from: &mut $crate::worker::wire::Reader<'_>,
        ) -> Result<$ty, $crate::worker::wire::CorruptMessage> {
            Ok($ty { $($field: $crate::worker::wire::Wire::read_from(from)?),+ })
        }
    })+ };
}

/// Implements [`Wire`] for values as their index in a list of all of them.
macro_rules! indices {
    ($($ty:ty: $all:expr),+ $(,)?) => { $(impl $crate::worker::wire::Wire for $ty {
        fn write_to(&self, to: &mut Vec<u8>) {
            let index = $all.iter().position(|one| one == self).unwrap_or(usize::MAX);
            $crate::worker::wire::Wire::write_to(&index, to);
        }

        fn read_from(
            from: &mut $crate::worker::wire::Reader<'_>,
        ) -> Result<$ty, $crate::worker::wire::CorruptMessage> {
            let index = <usize as $crate::worker::wire::Wire>::read_from(from)?;
            $all.get(index).copied().ok_or($crate::worker::wire::CorruptMessage)
        }
    })+ };
}

pub(super) use {indices, structs};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_round_trip_and_truncated_ones_are_corrupt() {
        type All = Vec<Option<(Vec3, String)>>;
        let _: Option<All> = None;
        let value = (
            vec![Some(Vec3::new(1.0, -0.0, f32::NAN)), None],
            "è".to_owned(),
        );
        let bytes = [
            encode(&value.0),
            encode(&value.1),
            encode(&Blob(vec![1, 2])),
            encode(&[7u64, u64::MAX]),
        ]
        .concat();
        let mut from = Reader::new(&bytes);
        let back: Vec<Option<Vec3>> = Wire::read_from(&mut from).unwrap();
        assert_eq!(format!("{back:?}"), format!("{:?}", value.0));
        assert_eq!(String::read_from(&mut from).unwrap(), value.1);
        assert_eq!(Blob::read_from(&mut from).unwrap(), Blob(vec![1, 2]));
        assert_eq!(<[u64; 2]>::read_from(&mut from).unwrap(), [7, u64::MAX]);
        assert!(u8::read_from(&mut from).is_err());
        assert!(decode::<[u64; 2]>(&encode(&[1u64, 2])[..15]).is_err());
        assert!(decode::<u8>(&[1, 2]).is_err());
    }

    #[test]
    fn an_impossible_length_is_refused_before_allocation() {
        let mut bytes = encode(&u64::MAX);
        bytes.push(1);
        assert!(decode::<Vec<u8>>(&bytes).is_err() && decode::<String>(&bytes).is_err());
        assert!(decode::<Blob>(&encode(&(1u64 << 40))).is_err());
        assert!(decode::<bool>(&[2]).is_err());
    }
}
