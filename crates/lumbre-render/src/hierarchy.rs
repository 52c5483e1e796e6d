//! Settings of the acceleration structure: the key `accel` of a render table. They change the cost
//! of rays and are therefore part of a run's identity. They do not change the picture, except for
//! rays that hit exactly the edge of a box, and for the last digits of hits on instanced meshes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use lumbre_light::scene::compile::Sharing;
use lumbre_light::value::Value;
use lumbre_light::value::schema::Ty;

/// Settings of a scene's bounding volume hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AccelSpec {
    /// Builder of the hierarchy.
    pub builder: Builder,
    /// Number of bins along each axis; `sah` only.
    pub bins: u32,
    /// Maximum depth of the binary tree; `plane`, `plane_z` and `sah` only.
    pub max_depth: u32,
    /// Number of primitives up to which a leaf of the binary tree is not divided further; not
    /// `none` and `plane_z`.
    pub max_leaf: u32,
    /// Build quality; `ploc` and `cwbvh` only.
    pub quality: Quality,
    /// Treatment of meshes that several entities use.
    pub instances: Sharing,
    /// Use of the vectorised integrators of the CPU.
    pub lanes: LaneMode,
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
            lanes: LaneMode::Auto,
        }
    }
}

lumbre_light::named! {
    /// Use of the vectorised integrators of the CPU. Pictures have the same bits either way.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub enum LaneMode {
        /// Whenever an integrator has a vectorised implementation; the default.
        Auto = "auto",
        /// Never use them.
        Never = "never",
        /// The same as [`LaneMode::Auto`], under a run id of its own.
        Always = "always",
    }
}

lumbre_light::named! {
    /// Builder of a hierarchy.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    pub enum Builder {
        /// No hierarchy: every ray is tested with every primitive, eight at a time.
        None = "none",
        /// Splits boxes in the middle of their longest side [thesis S1 (docs/inside/transport.md),
        /// section 4.2.1].
        Plane = "plane",
        /// The same as listing 4.6 of thesis S1 is printed: always along z, to the maximum depth.
        PlaneZ = "plane_z",
        /// Splits at the bin border that is cheapest by the surface area heuristic [Wald 2007].
        Sah = "sah",
        /// Splits at the median along the longest side of the centroids' box: the depth is the
        /// binary logarithm of the number of primitives, whatever the scene.
        Median = "median",
        /// Locally ordered clustering [Meister and Bittner 2018a] with reinsertion [Meister and
        /// Bittner 2018b], by `obvhs`.
        Ploc = "ploc",
        /// As [`Builder::Ploc`] with compressed eight-wide nodes [Ylitie et al. 2017]. The CPU
        /// tests one triangle of them at a time.
        Cwbvh = "cwbvh",
    }
}

lumbre_light::named! {
    /// Effort of the builders `ploc` and `cwbvh`: the preset of `obvhs`, and whether long triangles
    /// are cut into parts.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
    pub enum Quality {
        /// Clustering of neighbours along the Morton curve, without reinsertion and parts of
        /// triangles.
        Fastest = "fastest",
        /// The same with some reinsertion, and parts of long triangles, as for all that follow.
        VeryFast = "very_fast",
        /// Clustering within 6 places along the curve, but of neighbours in the first two passes,
        /// and more reinsertion.
        Fast = "fast",
        /// Default: clustering within 6 places in all passes, and half as much reinsertion again.
        Medium = "medium",
        /// Clustering within 24 places, and seven times as much reinsertion.
        Slow = "slow",
        /// Clustering within 14 places, and reinsertion of all nodes in every round.
        VerySlow = "very_slow",
    }
}

/// Names in scripts for the treatment of shared meshes, in the order of [`SHARINGS`].
const SHARING_WORDS: &[&str] = &["auto", "always", "never"];

const SHARINGS: [Sharing; 3] = [Sharing::Auto, Sharing::Always, Sharing::Never];

/// Returns the treatment of shared meshes with this name.
fn sharing(name: &str) -> Option<Sharing> {
    let at = SHARING_WORDS.iter().position(|word| *word == name)?;
    Some(SHARINGS[at])
}

lumbre_light::table! {
    /// Schema of `accel` in the render table.
    pub const ACCEL = "Accel",
        "Settings of the acceleration structure of `cpu` and `vulkan-compute`. They affect only \
         render time, not the picture.";
    builder = "ploc": Ty::Word(Builder::NAMES),
        "none: no hierarchy, every ray is tested with every primitive; plane: boxes are split in \
         the middle of their longest side; plane_z: always along z, to the maximum depth; sah: \
         binned surface area heuristic; median: halves by number; ploc: locally ordered clustering \
         with reinsertion; cwbvh: the same with compressed nodes, and triangles tested one at a \
         time (on vulkan-compute identical to ploc). Where ploc and cwbvh are too deep for \
         traversal, median is used";
    bins = "14": Ty::int(2, 1024), "sah: number of bins along each axis";
    max_depth = "48": Ty::int(0, 200),
        "plane, plane_z, sah: maximum number of levels below the root";
    max_leaf = "8": Ty::int(1, 255),
        "number of primitives up to which a leaf is not divided further (plane_z: 1), and to which \
         ploc merges leaves if that costs less; the CPU always tests eight at once (cwbvh, and \
         ploc on vulkan-compute: at most three)";
    quality = "medium": Ty::Word(Quality::NAMES),
        "ploc, cwbvh: build quality; slower presets make faster hierarchies. All but fastest cut \
         long triangles that are oblique to the axes into parts with boxes of their own, which add \
         at most half of the number of triangles";
    instances = "auto": Ty::Word(SHARING_WORDS),
        "whether meshes that are used several times are stored once, each with its own hierarchy; \
         auto does so in scenes of more than 2^20 triangles, since smaller ones render faster \
         without";
    lanes = "auto": Ty::Word(LaneMode::NAMES),
        "cpu: whether to use the vectorised integrators, which give identical pictures. auto uses \
         them for every run that can; always is the same under an id of its own. References always \
         use them";
}

impl AccelSpec {
    /// Parses a table that was checked against [`ACCEL`].
    pub fn from_map(map: &BTreeMap<String, Value>) -> AccelSpec {
        let defaults = AccelSpec::default();
        let word = |key: &str| map.get(key).and_then(Value::as_str);
        let integer = |key: &str| {
            map.get(key)
                .and_then(Value::as_i64)
                .and_then(|n| u32::try_from(n).ok())
        };
        AccelSpec {
            builder: word("builder")
                .and_then(Builder::from_name)
                .unwrap_or(defaults.builder),
            bins: integer("bins").unwrap_or(defaults.bins),
            max_depth: integer("max_depth").unwrap_or(defaults.max_depth),
            max_leaf: integer("max_leaf").unwrap_or(defaults.max_leaf),
            quality: word("quality")
                .and_then(Quality::from_name)
                .unwrap_or(defaults.quality),
            instances: word("instances")
                .and_then(sharing)
                .unwrap_or(defaults.instances),
            lanes: word("lanes")
                .and_then(LaneMode::from_name)
                .unwrap_or(defaults.lanes),
        }
    }

    /// Parses a table that [`AccelSpec::identity`] made.
    pub fn from_identity(map: &BTreeMap<String, Value>) -> AccelSpec {
        let spec = AccelSpec::from_map(map);
        AccelSpec {
            lanes: if map.contains_key("lanes") {
                spec.lanes
            } else {
                LaneMode::Never
            },
            ..spec
        }
    }

    /// Returns the same settings with the scalar integrators.
    pub fn scalar(self) -> AccelSpec {
        AccelSpec {
            lanes: LaneMode::Never,
            ..self
        }
    }

    /// Returns the settings that are part of a run's identity, in canonical form: the fields that
    /// the builder uses, and those that differ from the default. The default is the empty map
    /// except for `lanes`, which is left out if `never`, the value of runs from before the key
    /// existed.
    pub fn identity(&self) -> BTreeMap<String, Value> {
        let defaults = AccelSpec::default();
        let integer = |n: u32| Value::Int(i64::from(n));
        let divides = matches!(
            self.builder,
            Builder::Plane | Builder::PlaneZ | Builder::Sah
        );
        let clusters = matches!(self.builder, Builder::Ploc | Builder::Cwbvh);
        let fields = [
            (
                "builder",
                self.builder != defaults.builder,
                self.builder.name().into(),
            ),
            ("bins", self.builder == Builder::Sah, integer(self.bins)),
            ("max_depth", divides, integer(self.max_depth)),
            (
                "max_leaf",
                !matches!(self.builder, Builder::None | Builder::PlaneZ)
                    && self.max_leaf != defaults.max_leaf,
                integer(self.max_leaf),
            ),
            (
                "quality",
                clusters && self.quality != defaults.quality,
                self.quality.name().into(),
            ),
            (
                "instances",
                self.instances != defaults.instances,
                self.sharing_name().into(),
            ),
            (
                "lanes",
                self.lanes != LaneMode::Never,
                self.lanes.name().into(),
            ),
        ];
        fields
            .into_iter()
            .filter(|(_, counts, _)| *counts)
            .map(|(key, _, value)| (key.to_owned(), value))
            .collect()
    }

    /// Returns the settings to use instead where a tree of these is too deep for traversal, or
    /// `None` if the builder is one that a user chose to study.
    pub fn shallow(&self) -> Option<AccelSpec> {
        matches!(self.builder, Builder::Ploc | Builder::Cwbvh).then_some(AccelSpec {
            builder: Builder::Median,
            ..*self
        })
    }

    /// Returns a short description for users: the builder and its settings.
    pub fn describe(&self) -> String {
        let own = match self.builder {
            Builder::None | Builder::Median => String::new(),
            Builder::Plane | Builder::PlaneZ => format!(" to {} levels", self.max_depth),
            Builder::Sah => format!(" with {} bins to {} levels", self.bins, self.max_depth),
            Builder::Ploc | Builder::Cwbvh => format!(" {}", self.quality.name().replace('_', " ")),
        };
        format!("{}{own}", self.builder.name())
    }

    fn sharing_name(&self) -> &'static str {
        SHARINGS
            .iter()
            .zip(SHARING_WORDS)
            .find(|(s, _)| **s == self.instances)
            .map_or("", |(_, name)| *name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_a_builder_ignores_are_not_in_its_identity() {
        assert!(AccelSpec::default().scalar().identity().is_empty());
        let map = |pairs: &[(&str, Value)]| {
            pairs
                .iter()
                .map(|(k, v)| ((*k).to_owned(), v.clone()))
                .collect()
        };
        let identity_of =
            |pairs: &[(&str, Value)]| AccelSpec::from_map(&map(pairs)).scalar().identity();
        assert!(
            identity_of(&[
                ("builder", "ploc".into()),
                ("bins", Value::Int(3)),
                ("max_depth", Value::Int(2))
            ])
            .is_empty()
        );
        let sah = identity_of(&[("builder", "sah".into()), ("quality", "slow".into())]);
        assert_eq!(
            sah,
            map(&[
                ("builder", "sah".into()),
                ("bins", Value::Int(14)),
                ("max_depth", Value::Int(48))
            ])
        );
        assert_eq!(
            identity_of(&[("builder", "none".into()), ("max_leaf", Value::Int(2))]),
            map(&[("builder", "none".into())])
        );
        assert_eq!(
            identity_of(&[("quality", "fast".into())]),
            map(&[("quality", "fast".into())])
        );
        assert_eq!(
            identity_of(&[("instances", "never".into())]),
            map(&[("instances", "never".into())])
        );
    }

    #[test]
    fn names_match_their_variants() {
        assert!(
            Builder::ALL
                .iter()
                .zip(Builder::NAMES)
                .all(|(b, name)| b.name() == *name)
        );
        assert!(
            Quality::ALL
                .iter()
                .zip(Quality::NAMES)
                .all(|(q, name)| q.name() == *name)
        );
        assert!(
            LaneMode::ALL
                .iter()
                .zip(LaneMode::NAMES)
                .all(|(l, name)| l.name() == *name)
        );
        assert_eq!(SHARINGS.len(), SHARING_WORDS.len());
        assert_eq!(LaneMode::ALL.len(), LaneMode::NAMES.len());
    }

    #[test]
    fn identities_are_parsed_back() {
        for lanes in LaneMode::ALL {
            let spec = AccelSpec {
                lanes,
                max_leaf: 3,
                ..AccelSpec::default()
            };
            assert_eq!(AccelSpec::from_identity(&spec.identity()), spec);
        }
        assert_eq!(AccelSpec::from_map(&BTreeMap::new()), AccelSpec::default());
    }
}
