//! Cameras that show a part of their view: crops, views off the axis and mirrored pictures.

use glam::Vec3;
use lumbre_light::scene::desc::{CameraDesc, CameraKind, Optics, ViewWindow};
use lumbre_light::transport::camera::{Camera, FilterSpec};

use crate::common::{grey, light};
use crate::render::agreement::{agree_with_bpt, room};
use crate::render::camera::uniform;

const WHOLE: [u32; 2] = [64, 32];

/// The kinds of cameras whose picture may be a part.
const KINDS: [CameraKind; 2] = [CameraKind::Perspective, CameraKind::Orthographic];

fn desc(kind: CameraKind, window: [f32; 4]) -> CameraDesc {
    CameraDesc {
        kind,
        position: Vec3::new(0.7, -1.0, 2.5),
        target: Vec3::new(0.1, 0.1, 0.0),
        up: Vec3::new(0.1, 1.0, 0.2),
        view_height: 1.6,
        optics: Optics::default().with_aperture(if kind == CameraKind::Perspective {
            0.3
        } else {
            0.0
        }),
        window: ViewWindow::from_array(window),
        ..CameraDesc::default()
    }
}

#[test]
fn a_window_shows_the_pixels_of_the_whole() {
    // The second window is mirrored: its columns run to the left.
    let windows = [
        ([0.25, 0.75, 0.5, 1.0], [32, 16], 1.0),
        ([0.75, 0.25, 0.5, 1.0], [32, 16], -1.0),
        ([-0.5, 1.5, 0.0, 2.0], [128, 64], 1.0),
    ];
    for kind in KINDS {
        let whole = Camera::new(&desc(kind, [0.0, 1.0, 0.0, 1.0]), WHOLE, FilterSpec::PIXEL);
        for (window, size, side) in windows {
            let part = Camera::new(&desc(kind, window), size, FilterSpec::PIXEL);
            for i in 0..2000 {
                let [a, b, c, d] = uniform(i, 5);
                let pixel = [(a * size[0] as f32).floor(), (b * size[1] as f32).floor()];
                let (u, lens) = ([c, d], [0.5; 2]);
                let [origin, dir]: [Vec3; 2] = part.ray(pixel, u, lens);
                let column = window[0] * WHOLE[0] as f32 + side * (pixel[0] + c);
                let row = window[2] * WHOLE[1] as f32 + pixel[1] + d;
                let there = [column - 0.5, row - 0.5];
                let [from, towards]: [Vec3; 2] = whole.ray(there, [0.5; 2], lens);
                assert!((origin - from).length() < 2e-6, "{kind:?} {window:?}");
                assert!((dir - towards).length() < 2e-6, "{kind:?} {window:?}");
                let at = part.project(origin + dir * (0.5 + a), lens);
                let off = [at.raster[0] - pixel[0] - c, at.raster[1] - pixel[1] - d];
                assert!(at.ahead && off.iter().all(|x| x.abs() < 1e-3), "{off:?}");
            }
            // All rays of a part are as dense as its share of the whole says.
            let [width, height] = part.resolution;
            let share = width * height / (WHOLE[0] * WHOLE[1]) as f32;
            let ratio = whole.pdf_w(part.forward) / part.pdf_w(part.forward);
            assert!((ratio - share).abs() < 1e-4, "{kind:?}: {ratio} {share}");
        }
    }
}

#[test]
fn all_techniques_agree_in_a_mirrored_part() {
    for kind in KINDS {
        let scene = room(Vec3::new(0.3, 1.1, 1.6))
            .sphere(Vec3::new(0.5, 0.4, 0.2), 0.35, light(2.0))
            .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.4, grey(0.8))
            .with(|s| {
                (s.camera.kind, s.camera.view_height) = (kind, 2.4);
                s.camera.window = ViewWindow::from_array([0.9, 0.3, 0.25, 1.1]);
            })
            .build();
        agree_with_bpt(&scene, 4, None, 400);
    }
}
