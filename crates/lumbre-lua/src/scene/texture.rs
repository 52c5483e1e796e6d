//! Textures of scenes: image files, and pictures that a Lua function computes.

use std::sync::Arc;

use glam::{Affine2, Vec2};
use mlua::{UserData, UserDataFields, Value as LuaValue, Variadic};

use crate::api::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::kind::KIND;
use lumbre_light::scene::desc::{Lookup, Texels, TextureDesc, TextureFilter, Wrap};
use lumbre_light::value::Value;
use lumbre_light::value::schema::Ty;
use lumbre_scene_io::load;

lumbre_light::table! {
    /// Options of `texture.paint`.
    pub const PAINT = "Paint", "Picture that a function computes.";
    size: Ty::nums(2, 1.0, 4096.0), "width and height in texels";
    color: Ty::Object("fun(u: number, v: number): number, number?, number?"),
        "function that returns red, green and blue, or one number for all three, at the centre of \
         each texel; u grows to the right and v upwards, both from 0 to 1";
    linear = "false": Ty::Bool,
        "`true`: linear radiance without an upper bound, for environments and emission; `false`: \
         display values from 0 to 1, decoded from sRGB if the texture is a colour";
}

lumbre_light::table! {
    /// Options of `texture.lay`.
    pub const LAY = "Lay", "Mapping of one texture on a surface, instead of that of its material.";
    wrap = "repeat": Ty::OneOrMany(&Ty::Word(Wrap::NAMES)),
        "treatment of coordinates outside 0 to 1; one word, or a list of those of u and v";
    filter = "bilinear": Ty::Word(TextureFilter::NAMES),
        "interpolation between the centres of four texels, or the texel that is `nearest`";
    scale = "{ 1, 1 }": Ty::nums(2, -1e6, 1e6), "number of repetitions along u and v";
    rotation = "0": Ty::num(-1e6, 1e6), "rotation in degrees, applied after the scale";
    offset = "{ 0, 0 }": Ty::nums(2, -1e6, 1e6), "offset of u and v, applied last";
    second = "false": Ty::Bool, "whether it uses the mesh's `second_uvs`";
}

functions! {
    /// Constructors of textures.
    pub const GLOBALS;
    "texture.file" -> "Texture" = file, "Returns a texture from an image file." {
        "path": "string", "Image file, relative to the scene's folder.";
    }
    "texture.paint" -> "Texture" = paint, "Returns a texture whose colours a function computes." {
        "options": "Paint", "Size and colours.";
    }
    "texture.lay" -> "Texture" = lay,
        "Returns the same texture with another mapping, which replaces that of an earlier \
         `texture.lay`." {
        "texture": "Texture|string", "Texture, or the name of an image file.";
        "options": "Lay", "Mapping of the texture.";
    }
    "texture.channel" -> "Texture" = channel,
        "Returns one channel of a texture as a grey one, so that one image gives several \
         parameters. Values are those of the file, not decoded from sRGB. The mapping is kept." {
        "texture": "Texture|string", "Texture, or the name of an image file.";
        "name": "string", "Channel: `red`, `green`, `blue` or `alpha`.";
    }
}

/// Names of channels in the order of texels.
const CHANNELS: [&str; 4] = ["red", "green", "blue", "alpha"];

/// Lua object of a texture with its mapping.
#[derive(Clone, Debug)]
pub struct TextureObject {
    /// Picture of the texture.
    pub texture: Arc<TextureDesc>,
    /// Mapping from texture coordinates to the picture.
    pub lookup: Lookup,
}

impl TextureObject {
    /// Creates a texture with the mapping of its material.
    pub fn plain(texture: impl Into<Arc<TextureDesc>>) -> TextureObject {
        TextureObject {
            texture: texture.into(),
            lookup: Lookup::default(),
        }
    }
}

impl UserData for TextureObject {
    fn add_fields<F: UserDataFields<Self>>(fields: &mut F) {
        fields.add_meta_field(KIND, "a texture");
    }
}

/// Returns the texture of a Lua value: a texture object, or an image file named by a string. `None`
/// for other values.
///
/// # Errors
/// Returns an error if the image file cannot be read.
pub fn texture_from_value(
    args: &Args,
    value: &LuaValue,
) -> Result<Option<TextureObject>, ScriptError> {
    match value {
        LuaValue::UserData(data) => Ok(data.borrow::<TextureObject>().ok().map(|t| t.clone())),
        LuaValue::String(name) => Ok(Some(TextureObject::plain(read_image(
            args,
            &name.to_string_lossy(),
        )?))),
        _ => Ok(None),
    }
}

/// Reads an image file below the scene's folder.
fn read_image(args: &Args, name: &str) -> Result<Arc<TextureDesc>, ScriptError> {
    let path = args.shared.folder.join(name);
    let mut notes = Vec::new();
    let watchdog = &args.shared.watchdog;
    let read = watchdog.pause_for(|| load::texture(&path, &mut notes));
    let texture = read.map_err(|e| args.error(e.to_string(), None))?;
    args.shared.scene.borrow_mut().notes.append(&mut notes);
    Ok(Arc::new(texture))
}

fn file(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = args.text(0, "path")?;
    args.object(TextureObject::plain(read_image(args, &name)?))
}

fn channel(args: &Args) -> Result<LuaValue, ScriptError> {
    let Some(texture) = texture_from_value(args, &args.get(0))? else {
        return Err(args.wrong(0, "texture", "a texture or the name of an image"));
    };
    let name = args.text(1, "name")?;
    let Some(c) = CHANNELS.iter().position(|channel| *channel == name) else {
        let problem = format!(
            "name: expected one of {}, found `{name}`",
            CHANNELS.join(", ")
        );
        return Err(args.error(problem, None));
    };
    let from = &texture.texture;
    let texels = match &from.texels {
        Texels::Rgba8(texels) => {
            let grey = |t: &[u8; 4]| [t[c], t[c], t[c], u8::MAX];
            Texels::Rgba8(texels.iter().map(grey).collect())
        }
        Texels::RgbaF32(texels) => {
            let grey = |t: &[f32; 4]| [t[c], t[c], t[c], 1.0];
            Texels::RgbaF32(texels.iter().map(grey).collect())
        }
    };
    let grey = TextureDesc::new(from.file.clone(), from.width, from.height, texels);
    args.object(TextureObject {
        texture: Arc::new(grey),
        ..texture
    })
}

fn lay(args: &Args) -> Result<LuaValue, ScriptError> {
    let Some(texture) = texture_from_value(args, &args.get(0))? else {
        return Err(args.wrong(0, "texture", "a texture or the name of an image"));
    };
    let fields = args.fields(1, "options", &LAY, "texture.lay")?;
    let wrap = |v: &Value| {
        Wrap::ALL
            .into_iter()
            .find(|wrap| v.as_str() == Some(wrap.name()))
            .unwrap_or_default()
    };
    let wrap = match fields.values.get("wrap") {
        None => [Wrap::Repeat; 2],
        Some(Value::List(words)) => match words.as_slice() {
            [u, v] => [wrap(u), wrap(v)],
            other => {
                let problem = format!(
                    "wrap: expected one word, or a list of two for u and v, found {} words",
                    other.len()
                );
                return Err(args.error(problem, None));
            }
        },
        Some(word) => [wrap(word); 2],
    };
    let pair = |key: &str, default: f32| {
        fields
            .numbers(key)
            .map_or(Vec2::splat(default), Vec2::from_array)
    };
    let angle = fields.f64("rotation").unwrap_or(0.0).to_radians() as f32;
    let map = Affine2::from_scale_angle_translation(Vec2::ONE, angle, pair("offset", 0.0))
        * Affine2::from_scale(pair("scale", 1.0));
    let second = fields.is_true("second");
    let filter = TextureFilter::ALL
        .into_iter()
        .find(|filter| fields.text("filter") == Some(filter.name()));
    let lookup = Lookup {
        wrap,
        filter: filter.unwrap_or_default(),
        second,
        map: (map != Affine2::IDENTITY).then_some(map),
    };
    args.object(TextureObject { lookup, ..texture })
}

fn paint(args: &Args) -> Result<LuaValue, ScriptError> {
    let fields = args.fields(0, "options", &PAINT, "texture.paint")?;
    let [width, height] = fields.numbers("size").unwrap_or([1.0; 2]).map(|n| n as u32);
    let Some(LuaValue::Function(color)) = fields.objects.get("color") else {
        return Err(args.error("color: expected a function of u and v", None));
    };
    let mut texels = Vec::with_capacity(width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let u = (f64::from(x) + 0.5) / f64::from(width);
            let v = 1.0 - (f64::from(y) + 0.5) / f64::from(height);
            let found: Variadic<f64> = color.call((u, v)).map_err(|e| args.shared.convert(&e))?;
            let rgb = match found.as_slice() {
                [grey] => [*grey; 3],
                [r, g, b] => [*r, *g, *b],
                other => {
                    let problem = format!(
                        "the colour function returned {} numbers: expected one or three",
                        other.len()
                    );
                    return Err(args.error(problem, None));
                }
            };
            if !rgb.iter().all(|c| c.is_finite()) {
                return Err(args.error(
                    format!("the colour at u = {u}, v = {v} is not finite: {rgb:?}"),
                    None,
                ));
            }
            texels.push([rgb[0] as f32, rgb[1] as f32, rgb[2] as f32, 1.0]);
        }
    }
    let texels = if fields.is_true("linear") {
        Texels::RgbaF32(texels)
    } else {
        let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
        let bytes: Vec<[u8; 4]> = texels.into_iter().map(|t| t.map(byte)).collect();
        Texels::Rgba8(bytes.into())
    };
    args.object(TextureObject::plain(TextureDesc::new(
        "", width, height, texels,
    )))
}
