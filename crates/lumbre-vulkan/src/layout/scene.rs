//! Structs of a scene that shaders read.

super::gpu_structs! {
    /// Corners of a triangle in world space, counter-clockwise seen from its front.
    pub struct Triangle {
        /// Position of the first corner.
        a: [f32; 3],
        /// Position of the second corner, weight `hit.uv.x`.
        b: [f32; 3],
        /// Position of the third corner, weight `hit.uv.y`.
        c: [f32; 3],
    }

    /// Shading attributes of a triangle.
    pub struct TriangleAttributes {
        /// Unit shading normal at the first corner.
        na: [f32; 3],
        /// Unit shading normal at the second corner.
        nb: [f32; 3],
        /// Unit shading normal at the third corner.
        nc: [f32; 3],
        /// Texture coordinates at the first corner.
        ta: [f32; 2],
        /// Texture coordinates at the second corner.
        tb: [f32; 2],
        /// Texture coordinates at the third corner.
        tc: [f32; 2],
        /// Index into `materials`.
        material: u32,
        /// Index into `emitters`, or NONE.
        emitter: u32,
    }

    /// MikkTSpace tangents of a triangle: a unit vector and in `w` the sign of the bitangent.
    pub struct Tangents {
        /// Tangent at the first corner.
        a: [f32; 4],
        /// Tangent at the second corner.
        b: [f32; 4],
        /// Tangent at the third corner.
        c: [f32; 4],
    }

    /// Analytic sphere; its front is the outside.
    pub struct Sphere {
        /// Centre in world space.
        center: [f32; 3],
        /// Radius of the sphere, positive.
        radius: f32,
        /// Index into `materials`.
        material: u32,
        /// Index into `emitters`, or NONE.
        emitter: u32,
    }

    /// Material, as `scene::compile::Material`.
    pub struct Material {
        /// Base colour, linear.
        base_color: [f32; 3],
        /// Emitted radiance of the front side.
        emission: [f32; 3],
        /// MODEL_DISNEY and so on.
        model: u32,
        /// Perceptual roughness of the surface.
        roughness: f32,
        /// 0 dielectric to 1 metal.
        metallic: f32,
        /// 1 opaque to 0 refractive.
        opacity: f32,
        /// Share of the light that MODEL_TRANSLUCENT transmits.
        transmittance: [f32; 3],
        /// Index of refraction relative to the outside.
        ior: f32,
        /// Fraction of the flatter diffuse lobe.
        subsurface: f32,
        /// Hue in the dielectric's reflectance at normal incidence.
        specular_tint: f32,
        /// Stretch of highlights.
        anisotropic: f32,
        /// World-space direction of the stretch; zero is the direction of growing u.
        anisotropic_direction: [f32; 3],
        /// Strength of the sheen.
        sheen: f32,
        /// Hue of the sheen.
        sheen_tint: f32,
        /// Strength of the clear coat.
        clearcoat: f32,
        /// Gloss of the clear coat.
        clearcoat_gloss: f32,
        /// Roughness below which specular lobes are Dirac lobes.
        smooth_below: f32,
        /// 1 if opaque lobes are missing at the back, else 0.
        one_sided: u32,
        /// Factor on the slope of the normal map.
        normal_strength: f32,
        /// Displacement of the value 1 in the bump map, in scene units.
        bump_height: f32,
        /// Mask values below this are holes.
        mask_threshold: f32,
        /// MASK_THRESHOLD or MASK_BLEND.
        mask_mode: u32,
        /// 1 if paths leave opaque triangles from the surface that their normals suggest, else 0.
        shadow_terminator: u32,
        /// Texture that multiplies `base_color`, or NONE.
        base_color_texture: u32,
        /// Texture that multiplies `emission`, or NONE.
        emission_texture: u32,
        /// Texture whose red channel is the mask, or NONE.
        mask_texture: u32,
        /// Texture whose red channel replaces `roughness`, or NONE.
        roughness_texture: u32,
        /// Texture whose red channel replaces `metallic`, or NONE.
        metallic_texture: u32,
        /// Texture whose red channel replaces `opacity`, or NONE.
        opacity_texture: u32,
        /// Texture that multiplies `transmittance`, or NONE.
        transmittance_texture: u32,
        /// Texture of directions in the tangent frame, or NONE.
        anisotropic_texture: u32,
        /// Normal map, or NONE.
        normal_texture: u32,
        /// Texture whose red channel is a height, or NONE.
        bump_texture: u32,
        /// Factor from texture coordinates to positions in the textures.
        tiling_scale: f32,
        /// Offset of these positions, in repeats.
        tiling_offset: [f32; 2],
        /// 1 if the surface of a light also reflects, else 0.
        emitter_reflects: u32,
        /// Factor on the light that an interface reflects.
        specular: [f32; 3],
        /// Real part of a metal's index by channel.
        eta: [f32; 3],
        /// Imaginary part of a metal's index by channel.
        k: [f32; 3],
        /// DISTRIBUTION_GGX or DISTRIBUTION_BECKMANN.
        distribution: u32,
        /// 1 if a dielectric is a thin pane, else 0.
        thin: u32,
        /// FORMULAS_LUMBRE or FORMULAS_MITSUBA.
        formulas: u32,
        /// 1 if texels of the roughness texture are alpha, the square of roughness, else 0.
        alpha_texels: u32,
        /// 1 if light passes the interface of plastic as its microfacets let it, else 0.
        rough_body: u32,
        /// Transmittance of the microfacets at cosine 0, and its slopes up to the fourth knot.
        transmittance_grazing: [f32; 4],
        /// Its slopes up to the eighth knot.
        transmittance_middle: [f32; 4],
        /// Its slopes up to the last knot.
        transmittance_steep: [f32; 4],
        /// 1 if light that is reflected back inside plastic is tinted each time, else 0.
        nonlinear: u32,
        /// Fraction of diffuse light that is reflected back at the inside of plastic.
        internal_reflectance: f32,
        /// First row in `material_parts` of a composed or delayed material and number of rows; none
        /// for others.
        parts: [u32; 2],
    }

    /// Component of a composed or delayed material.
    pub struct MaterialPart {
        /// Sum of the weights up to this component; exactly 1 for the last one.
        upto: f32,
        /// Index into `materials`.
        material: u32,
        /// First row in `delay_profiles` and number of rows: their delays add up.
        profiles: [u32; 2],
    }

    /// Delay profile: each of its one or two parameters is `offset + value * texture`.
    pub struct DelayProfile {
        /// DELAY_NONE and so on.
        kind: u32,
        /// Factors on the textures.
        value: [f32; 2],
        /// Offsets that are added.
        offset: [f32; 2],
        /// Textures whose red channel is used, or NONE.
        textures: [u32; 2],
        /// Factor from texture coordinates to positions in the textures.
        tiling_scale: f32,
        /// Offset of these positions, in repeats.
        tiling_offset: [f32; 2],
        /// First row in `knots` of a table and number of rows.
        knots: [u32; 2],
    }

    /// Knot of a tabulated density, as words of double precision, low word first.
    pub struct Knot {
        /// Delay in scene units.
        x: [u32; 2],
        /// Density in 1 / scene unit.
        density: [u32; 2],
        /// Probability of smaller delays.
        below: [u32; 2],
    }

    /// Texture: texels `[y][x]` from word `first` on, origin at the top left.
    pub struct Texture {
        /// Index of the first word of the texels.
        first: u32,
        /// If a texel is a word, of four bytes, the index of the first of 256 linear values that a
        /// byte means; NONE if a texel is three words, which are linear floats.
        table: u32,
        /// Width in texels.
        width: u32,
        /// Height in texels.
        height: u32,
        /// Wrap mode along u and v: WRAP_REPEAT and so on.
        wrap: [u32; 2],
        /// 1 if the filter is `nearest`, 0 if it is bilinear.
        nearest: u32,
        /// 1 if the second set of texture coordinates is used, else 0.
        second: u32,
        /// 1 if coordinates are transformed by the map below, else 0.
        moved: u32,
        /// Image of the u axis under the map.
        map_u: [f32; 2],
        /// Image of the v axis under the map.
        map_v: [f32; 2],
        /// Image of (0, 0) under the map.
        map_origin: [f32; 2],
    }

    /// Emissive primitive of the scene.
    pub struct Emitter {
        /// Primitive index: triangles first, spheres after them.
        primitive: u32,
        /// Instance of a mesh that it belongs to, or NONE.
        instance: u32,
        /// Area in square scene units.
        area: f32,
    }

    /// Placement of an instance of a mesh: `scene::compile::Instance`. Words of doubles, low one
    /// first.
    pub struct Placement {
        /// World-space image of the mesh's x axis: its x.
        xx: [u32; 2],
        /// Its y coordinate.
        xy: [u32; 2],
        /// Its z coordinate.
        xz: [u32; 2],
        /// World-space image of the mesh's y axis: its x.
        yx: [u32; 2],
        /// Its y coordinate.
        yy: [u32; 2],
        /// Its z coordinate.
        yz: [u32; 2],
        /// World-space image of the mesh's z axis: its x.
        zx: [u32; 2],
        /// Its y coordinate.
        zy: [u32; 2],
        /// Its z coordinate.
        zz: [u32; 2],
        /// World-space position of the mesh's origin: its x.
        tx: [u32; 2],
        /// Its y coordinate.
        ty: [u32; 2],
        /// Its z coordinate.
        tz: [u32; 2],
        /// Maps the mesh's normals to world space: first column.
        normal_x: [f32; 3],
        /// Second column of the matrix.
        normal_y: [f32; 3],
        /// Third column of the matrix.
        normal_z: [f32; 3],
        /// Row in `triangles` of the mesh's first triangle.
        start: u32,
        /// First row in `place_materials`.
        materials: u32,
        /// Row in `emitters` of its first emissive triangle.
        emitters: u32,
        /// Index of its first triangle in the flattened scene.
        first: u32,
    }

    /// Transform of rays into the space of an instance's mesh:
    /// `render::instance_transform::InstanceTransform`.
    pub struct InstanceTransform {
        /// Maps directions of the world to those of the mesh: first column.
        inverse_x: [f32; 3],
        /// Second column of the matrix.
        inverse_y: [f32; 3],
        /// Third column of the matrix.
        inverse_z: [f32; 3],
        /// Middle of the mesh's box in world space.
        pivot_world: [f32; 3],
        /// Middle of the mesh's box in the mesh's space.
        pivot_own: [f32; 3],
        /// First node of the mesh's tree.
        root: u32,
    }

    /// Point light that shines in all directions, into a cone, or as a map states.
    pub struct PointLight {
        /// Position in world space.
        position: [f32; 3],
        /// Radiant intensity along the axis.
        intensity: [f32; 3],
        /// Axis of the cone, a unit vector.
        axis: [f32; 3],
        /// Angle in radians up to which the intensity is full.
        beam: f32,
        /// Angle in radians from which on the intensity is zero.
        cutoff: f32,
        /// One minus the cosine of `beam`.
        beam_height: f32,
        /// One minus the cosine of `cutoff`; 2 is all directions.
        cutoff_height: f32,
        /// 1 if the intensity falls off with the square of a term linear in the cosine, 0 if
        /// linearly with the angle.
        is_smooth: u32,
        /// Texture that multiplies the intensity by direction, or NONE.
        map: u32,
        /// Sine and cosine of the rotation about +y of a map of all directions.
        turn: [f32; 2],
        /// Vector whose product with a direction, over the cosine to the axis, is 1 at the right edge
        /// of an image across the axis; zero for a map of all directions.
        right: [f32; 3],
        /// The same for the upper edge.
        up: [f32; 3],
        /// 1 if the intensity of an image is divided by the cube of the cosine to the axis.
        is_even: u32,
    }

    /// Directional light from infinity.
    pub struct DirectionalLight {
        /// Unit direction in which the light travels.
        direction: [f32; 3],
        /// Irradiance on a surface that faces the light.
        irradiance: [f32; 3],
    }
}
