//! Textures: `bitmap` and `checkerboard`.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, Vec2, Vec3};

use super::tree::{Item, Object};
use crate::scene::compile::srgb_to_linear;
use crate::scene::desc::{Texels, TextureDesc, texture_hash};
use crate::scene::load::Missing;
use crate::scene::load::images::Pictures;
use crate::scene::{Note, SceneError};

/// Side of the picture of a checkerboard in texels: edges are blurred over a 128th of a field.
const BOARD: u32 = 256;
/// How many of them with different colours a scene may have: each takes a megabyte.
const MAX_BOARDS: usize = 64;

/// A map of texture coordinates, `[xx, xy, x, yx, yy, y]`, that no factor and offset can say.
pub(super) type UvAffine = [f32; 6];

/// A texture as Mitsuba sees it: coordinates start at the top left, before `to_uv`.
pub(super) struct Read {
    /// The image.
    pub image: Arc<TextureDesc>,
    to_uv: DAffine3,
}

impl Read {
    /// Factor, offset, and where these two cannot say it the whole map, for coordinates that start at the bottom left.
    pub fn placement(&self) -> (f32, Vec2, Option<UvAffine>) {
        let (m, t) = (self.to_uv.matrix3.as_mat3(), self.to_uv.translation.as_vec3());
        // With v = 1 - v' on both sides of u' = a u + b v + tx, v' = c u + d v + ty.
        let (a, b, c, d) = (m.x_axis.x, m.y_axis.x, m.x_axis.y, m.y_axis.y);
        let map = [a, -b, b + t.x, -c, d, 1.0 - d - t.y];
        let scaled = b == 0.0 && c == 0.0 && (a - d).abs() <= 1e-6 * a.abs();
        if scaled { (a, Vec2::new(map[2], map[5]), None) } else { (1.0, Vec2::ZERO, Some(map)) }
    }
}

fn made(file: &Path, width: u32, height: u32, texels: Texels) -> Arc<TextureDesc> {
    let content_hash = texture_hash(width, height, &texels);
    Arc::new(TextureDesc { file: file.to_owned(), width, height, texels, content_hash })
}

/// One grey texel.
pub(super) fn constant(grey: f32) -> Arc<TextureDesc> {
    made(Path::new(""), 1, 1, Texels::RgbaF32(vec![[grey, grey, grey, 1.0]]))
}

/// The images that were read or made.
pub(super) struct Textures {
    pictures: Pictures,
    /// Checkerboards by the bits of their colours.
    boards: BTreeMap<[u32; 6], Arc<TextureDesc>>,
    missing: Missing,
}

impl Textures {
    /// None yet.
    pub fn new(missing: Missing) -> Textures {
        Textures { pictures: Pictures::default(), boards: BTreeMap::new(), missing }
    }

    /// The same texels for a role in which they are numbers: Mitsuba decodes them from sRGB unless they are `raw`, and
    /// here such roles take them as stored.
    pub fn linear(&mut self, o: &Object, read: Read) -> Result<Read, SceneError> {
        match read.image.texels {
            Texels::Rgba8(_) => self.mapped(o, read, "linear", srgb_to_linear),
            Texels::RgbaF32(_) => Ok(read),
        }
    }

    /// As heights: the luminance of linear texels.
    pub fn heights(&mut self, o: &Object, read: Read) -> Result<Read, SceneError> {
        let linear = self.linear(o, read)?;
        let image = self.pictures.heights(&linear.image).map_err(|problem| o.error(problem))?;
        Ok(Read { image, ..linear })
    }

    /// With a function of every channel, which `how` names.
    pub fn mapped(&mut self, o: &Object, read: Read, how: &str, f: fn(f32) -> f32) -> Result<Read, SceneError> {
        let image = self.pictures.made(&read.image, how, |texel| texel.map(f)).map_err(|problem| o.error(problem))?;
        Ok(Read { image, ..read })
    }

    /// Reads a texture; `None` where it is not known, or cannot be read and that is allowed, with a note.
    pub fn read(&mut self, o: &Rc<Object>, notes: &mut Vec<Note>) -> Result<Option<Read>, SceneError> {
        let to_uv = o.map("to_uv")?;
        match o.kind.as_str() {
            "bitmap" => {
                let Some(file) = o.text("filename")? else { return Err(o.error("a bitmap needs a `filename`")) };
                let raw = o.flag("raw", false)?;
                for (key, known) in [("filter_type", &["bilinear", "trilinear", "ewa"][..]), ("wrap_mode", &["repeat"])]
                {
                    if let Some(said) = o.text(key)?
                        && !known.contains(&said)
                    {
                        notes.push(o.note(format!("textures are bilinear and repeat: `{key}` is ignored")));
                    }
                }
                o.known(&["format", "accel", "gamma", "cache", "max_anisotropy", "wrap_mode_u", "wrap_mode_v"]);
                Ok(self.image(o, file, raw, notes)?.map(|image| Read { image, to_uv }))
            }
            "checkerboard" => {
                let mut colors = [Vec3::splat(0.4), Vec3::splat(0.2)];
                for (color, key) in colors.iter_mut().zip(["color0", "color1"]) {
                    if let Some(Item::Object(_)) = o.item(key) {
                        notes.push(
                            o.note(format!("`{key}` of a checkerboard is a colour here, not a texture: ignored")),
                        );
                    } else if let Some(said) = o.color(key)? {
                        *color = said;
                    }
                }
                let key = [colors[0].to_array().map(f32::to_bits), colors[1].to_array().map(f32::to_bits)];
                let key = std::array::from_fn(|i| key[i / 3][i % 3]);
                if !self.boards.contains_key(&key) && self.boards.len() >= MAX_BOARDS {
                    return Err(o.error(format!("checkerboards of more than {MAX_BOARDS} pairs of colours")));
                }
                let image = self.boards.entry(key).or_insert_with(|| board(colors)).clone();
                Ok(Some(Read { image, to_uv }))
            }
            other => {
                let shown = super::values::shorten(other);
                notes.push(o.note(format!("the texture `{shown}` is not known: it is left out")));
                o.known(&o.items.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>());
                Ok(None)
            }
        }
    }

    /// The image of a file beside the scene; raw ones are made floats, which no role decodes from sRGB.
    pub fn image(
        &mut self,
        o: &Object,
        file: &str,
        raw: bool,
        notes: &mut Vec<Note>,
    ) -> Result<Option<Arc<TextureDesc>>, SceneError> {
        let path = super::beside(o, file);
        let image = match self.pictures.load(&path, notes) {
            Ok(image) => image,
            Err(e) if self.missing == Missing::Noted => {
                notes.push(o.note(format!("{e}: left out")));
                return Ok(None);
            }
            Err(e) => return Err(o.error(e.to_string())),
        };
        if raw {
            return self.pictures.made(&image, "raw", |texel| texel).map(Some).map_err(|problem| o.error(problem));
        }
        Ok(Some(image))
    }
}

/// A board of 2 by 2 fields; the first colour has the corner where texture coordinates start.
fn board(colors: [Vec3; 2]) -> Arc<TextureDesc> {
    let field = |x: u32, y: u32| usize::from((x < BOARD / 2) != (y < BOARD / 2));
    let at = |i: u32| {
        let c = colors[field(i % BOARD, i / BOARD)];
        [c.x, c.y, c.z, 1.0]
    };
    made(Path::new(""), BOARD, BOARD, Texels::RgbaF32((0..BOARD * BOARD).map(at).collect()))
}
