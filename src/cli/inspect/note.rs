//! `lumbre note`: notes on a night.

use std::time::SystemTime;

use crate::cli::args::{Global, NoteArgs};
use crate::cli::exit::{Exit, Failure, print_result};
use crate::cli::selector;
use lumbre_night::store::schema::plan::{NightNote, NotesFile};
use lumbre_night::store::{NightReader, StoredFile, utc};
use lumbre_night::text::is_line;

/// Runs `lumbre note`: adds a note to a night, or prints those that it has.
pub fn main(args: &NoteArgs, global: &Global) -> Result<Exit, Failure> {
    let folder = selector::night(Some(&args.night), &global.out)?;
    let files = NightReader::open(&folder).map_err(Failure::usage)?;
    let mut file = match NotesFile::read(&folder) {
        Ok(file) => file,
        Err(error) if error.is_missing() => NotesFile::default(),
        Err(error) => return Err(Failure::usage(error)),
    };
    let Some(text) = &args.text else {
        let script = files.plan().report.iter().flat_map(|report| &report.notes);
        let lines = script
            .cloned()
            .chain(file.notes.iter().map(NightNote::line));
        let lines: Vec<String> = lines.map(|line| line + "\n").collect();
        print_result(&lines.concat())?;
        return Ok(Exit::Done);
    };
    if !is_line(text) {
        return Err(Failure::usage("a note is a line of text".to_owned()));
    }
    file.notes.push(NightNote {
        date: utc(SystemTime::now()),
        text: text.clone(),
    });
    file.write(&folder).map_err(Failure::internal)?;
    Ok(Exit::Done)
}
