//! Parameters of a job: everything that is constant over its samples.

use super::delay_tables::double_words;
use super::subpaths::{SubpathRoom, light_path_count};
use super::texel_words::TexelLayout;
use crate::layout;
use lumbre_light::film::layer::{Layer, LayerLayout};
use lumbre_light::film::time::TimeFilter;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::NONE;
use lumbre_light::transport::camera::Camera;
use lumbre_light::transport::integrator::Settings;
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::mis::Heuristic;
use lumbre_light::transport::vertex::least_extent;

/// Returns the parameters of a job. Each group of fields has a function of its own.
pub(super) fn job_params(
    scene: &CompiledScene,
    job: &lumbre_render::Job,
    lights: &Lights,
    layers: &LayerLayout,
    room: &SubpathRoom,
    emission: u32,
) -> layout::JobParams {
    let params = camera_params(scene, job);
    let params = geometry_params(params, scene);
    let params = light_params(params, scene, lights);
    let params = layer_params(params, layers);
    let params = layout::JobParams {
        light_path_count: light_path_count(job).unwrap_or(0),
        light_path_room: room.of_light_path,
        subpath_room: room.of_sample,
        subpath_slots: room.samples,
        ..params
    };
    time_params(params, job, emission)
}

/// Returns parameters with camera, limits, integrator settings and sampler; all others are zero.
fn camera_params(scene: &CompiledScene, job: &lumbre_render::Job) -> layout::JobParams {
    let camera = Camera::new(job.camera(scene), job.resolution, job.settings.filter);
    let settings = Settings::new(&job.settings.params);
    layout::JobParams {
        camera_position: camera.position.into(),
        camera_right: camera.right.into(),
        camera_up: camera.up.into(),
        camera_forward: camera.forward.into(),
        camera_half: camera.half,
        camera_center: camera.center,
        camera_kind: camera.kind as u32,
        resolution: job.resolution,
        lens_radius: camera.lens_radius,
        focus_distance: camera.focus_distance,
        filter_kind: job.settings.filter.kind as u32,
        filter_radius: job.settings.filter.radius,
        max_depth: job.max_depth,
        rr_start: job.settings.rr_start.unwrap_or(NONE),
        mis: match settings.mis {
            Some(Heuristic::Power) => 0,
            Some(Heuristic::Balance) => 1,
            Some(Heuristic::Uniform) => 2,
            None => NONE,
        },
        one_strategy: settings.one.unwrap_or([NONE; 2]),
        keep_strategy: settings.keep.into(),
        connections: settings.connections,
        candidates: settings.candidates,
        candidate_step: {
            let step = (1u128 << 64) / u128::from(settings.candidates.max(1));
            [step as u32, (step >> 32) as u32]
        },
        seed: [job.seed as u32, (job.seed >> 32) as u32],
        ..bytemuck::Zeroable::zeroed()
    }
}

/// Adds the numbers of primitives and the texel ranges of triangle corners.
fn geometry_params(params: layout::JobParams, scene: &CompiledScene) -> layout::JobParams {
    let texels = TexelLayout::new(scene);
    layout::JobParams {
        least_extent: least_extent(scene),
        triangle_count: scene.triangles.len() as u32,
        sphere_count: scene.spheres.len() as u32,
        has_tangents: u32::from(!scene.tangents.is_empty()),
        first_color: if scene.colors.is_empty() {
            NONE
        } else {
            texels.colors as u32
        },
        first_second_uv: match scene.second_uvs.is_empty() {
            true => NONE,
            false => texels.second_uvs as u32,
        },
        ..params
    }
}

/// Adds the lights and the environment.
fn light_params(
    params: layout::JobParams,
    scene: &CompiledScene,
    lights: &Lights,
) -> layout::JobParams {
    let environment = lights.environment_light.as_ref();
    let map = environment.and_then(|s| s.map.as_ref());
    layout::JobParams {
        light_count: lights.count() as u32,
        light_first: lights.first,
        alias_shift: lights.choice.as_ref().map_or(NONE, |alias| alias.shift),
        ball_center: lights.ball.center.into(),
        ball_radius: lights.ball.radius,
        has_environment: environment.is_some().into(),
        environment_texture: if map.is_some() {
            scene.textures.len() as u32
        } else {
            NONE
        },
        environment_radiance: environment.map_or([0.0; 3], |s| s.radiance.into()),
        environment_turn: map.map_or([0.0, 1.0], |m| m.directions.turn),
        ..params
    }
}

/// Adds the films of layers.
fn layer_params(params: layout::JobParams, layers: &LayerLayout) -> layout::JobParams {
    let first = |index: Option<usize>| index.map_or(NONE, |i| i as u32);
    layout::JobParams {
        film_count: layers.summed().len() as u32,
        light_films: layers.contribution_films() as u32,
        splat_films: layers.films().iter().filter(|film| film.splats).count() as u32,
        layer_depth: first(layers.depth(1)),
        layer_strategies: first(layers.strategy(0, 2)),
        layer_bounces: first(layers.single(Layer::Bounces)),
        layer_rays: first(layers.single(Layer::Rays)),
        layer_albedo: first(layers.single(Layer::Albedo)),
        layer_normal: first(layers.single(Layer::Normal)),
        layer_distance: first(layers.single(Layer::Distance)),
        ..params
    }
}

/// Adds the time axis, its filter and the emission profile of lights.
fn time_params(
    params: layout::JobParams,
    job: &lumbre_render::Job,
    emission: u32,
) -> layout::JobParams {
    let timing = job.settings.timing.as_ref();
    let axis = timing.map(|t| t.axis);
    let (filter, radius) = match timing.map_or(TimeFilter::None, |t| t.filter) {
        TimeFilter::None => (0, 0.0),
        TimeFilter::Box(radius) => (1, radius),
        TimeFilter::Gauss(sigma) => (2, sigma),
    };
    layout::JobParams {
        time_start: double_words(axis.map_or(0.0, |a| a.start)),
        time_bin: double_words(axis.map_or(1.0, |a| a.bin)),
        time_bins: axis.map_or(0, |a| a.bins),
        time_filter: filter,
        time_radius: double_words(radius),
        time_camera: timing.is_none_or(|t| t.camera).into(),
        time_medium: timing.map_or(1.0, |t| t.medium),
        time_emission: emission,
        ..params
    }
}
