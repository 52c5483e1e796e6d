//! Scene folders of thesis S1 (docs/inside/transport.md): `scene.json` beside `Objects/*.obj`,
//! `Textures/*.bmp` and `HDRI/*.hdr`.
//!
//! Conventions that affect the image:
//! - Space is left-handed: the original program mirrors meshes along z when it reads them, and its
//!   camera looks along +z. Here meshes stay unchanged, and the camera, which looks along -z, and
//!   the lights are mirrored instead.
//! - `focalLength`, `sensorWidth` and `sensorHeight` are in metres, which are the scene's units.
//!   The defaults are 1280 x 720 pixels (`xRes`, `yRes`), a sensor 36 mm wide and a focal length of
//!   35 mm.
//! - The camera has a thin lens if `aperture`, an f-number, is given and `bokeh` is not false. The
//!   focal plane is at `focusDistance` plus the focal length; the original program focuses on a
//!   sphere of that radius.
//! - A material uses the textures `Textures/NAME_albedo.bmp`, `_emission`, `_roughness`,
//!   `_metallic` and `_normal` that exist; they replace its values. 8-bit texels are decoded by the
//!   sRGB curve and divided by 255; the original program uses a power of 2.2 and divides by 256.
//! - Defaults are 0.5 for `albedo` and 1 for `roughness`. `eta` is the index of refraction; without
//!   it the index follows from `specular`, with a reflectance of 0.08 at normal incidence for 1.
//! - `radiance` of a point light is its radiant intensity. With `n` lights the original program
//!   selects one and divides by `n / 2 pi`, which is not a probability: its lights are `2 pi / n^2`
//!   times as bright.
//! - `xOffset` rotates the HDRI by that fraction of a full turn.
//!
//! Additions: `radiance` of `pointLights` is optional, and PNG, TGA and EXR files are found under
//! the same names.

mod relaxed;
mod supported;

pub(super) use self::supported::SUPPORTED;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use serde_json::Value as Json;

use super::images::ImageCache;
use super::obj::{Front, Smoothing, load_mesh};
use super::scn::reader::{Diagnostics, JsonObject, describe, truncated};
use super::{MissingTextures, default_scene, read_file, with_lenient_hint};
use crate::names::UniqueNames;
use lumbre_light::scene::desc::{
    CameraDesc, DEFAULT_MATERIAL, EntityDesc, EnvironmentDesc, EnvironmentSource, LightDesc,
    LightKind, MAX_SIDE, MaterialDesc, MeshDesc, Optics, SceneDesc, ShapeDesc, TextureDesc,
    TextureSlot,
};
use lumbre_light::scene::{Note, SceneError};

/// Name of the file that makes a folder a scene.
pub(super) const SCENE_FILE: &str = "scene.json";

/// Greatest size of the scene file in bytes.
const MAX_JSON_BYTES: u64 = 16 << 20;
/// Default width of the sensor and default focal length in metres.
const SENSOR_WIDTH: f64 = 0.036;
const FOCAL_LENGTH: f64 = 0.035;
/// Default albedo, grey.
const ALBEDO: f32 = 0.5;
/// File extensions of textures, in order of preference.
const IMAGE_EXTENSIONS: [&str; 4] = ["bmp", "png", "tga", "exr"];

/// Keys of the camera.
const CAMERA_KEYS: [&str; 9] = [
    "xRes",
    "yRes",
    "position",
    "focalLength",
    "focusDistance",
    "aperture",
    "sensorWidth",
    "sensorHeight",
    "bokeh",
];

/// A number of a material: key, least value, greatest value, and a setter.
type NumberParam = (&'static str, f64, f64, fn(&mut MaterialDesc, f32));
const NUMBER_PARAMS: [NumberParam; 11] = [
    ("roughness", 0.0, 1.0, |m, x| m.roughness = x),
    ("metallic", 0.0, 1.0, |m, x| m.metallic = x),
    ("transmission", 0.0, 1.0, |m, x| m.opacity = 1.0 - x),
    ("clearcoat", 0.0, 1.0, |m, x| m.clearcoat = x),
    ("clearcoatgloss", 0.0, 1.0, |m, x| m.clearcoat_gloss = x),
    ("anisotropic", 0.0, 1.0, |m, x| m.anisotropic = x),
    ("speculartint", 0.0, 1.0, |m, x| m.specular_tint = x),
    ("sheen", 0.0, 1.0, |m, x| m.sheen = x),
    ("sheentint", 0.0, 1.0, |m, x| m.sheen_tint = x),
    ("subsurface", 0.0, 1.0, |m, x| m.subsurface = x),
    // F0 = 0.08 specular, as an index; `eta`, which is read afterwards, replaces it.
    ("specular", 0.0, 1.0, |m, x| {
        m.ior = (1.0 + (0.08 * x).sqrt()) / (1.0 - (0.08 * x).sqrt())
    }),
];

/// Texture slots by the suffixes of their files' names.
const TEXTURE_SUFFIXES: [(&str, TextureSlot); 5] = [
    ("albedo", TextureSlot::BaseColor),
    ("emission", TextureSlot::Emission),
    ("roughness", TextureSlot::Roughness),
    ("metallic", TextureSlot::Metallic),
    ("normal", TextureSlot::Normal),
];

/// Returns whether the first bytes of a file look like a scene of this format.
pub(super) fn sniff(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(head);
    head.trim_start_matches('\u{feff}')
        .trim_start()
        .starts_with('{')
        && head.contains("xRes")
}

/// Loads a scene and everything that it refers to.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let bytes = read_file(path, MAX_JSON_BYTES)?;
    let mut diagnostics = Diagnostics {
        file: path.to_owned(),
        missing,
        notes: Vec::new(),
    };
    let json =
        relaxed::parse(&String::from_utf8_lossy(&bytes)).map_err(|([line, column], problem)| {
            diagnostics.error(format!("line {line}, column {column}"), problem)
        })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let desc = FolderLoader {
        folder,
        diagnostics: &mut diagnostics,
        images: ImageCache::default(),
    }
    .scene(&json)?;
    Ok((desc, diagnostics.notes))
}

/// State while a scene folder is loaded.
struct FolderLoader<'a> {
    folder: &'a Path,
    diagnostics: &'a mut Diagnostics,
    images: ImageCache,
}

impl FolderLoader<'_> {
    /// Reads the document.
    fn scene(&mut self, json: &Json) -> Result<SceneDesc, SceneError> {
        let mut root = JsonObject::new("", json, self.diagnostics)?;
        let (camera, resolution) = match root.get("camera") {
            Some((place, json)) => self.camera(&place, json)?,
            None => self.camera("camera", &Json::Object(Default::default()))?,
        };
        let mut materials: Vec<MaterialDesc> = Vec::new();
        let mut known = BTreeSet::new();
        for (place, json) in root.list("materials", self.diagnostics)? {
            let material = self.material(&place, json)?;
            if known.insert(material.name.clone()) {
                materials.push(material);
            } else {
                let name = truncated(&material.name);
                self.diagnostics.note(
                    place,
                    format!("a material named `{name}` is already defined; this one is ignored"),
                );
            }
        }
        if known.insert(DEFAULT_MATERIAL.to_owned()) {
            materials.push(MaterialDesc {
                base_color: Vec3::splat(ALBEDO),
                ..MaterialDesc::new(DEFAULT_MATERIAL)
            });
        }
        let mut names = UniqueNames::default();
        let mut meshes = BTreeMap::new();
        let mut entities = Vec::new();
        for (place, json) in root.list("objects", self.diagnostics)? {
            entities.push(self.object(&place, json, &known, &mut meshes, &mut names)?);
        }
        let mut lights = Vec::new();
        for (place, json) in root.list("pointlights", self.diagnostics)? {
            let kind = self.point(&place, json)?;
            lights.push(LightDesc::new(names.allocate("point"), kind));
        }
        let environment = match root.get("hdri") {
            Some((place, json)) => self.environment(&place, json)?,
            None => None,
        };
        root.note_unknown(
            ["camera", "materials", "objects", "hdri", "pointLights"],
            self.diagnostics,
        );
        Ok(SceneDesc {
            views: Vec::new(),
            resolution,
            max_depth: default_scene::DEFAULT_MAX_DEPTH,
            camera,
            materials: materials.into(),
            entities: entities.into(),
            lights,
            environment,
        })
    }

    /// Reads the camera and the resolution.
    fn camera(&mut self, place: &str, json: &Json) -> Result<(CameraDesc, [u32; 2]), SceneError> {
        let mut o = JsonObject::new(place, json, self.diagnostics)?;
        let resolution = self.resolution(&mut o)?;
        let position = match o.get("position") {
            Some((place, json)) => {
                mirrored(self.vector(&place, json, ["x", "y", "z"], Vec3::ZERO)?)
            }
            None => Vec3::ZERO,
        };
        let diagnostics = &*self.diagnostics;
        let mut positive = |key: &str| match o.number(key, diagnostics)? {
            None => Ok(None),
            Some((_, x)) if x > 0.0 && x <= 1e6 => Ok(Some(x)),
            Some((at, x)) => {
                Err(diagnostics.error(at, format!("expected a positive number, found {x}")))
            }
        };
        let focal = positive("focallength")?.unwrap_or(FOCAL_LENGTH);
        let [width, height] = resolution.map(f64::from);
        let sensor_width = positive("sensorwidth")?.unwrap_or(SENSOR_WIDTH);
        let sensor_height = positive("sensorheight")?.unwrap_or(sensor_width * height / width);
        let (aperture, focus) = (positive("aperture")?, positive("focusdistance")?);
        let has_lens = !matches!(o.get("bokeh"), Some((_, Json::Bool(false))));
        let pixel_aspect = sensor_height * width / (sensor_width * height);
        if (pixel_aspect - 1.0).abs() > 1e-3 {
            self.diagnostics.note(
                o.key_path("sensorHeight"),
                "sensor and resolution do not give square pixels; the height of the sensor is used",
            );
        }
        o.note_unknown(CAMERA_KEYS, self.diagnostics);
        let lens = aperture.filter(|_| has_lens);
        let camera = CameraDesc {
            position,
            target: position + Vec3::NEG_Z,
            up: Vec3::Y,
            focus_distance: lens.and(focus).map(|distance| (distance + focal) as f32),
            optics: Optics::default()
                .with_f_number(lens.map(|x| x as f32))
                .with_focal_length(Some(focal as f32))
                .with_sensor_height(Some(sensor_height as f32)),
            ..CameraDesc::default()
        };
        if camera.position == camera.target {
            return Err(self.diagnostics.error(
                place,
                "the position is too far from the origin for a view direction",
            ));
        }
        Ok((camera, resolution))
    }

    /// Reads the image resolution, keys of the camera.
    fn resolution(&self, camera: &mut JsonObject) -> Result<[u32; 2], SceneError> {
        let mut resolution = default_scene::DEFAULT_RESOLUTION;
        for (n, key) in resolution.iter_mut().zip(["xres", "yres"]) {
            if let Some((at, x)) = camera.number(key, self.diagnostics)? {
                if x.fract() != 0.0 || x < 1.0 || x > f64::from(MAX_SIDE) {
                    let problem =
                        format!("expected a whole number from 1 to {MAX_SIDE}, found {x}");
                    return Err(self.diagnostics.error(at, problem));
                }
                *n = x as u32;
            }
        }
        Ok(resolution)
    }

    /// Reads a material and its textures.
    fn material(&mut self, place: &str, json: &Json) -> Result<MaterialDesc, SceneError> {
        let mut o = JsonObject::new(place, json, self.diagnostics)?;
        let Some((_, name)) = o.string("name", self.diagnostics)? else {
            return Err(self.diagnostics.error(place, "a material needs a `name`"));
        };
        let mut m = MaterialDesc {
            base_color: Vec3::splat(ALBEDO),
            clearcoat_gloss: 0.0,
            ..MaterialDesc::new(name)
        };
        for (key, least, greatest) in [("albedo", 0.0, 1.0), ("emission", 0.0, 1e9)] {
            let Some((at, json)) = o.get(key) else {
                continue;
            };
            let color = self.vector(&at, json, ["r", "g", "b"], Vec3::ZERO)?;
            let inside = color.clamp(Vec3::splat(least), Vec3::splat(greatest));
            if inside != color {
                self.diagnostics.note(
                    &at,
                    format!("{color} is outside {least} to {greatest}; {inside} is used"),
                );
            }
            *(if key == "albedo" {
                &mut m.base_color
            } else {
                &mut m.emission
            }) = inside;
        }
        for (key, least, greatest, set) in NUMBER_PARAMS {
            let Some((at, x)) = o.number(key, self.diagnostics)? else {
                continue;
            };
            let inside = x.clamp(least, greatest);
            if inside != x {
                self.diagnostics.note(
                    at,
                    format!("{x} is outside {least} to {greatest}; {inside} is used"),
                );
            }
            set(&mut m, inside as f32);
        }
        match o.number("eta", self.diagnostics)? {
            Some((_, x)) if (1.0..=100.0).contains(&x) => m.ior = x as f32,
            // The original program's default, which means unset.
            Some((_, 0.0)) | None => {}
            Some((at, x)) => {
                return Err(self.diagnostics.error(
                    at,
                    format!("expected an index of refraction from 1 to 100, found {x}"),
                ));
            }
        }
        let known = NUMBER_PARAMS
            .iter()
            .map(|p| p.0)
            .chain(["name", "albedo", "emission", "eta"]);
        o.note_unknown(known, self.diagnostics);
        self.textures(place, name, &mut m)?;
        Ok(m)
    }

    /// Sets the textures of a material that exist; a texture replaces its value.
    fn textures(
        &mut self,
        place: &str,
        name: &str,
        m: &mut MaterialDesc,
    ) -> Result<(), SceneError> {
        for (suffix, slot) in TEXTURE_SUFFIXES {
            if let Some(texture) = self.texture(place, name, suffix)? {
                match slot {
                    TextureSlot::BaseColor => m.base_color = Vec3::ONE,
                    TextureSlot::Emission => m.emission = Vec3::ONE,
                    _ => {}
                }
                m.set_texture(slot, Some(texture));
            }
        }
        Ok(())
    }

    /// Returns the texture of a material with this suffix, or `None` if there is no such file.
    fn texture(
        &mut self,
        place: &str,
        name: &str,
        suffix: &str,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let stem = self.file_stem(place, name)?;
        let paths = IMAGE_EXTENSIONS.map(|extension| {
            self.folder
                .join("Textures")
                .join(format!("{stem}_{suffix}.{extension}"))
        });
        let Some(path) = paths.into_iter().find(|path| path.exists()) else {
            return Ok(None);
        };
        match self.images.load(&path, &mut self.diagnostics.notes) {
            Ok(texture) => Ok(Some(texture)),
            Err(e) if self.diagnostics.missing == MissingTextures::Note => {
                self.diagnostics
                    .note(place, format!("{e}; the material's constant value is used"));
                Ok(None)
            }
            Err(e) => Err(with_lenient_hint(self.diagnostics.at_reference(place, e))),
        }
    }

    /// Reads an object; its mesh is loaded once per file.
    fn object(
        &mut self,
        place: &str,
        json: &Json,
        materials: &BTreeSet<String>,
        meshes: &mut BTreeMap<PathBuf, Arc<MeshDesc>>,
        names: &mut UniqueNames,
    ) -> Result<EntityDesc, SceneError> {
        let mut o = JsonObject::new(place, json, self.diagnostics)?;
        let Some((at, name)) = o.string("name", self.diagnostics)? else {
            return Err(self.diagnostics.error(
                place,
                "an object needs a `name`, the name of its file in Objects",
            ));
        };
        let path = self
            .folder
            .join("Objects")
            .join(format!("{}.obj", self.file_stem(&at, name)?));
        let mesh = match meshes.get(&path) {
            Some(mesh) => mesh.clone(),
            None => {
                let read = load_mesh(
                    &path,
                    DEFAULT_MATERIAL,
                    (Front::CounterClockwise, Smoothing::Groups),
                    &mut self.diagnostics.notes,
                );
                let mesh = Arc::new(read.map_err(|e| self.diagnostics.at_reference(&at, e))?);
                meshes.insert(path, mesh.clone());
                mesh
            }
        };
        let material = match o.string("material", self.diagnostics)? {
            None => DEFAULT_MATERIAL,
            Some((_, name)) if materials.contains(name) => name,
            Some((at, name)) => {
                self.diagnostics.note(
                    at,
                    format!("no material is named `{}`; grey is used", truncated(name)),
                );
                DEFAULT_MATERIAL
            }
        };
        o.note_unknown(["name", "material"], self.diagnostics);
        Ok(EntityDesc {
            material: Some(material.to_owned()),
            ..EntityDesc::new(names.allocate(name), ShapeDesc::Mesh(mesh))
        })
    }

    /// Reads a point light.
    fn point(&mut self, place: &str, json: &Json) -> Result<LightKind, SceneError> {
        let mut o = JsonObject::new(place, json, self.diagnostics)?;
        let mut vector = |key: &str, components, default| match o.get(key) {
            Some((at, json)) => self.vector(&at, json, components, Vec3::ZERO),
            None => Ok(default),
        };
        let position = mirrored(vector("position", ["x", "y", "z"], Vec3::ZERO)?);
        let intensity = vector("radiance", ["r", "g", "b"], Vec3::ONE)?;
        if intensity.min_element() < 0.0 {
            return Err(self.diagnostics.error(
                o.key_path("radiance"),
                format!("expected a radiance of 0 or more, found {intensity}"),
            ));
        }
        o.note_unknown(["position", "radiance"], self.diagnostics);
        Ok(LightKind::Point {
            position,
            intensity,
        })
    }

    /// Reads the environment; `None` if it has neither a file nor a colour.
    fn environment(
        &mut self,
        place: &str,
        json: &Json,
    ) -> Result<Option<EnvironmentDesc>, SceneError> {
        let mut o = JsonObject::new(place, json, self.diagnostics)?;
        let offset = o
            .number("xoffset", self.diagnostics)?
            .map_or(0.0, |(_, x)| x);
        if let Some((at, y)) = o.number("yoffset", self.diagnostics)?
            && y != 0.0
        {
            self.diagnostics.note(
                at,
                "an environment can be rotated about the vertical axis only; ignored",
            );
        }
        let source = match (o.string("name", self.diagnostics)?, o.get("color")) {
            (Some((at, name)), _) => {
                let path = self
                    .folder
                    .join("HDRI")
                    .join(format!("{}.hdr", self.file_stem(&at, name)?));
                let map = self.images.load(&path, &mut self.diagnostics.notes);
                Some(EnvironmentSource::Map(
                    map.map_err(|e| self.diagnostics.at_reference(&at, e))?,
                ))
            }
            (None, Some((at, json))) => {
                let color = self.vector(&at, json, ["r", "g", "b"], Vec3::ZERO)?;
                Some(EnvironmentSource::Color(color.max(Vec3::ZERO)))
            }
            (None, None) => None,
        };
        o.note_unknown(["name", "xOffset", "yOffset", "color"], self.diagnostics);
        // The file's column u is at the angle 2 pi (u - 1/2 - offset) of x + i z, mirrored, from
        // +x: a quarter turn from the columns here.
        let rotation_deg = (90.0 + 360.0 * offset.rem_euclid(1.0)) as f32;
        Ok(source.map(|source| EnvironmentDesc {
            rotation_deg,
            ..EnvironmentDesc::new(source)
        }))
    }

    /// Returns a name after checking that it can be part of a file name and is not a path.
    fn file_stem<'n>(&self, place: &str, name: &'n str) -> Result<&'n str, SceneError> {
        if name.is_empty()
            || name.contains(['/', '\\', '\0'])
            || name.starts_with("..")
            || name.contains(':')
        {
            let problem = format!(
                "`{}` is not the name of a file in the scene's folder",
                truncated(name)
            );
            return Err(self.diagnostics.error(place, problem));
        }
        Ok(name)
    }

    /// Reads three numbers by their keys; missing ones have the default value.
    fn vector(
        &mut self,
        place: &str,
        json: &Json,
        names: [&str; 3],
        default: Vec3,
    ) -> Result<Vec3, SceneError> {
        if !json.is_object() {
            let problem = format!(
                "expected {{{}: .., {}: .., {}: ..}}, found {}",
                names[0],
                names[1],
                names[2],
                describe(json)
            );
            return Err(self.diagnostics.error(place, problem));
        }
        let mut o = JsonObject::new(place, json, self.diagnostics)?;
        let mut v = default;
        for (i, name) in names.into_iter().enumerate() {
            if let Some((at, x)) = o.number(name, self.diagnostics)? {
                if x.abs() > f64::from(lumbre_light::scene::desc::MAX_COORDINATE) {
                    return Err(self.diagnostics.error(
                        at,
                        format!(
                            "{x} is out of range; the greatest magnitude is {:e}",
                            lumbre_light::scene::desc::MAX_COORDINATE
                        ),
                    ));
                }
                v[i] = x as f32;
            }
        }
        o.note_unknown(names, self.diagnostics);
        Ok(v)
    }
}

/// Converts a point or direction from the file's left-handed space.
fn mirrored(v: Vec3) -> Vec3 {
    v * Vec3::new(1.0, 1.0, -1.0)
}
