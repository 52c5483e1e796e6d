//! Techniques of one's own: integrators of another crate, with the way in which the CPU renders many
//! of their samples at a time.

use std::sync::OnceLock;

use crate::cpu::wavefront::TileMethod;
use crate::plugin::Plugin;
use lumbre_light::transport::integrator::camera_path::CameraPaths;
use lumbre_light::transport::integrator::own::{Registered, RegistrationError};
use lumbre_light::transport::integrator::{self, IntegratorRow, camera_path};

/// The registered techniques of this process.
static OWN: OnceLock<Vec<OwnTechnique>> = OnceLock::new();

/// A technique of one's own, which [`register`] makes known.
#[derive(Clone, Copy)]
pub struct OwnTechnique {
    row: IntegratorRow,
    tiles: Option<TileMethod>,
}

impl OwnTechnique {
    /// Creates a technique that follows paths from the camera. The CPU renders many of its samples
    /// at a time where it has vector instructions, and single ones elsewhere, with the same bits.
    /// [`IntegratorRow::sample`] of the row is not used.
    pub const fn camera_paths<T: CameraPaths>(row: IntegratorRow) -> OwnTechnique {
        OwnTechnique {
            row: IntegratorRow {
                sample: camera_path::sample::<T>,
                ..row
            },
            tiles: Some(TileMethod::camera_paths::<T>()),
        }
    }

    /// Creates a technique whose samples are computed one by one, by [`IntegratorRow::sample`].
    pub const fn single_samples(row: IntegratorRow) -> OwnTechnique {
        OwnTechnique { row, tiles: None }
    }

    /// Returns the table entry of the technique.
    pub const fn row(&self) -> &IntegratorRow {
        &self.row
    }
}

/// Makes techniques known to this process, and those of shared libraries: they can be looked up as
/// built-in ones are. Must be called at most once, before anything else of this crate and of
/// `lumbre-light`.
///
/// # Errors
/// Returns an error, and registers nothing, if a name is invalid or taken, or on a later call.
pub fn register(techniques: &[OwnTechnique], plugins: &[Plugin]) -> Result<(), RegistrationError> {
    let own = techniques.iter().map(|technique| Registered {
        row: technique.row,
        library: None,
    });
    let of_libraries = plugins.iter().map(|plugin| Registered {
        row: plugin.row,
        library: Some(plugin.hash.clone()),
    });
    integrator::register(own.chain(of_libraries).collect())?;
    OWN.set(techniques.to_vec())
        .map_err(|_| RegistrationError::TooLate)
}

/// Returns the method of rendering tiles of a registered technique; `None` for any other, and for one
/// whose samples are computed one by one.
pub(crate) fn tile_method(row: &IntegratorRow) -> Option<TileMethod> {
    let mut techniques = OWN.get()?.iter();
    techniques.find(|own| own.row.name == row.name)?.tiles
}
