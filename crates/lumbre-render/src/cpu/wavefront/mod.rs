//! Renders with many paths at a time, one path per lane of a SIMD vector: 16 with AVX-512, 8 with
//! AVX2. [`Wavefront`] is the entry point.
//!
//! A tile is a run of consecutive samples of a row. All its paths advance by one step at a time:
//! rays are traced one by one or a few in turn, or in vectors by [`small_scene`] in scenes of few
//! primitives, hits are sorted by class of surface, and a step of the technique runs on full vectors
//! of one class.
//! [`wave`] does what all techniques share. [`camera_paths`] schedules every technique that follows
//! paths from the camera, and [`bdpt`](self::bdpt) every one that joins subpaths from the camera with
//! subpaths from lights; they know no technique by name.
//!
//! Invariant: results are bit-identical for any number of lanes, which tests check. The text of a
//! technique is the same for all of them, and the contributions of a sample are added in the order
//! of its path.

mod bdpt;
mod camera_paths;
mod light;
mod small_scene;
mod wave;

use std::ops::Range;

use super::bvh::accel::Accel;
use super::bvh::simd::Isa;
use super::films::contributions::SampleId;
use super::films::layers::LayerRowFilm;
use super::films::row_film::RowFilm;
use crate::hierarchy::LaneMode;
use crate::{Job, own_technique};
use camera_paths::PathTile;
use lumbre_light::math::simd::Width;
use lumbre_light::transport::integrator::bdpt::joins::SubpathTechnique;
use lumbre_light::transport::integrator::camera_path::CameraPaths;
use lumbre_light::transport::integrator::iteration::light_batch::{LightBatch, LightUnit};
use lumbre_light::transport::integrator::iteration::recorded::{CameraBatch, RecordedPaths};
use lumbre_light::transport::integrator::{Context, TechniqueVisitor, visit_technique};
pub use small_scene::SmallScene;
use wave::TileContext;

/// Renders a tile.
type RenderTile = fn(&TileContext, &mut TileBuffers, &mut RowFilm, Option<&mut LayerRowFilm>);

/// Buffers that tiles reuse; a technique uses its own.
#[derive(Default)]
struct TileBuffers {
    paths: PathTile,
    subpaths: bdpt::SubpathTile,
}

/// Method of rendering the tiles of a technique.
#[derive(Clone, Copy)]
pub struct TileMethod {
    render_tile: RenderTile,
    /// Number of samples in a tile.
    tile_samples: usize,
}

impl TileMethod {
    /// Returns the method for a technique that follows paths from the camera.
    pub const fn camera_paths<T: CameraPaths>() -> TileMethod {
        TileMethod {
            render_tile: |tile, buffers, film, layers| {
                camera_paths::render_tile::<T>(tile, &mut buffers.paths, film, layers);
            },
            tile_samples: camera_paths::TILE_SAMPLES,
        }
    }
}

/// Records the camera paths of a tile.
type RecordTile = fn(&TileContext) -> RecordedPaths;

/// Selects the method of recording the paths of a technique, if it follows paths from the camera.
struct SelectRecorder;

impl TechniqueVisitor for SelectRecorder {
    type Output = Option<RecordTile>;

    fn camera_paths<T: CameraPaths>(self) -> Option<RecordTile> {
        Some(camera_paths::record_tile::<T>)
    }

    fn subpaths<T: SubpathTechnique>(self) -> Option<RecordTile> {
        None
    }
}

/// Renderer of many paths at a time, for one job and scene.
pub struct Wavefront {
    width: Width,
    /// Method of rendering samples; `None` if the technique has no steps that are generic over the
    /// width of vectors.
    technique: Option<TileMethod>,
    small_scene: Option<SmallScene>,
}

/// Selects the method for a technique.
struct SelectTiles;

impl TechniqueVisitor for SelectTiles {
    type Output = TileMethod;

    fn camera_paths<T: CameraPaths>(self) -> TileMethod {
        TileMethod::camera_paths::<T>()
    }

    fn subpaths<T: SubpathTechnique>(self) -> TileMethod {
        TileMethod {
            render_tile: |tile, buffers, film, layers| {
                let joins = T::joins(tile.context);
                bdpt::render_tile(tile, &joins, &mut buffers.subpaths, film, layers);
            },
            tile_samples: bdpt::TILE_SAMPLES,
        }
    }
}

impl Wavefront {
    /// Creates the renderer for a job. Returns `None` if `lanes` is `never`, if the processor has no
    /// vector instructions, or if the hierarchy was built without them.
    pub fn new(job: &Job, accel: &Accel) -> Option<Wavefront> {
        let width = match accel.isa() {
            Isa::Portable => None,
            Isa::Avx2 => Width::eight(),
            Isa::Avx512 => Width::sixteen(),
        }?;
        if job.settings.accel.lanes == LaneMode::Never {
            return None;
        }
        Some(Wavefront {
            width,
            technique: visit_technique(job.integrator.name, SelectTiles)
                .or_else(|| own_technique::tile_method(job.integrator)),
            small_scene: SmallScene::new_if_small(accel, width),
        })
    }

    /// Returns the tracer of rays in small scenes, if this scene is small.
    pub fn small_scene(&self) -> Option<&SmallScene> {
        self.small_scene.as_ref()
    }

    /// Returns the number of paths in a vector.
    pub fn lanes(&self) -> u32 {
        self.width.lanes() as u32
    }

    /// Returns whether it renders the samples of the job's technique.
    pub fn renders_samples(&self) -> bool {
        self.technique.is_some()
    }

    /// Traces light subpaths that belong to no pixel.
    pub fn trace_light(&self, context: &Context, job: &Job, batch: &LightBatch) -> LightUnit {
        bdpt::trace_light(self.width, context, job, batch)
    }

    /// Traces camera paths of neighbouring pixels; `None` if the technique cannot be recorded.
    pub fn trace_camera(
        &self,
        context: &Context,
        job: &Job,
        batch: &CameraBatch,
    ) -> Option<RecordedPaths> {
        let record_tile = visit_technique(batch.technique, SelectRecorder)??;
        let columns = batch.columns.clone();
        let ids: Vec<SampleId> = columns.map(|x| (x, batch.sample)).collect();
        Some(record_tile(&TileContext {
            width: self.width,
            context,
            job,
            seed: batch.seed,
            y: batch.row,
            ids: &ids,
        }))
    }

    /// Renders the given samples of all pixels of row `y` and adds them to the films, if it
    /// [renders samples](Self::renders_samples). Within a tile, all splats are added before the
    /// contributions to the samples' own pixels.
    pub fn render_row(
        &self,
        context: &Context,
        job: &Job,
        y: u32,
        samples: Range<u64>,
        film: &mut RowFilm,
        mut layers: Option<&mut LayerRowFilm>,
    ) {
        let Some(TileMethod {
            render_tile,
            tile_samples,
        }) = self.technique
        else {
            return;
        };
        let columns = 0..job.resolution[0];
        let mut ids = columns.flat_map(|x| samples.clone().map(move |sample| (x, sample)));
        let mut buffers = TileBuffers::default();
        loop {
            let ids: Vec<SampleId> = ids.by_ref().take(tile_samples).collect();
            if ids.is_empty() {
                return;
            }
            let tile = TileContext {
                width: self.width,
                context,
                job,
                seed: job.seed,
                y,
                ids: &ids,
            };
            render_tile(&tile, &mut buffers, film, layers.as_deref_mut());
        }
    }
}
