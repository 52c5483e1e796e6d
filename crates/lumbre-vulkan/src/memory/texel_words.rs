//! The array of words that holds the texels of a scene: bytes as image files have them, with a table of
//! the values that they mean, or floats.

use std::collections::BTreeMap;

use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{Curve, LinearTexels, Texture};

/// Words of a texel of floats.
const FLOATS: u64 = 3;

/// Place of the texels of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Index of the first word.
    pub first: u64,
    /// If a texel is one word, of four bytes, the index of the first of 256 values that a byte means;
    /// `None` if a texel is three words, which are floats.
    pub table: Option<u64>,
}

/// Indices of the words of a scene. Words of textures come first, then those of the environment map,
/// tables, colours at the corners of triangles, and second texture coordinates there, with a third
/// word of zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TexelLayout {
    /// Places of the scene's textures, the environment map's last. Textures may share words.
    pub places: Vec<Place>,
    tables: Vec<(Curve, u64)>,
    /// Index of the first word of the colours.
    pub colors: u64,
    /// Index of the first word of the second texture coordinates.
    pub second_uvs: u64,
    /// Number of words.
    pub count: u64,
}

impl TexelLayout {
    /// Lays out the texels of a scene. The environment map is always stored as floats.
    pub fn new(scene: &CompiledScene) -> TexelLayout {
        let (mut known, mut firsts, mut end) = (BTreeMap::new(), Vec::new(), 0);
        for texels in scene.textures.iter().map(|t| &t.texels) {
            let first = *known.entry(texels.address()).or_insert(end);
            let words = match texels {
                LinearTexels::Bytes(..) => 1,
                LinearTexels::Floats(_) => FLOATS,
            };
            end = end.max(first + words * texels.len() as u64);
            firsts.push((first, texels));
        }
        let map = environment_map(scene).map(|map| (end, FLOATS * map.texels.len() as u64));
        end += map.map_or(0, |(_, words)| words);
        let mut tables: Vec<(Curve, u64)> = Vec::new();
        for curve in Curve::ALL {
            let used = |(_, texels): &(u64, &LinearTexels)| matches!(texels, LinearTexels::Bytes(_, own) if *own == curve);
            if firsts.iter().any(used) {
                tables.push((curve, end));
                end += curve.table().len() as u64;
            }
        }
        let place = |(first, texels)| Place {
            first,
            table: match texels {
                &LinearTexels::Bytes(_, curve) => table_of(&tables, curve),
                LinearTexels::Floats(_) => None,
            },
        };
        let map = map.map(|(first, _)| Place { first, table: None });
        let places = firsts.into_iter().map(place).chain(map).collect();
        let second_uvs = end + FLOATS * scene.colors.as_flattened().len() as u64;
        TexelLayout {
            places,
            tables,
            colors: end,
            second_uvs,
            count: second_uvs + FLOATS * scene.second_uvs.as_flattened().len() as u64,
        }
    }

    /// Returns the words of the scene that this layout was made for.
    pub fn words(&self, scene: &CompiledScene) -> Vec<u32> {
        let mut words = Vec::with_capacity(self.count as usize);
        for (texture, place) in scene.textures.iter().zip(&self.places) {
            // Words that a texture shares are stored already.
            if place.first < words.len() as u64 {
                continue;
            }
            match &texture.texels {
                LinearTexels::Bytes(bytes, _) => {
                    words.extend(bytes.iter().map(|bytes| u32::from_le_bytes(*bytes)));
                }
                LinearTexels::Floats(floats) => push_floats(&mut words, floats.iter().copied()),
            }
        }
        if let Some(map) = environment_map(scene) {
            push_floats(&mut words, map.texels.iter());
        }
        for (curve, _) in &self.tables {
            words.extend(curve.table().map(f32::to_bits));
        }
        let colors = scene.colors.as_flattened().iter();
        push_floats(&mut words, colors.map(|color| color.to_array()));
        let second = scene.second_uvs.as_flattened().iter();
        push_floats(&mut words, second.map(|uv| [uv.x, uv.y, 0.0]));
        words
    }
}

fn push_floats(words: &mut Vec<u32>, texels: impl Iterator<Item = [f32; 3]>) {
    words.extend(texels.flat_map(|texel| texel.map(f32::to_bits)));
}

fn table_of(tables: &[(Curve, u64)], curve: Curve) -> Option<u64> {
    let own = tables.iter().find(|(of, _)| *of == curve);
    own.map(|(_, first)| *first)
}

/// Returns the map of the scene's environment.
pub fn environment_map(scene: &CompiledScene) -> Option<&Texture> {
    scene.environment.as_ref().and_then(|e| e.map.as_deref())
}
