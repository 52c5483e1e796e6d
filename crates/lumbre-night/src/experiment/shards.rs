//! Shards: ranges of a reference's samples that are rendered separately and joined in order.
//!
//! A shard is a run of both reference halves that starts at a later sample, so the shards contain
//! exactly the samples of the whole reference. The two films of each shard start from zero and are
//! added in the order of the shards ([`Film::pooled`]). Floating-point sums depend on the order of
//! addition, so the shard size is part of the reference's identity: one process or many that render
//! the shards obtain the same bits, provided that the backend does for each shard.

use std::io::{self, Write};

use super::outcome::{CellRef, WaveRow};
use super::run_progress::{Checkpoint, RunProgress};
use lumbre_light::film::Film;
use lumbre_light::film::state::{CheckpointMismatch, StateReader, write_u64s};
use lumbre_render::device::add_devices;
use lumbre_render::{Device, OpenStats, WaveStats};

/// A shard of a reference. Its first sample is even, so that both halves start at the same sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shard {
    /// Index into [`Plan::references`](super::Plan::references).
    pub reference: usize,
    /// Index of the first sample per pixel, counted over both halves.
    pub first: u64,
    /// Index one past the last sample, at least `first + 2`.
    pub end: u64,
    /// Number of the shard within the reference, from 1.
    pub number: usize,
    /// Number of shards of the reference.
    pub count: usize,
}

impl Shard {
    /// Position among the shards, for people: `shard 2 of 8`.
    pub fn label(&self) -> String {
        format!("shard {} of {}", self.number, self.count)
    }
}

/// A unit of work for one process at a time. It is claimed as a whole and has its own checkpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WorkUnit {
    /// A cell, or a reference as a whole.
    Run(CellRef),
    /// A shard of a reference.
    Shard(Shard),
}

impl WorkUnit {
    /// The cell or reference that the unit belongs to.
    pub fn cell(self) -> CellRef {
        match self {
            WorkUnit::Run(cell) => cell,
            WorkUnit::Shard(shard) => CellRef::Reference(shard.reference),
        }
    }
}

impl From<CellRef> for WorkUnit {
    fn from(cell: CellRef) -> WorkUnit {
        WorkUnit::Run(cell)
    }
}

/// Samples per pixel of every shard but the last, such that `total` samples make at most
/// `max_shards` shards. `None` if they make only one.
pub fn shard_size(total: u64, max_shards: u32) -> Option<u64> {
    let size = total.div_ceil(2 * u64::from(max_shards.max(1))).max(1) * 2;
    (split(0, size, total).len() > 1).then_some(size)
}

/// The shards of `size` samples per pixel of a reference with `total` samples. A remainder of one
/// sample, which would have no second half, is added to the last full shard.
pub fn split(reference: usize, size: u64, total: u64) -> Vec<Shard> {
    let count =
        usize::try_from((total / size + u64::from(total % size > 1)).max(1)).unwrap_or(usize::MAX);
    let shard = |i: usize| {
        let first = i as u64 * size;
        let end = if i + 1 == count { total } else { first + size };
        Shard {
            reference,
            first,
            end,
            number: i + 1,
            count,
        }
    };
    (0..count).map(shard).collect()
}

/// Films of one shard of a reference, or of several consecutive ones.
#[derive(Clone, Debug, PartialEq)]
pub struct ShardSums {
    /// The films of both halves.
    pub halves: [Film; 2],
    /// Total cost of opening the renderers, and every device that was used, without repetition.
    pub open: OpenStats,
}

impl ShardSums {
    /// Adds the shards that follow.
    pub fn append(&mut self, next: &ShardSums) {
        for (half, more) in self.halves.iter_mut().zip(&next.halves) {
            *half = Film::pooled(half, more);
        }
        let (total, more) = (&mut self.open, &next.open);
        total.upload_s += more.upload_s;
        total.pipeline_s += more.pipeline_s;
        total.accel_build_s += more.accel_build_s;
        add_devices(&mut total.devices, &more.devices);
    }

    /// Samples per pixel of both halves.
    pub fn samples(&self) -> u64 {
        self.halves.iter().map(|half| half.samples).sum()
    }

    /// Writes the sums.
    ///
    /// # Errors
    /// When `to` cannot be written.
    pub fn save(&self, to: &mut dyn Write) -> io::Result<()> {
        let OpenStats {
            upload_s,
            pipeline_s,
            accel_build_s,
            accel_nodes,
            accel_bytes,
            accel_cost,
            // Shards do not store the memory of their scene, which is that of every other run.
            scene: _,
            devices,
            // The clocks of references are not compared.
            watches_processor: _,
        } = &self.open;
        let devices = serde_json::to_vec(devices)?;
        let seconds = [upload_s, pipeline_s, accel_build_s, accel_cost].map(|x| x.to_bits());
        write_u64s(
            to,
            [
                u64::from(self.halves[0].width),
                u64::from(self.halves[0].height),
            ],
        )?;
        write_u64s(
            to,
            seconds
                .into_iter()
                .chain([*accel_nodes, *accel_bytes, devices.len() as u64]),
        )?;
        to.write_all(&devices)?;
        self.halves.iter().try_for_each(|half| half.save(to))
    }

    /// Reads what [`ShardSums::save`] wrote.
    ///
    /// # Errors
    /// When `state` is truncated, too long or otherwise not such sums.
    pub fn read(state: &[u8]) -> Result<ShardSums, CheckpointMismatch> {
        let mut from = StateReader::new(state);
        let mut side = || {
            from.read_u64()
                .and_then(|side| u32::try_from(side).map_err(|_| CheckpointMismatch))
        };
        let [width, height] = [side()?, side()?];
        let pixels = u64::from(width) * u64::from(height);
        if pixels.saturating_mul(96) > state.len() as u64 {
            return Err(CheckpointMismatch);
        }
        let mut number = || from.read_u64().map(f64::from_bits);
        let [upload_s, pipeline_s, accel_build_s, accel_cost] =
            [number()?, number()?, number()?, number()?];
        let [accel_nodes, accel_bytes, length] =
            [from.read_u64()?, from.read_u64()?, from.read_u64()?];
        let devices = read_devices(from.read_bytes(length)?)?;
        let mut halves = [0, 1].map(|_| Film::new(width, height));
        halves
            .iter_mut()
            .try_for_each(|half| half.restore(&mut from))?;
        from.finish()?;
        let open = OpenStats {
            upload_s,
            pipeline_s,
            accel_build_s,
            accel_nodes,
            accel_bytes,
            accel_cost,
            devices,
            ..OpenStats::default()
        };
        Ok(ShardSums { halves, open })
    }
}

/// Parses the devices of a shard: a JSON list, or the line for people that earlier versions stored.
fn read_devices(bytes: &[u8]) -> Result<Vec<Device>, CheckpointMismatch> {
    if bytes.starts_with(b"[") {
        return serde_json::from_slice(bytes).map_err(|_| CheckpointMismatch);
    }
    let line = std::str::from_utf8(bytes).map_err(|_| CheckpointMismatch)?;
    Ok(vec![Device::from_line(line)])
}

/// The first shards of a reference, joined.
#[derive(Clone, Debug)]
pub struct JoinedShards {
    /// Sums of the joined shards.
    pub sums: ShardSums,
    /// One row after each shard, with totals over all shards up to it.
    pub rows: Vec<WaveRow>,
}

impl JoinedShards {
    /// Reads the first shard, or several that were joined before.
    ///
    /// # Errors
    /// When the checkpoint does not hold shards.
    pub fn from_checkpoint(checkpoint: &Checkpoint) -> Result<JoinedShards, CheckpointMismatch> {
        let sums = ShardSums::read(&checkpoint.state)?;
        if sums.samples() != checkpoint.progress.samples() {
            return Err(CheckpointMismatch);
        }
        Ok(JoinedShards {
            sums,
            rows: checkpoint.progress.rows.clone(),
        })
    }

    /// Adds the next shard.
    ///
    /// # Errors
    /// When the checkpoint does not hold a shard, or its picture has another size.
    pub fn append(&mut self, shard: &Checkpoint) -> Result<(), CheckpointMismatch> {
        let next = JoinedShards::from_checkpoint(shard)?;
        let size = |sums: &ShardSums| [sums.halves[0].width, sums.halves[0].height];
        if size(&next.sums) != size(&self.sums) {
            return Err(CheckpointMismatch);
        }
        self.sums.append(&next.sums);
        let [before, added] =
            [&self.rows, &shard.progress.rows].map(|rows| rows.last().cloned().unwrap_or_default());
        let current_wave = WaveStats {
            samples: added.samples,
            render_s: added.render_s,
            lost_s: added.lost_s,
            paths: added.paths,
            rays: added.rays,
            invalid: added.invalid,
            first_invalid: added.first_invalid,
            ..WaveStats::default()
        };
        let (wall_s, measure_s) = (
            before.wall_s + added.wall_s,
            before.measure_s + added.measure_s,
        );
        let row = RunProgress {
            rows: vec![before],
            current_wave,
            ..RunProgress::default()
        }
        .close_wave();
        self.rows.push(WaveRow {
            wall_s,
            measure_s,
            ..row
        });
        Ok(())
    }

    /// Saves the joined shards as a checkpoint.
    ///
    /// # Errors
    /// Never in practice, since it writes to memory.
    pub fn to_checkpoint(&self) -> io::Result<Checkpoint> {
        let mut state = Vec::new();
        self.sums.save(&mut state)?;
        let wall_s = self.rows.last().map_or(0.0, |row| row.wall_s);
        Ok(Checkpoint {
            progress: RunProgress {
                rows: self.rows.clone(),
                wall_s,
                ..RunProgress::default()
            },
            state,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::experiment::shards::*;

    #[test]
    fn shards_are_even_ranges_of_equal_size_with_two_halves_each() {
        let ends = |max_shards: u32, total: u64| -> Vec<u64> {
            let size = shard_size(total, max_shards).unwrap_or(total.max(1));
            let all = split(3, size, total);
            let firsts: Vec<u64> = all.iter().map(|shard| shard.first).collect();
            assert!(firsts.iter().all(|first| first % 2 == 0) && firsts[0] == 0);
            assert!(
                all.windows(2).all(|two| two[0].end == two[1].first),
                "shards are contiguous"
            );
            assert!(
                all.iter()
                    .enumerate()
                    .all(|(i, shard)| (shard.number, shard.count) == (i + 1, all.len()))
            );
            assert!(all.len() == 1 || all.iter().all(|shard| shard.end - shard.first >= 2));
            all.iter().map(|shard| shard.end).collect()
        };
        assert_eq!(ends(4, 4096), [1024, 2048, 3072, 4096]);
        assert_eq!(ends(3, 100), [34, 68, 100]);
        assert_eq!(
            ends(4, 9),
            [4, 9],
            "never more shards than requested, and no single sample at the end"
        );
        assert_eq!(ends(8, 5), [2, 5]);
        assert_eq!(
            (ends(1, 64), ends(9, 1), ends(2, 3)),
            (vec![64], vec![1], vec![3])
        );
        assert_eq!(
            (shard_size(64, 1), shard_size(3, 2), shard_size(4096, 4)),
            (None, None, Some(1024))
        );
        assert_eq!(
            shard_size(8192, 8),
            shard_size(4096, 4),
            "twice the samples in twice the shards continue the same shards"
        );
    }

    fn checkpoint(samples: [u64; 2], value: f64, device: &Device) -> Checkpoint {
        let halves = samples.map(|n| {
            let mut film = Film::new(2, 1);
            film.samples = n;
            film.sum.fill([value * n as f64; 3]);
            film.sum2.fill([value * value * n as f64; 3]);
            film
        });
        let open = OpenStats {
            accel_build_s: 0.5,
            accel_nodes: 7,
            devices: vec![device.clone()],
            ..OpenStats::default()
        };
        let mut state = Vec::new();
        ShardSums { halves, open }.save(&mut state).unwrap();
        let row = |wave, samples| WaveRow {
            wave,
            samples,
            render_s: samples as f64,
            wall_s: 9.0,
            ..WaveRow::default()
        };
        let rows = vec![row(1, samples[0] + samples[1])];
        Checkpoint {
            progress: RunProgress {
                rows,
                ..RunProgress::default()
            },
            state,
        }
    }

    #[test]
    fn joined_shards_have_all_samples_clocks_and_devices() {
        let [one, two] = [1, 2].map(Device::processor);
        let mut joined = JoinedShards::from_checkpoint(&checkpoint([2, 2], 1.0, &one)).unwrap();
        joined.append(&checkpoint([3, 2], 2.0, &two)).unwrap();
        joined.append(&checkpoint([1, 1], 4.0, &one)).unwrap();
        let JoinedShards { sums, rows } = &joined;
        assert_eq!(
            sums.halves
                .each_ref()
                .map(|half| (half.samples, half.sum[1][0])),
            [(6, 12.0), (5, 10.0)]
        );
        assert_eq!(
            (
                sums.open.devices.as_slice(),
                sums.open.accel_build_s,
                sums.open.accel_nodes
            ),
            ([one, two].as_slice(), 1.5, 7)
        );
        assert_eq!(sums.open.device_line(), "cpu, 1 threads; cpu, 2 threads");
        let clocks: Vec<(u64, u64, f64, f64)> = rows
            .iter()
            .map(|r| (r.wave, r.samples, r.render_s, r.wall_s))
            .collect();
        assert_eq!(
            clocks,
            [(1, 4, 4.0, 9.0), (2, 9, 9.0, 18.0), (3, 11, 11.0, 27.0)]
        );
        // Joined shards survive a round trip through a checkpoint.
        let again = JoinedShards::from_checkpoint(&joined.to_checkpoint().unwrap()).unwrap();
        assert_eq!((again.sums, again.rows), (sums.clone(), rows.clone()));
    }

    #[test]
    fn devices_of_shards_of_earlier_versions_are_lines() {
        let line = "cpu, 2 threads, eight-wide BVH, avx2; a card; with a driver";
        let stored = read_devices(line.as_bytes()).unwrap();
        assert_eq!(stored, [Device::from_line(line)]);
        assert_eq!(lumbre_render::device::devices_line(&stored), line);
        for damaged in [&b"[{\"name\""[..], b"\xff"] {
            assert_eq!(read_devices(damaged), Err(CheckpointMismatch));
        }
    }

    #[test]
    fn checkpoints_that_are_not_shards_are_rejected() {
        let one = Device::processor(1);
        let whole = checkpoint([2, 2], 1.0, &one);
        for cut in [0, 8, 80, whole.state.len() - 1] {
            let cut = Checkpoint {
                state: whole.state[..cut].to_vec(),
                ..whole.clone()
            };
            assert!(JoinedShards::from_checkpoint(&cut).is_err());
        }
        let huge = [
            u64::from(u32::MAX).to_ne_bytes(),
            u64::from(u32::MAX).to_ne_bytes(),
        ]
        .concat();
        assert_eq!(
            ShardSums::read(&huge),
            Err(CheckpointMismatch),
            "rejected before memory is allocated"
        );
        let other = Checkpoint {
            state: checkpoint([2, 3], 1.0, &one).state,
            ..whole.clone()
        };
        assert!(
            JoinedShards::from_checkpoint(&whole)
                .unwrap()
                .append(&other)
                .is_err(),
            "its rows have another number of samples"
        );
    }
}
