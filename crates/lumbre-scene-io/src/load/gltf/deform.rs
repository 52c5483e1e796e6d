//! Deformed meshes: vertices that morph targets displace and joints of a skin move.

use std::rc::Rc;

use glam::{DAffine3, DMat3, DVec3};
use serde_json::Value as Json;

use super::document::select;
use super::{GltfLoader, list, shown};
use lumbre_light::scene::SceneError;
use lumbre_light::scene::compile::cofactor;

/// The weights and joints that move the vertices of a mesh.
#[derive(Default)]
pub(super) struct Deformation {
    /// Weights of morph targets.
    pub weights: Vec<f64>,
    /// A skin: its index, and the maps of its joints from the mesh's space to the world.
    pub skin: Option<(usize, Rc<Vec<DAffine3>>)>,
}

/// Index of a skin, and the bits of the weights of morph targets.
pub(super) type DeformationKey = (Option<usize>, Vec<u64>);

impl Deformation {
    /// Returns a key that is equal for equal deformations of a mesh.
    pub fn key(&self) -> DeformationKey {
        let weights = self.weights.iter().map(|w| w.to_bits()).collect();
        (self.skin.as_ref().map(|(i, _)| *i), weights)
    }
}

/// The vectors of a primitive that change with its vertices.
pub(super) struct Vertices {
    /// Indices of the vertices in the accessors of the file.
    pub used: Vec<u32>,
    /// Length of those accessors.
    pub count: usize,
    pub positions: Vec<DVec3>,
    /// Normals, or empty.
    pub normals: Vec<DVec3>,
    /// Tangents, or empty, without their signs.
    pub tangents: Vec<DVec3>,
}

impl GltfLoader<'_> {
    /// Reads what moves the mesh of a node: weights of the node or else of the mesh, and its skin.
    pub(super) fn deformation(
        &mut self,
        place: &str,
        node: &Json,
        mesh: &Json,
    ) -> Result<Deformation, SceneError> {
        let given = [node, mesh].into_iter().find(|o| o["weights"].is_array());
        let given = given.map_or(&[][..], |o| list(&o["weights"]));
        self.document.charge(place, given.len() as u64)?;
        let zero = |w: &Json| w.as_f64().is_none_or(|w| w == 0.0);
        let count = given
            .iter()
            .rposition(|w| !zero(w))
            .map_or(0, |last| last + 1);
        let weights = given[..count]
            .iter()
            .map(|w| w.as_f64().unwrap_or(0.0))
            .collect();
        let mut skin = None;
        if !node["skin"].is_null() {
            let (i, _) = self.document.resolve(place, "skins", &node["skin"])?;
            if mesh["primitives"][0]["attributes"]["JOINTS_0"].is_null() {
                self.note(place, "its mesh has no `JOINTS_0`; the skin is ignored");
            } else {
                skin = self.joints(i)?.map(|joints| (i, joints));
            }
        }
        Ok(Deformation { weights, skin })
    }

    /// Returns the maps of the joints of a skin, from the space of a mesh to the world. Returns
    /// `None`, with a note, if a joint is not in the scene.
    fn joints(&mut self, i: usize) -> Result<Option<Rc<Vec<DAffine3>>>, SceneError> {
        if let Some(known) = self.skins.get(&i) {
            return Ok(known.clone());
        }
        let (document, place) = (self.document, format!("skins[{i}]"));
        let skin = document.at("skins", i);
        let joints = list(&skin["joints"]);
        let inverse = match &skin["inverseBindMatrices"] {
            Json::Null => Rc::default(),
            index => document.numbers(&place, index, 16)?,
        };
        if !inverse.is_empty() && inverse.len() < 16 * joints.len() {
            let problem = format!("{} joints have fewer inverse bind matrices", joints.len());
            return Err(document.error(&place, problem));
        }
        let mut maps = Some(Vec::with_capacity(joints.len()));
        for (k, joint) in joints.iter().enumerate() {
            let (n, _) = document.resolve(&place, "nodes", joint)?;
            match self.worlds.get(&n) {
                Some(world) => {
                    let bound = inverse
                        .get(16 * k..16 * k + 16)
                        .map(affine)
                        .unwrap_or_default();
                    maps.iter_mut().for_each(|maps| maps.push(*world * bound));
                }
                None if maps.take().is_some() => {
                    let problem = "is not in the scene, so the skin is ignored";
                    self.note(&place, format!("the joint nodes[{n}] {problem}"));
                }
                None => {}
            }
        }
        let maps = maps.map(Rc::new);
        self.skins.insert(i, maps.clone());
        Ok(maps)
    }

    /// Displaces the vertices of a primitive by its morph targets.
    pub(super) fn morph(
        &mut self,
        place: &str,
        primitive: &Json,
        weights: &[f64],
        vertices: &mut Vertices,
    ) -> Result<(), SceneError> {
        let document = self.document;
        let targets = list(&primitive["targets"]);
        if weights.len() > targets.len() {
            let problem = format!(
                "{} weights for {} morph targets",
                weights.len(),
                targets.len()
            );
            self.note(place, format!("{problem}; the others are ignored"));
        }
        for (k, (target, weight)) in targets.iter().zip(weights).enumerate() {
            let place = format!("{place}.targets[{k}]");
            for (key, index) in target.as_object().into_iter().flatten() {
                let vectors = match key.as_str() {
                    _ if *weight == 0.0 => continue,
                    "POSITION" => &mut vertices.positions,
                    "NORMAL" => &mut vertices.normals,
                    "TANGENT" => &mut vertices.tangents,
                    other => {
                        let problem = format!("morphing of `{}` is not supported", shown(other));
                        self.note(&place, problem);
                        continue;
                    }
                };
                let changes = document.numbers(&place, index, 3)?;
                document.charge(&place, 3 * vectors.len() as u64)?;
                if changes.len() != 3 * vertices.count {
                    let problem = format!("`{key}` is not that of {} vertices", vertices.count);
                    return Err(document.error(&place, problem));
                }
                let changes = select::<3>(&changes, &vertices.used);
                let changes = changes.into_iter().map(DVec3::from_array);
                vectors
                    .iter_mut()
                    .zip(changes)
                    .for_each(|(v, change)| *v += *weight * change);
            }
        }
        Ok(())
    }

    /// Moves the vertices of a primitive by the joints that its attributes name.
    pub(super) fn skin(
        &mut self,
        place: &str,
        primitive: &Json,
        joints: &[DAffine3],
        vertices: &mut Vertices,
    ) -> Result<(), SceneError> {
        let document = self.document;
        let mut blended = vec![(DMat3::ZERO, DVec3::ZERO, 0.0); vertices.used.len()];
        for set in 0.. {
            let attributes = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
            let [indices, weights] = attributes
                .each_ref()
                .map(|key| &primitive["attributes"][key]);
            if indices.is_null() {
                break;
            }
            let place = format!("{place}.attributes.{}", attributes[0]);
            document.charge(&place, 20 * vertices.used.len() as u64)?;
            let [indices, weights] = [
                document.numbers(&place, indices, 4)?,
                document.numbers(&place, weights, 4)?,
            ];
            if [indices.len(), weights.len()] != [4 * vertices.count; 2] {
                let problem = format!(
                    "joints or weights are not those of {} vertices",
                    vertices.count
                );
                return Err(document.error(&place, problem));
            }
            for (i, (matrix, translation, sum)) in vertices.used.iter().zip(&mut blended) {
                for at in 4 * *i as usize..4 * *i as usize + 4 {
                    let (joint, weight) = (indices[at], weights[at]);
                    if weight == 0.0 {
                        continue;
                    }
                    let Some(map) = joints.get(joint as usize).filter(|_| joint >= 0.0) else {
                        let problem = format!("vertex {i} has joint {joint} of {}", joints.len());
                        return Err(document.error(&place, problem));
                    };
                    *matrix += map.matrix3 * weight;
                    *translation += map.translation * weight;
                    *sum += weight;
                }
            }
        }
        let mut loose = 0;
        for (k, (matrix, translation, sum)) in blended.into_iter().enumerate() {
            if sum <= 0.0 {
                loose += 1;
                continue;
            }
            // Quantised weights do not quite add up to 1.
            let map = DAffine3::from_mat3_translation(matrix * sum.recip(), translation / sum);
            let normal_map = cofactor(map.matrix3) * map.matrix3.determinant().signum();
            vertices.positions[k] = map.transform_point3(vertices.positions[k]);
            vertices
                .normals
                .get_mut(k)
                .into_iter()
                .for_each(|n| *n = normal_map * *n);
            vertices
                .tangents
                .get_mut(k)
                .into_iter()
                .for_each(|t| *t = map.matrix3 * *t);
        }
        if loose > 0 {
            self.note(
                place,
                format!("{loose} vertices without weights of joints are not moved"),
            );
        }
        Ok(())
    }
}

/// Returns the affine map of a 4 x 4 matrix in columns.
fn affine(columns: &[f64]) -> DAffine3 {
    let column = |c: usize| DVec3::from_slice(&columns[4 * c..]);
    DAffine3::from_cols(column(0), column(1), column(2), column(3))
}
