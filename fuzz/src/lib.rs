//! Shared code of the fuzz targets: a sample folder in which one file is replaced by the fuzzer's
//! input, a limit on memory, and changes of valid inputs that keep most of their structure.

#![allow(
    clippy::expect_used,
    clippy::print_stderr,
    reason = "an error ends the target"
)]

#[path = "../../tests/library/scenes/meter.rs"]
mod meter;
#[path = "../../xtask/src/torture/mutation.rs"]
mod mutation;
#[path = "../../xtask/src/random.rs"]
mod random;
#[path = "../../tests/library/scenes/samples.rs"]
pub mod samples;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use lumbre_lua::scene;
use lumbre_night::store::write::metrics_csv;
use lumbre_light::film::time::TimeAxis;
use lumbre_light::scene::compile::SHARED_FROM;
use lumbre_light::scene::desc::{EntityDesc, SceneDesc, ShapeDesc};
use lumbre_scene_io::load::{self, MissingTextures};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::transport::sampler::SOBOL;
use lumbre_render::{Job, Renderer};
use mutation::Extent;
use random::Random;

#[global_allocator]
static METER: meter::Meter = meter::Meter;

/// Bytes of memory that reading may take for files of any size. Less than the 384 MiB of
/// `tests/library/scenes/hostile.rs`, which allows for many images: here only one file of a small sample is
/// replaced, and images are covered by [`GROWTH`].
const SMALL: usize = 96 << 20;
/// Additional bytes of memory that reading may take per byte of the files.
const GROWTH: usize = 8192;
/// Additional bytes of memory for each triangle of the scene, of at most [`SHARED_FROM`]: below
/// that number, entities of one mesh have copies of it.
const COPY: usize = 512;

/// Greatest number of accepted inputs that are kept to make further ones from.
const KEPT: usize = 256;
/// Extent of the changes of a text: one, since most results should be accepted, and small. Inputs that
/// were accepted are changed again, so that changes add up.
const EXTENT: Extent = Extent {
    changes: 1,
    copies: 4,
};
/// Part of the inputs in percent that should be accepted: while fewer are, none is made by changes of bytes.
/// More than half, for what earlier runs fell short of.
const GOAL: u64 = 55;
/// Number of inputs after which the part that was accepted is printed.
const INTERVAL: u64 = 1 << 12;

/// Inputs that a target accepted, and counts.
#[derive(Default)]
struct Accepted {
    kept: Vec<Vec<u8>>,
    accepted: u64,
    tried: u64,
}

static ACCEPTED: Mutex<Accepted> = Mutex::new(Accepted {
    kept: Vec::new(),
    accepted: 0,
    tried: 0,
});

/// Defines a target by a function of the input that returns whether it was accepted. Its inputs are
/// made by [`mutate`].
#[macro_export]
macro_rules! target {
    (|$bytes:ident| $read:expr) => {
        libfuzzer_sys::fuzz_target!(|$bytes: &[u8]| $crate::count($bytes, $read));
        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            $crate::mutate(data, size, max_size, seed)
        });
    };
}

/// Counts an input and keeps it if it was accepted.
pub fn count(bytes: &[u8], is_accepted: bool) {
    let mut all = ACCEPTED.lock().unwrap_or_else(PoisonError::into_inner);
    all.tried += 1;
    if is_accepted {
        all.accepted += 1;
        if all.kept.len() < KEPT {
            all.kept.push(bytes.to_vec());
        } else {
            // Every kept input is replaced in turn, so that structure drifts.
            let at = all.accepted as usize % KEPT;
            all.kept[at] = bytes.to_vec();
        }
    }
    if all.tried % INTERVAL == 0 {
        eprintln!("accepted: {} of {}", all.accepted, all.tried);
    }
}

/// Makes the next input in `data`, which has `size` bytes of another one, and returns its size. Most
/// are made from an input that was accepted, by changes of tokens, numbers and lines; the rest by
/// libFuzzer's changes of bytes, of which few are accepted.
pub fn mutate(data: &mut [u8], size: usize, max_size: usize, seed: u32) -> usize {
    let mut random = Random::new([seed, 0, 0]);
    let all = ACCEPTED.lock().unwrap_or_else(PoisonError::into_inner);
    let kept = &all.kept;
    let has_enough = 100 * all.accepted >= GOAL * all.tried;
    if kept.is_empty() || has_enough && random.below(8) == 0 {
        return libfuzzer_sys::fuzzer_mutate(data, size, max_size);
    }
    let from = match random.below(4) {
        0 => &data[..size],
        _ => random.pick(kept),
    };
    let made = mutation::of_file(from, &EXTENT, &mut random);
    let size = made.len().min(max_size);
    data[..size].copy_from_slice(&made[..size]);
    size
}

/// The sample folder of one target.
struct SampleFolder {
    directory: tempfile::TempDir,
    /// Path of the file that is read.
    main: PathBuf,
    /// Size of all files except the replaced one, in bytes.
    other_bytes: usize,
}

static SAMPLE_FOLDER: OnceLock<SampleFolder> = OnceLock::new();

fn sample_folder(sample: &str, replaced: &str) -> &'static SampleFolder {
    SAMPLE_FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a temporary folder can be created");
        let sample = samples::samples()
            .into_iter()
            .find(|s| s.name == sample)
            .expect("a sample has this name");
        let main = folder.path().join(sample.files[0].0);
        let mut other_bytes = 0;
        for (name, bytes) in &sample.files {
            write(folder.path(), name, bytes);
            other_bytes += if *name == replaced { 0 } else { bytes.len() };
        }
        SampleFolder {
            directory: folder,
            main,
            other_bytes,
        }
    })
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("the file lies in a folder"))
        .expect("the folder can be written");
    fs::write(path, bytes).expect("the folder can be written");
}

/// Runs a function and panics if it allocates more memory than the size of the files and the number of
/// triangles that it returns justify.
fn check_memory(bytes: usize, run: impl FnOnce() -> usize) {
    let (triangles, most) = meter::peak(run);
    let limit = SMALL + GROWTH * bytes + COPY * triangles.min(SHARED_FROM);
    assert!(
        most <= limit,
        "{most} bytes allocated for {bytes} bytes of input: the limit is {limit}"
    );
}

/// Reads and compiles the scene of a sample with one of its files replaced. Returns whether it was
/// read.
pub fn scene(sample: &str, replaced: &str, bytes: &[u8]) -> bool {
    let folder = sample_folder(sample, replaced);
    write(folder.directory.path(), replaced, bytes);
    let mut is_read = false;
    check_memory(folder.other_bytes + bytes.len(), || {
        match scene::read(&folder.main, &Default::default(), MissingTextures::Note) {
            Ok((desc, _)) => {
                is_read = true;
                drop(compile(&desc));
                triangles_of(&desc)
            }
            Err(e) => {
                assert!(
                    e.to_string().len() < 20_000,
                    "the error text is longer than 20,000 bytes"
                );
                0
            }
        }
    });
    is_read
}

/// Returns the number of triangles of all entities, also of scenes that are refused when compiled.
fn triangles_of(scene: &SceneDesc) -> usize {
    let triangles = |entity: &EntityDesc| match &entity.shape {
        ShapeDesc::Mesh(mesh) => mesh.triangles.len(),
        ShapeDesc::Sphere { .. } => 0,
    };
    scene.entities.iter().map(triangles).sum()
}

/// Reads a Mitsuba scene with a serialized mesh. The first byte is the mesh's version; the rest is what
/// its compressed stream expands to. Returns whether it was read.
pub fn serialized(bytes: &[u8]) -> bool {
    let [version, mesh @ ..] = bytes else {
        return false;
    };
    let file = samples::serialized(&[((*version).into(), mesh)]);
    scene("mitsuba, serialized", "m.serialized", &file)
}

/// Reads a texture file. Returns whether it was read.
pub fn texture(bytes: &[u8]) -> bool {
    let folder = sample_folder("tga", "a.tga");
    write(folder.directory.path(), "a.tga", bytes);
    let mut is_read = false;
    check_memory(bytes.len(), || {
        is_read = load::texture(&folder.main, &mut Vec::new()).is_ok();
        0
    });
    is_read
}

/// The scene of the checkpoint target, and a valid state of each technique.
struct States {
    scene: Arc<CompiledScene>,
    valid: [Vec<u8>; 2],
}

static STATES: OnceLock<States> = OnceLock::new();

fn renderer(scene: &Arc<CompiledScene>, technique: usize) -> Box<dyn Renderer> {
    let timing = Timing::plain(TimeAxis {
        start: 2.0,
        bin: 0.5,
        bins: 5,
    });
    let integrator = integrator(["bdpt", "nee"][technique]).expect("an integrator has this name");
    let job = Job {
        sampler: SOBOL,
        threads: 1,
        ..Job::plain(integrator, [4, 3], 4, 7)
    }
    .with(|settings| settings.timing = Some(timing));
    lumbre_night::backends::open("cpu", scene.clone(), job).expect("the job is valid")
}

fn save_state(renderer: &dyn Renderer) -> Vec<u8> {
    let mut state = Vec::new();
    renderer
        .save(&mut state)
        .expect("writing to a vector does not fail");
    state
}

/// Restores a renderer with a time axis from a checkpoint; if it accepts the state, saves it again.
/// The first byte selects the technique. The second is the offset, in units of 8 bytes, at which
/// the rest overwrites a valid state; 0 means that the rest is the complete state. Returns whether it
/// was restored.
pub fn checkpoint(bytes: &[u8]) -> bool {
    let [technique, at, rest @ ..] = bytes else {
        return false;
    };
    let technique = usize::from(technique % 2);
    let states = STATES.get_or_init(|| {
        let (desc, _) = scene::read(
            &sample_folder("scn", "").main,
            &Default::default(),
            MissingTextures::Fail,
        )
        .expect("the sample is valid");
        let scene = Arc::new(compile(&desc).expect("the sample compiles").0);
        let valid = [0, 1].map(|technique| {
            let mut renderer = renderer(&scene, technique);
            renderer.advance(2).expect("the scene can be rendered");
            save_state(renderer.as_ref())
        });
        States { scene, valid }
    });
    let state = match usize::from(*at) {
        0 => rest.to_vec(),
        at => {
            let mut state = states.valid[technique].clone();
            state
                .iter_mut()
                .skip(8 * at)
                .zip(rest)
                .for_each(|(to, from)| *to = *from);
            state
        }
    };
    let mut restored = renderer(&states.scene, technique);
    let mut accepted = false;
    check_memory(state.len(), || {
        accepted = restored.restore(&state).is_ok();
        0
    });
    if accepted {
        renderer(&states.scene, technique)
            .restore(&save_state(restored.as_ref()))
            .expect("a saved state is accepted");
        let _ = (restored.film(), restored.times());
    }
    accepted
}

/// Reads the rows of a `metrics.csv`, writes them, and reads them again. Returns whether they were
/// read.
pub fn rows(bytes: &[u8]) -> bool {
    let text = String::from_utf8_lossy(bytes);
    let _ = metrics_csv::parse_more(&text, 2);
    let Ok((columns, read)) = metrics_csv::parse(&text) else {
        return false;
    };
    let mut again = metrics_csv::header(columns.iter().map(String::as_str));
    read.iter()
        .for_each(|row| again.push_str(&metrics_csv::line(row)));
    let (_, twice) = metrics_csv::parse(&again).expect("written rows can be read");
    assert_eq!(format!("{read:?}"), format!("{twice:?}"));
    true
}
