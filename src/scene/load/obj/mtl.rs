//! Material files of OBJ meshes, as far as this material model has words for them.
//!
//! | statement | here |
//! |---|---|
//! | `Kd`, `map_Kd` | base colour |
//! | `Ke`, `map_Ke` | emission; a texture alone shines with radiance 1 |
//! | `Ni` | `ior` |
//! | `d`, `Tr` | the opacity `d = 1 - Tr`; 0 where `illum` is 4, 6, 7 or 9, which are models of glass |
//! | `map_d` | the mask: coverage, not refraction |
//! | `Pr`, `map_Pr` | roughness; else from the exponent `Ns` where `Ks` is not black, else 1 |
//! | `Pm`, `map_Pm` | metallic |
//! | `Ps` | sheen |
//! | `Pc`, `Pcr` | clearcoat, and 1 - `clearcoat_gloss` |
//! | `aniso` | anisotropic |
//! | `norm` | the normal map, `-bm` its strength |
//! | `bump`, `map_bump` | the bump map, in scene units times `-bm`; the normal map if the picture holds normals |
//!
//! An exponent becomes a GGX alpha of sqrt(2 / (Ns + 2)), which has the same peak [Walter et al. 2007]. `disp` moves points,
//! which is not read. Of the options before a file name `-s`, `-o` and `-clamp` lay the map: equal factors and the
//! offset of the first map become those of the material.

use std::path::Path;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};

use crate::scene::desc::material::MIN_IOR;
use crate::scene::desc::{Lookup, MaterialDesc, NoInverse, TextureDesc, TextureSlot, Wrap};
use crate::scene::load::images::{self, Pictures};
use crate::scene::load::{Missing, missing_texture, read};
use crate::scene::{Note, SceneError};

/// Greatest size of a material file in bytes.
const MAX_MTL_BYTES: u64 = 16 << 20;

/// Statements whose meaning is another model's, or that say nothing about the surface.
const SILENT: &[&str] = &["ka", "tf", "map_ka", "map_ks", "map_ns", "sharpness", "anisor", "map_aat"];

/// What a material's statements say together.
#[derive(Default)]
struct Said {
    specular: Option<Vec3>,
    exponent: Option<f32>,
    roughness: Option<f32>,
    dissolve: Option<f32>,
    model: Option<u32>,
    /// Why the newest map could not be laid.
    refused: Option<NoInverse>,
}

/// What stands after the keyword of a map.
struct Options<'t> {
    name: &'t str,
    scale: Vec2,
    offset: Vec2,
    wrap: Wrap,
    /// How high bumps are.
    multiplier: Option<f32>,
}

/// Reads a material file and the textures that it names.
///
/// # Errors
/// A file that cannot be read, statements that are not numbers where numbers belong, and textures that cannot be read
/// unless `missing` says that those are noted.
pub(super) fn load(
    path: &Path,
    missing: Missing,
    pictures: &mut Pictures,
    notes: &mut Vec<Note>,
) -> Result<Vec<MaterialDesc>, SceneError> {
    let bytes = read(path, MAX_MTL_BYTES)?;
    let mut file = File { path, missing, notes, pictures, unread: Vec::new(), materials: Vec::new() };
    for (i, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
        file.statement(i + 1, line.trim())?;
    }
    Ok(file.finish())
}

struct File<'a> {
    path: &'a Path,
    missing: Missing,
    notes: &'a mut Vec<Note>,
    pictures: &'a mut Pictures,
    /// Keywords that have been noted.
    unread: Vec<String>,
    materials: Vec<(MaterialDesc, Said)>,
}

impl File<'_> {
    fn note(&mut self, line: usize, message: String) {
        self.notes.push(Note { file: self.path.to_owned(), place: format!("line {line}"), message });
    }

    fn error(&self, line: usize, problem: String) -> SceneError {
        SceneError::Malformed { file: self.path.to_owned(), place: format!("line {line}"), problem }
    }

    fn statement(&mut self, line: usize, text: &str) -> Result<(), SceneError> {
        let Some(keyword) = text.split_whitespace().next().filter(|k| !k.starts_with('#')) else { return Ok(()) };
        let rest = text[keyword.len()..].trim();
        let keyword = keyword.to_ascii_lowercase();
        if keyword == "newmtl" {
            self.materials.push((MaterialDesc::new(rest), Said::default()));
            return Ok(());
        }
        if self.materials.is_empty() {
            return Err(self.error(line, format!("`{}` before any `newmtl`", shorten(&keyword))));
        }
        match keyword.as_str() {
            "kd" => self.color(line, rest, [0.0, 1.0], |m, _, c| m.base_color = c),
            "ke" => self.color(line, rest, [0.0, 1e9], |m, _, c| m.emission = c),
            "ks" => self.color(line, rest, [0.0, 1.0], |_, said, c| said.specular = Some(c)),
            "ns" => self.scalar(line, rest, [0.0, 1e9], |_, said, x| said.exponent = Some(x)),
            "ni" => self.scalar(line, rest, [MIN_IOR as f32, 100.0], |m, _, x| m.ior = x),
            "d" => {
                self.scalar(line, rest.trim_start_matches("-halo"), [0.0, 1.0], |_, said, x| said.dissolve = Some(x))
            }
            "tr" => self.scalar(line, rest, [0.0, 1.0], |_, said, x| {
                said.dissolve.get_or_insert(1.0 - x);
            }),
            "illum" => self.scalar(line, rest, [0.0, 10.0], |_, said, x| said.model = Some(x as u32)),
            "pr" => self.scalar(line, rest, [0.0, 1.0], |_, said, x| said.roughness = Some(x)),
            "pm" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.metallic = x),
            "ps" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.sheen = x),
            "pc" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.clearcoat = x),
            "pcr" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.clearcoat_gloss = 1.0 - x),
            "aniso" => self.scalar(line, rest, [0.0, 1.0], |m, _, x| m.anisotropic = x),
            "map_kd" => self.map(line, rest, TextureSlot::BaseColor),
            "map_ke" => self.map(line, rest, TextureSlot::Emission),
            "map_d" => self.map(line, rest, TextureSlot::Mask),
            "map_pr" => self.map(line, rest, TextureSlot::Roughness),
            "map_pm" => self.map(line, rest, TextureSlot::Metallic),
            "norm" => self.map(line, rest, TextureSlot::Normal),
            "bump" | "map_bump" => self.map(line, rest, TextureSlot::Bump),
            other if SILENT.contains(&other) => Ok(()),
            other => {
                if self.unread.iter().all(|k| k != other) && self.unread.len() < 16 {
                    self.note(line, format!("statements `{}` are not read: ignored", shorten(other)));
                    self.unread.push(other.to_owned());
                }
                Ok(())
            }
        }
    }

    fn numbers<const N: usize>(&mut self, line: usize, rest: &str, range: [f32; 2]) -> Result<[f32; N], SceneError> {
        let words: Vec<&str> = rest.split_whitespace().collect();
        // One number stands for all three of a colour.
        if words.is_empty() || (words.len() < N && words.len() != 1) {
            return Err(self.error(line, format!("expected {N} numbers, found `{}`", shorten(rest))));
        }
        let mut out = [0.0; N];
        for (i, x) in out.iter_mut().enumerate() {
            let word = words.get(i).unwrap_or(&words[0]);
            let read: f32 = word.parse().map_err(|_| self.error(line, format!("`{}` is no number", shorten(word))))?;
            if read.is_nan() {
                return Err(self.error(line, "NaN is no number that a material can have".to_owned()));
            }
            *x = read.clamp(range[0], range[1]);
            if *x != read {
                self.note(line, format!("{read} is outside {} to {}: {x} is used", range[0], range[1]));
            }
        }
        Ok(out)
    }

    fn scalar(
        &mut self,
        line: usize,
        rest: &str,
        range: [f32; 2],
        set: fn(&mut MaterialDesc, &mut Said, f32),
    ) -> Result<(), SceneError> {
        let [x] = self.numbers::<1>(line, rest, range)?;
        self.last(|m, said| set(m, said, x));
        Ok(())
    }

    fn color(
        &mut self,
        line: usize,
        rest: &str,
        range: [f32; 2],
        set: fn(&mut MaterialDesc, &mut Said, Vec3),
    ) -> Result<(), SceneError> {
        if rest.starts_with("spectral") || rest.starts_with("xyz") {
            self.note(line, "colours by spectrum or in XYZ are not read: ignored".to_owned());
            return Ok(());
        }
        let c = Vec3::from_array(self.numbers::<3>(line, rest, range)?);
        self.last(|m, said| set(m, said, c));
        Ok(())
    }

    fn last(&mut self, change: impl FnOnce(&mut MaterialDesc, &mut Said)) {
        if let Some((m, said)) = self.materials.last_mut() {
            change(m, said);
        }
    }

    fn map(&mut self, line: usize, rest: &str, slot: TextureSlot) -> Result<(), SceneError> {
        let Options { name, scale, offset, wrap, multiplier } = self.options(line, rest)?;
        if name.is_empty() {
            return Err(self.error(line, "a map needs a file".to_owned()));
        }
        let file = self.path.parent().unwrap_or(Path::new("")).join(name.replace('\\', "/"));
        let texture = match self.pictures.load(&file, self.notes) {
            Ok(texture) => texture,
            Err(e) => {
                let whose = self.materials.last().map_or("", |(m, _)| m.name.as_str());
                let problem = format!("texture of the material `{}`: {e}", shorten(whose));
                if self.missing == Missing::Refused {
                    return Err(missing_texture(self.error(line, problem)));
                }
                self.note(line, format!("{problem}: the scalar value is used"));
                return Ok(());
            }
        };
        let (slot, texture) = match slot {
            TextureSlot::Bump => self.bump(line, texture, multiplier)?,
            _ => (slot, texture),
        };
        self.last(|m, said| {
            match slot {
                TextureSlot::Bump => m.bump_height = multiplier.unwrap_or(1.0),
                TextureSlot::Normal => m.normal_strength = multiplier.unwrap_or(1.0).clamp(0.0, 100.0),
                _ => {}
            }
            if m.textures.is_empty() && scale.x == scale.y {
                (m.tiling, m.uv_offset) = (scale.x, offset);
            }
            let laid = |scale, offset| Affine2::from_scale_angle_translation(scale, 0.0, offset);
            let map = Lookup::beside(laid(Vec2::splat(m.tiling), m.uv_offset), laid(scale, offset));
            said.refused = map.err();
            m.lay_texture(slot, texture, Lookup { wrap: [wrap; 2], second: false, map: map.unwrap_or(None) });
        });
        if let Some(e) = self.materials.last().and_then(|(_, said)| said.refused) {
            self.note(line, e.to_string());
        }
        Ok(())
    }

    /// A bump map as what its picture holds: heights, or normals, which exporters write under the same keyword.
    fn bump(
        &mut self,
        line: usize,
        texture: Arc<TextureDesc>,
        multiplier: Option<f32>,
    ) -> Result<(TextureSlot, Arc<TextureDesc>), SceneError> {
        let whose = self.materials.last().map_or_else(String::new, |(m, _)| shorten(&m.name));
        let known = self.materials.last().is_some_and(|(m, _)| {
            [TextureSlot::Bump, TextureSlot::Normal].iter().any(|slot| m.texture(*slot).is_some())
        });
        if images::shows_normals(&texture) {
            if !known {
                self.note(line, format!("the bumps of `{whose}` are normals: taken as a normal map"));
            }
            return Ok((TextureSlot::Normal, texture));
        }
        if !known && multiplier.is_none() {
            let message = format!("the bumps of `{whose}` are 1 scene unit high: see `materials.{whose}.bump_height`");
            self.note(line, message);
        }
        let heights = self.pictures.heights(&texture).map_err(|problem| self.error(line, problem))?;
        Ok((TextureSlot::Bump, heights))
    }

    /// The file's name, and what the options before it say.
    fn options<'t>(&mut self, line: usize, rest: &'t str) -> Result<Options<'t>, SceneError> {
        let (mut scale, mut offset, mut wrap, mut multiplier) = (Vec2::ONE, Vec2::ZERO, Wrap::Repeat, None);
        let mut left = rest;
        while let Some(option) = left.split_whitespace().next().filter(|w| w.starts_with('-')) {
            left = left[option.len()..].trim_start();
            let values = match option {
                "-o" | "-s" | "-t" => 3,
                "-mm" => 2,
                _ => 1,
            };
            let on = left.split_whitespace().next() == Some("on");
            let mut numbers = Vec::new();
            for i in 0..values {
                let Some(word) = left.split_whitespace().next() else { break };
                // Of three numbers the last two may be left out.
                if values == 3 && i > 0 && word.parse::<f32>().is_err() {
                    break;
                }
                numbers.extend(word.parse::<f32>().ok().filter(|x| x.abs() <= 1e6));
                left = left[word.len()..].trim_start();
            }
            match (option, numbers.as_slice()) {
                ("-s", [u, more @ ..]) => scale = Vec2::new(*u, more.first().copied().unwrap_or(*u)),
                ("-o", [u, more @ ..]) => offset = Vec2::new(*u, more.first().copied().unwrap_or(0.0)),
                ("-bm", [by]) => multiplier = Some(*by),
                ("-clamp", _) => wrap = if on { Wrap::Clamp } else { Wrap::Repeat },
                ("-bm" | "-blendu" | "-blendv" | "-cc" | "-imfchan" | "-texres" | "-type", _) => {}
                _ => self.note(line, format!("the option `{}` of a map is not read: ignored", shorten(option))),
            }
        }
        Ok(Options { name: left, scale, offset, wrap, multiplier })
    }

    fn finish(self) -> Vec<MaterialDesc> {
        let done = |(mut m, said): (MaterialDesc, Said)| {
            let glossy = said.specular.is_some_and(|ks| ks != Vec3::ZERO);
            m.roughness = match (said.roughness, said.exponent) {
                (Some(roughness), _) => roughness,
                (None, Some(ns)) if glossy => (2.0 / (ns + 2.0)).powf(0.25),
                _ => 1.0,
            };
            let glass = matches!(said.model, Some(4 | 6 | 7 | 9));
            m.opacity = if glass { 0.0 } else { said.dissolve.unwrap_or(1.0) };
            if m.texture(TextureSlot::Emission).is_some() && m.emission == Vec3::ZERO {
                m.emission = Vec3::ONE;
            }
            m
        };
        self.materials.into_iter().map(done).collect()
    }
}

/// The beginning of a text that may be of any length.
fn shorten(text: &str) -> String {
    text.chars().take(60).collect()
}
