//! The time to read a file grows with its size and no faster: files of many small parts, of every
//! format.

use std::time::Duration;

use lumbre_light::scene::compile;
use lumbre_light::scene::desc::content_hash;
use lumbre_lua::scene;
use lumbre_night::experiment::processor_time::thread_time;
use lumbre_scene_io::load::MissingTextures;

use super::Folder;
use super::growth_files::KINDS;

/// Factor between the numbers of parts of the two files that are compared.
const FACTOR: usize = 8;

/// Greatest ratio of their times. A time that grows with the square of the size has the ratio 64.
const MAX_RATIO: u32 = 32;

/// Time below which a file is too fast to tell how its time grows.
const LEAST: Duration = Duration::from_millis(10);

/// Returns the processor time of reading and compiling the first file.
fn time(files: &[(&'static str, String)]) -> Duration {
    let folder = Folder::new(files);
    let path = folder.path(files[0].0);
    let start = thread_time().unwrap();
    let (desc, notes) = scene::read(&path, &Default::default(), MissingTextures::Note).unwrap();
    let (_, more) = compile(&desc).unwrap();
    assert!(
        notes.len() + more.len() < 250,
        "{} notes",
        notes.len() + more.len()
    );
    content_hash(&desc);
    thread_time().unwrap() - start
}

#[test]
fn the_time_to_read_a_file_grows_with_its_size_and_no_faster() {
    for (name, files) in KINDS {
        let n = 2000;
        let [small, large] = [n, FACTOR * n].map(|n| time(&files(n)));
        assert!(
            large < MAX_RATIO * small.max(LEAST),
            "{name}: {n} parts take {small:?}, and {FACTOR} times as many {large:?}"
        );
    }
}
