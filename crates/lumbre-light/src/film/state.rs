//! Serialisation of film sums, so that an interrupted run resumes from a checkpoint with identical
//! bits.
//!
//! Numbers are stored in the machine's own byte order; the caller records which one that is.

use std::io::{self, Write};

use super::Film;

/// Number of integers buffered for one write call.
const CHUNK: usize = 8192;

/// Error: the saved bytes do not belong to a state of this kind and size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the checkpoint does not match this run: it was written for other settings")]
pub struct CheckpointMismatch;

/// Writes integers one after another.
///
/// # Errors
/// Returns any error of the writer.
pub fn write_u64s(to: &mut dyn Write, words: impl IntoIterator<Item = u64>) -> io::Result<()> {
    let mut words = words.into_iter();
    let mut chunk = Vec::with_capacity(CHUNK);
    loop {
        chunk.clear();
        chunk.extend(words.by_ref().take(CHUNK));
        if chunk.is_empty() {
            return Ok(());
        }
        to.write_all(bytemuck::cast_slice(&chunk))?;
    }
}

/// Writes sums, `[pixel][rgb]`.
///
/// # Errors
/// Returns any error of the writer.
pub fn write_sums(to: &mut dyn Write, sums: &[[f64; 3]]) -> io::Result<()> {
    to.write_all(bytemuck::cast_slice(sums))
}

/// Reader over the bytes of a saved state that have not been read yet.
#[derive(Debug)]
pub struct StateReader<'a> {
    bytes: &'a [u8],
}

impl<'a> StateReader<'a> {
    /// Starts at the first byte of a state.
    pub fn new(bytes: &'a [u8]) -> StateReader<'a> {
        StateReader { bytes }
    }

    /// Reads the next integer.
    ///
    /// # Errors
    /// Returns [`CheckpointMismatch`] if nothing is left.
    pub fn read_u64(&mut self) -> Result<u64, CheckpointMismatch> {
        let (word, rest) = self.bytes.split_first_chunk().ok_or(CheckpointMismatch)?;
        self.bytes = rest;
        Ok(u64::from_ne_bytes(*word))
    }

    /// Reads the next `length` bytes.
    ///
    /// # Errors
    /// Returns [`CheckpointMismatch`] if fewer are left.
    pub fn read_bytes(&mut self, length: u64) -> Result<&'a [u8], CheckpointMismatch> {
        let length = usize::try_from(length).map_err(|_| CheckpointMismatch)?;
        let (bytes, rest) = self
            .bytes
            .split_at_checked(length)
            .ok_or(CheckpointMismatch)?;
        self.bytes = rest;
        Ok(bytes)
    }

    /// Fills `sums` with the next values.
    ///
    /// # Errors
    /// Returns [`CheckpointMismatch`] if fewer are left.
    pub fn read_sums(&mut self, sums: &mut [[f64; 3]]) -> Result<(), CheckpointMismatch> {
        let target: &mut [u8] = bytemuck::cast_slice_mut(sums);
        target.copy_from_slice(self.read_bytes(target.len() as u64)?);
        Ok(())
    }

    /// Finishes reading the state.
    ///
    /// # Errors
    /// Returns [`CheckpointMismatch`] if bytes are left.
    pub fn finish(self) -> Result<(), CheckpointMismatch> {
        if self.bytes.is_empty() {
            Ok(())
        } else {
            Err(CheckpointMismatch)
        }
    }
}

impl Film {
    /// Writes the size, the number of samples and the sums.
    ///
    /// # Errors
    /// Returns any error of the writer.
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        write_u64s(
            to,
            [u64::from(self.width), u64::from(self.height), self.samples],
        )?;
        write_sums(to, &self.sum)?;
        write_sums(to, &self.sum2)
    }

    /// Reads the sums of a film of the same size.
    ///
    /// # Errors
    /// Returns [`CheckpointMismatch`] if the sizes differ or bytes are missing; the contents of
    /// this film are then undefined.
    pub fn restore(&mut self, from: &mut StateReader<'_>) -> Result<(), CheckpointMismatch> {
        if [from.read_u64()?, from.read_u64()?] != [u64::from(self.width), u64::from(self.height)] {
            return Err(CheckpointMismatch);
        }
        self.samples = from.read_u64()?;
        from.read_sums(&mut self.sum)?;
        from.read_sums(&mut self.sum2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn film() -> Film {
        let mut film = Film::new(3, 2);
        film.samples = 7;
        for (i, (sum, sum2)) in film.sum.iter_mut().zip(&mut film.sum2).enumerate() {
            *sum = [i as f64 / 3.0, -0.0, f64::MIN_POSITIVE];
            *sum2 = [i as f64, f64::MAX, 1e-300];
        }
        film
    }

    #[test]
    fn a_restored_film_has_the_same_bits() {
        let mut bytes = Vec::new();
        film().save(&mut bytes).unwrap();
        let mut back = Film::new(3, 2);
        let mut saved = StateReader::new(&bytes);
        back.restore(&mut saved).unwrap();
        saved.finish().unwrap();
        assert_eq!(back, film());
        assert!(back.sum[0][1].is_sign_negative());
    }

    #[test]
    fn a_truncated_or_overlong_state_or_one_of_another_size_is_a_mismatch() {
        let mut bytes = Vec::new();
        film().save(&mut bytes).unwrap();
        for cut in [0, 8, 24, bytes.len() - 1] {
            assert_eq!(
                Film::new(3, 2).restore(&mut StateReader::new(&bytes[..cut])),
                Err(CheckpointMismatch)
            );
        }
        assert_eq!(
            Film::new(2, 3).restore(&mut StateReader::new(&bytes)),
            Err(CheckpointMismatch)
        );
        bytes.push(0);
        let mut saved = StateReader::new(&bytes);
        Film::new(3, 2).restore(&mut saved).unwrap();
        assert_eq!(saved.finish(), Err(CheckpointMismatch));
    }
}
