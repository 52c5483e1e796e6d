//! Sums as bytes, so that a run that was cut off goes on from them to the same bits.
//!
//! Numbers keep the machine's own byte order; who stores them says which that is.

use std::io::{self, Write};

use super::Film;

/// Numbers that are gathered before they are written.
const CHUNK: usize = 8192;

/// Why bytes are no state of the sums that were to take them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the saved sums do not fit: they were made by another kind of run")]
pub struct Misfit;

/// Writes whole numbers one after another.
///
/// # Errors
/// As `to`.
pub fn write_words(to: &mut dyn Write, words: impl IntoIterator<Item = u64>) -> io::Result<()> {
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
/// As `to`.
pub fn write_sums(to: &mut dyn Write, sums: &[[f64; 3]]) -> io::Result<()> {
    to.write_all(bytemuck::cast_slice(sums))
}

/// What is left to read of a saved state.
#[derive(Debug)]
pub struct Saved<'a> {
    bytes: &'a [u8],
}

impl<'a> Saved<'a> {
    /// A state from its beginning.
    pub fn new(bytes: &'a [u8]) -> Saved<'a> {
        Saved { bytes }
    }

    /// The next whole number.
    ///
    /// # Errors
    /// When nothing is left.
    pub fn word(&mut self) -> Result<u64, Misfit> {
        let (word, rest) = self.bytes.split_first_chunk().ok_or(Misfit)?;
        self.bytes = rest;
        Ok(u64::from_ne_bytes(*word))
    }

    /// The next so many bytes.
    ///
    /// # Errors
    /// When fewer are left.
    pub fn bytes(&mut self, length: u64) -> Result<&'a [u8], Misfit> {
        let length = usize::try_from(length).map_err(|_| Misfit)?;
        let (bytes, rest) = self.bytes.split_at_checked(length).ok_or(Misfit)?;
        self.bytes = rest;
        Ok(bytes)
    }

    /// Fills `sums` with the next ones.
    ///
    /// # Errors
    /// When fewer are left.
    pub fn sums(&mut self, sums: &mut [[f64; 3]]) -> Result<(), Misfit> {
        let target: &mut [u8] = bytemuck::cast_slice_mut(sums);
        target.copy_from_slice(self.bytes(target.len() as u64)?);
        Ok(())
    }

    /// Ends the reading.
    ///
    /// # Errors
    /// When something is left.
    pub fn end(self) -> Result<(), Misfit> {
        if self.bytes.is_empty() { Ok(()) } else { Err(Misfit) }
    }
}

impl Film {
    /// Writes size and sums.
    ///
    /// # Errors
    /// As `to`.
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        write_words(to, [u64::from(self.width), u64::from(self.height), self.samples])?;
        write_sums(to, &self.sum)?;
        write_sums(to, &self.sum2)
    }

    /// Takes the sums of a film of the same size.
    ///
    /// # Errors
    /// When they are not; this film is then worthless.
    pub fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Misfit> {
        if [from.word()?, from.word()?] != [u64::from(self.width), u64::from(self.height)] {
            return Err(Misfit);
        }
        self.samples = from.word()?;
        from.sums(&mut self.sum)?;
        from.sums(&mut self.sum2)
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
    fn a_film_comes_back_to_the_bit() {
        let mut bytes = Vec::new();
        film().save(&mut bytes).unwrap();
        let mut back = Film::new(3, 2);
        let mut saved = Saved::new(&bytes);
        back.restore(&mut saved).unwrap();
        saved.end().unwrap();
        assert_eq!(back, film());
        assert!(back.sum[0][1].is_sign_negative());
    }

    #[test]
    fn what_is_cut_off_too_long_or_of_another_size_does_not_fit() {
        let mut bytes = Vec::new();
        film().save(&mut bytes).unwrap();
        for cut in [0, 8, 24, bytes.len() - 1] {
            assert_eq!(Film::new(3, 2).restore(&mut Saved::new(&bytes[..cut])), Err(Misfit));
        }
        assert_eq!(Film::new(2, 3).restore(&mut Saved::new(&bytes)), Err(Misfit));
        bytes.push(0);
        let mut saved = Saved::new(&bytes);
        Film::new(3, 2).restore(&mut saved).unwrap();
        assert_eq!(saved.end(), Err(Misfit));
    }
}
