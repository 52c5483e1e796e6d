//! Notes about parts of scene files that a scene does not represent as the file says.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// A part of a scene file that was ignored, or interpreted differently than the file specifies.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Note {
    /// File that the note refers to; empty if the note concerns a whole scene of any origin.
    pub file: PathBuf,
    /// Location in the file: a key path such as `materials[2].displacementtexture`, or a line.
    pub place: String,
    /// Description of the problem and of what was done instead.
    pub message: String,
}

impl Note {
    /// Creates a note on a place in a file; an empty file stands for none.
    pub fn new(
        file: impl Into<PathBuf>,
        place: impl Into<String>,
        message: impl Into<String>,
    ) -> Note {
        Note {
            file: file.into(),
            place: place.into(),
            message: message.into(),
        }
    }
}

impl std::fmt::Display for Note {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.file.as_os_str().is_empty() {
            return write!(f, "{}: {}", self.place, self.message);
        }
        write!(
            f,
            "{}: {}: {}",
            self.file.display(),
            self.place,
            self.message
        )
    }
}

/// Greatest number of places that a note on several of one file names.
const MAX_PLACES: usize = 5;

/// Greatest number of notes that are kept in all.
const MAX_NOTES: usize = 100;

/// Shortens a list of notes, in which a file may repeat one message for each of its objects: notes of
/// one message become one, with the first five places by name and the number of others, and of all
/// notes the first hundred are kept and the others counted.
pub fn summed_up(notes: Vec<Note>) -> Vec<Note> {
    let mut known: BTreeMap<(PathBuf, String), (usize, usize)> = BTreeMap::new();
    let mut kept: Vec<Note> = Vec::new();
    for note in notes {
        let key = (note.file.clone(), note.message.clone());
        let (index, places) = known.entry(key).or_insert((kept.len(), 0));
        *places += 1;
        if *places == 1 {
            kept.push(note);
        } else if *places <= MAX_PLACES {
            kept[*index].place += &format!(", {}", note.place);
        }
    }
    for (index, places) in known.into_values() {
        if places > MAX_PLACES {
            kept[index].place += &format!(" and {} more places", places - MAX_PLACES);
        }
    }
    let left_out = kept.len().saturating_sub(MAX_NOTES);
    kept.truncate(MAX_NOTES);
    if left_out > 0 {
        kept.push(Note::new(
            "",
            "notes",
            format!("and {left_out} more with other messages"),
        ));
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn note(place: usize, message: &str) -> Note {
        Note::new(PathBuf::from("a.xml"), format!("line {place}"), message)
    }

    #[test]
    fn a_few_notes_stay_as_they_are() {
        let notes: Vec<Note> = (0..5).map(|i| note(i, &format!("m{i}"))).collect();
        assert_eq!(summed_up(notes.clone()), notes);
    }

    #[test]
    fn equal_messages_are_counted() {
        let mut notes: Vec<Note> = (0..20_000).map(|i| note(i, "ignored")).collect();
        notes.push(note(7, "no light"));
        let kept = summed_up(notes);
        assert_eq!(kept.len(), 2);
        assert_eq!(kept[1], note(7, "no light"));
        assert_eq!(
            kept[0].to_string(),
            "a.xml: line 0, line 1, line 2, line 3, line 4 and 19995 more places: ignored"
        );
    }

    #[test]
    fn different_messages_are_counted_beyond_a_hundred() {
        let kept = summed_up((0..250).map(|i| note(i, &format!("m{i}"))).collect());
        assert_eq!(kept.len(), 101);
        assert_eq!(
            kept[100].to_string(),
            "notes: and 150 more with other messages"
        );
    }
}
