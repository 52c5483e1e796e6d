//! What samples bring.

use glam::Vec3;

use crate::film::time::TimeFilter;
use crate::transport::flight::Timing;

/// The column and the index of a sample.
pub type Named = (u32, u64);

/// What a sample brings to a slot of a film with a time axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Part {
    /// The light.
    pub value: [f32; 3],
    /// The slot.
    pub slot: u32,
    /// Which of the samples that go together; 0 of one that goes alone.
    pub path: u32,
}

impl Part {
    /// Hands over what becomes of light that comes to a [place](crate::film::time::TimeAxis::place) of the time axis, slot by
    /// slot.
    #[inline(always)]
    pub fn each(timing: &Timing, path: u32, value: Vec3, place: f64, mut give: impl FnMut(Part)) {
        let Timing { axis, filter, .. } = timing;
        match filter {
            TimeFilter::None => give(Part { value: value.to_array(), slot: axis.slot(place) as u32, path }),
            _ => Part::shares(timing, path, value, place, &mut give),
        }
    }

    /// The same where a filter spreads it.
    #[inline(never)]
    fn shares(timing: &Timing, path: u32, value: Vec3, place: f64, give: &mut dyn FnMut(Part)) {
        timing.filter.spread(&timing.axis, place, |slot, share| {
            let value = if share == 1.0 { value } else { value * share as f32 };
            give(Part { value: value.to_array(), slot: slot as u32, path });
        });
    }
}

/// What paths that go together have found for their own pixels, in slots of the time axis.
#[derive(Default)]
pub struct Parts {
    /// In the order in which it was found.
    found: Vec<Part>,
    /// Path by path, those of each in the order in which they were found.
    sorted: Vec<Part>,
    /// While they are sorted, where the next of each path goes.
    ends: Vec<u32>,
}

impl Parts {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.found.clear();
    }

    /// Takes what a path has found, and its place on the time axis.
    #[inline(always)]
    pub fn push(&mut self, timing: &Timing, path: u32, value: Vec3, place: f64) {
        Part::each(timing, path, value, place, |part| self.found.push(part));
    }

    /// Sorts all by so many paths.
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
        self.sorted.resize(self.found.len(), Part::default());
        for found in &self.found {
            let end = &mut self.ends[found.path as usize];
            self.sorted[*end as usize] = *found;
            *end += 1;
        }
    }

    /// All of them, once they are sorted.
    pub fn sorted(&self) -> &[Part] {
        &self.sorted
    }

    /// Forgets those of a path.
    pub fn refuse(&mut self, path: u32) {
        self.sorted.retain(|part| part.path != path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::time::TimeAxis;

    const AXIS: TimeAxis = TimeAxis { start: 1.0, bin: 0.5, bins: 4 };

    #[test]
    fn parts_are_sorted_by_paths_and_keep_their_order() {
        let mut parts = Parts::default();
        for again in 0..2 {
            parts.clear();
            for (path, value, length) in [(2, 1.0, 1.2), (0, 2.0, 0.0), (2, 3.0, 2.9), (2, 4.0, 1.2), (3, 5.0, 9.0)] {
                parts.push(&Timing::plain(AXIS), path, Vec3::splat(value), AXIS.place(length));
            }
            parts.sort(5);
            let all = |parts: &Parts| parts.sorted().iter().map(|p| (p.path, p.value[1], p.slot)).collect::<Vec<_>>();
            assert_eq!(all(&parts), [(0, 2.0, 0), (2, 1.0, 1), (2, 3.0, 4), (2, 4.0, 1), (3, 5.0, 5)], "{again}");
            parts.refuse(2);
            assert_eq!(all(&parts), [(0, 2.0, 0), (3, 5.0, 5)]);
        }
    }

    #[test]
    fn a_filter_gives_what_it_gives_to_light_of_one_path() {
        let timing = Timing { filter: TimeFilter::Gauss(0.7), ..Timing::plain(AXIS) };
        let mut parts = Parts::default();
        let mut one = Vec::new();
        for length in [0.3, 1.0, 1.9, 2.99, 4.0] {
            let (value, place) = (Vec3::new(0.1, 7.0, 1e-3), AXIS.place(length));
            parts.push(&timing, 1, value, place);
            Part::each(&timing, 1, value, place, |part| one.push(part));
        }
        parts.sort(2);
        assert_eq!(parts.sorted(), one);
        assert!(one.len() > 10 && one.iter().any(|p| p.slot == 0) && one.iter().any(|p| p.slot == 5));
    }
}
