//! NumPy's array files, version 1.0: a header of text and numbers of single precision, the last index fastest.

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
pub fn decode(bytes: &[u8]) -> Result<(Vec<usize>, Vec<f32>), OutputError> {
    let fail = |reason: &str| OutputError::PictureRead { reason: format!("no array of NumPy that is known: {reason}") };
    let rest = bytes.strip_prefix(b"\x93NUMPY\x01\x00").ok_or_else(|| fail("it begins in another way"))?;
    let (length, rest) = rest.split_first_chunk::<2>().ok_or_else(|| fail("it is cut off"))?;
    let length = usize::from(u16::from_le_bytes(*length));
    let (header, numbers) = rest.split_at_checked(length).ok_or_else(|| fail("it is cut off"))?;
    let header = String::from_utf8_lossy(header);
    if !header.contains("'<f4'") || !header.contains("'fortran_order': False") {
        return Err(fail("its numbers are of another kind"));
    }
    let inside = header.split_once("'shape': (").and_then(|(_, s)| s.split_once(')')).map(|(s, _)| s);
    let sides = inside.unwrap_or_default().split(',').map(str::trim).filter(|s| !s.is_empty());
    let shape: Vec<usize> = sides.map(str::parse).collect::<Result<_, _>>().map_err(|_| fail("it has no shape"))?;
    let count = shape.iter().try_fold(1usize, |n, side| n.checked_mul(*side));
    if count.and_then(|n| n.checked_mul(4)) != Some(numbers.len()) {
        return Err(fail("shape and size do not fit"));
    }
    let (numbers, _) = numbers.as_chunks::<4>();
    Ok((shape, numbers.iter().map(|b| f32::from_le_bytes(*b)).collect()))
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
