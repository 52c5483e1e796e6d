//! glTF meshes: triangles of primitives with their vertex attributes.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{Affine2, DVec3, DVec4, Vec2, Vec3, Vec4};
use serde_json::Value as Json;

use super::deform::{Deformation, Vertices};
use super::document::{Document, select};
use super::material::{UNLIT, UvSets};
use super::{GltfLoader, draco, list};
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{MeshDesc, mesh_hash};
use lumbre_light::scene::shape::Shape;

/// Vertex attributes of a primitive as flat lists of numbers. An attribute that it lacks is empty.
struct Attributes {
    positions: Rc<Vec<f64>>,
    normals: Rc<Vec<f64>>,
    uvs: Rc<Vec<f64>>,
    second_uvs: Rc<Vec<f64>>,
    tangents: Rc<Vec<f64>>,
    colors: Rc<Vec<f64>>,
    /// Numbers per colour: 3, or 4 with alpha.
    color_width: usize,
}

impl Attributes {
    /// Reads the attributes of a primitive.
    ///
    /// # Errors
    /// Fails for invalid accessors, and for attributes of different lengths.
    fn read(
        document: &Document,
        place: &str,
        primitive: &Json,
        uv_sets: UvSets,
    ) -> Result<Attributes, SceneError> {
        let attributes = &primitive["attributes"];
        let at = |key: &str| format!("{place}.attributes.{key}");
        let vectors = |key: &str, n: usize| match &attributes[key] {
            Json::Null => Ok(Rc::default()),
            index => document.numbers(&at(key), index, n),
        };
        let positions = vectors("POSITION", 3)?;
        let normals = vectors("NORMAL", 3)?;
        let uvs = vectors(&format!("TEXCOORD_{}", uv_sets.first), 2)?;
        let second_uvs = match uv_sets.second {
            Some(set) => vectors(&format!("TEXCOORD_{set}"), 2)?,
            None => Rc::default(),
        };
        // Tangents of flat triangles are ignored, as the format specifies.
        let tangents = if uv_sets.tangents && !normals.is_empty() {
            vectors("TANGENT", 4)?
        } else {
            Rc::default()
        };
        let color_width = match &attributes["COLOR_0"] {
            Json::Null => 3,
            index => {
                let (_, accessor) = document.resolve(&at("COLOR_0"), "accessors", index)?;
                if accessor["type"].as_str() == Some("VEC4") {
                    4
                } else {
                    3
                }
            }
        };
        let colors = vectors("COLOR_0", color_width)?;
        let count = positions.len() / 3;
        let counts = [
            normals.len() / 3,
            uvs.len() / 2,
            second_uvs.len() / 2,
            tangents.len() / 4,
            colors.len() / color_width,
        ];
        if counts.into_iter().any(|n| n != 0 && n != count) {
            return Err(document.error(place, "the attributes have different numbers of elements"));
        }
        Ok(Attributes {
            positions,
            normals,
            uvs,
            second_uvs,
            tangents,
            colors,
            color_width,
        })
    }

    /// Returns the number of vertices.
    fn count(&self) -> usize {
        self.positions.len() / 3
    }

    /// Returns the count of numbers per vertex.
    fn numbers_per_vertex(&self) -> usize {
        let lists = [
            &self.positions,
            &self.normals,
            &self.uvs,
            &self.second_uvs,
            &self.tangents,
            &self.colors,
        ];
        let numbers: usize = lists.iter().map(|list| list.len()).sum();
        numbers / self.count().max(1)
    }
}

impl GltfLoader<'_> {
    /// Returns all primitives of a deformed mesh as one, or `None` if none consists of triangles.
    pub(super) fn mesh(
        &mut self,
        i: usize,
        mesh: &Json,
        deformation: &Deformation,
    ) -> Result<Option<MeshDesc>, SceneError> {
        let mut merged = Shape::default();
        let (mut slots, mut triangle_slot): (Vec<String>, Vec<u32>) = (Vec::new(), Vec::new());
        let mut slot_indices: BTreeMap<String, u32> = BTreeMap::new();
        for (k, primitive) in list(&mesh["primitives"]).iter().enumerate() {
            let place = format!("meshes[{i}].primitives[{k}]");
            let Some((shape, slot)) = self.primitive(&place, primitive, deformation)? else {
                continue;
            };
            let index = *slot_indices.entry(slot).or_insert_with_key(|slot| {
                slots.push(slot.clone());
                slots.len() as u32 - 1
            });
            triangle_slot.resize(triangle_slot.len() + shape.triangles.len(), index);
            merged.merge(shape);
        }
        if merged.triangles.is_empty() {
            return Ok(None);
        }
        let mut mesh = MeshDesc {
            slots,
            triangle_slot,
            ..merged.into_mesh(self.document.path.clone(), "")
        };
        mesh.content_hash = mesh_hash(&mesh);
        Ok(Some(mesh))
    }

    /// Returns the triangles of a primitive and the name of their material, or `None`, with a note,
    /// if it does not consist of triangles.
    fn primitive(
        &mut self,
        place: &str,
        primitive: &Json,
        deformation: &Deformation,
    ) -> Result<Option<(Shape, String)>, SceneError> {
        let document = self.document;
        let mode = primitive["mode"].as_u64().unwrap_or(4);
        if !(4..=6).contains(&mode) {
            self.note(place, "points and lines are not supported and are left out");
            return Ok(None);
        }
        // Compressed triangles are a list, whatever they were.
        let mode = if draco::unpack(document, place, primitive)? {
            4
        } else {
            mode
        };
        self.note_unsupported(place, primitive);
        let (slot, uv_sets) = match &primitive["material"] {
            Json::Null => (self.default_material(), UvSets::default()),
            index => {
                self.materials_by_index[&document.resolve(place, "materials", index)?.0].clone()
            }
        };
        let attributes = Attributes::read(document, place, primitive, uv_sets)?;
        let (indices, used) = vertex_indices(document, place, primitive, &attributes)?;
        let vectors = |numbers: &[f64]| -> Vec<DVec3> {
            let selected = select::<3>(numbers, &used).into_iter();
            selected.map(DVec3::from_array).collect()
        };
        let tangents = select::<4>(&attributes.tangents, &used).into_iter();
        let tangents: Vec<DVec4> = tangents.map(DVec4::from_array).collect();
        let mut vertices = Vertices {
            count: attributes.count(),
            positions: vectors(&attributes.positions),
            normals: vectors(&attributes.normals),
            tangents: tangents.iter().map(|t| t.truncate()).collect(),
            used,
        };
        self.morph(place, primitive, &deformation.weights, &mut vertices)?;
        if let Some((_, joints)) = &deformation.skin {
            self.skin(place, primitive, joints, &mut vertices)?;
        }
        if !vertices.positions.iter().all(|p| p.as_vec3().is_finite()) {
            let problem = "its morph targets or joints move a vertex out of range";
            return Err(document.error(place, problem));
        }
        let used = &vertices.used;
        let rounded = |v: &[DVec3]| v.iter().map(|v| v.as_vec3()).collect();
        // Texture coordinates start at the top left in the file, at the bottom left in a `Shape`.
        let uvs = |numbers: &[f64], map: Affine2| -> Vec<Vec2> {
            let uv = |[x, y]: &[f64; 2]| {
                let p = map.transform_point2(Vec2::new(*x as f32, *y as f32));
                Vec2::new(p.x, 1.0 - p.y)
            };
            select::<2>(numbers, used).iter().map(uv).collect()
        };
        let colors = self.colors(place, &attributes, used);
        let mut shape = Shape {
            positions: rounded(&vertices.positions),
            normals: rounded(&vertices.normals),
            uvs: uvs(&attributes.uvs, uv_sets.map),
            second_uvs: uvs(&attributes.second_uvs, Affine2::IDENTITY),
            tangents: vertices
                .tangents
                .iter()
                .zip(&tangents)
                .map(|(along, t)| tangent(*along, t.w))
                .collect(),
            colors,
            triangles: triangles(mode, &indices),
        };
        if shape.normals.is_empty() {
            shape.facet();
        }
        shape
            .normals
            .iter_mut()
            .for_each(|n| *n = n.normalize_or(Vec3::Y));
        Ok(Some((shape, slot)))
    }

    /// Returns the vertex colours of a primitive, clamped to 0..=1, with a note on their alpha.
    fn colors(&mut self, place: &str, attributes: &Attributes, used: &[u32]) -> Vec<Vec3> {
        let clamped = |c: &[f64]| vec3(c).clamp(Vec3::ZERO, Vec3::ONE);
        if attributes.color_width == 3 {
            let colors = select::<3>(&attributes.colors, used);
            return colors.iter().map(|c| clamped(c)).collect();
        }
        let colors = select::<4>(&attributes.colors, used);
        if colors.iter().any(|c| c[3] < 1.0) {
            self.note(
                &format!("{place}.attributes.COLOR_0"),
                "the alpha of vertex colours is not supported",
            );
        }
        colors.iter().map(|c| clamped(c)).collect()
    }

    /// Notes attributes of a primitive that are not supported.
    fn note_unsupported(&mut self, place: &str, primitive: &Json) {
        if !primitive["attributes"]["COLOR_1"].is_null() {
            self.note(place, "second vertex colours are not supported");
        }
        let index = primitive["material"].as_u64().unwrap_or(u64::MAX);
        let material = self.document.at("materials", index as usize);
        if !primitive["attributes"]["COLOR_0"].is_null()
            && material["extensions"][UNLIT].is_object()
        {
            self.note(
                place,
                "vertex colours of an unlit material are not supported",
            );
        }
    }
}

/// Returns the vertex indices of a primitive, and the vertices of the file that they refer to.
/// Primitives often share attributes of which each uses a few vertices, so unused ones are removed.
fn vertex_indices(
    document: &Document,
    place: &str,
    primitive: &Json,
    attributes: &Attributes,
) -> Result<(Vec<u32>, Vec<u32>), SceneError> {
    let count = attributes.count();
    let indices = match &primitive["indices"] {
        Json::Null => None,
        index => Some(document.numbers(&format!("{place}.indices"), index, 1)?),
    };
    let corners = indices.as_ref().map_or(count, |indices| indices.len());
    let per_vertex = attributes.numbers_per_vertex().max(8);
    document.charge(
        place,
        (per_vertex * corners.min(count)) as u64 + corners as u64,
    )?;
    let mut indices: Vec<u32> = match indices {
        None => (0..count as u32).collect(),
        Some(indices) => indices.iter().map(|x| *x as u32).collect(),
    };
    if let Some(i) = indices.iter().find(|i| **i as usize >= count) {
        return Err(document.error(
            place,
            format!("an index is {i}, but there are only {count} vertices"),
        ));
    }
    if indices.len() >= count {
        return Ok((indices, (0..count as u32).collect()));
    }
    let mut used = indices.clone();
    used.sort_unstable();
    used.dedup();
    indices
        .iter_mut()
        .for_each(|i| *i = used.partition_point(|u| *u < *i) as u32);
    Ok((indices, used))
}

/// Returns the triangles of a list (mode 4), strip (5) or fan (6) of vertices.
fn triangles(mode: u64, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        4 => indices
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect(),
        5 => strip(indices),
        _ => indices
            .windows(2)
            .skip(1)
            .map(|t| [indices[0], t[0], t[1]])
            .collect(),
    }
}

/// Returns the triangles of a strip, in which every second one has the opposite orientation.
fn strip(indices: &[u32]) -> Vec<[u32; 3]> {
    let oriented = |(i, t): (usize, &[u32])| {
        if i % 2 == 0 {
            [t[0], t[1], t[2]]
        } else {
            [t[1], t[0], t[2]]
        }
    };
    indices.windows(3).enumerate().map(oriented).collect()
}

/// Returns a unit tangent and the sign of its bitangent; zero if it has no direction.
fn tangent(along: DVec3, sign: f64) -> Vec4 {
    let sign = if sign < 0.0 { -1.0 } else { 1.0 };
    along
        .as_vec3()
        .try_normalize()
        .map_or(Vec4::ZERO, |along| along.extend(sign))
}

/// Returns a vector of three numbers, rounded to `f32`.
fn vec3(c: &[f64]) -> Vec3 {
    DVec3::new(c[0], c[1], c[2]).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_of_lists_strips_and_fans_face_one_side() {
        let zigzag: Vec<[f64; 2]> = (0..6).map(|i| [f64::from(i), -f64::from(i % 2)]).collect();
        let around = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-1.0, 1.0]];
        let cases = [
            (4, &zigzag[..], &[0, 1, 2, 1, 3, 2][..], 2),
            (5, &zigzag, &[0, 1, 2, 3, 4, 5], 4),
            (6, &around, &[0, 1, 2, 3, 4], 3),
        ];
        for (mode, points, indices, count) in cases {
            let found = triangles(mode, indices);
            assert_eq!(found.len(), count, "mode {mode}");
            for t in found {
                let [a, b, c] = t.map(|i| points[i as usize]);
                let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                assert!(area > 0.0, "mode {mode}, triangle {t:?}");
            }
        }
    }
}
