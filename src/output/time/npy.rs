//! NumPy's array files, version 1.0: a header of text and numbers of single precision, the last index fastest.

use std::io::Read;

use crate::output::OutputError;

/// The bytes of an array of `f32`.
pub fn encode(shape: &[usize], values: impl Iterator<Item = f32>) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}{comma}), }}", sides.join(", "));
    // The header ends in a line end, and the numbers begin at a multiple of 64.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = Vec::with_capacity(10 + header.len() + 4 * shape.iter().product::<usize>());
    bytes.extend(b"\x93NUMPY\x01\x00");
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    values.for_each(|v| bytes.extend(v.to_le_bytes()));
    bytes
}

/// Shape and numbers of an array that [`encode`] has made.
///
/// # Errors
/// Anything else.
pub fn decode(mut bytes: &[u8]) -> Result<(Vec<usize>, Vec<f32>), OutputError> {
    let shape = read_shape(&mut bytes)?;
    let count = shape.iter().try_fold(1usize, |n, side| n.checked_mul(*side));
    if count.and_then(|n| n.checked_mul(4)) != Some(bytes.len()) {
        return Err(unknown("shape and size do not fit"));
    }
    let numbers = read_numbers(&mut bytes, count.unwrap_or(0))?;
    Ok((shape, numbers))
}

/// The shape of an array that [`encode`] has made; its numbers follow, and can be had piece by piece by [`read_numbers`].
///
/// # Errors
/// When it is something else, or cannot be read.
pub fn read_shape(from: &mut impl Read) -> Result<Vec<usize>, OutputError> {
    let mut begin = [0; 10];
    from.read_exact(&mut begin).map_err(|_| unknown("it is cut off"))?;
    let [b'\x93', b'N', b'U', b'M', b'P', b'Y', 1, 0, low, high] = begin else {
        return Err(unknown("it begins in another way"));
    };
    let mut header = vec![0; usize::from(u16::from_le_bytes([low, high]))];
    from.read_exact(&mut header).map_err(|_| unknown("it is cut off"))?;
    let header = String::from_utf8_lossy(&header);
    if !header.contains("'<f4'") || !header.contains("'fortran_order': False") {
        return Err(unknown("its numbers are of another kind"));
    }
    let inside = header.split_once("'shape': (").and_then(|(_, s)| s.split_once(')')).map(|(s, _)| s);
    let sides = inside.unwrap_or_default().split(',').map(str::trim).filter(|s| !s.is_empty());
    sides.map(str::parse).collect::<Result<_, _>>().map_err(|_| unknown("it has no shape"))
}

/// The next `count` numbers of an array.
///
/// # Errors
/// When there are fewer.
pub fn read_numbers(from: &mut impl Read, count: usize) -> Result<Vec<f32>, OutputError> {
    let mut bytes = Vec::new();
    let all = count.saturating_mul(4);
    from.take(all as u64).read_to_end(&mut bytes).map_err(|e| unknown(&e.to_string()))?;
    if bytes.len() != all {
        return Err(unknown("it is cut off"));
    }
    Ok(bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect())
}

fn unknown(reason: &str) -> OutputError {
    OutputError::PictureRead { reason: format!("no array of NumPy that is known: {reason}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_comes_back_and_begins_where_numpy_wants_it() {
        let values: Vec<f32> = (0..24).map(|i| i as f32 / 7.0 - 1.0).collect();
        let bytes = encode(&[2, 3, 4], values.iter().copied());
        assert_eq!(bytes.len() % 64, 24 * 4 % 64);
        assert_eq!(decode(&bytes).unwrap(), (vec![2, 3, 4], values));
        assert_eq!(decode(&encode(&[2], [1.0, 2.0].into_iter())).unwrap().0, [2]);
        for cut in [0, 5, 9, 40, bytes.len() - 1] {
            assert!(decode(&bytes[..cut]).is_err());
        }
    }
}
