//! Structs of a job that shaders read: everything that is constant over its samples.

super::gpu_structs! {
    /// Column of the alias table that `transport::light::Lights` selects lights with, and a light's
    /// probability.
    pub struct LightChoice {
        /// Number of the column's steps that select its own light.
        own: u32,
        /// Light that the other steps select.
        above: u32,
        /// Probability of the light with this index; 0 for columns that have no light.
        pmf: f32,
    }

    /// Row of an environment map with its cumulative probability.
    pub struct EnvironmentRow {
        /// Cumulative probability after this row.
        marginal: f32,
        /// Cosine of the polar angle at the upper edge.
        upper: f32,
        /// Cosine at the lower edge minus cosine at the upper one: negative.
        step: f32,
        /// One minus the absolute cosine at the upper edge, exact near the poles.
        upper_rest: f32,
        /// Number of columns divided by the solid angle of the row: the density of a cell per solid
        /// angle is its probability times this.
        density: f32,
    }

    /// Everything that is constant over the samples: camera, limits, settings, lights.
    pub struct JobParams {
        /// Position of the camera in world space.
        camera_position: [f32; 3],
        /// Unit vector to the picture's right.
        camera_right: [f32; 3],
        /// Unit vector to the picture's top.
        camera_up: [f32; 3],
        /// Unit vector along the optical axis.
        camera_forward: [f32; 3],
        /// Half extent of the picture, horizontally and vertically: at distance 1; of an
        /// orthographic camera in scene units; of a spherical one in radians.
        camera_half: [f32; 2],
        /// Vector from the axis to the middle of the picture, in the unit of `camera_half`.
        camera_center: [f32; 2],
        /// CAMERA_PERSPECTIVE and so on.
        camera_kind: u32,
        /// Width and height in pixels.
        resolution: [u32; 2],
        /// Radius of the lens; 0 is a pinhole.
        lens_radius: f32,
        /// Distance of the plane of focus.
        focus_distance: f32,
        /// FILTER_BOX and so on.
        filter_kind: u32,
        /// Half width of the filter in pixels.
        filter_radius: f32,
        /// Maximum number of path edges.
        max_depth: u32,
        /// First path edge after which roulette may end a path, or NONE.
        rr_start: u32,
        /// MIS_POWER, MIS_BALANCE, or NONE.
        mis: u32,
        /// Strategy (s, t) that is selected or left out; NONE, NONE for all.
        one_strategy: [u32; 2],
        /// 1 if only that strategy is used, 0 if it is left out.
        keep_strategy: u32,
        /// Number of light subpaths of an iteration; 0 if samples share none.
        light_path_count: u32,
        /// Number of vertices for which each of them has room.
        light_path_room: u32,
        /// Number of vertices for which a sample has room, of all subpaths that it traces.
        subpath_room: u32,
        /// Number of samples that have that room at the same time.
        subpath_slots: u32,
        /// Number of connections of a camera vertex with drawn light vertices.
        connections: u32,
        /// Number of vertices that are drawn for each connection.
        candidates: u32,
        /// Low and high word of 2^64 divided by that number, rounded down; 0 if it is 1.
        candidate_step: [u32; 2],
        /// Low and high word of the seed.
        seed: [u32; 2],
        /// Least extent of primitives: see `offset_origin`.
        least_extent: f32,
        /// Number of triangles: primitive indices from here on are spheres.
        triangle_count: u32,
        /// Number of spheres.
        sphere_count: u32,
        /// 1 if `tangents` has a row for every triangle, else 0.
        has_tangents: u32,
        /// First word of three texels of floats for each triangle that multiply base colours at its
        /// corners, or NONE.
        first_color: u32,
        /// First word of three texels of floats for each triangle that hold its second texture
        /// coordinates, or NONE.
        first_second_uv: u32,
        /// Number of lights.
        light_count: u32,
        /// Indices of the first point light, directional light and environment among the lights.
        light_first: [u32; 3],
        /// Binary logarithm of the steps of a column in `light_choices`; NONE if there is nothing
        /// to select.
        alias_shift: u32,
        /// Centre of the ball around all surfaces.
        ball_center: [f32; 3],
        /// Radius of that ball; 0 without surfaces.
        ball_radius: f32,
        /// 1 if there is an environment, else 0.
        has_environment: u32,
        /// Texture of the environment, or NONE if it is constant.
        environment_texture: u32,
        /// Radiance, or factor on the texture.
        environment_radiance: [f32; 3],
        /// Sine and cosine of its rotation about +y.
        environment_turn: [f32; 2],
        /// Number of layer films per pixel.
        film_count: u32,
        /// Number of them that are made of contributions; they come first.
        light_films: u32,
        /// Number of them that receive splats.
        splat_films: u32,
        /// First film of the layer `depth`, or NONE.
        layer_depth: u32,
        /// First film of the layer `strategies`, or NONE.
        layer_strategies: u32,
        /// Film of the layer `bounces`, or NONE.
        layer_bounces: u32,
        /// Film of the layer `rays`, or NONE.
        layer_rays: u32,
        /// Film of the layer `albedo`, or NONE.
        layer_albedo: u32,
        /// Film of the layer `normal`, or NONE.
        layer_normal: u32,
        /// Film of the layer `distance`, or NONE.
        layer_distance: u32,
        /// Start of the first bin of the time axis, in scene units: a double, low word first.
        time_start: [u32; 2],
        /// Width of a bin, in scene units: a double, low word first.
        time_bin: [u32; 2],
        /// Number of bins; 0 without a time axis.
        time_bins: u32,
        /// TIME_FILTER_NONE and so on.
        time_filter: u32,
        /// Half width of the box or sigma of the Gaussian in bins: a double, low word first.
        time_radius: [u32; 2],
        /// 1 if the first path segment from the camera counts, else 0.
        time_camera: u32,
        /// Index of refraction of the medium around the camera.
        time_medium: f32,
        /// Row in `delay_profiles` of the emission profile of lights, or NONE if they emit
        /// instantaneously.
        time_emission: u32,
    }
}
