//! Numbers of a PLY after its header, in any of its three encodings.

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    /// The type of either of its names.
    pub(super) fn named(name: &str) -> Option<Type> {
        Some(match name {
            "char" | "int8" => Type::I8,
            "uchar" | "uint8" => Type::U8,
            "short" | "int16" => Type::I16,
            "ushort" | "uint16" => Type::U16,
            "int" | "int32" => Type::I32,
            "uint" | "uint32" => Type::U32,
            "float" | "float32" => Type::F32,
            "double" | "float64" => Type::F64,
            _ => return None,
        })
    }

    /// What colours of this type are counted to, unless they are floats.
    pub(super) fn most(self) -> Option<f32> {
        match self {
            Type::I8 => Some(127.0),
            Type::U8 => Some(255.0),
            Type::I16 => Some(32_767.0),
            Type::U16 => Some(65_535.0),
            Type::I32 | Type::U32 => Some(255.0),
            Type::F32 | Type::F64 => None,
        }
    }

    fn size(self) -> usize {
        match self {
            Type::I8 | Type::U8 => 1,
            Type::I16 | Type::U16 => 2,
            Type::I32 | Type::U32 | Type::F32 => 4,
            Type::F64 => 8,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// A place in the bytes of a file.
pub(super) struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
}

impl<'a> Source<'a> {
    /// The bytes from `at` on in the encoding of a format's name.
    pub(super) fn new(format: &str, bytes: &'a [u8], at: usize) -> Option<Source<'a>> {
        let encoding = match format {
            "ascii" => Encoding::Ascii,
            "binary_little_endian" => Encoding::Little,
            "binary_big_endian" => Encoding::Big,
            _ => return None,
        };
        Some(Source { bytes, at, encoding })
    }

    /// The next byte's place.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// How many bytes are left.
    pub(super) fn rest(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The fewest bytes that a number of this type takes.
    pub(super) fn least(&self, ty: Type) -> usize {
        // A digit and a space.
        if self.encoding == Encoding::Ascii { 2 } else { ty.size() }
    }

    /// The next number.
    pub(super) fn number(&mut self, ty: Type) -> Result<f64, String> {
        if self.encoding == Encoding::Ascii {
            return self.word();
        }
        let Some(raw) = self.bytes.get(self.at..self.at + ty.size()) else {
            return Err("the file ends in the middle of it".to_owned());
        };
        self.at += raw.len();
        let mut b = [0u8; 8];
        b[..raw.len()].copy_from_slice(raw);
        if self.encoding == Encoding::Big {
            b[..raw.len()].reverse();
        }
        let [b0, b1, b2, b3, ..] = b;
        Ok(match ty {
            Type::I8 => f64::from(b0 as i8),
            Type::U8 => f64::from(b0),
            Type::I16 => f64::from(i16::from_le_bytes([b0, b1])),
            Type::U16 => f64::from(u16::from_le_bytes([b0, b1])),
            Type::I32 => f64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            Type::U32 => f64::from(u32::from_le_bytes([b0, b1, b2, b3])),
            Type::F32 => f64::from(f32::from_le_bytes([b0, b1, b2, b3])),
            Type::F64 => f64::from_le_bytes(b),
        })
    }

    fn word(&mut self) -> Result<f64, String> {
        let rest = &self.bytes[self.at..];
        let Some(start) = rest.iter().position(|b| !b.is_ascii_whitespace()) else {
            return Err("the file ends in the middle of it".to_owned());
        };
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        let word = &rest[start..start + length];
        self.at += start + length;
        let read = std::str::from_utf8(word).ok().and_then(|w| w.parse().ok());
        read.ok_or_else(|| {
            let shown: String = String::from_utf8_lossy(word).chars().take(24).collect();
            format!("`{shown}` is no number")
        })
    }

    /// The length of a list of numbers of a type: no more than the rest of the file holds.
    pub(super) fn length(&mut self, length: Type, ty: Type) -> Result<usize, String> {
        let n = self.number(length)?;
        let room = self.rest() / self.least(ty) + 1;
        if n < 0.0 || n.fract() != 0.0 || n > room as f64 {
            return Err(format!("a list of {n} numbers, where the file has room for {room} at most"));
        }
        Ok(n as usize)
    }

    /// The next number as an index.
    pub(super) fn index(&mut self, ty: Type) -> Result<u32, String> {
        let n = self.number(ty)?;
        if n < 0.0 || n.fract() != 0.0 || n > f64::from(u32::MAX) {
            return Err(format!("expected an index, found {n}"));
        }
        Ok(n as u32)
    }
}
