//! NumPy array files, version 1.0: a text header, then `f32` values with the last index varying
//! fastest.

use std::io::Read;

use crate::OutputError;

/// Encodes an array of `f32` in NumPy's format.
pub fn encode(shape: &[usize], values: impl Iterator<Item = f32>) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut header = format!(
        "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}{comma}), }}",
        sides.join(", ")
    );
    // The header ends with a line feed, and the values begin at a multiple of 64 bytes.
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

/// Returns shape and values of an array written by [`encode`].
///
/// # Errors
/// Returns an error if the bytes are not such an array.
pub fn decode(mut bytes: &[u8]) -> Result<(Vec<usize>, Vec<f32>), OutputError> {
    let shape = read_shape(&mut bytes)?;
    let count = shape
        .iter()
        .try_fold(1usize, |n, side| n.checked_mul(*side));
    if count.and_then(|n| n.checked_mul(4)) != Some(bytes.len()) {
        return Err(invalid("its shape does not match its size"));
    }
    let numbers = read_numbers(&mut bytes, count.unwrap_or(0))?;
    Ok((shape, numbers))
}

/// Reads the shape of an array written by [`encode`]. The values follow and can be read in parts
/// with [`read_numbers`].
///
/// # Errors
/// Returns an error if the data are not such an array or cannot be read.
pub fn read_shape(from: &mut impl Read) -> Result<Vec<usize>, OutputError> {
    let mut start = [0; 10];
    from.read_exact(&mut start)
        .map_err(|_| invalid("it is truncated"))?;
    let [b'\x93', b'N', b'U', b'M', b'P', b'Y', 1, 0, low, high] = start else {
        return Err(invalid(
            "it does not start with the signature of version 1.0",
        ));
    };
    let mut header = vec![0; usize::from(u16::from_le_bytes([low, high]))];
    from.read_exact(&mut header)
        .map_err(|_| invalid("its header is truncated"))?;
    let header = String::from_utf8_lossy(&header);
    if !header.contains("'<f4'") || !header.contains("'fortran_order': False") {
        return Err(invalid("its values are not `f32` in C order"));
    }
    let inside = header
        .split_once("'shape': (")
        .and_then(|(_, s)| s.split_once(')'))
        .map(|(s, _)| s);
    let sides = inside
        .unwrap_or_default()
        .split(',')
        .map(str::trim)
        .filter(|s| !s.is_empty());
    sides
        .map(str::parse)
        .collect::<Result<_, _>>()
        .map_err(|_| invalid("its header has no shape"))
}

/// Reads the next `count` values of an array.
///
/// # Errors
/// Returns an error if there are fewer values, or they cannot be read.
pub fn read_numbers(from: &mut impl Read, count: usize) -> Result<Vec<f32>, OutputError> {
    let mut bytes = Vec::new();
    let size = count.saturating_mul(4);
    from.take(size as u64)
        .read_to_end(&mut bytes)
        .map_err(|e| invalid(&e.to_string()))?;
    if bytes.len() != size {
        return Err(invalid("it is truncated"));
    }
    Ok(bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
        .collect())
}

fn invalid(reason: &str) -> OutputError {
    OutputError::PictureRead {
        reason: format!("invalid NumPy array: {reason}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_decoded_unchanged_and_its_values_are_aligned() {
        let values: Vec<f32> = (0..24).map(|i| i as f32 / 7.0 - 1.0).collect();
        let bytes = encode(&[2, 3, 4], values.iter().copied());
        assert_eq!(bytes.len() % 64, 24 * 4 % 64);
        assert_eq!(decode(&bytes).unwrap(), (vec![2, 3, 4], values));
        assert_eq!(
            decode(&encode(&[2], [1.0, 2.0].into_iter())).unwrap().0,
            [2]
        );
        for cut in [0, 5, 9, 40, bytes.len() - 1] {
            assert!(decode(&bytes[..cut]).is_err());
        }
    }
}
