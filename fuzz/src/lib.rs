//! What the targets share: a folder in which one file is replaced by what the fuzzer makes, and the limit on memory.

#![allow(clippy::expect_used, clippy::print_stderr, reason = "a target that cannot begin has nobody to tell")]

#[path = "../../tests/scenes/meter.rs"]
mod meter;
#[path = "../../tests/scenes/samples.rs"]
pub mod samples;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use lumbre::film::time::TimeAxis;
use lumbre::render::{self, Job, Renderer};
use lumbre::scene::load::{self, Missing};
use lumbre::scene::{CompiledScene, compile};
use lumbre::script::scene;
use lumbre::store::rows;
use lumbre::transport::flight::Timing;
use lumbre::transport::integrator::integrator;
use lumbre::transport::sampler::SOBOL;

#[global_allocator]
static METER: meter::Meter = meter::Meter;

/// Bytes that reading may take whatever the size of the files. Less than the 384 MiB of `tests/scenes/hostile.rs`, which has room
/// for what many pictures make: here one file of one small sample is another, and pictures have their room below.
const SMALL: usize = 96 << 20;
/// How many times the size of the files reading may take beside that.
const GROWTH: usize = 8192;

/// The folder of one target.
struct Place {
    folder: tempfile::TempDir,
    /// The file that is read.
    main: PathBuf,
    /// Bytes of all files but the replaced one.
    beside: usize,
}

static PLACE: OnceLock<Place> = OnceLock::new();

fn place(sample: &str, replaced: &str) -> &'static Place {
    PLACE.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let sample = samples::samples().into_iter().find(|s| s.name == sample).expect("a sample of this name");
        let main = folder.path().join(sample.files[0].0);
        let mut beside = 0;
        for (name, bytes) in &sample.files {
            write(folder.path(), name, bytes);
            beside += if *name == replaced { 0 } else { bytes.len() };
        }
        Place { folder, main, beside }
    })
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("a name in a folder")).expect("a folder that can be written");
    fs::write(path, bytes).expect("a folder that can be written");
}

/// Runs what must neither panic nor take more memory than the files justify.
fn within(bytes: usize, run: impl FnOnce()) {
    let limit = SMALL + GROWTH * bytes;
    let ((), most) = meter::peak(run);
    assert!(most <= limit, "{most} bytes taken for {bytes}: the limit is {limit}");
}

/// Reads and compiles the scene of a sample with one of its files replaced.
pub fn scene(sample: &str, replaced: &str, bytes: &[u8]) {
    let place = place(sample, replaced);
    write(place.folder.path(), replaced, bytes);
    within(place.beside + bytes.len(), || match scene::read(&place.main, &Default::default(), Missing::Noted) {
        Ok((desc, _)) => drop(compile(&desc)),
        Err(e) => assert!(e.to_string().len() < 20_000, "errors are short"),
    });
}

/// Reads a texture.
pub fn texture(bytes: &[u8]) {
    let place = place("tga", "a.tga");
    write(place.folder.path(), "a.tga", bytes);
    within(bytes.len(), || drop(load::texture(&place.main, &mut Vec::new())));
}

/// A scene that renderers of checkpoints have, and a state of each technique that fits.
struct States {
    scene: Arc<CompiledScene>,
    fitting: [Vec<u8>; 2],
}

static STATES: OnceLock<States> = OnceLock::new();

fn renderer(scene: &Arc<CompiledScene>, technique: usize) -> Box<dyn Renderer> {
    let timing = Timing::plain(TimeAxis { start: 2.0, bin: 0.5, bins: 5 });
    let integrator = integrator(["bdpt", "nee"][technique]).expect("an integrator of this name");
    let job = Job { timing: Some(timing), sampler: SOBOL, threads: 1, ..Job::plain(integrator, [4, 3], 4, 7) };
    render::open("cpu", scene.clone(), job).expect("a job that is possible")
}

fn saved(renderer: &dyn Renderer) -> Vec<u8> {
    let mut state = Vec::new();
    renderer.save(&mut state).expect("a vector can be written");
    state
}

/// Hands a renderer with a time axis what a checkpoint holds; whatever it takes, it writes again. The first byte chooses
/// the technique, and the second where a state that fits is overwritten by the rest; 0 is nowhere, and the rest is all.
pub fn checkpoint(bytes: &[u8]) {
    let [technique, at, rest @ ..] = bytes else { return };
    let technique = usize::from(technique % 2);
    let states = STATES.get_or_init(|| {
        let (desc, _) = scene::read(&place("scn", "").main, &Default::default(), Missing::Refused).expect("a sample");
        let scene = Arc::new(compile(&desc).expect("a sample").0);
        let fitting = [0, 1].map(|technique| {
            let mut renderer = renderer(&scene, technique);
            renderer.advance(2).expect("a scene that can be rendered");
            saved(renderer.as_ref())
        });
        States { scene, fitting }
    });
    let state = match usize::from(*at) {
        0 => rest.to_vec(),
        at => {
            let mut state = states.fitting[technique].clone();
            state.iter_mut().skip(8 * at).zip(rest).for_each(|(to, from)| *to = *from);
            state
        }
    };
    let mut taker = renderer(&states.scene, technique);
    let mut fits = false;
    within(state.len(), || fits = taker.restore(&state).is_ok());
    if fits {
        renderer(&states.scene, technique).restore(&saved(taker.as_ref())).expect("what was saved fits");
        let _ = (taker.film(), taker.times());
    }
}

/// Reads the rows of a `metrics.csv`, and writes and reads them again.
pub fn rows(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let _ = rows::parse_more(&text);
    let Ok((columns, read)) = rows::parse(&text) else { return };
    let mut again = rows::header(columns.iter().map(String::as_str));
    read.iter().for_each(|row| again.push_str(&rows::line(row)));
    let (_, twice) = rows::parse(&again).expect("what was written can be read");
    assert_eq!(format!("{read:?}"), format!("{twice:?}"));
}
