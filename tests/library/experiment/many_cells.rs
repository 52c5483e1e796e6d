//! What nights of many cells share, and what they drop when a cell has ended.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::sync::{Arc, Weak};

use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::compile;
use lumbre_night::experiment::spec::Order;
use lumbre_night::experiment::{CellRef, run};
use lumbre_render::Renderer;
use lumbre_render::mock::MockRenderer;

use crate::experiment::fixtures::{Lab, Night, at, ints, whole_at};

/// Returns an experiment that sets a value of the scene to each of these numbers.
fn sweep(path: &'static str, values: impl IntoIterator<Item = f64>) -> Lab {
    let mut lab = Lab::new().axis("x", values);
    lab.configure(move |p, config| {
        config.set.insert(path.into(), at(p, "x"));
    });
    lab
}

fn cameras(count: u32) -> Lab {
    let angles = (0..count).map(|i| 30.0 + f64::from(i) / 10.0);
    sweep("camera.fov", angles)
}

/// Renders a night, and returns the number of different compiled scenes that it opens.
fn compiled_scenes(lab: &Lab) -> usize {
    let scenes = RefCell::new(Vec::new());
    let open: run::Open<'_> = &|_, scene, job| {
        scenes.borrow_mut().push(Arc::clone(&scene));
        Ok(Box::new(MockRenderer::new(scene, job)))
    };
    Night {
        open,
        ..Night::default()
    }
    .record(lab);
    let addresses = scenes.borrow().iter().map(Arc::as_ptr).collect();
    BTreeSet::len(&addresses)
}

#[test]
fn consecutive_cells_share_a_compiled_scene() {
    let mut lab = Lab::new()
        .axis("rough", [0.25, 0.75])
        .axis("depth", ints([1, 2]));
    lab.spec.repeats = 2;
    lab.configure(|p, config| {
        config.max_depth = Some(whole_at(p, "depth"));
        config
            .set
            .insert("materials.egg.roughness".into(), at(p, "rough"));
    });
    assert_eq!(compiled_scenes(&lab), 2);
}

#[test]
fn cells_that_differ_in_their_camera_alone_share_a_compiled_scene() {
    let mut lab = cameras(300);
    assert_eq!(compiled_scenes(&lab), 1);
    lab = cameras(20).measured();
    lab.spec.repeats = 2;
    assert_eq!(compiled_scenes(&lab), 1, "references share it, too");
    lab = cameras(20).axis("technique", ["nee", "bpt"]);
    lab.spec.night.order = Order::Interleave;
    lab.configure(|p, config| {
        config.set.insert("camera.fov".into(), at(p, "x"));
        config.integrator = at(p, "technique").as_str().unwrap().to_owned();
    });
    assert_eq!(compiled_scenes(&lab), 1, "in turns");
}

#[test]
fn a_shared_scene_changes_no_picture() {
    let lab = cameras(20);
    let (_, recorder) = Night::default().record(&lab);
    let films = lab.plan().cells.into_iter().enumerate().map(|(i, cell)| {
        let compiled = compile(&cell.scene).unwrap().0;
        let job = cell.config.job([0, 0], 0, 1).unwrap();
        let job = lumbre_render::Job {
            seed: cell.seed,
            ..job
        };
        let mut alone = MockRenderer::new(Arc::new(compiled), job);
        alone.advance(16).unwrap();
        let film = recorder.film(CellRef::Cell(i)).unwrap();
        assert_eq!(film.mean(), alone.film().mean(), "cell {i}");
        format!("{:?}", film.mean())
    });
    assert!(films.collect::<BTreeSet<String>>().len() > 1);
}

#[test]
fn few_of_many_scenes_are_in_memory() {
    let lab = sweep(
        "materials.egg.roughness",
        (0..300).map(|i| f64::from(i) / 300.0),
    );
    let scenes: RefCell<Vec<Weak<CompiledScene>>> = RefCell::default();
    let most = RefCell::new(0);
    let open: run::Open<'_> = &|_, scene, job| {
        scenes.borrow_mut().push(Arc::downgrade(&scene));
        let in_memory = |scene: &&Weak<CompiledScene>| scene.strong_count() > 0;
        let count = scenes.borrow().iter().filter(in_memory).count();
        most.replace_with(|most| count.max(*most));
        Ok(Box::new(MockRenderer::new(scene, job)))
    };
    Night {
        open,
        ..Night::default()
    }
    .record(&lab);
    assert_eq!(scenes.borrow().len(), 300);
    assert_eq!(most.into_inner(), 64);
}
