//! Renders with many paths at a time, one path per lane of a SIMD vector: 16 with AVX-512, 8 with
//! AVX2. [`Wavefront`] is the entry point.
//!
//! A tile is a run of consecutive samples of a row. All its paths advance by one step at a time:
//! rays are traced one by one, or in vectors by [`small_scene`] in scenes of few primitives, hits
//! are sorted by class of surface, and a step of the technique runs on full vectors of one class.
//! [`camera_paths`] does this for every technique that follows paths from the camera, none of which
//! it knows by name; [`bdpt`](self::bdpt) has tiles and steps of its own.
//!
//! Invariant: results are bit-identical for any number of lanes, which tests check. The text of a
//! technique is the same for all of them, and the contributions of a sample are added in the order
//! of its path.

mod bdpt;
mod camera_paths;
mod light;
mod small_scene;

use std::ops::Range;

use super::bvh::accel::Accel;
use super::bvh::simd::Isa;
use super::films::contributions::SampleId;
use super::films::layers::LayerRowFilm;
use super::films::row_film::RowFilm;
use super::vectorizable::scalar_reason;
use crate::Job;
use crate::hierarchy::LaneMode;
use bdpt::material_classes::{MaterialTable, all_vectorized};
use camera_paths::{PathTile, TileContext};
use lumbre_light::math::simd::Width;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::camera_path::CameraPaths;
use lumbre_light::transport::integrator::{CameraPathsVisitor, Context, visit_camera_paths};
pub use small_scene::SmallScene;

/// Renders a tile of camera paths.
type RenderTile = fn(&TileContext, &mut PathTile, &mut RowFilm, Option<&mut LayerRowFilm>);

/// Renderer of many paths at a time, for one job and scene.
pub struct Wavefront {
    width: Width,
    technique: Technique,
    small_scene: Option<SmallScene>,
}

/// Method of rendering a tile.
enum Technique {
    /// Technique that follows camera paths.
    CameraPaths(RenderTile),
    /// Bidirectional path tracing.
    Bidirectional(MaterialTable),
}

/// Selects the function that renders tiles with a technique.
struct SelectTiles;

impl CameraPathsVisitor for SelectTiles {
    type Output = RenderTile;

    fn visit<T: CameraPaths>(self) -> RenderTile {
        camera_paths::render_tile::<T>
    }
}

impl Wavefront {
    /// Creates the renderer for a job. Returns `None` if `lanes` is `never`, if the processor has no
    /// vector instructions, or if the hierarchy was built without them; for `bdpt` also if the
    /// job's settings [rule it out](scalar_reason), or a surface at which paths continue has a
    /// texture, a delay or a terminator offset or belongs to an instance.
    pub fn new(scene: &CompiledScene, job: &Job, accel: &Accel) -> Option<Wavefront> {
        let width = match accel.isa() {
            Isa::Portable => None,
            Isa::Avx2 => Width::eight(),
            Isa::Avx512 => Width::sixteen(),
        }?;
        if job.accel.lanes == LaneMode::Never {
            return None;
        }
        let technique = match visit_camera_paths(job.integrator, SelectTiles) {
            Some(render_tile) => Technique::CameraPaths(render_tile),
            None => Technique::Bidirectional(bidirectional(scene, job, width)?),
        };
        Some(Wavefront {
            width,
            technique,
            small_scene: SmallScene::new_if_small(accel, width),
        })
    }

    /// Returns the tracer of rays in small scenes, if this scene is small.
    pub fn small_scene(&self) -> Option<&SmallScene> {
        self.small_scene.as_ref()
    }

    /// Renders the given samples of all pixels of row `y` and adds them to the films. Within a tile,
    /// all splats are added before the contributions to the samples' own pixels.
    pub fn render_row(
        &self,
        context: &Context,
        job: &Job,
        y: u32,
        samples: Range<u64>,
        film: &mut RowFilm,
        mut layers: Option<&mut LayerRowFilm>,
    ) {
        let columns = 0..job.resolution[0];
        let mut ids = columns.flat_map(|x| samples.clone().map(move |sample| (x, sample)));
        let mut tile_of = |size: usize| -> Vec<SampleId> { ids.by_ref().take(size).collect() };
        match &self.technique {
            Technique::CameraPaths(render_tile) => {
                let mut buffers = PathTile::default();
                loop {
                    let ids = tile_of(camera_paths::TILE_SAMPLES);
                    if ids.is_empty() {
                        return;
                    }
                    let tile = TileContext {
                        width: self.width,
                        context,
                        job,
                        y,
                        ids: &ids,
                    };
                    render_tile(&tile, &mut buffers, film, layers.as_deref_mut());
                }
            }
            Technique::Bidirectional(table) => {
                let render_tile = match context.timing {
                    None => bdpt::render_tile::<false>,
                    Some(_) => bdpt::render_tile::<true>,
                };
                let mut buffers = bdpt::TileBuffers::default();
                loop {
                    let ids = tile_of(bdpt::TILE_SAMPLES);
                    if ids.is_empty() {
                        return;
                    }
                    render_tile(table, context, job, y, &ids, &mut buffers, film);
                }
            }
        }
    }
}

/// Returns the materials of a scene for bidirectional path tracing, or `None` if a job cannot use
/// vectors: see [`Wavefront::new`].
fn bidirectional(scene: &CompiledScene, job: &Job, width: Width) -> Option<MaterialTable> {
    let has_layers = !job.layers.is_empty();
    let reason = scalar_reason(job.integrator, &job.params, job.sampler, has_layers);
    let lifted = scene.materials.iter().any(|m| m.shadow_terminator);
    if reason.is_some() || !scene.delays.is_empty() || lifted || !all_vectorized(scene) {
        return None;
    }
    MaterialTable::new(scene, width, true, true).filter(|table| table.covers(scene))
}
