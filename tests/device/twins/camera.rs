//! Pixel filters and the camera.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::desc::{CameraDesc, CameraKind, ViewWindow};
use lumbre_light::transport::camera::filter::FilmEdge;
use lumbre_light::transport::camera::{Camera, CameraConnection, FilterKind, FilterSpec};
use lumbre_render::Job;

use super::{CLOSE, RandomInputs, SAME};
use crate::common::{SceneBuilder, grey, job};
use crate::parity::{Near, Row, Twin};

const KINDS: [FilterKind; 5] = [
    FilterKind::Box,
    FilterKind::Tent,
    FilterKind::Gauss,
    FilterKind::BlackmanHarris,
    FilterKind::AntialiasingRadius,
];

const EDGES: [FilmEdge; 3] = [FilmEdge::Open, FilmEdge::Wraps, FilmEdge::Reflects];

/// Tolerance of offsets in pixels: one ten-thousandth of a pixel is invisible.
const OFFSET: Near = Near::Float {
    absolute: 1e-4,
    relative: 1e-5,
};
const DENSITY: Near = Near::Float {
    absolute: 2e-6,
    relative: 1e-4,
};

/// All pixel filters.
pub const FILTER: Twin = Twin {
    name: "filter",
    kernel: kernel!(Generation "filter.rgen"),
    scene: super::plain,
    in_words: 8,
    inputs: || {
        RandomInputs::rows(6000, |d, i| {
            let radius = [0.0, 0.5, 1.25, 2.0, 0.3][d.word() as usize % 5];
            let u = match i % 16 {
                0 => [0.0, 0.5],
                1 => [0.999_999_94, 5.960_464_5e-8],
                _ => [d.unit(), d.unit()],
            };
            let (x, q, pick) = (
                d.between(-3.0, 3.0) * radius,
                d.between(-3.0, 10.0),
                d.unit(),
            );
            d.put_word(i % 5);
            d.put([radius]);
            d.put(u);
            d.put([x, q, pick]);
            d.put_word(i / 5 % 3);
        })
    },
    original: |_, _, row| {
        let kind = KINDS[row.word() as usize];
        let [radius] = row.floats();
        let f = FilterSpec { kind, radius };
        let u = row.floats();
        let [x, q, pick] = row.floats();
        let edge = EDGES[row.word() as usize];
        row.push_floats(f.sample(u));
        row.push_floats([f.density(x), f.reach()]);
        let chosen = f.choose_pixel(q, (7, edge), pick);
        row.push(u32::from(chosen.is_some()));
        row.push(chosen.map_or(0, |c| c.0));
        row.push_floats([chosen.map_or(0.0, |c| c.1)]);
    },
    near: &[OFFSET, OFFSET, DENSITY, CLOSE, SAME, SAME, DENSITY],
    max_outliers: 0.01,
    why: "logarithms differ in their last digits; a position on the border of two pixels may \
          belong to either; at the ends of the Blackman-Harris window, where its density \
          vanishes, single precision cannot distinguish positions",
};

/// Returns a scene with a thin lens, and a job with a wide filter.
fn lens() -> (Arc<CompiledScene>, Job) {
    seen_by(|camera| {
        (camera.optics, camera.focus_distance) = (camera.optics.with_aperture(0.4), Some(2.5))
    })
}

fn orthographic() -> (Arc<CompiledScene>, Job) {
    seen_by(|camera| (camera.kind, camera.view_height) = (CameraKind::Orthographic, 2.5))
}

fn off_axis() -> (Arc<CompiledScene>, Job) {
    seen_by(|camera| camera.window = ViewWindow::from_array([0.9, -0.4, 0.25, 1.1]))
}

fn spherical() -> (Arc<CompiledScene>, Job) {
    seen_by(|camera| camera.kind = CameraKind::Spherical)
}

/// Returns a scene whose camera was changed, and a job with a wide filter.
fn seen_by(change: impl FnOnce(&mut CameraDesc)) -> (Arc<CompiledScene>, Job) {
    let builder = SceneBuilder::new(Vec3::new(0.5, 1.0, 3.0), Vec3::ZERO, 50.0)
        .with(|s| change(&mut s.camera));
    let scene = builder
        .quad(-Vec3::ONE, Vec3::X, Vec3::Y, grey(0.5))
        .build();
    let filter = FilterSpec {
        kind: FilterKind::Tent,
        radius: 1.5,
    };
    (
        scene,
        job([64, 36], 5, 3).with(|settings| settings.filter = filter),
    )
}

fn put(c: Option<CameraConnection>, row: &mut Row) {
    row.push(u32::from(c.is_some()));
    row.push_words(c.map_or([0; 2], |c| c.pixel));
    row.push_floats(c.map_or(Vec3::ZERO, |c| c.lens).to_array());
    row.push_floats(c.map_or(Vec3::ZERO, |c| c.dir).to_array());
    row.push_floats(c.map_or([0.0; 3], |c| [c.distance, c.importance, c.pdf_w]));
}

const NEAR: [Near; 31] = {
    let mut near = [Near::Float {
        absolute: 2e-6,
        relative: 2e-4,
    }; 31];
    let integers = [7, 8, 9, 19, 20, 21];
    let mut i = 0;
    while i < integers.len() {
        near[integers[i]] = SAME;
        i += 1;
    }
    near
};

/// Rays of an orthographic camera, and points connected to it.
pub const ORTHOGRAPHIC: Twin = Twin {
    scene: orthographic,
    ..CAMERA
};

/// Rays of a camera that shows a mirrored part of its view, and points connected to it.
pub const OFF_AXIS: Twin = Twin {
    scene: off_axis,
    ..CAMERA
};

/// Rays of a spherical camera, and points connected to it.
pub const SPHERICAL: Twin = Twin {
    scene: spherical,
    ..CAMERA
};

/// Rays of a thin lens, and points connected to it.
pub const CAMERA: Twin = Twin {
    name: "camera",
    kernel: kernel!(Generation "camera.rgen"),
    scene: lens,
    in_words: 13,
    inputs: || {
        RandomInputs::rows(4000, |d, i| {
            let pixel = [d.word() % 64, d.word() % 36];
            let point = d.vector(2.0);
            let towards = (point - Vec3::new(0.5, 1.0, 3.0)).normalize_or(Vec3::X);
            let dir = if i.is_multiple_of(3) {
                d.direction()
            } else {
                towards
            };
            let numbers = [d.unit(), d.unit(), d.unit(), d.unit()];
            pixel.into_iter().for_each(|p| d.put_word(p));
            d.put_word(i);
            d.put(point.to_array());
            d.put(dir.to_array());
            d.put(numbers);
        })
    },
    original: |scene, job, row| {
        let pixel = [row.word(), row.word()];
        let index = row.word();
        let [point, dir]: [Vec3; 2] = [(); 2].map(|()| Vec3::from_array(row.floats()));
        let (lens_u, filter_u) = (row.floats(), row.floats());
        let camera = Camera::new(&scene.camera, job.resolution, job.settings.filter);
        let ray = camera.sample_ray(
            pixel,
            &mut job.sampler.start(job.seed, pixel, u64::from(index)),
        );
        row.push_floats(ray.origin.to_array());
        row.push_floats(ray.dir.to_array());
        row.push_floats([camera.pdf_w(dir)]);
        put(camera.connect(point, lens_u, filter_u), row);
        put(camera.connect_direction(dir, lens_u, filter_u), row);
    },
    near: &NEAR,
    max_outliers: 0.01,
    why: "a few roundings; a position on the border of two pixels may belong to either, and \
          weights vanish at the end of the filter",
};
