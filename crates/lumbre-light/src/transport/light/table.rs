//! The table of the kinds of lights, their identities, and the parameters of every light in rows of
//! numbers.

use glam::Vec3;

use crate::math::simd::F32x8;
use crate::scene::CompiledScene;

/// Calls a macro with the kinds of lights, a row each: variant of [`LightId`], list of the scene,
/// type of its lights, and [`Place`]. Lights have their indices in this order: surfaces first, then
/// points, then infinitely distant lights, and the environment, of which a scene has at most one.
macro_rules! lights {
    ($declare:ident) => {
        $declare! {
            /// An emissive primitive: index into [`CompiledScene::emitters`].
            Emitter(u32) in emitters: compile::Emitter, Surface;
            /// A point light: index into [`CompiledScene::points`].
            Point(u32) in points: compile::PointLight, Point;
            /// A directional light: index into [`CompiledScene::directionals`].
            Directional(u32) in directionals: compile::DirectionalLight, Direction;
            /// The environment: [`CompiledScene::environment`].
            Environment in environment: compile::Environment, Outside;
        }
    };
}
pub(super) use lights;

/// The points of a light, on which the measures of its densities depend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// A surface, which paths can hit.
    Surface,
    /// A single point.
    Point,
    /// A single direction, infinitely far away.
    Direction,
    /// Many directions, infinitely far away, into which paths can leave the scene.
    Outside,
}

impl Place {
    /// Returns whether the light is infinitely distant.
    #[inline(always)]
    pub const fn is_distant(self) -> bool {
        matches!(self, Place::Direction | Place::Outside)
    }

    /// Returns whether no path can hit the light by chance.
    #[inline(always)]
    pub const fn is_dirac(self) -> bool {
        matches!(self, Place::Point | Place::Direction)
    }
}

/// Declares the identities of lights from the table.
macro_rules! identities {
    ($($(#[$doc:meta])* $Kind:ident $(($index:ty))? in $list:ident: $Source:ty, $place:ident;)+) => {
        /// Identifies one light.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum LightId {
            $($(#[$doc])* $Kind $(($index))?,)+
        }

        /// The kinds of lights.
        #[derive(Clone, Copy, Debug)]
        pub(super) enum SourceKind {
            $($Kind,)+
        }

        impl LightId {
            /// Returns the kind of the light and its index among those of the kind.
            #[inline]
            pub(super) fn parts(self) -> (SourceKind, u32) {
                match self {
                    $($(LightId::$Kind(own) => {
                        let own: $index = own;
                        (SourceKind::$Kind, own)
                    })?)+
                    LightId::Environment => (SourceKind::Environment, 0),
                }
            }

            /// Returns the points of the light.
            #[inline]
            pub fn place(self) -> Place {
                match self.parts().0 {
                    $(SourceKind::$Kind => Place::$place,)+
                }
            }

            /// Returns the identity of the light with an index, from
            /// [`Lights::first`](super::Lights::first).
            #[inline]
            pub(super) fn new(first: [u32; LISTS], index: u32) -> LightId {
                $($(
                    let kind = SourceKind::$Kind;
                    if index < first[kind as usize] {
                        let own: $index = index - kind.first_index(first);
                        return LightId::$Kind(own);
                    }
                )?)+
                LightId::Environment
            }
        }

        /// Returns the index of the first light of each kind but the first.
        pub(super) fn first_indices(scene: &CompiledScene) -> [u32; LISTS] {
            let counts = [$(scene.$list.as_slice().len() as u32,)+];
            let mut end = 0;
            std::array::from_fn(|kind| {
                end += counts[kind];
                end
            })
        }
    };
}

lights!(identities);

/// Number of kinds of which a scene has a list.
pub(super) const LISTS: usize = SourceKind::Environment as usize;

impl SourceKind {
    /// Returns the number in the last column of a light's rows. Lanes without a light have 0.
    #[inline(always)]
    pub const fn number(self) -> f32 {
        (self as u8 + 1) as f32
    }

    /// Returns the index of the first light of the kind.
    #[inline(always)]
    fn first_index(self, first: [u32; LISTS]) -> u32 {
        match self as usize {
            0 => 0,
            kind => first[kind - 1],
        }
    }
}

impl LightId {
    /// Returns the index of the light: the inverse of [`LightId::new`].
    #[inline]
    pub(super) fn index(self, first: [u32; LISTS]) -> u32 {
        let (kind, own) = self.parts();
        kind.first_index(first) + own
    }

    /// Returns the index of an emissive primitive; `None` for a light without a surface.
    #[inline]
    pub fn emitter(self) -> Option<u32> {
        match self {
            LightId::Emitter(i) => Some(i),
            _ => None,
        }
    }
}

/// Rows of one light. The second row ends with radiance (intensity of a point light, irradiance of a
/// directional light), flags, the extent of the light's points
/// ([`EdgeEnd::extent`](crate::transport::vertex::EdgeEnd::extent)), and the number of the kind; the
/// last two are completed by [`LightId::facts`].
///
/// | kind | first row | start of the second row | flags |
/// |---|---|---|---|
/// | triangle | three corners, without the last z | that z, area | 1 if textured |
/// | sphere | centre, radius | 0, area | 2, plus 1 if textured |
/// | point | position, axis of the cone, `beam_height`, `cutoff_height` | `beam`, `cutoff` | `smooth`, or 2 with a map |
/// | directional | direction | | |
/// | environment | | | |
///
/// Textured lights have an emission texture or a mask.
pub(super) type LightRows = [F32x8; 2];

/// Rows of lanes without a light.
pub(super) const NO_LIGHT: LightRows = [F32x8([0.0; 8]); 2];

/// Returns the rows of a light: the first row and the columns of the second, without the kind.
pub(super) fn light_rows(
    first: [f32; 8],
    [x, y]: [f32; 2],
    radiance: Vec3,
    [flags, extent]: [f32; 2],
) -> LightRows {
    let [r, g, b] = radiance.to_array();
    [first, [x, y, r, g, b, flags, extent, 0.0]].map(F32x8)
}
