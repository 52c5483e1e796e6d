//! Serialisation of textures: texels that several textures share are written once.

use std::borrow::Cow;

use serde::de::{Deserializer, Error};
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};

use super::Texture;
use crate::scene::desc::Lookup;

/// A texture, or the index of an earlier one with the same texels and the own mapping.
#[derive(Serialize, Deserialize)]
enum Entry<'a> {
    Own(Cow<'a, Texture>),
    Shared(usize, Lookup),
}

/// Writes textures; those with shared texels refer to the first that has them.
pub fn serialize<S: Serializer>(textures: &[Texture], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(textures.iter().enumerate().map(|(i, texture)| {
        let shares = |earlier: &Texture| earlier.texels.is(&texture.texels);
        match textures[..i].iter().position(shares) {
            Some(first) => Entry::Shared(first, texture.lookup),
            None => Entry::Own(Cow::Borrowed(texture)),
        }
    }))
}

/// Reads textures; those that shared texels share them again.
pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Texture>, D::Error> {
    let entries = Vec::<Entry<'static>>::deserialize(from)?;
    let mut textures: Vec<Texture> = Vec::with_capacity(entries.len());
    for entry in entries {
        textures.push(match entry {
            Entry::Own(texture) => texture.into_owned(),
            Entry::Shared(first, lookup) => {
                let missing = || D::Error::custom("a texture shares the texels of none before it");
                let texture = textures.get(first).ok_or_else(missing)?.clone();
                Texture { lookup, ..texture }
            }
        });
    }
    Ok(textures)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::{Texels, TextureDesc, Wrap};

    /// Textures as a field of a scene.
    #[derive(Serialize, Deserialize)]
    struct Textures(#[serde(with = "super")] Vec<Texture>);

    #[test]
    fn shared_texels_are_written_once_and_shared_again() {
        let plain = Texture::new(2, 1, vec![[0.25, 0.5, 1.0], [f32::MIN_POSITIVE, -0.0, 3.0]]);
        let mut clamped = plain.clone();
        clamped.lookup.wrap = [Wrap::Clamp; 2];
        let other = Texture::new(1, 1, vec![[0.25, 0.5, 1.0]]);
        let image = TextureDesc::new("", 1, 1, Texels::Rgba8(vec![[0, 99, 255, 7]].into()));
        let [colour, data] = [true, false].map(|srgb| Texture::decode(&image, srgb));
        let textures = Textures(vec![
            plain.clone(),
            other.clone(),
            clamped.clone(),
            colour.clone(),
            data.clone(),
        ]);
        let text = serde_json::to_string(&textures).unwrap();
        assert_eq!(text.matches("texels").count(), 4, "{text}");
        let Textures(back) = serde_json::from_str(&text).unwrap();
        // Bytes that are read by two curves are two textures.
        assert_eq!(back, [plain, other, clamped, colour, data]);
        assert!(back[0].texels.is(&back[2].texels));
        assert!(!back[0].texels.is(&back[1].texels));
        let early = text.replacen("\"Shared\":[0", "\"Shared\":[7", 1);
        assert!(serde_json::from_str::<Textures>(&early).is_err());
    }
}
