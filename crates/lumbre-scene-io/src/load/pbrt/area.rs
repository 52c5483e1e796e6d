//! Area lights on shapes, and the alpha of shapes.

use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use super::light::{AreaSource, Areas, LightReader};
use super::params::Params;
use super::state::{MaterialRef, State};
use super::texture;
use super::version::Version;
use super::{Loader, material, spectrum};
use crate::load::composed::TextureValue;
use crate::load::default_scene;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{MeshDesc, ShapeDesc, mesh_hash};

/// Distance between the two sides of a light that emits on both, relative to its size, and relative
/// to its greatest coordinate, which bounds the precision of intersections.
const GAP: [f64; 2] = [1e-4, 4e-6];

impl Loader {
    /// Returns the `alpha` of a shape, unless it is opaque.
    pub(super) fn alpha(
        &self,
        params: &Params,
        state: &State,
    ) -> Result<Option<TextureValue>, SceneError> {
        let Some(p) = params.get("alpha") else {
            return Ok(None);
        };
        let purpose = spectrum::Use::Reflectance;
        let value = self
            .textures
            .value_of(p, false, purpose, &self.spectra(state))?;
        let opaque = matches!(&value, TextureValue::Constant(c) if c.x >= 1.0);
        Ok((!opaque).then_some(value))
    }

    /// Returns the area light of a shape. In version 4 one on an interface is ignored. A light
    /// whose shape is invisible, with an alpha of 0, becomes visible, with a note.
    pub(super) fn area(
        &mut self,
        params: &Params,
        state: &State,
        object: Option<&str>,
        alpha: &mut Option<TextureValue>,
    ) -> Option<Rc<AreaSource>> {
        let area = state.area_light.clone()?;
        if object.is_some() {
            self.notes
                .push(params.note("pbrt ignores area lights in object definitions"));
            return None;
        }
        let is_interface = match &state.material {
            MaterialRef::Own(source) => source.is_interface(),
            MaterialRef::Named(name) => self.named.get(name).is_some_and(|m| m.is_interface()),
            MaterialRef::None => false,
        };
        if is_interface && self.version == Version::V4 {
            self.notes
                .push(params.note("pbrt ignores an area light on the material `interface`"));
            return None;
        }
        if matches!(alpha, Some(TextureValue::Constant(c)) if c.x <= 0.0) {
            *alpha = None;
            self.notes.push(params.note(
                "an invisible light (`alpha` 0) is not supported; the light stays and its shape is \
                 visible",
            ));
        }
        Some(area)
    }

    /// Returns the name of a copy of a material with the light and the alpha of a shape. Shapes
    /// with the same light share it, unless it states its power.
    pub(super) fn variant(
        &mut self,
        base: &str,
        area: Option<&Rc<AreaSource>>,
        alpha: Option<TextureValue>,
        areas: Areas,
        params: &Params,
    ) -> Result<String, SceneError> {
        let address = area.map_or(0, |a| Rc::as_ptr(a) as usize);
        let key = (
            base.to_owned(),
            address,
            format!("{:?}", alpha.as_ref().map(texture::key)),
        );
        let shared = area.is_none_or(|a| a.params.get("power").is_none());
        if let Some((known, _)) = self.variants.get(&key).filter(|_| shared) {
            return Ok(known.clone());
        }
        let mut m = match self.materials.get(base) {
            Some(found) => found.clone(),
            None => material::default_material(base),
        };
        m.name = self.names.allocate(&if area.is_some() {
            format!("{base}_light")
        } else {
            base.to_owned()
        });
        if let Some(alpha) = alpha.clone() {
            material::set_mask(&mut m, alpha);
        }
        if let Some(source) = area {
            material::without_parts(&mut m, params, &mut self.notes);
            let mut reader = LightReader {
                spectra: &source.spectra,
                textures: &mut self.textures,
                notes: &mut self.notes,
                exposure: self.exposure,
            };
            reader.set_emission(&mut m, source, areas)?;
        }
        let name = m.name.clone();
        self.materials.push(m);
        if shared {
            let addressed = (area.cloned(), alpha);
            self.variants.insert(key, (name.clone(), addressed));
        }
        Ok(name)
    }
}

/// Returns a shape whose back is a second front, a small gap behind the first, so that it emits on
/// both sides. `to_world` is its transform. Spheres are meshes here.
pub(super) fn two_sided(shape: ShapeDesc, to_world: &DAffine3) -> ShapeDesc {
    let ShapeDesc::Mesh(mesh) = &shape else {
        return shape;
    };
    let world: Vec<DVec3> = mesh
        .positions
        .iter()
        .map(|p| to_world.transform_point3(p.as_dvec3()))
        .collect();
    let (low, high) = world
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| {
            (low.min(*p), high.max(*p))
        });
    let size = (high - low).length();
    let gap = (GAP[0] * size).max(GAP[1] * low.abs().max(high.abs()).max_element());
    let normals = if mesh.normals.is_empty() {
        default_scene::smooth_normals(&mesh.positions, &mesh.triangles)
    } else {
        mesh.normals.clone()
    };
    let to_object = to_world.matrix3.inverse();
    let behind = |(p, n): (&Vec3, &Vec3)| {
        let n = (to_object.transpose() * n.as_dvec3()).normalize_or_zero();
        *p - (to_object * (gap * n)).as_vec3()
    };
    let mut both = MeshDesc::clone(mesh);
    let count = mesh.positions.len() as u32;
    both.positions
        .extend(mesh.positions.iter().zip(&normals).map(behind));
    both.normals.extend(mesh.normals.iter().map(|n| -*n));
    both.uvs.extend_from_slice(&mesh.uvs);
    both.triangles.extend(
        mesh.triangles
            .iter()
            .map(|[a, b, c]| [a, c, b].map(|i| i + count)),
    );
    both.triangle_slot.extend_from_slice(&mesh.triangle_slot);
    both.content_hash = mesh_hash(&both);
    ShapeDesc::Mesh(Arc::new(both))
}
