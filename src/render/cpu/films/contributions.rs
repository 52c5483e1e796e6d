//! Contributions of vectorised samples to films with a time axis, collected and sorted by sample.

use glam::Vec3;

use crate::film::time::TimeFilter;
use crate::transport::path_time::Timing;

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
    /// Calls `emit` with the contribution of `value` to each slot that the filter spreads it to.
    /// `position` is its [position](crate::film::time::TimeAxis::bin_position) on the time axis.
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
            _ => TimedContribution::filtered(timing, path, value, position, &mut emit),
        }
    }

    /// Spreads a contribution with a filter; kept out of line because filters are rare.
    #[inline(never)]
    fn filtered(
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

/// Contributions of a batch of paths to their own pixels, in slots of the time axis.
#[derive(Default)]
pub struct TimedContributions {
    /// Contributions in the order in which they were found.
    found: Vec<TimedContribution>,
    /// Contributions by path, those of each path in the order in which they were found.
    sorted: Vec<TimedContribution>,
    /// Scratch space of the sort: the next index for each path.
    ends: Vec<u32>,
}

impl TimedContributions {
    /// Removes all contributions.
    pub fn clear(&mut self) {
        self.found.clear();
    }

    /// Adds a contribution of a path at a position on the time axis.
    #[inline(always)]
    pub fn push(&mut self, timing: &Timing, path: u32, value: Vec3, position: f64) {
        TimedContribution::for_each_slot(timing, path, value, position, |part| {
            self.found.push(part)
        });
    }

    /// Sorts the contributions by path; path indices are below `paths`.
    pub fn sort(&mut self, paths: usize) {
        self.ends.clear();
        self.ends.resize(paths, 0);
        for found in &self.found {
            self.ends[found.path as usize] += 1;
        }
        let mut sum = 0;
        for end in &mut self.ends {
            sum += std::mem::replace(end, sum);
        }
        self.sorted
            .resize(self.found.len(), TimedContribution::default());
        for found in &self.found {
            let end = &mut self.ends[found.path as usize];
            self.sorted[*end as usize] = *found;
            *end += 1;
        }
    }

    /// Returns all contributions after [`sort`](Self::sort).
    pub fn sorted(&self) -> &[TimedContribution] {
        &self.sorted
    }

    /// Removes the contributions of a path.
    pub fn discard(&mut self, path: u32) {
        self.sorted.retain(|part| part.path != path);
    }
}

#[cfg(test)]
mod tests {
    use crate::film::time::TimeAxis;
    use crate::render::cpu::films::contributions::*;

    const AXIS: TimeAxis = TimeAxis {
        start: 1.0,
        bin: 0.5,
        bins: 4,
    };

    #[test]
    fn contributions_are_sorted_by_path_and_stay_in_order() {
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
    fn batched_and_single_contributions_are_filtered_alike() {
        let timing = Timing {
            filter: TimeFilter::Gauss(0.7),
            ..Timing::plain(AXIS)
        };
        let mut timed = TimedContributions::default();
        let mut one = Vec::new();
        for length in [0.3, 1.0, 1.9, 2.99, 4.0] {
            let (value, position) = (Vec3::new(0.1, 7.0, 1e-3), AXIS.bin_position(length));
            timed.push(&timing, 1, value, position);
            TimedContribution::for_each_slot(&timing, 1, value, position, |part| one.push(part));
        }
        timed.sort(2);
        assert_eq!(timed.sorted(), one);
        assert!(
            one.len() > 10 && one.iter().any(|p| p.slot == 0) && one.iter().any(|p| p.slot == 5)
        );
    }
}
