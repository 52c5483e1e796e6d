//! The surfaces that camera rays hit first, as layers show them. A composed material is used as a
//! whole.

use glam::Vec3;

use lumbre_light::film::layer::FirstHit;
use lumbre_light::math::real::Vector;
use lumbre_light::math::simd::{F32x8, Lanes, SimdKernel, Width, dispatch, map_array, padded};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::arrival::HitState;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::ray::{Hit, Ray, RayHits};
use lumbre_light::transport::sampler::Sampler;
use lumbre_light::transport::surface::{Surface, SurfaceTraits};

/// First surfaces of the paths of a tile, with buffers that tiles reuse.
#[derive(Default)]
pub(crate) struct FirstHits {
    /// The surface of each path; `None` if it hits nothing.
    found: Vec<Option<FirstHit>>,
    /// Paths that hit surfaces of each class; empty between tiles.
    by_class: Vec<Vec<u32>>,
}

impl FirstHits {
    /// Removes all surfaces.
    pub fn clear(&mut self) {
        self.found.clear();
    }

    /// Finds the surface of each path, given the rays from the camera and their hits.
    pub fn find(
        &mut self,
        width: Width,
        context: &Context,
        rays: &[(Ray, f32)],
        hits: &[Option<Hit>],
    ) {
        let (scene, classes) = (context.scene, context.classes);
        self.found.resize(rays.len(), None);
        self.by_class.resize_with(classes.count(), Vec::new);
        for (path, hit) in hits.iter().enumerate() {
            if let Some(hit) = hit {
                let class = classes.index_of(scene, &HitState::whole(scene, hit));
                self.by_class[class].push(path as u32);
            }
        }
        for (class, paths) in self.by_class.iter_mut().enumerate() {
            dispatch(
                width,
                Find {
                    scene,
                    traits: readable(scene, classes[class].surface),
                    paths,
                    rays,
                    hits,
                    found: &mut self.found,
                },
            );
            paths.clear();
        }
    }

    /// Returns the surface of a path; `None` if it hits nothing.
    pub fn of_path(&self, path: usize) -> Option<FirstHit> {
        self.found.get(path).copied().flatten()
    }
}

/// Returns the surface that a sample's camera ray hits, or `None`. Traces the ray again, since
/// techniques without steps do not report it.
pub(super) fn first_hit(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
) -> Option<FirstHit> {
    let scene = context.scene;
    let ray = context.camera.sample_ray(pixel, sampler);
    let hit = context.trace.closest(&ray, f32::INFINITY)?;
    let class = context
        .classes
        .index_of(scene, &HitState::whole(scene, &hit));
    let traits = readable(scene, context.classes[class].surface);
    let [found] = surfaces::<f32, 1>(scene, &traits, &RayHits::new(&ray, &hit));
    Some(found)
}

/// Returns the properties of surfaces whose texture coordinates are read, even if no texture needs
/// them.
fn readable(scene: &CompiledScene, traits: SurfaceTraits) -> SurfaceTraits {
    SurfaceTraits {
        uv: true,
        second_uv: !traits.sphere && !scene.second_uvs.is_empty(),
        ..traits
    }
}

/// Kernel that finds the surfaces of one class.
struct Find<'a> {
    scene: &'a CompiledScene,
    traits: SurfaceTraits,
    paths: &'a [u32],
    rays: &'a [(Ray, f32)],
    hits: &'a [Option<Hit>],
    found: &'a mut [Option<FirstHit>],
}

impl SimdKernel for Find<'_> {
    type Output = ();

    #[inline(always)]
    fn run<R: Lanes<N>, const N: usize>(self) {
        for group in self.paths.chunks(N) {
            let paths = map_array(padded::<u32, N>(group), |path| path as usize);
            let (mut starts, mut ends) = ([F32x8::default(); N], [F32x8::default(); N]);
            let (mut primitives, mut instances) = ([0; N], [0; N]);
            for lane in 0..N {
                let Ray { origin: o, dir: d } = self.rays[paths[lane]].0;
                starts[lane] = F32x8([o.x, o.y, o.z, d.x, d.y, d.z, 0.0, 0.0]);
                if let Some(hit) = &self.hits[paths[lane]] {
                    ends[lane] = F32x8([hit.t, hit.uv[0], hit.uv[1], 0.0, 0.0, 0.0, 0.0, 0.0]);
                    (primitives[lane], instances[lane]) = (hit.primitive, hit.instance);
                }
            }
            let [ox, oy, oz, dx, dy, dz, ..] = R::transpose_load(starts.each_ref());
            let [t, v, w, ..] = R::transpose_load(ends.each_ref());
            let hits = RayHits {
                origin: R::Vec3::new(ox, oy, oz),
                dir: R::Vec3::new(dx, dy, dz),
                t,
                uv: [v, w],
                primitives,
                instances,
            };
            let found = surfaces::<R, N>(self.scene, &self.traits, &hits);
            for (path, found) in paths.iter().zip(found).take(group.len()) {
                self.found[*path] = Some(found);
            }
        }
    }
}

/// Returns the surfaces at hits, all with `traits`.
#[inline(always)]
fn surfaces<R: Lanes<N>, const N: usize>(
    scene: &CompiledScene,
    traits: &SurfaceTraits,
    hits: &RayHits<R, N>,
) -> [FirstHit; N] {
    let mut materials = [0; N];
    for (lane, material) in materials.iter_mut().enumerate() {
        *material = scene.material_of(hits.primitives[lane], hits.instances[lane]);
    }
    let surface = Surface::at_hits(scene, traits, hits, materials);
    let albedo = surface.base_color(&scene.textures);
    let behind = surface.n_geometric.dot(hits.dir).gt(R::splat(0.0));
    let normal = R::Vec3::select(behind, -surface.n_shading, surface.n_shading);
    let distance = (hits.origin - surface.position).length();
    let [u, v] = surface.uv.first;
    let (n, p, zero) = (normal, surface.position, R::splat(0.0));
    let looks = R::transpose_store([
        albedo.x(),
        albedo.y(),
        albedo.z(),
        n.x(),
        n.y(),
        n.z(),
        u,
        v,
    ]);
    let places = R::transpose_store([p.x(), p.y(), p.z(), distance, zero, zero, zero, zero]);
    let mut found = [FirstHit::default(); N];
    for (lane, found) in found.iter_mut().enumerate() {
        let F32x8([r, g, b, nx, ny, nz, u, v]) = looks[lane];
        let F32x8([x, y, z, distance, ..]) = places[lane];
        let [shape, primitive] = scene.entity_of(hits.primitives[lane], hits.instances[lane]);
        *found = FirstHit {
            albedo: Vec3::new(r, g, b),
            normal: Vec3::new(nx, ny, nz),
            distance,
            position: scene.described(Vec3::new(x, y, z)),
            uv: [u, v],
            shape,
            primitive,
        };
    }
    found
}
