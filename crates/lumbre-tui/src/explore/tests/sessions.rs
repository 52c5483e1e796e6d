//! The render thread: restarts, techniques, limits, and the bits of its pictures.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{scene, session_options, wait_until};
use crate::explore::script::script_text;
use crate::explore::session::{Frame, Request, Session, Slot, SlotView, Status};
use crate::explore::settings::{Limits, Settings};
use lumbre_light::scene::compile::compile_sharing;
use lumbre_light::transport::integrator::INTEGRATORS;
use lumbre_light::value::Value;
use lumbre_night::backends;
use lumbre_night::experiment::plan::expand;
use lumbre_night::experiment::{Overrides, Plan};
use lumbre_render::Job;
use lumbre_scene_io::load::MissingTextures;

const RESOLUTION: [u32; 2] = [48, 32];

fn request(settings: &Settings, resolution: [u32; 2]) -> Request {
    let scene = scene("cornell_spheres");
    Request {
        table: settings.request_table(&scene, resolution),
        seed: settings.random_seed(),
        scene,
    }
}

/// Waits until a picture has the given number of samples at least, for the newest request.
fn wait_for(session: &Session, number: u64, samples: u64) -> SlotView {
    let mut view = SlotView::default();
    wait_until("a picture", || {
        view = session.published().slot(Slot::A).clone();
        if let Status::Failed(reason) = &view.status {
            assert!(view.request != number, "{reason}");
        }
        let done = view.frame.as_ref().map_or(0, |frame| frame.samples);
        view.request == number && done >= samples
    });
    view
}

fn settings(pairs: &[(&str, Value)]) -> Settings {
    let pairs: Vec<(String, Value)> = pairs
        .iter()
        .map(|(key, value)| ((*key).to_owned(), value.clone()))
        .collect();
    Settings::new(&pairs)
}

fn rendered(settings: &Settings, samples: u64) -> Arc<Frame> {
    let session = Session::start(session_options()).unwrap();
    session.set_limits(
        Slot::A,
        Limits {
            samples: Some(samples),
            seconds: None,
        },
    );
    let number = session.request(Slot::A, Some(request(settings, RESOLUTION)));
    let view = wait_for(&session, number, samples);
    assert_eq!(view.status, Status::Finished);
    view.frame.unwrap()
}

/// Plans a script.
fn planned(text: String) -> Plan {
    let path = Path::new("explore.lua");
    let script = lumbre_lua::load_text(path, text, lumbre_lua::Limits::default()).unwrap();
    let mut load = |path: &Path, options: &BTreeMap<String, Value>| {
        lumbre_lua::scene::read(path, options, MissingTextures::Fail)
    };
    let overrides = Overrides {
        backend: Some("cpu".to_owned()),
        ..Overrides::default()
    };
    expand(&script.spec, &script, &overrides, &mut load).unwrap()
}

#[test]
fn the_script_renders_the_bits_of_the_picture() {
    for (technique, more) in [
        ("nee", ("aa.filter", Value::from("gauss"))),
        (
            "bdpt",
            (
                "strategies",
                Value::List(vec![Value::Int(1), Value::Int(2)]),
            ),
        ),
        ("vcm", ("rr.start", Value::Int(3))),
    ] {
        let mut settings = settings(&[
            ("integrator", technique.into()),
            ("max_depth", Value::Int(4)),
            ("sampler", "sobol".into()),
            ("camera.fov", Value::Num(31.5)),
            ("camera.aperture", Value::Num(0.05)),
            ("materials.*.roughness", Value::Num(0.5)),
            ("display.exposure", Value::Num(1.5)),
            ("seed", Value::Int(7)),
            more,
        ]);
        settings.put("limit.samples", Some(Value::Int(5)));
        let frame = rendered(&settings, 5);
        let scene = scene("cornell_spheres");
        let text = script_text(&settings, &scene, RESOLUTION, 5, "explore.lua");
        assert!(text.contains("tonemap.srgb { exposure = 1.5 }"), "{text}");
        let plan = planned(text);
        let [cell] = &plan.cells[..] else {
            panic!("{} cells", plan.cells.len());
        };
        let (compiled, _) = compile_sharing(&cell.scene, cell.config.accel.instances).unwrap();
        let job = cell
            .config
            .job(compiled.resolution, compiled.max_depth, 1)
            .unwrap();
        let job = Job {
            seed: cell.seed,
            ..job
        };
        let mut renderer = backends::open("cpu", Arc::new(compiled), job).unwrap();
        renderer.advance(5).unwrap();
        assert!(
            renderer.film().mean() == *frame.image,
            "{technique}: the bits differ"
        );
        assert!(
            frame.image.mean()[1] > 0.0,
            "{technique}: the picture is black"
        );
    }
}

/// Number of threads of this process whose name begins like those of render threads.
#[cfg(target_os = "linux")]
fn render_threads() -> usize {
    let tasks = std::fs::read_dir("/proc/self/task").unwrap().flatten();
    let names = tasks.filter_map(|task| std::fs::read_to_string(task.path().join("comm")).ok());
    names.filter(|name| name.starts_with("render-")).count()
}

#[test]
fn switching_techniques_reloads_and_leaks_nothing() {
    let session = Session::start(session_options()).unwrap();
    let mut settings = Settings::new(&[]);
    let number = session.request(Slot::A, Some(request(&settings, RESOLUTION)));
    let first = wait_for(&session, number, 1).scene.unwrap();
    #[cfg(target_os = "linux")]
    let threads = render_threads();
    for step in 0..200 {
        let technique = &INTEGRATORS[step % INTEGRATORS.len()];
        settings.put("integrator", Some(technique.name.into()));
        settings.put("camera.fov", Some(Value::number(30.0 + step as f64 / 10.0)));
        let number = session.request(Slot::A, Some(request(&settings, RESOLUTION)));
        if step % 20 == 19 {
            let view = wait_for(&session, number, 1);
            assert!(
                Arc::ptr_eq(&view.scene.unwrap(), &first),
                "the scene was loaded again"
            );
        }
    }
    // Other tests start and end sessions of their own meanwhile, with two threads each.
    #[cfg(target_os = "linux")]
    assert!(
        render_threads() <= threads + 32,
        "threads of old runs are still there"
    );
    let prepared = first.prepared.as_ref().unwrap();
    assert!(
        Arc::strong_count(prepared) <= 2,
        "{}",
        Arc::strong_count(prepared)
    );
}

#[test]
fn a_change_abandons_the_picture_in_progress() {
    let session = Session::start(session_options()).unwrap();
    // `guided` trains before its first sample, `vcm` traces a light subpath for each pixel.
    for technique in ["bdpt", "guided", "vcm"] {
        let settings = settings(&[
            ("integrator", technique.into()),
            ("max_depth", Value::Int(20)),
        ]);
        // A hundredth of the large picture's pixels, for its time on this machine as busy as it is.
        let start = Instant::now();
        let number = session.request(Slot::A, Some(request(&settings, [600, 400])));
        wait_for(&session, number, 1);
        let whole = start.elapsed() * 100;
        session.request(Slot::A, Some(request(&settings, [6000, 4000])));
        wait_until("the start of the large picture", || {
            let published = session.published();
            published.slot(Slot::A).status == Status::Rendering
        });
        std::thread::sleep(Duration::from_millis(300));
        let start = Instant::now();
        let number = session.request(Slot::A, Some(request(&settings, RESOLUTION)));
        let view = wait_for(&session, number, 1);
        assert!(
            start.elapsed() < whole / 4,
            "{technique}: {:?} of {whole:?}",
            start.elapsed()
        );
        let image = &view.frame.unwrap().image;
        assert_eq!([image.width, image.height], RESOLUTION);
    }
}

#[test]
fn a_large_picture_is_shown_in_reduced_resolution_first() {
    let session = Session::start(session_options()).unwrap();
    let settings = settings(&[("max_depth", Value::Int(3))]);
    let number = session.request(Slot::A, Some(request(&settings, [1600, 1200])));
    let view = wait_for(&session, number, 0);
    let frame = view.frame.unwrap();
    if frame.samples == 0 {
        assert!(frame.image.width < 1600 && frame.image.mean()[0] > 0.0);
    }
    let view = wait_for(&session, number, 1);
    assert_eq!(view.frame.unwrap().image.width, 1600);
}

#[test]
fn a_paused_picture_has_one_sample_and_goes_on_when_resumed() {
    let session = Session::start(session_options()).unwrap();
    session.set_paused(true);
    let settings = Settings::new(&[]);
    let number = session.request(Slot::A, Some(request(&settings, RESOLUTION)));
    let view = wait_for(&session, number, 1);
    wait_until("the pause", || {
        session.published().slot(Slot::A).status == Status::Paused
    });
    let done = view.frame.unwrap().samples;
    assert_eq!(done, 1);
    session.set_paused(false);
    wait_for(&session, number, 2);
    session.request(Slot::A, None);
    wait_until("the end", || {
        session.published().slot(Slot::A).status == Status::Idle
    });
}

#[test]
fn the_pictures_of_both_slots_take_turns_on_one_scene() {
    let session = Session::start(session_options()).unwrap();
    let (first, second) = (
        settings(&[("integrator", "nee".into())]),
        settings(&[("integrator", "bdpt".into())]),
    );
    session.request(Slot::A, Some(request(&first, RESOLUTION)));
    session.request(Slot::B, Some(request(&second, RESOLUTION)));
    wait_until("both pictures", || {
        let published = session.published();
        Slot::ALL.iter().all(|slot| {
            let view = published.slot(*slot);
            view.frame.as_ref().is_some_and(|frame| frame.samples >= 2)
        })
    });
    let published = session.published();
    let [live, other] = Slot::ALL.map(|slot| published.slot(slot).scene.clone().unwrap());
    assert!(Arc::ptr_eq(&live, &other));
}

#[test]
fn an_error_is_published_and_the_next_request_is_rendered() {
    let session = Session::start(session_options()).unwrap();
    let bad = settings(&[("materials.none.roughness", Value::Int(1))]);
    session.request(Slot::A, Some(request(&bad, RESOLUTION)));
    wait_until("the error", || {
        matches!(&session.published().slot(Slot::A).status,
            Status::Failed(reason) if reason.contains("none"))
    });
    let number = session.request(Slot::A, Some(request(&Settings::new(&[]), RESOLUTION)));
    wait_for(&session, number, 1);
}
