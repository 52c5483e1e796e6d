//! Material files of OBJ meshes: the statements that the material model has parameters for.
//!
//! | statement | parameter |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour |
//! | `Ke`, `map_Ke` | emission; a texture without `Ke` emits with radiance 1 |
//! | `Ni` | `ior` |
//! | `d`, `Tr`, `map_d` | coverage `d = 1 - Tr`, times the map: a mask, without colour and refraction |
//! | `illum` | the models 4, 6, 7 and 9 are glass, whose `d` and `Tr` have no effect |
//! | `Pr`, `map_Pr` | roughness; else from the exponent `Ns` if `Ks` is not black, else 1 |
//! | `Pm`, `map_Pm` | metallic |
//! | `Ps` | sheen |
//! | `Pc`, `Pcr` | clearcoat, and 1 - `clearcoat_gloss` |
//! | `aniso` | anisotropic |
//! | `norm` | the normal map, `-bm` is its strength |
//! | `bump`, `map_bump` | the bump map, in scene units times `-bm`; a normal map if the image
//! contains normals |
//!
//! An exponent is converted to a GGX alpha of sqrt(2 / (Ns + 2)), which has the same peak [Walter
//! et al. 2007]. `disp` displaces points, which is not supported. Of the options before a file
//! name, `-s`, `-o` and `-clamp` map the texture: equal factors and the offset of the first map
//! become those of the material.

use std::path::Path;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};

use super::supported::NotedKeywords;
use super::without_comment;
use crate::load::beside;
use crate::load::images::{self, ImageCache};
use crate::load::{MissingTextures, files, read_file, text_of_lines, with_lenient_hint};
use lumbre_light::scene::desc::material_params::MIN_IOR;
use lumbre_light::scene::desc::{
    Lookup, MaskMode, MaterialDesc, NoInverse, Texels, TextureDesc, TextureFilter, TextureSlot,
    Wrap,
};
use lumbre_light::scene::{Note, SceneError};

/// Greatest size of a material file in bytes.
const MAX_MTL_BYTES: u64 = 16 << 20;

/// Statements without a note: they belong to other material models, or do not describe the surface.
const IGNORED: &[&str] = &[
    "ka",
    "tf",
    "map_ka",
    "map_ks",
    "map_ns",
    "sharpness",
    "map_aat",
];

/// Statements of a material that determine parameters jointly.
#[derive(Default)]
struct Statements {
    specular: Option<Vec3>,
    exponent: Option<f32>,
    roughness: Option<f32>,
    dissolve: Option<f32>,
    model: Option<u32>,
    /// Error in the mapping of the newest map.
    map_error: Option<NoInverse>,
}

/// Arguments of a map: its options and file name.
struct MapOptions<'t> {
    name: &'t str,
    scale: Vec2,
    offset: Vec2,
    wrap: Wrap,
    /// Height of bumps, or strength of a normal map.
    multiplier: Option<f32>,
    /// The only channel that is read.
    channel: Option<usize>,
}

/// Loads a material file and the textures that it refers to.
///
/// # Errors
/// Fails for a file that cannot be read, statements with invalid numbers, and textures that cannot
/// be read, unless `missing` exempts them.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
    images: &mut ImageCache,
    notes: &mut Vec<Note>,
) -> Result<Vec<MaterialDesc>, SceneError> {
    let bytes = read_file(path, MAX_MTL_BYTES)?;
    let mut file = MtlParser {
        path,
        missing,
        notes,
        images,
        noted_keywords: NotedKeywords::default(),
        keyword: String::new(),
        tr_is_coverage: false,
        materials: Vec::new(),
    };
    let text = text_of_lines(&bytes);
    for (i, line) in text.lines().enumerate() {
        file.statement(i + 1, line.trim())?;
    }
    file.finish()
}

/// State while a material file is parsed.
struct MtlParser<'a> {
    path: &'a Path,
    missing: MissingTextures,
    notes: &'a mut Vec<Note>,
    images: &'a mut ImageCache,
    noted_keywords: NotedKeywords,
    /// Keyword of the current statement.
    keyword: String,
    /// Whether a comment names MeshLab, which writes coverage as `Tr`.
    tr_is_coverage: bool,
    materials: Vec<(MaterialDesc, Statements)>,
}

impl MtlParser<'_> {
    /// Adds a note about a line.
    fn note(&mut self, line: usize, message: String) {
        self.notes
            .push(Note::new(self.path, format!("line {line}"), message));
    }

    /// Creates an error about a line.
    fn error(&self, line: usize, problem: String) -> SceneError {
        SceneError::malformed(self.path, format!("line {line}"), problem)
    }

    /// Reads one statement.
    fn statement(&mut self, line: usize, text: &str) -> Result<(), SceneError> {
        let Some(keyword) = text
            .split_whitespace()
            .next()
            .filter(|k| !k.starts_with('#'))
        else {
            let head = self.materials.is_empty();
            self.tr_is_coverage |= head && text.to_ascii_lowercase().contains("meshlab");
            return Ok(());
        };
        let rest = text[keyword.len()..].trim();
        self.keyword = keyword.to_owned();
        let keyword = keyword.to_ascii_lowercase();
        if keyword == "newmtl" {
            self.materials
                .push((MaterialDesc::new(rest), Statements::default()));
            return Ok(());
        }
        if self.materials.is_empty() {
            return Err(self.error(line, "this line precedes the first `newmtl`".to_owned()));
        }
        match keyword.as_str() {
            "kd" => self.color(line, rest, [0.0, 1.0], |m, _, c| m.base_color = c),
            "ke" => self.color(line, rest, [0.0, 1e9], |m, _, c| m.emission = c),
            "ks" => self.color(line, rest, [0.0, 1.0], |_, s, c| s.specular = Some(c)),
            "ns" => self.scalar(line, rest, [0.0, 1e9], |_, s, x| s.exponent = Some(x)),
            // An index of 0 is one that was not set.
            "ni" if rest.parse() == Ok(0.0f32) => Ok(()),
            "ni" => self.scalar(line, rest, [MIN_IOR as f32, 100.0], |m, _, x| m.ior = x),
            "d" => self.scalar(
                line,
                rest.trim_start_matches("-halo"),
                [0.0, 1.0],
                |_, s, x| s.dissolve = Some(x),
            ),
            "tr" if self.tr_is_coverage => self.scalar(line, rest, [0.0, 1.0], |_, s, x| {
                s.dissolve.get_or_insert(x);
            }),
            "tr" => self.scalar(line, rest, [0.0, 1.0], |_, s, x| {
                s.dissolve.get_or_insert(1.0 - x);
            }),
            "illum" => self.scalar(line, rest, [0.0, 10.0], |_, s, x| s.model = Some(x as u32)),
            "pr" => self.scalar(line, rest, [0.0, 1.0], |_, s, x| s.roughness = Some(x)),
            "pm" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.metallic = x),
            "ps" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.sheen = x),
            "pc" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.clearcoat = x),
            "pcr" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| {
                m.clearcoat_gloss = 1.0 - x
            }),
            "aniso" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.anisotropic = x),
            "map_kd" => self.map(line, rest, TextureSlot::BaseColor),
            "map_ke" => self.map(line, rest, TextureSlot::Emission),
            "map_d" => self.map(line, rest, TextureSlot::Mask),
            "map_pr" => self.map(line, rest, TextureSlot::Roughness),
            "map_pm" => self.map(line, rest, TextureSlot::Metallic),
            "norm" => self.map(line, rest, TextureSlot::Normal),
            "bump" | "map_bump" => self.map(line, rest, TextureSlot::Bump),
            other if IGNORED.contains(&other) => Ok(()),
            other => {
                if let Some(problem) = self.noted_keywords.note(other) {
                    self.note(line, problem);
                }
                Ok(())
            }
        }
    }

    /// Reads `N` numbers, clamped to a range with a note.
    fn numbers<const N: usize>(
        &mut self,
        line: usize,
        rest: &str,
        range: [f32; 2],
    ) -> Result<[f32; N], SceneError> {
        let numbers = rest.split('#').next().unwrap_or_default();
        let words: Vec<&str> = numbers.split_whitespace().collect();
        // A single number is used for all three channels of a colour.
        if words.is_empty() || (words.len() < N && words.len() != 1) {
            return Err(self.error(
                line,
                format!("expected {N} numbers, found `{}`", truncated(rest)),
            ));
        }
        let mut out = [0.0; N];
        for (i, x) in out.iter_mut().enumerate() {
            let word = words.get(i).unwrap_or(&words[0]);
            let read: f32 = word
                .parse()
                .map_err(|_| self.error(line, format!("`{}` is not a number", truncated(word))))?;
            if read.is_nan() {
                return Err(self.error(line, "NaN is not a valid material parameter".to_owned()));
            }
            *x = read.clamp(range[0], range[1]);
            if *x != read {
                let message = format!(
                    "{read} of `{}` is outside {} to {}; {x} is used",
                    truncated(&self.keyword),
                    range[0],
                    range[1]
                );
                self.note(line, message);
            }
        }
        Ok(out)
    }

    /// Reads a number and stores it in the current material.
    fn scalar(
        &mut self,
        line: usize,
        rest: &str,
        range: [f32; 2],
        set: fn(&mut MaterialDesc, &mut Statements, f32),
    ) -> Result<(), SceneError> {
        let [x] = self.numbers::<1>(line, rest, range)?;
        self.with_current(|m, statements| set(m, statements, x));
        Ok(())
    }

    /// Reads a colour and stores it in the current material.
    fn color(
        &mut self,
        line: usize,
        rest: &str,
        range: [f32; 2],
        set: fn(&mut MaterialDesc, &mut Statements, Vec3),
    ) -> Result<(), SceneError> {
        if rest.starts_with("spectral") || rest.starts_with("xyz") {
            self.note(
                line,
                "spectral and XYZ colours are not supported; ignored".to_owned(),
            );
            return Ok(());
        }
        let c = Vec3::from_array(self.numbers::<3>(line, rest, range)?);
        self.with_current(|m, statements| set(m, statements, c));
        Ok(())
    }

    /// Applies a change to the current material.
    fn with_current(&mut self, change: impl FnOnce(&mut MaterialDesc, &mut Statements)) {
        if let Some((m, statements)) = self.materials.last_mut() {
            change(m, statements);
        }
    }

    /// Reads a texture map and stores it in the current material.
    fn map(&mut self, line: usize, rest: &str, slot: TextureSlot) -> Result<(), SceneError> {
        let MapOptions {
            name,
            scale,
            offset,
            wrap,
            multiplier,
            channel,
        } = self.options(line, rest)?;
        if name.is_empty() {
            let message = format!("`{}` names no file; ignored", truncated(&self.keyword));
            self.note(line, message);
            return Ok(());
        }
        let Some(mut texture) = self.map_texture(line, name)? else {
            return Ok(());
        };
        if let Some(c) = channel {
            if matches!(
                slot,
                TextureSlot::BaseColor | TextureSlot::Emission | TextureSlot::Normal
            ) {
                let message = "the option `-imfchan` of a map of colours is not supported; ignored";
                self.note(line, message.to_owned());
            } else {
                let single = |texel: [f32; 4]| [texel[c], texel[c], texel[c], 1.0];
                let derived = self
                    .images
                    .derived(&texture, &format!("channel {c}"), single);
                texture = derived.map_err(|problem| self.error(line, problem))?;
            }
        }
        let (slot, texture) = match slot {
            TextureSlot::Bump => self.bump(line, texture, multiplier)?,
            TextureSlot::Mask => (slot, self.coverage(line, &texture)?),
            _ => (slot, texture),
        };
        self.with_current(|m, statements| {
            match slot {
                TextureSlot::Bump => m.bump_height = multiplier.unwrap_or(1.0),
                TextureSlot::Normal => {
                    m.normal_strength = multiplier.unwrap_or(1.0).clamp(0.0, 100.0)
                }
                _ => {}
            }
            if m.textures.is_empty() && scale.x == scale.y {
                (m.tiling, m.uv_offset) = (scale.x, offset);
            }
            let affine = |scale, offset| Affine2::from_scale_angle_translation(scale, 0.0, offset);
            let map = Lookup::relative_to(
                affine(Vec2::splat(m.tiling), m.uv_offset),
                affine(scale, offset),
            );
            statements.map_error = map.err();
            m.set_mapped_texture(
                slot,
                texture,
                Lookup {
                    wrap: [wrap; 2],
                    filter: TextureFilter::Bilinear,
                    second: false,
                    map: map.unwrap_or(None),
                },
            );
        });
        if let Some(e) = self
            .materials
            .last()
            .and_then(|(_, statements)| statements.map_error)
        {
            self.note(line, e.to_string());
        }
        Ok(())
    }

    /// Loads the texture of a map, or returns `None`, with a note, if it cannot be read and the
    /// policy allows it.
    fn map_texture(
        &mut self,
        line: usize,
        name: &str,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let mut file = beside(folder, name);
        // Names may contain a `#`, and comments may follow.
        if !files::exists(&file) {
            file = beside(folder, without_comment(name));
        }
        match self.images.load(&file, self.notes) {
            Ok(texture) => Ok(Some(texture)),
            Err(e) => {
                let material = self.materials.last().map_or("", |(m, _)| m.name.as_str());
                let problem = format!("texture of the material `{}`: {e}", truncated(material));
                if self.missing == MissingTextures::Fail {
                    return Err(with_lenient_hint(self.error(line, problem)));
                }
                self.note(
                    line,
                    format!("{problem}; the material's constant value is used"),
                );
                Ok(None)
            }
        }
    }

    /// Returns slot and texture of a bump map: exporters write height maps and normal maps under
    /// the same keyword.
    fn bump(
        &mut self,
        line: usize,
        texture: Arc<TextureDesc>,
        multiplier: Option<f32>,
    ) -> Result<(TextureSlot, Arc<TextureDesc>), SceneError> {
        let material = self
            .materials
            .last()
            .map_or_else(String::new, |(m, _)| truncated(&m.name));
        let has_map = self.materials.last().is_some_and(|(m, _)| {
            [TextureSlot::Bump, TextureSlot::Normal]
                .iter()
                .any(|slot| m.texture(*slot).is_some())
        });
        if images::is_normal_map(&texture) {
            if !has_map {
                self.note(
                    line,
                    format!(
                        "the bump map of `{material}` contains normals; it is used as a normal map"
                    ),
                );
            }
            return Ok((TextureSlot::Normal, texture));
        }
        if !has_map && multiplier.is_none() {
            let message = format!(
                "the bump map of `{material}` has no `-bm`, so its height is 1 scene unit; see \
                 `materials.{material}.bump_height`"
            );
            self.note(line, message);
        }
        let heights = self
            .images
            .heights(&texture)
            .map_err(|problem| self.error(line, problem))?;
        Ok((TextureSlot::Bump, heights))
    }

    /// Returns the coverage of a `map_d`: the alpha of an image that has one, else its luminance.
    fn coverage(
        &mut self,
        line: usize,
        texture: &Arc<TextureDesc>,
    ) -> Result<Arc<TextureDesc>, SceneError> {
        let coverage = if has_alpha(texture) {
            let alpha = |[_, _, _, a]: [f32; 4]| [a, a, a, 1.0];
            self.images.derived(texture, "alpha", alpha)
        } else {
            self.images.heights(texture)
        };
        coverage.map_err(|problem| self.error(line, problem))
    }

    /// Parses the options before the file name of a map.
    fn options<'t>(&mut self, line: usize, rest: &'t str) -> Result<MapOptions<'t>, SceneError> {
        let (mut scale, mut offset, mut wrap) = (Vec2::ONE, Vec2::ZERO, Wrap::Repeat);
        let (mut multiplier, mut channel) = (None, None);
        let mut unread = rest;
        while let Some(option) = unread
            .split_whitespace()
            .next()
            .filter(|w| w.starts_with('-'))
        {
            unread = unread[option.len()..].trim_start();
            let values = match option {
                "-o" | "-s" | "-t" => 3,
                "-mm" => 2,
                _ => 1,
            };
            let word = unread.split_whitespace().next();
            let on = word == Some("on");
            if option == "-imfchan" {
                channel = ["r", "g", "b", "m"].iter().position(|c| word == Some(*c));
                if channel.is_none() {
                    let shown = truncated(word.unwrap_or_default());
                    self.note(
                        line,
                        format!("the channel `{shown}` of a map is not supported; ignored"),
                    );
                }
            }
            let mut numbers = Vec::new();
            for i in 0..values {
                let Some(word) = unread.split_whitespace().next() else {
                    break;
                };
                // The last two of three numbers are optional.
                if values == 3 && i > 0 && word.parse::<f32>().is_err() {
                    break;
                }
                numbers.extend(word.parse::<f32>().ok().filter(|x| x.abs() <= 1e6));
                unread = unread[word.len()..].trim_start();
            }
            match (option, numbers.as_slice()) {
                ("-s", [u, rest @ ..]) => {
                    scale = Vec2::new(*u, rest.first().copied().unwrap_or(*u))
                }
                ("-o", [u, rest @ ..]) => {
                    offset = Vec2::new(*u, rest.first().copied().unwrap_or(0.0))
                }
                ("-bm", [factor]) => multiplier = Some(*factor),
                ("-clamp", _) => wrap = if on { Wrap::Clamp } else { Wrap::Repeat },
                ("-bm" | "-blendu" | "-blendv" | "-cc" | "-imfchan" | "-texres" | "-type", _) => {}
                _ => self.note(
                    line,
                    format!(
                        "the option `{}` of a map is not supported; ignored",
                        truncated(option)
                    ),
                ),
            }
        }
        Ok(MapOptions {
            name: unread,
            scale,
            offset,
            wrap,
            multiplier,
            channel,
        })
    }

    /// Returns the materials, with the parameters that several statements determine.
    fn finish(mut self) -> Result<Vec<MaterialDesc>, SceneError> {
        let materials = std::mem::take(&mut self.materials);
        let finished = materials.into_iter().map(|(m, statements)| {
            let glossy = statements.specular.is_some_and(|ks| ks != Vec3::ZERO);
            let mut m = MaterialDesc {
                roughness: match (statements.roughness, statements.exponent) {
                    (Some(roughness), _) => roughness,
                    (None, Some(ns)) if glossy => (2.0 / (ns + 2.0)).powf(0.25),
                    _ => 1.0,
                },
                ..m
            };
            if matches!(statements.model, Some(4 | 6 | 7 | 9)) {
                m.opacity = 0.0;
            } else {
                self.dissolve(&mut m, statements.dissolve.unwrap_or(1.0))?;
            }
            if m.texture(TextureSlot::Mask).is_some() {
                m.mask_mode = MaskMode::Blend;
            }
            if m.texture(TextureSlot::Emission).is_some() && m.emission == Vec3::ZERO {
                m.emission = Vec3::ONE;
            }
            Ok(m)
        });
        finished.collect()
    }

    /// Sets the coverage of a material to that of its map times `d`.
    fn dissolve(&mut self, m: &mut MaterialDesc, d: f32) -> Result<(), SceneError> {
        if d == 1.0 {
            return Ok(());
        }
        if d == 0.0 {
            self.notes.push(Note::new(
                self.path,
                format!("material {}", truncated(&m.name)),
                "its dissolve `d` is 0 (or `Tr` 1), which makes it invisible",
            ));
        }
        let mask = match m.texture(TextureSlot::Mask).cloned() {
            Some(map) => {
                let scaled = |texel: [f32; 4]| texel.map(|x| d * x);
                let derived = self.images.derived(&map, &format!("* {d}"), scaled);
                derived.map_err(|problem| {
                    SceneError::malformed(
                        self.path,
                        format!("material {}", truncated(&m.name)),
                        problem,
                    )
                })?
            }
            None => Arc::new(TextureDesc::grey(d)),
        };
        m.set_texture(TextureSlot::Mask, Some(mask));
        Ok(())
    }
}

/// Returns whether any texel of an image is transparent.
fn has_alpha(image: &TextureDesc) -> bool {
    match &image.texels {
        Texels::Rgba8(t) => t.iter().any(|[_, _, _, a]| *a < 255),
        Texels::RgbaF32(t) => t.iter().any(|[_, _, _, a]| *a < 1.0),
    }
}

/// Returns the beginning of a text of any length, for messages.
fn truncated(text: &str) -> String {
    text.chars().take(60).collect()
}
