//! The numbers of a PLY file after its header, in any of its three encodings.

/// Type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl NumberType {
    /// Returns the type with one of its two names.
    pub(super) fn from_name(name: &str) -> Option<NumberType> {
        Some(match name {
            "char" | "int8" => NumberType::I8,
            "uchar" | "uint8" => NumberType::U8,
            "short" | "int16" => NumberType::I16,
            "ushort" | "uint16" => NumberType::U16,
            "int" | "int32" => NumberType::I32,
            "uint" | "uint32" => NumberType::U32,
            "float" | "float32" => NumberType::F32,
            "double" | "float64" => NumberType::F64,
            _ => return None,
        })
    }

    /// Returns the value that means 1 in colours of this type; `None` for floats.
    pub(super) fn color_max(self) -> Option<f32> {
        match self {
            NumberType::I8 => Some(127.0),
            NumberType::U8 => Some(255.0),
            NumberType::I16 => Some(32_767.0),
            NumberType::U16 => Some(65_535.0),
            NumberType::I32 | NumberType::U32 => Some(255.0),
            NumberType::F32 | NumberType::F64 => None,
        }
    }

    /// Returns the size in binary encodings, in bytes.
    fn size(self) -> usize {
        match self {
            NumberType::I8 | NumberType::U8 => 1,
            NumberType::I16 | NumberType::U16 => 2,
            NumberType::I32 | NumberType::U32 | NumberType::F32 => 4,
            NumberType::F64 => 8,
        }
    }
}

/// Encoding of the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// A position in the bytes of a file.
pub(super) struct NumberStream<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
}

impl<'a> NumberStream<'a> {
    /// Creates a stream from `at` on, in the encoding with this name in the header.
    pub(super) fn new(format: &str, bytes: &'a [u8], at: usize) -> Option<NumberStream<'a>> {
        let encoding = match format {
            "ascii" => Encoding::Ascii,
            "binary_little_endian" => Encoding::Little,
            "binary_big_endian" => Encoding::Big,
            _ => return None,
        };
        Some(NumberStream {
            bytes,
            at,
            encoding,
        })
    }

    /// Returns the offset of the next byte.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// Returns the number of bytes left.
    pub(super) fn remaining(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Returns the least number of bytes of a number of this type.
    pub(super) fn min_size(&self, ty: NumberType) -> usize {
        // ASCII: a digit and a space.
        if self.encoding == Encoding::Ascii {
            2
        } else {
            ty.size()
        }
    }

    /// Returns whether numbers of this type may have more digits than single precision.
    pub(super) fn is_precise(&self, ty: NumberType) -> bool {
        match ty {
            NumberType::F64 => true,
            NumberType::F32 => self.encoding == Encoding::Ascii,
            _ => false,
        }
    }

    /// Reads the next number.
    pub(super) fn number(&mut self, ty: NumberType) -> Result<f64, String> {
        if self.encoding == Encoding::Ascii {
            return self.ascii_number();
        }
        let Some(raw) = self.bytes.get(self.at..self.at + ty.size()) else {
            return Err("the file ends early".to_owned());
        };
        self.at += raw.len();
        let mut b = [0u8; 8];
        b[..raw.len()].copy_from_slice(raw);
        if self.encoding == Encoding::Big {
            b[..raw.len()].reverse();
        }
        let [b0, b1, b2, b3, ..] = b;
        Ok(match ty {
            NumberType::I8 => f64::from(b0 as i8),
            NumberType::U8 => f64::from(b0),
            NumberType::I16 => f64::from(i16::from_le_bytes([b0, b1])),
            NumberType::U16 => f64::from(u16::from_le_bytes([b0, b1])),
            NumberType::I32 => f64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            NumberType::U32 => f64::from(u32::from_le_bytes([b0, b1, b2, b3])),
            NumberType::F32 => f64::from(f32::from_le_bytes([b0, b1, b2, b3])),
            NumberType::F64 => f64::from_le_bytes(b),
        })
    }

    /// Reads the next number of an ASCII file.
    fn ascii_number(&mut self) -> Result<f64, String> {
        let rest = &self.bytes[self.at..];
        let Some(start) = rest.iter().position(|b| !b.is_ascii_whitespace()) else {
            return Err("the file ends early".to_owned());
        };
        let length = rest[start..]
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len() - start);
        let word = &rest[start..start + length];
        self.at += start + length;
        let read = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        read.ok_or_else(|| {
            let shown: String = String::from_utf8_lossy(word).chars().take(24).collect();
            format!("`{shown}` is not a number")
        })
    }

    /// Reads the length of a list of numbers of a type; it is bounded by the rest of the file.
    pub(super) fn length(&mut self, length: NumberType, ty: NumberType) -> Result<usize, String> {
        let n = self.number(length)?;
        let capacity = self.remaining() / self.min_size(ty) + 1;
        if n < 0.0 || n.fract() != 0.0 || n > capacity as f64 {
            return Err(format!(
                "a list has {n} numbers, but the file holds at most {capacity}"
            ));
        }
        Ok(n as usize)
    }

    /// Reads the next number as an index.
    pub(super) fn index(&mut self, ty: NumberType) -> Result<u32, String> {
        let n = self.number(ty)?;
        if n < 0.0 || n.fract() != 0.0 || n > f64::from(u32::MAX) {
            return Err(format!("expected an index, found {n}"));
        }
        Ok(n as u32)
    }
}
