//! The version of a file.

/// Version of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::load) enum Version {
    V3,
    V4,
}

/// Beginnings of lines that only version 3 has.
const VERSION_3: [&str; 12] = [
    "WorldEnd",
    "Film \"image\"",
    "Material \"matte\"",
    "Material \"plastic\"",
    "Material \"metal\"",
    "Material \"glass\"",
    "Material \"mirror\"",
    "Material \"uber\"",
    "Material \"substrate\"",
    "Material \"translucent\"",
    "Material \"disney\"",
    "Material \"kdsubsurface\"",
];

impl Version {
    /// Returns the version of a file by its directives.
    pub(super) fn of(text: &str) -> Version {
        let is_old = |line: &str| {
            let line = line.trim_start();
            VERSION_3.iter().any(|start| line.starts_with(start))
        };
        if text.lines().any(is_old) {
            Version::V3
        } else {
            Version::V4
        }
    }
}
