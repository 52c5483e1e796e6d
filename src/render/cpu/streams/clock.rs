//! The clocks of paths in lanes, where a film has a time axis: what [`Flight`](crate::transport::flight::Flight) counts for a
//! path by itself.
//!
//! Where a path went on is in its record, and whether an edge counts depends on its number alone, so that a clock is three
//! numbers. Scenes with delays go alone: no stamp of lanes has any.

use super::Record;
use crate::math::lanes::{Lanes, Row, each};
use crate::transport::flight::{Chance, Stamp};
use crate::transport::integrator::Context;
use crate::transport::sampler::Sampler;

/// The clock of a path between two of its steps, in a row: the optical length of its segments, when its light was emitted,
/// and the index of the medium.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock(pub(super) Row);

impl Clock {
    /// From a stamp.
    #[inline]
    pub fn new(stamp: &Stamp) -> Clock {
        Clock(Row([stamp.path, stamp.late, stamp.index, 0.0, 0.0, 0.0, 0.0, 0.0]))
    }

    /// The stamp.
    #[inline]
    pub fn stamp(&self) -> Stamp {
        let [path, late, index, ..] = self.0.0;
        Stamp { path, late, delay: 0.0, index }
    }

    /// That of a path from the camera, whose light was emitted at `emitted`.
    pub fn of_camera(context: &Context, emitted: f32) -> Clock {
        let index = context.timing.map_or(1.0, |t| t.medium);
        Clock::new(&Stamp { path: 0.0, late: emitted, delay: 0.0, index })
    }
}

/// When the light of a sample was emitted.
pub(super) fn emitted(context: &Context, record: &Record) -> f32 {
    Chance::new::<true>(&Sampler::Independent(record.numbers())).emission(context)
}

/// Whether edge number `edge` of a path from the camera counts.
#[inline]
pub(super) fn counts(context: &Context, edge: u32) -> bool {
    edge > 1 || context.timing.is_some_and(|t| t.camera)
}

/// The clocks of all lanes; where nothing is `TIMED`, nothing.
#[inline(always)]
pub(super) fn stamps<R: Lanes<N>, const N: usize, const TIMED: bool>(clocks: &[Clock], lanes: [usize; N]) -> Stamp<R> {
    let zero = R::of(0.0);
    if !TIMED {
        return Stamp { path: zero, late: zero, delay: zero, index: zero };
    }
    let [path, late, index, ..] = R::transposed(each(lanes, |i| &clocks[i].0));
    Stamp { path, late, delay: zero, index }
}

/// The clock of each lane.
#[inline(always)]
pub(super) fn clocks<R: Lanes<N>, const N: usize>(stamp: &Stamp<R>) -> [Row; N] {
    let zero = R::of(0.0);
    R::stored([stamp.path, stamp.late, stamp.index, zero, zero, zero, zero, zero])
}
