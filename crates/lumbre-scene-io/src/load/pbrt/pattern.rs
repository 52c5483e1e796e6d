//! Textures that are patterns: `checkerboard`, `dots`, `bilerp` and `uv` become images, and those
//! that depend on positions or directions their mean.

use glam::{Affine2, Vec2, Vec3};

use super::params::Params;
use super::texture::{TextureContext, TextureReader};
use super::token::truncated;
use crate::load::composed::{self, ImageTexture, TextureValue};
use lumbre_light::math::rng::pcg4d;
use lumbre_light::scene::SceneError;
use lumbre_light::scene::desc::{TextureFilter, Wrap};

/// Radius of dots in cells.
const RADIUS: f32 = 0.35;
/// Number of cells of dots along each axis after which they repeat.
const CELLS: u32 = 16;
/// Number of texels of a cell along each axis.
const CELL_TEXELS: u32 = 32;
/// Number of columns and rows of the image of texture coordinates.
const UV_TEXELS: u32 = 256;
/// Mean of `marble` over all phases of its waves.
const MARBLE: Vec3 = Vec3::new(0.804_635, 0.802_959, 0.839_813);
/// Mean magnitude of noise, by which pbrt replaces octaves that are too fine.
const NOISE: f64 = 0.2;

impl TextureReader {
    /// Reads a texture that is neither a constant, nor an image, nor a mix of others.
    pub(super) fn pattern(
        &mut self,
        class: &str,
        params: &Params,
        of_color: bool,
        c: &mut TextureContext<'_>,
    ) -> Result<TextureValue, SceneError> {
        let failed = |problem| params.error(problem);
        match class {
            "checkerboard" => {
                params.mark_read(&["aamode"]);
                let fields = self.pair(params, ["tex1", "tex2"], of_color, c)?;
                let solid = params.integer("dimension", 2, 3)? == 3;
                let half = Affine2::from_scale(Vec2::splat(0.5));
                let mask = composed::checkerboard(&mut self.images, half).map_err(failed)?;
                let mask = mapped(class, params, mask, solid, c)?;
                self.mixed(params, [fields[0].clone(), fields[1].clone(), mask], c)
            }
            "dots" => {
                let [inside, outside] = self.pair(params, ["inside", "outside"], of_color, c)?;
                c.notes
                    .push(params.note("other cells have dots than in pbrt, as many of them"));
                let mask = self
                    .image(class, CELLS * CELL_TEXELS, dots)
                    .map_err(failed)?;
                let cell = Affine2::from_scale(Vec2::splat(1.0 / CELLS as f32))
                    * Affine2::from_translation(Vec2::splat(0.5));
                let mask = ImageTexture { map: cell, ..mask };
                let mask = mapped(class, params, mask, false, c)?;
                self.mixed(params, [outside, inside, mask], c)
            }
            "bilerp" => self.bilerp(params, of_color, c),
            "uv" if of_color => {
                let texel = |x, y| {
                    let at = Vec2::new(x as f32, (UV_TEXELS - 1 - y) as f32) + 0.5;
                    (at / UV_TEXELS as f32).extend(0.0)
                };
                let image = self.image(class, UV_TEXELS, texel).map_err(failed)?;
                mapped(class, params, image, false, c)
            }
            other => {
                c.notes.push(params.note(format!(
                    "the texture `{}` is not supported; its mean is used",
                    truncated(other)
                )));
                self.mean_of_unsupported(other, params, of_color, c)
            }
        }
    }

    /// Returns two textures, whose defaults are 1 and 0.
    fn pair(
        &mut self,
        params: &Params,
        [first, second]: [&str; 2],
        of_color: bool,
        c: &mut TextureContext<'_>,
    ) -> Result<[TextureValue; 2], SceneError> {
        Ok([
            self.value(params, first, of_color, Vec3::ONE, c)?,
            self.value(params, second, of_color, Vec3::ZERO, c)?,
        ])
    }

    /// Returns a square image of which a function gives the texels, repeated and interpolated.
    fn image(
        &mut self,
        how: &str,
        side: u32,
        texel: impl Fn(u32, u32) -> Vec3,
    ) -> Result<ImageTexture, String> {
        Ok(ImageTexture {
            image: self.images.generated(how, "".as_ref(), [side; 2], texel)?,
            wrap: [Wrap::Repeat; 2],
            filter: TextureFilter::Bilinear,
            map: Affine2::IDENTITY,
        })
    }

    /// Reads a `bilerp`: an image of two by two texels, whose centres are the corners.
    fn bilerp(
        &mut self,
        params: &Params,
        of_color: bool,
        c: &mut TextureContext<'_>,
    ) -> Result<TextureValue, SceneError> {
        let mut corners = [Vec3::ZERO; 4];
        let names = [("v01", 1.0), ("v11", 1.0), ("v00", 0.0), ("v10", 0.0)];
        for (corner, (name, default)) in corners.iter_mut().zip(names) {
            let value = self.value(params, name, of_color, Vec3::splat(default), c)?;
            *corner = value.mean(true);
        }
        c.notes.push(params.note(
            "beyond coordinates from 0 to 1 the values at the edges are used; pbrt extrapolates",
        ));
        let texel = |x, y| corners[(2 * y + x) as usize];
        let image = self.image(&format!("bilerp {corners:?}"), 2, texel);
        let image = ImageTexture {
            wrap: [Wrap::Clamp; 2],
            map: Affine2::from_scale_angle_translation(Vec2::splat(0.5), 0.0, Vec2::splat(0.25)),
            ..image.map_err(|problem| params.error(problem))?
        };
        mapped("bilerp", params, image, false, c)
    }

    /// Returns the mean of a texture that is not supported, or grey where that is not known.
    fn mean_of_unsupported(
        &mut self,
        class: &str,
        params: &Params,
        of_color: bool,
        c: &mut TextureContext<'_>,
    ) -> Result<TextureValue, SceneError> {
        let mean = match class {
            "directionmix" => {
                // The mean of the cosine that is the weight.
                let half = TextureValue::Constant(Vec3::splat(0.5));
                let [b, a] = self.pair(params, ["tex2", "tex1"], of_color, c)?;
                return self.mixed(params, [a, b, half], c);
            }
            "fbm" | "windy" => Vec3::ZERO,
            "wrinkled" => {
                let octaves = params.number("octaves", 8.0)?.clamp(0.0, 64.0) as u32;
                let roughness = params.number("roughness", 0.5)?.clamp(-1.0, 1.0);
                let sum: f64 = (0..octaves).map(|i| roughness.powi(i as i32)).sum();
                Vec3::splat((NOISE * sum) as f32)
            }
            "marble" => MARBLE,
            _ => Vec3::splat(0.5),
        };
        Ok(TextureValue::Constant(mean))
    }
}

/// Returns an image with the mapping of a texture before its own, or the mean, with a note, if that
/// is not the mapping `uv`, or the texture is `solid`.
fn mapped(
    class: &str,
    params: &Params,
    image: ImageTexture,
    solid: bool,
    c: &mut TextureContext<'_>,
) -> Result<TextureValue, SceneError> {
    if let (Some(map), false) = (TextureReader::mapping(params)?, solid) {
        let map = image.map * map;
        return Ok(TextureValue::Image(ImageTexture { map, ..image }));
    }
    c.notes.push(params.note(format!(
        "only the mapping `uv` is supported; the mean of the texture `{class}` is used"
    )));
    Ok(TextureValue::Constant(
        TextureValue::Image(image).mean(true),
    ))
}

/// Returns the part of a texel that dots cover, given its column and row.
fn dots(x: u32, y: u32) -> Vec3 {
    let [present, u, v, _] = pcg4d([x / CELL_TEXELS, y / CELL_TEXELS, 0, 0]).map(noise);
    if present <= 0.0 {
        return Vec3::ZERO;
    }
    let centre = Vec2::new(u, v) * (0.5 - RADIUS) + 0.5;
    let covered = (0..64u32).filter(|i| {
        let within = (Vec2::new((i % 8) as f32, (i / 8) as f32) + 0.5) / 8.0;
        let corner = Vec2::new((x % CELL_TEXELS) as f32, (y % CELL_TEXELS) as f32);
        ((corner + within) / CELL_TEXELS as f32).distance(centre) < RADIUS
    });
    Vec3::splat(covered.count() as f32 / 64.0)
}

/// Returns a number from -1 to 1 with the distribution of Perlin's noise at the centre of a cell:
/// the mean of the gradients at its eight corners, each the sum of two halves of either sign.
fn noise(word: u32) -> f32 {
    ((word >> 16).count_ones() as f32 - 8.0) / 8.0
}
