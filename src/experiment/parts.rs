//! References in parts: ranges of samples that workers render apart and that are joined in their order.
//!
//! A part is a run of both halves that begins at a later sample, so parts hold the very samples that the whole would. Its
//! two films are added part after part ([`Film::pooled`]), each part's from nothing. Sums of floats depend on the order in
//! which they are made; so how many samples a part has belongs to the identity of the reference, and whoever renders the
//! parts, one process or many, arrives at the same bits, if the backend does for each of them.

use std::io::{self, Write};

use super::event::{CellRef, WaveRow};
use super::standing::{Checkpoint, Standing};
use crate::film::Film;
use crate::film::state::{Misfit, Saved, write_words};
use crate::render::{OpenStats, WaveStats};

/// One part of a reference. The first sample is even, so that it is the same number of samples for both halves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Part {
    /// Index into [`Plan::references`](super::Plan::references).
    pub reference: usize,
    /// Index of its first sample per pixel, counted over both halves.
    pub first: u64,
    /// Index of the first sample behind it, at least two more.
    pub end: u64,
    /// Its number among all parts of the reference, from 1.
    pub number: usize,
    /// Their number.
    pub of: usize,
}

impl Part {
    /// Its place among the parts, for people.
    pub fn words(&self) -> String {
        format!("part {} of {}", self.number, self.of)
    }
}

/// What one process at a time works on: it is claimed, and has checkpoints of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece {
    /// A cell, or a reference as a whole.
    Run(CellRef),
    /// A part of a reference.
    Part(Part),
}

impl Piece {
    /// The cell or reference that it is of.
    pub fn cell(self) -> CellRef {
        match self {
            Piece::Run(cell) => cell,
            Piece::Part(part) => CellRef::Reference(part.reference),
        }
    }
}

impl From<CellRef> for Piece {
    fn from(cell: CellRef) -> Piece {
        Piece::Run(cell)
    }
}

/// Samples per pixel of every part but the last, so that `total` of them make at most `parts` parts; `None` where that is
/// one part.
pub fn size(total: u64, parts: u32) -> Option<u64> {
    let size = total.div_ceil(2 * u64::from(parts.max(1))).max(1) * 2;
    (split(0, size, total).len() > 1).then_some(size)
}

/// The parts of so many samples per pixel that a reference of `total` has. A last one of a single sample, which would know
/// no second half, belongs to the one before.
pub fn split(reference: usize, size: u64, total: u64) -> Vec<Part> {
    let of = usize::try_from((total / size + u64::from(total % size > 1)).max(1)).unwrap_or(usize::MAX);
    let one = |i: usize| {
        let first = i as u64 * size;
        let end = if i + 1 == of { total } else { first + size };
        Part { reference, first, end, number: i + 1, of }
    };
    (0..of).map(one).collect()
}

/// The sums of the first parts of a reference, or of one alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Sums {
    /// The films of both halves.
    pub halves: [Film; 2],
    /// What opening cost all who rendered, and on what they did, each once.
    pub open: OpenStats,
}

impl Sums {
    /// Adds what follows.
    pub fn append(&mut self, next: &Sums) {
        for (half, more) in self.halves.iter_mut().zip(&next.halves) {
            *half = Film::pooled(half, more);
        }
        let (all, more) = (&mut self.open, &next.open);
        all.upload_s += more.upload_s;
        all.pipeline_s += more.pipeline_s;
        all.accel_build_s += more.accel_build_s;
        for device in more.device.split("; ") {
            if !all.device.split("; ").any(|known| known == device) {
                all.device = format!("{}; {device}", all.device);
            }
        }
    }

    /// Samples per pixel of both halves.
    pub fn samples(&self) -> u64 {
        self.halves.iter().map(|half| half.samples).sum()
    }

    /// Writes them.
    ///
    /// # Errors
    /// As `to`.
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        let OpenStats { upload_s, pipeline_s, accel_build_s, accel_nodes, accel_bytes, accel_cost, device } =
            &self.open;
        let seconds = [upload_s, pipeline_s, accel_build_s, accel_cost].map(|x| x.to_bits());
        write_words(to, [u64::from(self.halves[0].width), u64::from(self.halves[0].height)])?;
        write_words(to, seconds.into_iter().chain([*accel_nodes, *accel_bytes, device.len() as u64]))?;
        to.write_all(device.as_bytes())?;
        self.halves.iter().try_for_each(|half| half.save(to))
    }

    /// Reads what [`Sums::save`] wrote.
    ///
    /// # Errors
    /// When it is nothing of the kind.
    pub fn read(state: &[u8]) -> Result<Sums, Misfit> {
        let mut from = Saved::new(state);
        let mut side = || from.word().and_then(|side| u32::try_from(side).map_err(|_| Misfit));
        let [width, height] = [side()?, side()?];
        let pixels = u64::from(width) * u64::from(height);
        if pixels.saturating_mul(96) > state.len() as u64 {
            return Err(Misfit);
        }
        let mut number = || from.word().map(f64::from_bits);
        let [upload_s, pipeline_s, accel_build_s, accel_cost] = [number()?, number()?, number()?, number()?];
        let [accel_nodes, accel_bytes, length] = [from.word()?, from.word()?, from.word()?];
        let device = String::from_utf8(from.bytes(length)?.to_vec()).map_err(|_| Misfit)?;
        let mut halves = [0, 1].map(|_| Film::new(width, height));
        halves.iter_mut().try_for_each(|half| half.restore(&mut from))?;
        from.end()?;
        let open = OpenStats { upload_s, pipeline_s, accel_build_s, accel_nodes, accel_bytes, accel_cost, device };
        Ok(Sums { halves, open })
    }
}

/// The first parts of a reference, joined.
#[derive(Clone, Debug)]
pub struct Joined {
    /// Their sums.
    pub sums: Sums,
    /// A row after each of them, with the clocks of all up to it added up.
    pub rows: Vec<WaveRow>,
}

impl Joined {
    /// The first part alone, or several that were joined before.
    ///
    /// # Errors
    /// When they are nothing of the kind.
    pub fn begin(kept: &Checkpoint) -> Result<Joined, Misfit> {
        let sums = Sums::read(&kept.state)?;
        if sums.samples() != kept.standing.samples() {
            return Err(Misfit);
        }
        Ok(Joined { sums, rows: kept.standing.rows.clone() })
    }

    /// Adds the next part.
    ///
    /// # Errors
    /// When it is none, or one of a picture of another size.
    pub fn append(&mut self, part: &Checkpoint) -> Result<(), Misfit> {
        let next = Joined::begin(part)?;
        let size = |sums: &Sums| [sums.halves[0].width, sums.halves[0].height];
        if size(&next.sums) != size(&self.sums) {
            return Err(Misfit);
        }
        self.sums.append(&next.sums);
        let [before, after] = [&self.rows, &part.standing.rows].map(|rows| rows.last().cloned().unwrap_or_default());
        let part = WaveStats {
            samples: after.samples,
            render_s: after.render_s,
            paths: after.paths,
            rays: after.rays,
            invalid: after.invalid,
            first_invalid: after.first_invalid,
            ..WaveStats::default()
        };
        let (wall_s, measure_s) = (before.wall_s + after.wall_s, before.measure_s + after.measure_s);
        let joint = Standing { rows: vec![before], part, ..Standing::default() }.close_wave();
        self.rows.push(WaveRow { wall_s, measure_s, ..joint });
        Ok(())
    }

    /// What is kept of them.
    ///
    /// # Errors
    /// Never, as it is written into memory.
    pub fn keep(&self) -> io::Result<Checkpoint> {
        let mut state = Vec::new();
        self.sums.save(&mut state)?;
        let wall_s = self.rows.last().map_or(0.0, |row| row.wall_s);
        Ok(Checkpoint { standing: Standing { rows: self.rows.clone(), wall_s, ..Standing::default() }, state })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_even_ranges_of_one_size_and_none_knows_one_half_only() {
        let ends = |parts: u32, total: u64| -> Vec<u64> {
            let size = size(total, parts).unwrap_or(total.max(1));
            let all = split(3, size, total);
            let firsts: Vec<u64> = all.iter().map(|part| part.first).collect();
            assert!(firsts.iter().all(|first| first % 2 == 0) && firsts[0] == 0);
            assert!(all.windows(2).all(|two| two[0].end == two[1].first), "they follow one another");
            assert!(all.iter().enumerate().all(|(i, part)| (part.number, part.of) == (i + 1, all.len())));
            assert!(all.len() == 1 || all.iter().all(|part| part.end - part.first >= 2));
            all.iter().map(|part| part.end).collect()
        };
        assert_eq!(ends(4, 4096), [1024, 2048, 3072, 4096]);
        assert_eq!(ends(3, 100), [34, 68, 100]);
        assert_eq!(ends(4, 9), [4, 9], "never more parts than asked for, and no single sample at the end");
        assert_eq!(ends(8, 5), [2, 5]);
        assert_eq!((ends(1, 64), ends(9, 1), ends(2, 3)), (vec![64], vec![1], vec![3]));
        assert_eq!((size(64, 1), size(3, 2), size(4096, 4)), (None, None, Some(1024)));
        assert_eq!(size(8192, 8), size(4096, 4), "twice the samples in twice the parts continue the same parts");
    }

    fn kept(samples: [u64; 2], value: f64, device: &str) -> Checkpoint {
        let halves = samples.map(|n| {
            let mut film = Film::new(2, 1);
            film.samples = n;
            film.sum.fill([value * n as f64; 3]);
            film.sum2.fill([value * value * n as f64; 3]);
            film
        });
        let open = OpenStats { accel_build_s: 0.5, accel_nodes: 7, device: device.to_owned(), ..OpenStats::default() };
        let mut state = Vec::new();
        Sums { halves, open }.save(&mut state).unwrap();
        let row =
            |wave, samples| WaveRow { wave, samples, render_s: samples as f64, wall_s: 9.0, ..WaveRow::default() };
        let rows = vec![row(1, samples[0] + samples[1])];
        Checkpoint { standing: Standing { rows, ..Standing::default() }, state }
    }

    #[test]
    fn what_is_joined_has_all_samples_clocks_and_devices() {
        let mut joined = Joined::begin(&kept([2, 2], 1.0, "one")).unwrap();
        joined.append(&kept([3, 2], 2.0, "two")).unwrap();
        joined.append(&kept([1, 1], 4.0, "one")).unwrap();
        let Joined { sums, rows } = &joined;
        assert_eq!(sums.halves.each_ref().map(|half| (half.samples, half.sum[1][0])), [(6, 12.0), (5, 10.0)]);
        assert_eq!((sums.open.device.as_str(), sums.open.accel_build_s, sums.open.accel_nodes), ("one; two", 1.5, 7));
        let clocks: Vec<(u64, u64, f64, f64)> =
            rows.iter().map(|r| (r.wave, r.samples, r.render_s, r.wall_s)).collect();
        assert_eq!(clocks, [(1, 4, 4.0, 9.0), (2, 9, 9.0, 18.0), (3, 11, 11.0, 27.0)]);
        // What was joined and kept goes on like what was just joined.
        let again = Joined::begin(&joined.keep().unwrap()).unwrap();
        assert_eq!((again.sums, again.rows), (sums.clone(), rows.clone()));
    }

    #[test]
    fn what_is_no_part_is_not_joined() {
        let whole = kept([2, 2], 1.0, "one");
        for cut in [0, 8, 80, whole.state.len() - 1] {
            let cut = Checkpoint { state: whole.state[..cut].to_vec(), ..whole.clone() };
            assert!(Joined::begin(&cut).is_err());
        }
        let huge = [u64::from(u32::MAX).to_ne_bytes(), u64::from(u32::MAX).to_ne_bytes()].concat();
        assert_eq!(Sums::read(&huge), Err(Misfit), "before memory is asked for");
        let other = Checkpoint { state: kept([2, 3], 1.0, "one").state, ..whole.clone() };
        assert!(Joined::begin(&whole).unwrap().append(&other).is_err(), "its rows tell of other samples");
    }
}
