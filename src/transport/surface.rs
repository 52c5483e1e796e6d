//! From a hit to the surface that was hit.

use glam::{Vec2, Vec3};

use super::light::DirectSample;
use super::ray::{Hit, Ray, offset_origin};
use crate::math::real::{Real, Vector};
use crate::math::rng::{pcg4d, unit};
use crate::scene::CompiledScene;
use crate::scene::compile::{MaskMode, Material, NONE, Texture, Uv, UvMap};

/// A normal from a normal or bump map that points behind the real surface is tilted until its cosine with it is this.
const GRAZING_COSINE: f32 = 1e-3;

/// A point on a surface with what shading needs of it.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Position in world space, computed from the primitive rather than from the ray.
    pub position: Vec3,
    /// Unit normal of the primitive on its front side, whichever side was hit.
    pub n_geometric: Vec3,
    /// Unit shading normal on the same side.
    pub n_shading: Vec3,
    /// World-space direction of the stretch of anisotropic highlights; not a unit vector, not orthogonal to the normal,
    /// and zero where the material does not say or does not need any.
    pub tangent: Vec3,
    /// Texture coordinates before tiling.
    pub uv: Uv,
    /// What the colours of vertices make of the base colour; white without any.
    pub tint: Vec3,
    /// The material row.
    pub material: &'a Material,
    /// Index into the scene's emitters, or [`NONE`].
    pub emitter: u32,
    /// Where edges towards light leave that the triangle itself would hide; `None` for all others, and where the material
    /// does not ask for it.
    pub overhang: Option<Overhang>,
}

/// Where a ray met a primitive, for any number of rays.
#[derive(Clone, Copy, Debug)]
pub struct Point<V> {
    /// Position in world space.
    pub position: V,
    /// Unit normal of the primitive on its front side.
    pub n_geometric: V,
    /// Unit shading normal on the same side, before any map.
    pub n_shading: V,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Point<V> {
    /// On a triangle, with these weights of its second and third corner. One without an area faces the ray.
    #[inline(always)]
    pub fn on_triangle([a, b, c]: [V; 3], [na, nb, nc]: [V; 3], [v, w]: [R; 2], dir: V) -> Point<V> {
        let u = R::of(1.0) - v - w;
        let n_geometric = (b - a).cross(c - a).normalize_or(-dir);
        let n_shading = (na * u + nb * v + nc * w).normalize_or(n_geometric);
        Point { position: a * u + b * v + c * w, n_geometric, n_shading }
    }

    /// On a sphere, near `at`.
    #[inline(always)]
    pub fn on_sphere(center: V, radius: R, at: V, dir: V) -> Point<V> {
        let n = (at - center).normalize_or(-dir);
        Point { position: center + n * radius, n_geometric: n, n_shading: n }
    }
}

impl<'a> Surface<'a> {
    /// The surface at a hit of `ray`. A composed material is shown as a whole, as layers of the first surface want it:
    /// paths take [`Flight::arrive`](super::flight::Flight::arrive), which chooses a part.
    #[inline]
    pub fn at(scene: &'a CompiledScene, ray: &Ray, hit: &Hit) -> Surface<'a> {
        Surface::of_material(scene, ray, hit, scene.material_of(hit.primitive, hit.instance))
    }

    /// The surface at a hit of `ray` with the material of this row.
    #[inline]
    pub fn of_material(scene: &'a CompiledScene, ray: &Ray, hit: &Hit, material: u32) -> Surface<'a> {
        let i = hit.primitive as usize;
        let material = &scene.materials[material as usize];
        let mut surface = if i < scene.triangles.len() {
            let (corners, normals) = scene.triangle(hit.primitive, hit.instance);
            let Point { position, n_geometric, n_shading } = Point::on_triangle(corners, normals, hit.uv, ray.dir);
            Surface {
                position,
                n_geometric,
                n_shading,
                tangent: Vec3::ZERO,
                uv: scene.uv_at(hit.primitive, hit.uv),
                tint: scene.tint_at(hit.primitive, hit.uv),
                material,
                emitter: scene.emitter_of(hit.primitive, hit.instance),
                overhang: None,
            }
        } else {
            let sphere = &scene.spheres[i - scene.triangles.len()];
            let at = ray.origin + ray.dir * hit.t;
            let Point { position, n_geometric: n, .. } = Point::on_sphere(sphere.center, sphere.radius, at, ray.dir);
            Surface {
                position,
                n_geometric: n,
                n_shading: n,
                tangent: Vec3::ZERO,
                uv: Uv::same(sphere_uv(n)),
                tint: Vec3::ONE,
                material,
                emitter: sphere.emitter,
                overhang: None,
            }
        };
        if surface.material.shadow_terminator && i < scene.triangles.len() {
            surface.overhang = surface.find_overhang(scene, ray, hit);
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

    /// The smooth surface above this point of a triangle, where the corner normals suggest one on the side the ray came
    /// from: the point's projections onto the corners' tangent planes, interpolated [Vives]. Refractive materials have
    /// none, since a path that goes on inside would meet the surface again.
    #[cold]
    fn find_overhang(&self, scene: &CompiledScene, ray: &Ray, hit: &Hit) -> Option<Overhang> {
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
        let up = if ray.dir.dot(self.n_geometric) < 0.0 { self.n_geometric } else { -self.n_geometric };
        (lift.dot(up) > 0.0).then(|| Overhang {
            base: self.position,
            crest: offset_origin(self.position + lift, up),
            up,
            raised: false,
        })
    }

    /// This surface as edges meet it that leave from the crest of its overhang, if it has one. They cannot be found from
    /// their other end by chance, which the normal zero says: every density of arriving here is zero.
    #[inline]
    pub fn raised(&self) -> Option<Surface<'a>> {
        let over = self.overhang?;
        let overhang = Some(Overhang { raised: true, ..over });
        Some(Surface { position: over.crest, n_geometric: Vec3::ZERO, overhang, ..*self })
    }

    /// The edge on which a path that came here goes on into `dir`, if that is one from the crest.
    #[inline]
    pub fn overhang_into(&self, dir: Vec3) -> Option<Overhang> {
        self.overhang.filter(|o| o.carries(dir))
    }

    /// Applies the normal map and finds the direction of anisotropy.
    #[cold]
    fn orient(&mut self, scene: &CompiledScene, hit: &Hit) {
        let m = self.material;
        let i = hit.primitive as usize;
        // MikkTSpace decodes with interpolated vectors that are not made unit vectors again.
        let mut n_axis = self.n_shading;
        let (u_axis, v_axis) = if i < scene.triangles.len() {
            let [v, w] = hit.uv;
            let u = 1.0 - v - w;
            let t = scene.tangents_at(hit.primitive, hit.instance);
            let n = scene.triangle(hit.primitive, hit.instance).1;
            n_axis = n[0] * u + n[1] * v + n[2] * w;
            let across = |k: usize| n[k].cross(t[k].truncate()) * t[k].w;
            let along = t[0] * u + t[1] * v + t[2] * w;
            (along.truncate(), across(0) * u + across(1) * v + across(2) * w)
        } else {
            let n = self.n_shading;
            let east = Vec3::new(n.z, 0.0, -n.x).normalize_or_zero();
            (east, n.cross(east))
        };
        if m.normal_texture != NONE && u_axis != Vec3::ZERO {
            let texel = lookup(&scene.textures, m.normal_texture, self.uv, m.tiling) * 2.0 - 1.0;
            let n = u_axis * (texel.x * m.normal_strength) + v_axis * (texel.y * m.normal_strength) + n_axis * texel.z;
            self.n_shading = self.in_front(n.normalize_or(self.n_shading));
        }
        self.tangent = if m.anisotropic_texture != NONE {
            let texel = lookup(&scene.textures, m.anisotropic_texture, self.uv, m.tiling) * 2.0 - 1.0;
            u_axis * texel.x + v_axis * texel.y
        } else if m.anisotropic_direction != Vec3::ZERO {
            m.anisotropic_direction
        } else {
            u_axis
        };
    }

    /// Tilts the normal by the slopes of the bump map, as if every point stood out along the smooth normal by what the map
    /// says [Blinn 1978], small heights assumed: n - grad h, with the gradient along the surface [Mikkelsen 2010].
    ///
    /// Heights are linear along the edges of the triangle as it lies in the world, so the gradient needs no tangents, and
    /// stretched, sheared or mirrored texture coordinates are right. Slopes are differences over one texel about the point:
    /// they are continuous, where the derivatives of the interpolated map jump at the middles of texels. Where there is a
    /// normal map as well, the slopes of both add.
    #[cold]
    fn emboss(&mut self, scene: &CompiledScene, hit: &Hit, smooth: Vec3) {
        let m = self.material;
        let map = &scene.textures[m.bump_texture as usize];
        let place = map.place(self.uv, m.tiling);
        let texel = Vec2::new(1.0 / map.width as f32, 1.0 / map.height as f32);
        let rise = |step: Vec2| map.bilinear(place + step * 0.5).x - map.bilinear(place - step * 0.5).x;
        let slopes = Vec2::new(rise(Vec2::new(texel.x, 0.0)), rise(Vec2::new(0.0, texel.y))) / texel;
        // Along the map's own coordinates, then along those of the surface.
        let slopes = map.lookup.map.map_or(slopes, |map| map.matrix2.transpose() * slopes);
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
        let gradient = (edges[1] * rises[0] - edges[0] * rises[1]).cross(smooth) / smooth.dot(edges[0].cross(edges[1]));
        let n = self.n_shading - gradient * self.n_shading.dot(smooth).max(0.0);
        self.n_shading = self.in_front(n.normalize_or(self.n_shading));
    }

    /// A unit normal, tilted until it is in front of the triangle.
    fn in_front(&self, n: Vec3) -> Vec3 {
        let behind = n.dot(self.n_geometric) - GRAZING_COSINE;
        if behind < 0.0 { (n - self.n_geometric * behind).normalize_or(self.n_geometric) } else { n }
    }

    /// Radiance emitted towards `wo`: the material's emission on the front side, black behind.
    #[inline]
    pub fn emitted(&self, textures: &[Texture], wo: Vec3) -> Vec3 {
        if self.emitter == NONE || self.n_geometric.dot(wo) <= 0.0 {
            return Vec3::ZERO;
        }
        self.material.emission * lookup(textures, self.material.emission_texture, self.uv, self.material.tiling)
    }

    /// The base colour here.
    #[inline]
    pub fn base_color(&self, textures: &[Texture]) -> Vec3 {
        let m = self.material;
        m.base_color * self.tint * lookup(textures, m.base_color_texture, self.uv, m.tiling)
    }

    /// A ray from here into `dir`, started off the surface on the side to which it goes.
    #[inline]
    pub fn spawn(&self, dir: Vec3) -> Ray {
        if let Some(over) = self.overhang_into(dir) {
            return Ray { origin: over.crest, dir };
        }
        let side = if dir.dot(self.n_geometric) < 0.0 { -self.n_geometric } else { self.n_geometric };
        Ray { origin: offset_origin(self.position, side), dir }
    }
}

/// The smooth surface that a triangle's corner normals suggest above one of its points, which hides the shadow terminator:
/// the hard edge where light passes below the triangle's plane, but not below the tangent plane of the shading normal.
///
/// The source moves every point up before it is shaded [Vives], so that an edge has other ends when it is traced from its
/// other end: techniques that trace light from both sides disagree then. Here a path's points stay where they are, and only
/// an edge towards light whose far end lies below the triangle's plane, which could carry nothing otherwise, leaves from
/// the point above: the crest. All techniques agree on that, since
/// - every other edge is as without an overhang, so that far ends above the plane are reached from the base only;
/// - an edge from the crest is allowed towards light, at the vertex that is nearer to the camera, and not the other way;
/// - no technique can find it from its far end by chance, so that this density is zero in all weights.
///
/// What remains is the bias that is wanted: a surface that is lit where its triangles would hide the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overhang {
    /// The point of the triangle.
    pub base: Vec3,
    /// The point above it, already moved off the surface.
    pub crest: Vec3,
    /// Unit normal of the triangle on the side where the crest is.
    pub up: Vec3,
    /// Whether edges from the crest are meant, or those from the base.
    pub raised: bool,
}

impl Overhang {
    /// Whether an edge in this direction leaves from the crest, if its far end [is below the plane](Self::reaches).
    #[inline]
    pub fn carries(&self, dir: Vec3) -> bool {
        dir.dot(self.up) <= 0.0
    }

    /// Whether a point lies below the triangle's plane.
    #[inline]
    pub fn reaches(&self, point: Vec3) -> bool {
        (point - self.base).dot(self.up) <= 0.0
    }

    /// Whether light sampled from here is for the other one of base and crest.
    #[inline]
    pub fn refuses(&self, direct: &DirectSample) -> bool {
        let below =
            if direct.distance.is_finite() { self.reaches(direct.point.position) } else { self.carries(direct.wi) };
        below != self.raised
    }
}

/// A texture's colour at texture coordinates, or white where there is no texture.
#[inline]
pub fn lookup(textures: &[Texture], texture: u32, uv: Uv, tiling: UvMap) -> Vec3 {
    if texture == NONE {
        return Vec3::ONE;
    }
    let texture = &textures[texture as usize];
    texture.bilinear(texture.place(uv, tiling))
}

/// A texture's red channel at texture coordinates, or `scalar` where there is no texture.
#[inline]
pub fn lookup_scalar(textures: &[Texture], texture: u32, uv: Uv, tiling: UvMap, scalar: f32) -> f32 {
    if texture == NONE { scalar } else { lookup(textures, texture, uv, tiling).x }
}

/// Texture coordinates at a hit of `ray`.
#[inline]
fn uv_at(scene: &CompiledScene, ray: &Ray, hit: &Hit) -> Uv {
    match (hit.primitive as usize).checked_sub(scene.attributes.len()) {
        None => scene.uv_at(hit.primitive, hit.uv),
        Some(i) => {
            let sphere = &scene.spheres[i];
            Uv::same(sphere_uv((ray.origin + ray.dir * hit.t - sphere.center).normalize_or(-ray.dir)))
        }
    }
}

/// How much of a material there is at texture coordinates: 0 or 1 where its mask is compared with a threshold, the mask
/// itself where it is blended. What traversal decides for a ray, on average.
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

/// Whether the mask of the material that was hit says that there is nothing.
///
/// In blend mode this is decided by a hash of the ray and of the primitive, so that the same ray always finds the same
/// holes, whatever thread asks, while rays of different samples see the mask's value on average.
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
            let directed = pcg4d([x, y, z, scene.number_of(hit.primitive, hit.instance)]);
            let [x, y, z] = ray.origin.to_array().map(f32::to_bits);
            unit(pcg4d([x ^ directed[0], y ^ directed[1], z ^ directed[2], directed[3]])[0]) >= covered
        }
    }
}

/// Texture coordinates on a sphere: longitude about y in u, from the south pole to the north pole in v.
#[inline]
pub fn sphere_uv(n: Vec3) -> Vec2 {
    let longitude = n.x.atan2(n.z) / std::f32::consts::TAU + 0.5;
    let latitude = n.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
    Vec2::new(longitude, 1.0 - latitude)
}
