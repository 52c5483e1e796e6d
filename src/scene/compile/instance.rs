//! Meshes that are kept once and stand in many places.
//!
//! Triangles of a shared mesh lie behind those of the world in the same arrays, in the mesh's own space. An [`Instance`]
//! says where a copy stands, and which materials and lights are its own. What is asked of a copy is computed as it would
//! have been compiled without sharing: corners in double precision and rounded once, normals by the inverse transpose and
//! on the front side. So the two differ by the last digits of a normal, and by nothing else.

use std::collections::BTreeMap;
use std::ops::Range;

use glam::{DAffine3, DMat3, Mat3, Vec3, Vec4};

use super::flatten::on_front_side;
use super::{CompiledScene, Emitter, NONE, TriangleAttributes};

/// Triangles and spheres up to which scenes with copies are [unfolded](CompiledScene::flattened) for what knows none: some four
/// gigabytes on a device.
pub const MOST_UNFOLDED: usize = 1 << 24;

/// All copies of shared meshes. Primitive ids and instances name a triangle together: the primitive is the triangle's row
/// in [`CompiledScene::triangles`], the instance a row of [`Instances::places`], or [`NONE`] for what is not shared.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instances {
    /// The shared meshes; their triangles follow one another behind those of the world.
    pub meshes: Vec<SharedMesh>,
    /// The copies.
    pub places: Vec<Instance>,
    /// Rows of [`CompiledScene::materials`]: for each copy one for each of its mesh's slots. The `material` of a shared
    /// triangle is its slot.
    pub materials: Vec<u32>,
}

/// A mesh that is kept once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SharedMesh {
    /// Its rows in [`CompiledScene::triangles`], [`CompiledScene::attributes`], and where there are any, tangents and colours.
    pub triangles: Range<u32>,
    /// Those of its triangles that shine, in their order. The `emitter` of a shared triangle is its place among them, or
    /// [`NONE`].
    pub shining: Vec<u32>,
}

/// A copy of a shared mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Row of [`Instances::meshes`].
    pub mesh: u32,
    /// From the mesh's space to the world; it can be inverted, and does not mirror what its triangles show as their front:
    /// the corners of a mesh that is mirrored run the other way round in a mesh of its own.
    pub to_world: DAffine3,
    /// From the mesh's normals to the world's, but for their length.
    pub normal_to_world: Mat3,
    /// First entry in [`Instances::materials`].
    pub materials: u32,
    /// Row in [`CompiledScene::emitters`] of the first of its triangles that shine.
    pub emitters: u32,
    /// The id that its first triangle has where nothing is shared: see [`CompiledScene::flattened`].
    pub first: u32,
}

impl Instance {
    /// A point of the mesh in the world.
    #[inline]
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.to_world.transform_point3(p.as_dvec3()).as_vec3()
    }
}

/// det(L) L^-T, which also exists where L flattens what it maps.
pub(super) fn cofactor(linear: DMat3) -> DMat3 {
    DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    )
}

impl CompiledScene {
    /// How many triangles are not shared; they come first.
    #[inline]
    pub fn world_triangles(&self) -> usize {
        self.instances.meshes.first().map_or(self.triangles.len(), |m| m.triangles.start as usize)
    }

    /// Number of triangles and spheres as a ray meets them, each copy counted.
    pub fn flattened_count(&self) -> usize {
        let meshes = &self.instances.meshes;
        let copies = self.instances.places.iter().map(|place| meshes[place.mesh as usize].triangles.len());
        copies.fold(self.world_triangles() + self.spheres.len(), usize::saturating_add)
    }

    /// The corners in world space of a triangle.
    #[inline]
    pub fn corners(&self, primitive: u32, instance: u32) -> [Vec3; 3] {
        let corners = self.triangles[primitive as usize];
        if instance == NONE { corners } else { corners.map(|p| self.place(instance).point(p)) }
    }

    /// The corners of a triangle, and the unit shading normals there, in world space.
    #[inline]
    pub fn triangle(&self, primitive: u32, instance: u32) -> ([Vec3; 3], [Vec3; 3]) {
        if instance != NONE {
            return self.copied(primitive, instance);
        }
        (self.triangles[primitive as usize], self.attributes[primitive as usize].normals)
    }

    /// The same of a copy: apart, so that what is not shared does not pay for it.
    #[cold]
    #[inline(never)]
    fn copied(&self, primitive: u32, instance: u32) -> ([Vec3; 3], [Vec3; 3]) {
        let corners = self.corners(primitive, instance);
        (corners, self.place(instance).normals(self.attributes[primitive as usize].normals, corners))
    }

    #[inline]
    fn place(&self, instance: u32) -> &Instance {
        &self.instances.places[instance as usize]
    }

    /// The tangents at the corners of a triangle in world space; zero where there are none.
    #[inline]
    pub fn tangents_at(&self, primitive: u32, instance: u32) -> [Vec4; 3] {
        let tangents = self.tangents.get(primitive as usize).map_or([Vec4::ZERO; 3], |t| *t);
        if instance == NONE {
            return tangents;
        }
        let matrix = self.place(instance).to_world.matrix3;
        tangents.map(|t| (matrix * t.truncate().as_dvec3()).as_vec3().normalize_or_zero().extend(t.w))
    }

    /// The material row of a primitive.
    #[inline]
    pub fn material_of(&self, primitive: u32, instance: u32) -> u32 {
        let i = primitive as usize;
        let own = match self.attributes.get(i) {
            Some(a) => a.material,
            None => self.spheres[i - self.attributes.len()].material,
        };
        if instance == NONE { own } else { self.instances.materials[(self.place(instance).materials + own) as usize] }
    }

    /// The emitter row of a primitive, or [`NONE`].
    #[inline]
    pub fn emitter_of(&self, primitive: u32, instance: u32) -> u32 {
        let i = primitive as usize;
        let own = match self.attributes.get(i) {
            Some(a) => a.emitter,
            None => self.spheres[i - self.attributes.len()].emitter,
        };
        if instance == NONE || own == NONE { own } else { self.place(instance).emitters + own }
    }

    /// A number that every primitive of every copy has for itself: its id in the [flattened](Self::flattened) scene, but
    /// for spheres, which keep theirs.
    #[inline]
    pub fn number_of(&self, primitive: u32, instance: u32) -> u32 {
        if instance == NONE {
            return primitive;
        }
        let place = self.place(instance);
        place.first.wrapping_add(primitive - self.instances.meshes[place.mesh as usize].triangles.start)
    }

    /// The same scene with every copy's triangles in the world: what backends take that know no copies. The order is that
    /// of the copies, behind what is in the world already.
    ///
    /// # Errors
    /// Where that makes more than `limit` triangles and spheres: how many.
    pub fn flattened(&self, limit: usize) -> Result<CompiledScene, usize> {
        let total = self.flattened_count();
        if total > limit {
            return Err(total);
        }
        let world = self.world_triangles();
        let mut flat = CompiledScene { instances: Instances::default(), ..self.clone() };
        flat.triangles.truncate(world);
        flat.attributes.truncate(world);
        flat.tangents.truncate(world);
        flat.colors.truncate(world);
        flat.second_uvs.truncate(world);
        let mut names = BTreeMap::new();
        for (row, place) in self.instances.places.iter().enumerate() {
            let row = row as u32;
            for primitive in self.instances.meshes[place.mesh as usize].triangles.clone() {
                let emitter = self.emitter_of(primitive, row);
                if emitter != NONE {
                    names.insert(emitter, flat.triangles.len() as u32);
                }
                let (corners, normals) = self.triangle(primitive, row);
                flat.attributes.push(TriangleAttributes {
                    normals,
                    uvs: self.attributes[primitive as usize].uvs,
                    material: self.material_of(primitive, row),
                    emitter,
                });
                if !self.tangents.is_empty() {
                    flat.tangents.push(self.tangents_at(primitive, row));
                }
                flat.colors.extend(self.colors.get(primitive as usize));
                flat.second_uvs.extend(self.second_uvs.get(primitive as usize));
                flat.triangles.push(corners);
            }
        }
        let moved = flat.triangles.len() as i64 - self.triangles.len() as i64;
        for (row, emitter) in flat.emitters.iter_mut().enumerate() {
            let primitive = match names.get(&(row as u32)) {
                Some(new) => *new,
                None if emitter.primitive as usize >= self.triangles.len() => {
                    (i64::from(emitter.primitive) + moved) as u32
                }
                None => emitter.primitive,
            };
            *emitter = Emitter { primitive, instance: NONE, ..*emitter };
        }
        Ok(flat)
    }
}

impl Instance {
    /// The mesh's corner normals in the world, on the side that the corners in the world make the front.
    #[inline]
    fn normals(&self, normals: [Vec3; 3], [a, b, c]: [Vec3; 3]) -> [Vec3; 3] {
        let front = (b - a).cross(c - a).normalize_or_zero();
        on_front_side(normals.map(|n| (self.normal_to_world * n).normalize_or(front)), front)
    }
}
