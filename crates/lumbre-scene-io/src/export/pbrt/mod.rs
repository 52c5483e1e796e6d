//! Export of a scene as a folder of files for pbrt-v4: `scene.pbrt`, `meshes/*.ply`,
//! `textures/*.{png,exr}`.
//!
//! `Scale -1 1 1` before the camera makes the world of the file right-handed, so that all
//! coordinates are those of the scene. Conventions are those of the loader of the same format in
//! [`crate::load`]. A feature without a counterpart in pbrt is replaced by the nearest one,
//! with a [`Note`].

mod surface;
mod text;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use self::surface::{Surfaces, Written};
use self::text::Text;
use super::lights::{image_axes, is_whole};
use super::mesh::MeshWriter;
use super::texture::TexelConversion;
use super::texture::TextureWriter;
use super::uses::{self, InstanceKey, MeshUses};
use super::{Exported, OutputFolder, identifier, sphere_place};
use crate::load::environment_square;
use crate::model_differences;
use crate::names::UniqueNames;
use lumbre_light::scene::compile::LinearTexels;
use lumbre_light::scene::desc::{
    CameraDesc, CameraKind, ConeEdge, EntityDesc, EnvironmentSource, LightKind, MeshDesc,
    SceneDesc, ShapeDesc,
};
use lumbre_light::scene::{Note, SceneError};

/// Name of the scene file in its folder.
pub(super) const SCENE_FILE: &str = "scene.pbrt";

/// Beginning of a scene file written by an export.
pub(super) const MARK: &str = "# Written by Lumbre";

/// State while a scene is exported.
struct PbrtWriter<'a> {
    desc: &'a SceneDesc,
    uses: MeshUses<'a>,
    text: Text,
    folder: OutputFolder,
    textures: TextureWriter,
    meshes: MeshWriter,
    ids: UniqueNames,
    /// Materials by index; a scene without materials has one.
    surfaces: Vec<Written>,
    /// Names of objects by the properties that their instances share.
    objects: BTreeMap<InstanceKey, String>,
    notes: Vec<Note>,
}

/// Exports a scene for pbrt-v4 to a folder, which is created; files with the same names are
/// replaced.
///
/// # Errors
/// Fails if the folder or a file cannot be written, or if a sphere's transform makes it an
/// ellipsoid.
pub fn pbrt(desc: &SceneDesc, folder: &Path) -> Result<Exported, SceneError> {
    let (desc, moved) = uses::prepared(desc);
    let desc = &*desc;
    let mut writer = PbrtWriter {
        desc,
        uses: MeshUses::new(desc),
        text: Text::default(),
        folder: OutputFolder::new(folder),
        textures: TextureWriter::default(),
        meshes: MeshWriter::default(),
        ids: UniqueNames::default(),
        surfaces: Vec::new(),
        objects: BTreeMap::new(),
        notes: moved.into_iter().collect(),
    };
    writer.picture();
    writer.text.line("WorldBegin");
    writer.lights()?;
    writer.materials()?;
    writer.entities()?;
    let PbrtWriter {
        text,
        mut folder,
        notes,
        ..
    } = writer;
    let version = env!("CARGO_PKG_VERSION");
    let text = format!("{MARK} {version}: for pbrt-v4\n{}", text.finish());
    let scene = folder.write_file(SCENE_FILE, text.as_bytes())?;
    Ok(Exported {
        scene,
        files: folder.files,
        notes,
    })
}

impl PbrtWriter<'_> {
    /// Writes what precedes the world: depth, film, filter and camera.
    fn picture(&mut self) {
        let desc = self.desc;
        let [width, height] = desc.resolution;
        let text = &mut self.text;
        text.directive("Integrator", "path");
        text.number("integer maxdepth", desc.max_depth.saturating_sub(1));
        text.directive("Sampler", "independent");
        text.number("integer pixelsamples", 16);
        text.directive("Film", "rgb");
        text.number("integer xresolution", width);
        text.number("integer yresolution", height);
        text.directive("PixelFilter", "box");
        text.number("float xradius", 0.5);
        text.number("float yradius", 0.5);
        self.camera(&desc.camera);
        for (name, _) in &desc.views {
            self.notes.push(Note::new(
                "",
                format!("views.{name}"),
                "pbrt supports one camera; this view is left out",
            ));
        }
    }

    /// Writes the camera.
    fn camera(&mut self, camera: &CameraDesc) {
        let [width, height] = self.desc.resolution.map(f64::from);
        let (p, t, u) = (camera.position, camera.target, camera.up);
        if camera.kind == CameraKind::Spherical {
            self.spherical_camera(p, t - p, u);
            return;
        }
        // The camera space of pbrt is left-handed.
        if !camera.window.mirrors() {
            self.text.line("Scale -1 1 1");
        }
        self.look_at([p, t, u]);
        // Half extents of the picture and its middle, in units of half its height.
        let ([_, shown], [right, down]) = (camera.window.size(), camera.window.offset());
        let across = (width / height) as f32;
        let (right, up) = (2.0 * right * across, -2.0 * down);
        let edges = [right - across, right + across, up - 1.0, up + 1.0];
        let screen = |half: f32| {
            let [a, b, c, d] = edges.map(|edge| edge * half);
            format!("\"float screenwindow\" [ {a} {b} {c} {d} ]")
        };
        let text = &mut self.text;
        if camera.kind == CameraKind::Orthographic {
            text.directive("Camera", "orthographic");
            text.parameter(&screen(0.5 * camera.view_height * shown));
            return;
        }
        let half = (0.5 * f64::from(camera.view_deg()).to_radians()).tan() * f64::from(shown);
        text.directive("Camera", "perspective");
        // The field of view is that of the smaller side, to which the screen refers.
        let smaller = half * (width / height).min(1.0);
        text.number("float fov", (2.0 * smaller.atan()).to_degrees() as f32);
        if (right, up) != (0.0, 0.0) {
            text.parameter(&screen((half / smaller) as f32));
        }
        let lens = camera.lens_diameter();
        if lens > 0.0 {
            let focus = camera.focus_distance.unwrap_or_else(|| p.distance(t));
            text.number("float lensradius", 0.5 * lens);
            text.number("float focaldistance", focus);
        }
    }

    /// Writes a spherical camera. The longitudes of pbrt grow from the right to the left, so there
    /// is no exchange of sides, and the forward direction of pbrt, a quarter of the picture from
    /// its left edge, is on the left of the camera.
    fn spherical_camera(&mut self, position: Vec3, axis: Vec3, up: Vec3) {
        let left = up.cross(axis).normalize_or(Vec3::NEG_X);
        let above = axis.cross(left).normalize_or(up);
        self.look_at([position, position + left, above]);
        self.text.directive("Camera", "spherical");
        self.text.string("string mapping", "equirectangular");
    }

    /// Writes the transform of a camera at a position that looks at a target, with an up direction.
    fn look_at(&mut self, [p, t, u]: [Vec3; 3]) {
        self.text.line(&format!(
            "LookAt {} {} {}  {} {} {}  {} {} {}",
            p.x, p.y, p.z, t.x, t.y, t.z, u.x, u.y, u.z
        ));
    }

    /// Writes the materials.
    fn materials(&mut self) -> Result<(), SceneError> {
        let surfaces = Surfaces {
            desc: self.desc,
            text: &mut self.text,
            folder: &mut self.folder,
            textures: &mut self.textures,
            ids: &mut self.ids,
            notes: &mut self.notes,
        };
        self.surfaces = surfaces.write()?;
        Ok(())
    }

    /// Writes the entities: meshes that several entities share as instances, unless they emit
    /// light.
    fn entities(&mut self) -> Result<(), SceneError> {
        let desc = self.desc;
        for entity in &desc.entities {
            self.notes.extend(uses::direction_note(entity, "pbrt"));
            match &entity.shape {
                ShapeDesc::Sphere { radius } => self.sphere(entity, *radius)?,
                ShapeDesc::Mesh(mesh) => {
                    let key = self.uses.key(entity, mesh);
                    let map = entity.to_near_world();
                    let emits = key.1.iter().any(|row| self.surfaces[*row].light.is_some());
                    let stem = identifier(&entity.name);
                    if self.uses.is_shared(&key) && !emits {
                        self.instance(mesh, key, &map, &stem)?;
                    } else {
                        self.text.begin("Attribute");
                        self.text.transform(&map);
                        self.mesh_shapes(mesh, &key.1, &stem)?;
                        self.text.end("Attribute");
                    }
                }
            }
        }
        Ok(())
    }

    /// Writes one instance of a mesh, and its object before the first one.
    fn instance(
        &mut self,
        mesh: &MeshDesc,
        key: InstanceKey,
        map: &DAffine3,
        stem: &str,
    ) -> Result<(), SceneError> {
        let object = match self.objects.get(&key) {
            Some(object) => object.clone(),
            None => {
                let object = self.ids.allocate(&format!("{stem}_object"));
                self.text.line(&format!("ObjectBegin \"{object}\""));
                self.mesh_shapes(mesh, &key.1, stem)?;
                self.text.line("ObjectEnd");
                self.objects.insert(key, object.clone());
                object
            }
        };
        self.text.begin("Attribute");
        self.text.transform(map);
        self.text.line(&format!("ObjectInstance \"{object}\""));
        self.text.end("Attribute");
        Ok(())
    }

    /// Writes a mesh, one shape for each of its materials.
    fn mesh_shapes(
        &mut self,
        mesh: &MeshDesc,
        rows: &[usize],
        stem: &str,
    ) -> Result<(), SceneError> {
        if !mesh.colors.is_empty() {
            let place = format!("entities.{stem}");
            self.notes.push(Note::new(
                "",
                &place,
                "vertex colours are not supported by pbrt; they are left out",
            ));
        }
        for (slot, row) in rows.iter().enumerate() {
            let slot = slot as u32;
            if !mesh.triangle_slot.contains(&slot) {
                continue;
            }
            let file = self
                .meshes
                .file(mesh, slot, false, stem, &mut self.folder)?;
            self.surface(*row);
            self.text.directive("Shape", "plymesh");
            self.text.string("string filename", &file);
            self.alpha(*row);
        }
        Ok(())
    }

    /// Writes the material of a shape, and its area light if it emits.
    fn surface(&mut self, row: usize) {
        let surface = &self.surfaces[row];
        self.text
            .line(&format!("NamedMaterial \"{}\"", surface.name));
        if let Some(light) = &surface.light {
            self.text.line(light);
        }
    }

    /// Writes the parameter of a shape for the mask of its material.
    fn alpha(&mut self, row: usize) {
        if let Some(alpha) = &self.surfaces[row].alpha {
            self.text.parameter(alpha);
        }
    }

    /// Writes a sphere.
    fn sphere(&mut self, entity: &EntityDesc, radius: f32) -> Result<(), SceneError> {
        let (center, radius) = sphere_place(entity, radius)?;
        let row = self.uses.sphere_row(entity);
        let rotation = uses::sphere_rotation(self.desc.materials.get(row));
        let linear = rotation.unwrap_or(DMat3::IDENTITY);
        self.text.begin("Attribute");
        let map = DAffine3::from_mat3_translation(linear, center.as_dvec3());
        self.text.transform(&map);
        self.surface(row);
        self.text.directive("Shape", "sphere");
        self.text.number("float radius", radius);
        self.alpha(row);
        self.text.end("Attribute");
        Ok(())
    }

    /// Writes the lights without a surface, and the environment.
    fn lights(&mut self) -> Result<(), SceneError> {
        for light in &self.desc.lights {
            let text = &mut self.text;
            match light.kind {
                LightKind::Point {
                    position,
                    intensity,
                } => {
                    text.directive("LightSource", "point");
                    text.vector("rgb I", intensity);
                    text.vector("point3 from", position);
                }
                LightKind::Spot {
                    position,
                    direction,
                    intensity,
                    cone,
                    image: Some(ref image),
                } if is_whole(image, direction, &cone) => {
                    let conversion = TexelConversion::Light(intensity);
                    let file = self
                        .textures
                        .file(&image.texture, conversion, &mut self.folder)?;
                    text.begin("Attribute");
                    let axes = image_axes(image, direction);
                    text.transform(&DAffine3::from_mat3_translation(axes, position.as_dvec3()));
                    text.directive("LightSource", "projection");
                    text.string("string filename", &file);
                    let half = image.right.length().min(image.up.length());
                    text.number("float fov", 2.0 * half.atan().to_degrees());
                    text.end("Attribute");
                    let place = format!("lights.{}", light.name);
                    self.notes
                        .push(Note::new("", &place, model_differences::PBRT_PROJECTION));
                    if image.even {
                        let text = "pbrt dims the edges of a projected image, which has the same \
                                    intensity in all directions there";
                        self.notes.push(Note::new("", &place, text));
                    }
                }
                LightKind::Spot {
                    position,
                    direction,
                    intensity,
                    cone,
                    ref image,
                } => {
                    if image.is_some() {
                        let place = format!("lights.{}", light.name);
                        let text =
                            "an image with a falloff has no counterpart in pbrt; it is left out";
                        self.notes.push(Note::new("", &place, text));
                    }
                    text.directive("LightSource", "spot");
                    text.vector("rgb I", intensity);
                    text.vector("point3 from", position);
                    text.vector("point3 to", position + direction.normalize_or(Vec3::Z));
                    text.number("float coneangle", cone.cutoff_deg);
                    text.number("float conedeltaangle", cone.cutoff_deg - cone.beam_deg);
                    let place = format!("lights.{}", light.name);
                    let message = match cone.edge {
                        ConeEdge::Linear => model_differences::PBRT_SPOT,
                        ConeEdge::Smooth => model_differences::PBRT_SMOOTH_SPOT,
                    };
                    self.notes.push(Note::new("", &place, message));
                }
                LightKind::Goniometric {
                    position,
                    intensity,
                    ref map,
                    rotation_deg,
                } => {
                    let square = environment_square(map, rotation_deg);
                    let file = self.textures.environment_map(&square, &mut self.folder)?;
                    // pbrt exchanges y and z of the light's space.
                    let axes = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
                    text.begin("Attribute");
                    text.transform(&DAffine3::from_mat3_translation(axes, position.as_dvec3()));
                    text.directive("LightSource", "goniometric");
                    text.vector("rgb I", intensity);
                    text.string("string filename", &file);
                    text.end("Attribute");
                    let place = format!("lights.{}", light.name);
                    let grey = |[r, g, b]: [f32; 3]| r == g && g == b;
                    if !LinearTexels::of(&square.texels, true).iter().all(grey) {
                        self.notes.push(Note::new(
                            "",
                            &place,
                            model_differences::PBRT_GONIOMETRIC_COLOR,
                        ));
                    }
                    self.notes
                        .push(Note::new("", &place, model_differences::EQUAL_AREA));
                }
                LightKind::Directional {
                    direction,
                    irradiance,
                } => {
                    text.directive("LightSource", "distant");
                    text.vector("rgb L", irradiance);
                    text.vector("point3 from", Vec3::ZERO);
                    text.vector("point3 to", direction.normalize_or(Vec3::Z));
                }
            }
        }
        self.environment()
    }

    /// Writes the environment.
    fn environment(&mut self) -> Result<(), SceneError> {
        let Some(environment) = &self.desc.environment else {
            return Ok(());
        };
        match &environment.source {
            EnvironmentSource::Color(color) => {
                self.text.directive("LightSource", "infinite");
                self.text.vector("rgb L", *color * environment.scale);
            }
            EnvironmentSource::Map(map) => {
                let square = environment_square(map, environment.rotation_deg);
                let file = self.textures.environment_map(&square, &mut self.folder)?;
                self.text.directive("LightSource", "infinite");
                self.text.string("string filename", &file);
                self.text.number("float scale", environment.scale);
                self.notes
                    .push(Note::new("", "environment", model_differences::EQUAL_AREA));
            }
        }
        Ok(())
    }
}
