//! Export of a scene as a folder of files for Mitsuba 3, and in [`pbrt`] for pbrt-v4: `scene.xml`,
//! `meshes/*.ply`, `textures/*.{png,exr}`.
//!
//! Used to compare Lumbre with Mitsuba. `spp`, `max_depth`, `rr_depth`, `width`, `height` and
//! `filter` are parameters of the file (`mitsuba -D spp=64 scene.xml`), so that one export serves a
//! sweep. Paths end at `max_depth` edges, as here, and Russian roulette begins beyond. A feature
//! without a counterpart in Mitsuba is replaced by the nearest one, with a [`Note`]. Conventions
//! are those of the loader of the same format in [`crate::load`].

mod lights;
mod mesh;
mod output_folder;
mod pbrt;
mod surface;
mod texture;
mod uses;
mod xml;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, Vec3};

use self::mesh::MeshWriter;
use self::output_folder::{OutputFolder, identifier};
pub use self::pbrt::pbrt;
use self::surface::SurfaceWriter;
use self::texture::{TexelConversion, TextureWriter};
use self::uses::{InstanceKey, MeshUses};
use self::xml::Xml;
use lumbre_light::scene::desc::{
    CameraDesc, CameraKind, DEFAULT_MATERIAL, EntityDesc, MaterialDesc, MeshDesc, SceneDesc,
    ShadingNormals, ShapeDesc, TextureSlot,
};

use crate::names::UniqueNames;
use lumbre_light::scene::{Note, SceneError};

/// Name of the scene file in its folder.
pub const SCENE_FILE: &str = "scene.xml";

/// Beginning of a scene file written by an export.
const MARK: &str = "<!-- Written by Lumbre";

/// Result of an export.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Path of the scene file.
    pub scene: PathBuf,
    /// Paths of all files, the scene last.
    pub files: Vec<PathBuf>,
    /// Features of the scene that could not be exported exactly.
    pub notes: Vec<Note>,
}

/// Returns whether a folder may be written to: it does not exist, is empty, or contains an earlier
/// export.
pub fn can_replace(folder: &Path) -> bool {
    let empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    let ours = |(file, mark): (&str, &str)| {
        std::fs::read_to_string(folder.join(file)).is_ok_and(|text| text.starts_with(mark))
    };
    empty
        || [(SCENE_FILE, MARK), (pbrt::SCENE_FILE, pbrt::MARK)]
            .into_iter()
            .any(ours)
}

/// Exports a scene for Mitsuba 3 to a folder, which is created; files with the same names are
/// replaced.
///
/// # Errors
/// Fails if the folder or a file cannot be written, or if a sphere's transform makes it an
/// ellipsoid.
pub fn mitsuba(desc: &SceneDesc, folder: &Path) -> Result<Exported, SceneError> {
    let (desc, moved) = uses::prepared(desc);
    let desc = &*desc;
    let mut writer = SceneWriter {
        desc,
        uses: MeshUses::new(desc),
        xml: Xml::default(),
        folder: OutputFolder::new(folder),
        textures: TextureWriter::default(),
        meshes: MeshWriter::default(),
        ids: UniqueNames::default(),
        surfaces: Vec::new(),
        groups: BTreeMap::new(),
        notes: moved.into_iter().collect(),
    };
    writer.scene()?;
    let SceneWriter {
        xml,
        mut folder,
        notes,
        ..
    } = writer;
    let text = format!(
        "{MARK} {}: for Mitsuba 3 -->\n{}",
        env!("CARGO_PKG_VERSION"),
        xml.finish()
    );
    let scene = folder.write_file(SCENE_FILE, text.as_bytes())?;
    Ok(Exported {
        scene,
        files: folder.files,
        notes,
    })
}

/// Returns the centre and the radius of a sphere in the world.
///
/// # Errors
/// Fails if the transform makes it an ellipsoid.
fn sphere_place(entity: &EntityDesc, radius: f32) -> Result<(Vec3, f32), SceneError> {
    let Some(scale) = entity.transform.sphere_scale() else {
        let problem =
            "the transform makes the sphere an ellipsoid; only uniform scales are supported"
                .to_owned();
        return Err(SceneError::malformed(
            "",
            format!("entities.{}", entity.name),
            problem,
        ));
    };
    let transform = entity.transform;
    let translate = transform.translate.as_vec3();
    let center = transform.frame.as_affine3a().transform_point3(translate);
    Ok((center, radius * scale))
}

/// State while a scene is exported.
struct SceneWriter<'a> {
    desc: &'a SceneDesc,
    uses: MeshUses<'a>,
    xml: Xml,
    folder: OutputFolder,
    textures: TextureWriter,
    meshes: MeshWriter,
    ids: UniqueNames,
    /// Ids of the surfaces by material index; a scene without materials has one.
    surfaces: Vec<String>,
    /// Ids of shape groups by the properties that their instances share.
    groups: BTreeMap<InstanceKey, String>,
    notes: Vec<Note>,
}

impl SceneWriter<'_> {
    /// Writes the scene.
    fn scene(&mut self) -> Result<(), SceneError> {
        let desc = self.desc;
        self.xml.open("scene", &[("version", "3.0.0")]);
        let [width, height] = desc.resolution;
        let depth = desc.max_depth;
        let defaults = [
            ("spp", 16),
            ("max_depth", depth),
            ("rr_depth", depth + 1),
            ("width", width),
            ("height", height),
        ];
        for (name, value) in defaults {
            self.xml.value("default", name, value);
        }
        self.xml.value("default", "filter", "box");
        self.xml.open("integrator", &[("type", "path")]);
        self.xml.value("integer", "max_depth", "$max_depth");
        self.xml.value("integer", "rr_depth", "$rr_depth");
        self.xml.close();
        let reach = self.far_distance();
        self.sensor(&desc.camera, "camera", reach);
        for (name, camera) in &desc.views {
            self.sensor(camera, name, reach);
        }
        self.materials()?;
        self.entities()?;
        self.lights()?;
        self.environment()
    }

    /// Returns a distance beyond everything in the scene, from every camera.
    fn far_distance(&self) -> f32 {
        let eyes: Vec<Vec3> = std::iter::once(&self.desc.camera)
            .chain(self.desc.views.iter().map(|(_, c)| c))
            .map(|c| c.position)
            .collect();
        let mut reach: f32 = 1.0;
        let mut include =
            |p: Vec3| reach = eyes.iter().map(|e| e.distance(p)).fold(reach, f32::max);
        for entity in &self.desc.entities {
            match &entity.shape {
                ShapeDesc::Sphere { radius } => {
                    let center = entity.to_world().translation.as_vec3();
                    let radius = radius * entity.transform.sphere_scale().unwrap_or(1.0);
                    [-radius, radius]
                        .into_iter()
                        .for_each(|r| include(center + Vec3::splat(r)));
                }
                ShapeDesc::Mesh(mesh) => {
                    let map = entity.to_world();
                    let world = |p: &Vec3| map.transform_point3(p.as_dvec3()).as_vec3();
                    mesh.positions.iter().map(world).for_each(&mut include);
                }
            }
        }
        4.0 * reach
    }

    /// Writes a camera.
    fn sensor(&mut self, camera: &CameraDesc, name: &str, reach: f32) {
        let id = self.ids.allocate(&identifier(name));
        let parallel = camera.kind == CameraKind::Orthographic;
        let lens = camera.lens_diameter();
        let kind = match camera.kind {
            CameraKind::Orthographic => "orthographic",
            CameraKind::Perspective if lens > 0.0 => "thinlens",
            CameraKind::Perspective => "perspective",
            CameraKind::Spherical => {
                self.notes.push(Note::new(
                    "",
                    name,
                    "Mitsuba has no spherical sensor; a perspective one of 90 degrees at its place \
                     is written",
                ));
                "perspective"
            }
        };
        if kind == "thinlens" && camera.window.offset() != [0.0; 2] {
            let text =
                "a view off the axis through a lens has no counterpart in Mitsuba; it is centred";
            self.notes.push(Note::new("", name, text));
        }
        let xml = &mut self.xml;
        xml.open("sensor", &[("type", kind), ("id", &id)]);
        if !parallel {
            let fov = match camera.kind {
                CameraKind::Spherical => 90.0,
                CameraKind::Perspective | CameraKind::Orthographic => camera.picture_deg(),
            };
            xml.value("float", "fov", fov);
            xml.value("string", "fov_axis", "y");
        }
        if kind == "perspective" {
            for (axis, offset) in ["x", "y"].into_iter().zip(camera.window.offset()) {
                if offset != 0.0 {
                    xml.value("float", &format!("principal_point_offset_{axis}"), offset);
                }
            }
        }
        // Mitsuba clips outside of these distances, and their ratio limits the precision of its
        // rays.
        xml.value("float", "near_clip", 1e-6 * reach);
        xml.value("float", "far_clip", reach);
        if lens > 0.0 {
            xml.value("float", "aperture_radius", 0.5 * lens);
            let focus = camera
                .focus_distance
                .unwrap_or_else(|| camera.position.distance(camera.target));
            xml.value("float", "focus_distance", focus);
        }
        self.camera_transform(camera);
        let xml = &mut self.xml;
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

    /// Writes the transform of a camera. That of an orthographic one has half the width of the
    /// picture as its scale, and the middle of the picture as its origin.
    fn camera_transform(&mut self, camera: &CameraDesc) {
        let [width, height] = self.desc.resolution.map(|n| n as f32);
        let parallel = camera.kind == CameraKind::Orthographic;
        let half_height = 0.5 * camera.view_height * camera.window.size()[1];
        let half = [half_height * width / height, half_height];
        let side = if camera.window.mirrors() { -1.0 } else { 1.0 };
        let mut moved = Vec3::ZERO;
        if parallel {
            let right = (camera.target - camera.position).cross(camera.up);
            let up = right.cross(camera.target - camera.position);
            let [across, down] = camera.window.offset();
            moved = right.normalize_or_zero() * (2.0 * across * half[0] * side)
                - up.normalize_or_zero() * (2.0 * down * half[1]);
        }
        let xml = &mut self.xml;
        xml.open("transform", &[("name", "to_world")]);
        let scale = if parallel { half[0] } else { 1.0 };
        if parallel || side < 0.0 {
            let (x, y) = ((side * scale).to_string(), scale.to_string());
            xml.leaf("scale", &[("x", &x), ("y", &y)]);
        }
        let triple = |v: Vec3| format!("{}, {}, {}", v.x, v.y, v.z);
        let (origin, target, up) = (
            triple(camera.position + moved),
            triple(camera.target + moved),
            triple(camera.up),
        );
        xml.leaf(
            "lookat",
            &[("origin", &origin), ("target", &target), ("up", &up)],
        );
        xml.close();
    }

    /// Writes the materials.
    fn materials(&mut self) -> Result<(), SceneError> {
        let fallback = MaterialDesc::new(DEFAULT_MATERIAL);
        let rows = if self.desc.materials.is_empty() {
            std::slice::from_ref(&fallback)
        } else {
            &self.desc.materials
        };
        for material in rows {
            let id = self.ids.allocate(&identifier(&material.name));
            let surface = SurfaceWriter {
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

    /// Returns whether a material emits light.
    fn emits(&self, row: usize) -> bool {
        self.desc
            .materials
            .get(row)
            .is_some_and(|m| m.emission != Vec3::ZERO)
    }

    /// Writes the entities: meshes that several entities share as instances, unless they emit
    /// light.
    fn entities(&mut self) -> Result<(), SceneError> {
        let desc = self.desc;
        for entity in &desc.entities {
            self.notes.extend(uses::direction_note(entity, "Mitsuba"));
            match &entity.shape {
                ShapeDesc::Sphere { radius } => self.sphere(entity, *radius)?,
                ShapeDesc::Mesh(mesh) => {
                    let key = self.uses.key(entity, mesh);
                    let map = entity.to_near_world();
                    let emits = key.1.iter().any(|row| self.emits(*row));
                    let stem = identifier(&entity.name);
                    if self.uses.is_shared(&key) && !emits && map.matrix3.determinant() != 0.0 {
                        self.instance(mesh, key, &map, &stem)?;
                    } else {
                        let id = self.ids.allocate(&stem);
                        self.mesh_shapes(mesh, &key.1, &map, Some(&id), &stem)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes one instance of a mesh, and its group before the first one.
    fn instance(
        &mut self,
        mesh: &MeshDesc,
        key: InstanceKey,
        map: &DAffine3,
        stem: &str,
    ) -> Result<(), SceneError> {
        let group = match self.groups.get(&key) {
            Some(group) => group.clone(),
            None => {
                let id = self.ids.allocate(&format!("{stem}_group"));
                self.xml
                    .open("shape", &[("type", "shapegroup"), ("id", &id)]);
                self.mesh_shapes(mesh, &key.1, &DAffine3::IDENTITY, None, stem)?;
                self.xml.close();
                self.groups.insert(key, id.clone());
                id
            }
        };
        let id = self.ids.allocate(stem);
        self.xml.open("shape", &[("type", "instance"), ("id", &id)]);
        self.xml.leaf("ref", &[("id", &group)]);
        self.xml.transform("to_world", map);
        self.xml.close();
        Ok(())
    }

    /// Writes a mesh, one shape for each of its materials.
    fn mesh_shapes(
        &mut self,
        mesh: &MeshDesc,
        rows: &[usize],
        map: &DAffine3,
        id: Option<&str>,
        stem: &str,
    ) -> Result<(), SceneError> {
        let mut first = id;
        for (slot, row) in rows.iter().enumerate() {
            let slot = slot as u32;
            if !mesh.triangle_slot.contains(&slot) {
                continue;
            }
            let material = self.desc.materials.get(*row);
            let flat = mesh.normals.is_empty()
                || material.is_some_and(|m| m.shading_normals == ShadingNormals::Flat);
            // In Mitsuba, a transform that mirrors reverses the front of a mesh without normals.
            let reversed = flat && map.matrix3.determinant() < 0.0;
            let file = self
                .meshes
                .file(mesh, slot, reversed, stem, &mut self.folder)?;
            let next = match (first.take(), id) {
                (Some(id), _) => Some(id.to_owned()),
                (None, Some(id)) => Some(self.ids.allocate(id)),
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
            self.xml.transform("to_world", map);
            self.surface(*row)?;
            self.xml.close();
        }
        Ok(())
    }

    /// Writes a sphere.
    fn sphere(&mut self, entity: &EntityDesc, radius: f32) -> Result<(), SceneError> {
        let (center, radius) = sphere_place(entity, radius)?;
        let row = self.uses.sphere_row(entity);
        let id = self.ids.allocate(&identifier(&entity.name));
        self.xml.open("shape", &[("type", "sphere"), ("id", &id)]);
        self.xml.value("float", "radius", radius);
        if let Some(rotation) = uses::sphere_rotation(self.desc.materials.get(row)) {
            self.xml.transform(
                "to_world",
                &DAffine3::from_mat3_translation(rotation, center.as_dvec3()),
            );
        } else {
            self.xml.vector("point", "center", center);
        }
        self.surface(row)?;
        self.xml.close();
        Ok(())
    }

    /// Writes the surface of a shape, and its area light if it emits.
    fn surface(&mut self, row: usize) -> Result<(), SceneError> {
        self.xml.leaf("ref", &[("id", &self.surfaces[row])]);
        let Some(material) = self
            .desc
            .materials
            .get(row)
            .filter(|m| m.emission != Vec3::ZERO)
        else {
            return Ok(());
        };
        self.xml.open("emitter", &[("type", "area")]);
        match material.texture(TextureSlot::Emission) {
            Some(_) => {
                let conversion = TexelConversion::Light(material.emission);
                self.textures.write(
                    &mut self.xml,
                    "radiance",
                    material,
                    TextureSlot::Emission,
                    conversion,
                    &mut self.folder,
                )?;
            }
            None => self.xml.rgb("radiance", material.emission),
        }
        self.xml.close();
        Ok(())
    }
}
