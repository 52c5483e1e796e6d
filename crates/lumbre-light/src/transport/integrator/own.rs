//! Techniques of one's own: integrators of another crate, registered before anything else runs.

use std::sync::OnceLock;

use super::IntegratorRow;

/// Greatest length of the name of a registered integrator.
const MAX_NAME: usize = 40;

/// The registered integrators of this process.
pub(super) static OWN: OnceLock<Vec<Registered>> = OnceLock::new();

/// An integrator to register.
#[derive(Clone, Debug)]
pub struct Registered {
    /// Its table entry.
    pub row: IntegratorRow,
    /// Hash of the shared library that computes its samples, if one does; part of the identity of
    /// runs.
    pub library: Option<String>,
}

/// Error of a registration.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RegistrationError {
    /// The name has other characters, or is too long.
    #[error(
        "`{0}` cannot be the name of a technique: use a lower-case letter, then lower-case letters, \
         digits and `_`, at most {MAX_NAME} in all"
    )]
    InvalidName(String),
    /// The name is taken.
    #[error("there are two techniques `{0}`: give yours another name")]
    TakenName(String),
    /// The technique is biased, and its long name does not say so.
    #[error(
        "the long name of `{0}`, which tables and figures show, has to end in `biased`, since its row \
         states a bias"
    )]
    HiddenBias(String),
    /// Techniques were registered or looked up before.
    #[error("techniques are registered once, before anything else")]
    TooLate,
}

/// Returns the registered integrators. Afterwards none can be registered.
pub fn rows() -> impl Iterator<Item = &'static IntegratorRow> + Clone {
    OWN.get_or_init(Vec::new).iter().map(|own| &own.row)
}

/// Returns the hash of the shared library that computes the samples of an integrator, if one does.
pub fn library(row: &IntegratorRow) -> Option<&'static str> {
    let mut all = OWN.get_or_init(Vec::new).iter();
    all.find(|own| own.row.name == row.name)?.library.as_deref()
}

/// Returns whether text can be the name of a registered integrator, which is part of the names of
/// files and columns.
pub fn is_valid_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    name.len() <= MAX_NAME
        && name.starts_with(|c: char| c.is_ascii_lowercase())
        && name.chars().all(plain)
}
