//! Textures composed of others: images that are computed when a scene is loaded.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::{Affine2, DAffine2, DVec2, Vec2, Vec3};

use super::images::{ImageCache, mean_texel};
use lumbre_light::scene::compile::Curve;
use lumbre_light::scene::desc::{Lookup, Texels, TextureDesc, TextureFilter, Wrap};

/// Greatest side of a composed image in texels, unless one of its inputs has a greater one.
const MAX_SIDE: f64 = 4096.0;
/// Greatest number of repeats of the coarsest input after which all inputs repeat together.
const MAX_PERIODS: u32 = 16;
/// Greatest number of repeats of an input in a composed image, along each axis.
const MAX_REPEATS: f64 = 4096.0;
/// Relative error of numbers of repeats that come from maps in single precision.
const REPEAT_ERROR: f64 = 1e-6;
/// Least side of an image in which sharp edges meet interpolated texels.
const EDGE_SIDE: f64 = 512.0;
/// Greatest ratio of the sides of an image in the resolution of its inputs to those that it has.
const MAX_REDUCTION: f64 = 4.0;
/// Number of samples of a texel along each axis, of which large images have half as many.
const SAMPLES: u32 = 4;
/// Greatest number of texels of an image with all samples.
const SAMPLED_TEXELS: f64 = 4_194_304.0;
/// Distance in texels below which a point is on the edge or at the centre of a texel.
const SNAP: f64 = 1e-7;

/// An image with its mapping.
#[derive(Clone, Debug)]
pub(super) struct ImageTexture {
    /// Texels: colours in sRGB if they have 8 bits, else linear; or numbers in all three channels,
    /// linear.
    pub image: Arc<TextureDesc>,
    /// Wrap modes along u and v.
    pub wrap: [Wrap; 2],
    /// Interpolation between texels.
    pub filter: TextureFilter,
    /// Map from the mesh's coordinates to those of the image, both with v pointing up.
    pub map: Affine2,
}

/// The value of a texture.
#[derive(Clone, Debug)]
pub(super) enum TextureValue {
    /// The same value everywhere, in all three channels for a number.
    Constant(Vec3),
    /// An image with a mapping.
    Image(ImageTexture),
}

impl TextureValue {
    /// Returns the image, if this is one.
    fn image(&self) -> Option<&ImageTexture> {
        match self {
            TextureValue::Constant(_) => None,
            TextureValue::Image(image) => Some(image),
        }
    }

    /// Returns the mean, where images of 8 bits are decoded from sRGB if they are `of_color`.
    pub fn mean(&self, of_color: bool) -> Vec3 {
        match self {
            TextureValue::Constant(value) => *value,
            TextureValue::Image(texture) => mean_texel(&texture.image, of_color),
        }
    }
}

impl ImageTexture {
    /// Returns whether values are interpolated between texels.
    pub fn is_interpolated(&self) -> bool {
        self.filter == TextureFilter::Bilinear
    }

    /// Returns whether an interpolated image covers the texture coordinates from 0 to 1 once.
    pub fn is_plain(&self) -> bool {
        self.map == Affine2::IDENTITY && self.is_interpolated()
    }

    /// Returns the mapping of a material's texture, given its own map.
    pub fn lookup(&self, map: Option<Affine2>) -> Lookup {
        Lookup {
            wrap: self.wrap,
            filter: self.filter,
            second: false,
            map,
        }
    }

    /// Returns numbers of columns and rows.
    fn size(&self) -> DVec2 {
        DVec2::new(self.image.width.into(), self.image.height.into())
    }

    /// Returns the linear texels at columns and rows, which may be outside of it, row by row.
    fn texels<const N: usize>(&self, columns: [i64; N], rows: [i64; N]) -> [[Vec3; N]; N] {
        let inside = |i: i64, size: u32, wrap: Wrap| {
            let size = i64::from(size);
            let at = match wrap {
                _ if (0..size).contains(&i) => i,
                Wrap::Repeat => i.rem_euclid(size),
                Wrap::Mirror => {
                    let at = i.rem_euclid(2 * size);
                    at.min(2 * size - 1 - at)
                }
                Wrap::Clamp => i.clamp(0, size - 1),
            };
            at as usize
        };
        let (width, height) = (self.image.width, self.image.height);
        let columns = columns.map(|x| inside(x, width, self.wrap[0]));
        let rows = rows.map(|y| inside(y, height, self.wrap[1]) * width as usize);
        rows.map(|row| {
            columns.map(|column| match &self.image.texels {
                Texels::Rgba8(t) => {
                    let [r, g, b, _] = t[row + column];
                    Vec3::from_array([r, g, b].map(|x| Curve::Srgb.decode(x)))
                }
                Texels::RgbaF32(t) => Vec3::from_slice(&t[row + column]),
            })
        })
    }

    /// Returns the linear value at image coordinates.
    pub fn at(&self, uv: DVec2) -> Vec3 {
        let at = DVec2::new(uv.x, 1.0 - uv.y) * self.size();
        if !self.is_interpolated() {
            let texel = (at + SNAP).floor();
            let [[value]] = self.texels([texel.x as i64], [texel.y as i64]);
            return value;
        }
        let at = at - 0.5;
        let corner = (at + SNAP).floor();
        let (x, y) = (corner.x as i64, corner.y as i64);
        let Vec2 { x: right, y: below } = (at - corner).max(DVec2::ZERO).as_vec2();
        let rows = self.texels([x, x + 1], [y, y + 1]);
        let [above, under] = rows.map(|[a, b]| a.lerp(b, right));
        above.lerp(under, below)
    }
}

/// Returns the checkerboard of 0 and 1, a texel for each of its 2 by 2 fields, which is 1 at the
/// top left and at the bottom right. Its edges are sharp.
///
/// # Errors
/// Fails like [`ImageCache::generated`].
pub(super) fn checkerboard(images: &mut ImageCache, map: Affine2) -> Result<ImageTexture, String> {
    let field = |x, y| Vec3::splat(if x == y { 1.0 } else { 0.0 });
    Ok(ImageTexture {
        image: images.generated("checkerboard", "".as_ref(), [2, 2], field)?,
        wrap: [Wrap::Repeat; 2],
        filter: TextureFilter::Nearest,
        map,
    })
}

/// Returns `a (1 - t) + b t` of three textures `[a, b, t]`, channel by channel. The product of two
/// textures is that of a constant 0 and both.
///
/// Two or three images become one that is sampled at the centres of its texels. Where that is not
/// possible, the mean is used of all but one: the last, or else the first. `note` receives
/// messages.
///
/// # Errors
/// Returns a message if an image would be too large, or has values that are not finite.
pub(super) fn mixed(
    images: &mut ImageCache,
    mut values: [TextureValue; 3],
    note: &mut dyn FnMut(String),
) -> Result<TextureValue, String> {
    let is = |i: usize, c: Vec3| matches!(values[i], TextureValue::Constant(own) if own == c);
    let equal = if is(2, Vec3::ZERO) {
        Some(0)
    } else if is(2, Vec3::ONE) {
        Some(1)
    } else {
        (is(0, Vec3::ZERO) && is(1, Vec3::ONE)).then_some(2)
    };
    if let Some(i) = equal {
        return Ok(values[i].clone());
    }
    let Some(first) = values.iter().find_map(TextureValue::image).cloned() else {
        let [a, b, t] = values.map(|value| value.mean(true));
        return Ok(TextureValue::Constant(mix([a, b, t])));
    };
    let is_single = values.iter().filter_map(TextureValue::image).count() == 1;
    let inputs = values.each_ref().map(|value| match value {
        TextureValue::Constant(c) => ImageTexture {
            image: Arc::new(TextureDesc::new(
                "",
                1,
                1,
                Texels::RgbaF32(vec![c.extend(1.0).to_array()]),
            )),
            ..first.clone()
        },
        TextureValue::Image(image) => image.clone(),
    });
    let composed = match common_map(&inputs) {
        Some(common) => compose(images, &first, &inputs, common, note),
        None => Err("images whose maps do not repeat together cannot be combined".to_owned()),
    };
    match composed {
        Err(problem) if !is_single => {
            note(format!("{problem}; the mean is used of all but one"));
            let kept = if values[2].image().is_some() { 2 } else { 0 };
            for (i, value) in values.iter_mut().enumerate() {
                if i != kept {
                    *value = TextureValue::Constant(value.mean(true));
                }
            }
            mixed(images, values, note)
        }
        composed => composed.map(TextureValue::Image),
    }
}

/// Returns the mix of two colours.
fn mix([a, b, t]: [Vec3; 3]) -> Vec3 {
    a * (Vec3::ONE - t) + b * t
}

/// Map and wrap modes of a composed image, and the maps from its coordinates to those of its
/// inputs.
type Common = (Affine2, [Wrap; 2], [DAffine2; 3]);

/// Returns a map after which all images repeat together: that of all, or one that covers a whole
/// number of repeats of the coarsest image.
fn common_map(inputs: &[ImageTexture; 3]) -> Option<Common> {
    let (map, wrap) = (inputs[0].map, inputs[0].wrap);
    if inputs.iter().all(|i| i.map == map && i.wrap == wrap) {
        return Some((map, wrap, [DAffine2::IDENTITY; 3]));
    }
    if inputs.iter().any(|i| i.wrap.contains(&Wrap::Clamp)) {
        return None;
    }
    let area = |i: &&ImageTexture| i.map.matrix2.determinant().abs();
    let coarsest = inputs
        .iter()
        .min_by(|a, b| area(a).total_cmp(&area(b)))?
        .map;
    let inverse = coarsest.as_daffine2().inverse();
    let relative = inputs.each_ref().map(|i| i.map.as_daffine2() * inverse);
    let periods = |axis| {
        (1..=MAX_PERIODS).map(f64::from).find(|count| {
            let mut inputs = inputs.iter().zip(&relative);
            inputs.all(|(input, to)| {
                let repeats = to.matrix2.col(axis) * *count;
                is_period(repeats.x, input.wrap[0]) && is_period(repeats.y, input.wrap[1])
            })
        })
    };
    let periods = DVec2::new(periods(0)?, periods(1)?);
    let to_inputs = relative.map(|to| {
        let to = to * DAffine2::from_scale(periods);
        let columns = [to.matrix2.x_axis.round(), to.matrix2.y_axis.round()];
        // Every wrap mode here repeats after two images.
        let translation = to.translation.map(|x| x.rem_euclid(2.0));
        DAffine2::from_cols(columns[0], columns[1], translation)
    });
    let finite = to_inputs.iter().all(|to| to.is_finite());
    let map = Affine2::from_scale(periods.recip().as_vec2()) * coarsest;
    finite.then_some((map, [Wrap::Repeat; 2], to_inputs))
}

/// Returns whether an image that is wrapped like this is the same after a number of repeats.
fn is_period(repeats: f64, wrap: Wrap) -> bool {
    let periods = repeats / if wrap == Wrap::Mirror { 2.0 } else { 1.0 };
    let error = (periods - periods.round()).abs();
    periods.abs() <= MAX_REPEATS && error <= REPEAT_ERROR * periods.abs().max(1.0)
}

/// An input of an image that is computed.
struct Input<'a> {
    texture: &'a ImageTexture,
    /// Map from the coordinates of the image to those of the input.
    to_input: DAffine2,
    /// Whether the texels of both are at the same places, or the input is a constant.
    is_aligned: bool,
    /// Whether values are averaged over the area of a texel.
    is_averaged: bool,
}

/// Computes an image of the mix of its inputs, which have the resolution of the finest one.
fn compose(
    images: &mut ImageCache,
    first: &ImageTexture,
    inputs: &[ImageTexture; 3],
    (map, wrap, to_inputs): Common,
    note: &mut dyn FnMut(String),
) -> Result<ImageTexture, String> {
    let detailed = || {
        let both = inputs.iter().zip(&to_inputs);
        both.filter(|(input, _)| input.size() != DVec2::ONE)
    };
    let interpolated = detailed().filter(|(input, _)| input.is_interpolated());
    let (interpolated, all) = (interpolated.count(), detailed().count());
    let side = |axis: usize| {
        let texels = detailed().map(|(i, to)| to.matrix2.col(axis).abs() * i.size());
        let side = texels.map(DVec2::max_element).fold(1.0, f64::max);
        if interpolated > 0 && interpolated < all && side < EDGE_SIDE {
            // The centres of texels stay centres if their number is multiplied by an odd one.
            let half = (EDGE_SIDE / side / 2.0).floor();
            side * (2.0 * half + 1.0)
        } else {
            side
        }
    };
    let wanted = DVec2::new(side(0), side(1));
    let sides = inputs.iter().map(|i| i.size().max_element());
    let size = wanted.min(DVec2::splat(sides.fold(MAX_SIDE, f64::max)));
    let is_capped = size != wanted;
    if (wanted / size).max_element() > MAX_REDUCTION {
        return Err(format!("an image of {wanted} texels would be too large"));
    }
    let filter = match interpolated {
        0 if all > 0 => TextureFilter::Nearest,
        0 => first.filter,
        _ => TextureFilter::Bilinear,
    };
    let mut how = format!("mix {size}");
    let inputs: [Input<'_>; 3] = std::array::from_fn(|i| {
        let (texture, to_input) = (&inputs[i], to_inputs[i]);
        let ImageTexture { wrap, filter, .. } = texture;
        let hash = texture.image.content_hash;
        how += &format!(" {hash:?} {wrap:?} {filter:?} {to_input}");
        let is_equal = to_input == DAffine2::IDENTITY && texture.size() == size;
        Input {
            texture,
            to_input,
            is_aligned: is_equal || texture.size() == DVec2::ONE,
            is_averaged: is_capped || !texture.is_interpolated(),
        }
    });
    let is_averaged = inputs.iter().any(|i| !i.is_aligned && i.is_averaged);
    let samples = match is_averaged {
        true if size.element_product() > SAMPLED_TEXELS => SAMPLES / 2,
        true => SAMPLES,
        false => 1,
    };
    let texel = |x: u32, y: u32| {
        let mut sum = Vec3::ZERO.as_dvec3();
        for i in 0..samples * samples {
            let within = DVec2::new((i % samples).into(), (i / samples).into());
            let within = (within + 0.5) / f64::from(samples);
            let values = inputs.each_ref().map(|input| {
                if input.is_aligned {
                    let [[value]] = input.texture.texels([x.into()], [y.into()]);
                    return value;
                }
                let within = if input.is_averaged {
                    within
                } else {
                    DVec2::splat(0.5)
                };
                let at = (DVec2::new(x.into(), y.into()) + within) / size;
                let uv = DVec2::new(at.x, 1.0 - at.y);
                input.texture.at(input.to_input.transform_point2(uv))
            });
            sum += mix(values).as_dvec3();
        }
        (sum / f64::from(samples * samples)).as_vec3()
    };
    let file = &first.image.file;
    let image = images.generated(&how, file, [size.x as u32, size.y as u32], texel)?;
    if is_capped {
        note(format!(
            "an image of {wanted} texels would be needed to combine the images; one of {size} is \
             used"
        ));
    }
    Ok(ImageTexture {
        image,
        wrap,
        filter,
        map,
    })
}
