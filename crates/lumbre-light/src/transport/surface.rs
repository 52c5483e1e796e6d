//! The surface at a hit: position, normals, texture coordinates, material.

use glam::{Vec2, Vec3};

use super::light::DirectSample;
use super::ray::{Hit, Ray, offset_origin};
use crate::math::real::{Real, Vector};
use crate::math::rng::{pcg4d, unit};
use crate::scene::CompiledScene;
use crate::scene::compile::{MaskMode, Material, NONE, Texture, Uv, UvMap};

/// A mapped normal that points behind the geometric surface is tilted until its cosine with the
/// geometric normal has this value.
const GRAZING_COSINE: f32 = 1e-3;

/// A point of a surface with everything that shading needs.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Position in world space, computed from the primitive rather than along the ray.
    pub position: Vec3,
    /// Unit normal of the primitive's front side, whichever side was hit.
    pub n_geometric: Vec3,
    /// Unit shading normal on the same side.
    pub n_shading: Vec3,
    /// World-space direction in which anisotropic highlights are stretched. Not normalised and not
    /// orthogonal to the normal; zero if the material has no direction or needs none.
    pub tangent: Vec3,
    /// Texture coordinates before tiling.
    pub uv: Uv,
    /// Product of the vertex colours and of the surface's tint, a factor on the base colour; white
    /// without any.
    pub tint: Vec3,
    /// The material at this point.
    pub material: &'a Material,
    /// Index into the scene's emitters, or [`NONE`].
    pub emitter: u32,
    /// Offset against the shadow terminator; `None` if the material does not enable it or this
    /// point needs none.
    pub terminator: Option<TerminatorOffset>,
}

/// Position and normals of a ray's intersection with a primitive; scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint<V> {
    /// Position in world space.
    pub position: V,
    /// Unit normal of the primitive on its front side.
    pub n_geometric: V,
    /// Unit shading normal on the same side, before any map.
    pub n_shading: V,
}

/// Material parameters at a point that textures may change; scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub struct ShadingParameters<R: Real = f32> {
    /// Base colour, vertex colours and tint included.
    pub base_color: R::Vec3,
    /// Perceptual roughness, 0..=1.
    pub roughness: R,
    /// 0 dielectric to 1 metal.
    pub metallic: R,
    /// 1 opaque to 0 refractive.
    pub opacity: R,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> SurfacePoint<V> {
    /// Computes a point of a triangle with these weights of its second and third corner. The normal
    /// of a triangle without area faces the ray.
    #[inline(always)]
    pub fn on_triangle(
        [a, b, c]: [V; 3],
        [na, nb, nc]: [V; 3],
        [v, w]: [R; 2],
        dir: V,
    ) -> SurfacePoint<V> {
        let u = R::splat(1.0) - v - w;
        let n_geometric = (b - a).cross(c - a).normalize_or(-dir);
        let n_shading = (na * u + nb * v + nc * w).normalize_or(n_geometric);
        SurfacePoint {
            position: a * u + b * v + c * w,
            n_geometric,
            n_shading,
        }
    }

    /// Computes the point of a sphere nearest to `at`.
    #[inline(always)]
    pub fn on_sphere(center: V, radius: R, at: V, dir: V) -> SurfacePoint<V> {
        let n = (at - center).normalize_or(-dir);
        SurfacePoint {
            position: center + n * radius,
            n_geometric: n,
            n_shading: n,
        }
    }
}

impl<'a> Surface<'a> {
    /// Builds the surface at a hit of `ray`. A composed material is used as a whole, as for the
    /// layers of the first surface; paths call
    /// [`PathTime::arrive`](super::path_time::PathTime::arrive), which chooses a part.
    #[inline]
    pub fn at(scene: &'a CompiledScene, ray: &Ray, hit: &Hit) -> Surface<'a> {
        Surface::with_material(
            scene,
            ray,
            hit,
            scene.material_of(hit.primitive, hit.instance),
        )
    }

    /// Builds the surface at a hit of `ray` with the given material row.
    #[inline]
    pub fn with_material(
        scene: &'a CompiledScene,
        ray: &Ray,
        hit: &Hit,
        material: u32,
    ) -> Surface<'a> {
        let i = hit.primitive as usize;
        let material = &scene.materials[material as usize];
        let mut surface = if i < scene.triangles.len() {
            let (corners, normals) = scene.triangle(hit.primitive, hit.instance);
            let SurfacePoint {
                position,
                n_geometric,
                n_shading,
            } = SurfacePoint::on_triangle(corners, normals, hit.uv, ray.dir);
            Surface {
                position,
                n_geometric,
                n_shading,
                tangent: Vec3::ZERO,
                uv: scene.uv_at(hit.primitive, hit.uv),
                tint: scene.tint_at(hit.primitive, hit.uv),
                material,
                emitter: scene.emitter_of(hit.primitive, hit.instance),
                terminator: None,
            }
        } else {
            let sphere = &scene.spheres[i - scene.triangles.len()];
            let at = ray.origin + ray.dir * hit.t;
            let SurfacePoint {
                position,
                n_geometric: n,
                ..
            } = SurfacePoint::on_sphere(sphere.center, sphere.radius, at, ray.dir);
            Surface {
                position,
                n_geometric: n,
                n_shading: n,
                tangent: Vec3::ZERO,
                uv: Uv::same(sphere_uv(n)),
                tint: Vec3::ONE,
                material,
                emitter: sphere.emitter,
                terminator: None,
            }
        };
        if surface.material.shadow_terminator && i < scene.triangles.len() {
            surface.terminator = surface.find_terminator_offset(scene, ray, hit);
        }
        let smooth = surface.n_shading;
        if surface.material.uses_tangents() {
            surface.orient(scene, hit);
        }
        if surface.material.bump_texture != NONE {
            surface.emboss(scene, hit, smooth);
        }
        surface
    }

    /// Computes the terminator offset at this point of a triangle: the point's projections onto the
    /// corners' tangent planes, interpolated [Vives], if they lie above the triangle on the side of
    /// the ray. Refractive materials have none, since a path that continues inside would hit the
    /// surface again.
    #[cold]
    fn find_terminator_offset(
        &self,
        scene: &CompiledScene,
        ray: &Ray,
        hit: &Hit,
    ) -> Option<TerminatorOffset> {
        let m = self.material;
        let opaque = m.opacity >= 1.0 && m.opacity_texture == NONE;
        if !opaque && (m.metallic < 1.0 || m.metallic_texture != NONE) {
            return None;
        }
        let [v, w] = hit.uv;
        let weights = [1.0 - v - w, v, w];
        let mut lift = Vec3::ZERO;
        let (corners, normals) = scene.triangle(hit.primitive, hit.instance);
        for ((weight, corner), n) in weights.into_iter().zip(corners).zip(normals) {
            lift -= n * ((self.position - corner).dot(n) * weight);
        }
        let up = if ray.dir.dot(self.n_geometric) < 0.0 {
            self.n_geometric
        } else {
            -self.n_geometric
        };
        (lift.dot(up) > 0.0).then(|| TerminatorOffset {
            base: self.position,
            lifted_point: offset_origin(self.position + lift, up),
            up,
            lifted: false,
        })
    }

    /// Returns this surface as the start of edges from the lifted point, if it has one. Such edges
    /// cannot be found by chance from their other end; the zero normal makes every density of
    /// arriving here zero.
    #[inline]
    pub fn lifted(&self) -> Option<Surface<'a>> {
        let terminator = TerminatorOffset {
            lifted: true,
            ..self.terminator?
        };
        Some(Surface {
            position: terminator.lifted_point,
            n_geometric: Vec3::ZERO,
            terminator: Some(terminator),
            ..*self
        })
    }

    /// Returns the terminator offset if an edge in direction `dir` leaves from the lifted point.
    #[inline]
    pub fn terminator_into(&self, dir: Vec3) -> Option<TerminatorOffset> {
        self.terminator.filter(|o| o.applies_to(dir))
    }

    /// Applies the normal map and determines the direction of anisotropy.
    #[cold]
    fn orient(&mut self, scene: &CompiledScene, hit: &Hit) {
        let m = self.material;
        let i = hit.primitive as usize;
        // MikkTSpace decodes with interpolated vectors that are not normalised.
        let mut n_axis = self.n_shading;
        let (u_axis, v_axis) = if i < scene.triangles.len() {
            let [v, w] = hit.uv;
            let u = 1.0 - v - w;
            let t = scene.tangents_at(hit.primitive, hit.instance);
            let n = scene.triangle(hit.primitive, hit.instance).1;
            n_axis = n[0] * u + n[1] * v + n[2] * w;
            let across = |k: usize| n[k].cross(t[k].truncate()) * t[k].w;
            let along = t[0] * u + t[1] * v + t[2] * w;
            (
                along.truncate(),
                across(0) * u + across(1) * v + across(2) * w,
            )
        } else {
            let n = self.n_shading;
            let east = Vec3::new(n.z, 0.0, -n.x).normalize_or_zero();
            (east, n.cross(east))
        };
        if m.normal_texture != NONE && u_axis != Vec3::ZERO {
            let texel = lookup(&scene.textures, m.normal_texture, self.uv, m.tiling) * 2.0 - 1.0;
            let n = u_axis * (texel.x * m.normal_strength)
                + v_axis * (texel.y * m.normal_strength)
                + n_axis * texel.z;
            self.n_shading = self.in_front(n.normalize_or(self.n_shading));
        }
        self.tangent = if m.anisotropic_texture != NONE {
            let texel =
                lookup(&scene.textures, m.anisotropic_texture, self.uv, m.tiling) * 2.0 - 1.0;
            u_axis * texel.x + v_axis * texel.y
        } else if m.anisotropic_direction != Vec3::ZERO {
            m.anisotropic_direction
        } else {
            u_axis
        };
    }

    /// Tilts the normal by the slopes of the bump map, as if every point were displaced along the
    /// smooth normal by the map's height [Blinn 1978], for small heights: n - grad h, with the
    /// gradient along the surface [Mikkelsen 2010].
    ///
    /// Heights are linear along the world-space edges of the triangle, so the gradient needs no
    /// tangents, and stretched, sheared or mirrored texture coordinates are handled correctly.
    /// Slopes are differences over one texel about the point: they are continuous, whereas the
    /// derivatives of the interpolated map are discontinuous at the middles of texels. If there is
    /// a normal map as well, the slopes of both add.
    #[cold]
    fn emboss(&mut self, scene: &CompiledScene, hit: &Hit, smooth: Vec3) {
        let m = self.material;
        let map = &scene.textures[m.bump_texture as usize];
        let place = map.image_uv(self.uv, m.tiling);
        let texel = Vec2::new(1.0 / map.width as f32, 1.0 / map.height as f32);
        let rise =
            |step: Vec2| map.bilinear(place + step * 0.5).x - map.bilinear(place - step * 0.5).x;
        let slopes =
            Vec2::new(rise(Vec2::new(texel.x, 0.0)), rise(Vec2::new(0.0, texel.y))) / texel;
        // Slopes along the map's own coordinates, then along those of the surface.
        let slopes = map
            .lookup
            .map
            .map_or(slopes, |map| map.matrix2.transpose() * slopes);
        let slopes = slopes * (m.tiling.scale * m.bump_height);
        let i = hit.primitive as usize;
        let (edges, rises) = if i < scene.triangles.len() {
            let [a, b, c] = scene.corners(hit.primitive, hit.instance);
            let second = scene.second_uvs.get(i).filter(|_| map.lookup.second);
            let [ta, tb, tc] = *second.unwrap_or(&scene.attributes[i].uvs);
            ([b - a, c - a], [slopes.dot(tb - ta), slopes.dot(tc - ta)])
        } else {
            let along = scene.spheres[i - scene.triangles.len()].radius * std::f32::consts::PI;
            let east = Vec3::new(smooth.z, 0.0, -smooth.x);
            let north = smooth.cross(east.normalize_or_zero());
            ([east * (2.0 * along), north * along], slopes.to_array())
        };
        let gradient = (edges[1] * rises[0] - edges[0] * rises[1]).cross(smooth)
            / smooth.dot(edges[0].cross(edges[1]));
        let n = self.n_shading - gradient * self.n_shading.dot(smooth).max(0.0);
        self.n_shading = self.in_front(n.normalize_or(self.n_shading));
    }

    /// Returns a unit normal tilted to the front of the triangle.
    fn in_front(&self, n: Vec3) -> Vec3 {
        let behind = n.dot(self.n_geometric) - GRAZING_COSINE;
        if behind < 0.0 {
            (n - self.n_geometric * behind).normalize_or(self.n_geometric)
        } else {
            n
        }
    }

    /// Returns the radiance emitted towards `wo`: the material's emission on the front side, black
    /// behind.
    #[inline]
    pub fn emitted(&self, textures: &[Texture], wo: Vec3) -> Vec3 {
        if self.emitter == NONE || self.n_geometric.dot(wo) <= 0.0 {
            return Vec3::ZERO;
        }
        self.material.emission
            * lookup(
                textures,
                self.material.emission_texture,
                self.uv,
                self.material.tiling,
            )
    }

    /// Returns whether a path that hits this surface ends there: a light that does not reflect.
    #[inline]
    pub fn ends_paths(&self) -> bool {
        self.emitter != NONE && !self.material.emitter_reflects
    }

    /// Returns the base colour.
    #[inline]
    pub fn base_color(&self, textures: &[Texture]) -> Vec3 {
        let m = self.material;
        m.base_color * self.tint * lookup(textures, m.base_color_texture, self.uv, m.tiling)
    }

    /// Returns the values of the material's textures at this point.
    #[inline]
    pub fn shading_parameters(&self, textures: &[Texture]) -> ShadingParameters {
        let m = self.material;
        let scalar = |texture, value| lookup_scalar(textures, texture, self.uv, m.tiling, value);
        ShadingParameters {
            base_color: self.base_color(textures),
            roughness: scalar(m.roughness_texture, m.roughness),
            metallic: scalar(m.metallic_texture, m.metallic),
            opacity: scalar(m.opacity_texture, m.opacity),
        }
    }

    /// Returns a ray in direction `dir`, started off the surface on the side of `dir`.
    #[inline]
    pub fn spawn(&self, dir: Vec3) -> Ray {
        if let Some(terminator) = self.terminator_into(dir) {
            return Ray {
                origin: terminator.lifted_point,
                dir,
            };
        }
        let side = if dir.dot(self.n_geometric) < 0.0 {
            -self.n_geometric
        } else {
            self.n_geometric
        };
        Ray {
            origin: offset_origin(self.position, side),
            dir,
        }
    }
}

/// An offset of shadow and path rays against the shadow terminator: the hard edge where light
/// arrives from below the triangle's plane but above the tangent plane of the shading normal. The
/// corner normals suggest a smooth surface above the triangle; rays towards such light start from
/// the lifted point on that surface.
///
/// The source lifts every point before it is shaded [Vives], so an edge has different ends when it
/// is traced from its other end, and techniques that trace light from both sides disagree. Here the
/// vertices of a path stay in place. Only an edge towards light whose far end lies below the
/// triangle's plane, which could carry nothing otherwise, starts at the lifted point. All
/// techniques agree on that, since
/// - every other edge is the same as without the offset, so far ends above the plane are reached
///   from the base only;
/// - an edge from the lifted point is allowed towards light, at the vertex nearer to the camera,
///   and not the other way;
/// - no technique can find it from its far end by chance, so that this density is zero in all
///   weights.
///
/// The remaining bias is intended: a surface is lit where its triangles would hide the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerminatorOffset {
    /// The point of the triangle.
    pub base: Vec3,
    /// The lifted point, already moved off the surface.
    pub lifted_point: Vec3,
    /// Unit normal of the triangle on the side of the lifted point.
    pub up: Vec3,
    /// Whether this describes edges from the lifted point rather than from the base.
    pub lifted: bool,
}

impl TerminatorOffset {
    /// Returns whether an edge in this direction leaves from the lifted point, provided that its
    /// far end [is below the plane](Self::has_below).
    #[inline]
    pub fn applies_to(&self, dir: Vec3) -> bool {
        dir.dot(self.up) <= 0.0
    }

    /// Returns whether a point lies below the triangle's plane.
    #[inline]
    pub fn has_below(&self, point: Vec3) -> bool {
        (point - self.base).dot(self.up) <= 0.0
    }

    /// Returns whether a light sample belongs to the other one of base and lifted point.
    #[inline]
    pub fn excludes(&self, direct: &DirectSample) -> bool {
        let below = if direct.distance.is_finite() {
            self.has_below(direct.point.position)
        } else {
            self.applies_to(direct.wi)
        };
        below != self.lifted
    }
}

/// Returns a texture's colour at texture coordinates, or white without a texture.
#[inline]
pub fn lookup(textures: &[Texture], texture: u32, uv: Uv, tiling: UvMap) -> Vec3 {
    if texture == NONE {
        return Vec3::ONE;
    }
    let texture = &textures[texture as usize];
    texture.bilinear(texture.image_uv(uv, tiling))
}

/// Returns a texture's red channel at texture coordinates, or `scalar` without a texture.
#[inline]
pub fn lookup_scalar(
    textures: &[Texture],
    texture: u32,
    uv: Uv,
    tiling: UvMap,
    scalar: f32,
) -> f32 {
    if texture == NONE {
        scalar
    } else {
        lookup(textures, texture, uv, tiling).x
    }
}

/// Returns the texture coordinates at a hit of `ray`.
#[inline]
fn uv_at(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> Uv {
    match (hit.primitive as usize).checked_sub(scene.attributes.len()) {
        None => scene.uv_at(hit.primitive, hit.uv),
        Some(i) => {
            let sphere = &scene.spheres[i];
            Uv::same(sphere_uv(
                (ray.origin + ray.dir * hit.t - sphere.center).normalize_or(-ray.dir),
            ))
        }
    }
}

/// Returns the coverage of a material's mask at texture coordinates: 0 or 1 if the mask is compared
/// with a threshold, the mask itself if it is blended. Equals the expected result of
/// [`is_masked_out`].
#[inline]
pub fn coverage(textures: &[Texture], m: &Material, uv: Uv) -> f32 {
    if m.mask_texture == NONE {
        return 1.0;
    }
    let mask = lookup(textures, m.mask_texture, uv, m.tiling).x;
    match m.mask_mode {
        MaskMode::Threshold => f32::from(u8::from(mask >= m.mask_threshold)),
        MaskMode::Blend => mask.clamp(0.0, 1.0),
    }
}

/// Returns whether the mask of the hit material leaves a hole at the hit.
///
/// In blend mode a hash of the ray and of the primitive decides, so that the same ray always finds
/// the same holes on any thread, while rays of different samples see the mask's value on average.
pub fn is_masked_out(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> bool {
    let m = &scene.materials[scene.material_of(hit.primitive, hit.instance) as usize];
    if m.mask_texture == NONE {
        return false;
    }
    let covered = coverage(&scene.textures, m, uv_at(scene, ray, hit));
    match m.mask_mode {
        MaskMode::Threshold => covered == 0.0,
        MaskMode::Blend => {
            let [x, y, z] = ray.dir.to_array().map(f32::to_bits);
            let directed = pcg4d([x, y, z, scene.unique_id(hit.primitive, hit.instance)]);
            let [x, y, z] = ray.origin.to_array().map(f32::to_bits);
            unit(
                pcg4d([
                    x ^ directed[0],
                    y ^ directed[1],
                    z ^ directed[2],
                    directed[3],
                ])[0],
            ) >= covered
        }
    }
}

/// Returns texture coordinates on a sphere: longitude about y in u, from the south pole to the
/// north pole in v.
#[inline]
pub fn sphere_uv(n: Vec3) -> Vec2 {
    let longitude = n.x.atan2(n.z) / std::f32::consts::TAU + 0.5;
    let latitude = n.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
    Vec2::new(longitude, 1.0 - latitude)
}
