//! Two settings side by side: which of them the panel edits, and what both share.

use super::parameters::SEED;
use super::session::Slot;
use super::settings::Settings;
use lumbre_light::value::Value;

/// Arrangement of the two pictures of a comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Arrangement {
    /// Both at once, A on the left.
    #[default]
    SideBySide,
    /// Both in turn, each in the whole pane.
    Flicker,
}

impl Arrangement {
    /// Returns the arrangement after this one.
    pub fn next(self) -> Arrangement {
        match self {
            Arrangement::SideBySide => Arrangement::Flicker,
            Arrangement::Flicker => Arrangement::SideBySide,
        }
    }
}

/// Display time in seconds of each of the two pictures that flicker.
pub const FLICKER_S: f64 = 0.6;

/// A comparison of two settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Settings of the side that the panel does not edit.
    pub other: Settings,
    /// Arrangement of the pictures.
    pub arrangement: Arrangement,
    /// Side that is visible while the pictures flicker.
    pub visible: Slot,
}

/// Paths that both sides share, since pictures of different views cannot be compared.
const SHARED: [&str; 3] = ["camera.position", "camera.target", "camera.up"];

impl Comparison {
    /// Starts a comparison with the present settings on the other side. Returns the settings of the
    /// side that is edited from now on: the same with another seed, so that the noise of both
    /// pictures is independent.
    pub fn begin(present: Settings, visible: Slot) -> (Comparison, Settings) {
        let mut edited = present.clone();
        edited.put(SEED, Some(seed_value(present.seed() + 1)));
        let comparison = Comparison {
            other: present,
            arrangement: Arrangement::default(),
            visible,
        };
        (comparison, edited)
    }

    /// Gives the other side the view of the edited one. Returns whether that changed it.
    pub fn share_view(&mut self, edited: &Settings) -> bool {
        let before = self.other.clone();
        if self.other.get("view") != edited.get("view") {
            self.other.put("view", edited.get("view").cloned());
        }
        for path in SHARED {
            self.other.put(path, edited.get(path).cloned());
        }
        self.other != before
    }
}

/// Returns a seed as a value.
pub fn seed_value(seed: u64) -> Value {
    Value::Int(i64::try_from(seed).unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sides_differ_in_the_seed_and_share_the_view() {
        let mut present = Settings::new(&[("seed".to_owned(), Value::Int(4))]);
        present.put("camera.aperture", Some(Value::Num(0.1)));
        let (mut comparison, mut edited) = Comparison::begin(present.clone(), Slot::B);
        assert_eq!((comparison.other.seed(), edited.seed()), (4, 5));
        assert!(!comparison.share_view(&edited));
        edited.put("camera.aperture", Some(Value::Num(0.3)));
        edited.put("camera.position", Some(Value::List(vec![Value::Int(1); 3])));
        assert!(comparison.share_view(&edited));
        assert_eq!(
            comparison.other.get("camera.aperture"),
            present.get("camera.aperture")
        );
        assert_eq!(
            comparison.other.get("camera.position"),
            edited.get("camera.position")
        );
        edited.put("view", Some("side".into()));
        assert!(comparison.share_view(&edited));
        assert_eq!(comparison.other.get("camera.position"), None);
        for view in [Some("side"), Some("top"), None] {
            edited.put("view", view.map(Value::from));
            comparison.share_view(&edited);
            assert_eq!(comparison.other.get("view"), edited.get("view"));
        }
    }
}
