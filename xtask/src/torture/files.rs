//! Scenes and pictures of every format, changed and read.

use std::sync::OnceLock;

use super::night::Site;
use super::worst_files::is_picture;
use super::worst_files::samples::{Sample, samples};
use super::{EXTENT, Random, Verdict, mutation};

/// Bytes of memory that the program may take to read small files: what the page about hostile files
/// promises, and what the program takes for itself.
const MEMORY: u64 = (384 + 128) << 20;

/// Changes one file of a sample and reads it.
pub fn changed(site: &Site, random: &mut Random) -> Result<Verdict, String> {
    static SAMPLES: OnceLock<Vec<Sample>> = OnceLock::new();
    let sample = random.pick(SAMPLES.get_or_init(samples));
    let room = site.empty_room()?;
    let victim = random.below(sample.files.len());
    for (i, (name, bytes)) in sample.files.iter().enumerate() {
        let bytes = if i == victim {
            mutation::of_file(bytes, &EXTENT, random)
        } else {
            bytes.clone()
        };
        room.write(name, &bytes)?;
    }
    let (main, _) = sample.files[0];
    let verb: &[&str] = match is_picture(main) {
        true => &["metric", main, main],
        false => &["check", main],
    };
    let ended = room.run(verb)?;
    let name = sample.name;
    let problem = match ended.crash() {
        Some(crash) => crash,
        None if ended.memory > MEMORY => format!("it took {} MiB", ended.memory >> 20),
        None if ended.text.contains('\u{1b}') => "it printed a control character".to_owned(),
        None => {
            return Ok(match ended.code {
                Some(0) => Verdict::Harmless,
                _ => Verdict::Noticed,
            });
        }
    };
    Ok(Verdict::Failed(format!("{name}: {problem}")))
}
