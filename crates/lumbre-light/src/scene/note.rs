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

/// Greatest number of notes with the same message that are kept of one file.
const MAX_EQUAL: usize = 5;

/// Greatest number of notes that are kept in all.
const MAX_NOTES: usize = 100;

/// Shortens a list of notes, in which a file may repeat one message for each of its objects: of one
/// message the first five places are kept and the others counted, and of all notes the first
/// hundred are kept and the others counted.
pub fn summed_up(notes: Vec<Note>) -> Vec<Note> {
    let mut places: BTreeMap<(PathBuf, String), usize> = BTreeMap::new();
    let mut kept = Vec::new();
    for note in notes {
        let count = places
            .entry((note.file.clone(), note.message.clone()))
            .or_default();
        *count += 1;
        if *count <= MAX_EQUAL {
            kept.push(note);
        }
    }
    let left_out = kept.len().saturating_sub(MAX_NOTES);
    kept.truncate(MAX_NOTES);
    for ((file, message), count) in places {
        if count > MAX_EQUAL && kept.iter().any(|n| n.file == file && n.message == message) {
            kept.push(Note::new(
                file,
                format!("and {} more places", count - MAX_EQUAL),
                message,
            ));
        }
    }
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
        let notes: Vec<Note> = (0..5).map(|i| note(i, "ignored")).collect();
        assert_eq!(summed_up(notes.clone()), notes);
    }

    #[test]
    fn equal_messages_are_counted() {
        let mut notes: Vec<Note> = (0..20_000).map(|i| note(i, "ignored")).collect();
        notes.push(note(7, "no light"));
        let kept = summed_up(notes);
        assert_eq!(kept.len(), 7);
        assert_eq!(kept[5], note(7, "no light"));
        assert_eq!(kept[6].to_string(), "a.xml: and 19995 more places: ignored");
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
