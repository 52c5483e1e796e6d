//! Frames: how messages follow each other in a pipe.
//!
//! ```text
//! length of the message, 64 bits | blake3 of it | the message
//! ```

use std::io::{self, Read, Write};

/// The longest message, in bytes: longer ones are no messages.
const LONGEST: u64 = 1 << 40;

/// Writes a message and everything before it.
///
/// # Errors
/// As `to`.
pub fn write(to: &mut impl Write, message: &[u8]) -> io::Result<()> {
    to.write_all(&(message.len() as u64).to_ne_bytes())?;
    to.write_all(blake3::hash(message).as_bytes())?;
    to.write_all(message)?;
    to.flush()
}

/// The next message; `None` where the pipe ends between two of them.
///
/// # Errors
/// When the pipe fails, ends within a message, or brings another than was sent.
pub fn read(from: &mut impl Read) -> io::Result<Option<Vec<u8>>> {
    let mut length = [0; 8];
    match from.read(&mut length)? {
        0 => return Ok(None),
        read => from.read_exact(&mut length[read..])?,
    }
    let length = u64::from_ne_bytes(length);
    let mut sum = [0; blake3::OUT_LEN];
    from.read_exact(&mut sum)?;
    if length > LONGEST {
        return Err(io::Error::new(io::ErrorKind::InvalidData, format!("a message of {length} bytes")));
    }
    let mut message = Vec::new();
    from.take(length).read_to_end(&mut message)?;
    if (message.len() as u64) < length {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    if *blake3::hash(&message).as_bytes() != sum {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "a message is not the one that was sent"));
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
            assert!(!matches!(read(&mut &changed[..]), Ok(Some(m)) if m == b"first"), "changed at {at}");
        }
    }
}
