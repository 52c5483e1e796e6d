//! The scene folders of the second source: `scene.json` beside `Objects/*.obj`, `Textures/*.bmp` and `HDRI/*.hdr`.
//!
//! Conventions, as far as they decide a picture:
//! - Its space is left-handed: its program mirrors meshes along z when it reads them, and its camera looks along +z. Here
//!   meshes stay as they are, and the camera, which looks along -z, and the lights are mirrored instead.
//! - `xRes`, `yRes`, `focalLength`, `sensorWidth` and `sensorHeight` in metres, which are the scene's units; without them
//!   1280 x 720 pixels on a sensor 36 mm wide behind 35 mm.
//! - A lens is one where `aperture`, an f-number, is given and `bokeh` is not false. It is in focus on a plane at
//!   `focusDistance` and a focal length more; the program has a sphere of that radius.
//! - A material has the textures `Textures/NAME_albedo.bmp`, `_emission`, `_roughness`, `_metallic` and `_normal` that are
//!   there; they replace its values. Eight bits are decoded by the curve of sRGB and over 255; there by a power of 2.2 and
//!   over 256.
//! - `albedo` is 0.5 and `roughness` 1 where nothing says otherwise; `eta` is the index of refraction, or follows from
//!   `specular`, of which the reflectance straight on is 0.08.
//! - `radiance` of a point light is its radiant intensity. Of `n` lights the program draws one and divides by `n / 2 pi`,
//!   which is no probability: its lights are `2 pi / n^2` times as bright.
//! - `xOffset` of an HDRI turns it by that part of a whole turn.
//!
//! Beyond the source, `pointLights` may leave out `radiance`, and PNG, TGA and EXR are found under the same names.

mod reads;
mod relaxed;

pub(super) use self::reads::READS;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use serde_json::Value as Json;

use super::images::Pictures;
use super::obj::{Front, load_mesh};
use super::scn::reader::{Object, Report, kind, shorten};
use super::{Missing, missing_texture, read, scn};
use crate::scene::desc::{
    CameraDesc, DEFAULT_MATERIAL, EntityDesc, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, MAX_SIDE,
    MaterialDesc, MeshDesc, Optics, SceneDesc, ShapeDesc, TextureDesc, TextureSlot, Transform,
};
use crate::scene::names::Names;
use crate::scene::{Note, SceneError};

/// The file that makes a folder a scene.
pub(super) const SCENE_FILE: &str = "scene.json";

/// Greatest size of the scene's file in bytes.
const MAX_JSON_BYTES: u64 = 16 << 20;
/// Width of the sensor and focal length in metres where the scene says none.
const SENSOR_WIDTH: f64 = 0.036;
const FOCAL_LENGTH: f64 = 0.035;
/// The grey of surfaces that say no colour.
const ALBEDO: f32 = 0.5;
/// What pictures may be called besides their name.
const PICTURES: [&str; 4] = ["bmp", "png", "tga", "exr"];

/// Numbers of a material: key, least, greatest, and where they go.
type Part = (&'static str, f64, f64, fn(&mut MaterialDesc, f32));
const PARTS: [Part; 11] = [
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
    // F0 = 0.08 specular, and its index; `eta`, which is read after it, replaces it.
    ("specular", 0.0, 1.0, |m, x| m.ior = (1.0 + (0.08 * x).sqrt()) / (1.0 - (0.08 * x).sqrt())),
];

/// Slots by the ends of their files' names.
const MAPS: [(&str, TextureSlot); 5] = [
    ("albedo", TextureSlot::BaseColor),
    ("emission", TextureSlot::Emission),
    ("roughness", TextureSlot::Roughness),
    ("metallic", TextureSlot::Metallic),
    ("normal", TextureSlot::Normal),
];

/// Whether the first bytes of a file look like a scene of this format.
pub(super) fn sniff(head: &[u8]) -> bool {
    let head = String::from_utf8_lossy(head);
    head.trim_start_matches('\u{feff}').trim_start().starts_with('{') && head.contains("xRes")
}

/// Reads a scene and everything that it names.
pub(super) fn load(path: &Path, missing: Missing) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let bytes = read(path, MAX_JSON_BYTES)?;
    let mut report = Report { file: path.to_owned(), missing, notes: Vec::new() };
    let json = relaxed::parse(&String::from_utf8_lossy(&bytes))
        .map_err(|([line, column], problem)| report.error(format!("line {line}, column {column}"), problem))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let desc = Reader { folder, report: &mut report, pictures: Pictures::default() }.scene(&json)?;
    Ok((desc, report.notes))
}

struct Reader<'a> {
    folder: &'a Path,
    report: &'a mut Report,
    pictures: Pictures,
}

impl Reader<'_> {
    fn scene(&mut self, json: &Json) -> Result<SceneDesc, SceneError> {
        let mut root = Object::new("", json, self.report)?;
        let (camera, resolution) = match root.take("camera") {
            Some((place, json)) => self.camera(&place, json)?,
            None => self.camera("camera", &Json::Object(Default::default()))?,
        };
        let mut materials: Vec<MaterialDesc> = Vec::new();
        let mut known = BTreeSet::new();
        for (place, json) in root.list("materials", self.report)? {
            let material = self.material(&place, json)?;
            if known.insert(material.name.clone()) {
                materials.push(material);
            } else {
                let name = shorten(&material.name);
                self.report.note(place, format!("a material named `{name}` came before: this one is never used"));
            }
        }
        if known.insert(DEFAULT_MATERIAL.to_owned()) {
            materials.push(MaterialDesc { base_color: Vec3::splat(ALBEDO), ..MaterialDesc::new(DEFAULT_MATERIAL) });
        }
        let mut names = Names::default();
        let mut meshes = BTreeMap::new();
        let mut entities = Vec::new();
        for (place, json) in root.list("objects", self.report)? {
            entities.push(self.object(&place, json, &known, &mut meshes, &mut names)?);
        }
        let mut lights = Vec::new();
        for (place, json) in root.list("pointlights", self.report)? {
            lights.push(LightDesc { name: names.give("point"), kind: self.point(&place, json)? });
        }
        let environment = match root.take("hdri") {
            Some((place, json)) => self.around(&place, json)?,
            None => None,
        };
        root.note_unknown(["camera", "materials", "objects", "hdri", "pointLights"], self.report);
        Ok(SceneDesc {
            views: Vec::new(),
            resolution,
            max_depth: scn::DEFAULT_MAX_DEPTH,
            camera,
            materials,
            entities,
            lights,
            environment,
        })
    }

    fn camera(&mut self, place: &str, json: &Json) -> Result<(CameraDesc, [u32; 2]), SceneError> {
        let mut o = Object::new(place, json, self.report)?;
        let mut resolution = scn::DEFAULT_RESOLUTION;
        for (n, key) in resolution.iter_mut().zip(["xres", "yres"]) {
            if let Some((at, x)) = o.number(key, self.report)? {
                if x.fract() != 0.0 || x < 1.0 || x > f64::from(MAX_SIDE) {
                    let problem = format!("expected a whole number from 1 to {MAX_SIDE}, found {x}");
                    return Err(self.report.error(at, problem));
                }
                *n = x as u32;
            }
        }
        let position = match o.take("position") {
            Some((place, json)) => mirrored(self.triple(&place, json, ["x", "y", "z"], Vec3::ZERO)?),
            None => Vec3::ZERO,
        };
        let report = &*self.report;
        let mut positive = |key: &str| match o.number(key, report)? {
            None => Ok(None),
            Some((_, x)) if x > 0.0 && x <= 1e6 => Ok(Some(x)),
            Some((at, x)) => Err(report.error(at, format!("expected a positive number, found {x}"))),
        };
        let focal = positive("focallength")?.unwrap_or(FOCAL_LENGTH);
        let [width, height] = resolution.map(f64::from);
        let across = positive("sensorwidth")?.unwrap_or(SENSOR_WIDTH);
        let sensor = positive("sensorheight")?.unwrap_or(across * height / width);
        let (aperture, focus) = (positive("aperture")?, positive("focusdistance")?);
        let blurs = !matches!(o.take("bokeh"), Some((_, Json::Bool(false))));
        let even = sensor * width / (across * height);
        if (even - 1.0).abs() > 1e-3 {
            self.report.note(o.at("sensorHeight"), "pixels are square here: the height of the sensor decides");
        }
        let keys = ["xRes", "yRes", "position", "focalLength", "focusDistance", "aperture", "sensorWidth"];
        o.note_unknown(keys.into_iter().chain(["sensorHeight", "bokeh"]), self.report);
        let lens = aperture.filter(|_| blurs);
        let camera = CameraDesc {
            position,
            target: position + Vec3::NEG_Z,
            up: Vec3::Y,
            fov_deg: (2.0 * (0.5 * sensor / focal).atan()).to_degrees() as f32,
            aperture: 0.0,
            focus_distance: lens.and(focus).map(|distance| (distance + focal) as f32),
            optics: Optics {
                f_number: lens.map(|x| x as f32),
                focal_length: Some(focal as f32),
                sensor_height: Some(sensor as f32),
            },
        };
        if camera.position == camera.target {
            return Err(self.report.error(place, "it stands too far from the origin to look anywhere"));
        }
        Ok((camera, resolution))
    }

    fn material(&mut self, place: &str, json: &Json) -> Result<MaterialDesc, SceneError> {
        let mut o = Object::new(place, json, self.report)?;
        let Some((_, name)) = o.string("name", self.report)? else {
            return Err(self.report.error(place, "a material needs a `name`"));
        };
        let mut m = MaterialDesc { base_color: Vec3::splat(ALBEDO), clearcoat_gloss: 0.0, ..MaterialDesc::new(name) };
        for (key, least, greatest) in [("albedo", 0.0, 1.0), ("emission", 0.0, 1e9)] {
            let Some((at, json)) = o.take(key) else { continue };
            let color = self.triple(&at, json, ["r", "g", "b"], Vec3::ZERO)?;
            let inside = color.clamp(Vec3::splat(least), Vec3::splat(greatest));
            if inside != color {
                self.report.note(&at, format!("{color} is outside {least} to {greatest}: {inside} is used"));
            }
            *(if key == "albedo" { &mut m.base_color } else { &mut m.emission }) = inside;
        }
        for (key, least, greatest, set) in PARTS {
            let Some((at, x)) = o.number(key, self.report)? else { continue };
            let inside = x.clamp(least, greatest);
            if inside != x {
                self.report.note(at, format!("{x} is outside {least} to {greatest}: {inside} is used"));
            }
            set(&mut m, inside as f32);
        }
        match o.number("eta", self.report)? {
            Some((_, x)) if (1.0..=100.0).contains(&x) => m.ior = x as f32,
            // The program's default, which says nothing.
            Some((_, 0.0)) | None => {}
            Some((at, x)) => return Err(self.report.error(at, format!("expected an index from 1 to 100, found {x}"))),
        }
        let known = PARTS.iter().map(|p| p.0).chain(["name", "albedo", "emission", "eta"]);
        o.note_unknown(known, self.report);
        for (end, slot) in MAPS {
            if let Some(texture) = self.texture(place, name, end)? {
                match slot {
                    TextureSlot::BaseColor => m.base_color = Vec3::ONE,
                    TextureSlot::Emission => m.emission = Vec3::ONE,
                    _ => {}
                }
                m.set_texture(slot, Some(texture));
            }
        }
        Ok(m)
    }

    /// The picture of a material by its name, if it is there.
    fn texture(&mut self, place: &str, name: &str, end: &str) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let stem = self.plain(place, name)?;
        let paths = PICTURES.map(|extension| self.folder.join("Textures").join(format!("{stem}_{end}.{extension}")));
        let Some(path) = paths.into_iter().find(|path| path.exists()) else { return Ok(None) };
        match self.pictures.load(&path, &mut self.report.notes) {
            Ok(texture) => Ok(Some(texture)),
            Err(e) if self.report.missing == Missing::Noted => {
                self.report.note(place, format!("{e}: the scalar value is used"));
                Ok(None)
            }
            Err(e) => Err(missing_texture(self.report.named_at(place, e))),
        }
    }

    fn object(
        &mut self,
        place: &str,
        json: &Json,
        materials: &BTreeSet<String>,
        meshes: &mut BTreeMap<PathBuf, Arc<MeshDesc>>,
        names: &mut Names,
    ) -> Result<EntityDesc, SceneError> {
        let mut o = Object::new(place, json, self.report)?;
        let Some((at, name)) = o.string("name", self.report)? else {
            return Err(self.report.error(place, "an object needs a `name`, which is that of its file in Objects"));
        };
        let path = self.folder.join("Objects").join(format!("{}.obj", self.plain(&at, name)?));
        let mesh = match meshes.get(&path) {
            Some(mesh) => mesh.clone(),
            None => {
                let read = load_mesh(&path, DEFAULT_MATERIAL, Front::CounterClockwise, &mut self.report.notes);
                let mesh = Arc::new(read.map_err(|e| self.report.named_at(&at, e))?);
                meshes.insert(path, mesh.clone());
                mesh
            }
        };
        let material = match o.string("material", self.report)? {
            None => DEFAULT_MATERIAL,
            Some((_, said)) if materials.contains(said) => said,
            Some((at, said)) => {
                self.report.note(at, format!("no material is named `{}`: grey is used", shorten(said)));
                DEFAULT_MATERIAL
            }
        };
        o.note_unknown(["name", "material"], self.report);
        Ok(EntityDesc {
            name: names.give(name),
            transform: Transform::default(),
            material: Some(material.to_owned()),
            anisotropic_direction: None,
            shape: ShapeDesc::Mesh(mesh),
        })
    }

    fn point(&mut self, place: &str, json: &Json) -> Result<LightKind, SceneError> {
        let mut o = Object::new(place, json, self.report)?;
        let mut triple = |key: &str, parts, default| match o.take(key) {
            Some((at, json)) => self.triple(&at, json, parts, Vec3::ZERO),
            None => Ok(default),
        };
        let position = mirrored(triple("position", ["x", "y", "z"], Vec3::ZERO)?);
        let intensity = triple("radiance", ["r", "g", "b"], Vec3::ONE)?;
        if intensity.min_element() < 0.0 {
            return Err(self.report.error(o.at("radiance"), format!("light must not be negative, found {intensity}")));
        }
        o.note_unknown(["position", "radiance"], self.report);
        Ok(LightKind::Point { position, intensity })
    }

    fn around(&mut self, place: &str, json: &Json) -> Result<Option<EnvironmentDesc>, SceneError> {
        let mut o = Object::new(place, json, self.report)?;
        let offset = o.number("xoffset", self.report)?.map_or(0.0, |(_, x)| x);
        if let Some((at, y)) = o.number("yoffset", self.report)?
            && y != 0.0
        {
            self.report.note(at, "an environment turns about the vertical axis only: ignored");
        }
        let source = match (o.string("name", self.report)?, o.take("color")) {
            (Some((at, name)), _) => {
                let path = self.folder.join("HDRI").join(format!("{}.hdr", self.plain(&at, name)?));
                let map = self.pictures.load(&path, &mut self.report.notes);
                Some(EnvironmentSource::Map(map.map_err(|e| self.report.named_at(&at, e))?))
            }
            (None, Some((at, json))) => {
                let color = self.triple(&at, json, ["r", "g", "b"], Vec3::ZERO)?;
                Some(EnvironmentSource::Color(color.max(Vec3::ZERO)))
            }
            (None, None) => None,
        };
        o.note_unknown(["name", "xOffset", "yOffset", "color"], self.report);
        // Its column u lies where x + i z, mirrored, has the angle 2 pi (u - 1/2 - offset) from +x: a quarter turn from ours.
        let rotation_deg = (90.0 + 360.0 * offset.rem_euclid(1.0)) as f32;
        Ok(source.map(|source| EnvironmentDesc { source, rotation_deg, scale: 1.0 }))
    }

    /// A name that is part of a file's name, and no path.
    fn plain<'n>(&self, place: &str, name: &'n str) -> Result<&'n str, SceneError> {
        if name.is_empty() || name.contains(['/', '\\', '\0']) || name.starts_with("..") || name.contains(':') {
            let problem = format!("`{}` is no name of a file in the scene's folder", shorten(name));
            return Err(self.report.error(place, problem));
        }
        Ok(name)
    }

    /// Three numbers by their names; those that are left out are the default's.
    fn triple(&mut self, place: &str, json: &Json, names: [&str; 3], default: Vec3) -> Result<Vec3, SceneError> {
        if !json.is_object() {
            let problem =
                format!("expected {{{} : .., {} : .., {} : ..}}, found {}", names[0], names[1], names[2], kind(json));
            return Err(self.report.error(place, problem));
        }
        let mut o = Object::new(place, json, self.report)?;
        let mut v = default;
        for (i, name) in names.into_iter().enumerate() {
            if let Some((at, x)) = o.number(name, self.report)? {
                if x.abs() > f64::from(crate::scene::desc::MAX_COORDINATE) {
                    return Err(self.report.error(at, format!("{x} is out of range")));
                }
                v[i] = x as f32;
            }
        }
        o.note_unknown(names, self.report);
        Ok(v)
    }
}

/// From the left-handed space of the source to ours.
fn mirrored(v: Vec3) -> Vec3 {
    v * Vec3::new(1.0, 1.0, -1.0)
}
