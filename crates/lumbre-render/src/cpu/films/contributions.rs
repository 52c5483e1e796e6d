//! Contributions of samples to the slots of films with a time axis: one slot for each bin, one for
//! light before the first bin, and one for light after the last.
//!
//! [`TimedContributions`] collects those of a batch of vectorised paths and sorts them by path. The
//! sort is stable, so that contributions of a path are added in the order of the scalar path.

use glam::Vec3;

use lumbre_light::film::time::TimeFilter;
use lumbre_light::transport::time_settings::Timing;

/// Identifies a sample of a row: its column and its sample index.
pub type SampleId = (u32, u64);

/// Contribution of a sample to one slot of a film with a time axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TimedContribution {
    /// Radiance to add.
    pub value: [f32; 3],
    /// Index of the slot.
    pub slot: u32,
    /// Index of the sample in its batch; 0 on the scalar path.
    pub path: u32,
}

impl TimedContribution {
    /// Calls `emit` with the contribution of `value` to each slot over which the filter spreads it.
    /// `position` is its [position](lumbre_light::film::time::TimeAxis::bin_position) on the time axis.
    #[inline(always)]
    pub fn for_each_slot(
        timing: &Timing,
        path: u32,
        value: Vec3,
        position: f64,
        mut emit: impl FnMut(TimedContribution),
    ) {
        let Timing { axis, filter, .. } = timing;
        match filter {
            TimeFilter::None => emit(TimedContribution {
                value: value.to_array(),
                slot: axis.slot(position) as u32,
                path,
            }),
            _ => TimedContribution::emit_filtered(timing, path, value, position, &mut emit),
        }
    }

    /// Spreads a contribution over slots with a filter. Out of line, since filters are rare.
    #[inline(never)]
    fn emit_filtered(
        timing: &Timing,
        path: u32,
        value: Vec3,
        position: f64,
        emit: &mut dyn FnMut(TimedContribution),
    ) {
        timing.filter.spread(&timing.axis, position, |slot, share| {
            let value = if share == 1.0 {
                value
            } else {
                value * share as f32
            };
            emit(TimedContribution {
                value: value.to_array(),
                slot: slot as u32,
                path,
            });
        });
    }
}

/// Order of items by their path; items of a path keep their order. Its buffers are reused.
#[derive(Default)]
pub struct PathOrder {
    /// Place in `order` of the next item of each path.
    next: Vec<u32>,
    order: Vec<u32>,
}

impl PathOrder {
    /// Returns the indices of items by path, given the path of each, which is below `paths`.
    pub fn sort(&mut self, paths: usize, of: impl ExactSizeIterator<Item = u32> + Clone) -> &[u32] {
        self.next.clear();
        self.next.resize(paths, 0);
        self.order.resize(of.len(), 0);
        of.clone().for_each(|path| self.next[path as usize] += 1);
        let mut sum = 0;
        for next in &mut self.next {
            sum += std::mem::replace(next, sum);
        }
        for (i, path) in of.enumerate() {
            let next = &mut self.next[path as usize];
            self.order[*next as usize] = i as u32;
            *next += 1;
        }
        &self.order
    }
}

/// Contributions of a batch of paths to their own pixels, in slots of the time axis.
#[derive(Default)]
pub struct TimedContributions {
    /// Contributions in the order in which they were added.
    unsorted: Vec<TimedContribution>,
    /// The same contributions sorted by path; those of a path keep their order.
    sorted: Vec<TimedContribution>,
    order: PathOrder,
}

impl TimedContributions {
    /// Removes all contributions.
    pub fn clear(&mut self) {
        self.unsorted.clear();
    }

    /// Adds a contribution of a path at a position on the time axis.
    #[inline(always)]
    pub fn push(&mut self, timing: &Timing, path: u32, value: Vec3, position: f64) {
        TimedContribution::for_each_slot(timing, path, value, position, |contribution| {
            self.unsorted.push(contribution)
        });
    }

    /// Sorts the contributions by path; path indices are below `paths`.
    pub fn sort(&mut self, paths: usize) {
        let order = self.order.sort(paths, self.unsorted.iter().map(|c| c.path));
        self.sorted.clear();
        let sorted = order.iter().map(|i| self.unsorted[*i as usize]);
        self.sorted.extend(sorted);
    }

    /// Returns the contributions sorted by path. [`sort`](Self::sort) must have been called after
    /// the last [`push`](Self::push).
    pub fn sorted(&self) -> &[TimedContribution] {
        &self.sorted
    }

    /// Removes the contributions of a path from the sorted ones.
    pub fn discard(&mut self, path: u32) {
        self.sorted.retain(|contribution| contribution.path != path);
    }
}

#[cfg(test)]
mod tests {
    use crate::cpu::films::contributions::*;
    use lumbre_light::film::time::TimeAxis;

    const AXIS: TimeAxis = TimeAxis {
        start: 1.0,
        bin: 0.5,
        bins: 4,
    };

    #[test]
    fn contributions_are_sorted_by_path_and_keep_their_order() {
        let mut timed = TimedContributions::default();
        for round in 0..2 {
            timed.clear();
            for (path, value, length) in [
                (2, 1.0, 1.2),
                (0, 2.0, 0.0),
                (2, 3.0, 2.9),
                (2, 4.0, 1.2),
                (3, 5.0, 9.0),
            ] {
                timed.push(
                    &Timing::plain(AXIS),
                    path,
                    Vec3::splat(value),
                    AXIS.bin_position(length),
                );
            }
            timed.sort(5);
            let all = |timed: &TimedContributions| {
                timed
                    .sorted()
                    .iter()
                    .map(|p| (p.path, p.value[1], p.slot))
                    .collect::<Vec<_>>()
            };
            assert_eq!(
                all(&timed),
                [
                    (0, 2.0, 0),
                    (2, 1.0, 1),
                    (2, 3.0, 4),
                    (2, 4.0, 1),
                    (3, 5.0, 5)
                ],
                "{round}"
            );
            timed.discard(2);
            assert_eq!(all(&timed), [(0, 2.0, 0), (3, 5.0, 5)]);
        }
    }

    #[test]
    fn batched_and_scalar_contributions_are_filtered_identically() {
        let timing = Timing {
            filter: TimeFilter::Gauss(0.7),
            ..Timing::plain(AXIS)
        };
        let mut timed = TimedContributions::default();
        let mut scalar = Vec::new();
        for length in [0.3, 1.0, 1.9, 2.99, 4.0] {
            let (value, position) = (Vec3::new(0.1, 7.0, 1e-3), AXIS.bin_position(length));
            timed.push(&timing, 1, value, position);
            TimedContribution::for_each_slot(&timing, 1, value, position, |contribution| {
                scalar.push(contribution)
            });
        }
        timed.sort(2);
        assert_eq!(timed.sorted(), scalar);
        assert!(
            scalar.len() > 10
                && scalar.iter().any(|p| p.slot == 0)
                && scalar.iter().any(|p| p.slot == 5)
        );
    }
}
