//! A scene as a folder of files for Mitsuba 3: `scene.xml`, `meshes/*.ply`, `textures/*.{png,exr}`.
//!
//! Used for checking ourselves. `spp`, `max_depth`, `rr_depth`, `width`, `height` and `filter` are parameters of the file
//! (`mitsuba -D spp=64 scene.xml`), so that one export serves a sweep. Paths end at `max_depth` edges, as here, and
//! roulette begins beyond. Where a scene says what Mitsuba has no words for, the nearest takes its place, with a
//! [`Note`]. Conventions that decide a picture are those of [`super::load`]'s reader of the same format.

mod mesh;
mod surface;
mod texture;
mod xml;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

use self::mesh::Meshes;
use self::surface::Surface;
use self::texture::{Textures, Use};
use self::xml::Xml;
use super::desc::{
    CameraDesc, ConeEdge, DEFAULT_MATERIAL, EntityDesc, EnvironmentSource, LightKind, MaterialDesc, MeshDesc,
    SceneDesc, ShapeDesc, TextureSlot,
};
use super::names::Names;
use super::{Note, SceneError};

/// The file of the scene in its folder.
pub const SCENE_FILE: &str = "scene.xml";

/// How the file begins.
const MARK: &str = "<!-- Written by Lumbre";

/// What an export left behind.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The scene.
    pub scene: PathBuf,
    /// Every file, the scene last.
    pub files: Vec<PathBuf>,
    /// What is not in it as the description says it.
    pub notes: Vec<Note>,
}

/// Whether a folder may be written to: it is not there, empty, or holds an earlier export.
pub fn is_ours(folder: &Path) -> bool {
    let empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    empty || std::fs::read_to_string(folder.join(SCENE_FILE)).is_ok_and(|text| text.starts_with(MARK))
}

/// Writes a scene for Mitsuba 3 into a folder, which is made; files of the same names are replaced.
///
/// # Errors
/// A folder or file that cannot be written, or a sphere that its frame makes an ellipsoid.
pub fn mitsuba(desc: &SceneDesc, folder: &Path) -> Result<Exported, SceneError> {
    let mut writer = Writer {
        desc,
        xml: Xml::default(),
        folder: Folder { root: folder.to_owned(), files: Vec::new(), names: Names::default() },
        textures: Textures::default(),
        meshes: Meshes::default(),
        ids: Names::default(),
        surfaces: Vec::new(),
        groups: BTreeMap::new(),
        notes: Vec::new(),
    };
    writer.scene()?;
    let Writer { xml, mut folder, notes, .. } = writer;
    let text = format!("{MARK} {}: for Mitsuba 3 -->\n{}", env!("CARGO_PKG_VERSION"), xml.finish());
    let scene = folder.put(SCENE_FILE, text.as_bytes())?;
    Ok(Exported { scene, files: folder.files, notes })
}

/// A note about the scene as a whole.
fn whole(place: &str, message: impl Into<String>) -> Note {
    Note { file: PathBuf::new(), place: place.to_owned(), message: message.into() }
}

/// A name that is an id and part of a file's name everywhere.
fn plain(name: &str) -> String {
    let plain: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).take(64).collect();
    if plain.trim_matches('_').is_empty() { "unnamed".to_owned() } else { plain }
}

/// The folder that is filled.
struct Folder {
    root: PathBuf,
    files: Vec<PathBuf>,
    names: Names,
}

impl Folder {
    /// Writes a file under a free name, and says its path as the scene names it.
    fn write(&mut self, below: &str, stem: &str, extension: &str, bytes: &[u8]) -> Result<String, SceneError> {
        // Some file systems take capital and small letters for the same.
        let stem = self.names.give(&format!("{below}/{}", plain(stem).to_ascii_lowercase()));
        let name = format!("{stem}.{extension}");
        self.put(&name, bytes)?;
        Ok(name)
    }

    fn put(&mut self, name: &str, bytes: &[u8]) -> Result<PathBuf, SceneError> {
        let path = self.root.join(name);
        let written = path.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(&path, bytes));
        written.map_err(|e| self.unwritable(&path, e))?;
        self.files.push(path.clone());
        Ok(path)
    }

    fn unwritable(&self, file: &Path, reason: impl std::fmt::Display) -> SceneError {
        SceneError::Unwritable { file: file.to_owned(), reason: reason.to_string() }
    }
}

struct Writer<'a> {
    desc: &'a SceneDesc,
    xml: Xml,
    folder: Folder,
    textures: Textures,
    meshes: Meshes,
    ids: Names,
    /// Ids by row of the materials; one more for a scene without any.
    surfaces: Vec<String>,
    /// Ids of groups by what their instances share.
    groups: BTreeMap<Shared, String>,
    notes: Vec<Note>,
}

/// What makes two entities the same but for their place: the mesh, and the rows of its materials.
type Shared = ([u8; 32], Vec<usize>);

impl Writer<'_> {
    fn scene(&mut self) -> Result<(), SceneError> {
        let desc = self.desc;
        self.xml.open("scene", &[("version", "3.0.0")]);
        let [width, height] = desc.resolution;
        let depth = desc.max_depth;
        let defaults =
            [("spp", 16), ("max_depth", depth), ("rr_depth", depth + 1), ("width", width), ("height", height)];
        for (name, value) in defaults {
            self.xml.value("default", name, value);
        }
        self.xml.value("default", "filter", "box");
        self.xml.open("integrator", &[("type", "path")]);
        self.xml.value("integer", "max_depth", "$max_depth");
        self.xml.value("integer", "rr_depth", "$rr_depth");
        self.xml.close();
        let reach = self.reach();
        self.sensor(&desc.camera, "camera", reach);
        for (name, camera) in &desc.views {
            self.sensor(camera, name, reach);
        }
        self.materials()?;
        self.entities()?;
        self.lights();
        self.environment()
    }

    /// A distance beyond everything from every camera.
    fn reach(&self) -> f32 {
        let eyes: Vec<Vec3> = std::iter::once(&self.desc.camera)
            .chain(self.desc.views.iter().map(|(_, c)| c))
            .map(|c| c.position)
            .collect();
        let mut reach: f32 = 1.0;
        let mut include = |p: Vec3| reach = eyes.iter().map(|e| e.distance(p)).fold(reach, f32::max);
        for entity in &self.desc.entities {
            match &entity.shape {
                ShapeDesc::Sphere { radius } => {
                    let center = entity.transform.frame.transform_point3(entity.transform.translate);
                    let radius = radius * entity.transform.sphere_scale().unwrap_or(1.0);
                    [-radius, radius].into_iter().for_each(|r| include(center + Vec3::splat(r)));
                }
                ShapeDesc::Mesh(mesh) => {
                    let map = entity.transform.to_world();
                    let world = |p: &Vec3| map.transform_point3(p.as_dvec3()).as_vec3();
                    mesh.positions.iter().map(world).for_each(&mut include);
                }
            }
        }
        4.0 * reach
    }

    fn sensor(&mut self, camera: &CameraDesc, name: &str, reach: f32) {
        let id = self.ids.give(&plain(name));
        let lens = camera.lens_diameter();
        let kind = if lens > 0.0 { "thinlens" } else { "perspective" };
        let xml = &mut self.xml;
        xml.open("sensor", &[("type", kind), ("id", &id)]);
        xml.value("float", "fov", camera.view_deg());
        xml.value("string", "fov_axis", "y");
        // What lies nearer or farther is not seen there, and the ratio of both is the precision of its rays.
        xml.value("float", "near_clip", 1e-6 * reach);
        xml.value("float", "far_clip", reach);
        if lens > 0.0 {
            xml.value("float", "aperture_radius", 0.5 * lens);
            let focus = camera.focus_distance.unwrap_or_else(|| camera.position.distance(camera.target));
            xml.value("float", "focus_distance", focus);
        }
        let triple = |v: Vec3| format!("{}, {}, {}", v.x, v.y, v.z);
        let (origin, target, up) = (triple(camera.position), triple(camera.target), triple(camera.up));
        xml.open("transform", &[("name", "to_world")]);
        xml.leaf("lookat", &[("origin", &origin), ("target", &target), ("up", &up)]);
        xml.close();
        xml.open("sampler", &[("type", "independent")]);
        xml.value("integer", "sample_count", "$spp");
        xml.close();
        xml.open("film", &[("type", "hdrfilm")]);
        xml.value("integer", "width", "$width");
        xml.value("integer", "height", "$height");
        xml.value("string", "pixel_format", "rgb");
        xml.value("string", "component_format", "float32");
        xml.leaf("rfilter", &[("type", "$filter")]);
        xml.close();
        xml.close();
    }

    fn materials(&mut self) -> Result<(), SceneError> {
        let fallback = MaterialDesc::new(DEFAULT_MATERIAL);
        let rows = if self.desc.materials.is_empty() { std::slice::from_ref(&fallback) } else { &self.desc.materials };
        for material in rows {
            let id = self.ids.give(&plain(&material.name));
            let surface = Surface {
                material,
                xml: &mut self.xml,
                folder: &mut self.folder,
                textures: &mut self.textures,
                notes: &mut self.notes,
            };
            surface.write(&id)?;
            self.surfaces.push(id);
        }
        Ok(())
    }

    /// The row of the material of each slot; unknown names are the first one.
    fn rows(&self, entity: &EntityDesc, mesh: &MeshDesc) -> Vec<usize> {
        let row = |name: &String| self.desc.material_row(name).unwrap_or(0);
        mesh.slots.iter().map(|slot| row(entity.material.as_ref().unwrap_or(slot))).collect()
    }

    fn shines(&self, row: usize) -> bool {
        self.desc.materials.get(row).is_some_and(|m| m.emission != Vec3::ZERO)
    }

    fn entities(&mut self) -> Result<(), SceneError> {
        let desc = self.desc;
        let mut copies: BTreeMap<Shared, usize> = BTreeMap::new();
        for entity in &desc.entities {
            if let ShapeDesc::Mesh(mesh) = &entity.shape {
                *copies.entry((mesh.content_hash, self.rows(entity, mesh))).or_default() += 1;
            }
        }
        for entity in &desc.entities {
            if entity.anisotropic_direction.is_some() {
                let place = format!("entities.{}", entity.name);
                self.notes.push(whole(&place, "`anisotropic_direction` has no counterpart: growing u is used"));
            }
            match &entity.shape {
                ShapeDesc::Sphere { radius } => self.sphere(entity, *radius)?,
                ShapeDesc::Mesh(mesh) => {
                    let shared = (mesh.content_hash, self.rows(entity, mesh));
                    let map = entity.transform.to_world();
                    let shines = shared.1.iter().any(|row| self.shines(*row));
                    let stem = plain(&entity.name);
                    if copies[&shared] > 1 && !shines && map.matrix3.determinant() != 0.0 {
                        self.instance(mesh, shared, &map, &stem)?;
                    } else {
                        let id = self.ids.give(&stem);
                        self.parts(mesh, &shared.1, &map, Some(&id), &stem)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// One copy of a mesh that stands in several places.
    fn instance(&mut self, mesh: &MeshDesc, shared: Shared, map: &DAffine3, stem: &str) -> Result<(), SceneError> {
        let group = match self.groups.get(&shared) {
            Some(group) => group.clone(),
            None => {
                let id = self.ids.give(&format!("{stem}_group"));
                self.xml.open("shape", &[("type", "shapegroup"), ("id", &id)]);
                self.parts(mesh, &shared.1, &DAffine3::IDENTITY, None, stem)?;
                self.xml.close();
                self.groups.insert(shared, id.clone());
                id
            }
        };
        let id = self.ids.give(stem);
        self.xml.open("shape", &[("type", "instance"), ("id", &id)]);
        self.xml.leaf("ref", &[("id", &group)]);
        self.xml.place("to_world", map);
        self.xml.close();
        Ok(())
    }

    /// A mesh, one shape for each of its materials.
    fn parts(
        &mut self,
        mesh: &MeshDesc,
        rows: &[usize],
        map: &DAffine3,
        id: Option<&str>,
        stem: &str,
    ) -> Result<(), SceneError> {
        // There, a place that mirrors turns the front of a mesh without normals round.
        let flat = mesh.normals.is_empty();
        let turned = flat && map.matrix3.determinant() < 0.0;
        let mut first = id;
        for (slot, row) in rows.iter().enumerate() {
            let slot = slot as u32;
            if !mesh.triangle_slot.contains(&slot) {
                continue;
            }
            let file = self.meshes.file(mesh, slot, turned, stem, &mut self.folder)?;
            let next = match (first.take(), id) {
                (Some(id), _) => Some(id.to_owned()),
                (None, Some(id)) => Some(self.ids.give(id)),
                (None, None) => None,
            };
            let mut attributes = vec![("type", "ply")];
            attributes.extend(next.as_deref().map(|id| ("id", id)));
            self.xml.open("shape", &attributes);
            self.xml.value("string", "filename", &file);
            if flat {
                self.xml.value("boolean", "face_normals", true);
            }
            if !mesh.uvs.is_empty() {
                self.xml.value("boolean", "flip_tex_coords", true);
            }
            self.xml.place("to_world", map);
            self.surface(*row)?;
            self.xml.close();
        }
        Ok(())
    }

    fn sphere(&mut self, entity: &EntityDesc, radius: f32) -> Result<(), SceneError> {
        let place = format!("entities.{}", entity.name);
        let Some(scale) = entity.transform.sphere_scale() else {
            let problem = "its frame makes it no sphere any more: only even scales are possible".to_owned();
            return Err(SceneError::Malformed { file: PathBuf::new(), place, problem });
        };
        let center = entity.transform.frame.transform_point3(entity.transform.translate);
        let row = entity.material.as_ref().and_then(|name| self.desc.material_row(name)).unwrap_or(0);
        let id = self.ids.give(&plain(&entity.name));
        self.xml.open("shape", &[("type", "sphere"), ("id", &id)]);
        self.xml.value("float", "radius", radius * scale);
        let material = self.desc.materials.get(row);
        if material.is_some_and(|m| !m.textures.is_empty() || m.anisotropic > 0.0) {
            // There the poles lie on z, and longitude starts at x; here on y, and at -z.
            let turn = DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y);
            self.xml.place("to_world", &DAffine3::from_mat3_translation(turn, center.as_dvec3()));
        } else {
            self.xml.triple("point", "center", center);
        }
        self.surface(row)?;
        self.xml.close();
        Ok(())
    }

    /// The surface of a shape, and its light.
    fn surface(&mut self, row: usize) -> Result<(), SceneError> {
        self.xml.leaf("ref", &[("id", &self.surfaces[row])]);
        let Some(material) = self.desc.materials.get(row).filter(|m| m.emission != Vec3::ZERO) else { return Ok(()) };
        self.xml.open("emitter", &[("type", "area")]);
        match material.texture(TextureSlot::Emission) {
            Some(_) => {
                let (slot, of) = (TextureSlot::Emission, Use::Light(material.emission));
                self.textures.write(&mut self.xml, "radiance", material, slot, of, &mut self.folder)?;
            }
            None => self.xml.rgb("radiance", material.emission),
        }
        self.xml.close();
        Ok(())
    }

    fn lights(&mut self) {
        for light in &self.desc.lights {
            let id = self.ids.give(&plain(&light.name));
            let xml = &mut self.xml;
            match light.kind {
                LightKind::Point { position, intensity } => {
                    xml.open("emitter", &[("type", "point"), ("id", &id)]);
                    xml.triple("point", "position", position);
                    xml.rgb("intensity", intensity);
                }
                LightKind::Spot { position, direction, intensity, cone } => {
                    xml.open("emitter", &[("type", "spot"), ("id", &id)]);
                    let axis = direction.normalize_or(Vec3::Z);
                    let matrix =
                        DMat3::from_quat(DQuat::from_rotation_arc(DVec3::Z, axis.as_dvec3().normalize_or(DVec3::Z)));
                    xml.place("to_world", &DAffine3::from_mat3_translation(matrix, position.as_dvec3()));
                    xml.rgb("intensity", intensity);
                    xml.value("float", "cutoff_angle", cone.cutoff_deg);
                    xml.value("float", "beam_width", cone.beam_deg);
                    if cone.edge == ConeEdge::Smooth {
                        let place = format!("lights.{}", light.name);
                        self.notes.push(whole(&place, "the edge of its cone falls off linearly with the angle"));
                    }
                }
                LightKind::Directional { direction, irradiance } => {
                    xml.open("emitter", &[("type", "directional"), ("id", &id)]);
                    xml.triple("vector", "direction", direction);
                    xml.rgb("irradiance", irradiance);
                }
            }
            xml.close();
        }
    }

    fn environment(&mut self) -> Result<(), SceneError> {
        let Some(environment) = &self.desc.environment else { return Ok(()) };
        match &environment.source {
            EnvironmentSource::Color(color) => {
                self.xml.open("emitter", &[("type", "constant")]);
                self.xml.rgb("radiance", *color * environment.scale);
            }
            EnvironmentSource::Map(map) => {
                let file = self.textures.around(map, &mut self.folder)?;
                self.xml.open("emitter", &[("type", "envmap")]);
                self.xml.value("string", "filename", &file);
                self.xml.value("float", "scale", environment.scale);
                if environment.rotation_deg != 0.0 {
                    let angle = environment.rotation_deg.to_string();
                    self.xml.open("transform", &[("name", "to_world")]);
                    self.xml.leaf("rotate", &[("y", "1"), ("angle", &angle)]);
                    self.xml.close();
                }
            }
        }
        self.xml.close();
        Ok(())
    }
}
