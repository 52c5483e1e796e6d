//! Frames that delimit messages in a pipe:
//!
//! ```text
//! length of the message, 64 bits | blake3 of it | the message
//! ```

use std::io::{self, Read, Write};

/// Maximum length of a message in bytes; longer ones are corrupt.
const MAX_LENGTH: u64 = 1 << 40;

/// Writes a framed message and flushes the pipe.
///
/// # Errors
/// Returns any error of the writer.
pub fn write(to: &mut impl Write, message: &[u8]) -> io::Result<()> {
    to.write_all(&(message.len() as u64).to_ne_bytes())?;
    to.write_all(blake3::hash(message).as_bytes())?;
    to.write_all(message)?;
    to.flush()
}

/// Reads the next message, or returns `None` if the pipe ends between two messages.
///
/// # Errors
/// Returns an error if the pipe fails, ends within a message, or the checksum does not match.
pub fn read(from: &mut impl Read) -> io::Result<Option<Vec<u8>>> {
    let mut length = [0; 8];
    match from.read(&mut length)? {
        0 => return Ok(None),
        read => from.read_exact(&mut length[read..])?,
    }
    let length = u64::from_ne_bytes(length);
    let mut sum = [0; blake3::OUT_LEN];
    from.read_exact(&mut sum)?;
    if length > MAX_LENGTH {
        return Err(io::Error::new(
            io::ErrorKind::InvalidData,
            format!("invalid message length: {length} bytes"),
        ));
    }
    let mut message = Vec::new();
    from.take(length).read_to_end(&mut message)?;
    if (message.len() as u64) < length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    if *blake3::hash(&message).as_bytes() != sum {
        return Err(io::Error::new(
            io::ErrorKind::InvalidData,
            "message checksum mismatch",
        ));
    }
    Ok(Some(message))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pipe() -> Vec<u8> {
        let mut pipe = Vec::new();
        write(&mut pipe, b"first").unwrap();
        write(&mut pipe, b"").unwrap();
        pipe
    }

    #[test]
    fn messages_come_in_order_and_then_the_end() {
        let pipe = pipe();
        let mut from = &pipe[..];
        assert_eq!(read(&mut from).unwrap(), Some(b"first".to_vec()));
        assert_eq!(read(&mut from).unwrap(), Some(Vec::new()));
        assert_eq!(read(&mut from).unwrap(), None);
    }

    #[test]
    fn a_message_that_is_cut_or_changed_anywhere_is_an_error() {
        let whole = pipe();
        let first = 8 + 32 + 5;
        for cut in 1..first {
            assert!(read(&mut &whole[..cut]).is_err(), "cut after {cut}");
        }
        for at in 0..first {
            let mut changed = whole.clone();
            changed[at] ^= 0x10;
            assert!(
                !matches!(read(&mut &changed[..]), Ok(Some(m)) if m == b"first"),
                "changed at {at}"
            );
        }
    }
}
