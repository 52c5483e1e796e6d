//! Films in memory shared by a process and its worker, as a file in a memory file system.
//!
//! A film of 1280x720 pixels is 44 MB after every wave. Through the pipe it would be copied six
//! times and hashed twice while the device waits for its next wave; with shared memory the worker
//! writes it and the parent reads it. If there is no such file system, it is full, or the worker
//! cannot open the file, films go through the pipe like everything else.
//!
//! Shared films have no checksum: memory of a process is not checked otherwise either, and hashing
//! a film would take longer than writing it. The reply that follows through the pipe, which has a
//! checksum, confirms that the film is complete.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use lumbre_light::film::Film;

/// Number of bytes that are read at once by one thread.
const CHUNK: usize = 1 << 20;

/// Returns the folder whose files are memory, if the system has one.
pub fn folder() -> Option<PathBuf> {
    let folder = Path::new("/dev/shm");
    (cfg!(target_os = "linux") && folder.is_dir()).then(|| folder.to_owned())
}

/// Sums and then sums of squares of a film, in an unnamed file that vanishes once both processes
/// have closed it.
#[derive(Debug)]
pub struct SharedFilm(File);

impl SharedFilm {
    /// Creates an empty shared film.
    ///
    /// # Errors
    /// Returns an error if no file can be created in this folder.
    pub fn new(folder: &Path) -> io::Result<SharedFilm> {
        tempfile::tempfile_in(folder).map(SharedFilm)
    }

    /// Returns the path at which another process can open it while this one holds it.
    pub fn name(&self) -> String {
        #[cfg(unix)]
        let descriptor = std::os::fd::AsRawFd::as_raw_fd(&self.0);
        #[cfg(not(unix))]
        let descriptor = "none";
        format!("/proc/{}/fd/{descriptor}", std::process::id())
    }

    /// Opens the shared film of another process.
    ///
    /// # Errors
    /// Returns an error if it cannot be opened.
    pub fn open(name: &str) -> io::Result<SharedFilm> {
        File::options().write(true).open(name).map(SharedFilm)
    }

    /// Writes a film's sums for the other process.
    ///
    /// # Errors
    /// Returns an error if there is no space left.
    pub fn write(&self, film: &Film) -> io::Result<()> {
        let sum: &[u8] = bytemuck::cast_slice(&film.sum);
        write_at(&self.0, sum, 0)?;
        write_at(&self.0, bytemuck::cast_slice(&film.sum2), sum.len() as u64)
    }

    /// Reads the sums that the other process wrote into a film of the same size.
    ///
    /// # Errors
    /// Returns an error if there are fewer.
    pub fn read(&self, film: &mut Film) -> io::Result<()> {
        let sum: &mut [u8] = bytemuck::cast_slice_mut(&mut film.sum);
        let length = sum.len();
        let sum2: &mut [u8] = bytemuck::cast_slice_mut(&mut film.sum2);
        [(sum, 0), (sum2, length)]
            .into_par_iter()
            .try_for_each(|(bytes, start)| {
                let chunks = bytes.par_chunks_mut(CHUNK).enumerate();
                chunks
                    .try_for_each(|(i, chunk)| read_at(&self.0, chunk, (start + i * CHUNK) as u64))
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
    fn a_film_arrives_with_the_same_bits_and_another_size_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let here = SharedFilm::new(dir.path()).unwrap();
        assert_eq!(
            std::fs::read_dir(dir.path()).unwrap().count(),
            0,
            "nothing remains if a process is killed"
        );
        let there = SharedFilm::open(&here.name()).unwrap();
        let mut film = Film::new(300, 200);
        for (i, (sum, sum2)) in film.sum.iter_mut().zip(&mut film.sum2).enumerate() {
            (*sum, *sum2) = ([i as f64, -0.0, f64::NAN], [0.5, i as f64, 3.0]);
        }
        there.write(&film).unwrap();
        let mut taken = Film::new(300, 200);
        here.read(&mut taken).unwrap();
        let bits = |film: &Film| {
            [&film.sum, &film.sum2].map(|sums| bytemuck::cast_slice::<_, u64>(sums).to_vec())
        };
        assert!(bits(&taken) == bits(&film));
        assert!(here.read(&mut Film::new(301, 200)).is_err());
    }
}
