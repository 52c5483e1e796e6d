//! How a hierarchy of boxes is built: the key `accel` of a render table. It changes no picture, but for rays that aim at a
//! box's very edge and for the last digits where copies are kept once, but what finding hits costs, and so it is part of
//! what a run is.

use std::collections::BTreeMap;

use crate::scene::compile::Sharing;
use crate::value::Value;
use crate::value::schema::{Field, Table, Ty};

/// How the hierarchy of a scene is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AccelSpec {
    /// Who builds it.
    pub builder: Builder,
    /// Bins along each axis; `sah` only.
    pub bins: u32,
    /// Levels of the binary tree below its root; `plane` and `sah` only.
    pub max_depth: u32,
    /// Primitives that a leaf of the binary tree may have without being divided further; not `none`.
    pub max_leaf: u32,
    /// What `obvhs` is to spend on building; `ploc` and `cwbvh` only.
    pub quality: Quality,
    /// What becomes of meshes that several entities have.
    pub instances: Sharing,
    /// Whether the CPU shades many paths at once.
    pub lanes: InLanes,
}

impl Default for AccelSpec {
    fn default() -> AccelSpec {
        AccelSpec {
            builder: Builder::Ploc,
            bins: 14,
            max_depth: 48,
            max_leaf: 8,
            quality: Quality::Medium,
            instances: Sharing::Auto,
            lanes: InLanes::Auto,
        }
    }
}

/// Whether the CPU shades many paths at once in the lanes of vectors. Pictures have the same bits either way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InLanes {
    /// Where every technique's paths can all go so, and nowhere else: times compare techniques, and not who has lanes.
    Auto,
    /// Nowhere.
    Never,
    /// Wherever that is built, though for one technique and not for another.
    Always,
}

impl InLanes {
    const ALL: [InLanes; 3] = [InLanes::Auto, InLanes::Never, InLanes::Always];

    const WORDS: &'static [&'static str] = &["auto", "never", "always"];

    fn word(self) -> &'static str {
        InLanes::WORDS[self as usize]
    }
}

/// Who builds a hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Builder {
    /// Nobody: every ray is tested with every primitive, eight at a time.
    None,
    /// Cuts boxes in the middle of their longest side [second source, 4.2.1].
    Plane,
    /// Cuts where the surface area heuristic finds it cheapest, looking only at the borders of bins [Wald 2007].
    Sah,
    /// `obvhs`: locally ordered clustering [Meister and Bittner 2018] with reinsertion [Meister and Bittner 2018].
    Ploc,
    /// The same as compressed eight-wide nodes [Ylitie et al. 2017], traversed by `obvhs` as well, with one triangle tested
    /// at a time.
    Cwbvh,
}

impl Builder {
    /// Every builder, in the order of [`Builder::WORDS`].
    pub const ALL: [Builder; 5] = [Builder::None, Builder::Plane, Builder::Sah, Builder::Ploc, Builder::Cwbvh];

    /// The words for the builders in scripts.
    pub const WORDS: &'static [&'static str] = &["none", "plane", "sah", "ploc", "cwbvh"];

    /// Its word.
    pub fn word(self) -> &'static str {
        Builder::WORDS[self as usize]
    }
}

/// The presets of `obvhs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quality {
    /// Nothing but clustering of neighbours.
    Fastest,
    /// With very little reinsertion.
    VeryFast,
    /// With little reinsertion.
    Fast,
    /// The default: about as long as Embree takes.
    Medium,
    /// Wider search and more reinsertion. Triangles are not cut into several boxes first, as `obvhs` itself does with this
    /// and the next preset.
    Slow,
    /// Reinsertion of everything.
    VerySlow,
}

impl Quality {
    /// Every preset, in the order of [`Quality::WORDS`].
    pub const ALL: [Quality; 6] =
        [Quality::Fastest, Quality::VeryFast, Quality::Fast, Quality::Medium, Quality::Slow, Quality::VerySlow];

    /// The words for the presets in scripts.
    pub const WORDS: &'static [&'static str] = &["fastest", "very_fast", "fast", "medium", "slow", "very_slow"];

    /// Its word.
    pub fn word(self) -> &'static str {
        Quality::WORDS[self as usize]
    }
}

/// The words for what becomes of meshes that several entities have, in the order of [`SHARINGS`].
const SHARING_WORDS: &[&str] = &["auto", "always", "never"];

const SHARINGS: [Sharing; 3] = [Sharing::Auto, Sharing::Always, Sharing::Never];

/// `accel` in the render table.
pub const ACCEL: Table = Table {
    name: "Accel",
    doc: "How the hierarchy is built through which rays find what they hit, by `cpu` and `vulkan-compute`. It changes no picture, \
          only times.",
    fields: &[
        Field {
            key: "builder",
            ty: Ty::Word(Builder::WORDS),
            required: false,
            default: "ploc",
            doc: "none tests everything, plane cuts boxes in the middle (both as the second source compares them), sah \
                  is its binned surface area heuristic, ploc is obvhs, and cwbvh is obvhs with its own traversal (by \
                  vulkan-compute the same as ploc)",
        },
        Field {
            key: "bins",
            ty: Ty::Int { min: 2, max: 1024 },
            required: false,
            default: "14",
            doc: "sah: bins along each axis",
        },
        Field {
            key: "max_depth",
            ty: Ty::Int { min: 0, max: 200 },
            required: false,
            default: "48",
            doc: "plane, sah: levels below the root, at the last of which everything is a leaf",
        },
        Field {
            key: "max_leaf",
            ty: Ty::Int { min: 1, max: 255 },
            required: false,
            default: "8",
            doc: "most primitives of a leaf that is not divided further, and that ploc joins where it costs less; the CPU \
                  tests eight at once in any case (cwbvh, and ploc by vulkan-compute: at most three)",
        },
        Field {
            key: "quality",
            ty: Ty::Word(Quality::WORDS),
            required: false,
            default: "medium",
            doc: "ploc, cwbvh: what is spent on building",
        },
        Field {
            key: "instances",
            ty: Ty::Word(SHARING_WORDS),
            required: false,
            default: "auto",
            doc: "whether meshes with several places are kept once and have hierarchies of their own; auto is in scenes of \
                  more than 2^20 triangles, since below rays are faster without",
        },
        Field {
            key: "lanes",
            ty: Ty::Word(InLanes::WORDS),
            required: false,
            default: "auto",
            doc: "cpu: whether to shade many paths at once in the lanes of vectors, to the same bits. auto is where every \
                  surface of the scene is known there, in nights all of whose runs on the CPU can, so that no technique has \
                  what another has not; always is wherever one can. References always do",
        },
    ],
};

impl AccelSpec {
    /// What a table that [`ACCEL`] has checked says.
    pub fn from_map(map: &BTreeMap<String, Value>) -> AccelSpec {
        let plain = AccelSpec::default();
        let place = |key: &str, words: &[&str]| {
            let word = map.get(key).and_then(Value::as_str)?;
            words.iter().position(|w| *w == word)
        };
        let whole = |key: &str| map.get(key).and_then(Value::as_i64).and_then(|n| u32::try_from(n).ok());
        AccelSpec {
            builder: place("builder", Builder::WORDS).map_or(plain.builder, |i| Builder::ALL[i]),
            bins: whole("bins").unwrap_or(plain.bins),
            max_depth: whole("max_depth").unwrap_or(plain.max_depth),
            max_leaf: whole("max_leaf").unwrap_or(plain.max_leaf),
            quality: place("quality", Quality::WORDS).map_or(plain.quality, |i| Quality::ALL[i]),
            instances: place("instances", SHARING_WORDS).map_or(plain.instances, |i| SHARINGS[i]),
            lanes: place("lanes", InLanes::WORDS).map_or(plain.lanes, |i| InLanes::ALL[i]),
        }
    }

    /// What a table that [`AccelSpec::identity`] has made says.
    pub fn from_identity(map: &BTreeMap<String, Value>) -> AccelSpec {
        let said = AccelSpec::from_map(map);
        AccelSpec { lanes: if map.contains_key("lanes") { said.lanes } else { InLanes::Never }, ..said }
    }

    /// The same with paths one by one.
    pub fn alone(self) -> AccelSpec {
        AccelSpec { lanes: InLanes::Never, ..self }
    }

    /// What of it counts, in canonical form: the builder's own fields, and those that are not as by default. The default
    /// is the empty map but for lanes, which are left out where there are none, as there were none once.
    pub fn identity(&self) -> BTreeMap<String, Value> {
        let plain = AccelSpec::default();
        let whole = |n: u32| Value::Int(i64::from(n));
        let divides = matches!(self.builder, Builder::Plane | Builder::Sah);
        let obvhs = matches!(self.builder, Builder::Ploc | Builder::Cwbvh);
        let fields = [
            ("builder", self.builder != plain.builder, self.builder.word().into()),
            ("bins", self.builder == Builder::Sah, whole(self.bins)),
            ("max_depth", divides, whole(self.max_depth)),
            ("max_leaf", self.builder != Builder::None && self.max_leaf != plain.max_leaf, whole(self.max_leaf)),
            ("quality", obvhs && self.quality != plain.quality, self.quality.word().into()),
            ("instances", self.instances != plain.instances, self.sharing_word().into()),
            ("lanes", self.lanes != InLanes::Never, self.lanes.word().into()),
        ];
        fields.into_iter().filter(|(_, counts, _)| *counts).map(|(key, _, value)| (key.to_owned(), value)).collect()
    }

    /// A few words for people: the builder and what it was told.
    pub fn describe(&self) -> String {
        let own = match self.builder {
            Builder::None => String::new(),
            Builder::Plane => format!(" to {} levels", self.max_depth),
            Builder::Sah => format!(" with {} bins to {} levels", self.bins, self.max_depth),
            Builder::Ploc | Builder::Cwbvh => format!(" {}", self.quality.word().replace('_', " ")),
        };
        format!("{}{own}", self.builder.word())
    }

    fn sharing_word(&self) -> &'static str {
        SHARINGS.iter().zip(SHARING_WORDS).find(|(s, _)| **s == self.instances).map_or("", |(_, word)| *word)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_builder_does_not_read_is_no_part_of_what_a_run_is() {
        assert!(AccelSpec::default().alone().identity().is_empty());
        let map = |pairs: &[(&str, Value)]| pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
        let of = |pairs: &[(&str, Value)]| AccelSpec::from_map(&map(pairs)).alone().identity();
        assert!(of(&[("builder", "ploc".into()), ("bins", Value::Int(3)), ("max_depth", Value::Int(2))]).is_empty());
        let sah = of(&[("builder", "sah".into()), ("quality", "slow".into())]);
        assert_eq!(sah, map(&[("builder", "sah".into()), ("bins", Value::Int(14)), ("max_depth", Value::Int(48))]));
        assert_eq!(of(&[("builder", "none".into()), ("max_leaf", Value::Int(2))]), map(&[("builder", "none".into())]));
        assert_eq!(of(&[("quality", "fast".into())]), map(&[("quality", "fast".into())]));
        assert_eq!(of(&[("instances", "never".into())]), map(&[("instances", "never".into())]));
    }

    #[test]
    fn words_are_those_of_their_variants() {
        assert!(Builder::ALL.iter().zip(Builder::WORDS).all(|(b, word)| b.word() == *word));
        assert!(Quality::ALL.iter().zip(Quality::WORDS).all(|(q, word)| q.word() == *word));
        assert!(InLanes::ALL.iter().zip(InLanes::WORDS).all(|(l, word)| l.word() == *word));
        assert_eq!(SHARINGS.len(), SHARING_WORDS.len());
        assert_eq!(InLanes::ALL.len(), InLanes::WORDS.len());
    }

    #[test]
    fn what_is_written_down_is_read_back() {
        for lanes in InLanes::ALL {
            let spec = AccelSpec { lanes, max_leaf: 3, ..AccelSpec::default() };
            assert_eq!(AccelSpec::from_identity(&spec.identity()), spec);
        }
        assert_eq!(AccelSpec::from_map(&BTreeMap::new()), AccelSpec::default());
    }
}
