//! Films that program and worker both see, in a file that is memory.
//!
//! A film of 1280x720 pixels is 44 MB after every wave. Through the pipe it would be copied six times and hashed twice while the
//! device waits for its next wave; here the worker writes it and the program reads it. Where there is no such file, it is too
//! small, or the worker does not find it, films go through the pipe as everything else does.
//!
//! They have no checksum: what no process checks of its own memory is not checked here either, and a hash of so much would take
//! longer than writing it. That a film is whole is what the answer says that follows it through the pipe, which has one.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::film::Film;

/// Bytes that are read at once.
const PART: usize = 1 << 20;

/// The folder whose files are memory, where the system has one.
pub fn folder() -> Option<PathBuf> {
    let folder = Path::new("/dev/shm");
    (cfg!(target_os = "linux") && folder.is_dir()).then(|| folder.to_owned())
}

/// The sums of a film, then its sums of squares, in a file without a name: it is gone once both processes have closed it.
#[derive(Debug)]
pub struct SharedFilm(File);

impl SharedFilm {
    /// An empty one.
    ///
    /// # Errors
    /// When no file can be made in this folder.
    pub fn new(folder: &Path) -> io::Result<SharedFilm> {
        tempfile::tempfile_in(folder).map(SharedFilm)
    }

    /// Where another process finds it while this one keeps it.
    pub fn name(&self) -> String {
        #[cfg(unix)]
        let descriptor = std::os::fd::AsRawFd::as_raw_fd(&self.0);
        #[cfg(not(unix))]
        let descriptor = "none";
        format!("/proc/{}/fd/{descriptor}", std::process::id())
    }

    /// That of another process.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(name: &str) -> io::Result<SharedFilm> {
        File::options().write(true).open(name).map(SharedFilm)
    }

    /// Leaves a film's sums for the other side.
    ///
    /// # Errors
    /// When there is no room.
    pub fn put(&self, film: &Film) -> io::Result<()> {
        let sum: &[u8] = bytemuck::cast_slice(&film.sum);
        write_at(&self.0, sum, 0)?;
        write_at(&self.0, bytemuck::cast_slice(&film.sum2), sum.len() as u64)
    }

    /// Takes the sums that the other side has left, of a film of this size.
    ///
    /// # Errors
    /// When there are fewer.
    pub fn take(&self, film: &mut Film) -> io::Result<()> {
        let sum: &mut [u8] = bytemuck::cast_slice_mut(&mut film.sum);
        let length = sum.len();
        let sum2: &mut [u8] = bytemuck::cast_slice_mut(&mut film.sum2);
        [(sum, 0), (sum2, length)].into_par_iter().try_for_each(|(bytes, start)| {
            let parts = bytes.par_chunks_mut(PART).enumerate();
            parts.try_for_each(|(i, part)| read_at(&self.0, part, (start + i * PART) as u64))
        })
    }
}

#[cfg(unix)]
use std::os::unix::fs::FileExt;

#[cfg(unix)]
fn write_at(file: &File, bytes: &[u8], at: u64) -> io::Result<()> {
    file.write_all_at(bytes, at)
}

#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], at: u64) -> io::Result<()> {
    file.read_exact_at(bytes, at)
}

#[cfg(not(unix))]
fn write_at(_: &File, _: &[u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(not(unix))]
fn read_at(_: &File, _: &mut [u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn a_film_arrives_as_it_was_left_and_one_of_another_size_is_no_film() {
        let dir = tempfile::tempdir().unwrap();
        let here = SharedFilm::new(dir.path()).unwrap();
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0, "nothing is left where a process is killed");
        let there = SharedFilm::open(&here.name()).unwrap();
        let mut film = Film::new(300, 200);
        for (i, (sum, sum2)) in film.sum.iter_mut().zip(&mut film.sum2).enumerate() {
            (*sum, *sum2) = ([i as f64, -0.0, f64::NAN], [0.5, i as f64, 3.0]);
        }
        there.put(&film).unwrap();
        let mut taken = Film::new(300, 200);
        here.take(&mut taken).unwrap();
        let bits = |film: &Film| [&film.sum, &film.sum2].map(|sums| bytemuck::cast_slice::<_, u64>(sums).to_vec());
        assert!(bits(&taken) == bits(&film));
        assert!(here.take(&mut Film::new(301, 200)).is_err());
    }
}
