//! Buffers of the vertices of subpaths: `shaders/subpaths.glsl`.

use std::sync::Arc;

use super::buffer::Buffer;
use crate::context::device::Device;
use crate::error::VulkanError;
use crate::layout::{SubpathLength, SubpathVertex};
use crate::pipelines::compute::BoundResource;
use lumbre_light::transport::integrator::Settings;
use lumbre_light::transport::integrator::lvc::cache;
use lumbre_render::Job;

/// Bytes of the vertices of samples that are rendered at once, if all of a picture need more: at a
/// `max_depth` of 8 those of 470,000 samples, more than ten times as many as an H100 renders at once.
const SAMPLE_BYTES: u64 = 512 << 20;

/// Least number of bytes of a storage buffer that every device supports.
const LEAST_RANGE: u64 = 1 << 27;

/// Bytes of a vertex.
const VERTEX_BYTES: u64 = size_of::<SubpathVertex>() as u64;

/// Room for vertices of subpaths. Integrators that store none need none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SubpathRoom {
    /// Number of light subpaths that samples share, or from which the job is prepared.
    pub light_paths: u64,
    /// Number of vertices of each of them.
    pub of_light_path: u32,
    /// Number of vertices of all subpaths that a sample traces.
    pub of_sample: u32,
    /// Number of samples that have room at the same time, at least those of a row.
    pub samples: u32,
}

impl SubpathRoom {
    /// Returns the room that a job needs on a device whose storage buffers have up to
    /// `storage_range` bytes.
    pub fn new(job: &Job, at_once: Option<u32>, storage_range: u64) -> SubpathRoom {
        let [width, height] = job.resolution.map(u64::from);
        // Samples of a pixel that are rendered at once are added afterwards: all of them need room.
        let (most, least) = match at_once {
            Some(at_once) => (width * height * u64::from(at_once), u64::MAX),
            None => (width * height, width),
        };
        let (light_paths, of_light_path) = (stored_light_paths(job), job.max_depth.max(2) - 1);
        let shared = light_paths * u64::from(of_light_path);
        let left = storage_range.saturating_sub(shared * VERTEX_BYTES);
        let fitting = samples_in(left.min(SAMPLE_BYTES), job);
        SubpathRoom {
            light_paths,
            of_light_path,
            of_sample: vertices_of_sample(job),
            samples: u32::try_from(fitting.max(least).min(most)).unwrap_or(u32::MAX),
        }
    }

    /// Returns the number of vertices of the light subpaths.
    pub fn shared(&self) -> u64 {
        self.light_paths * u64::from(self.of_light_path)
    }

    /// Returns the number of rows of `width` samples that have room at the same time.
    pub fn rows(&self, width: u32) -> u32 {
        (self.samples / width.max(1)).max(1)
    }
}

/// Returns the number of samples of a job whose vertices fit into a storage buffer of any device.
pub fn samples_anywhere(job: &Job) -> u64 {
    samples_in(LEAST_RANGE, job)
}

/// Returns the number of samples of a job whose vertices fit into this number of bytes.
fn samples_in(bytes: u64, job: &Job) -> u64 {
    match vertices_of_sample(job) {
        0 => u64::MAX,
        vertices => bytes / (u64::from(vertices) * VERTEX_BYTES),
    }
}

/// Returns the greatest number of vertices that a sample of a job stores: a camera vertex for each
/// edge and, unless samples share light subpaths, one fewer of its light subpath.
fn vertices_of_sample(job: &Job) -> u32 {
    let camera = job.max_depth.max(1);
    match (job.integrator.splats, job.integrator.sharing) {
        (false, _) => 0,
        (true, Some(_)) => camera,
        (true, None) => 2 * camera - 1,
    }
}

/// Buffers of vertices; of a few bytes for jobs that store none.
pub struct SubpathBuffers {
    vertices: Buffer,
    lengths: Buffer,
}

impl SubpathBuffers {
    /// Creates buffers with this room, with lengths if the job is `timed`.
    ///
    /// # Errors
    /// Returns an error if the device has no room for them.
    pub fn new(
        device: &Arc<Device>,
        room: &SubpathRoom,
        timed: bool,
    ) -> Result<SubpathBuffers, VulkanError> {
        let vertices = room.shared() + u64::from(room.samples) * u64::from(room.of_sample);
        let lengths = if timed { vertices } else { 0 };
        let remedy = if room.light_paths > 0 {
            "the vertices of subpaths must fit into one storage buffer; lower `photons` or `max_depth`"
        } else {
            "the vertices of subpaths must fit into one storage buffer; lower `max_depth`"
        };
        // The 32 bits of a buffer's size hold fewer vertices than the 32 bits of their numbers.
        let (vertices, lengths) = (
            vertices * VERTEX_BYTES,
            lengths * size_of::<SubpathLength>() as u64,
        );
        Ok(SubpathBuffers {
            vertices: Buffer::written(device, "subpath vertices", vertices, remedy)?,
            lengths: Buffer::written(device, "subpath lengths", lengths, remedy)?,
        })
    }

    /// Returns the bindings after those of the films, in the order of `shaders/subpaths.glsl`.
    pub fn bindings(&self) -> [BoundResource<'_>; 2] {
        [&self.vertices, &self.lengths].map(BoundResource::Storage)
    }
}

/// Returns the number of light subpaths of an iteration of a job, or `None` if its samples share
/// none.
pub fn light_path_count(job: &Job) -> Option<u32> {
    job.integrator.sharing?;
    let [width, height] = job.resolution.map(u64::from);
    let count = Settings::new(&job.settings.params).light_paths(width * height);
    Some(u32::try_from(count).unwrap_or(u32::MAX))
}

/// Returns the number of light subpaths for which a job needs room: those of an iteration, or those
/// from which it is prepared.
fn stored_light_paths(job: &Job) -> u64 {
    light_path_count(job).map_or(0, |count| u64::from(count).max(cache::PREPARED_PATHS))
}

#[cfg(test)]
mod tests {
    use lumbre_light::transport::integrator::integrator;

    use super::*;

    /// Returns the room of a job of this integrator, with up to five edges, at full HD.
    fn room(name: &str, at_once: Option<u32>, storage_range: u64) -> SubpathRoom {
        let job = Job::plain(integrator(name).unwrap(), [1920, 1080], 5, 1);
        SubpathRoom::new(&job, at_once, storage_range)
    }

    #[test]
    fn samples_get_the_room_that_is_left_but_at_least_that_of_a_row() {
        let none = room("nee", None, LEAST_RANGE);
        assert_eq!((none.of_sample, none.samples), (0, 1920 * 1080));
        let large = room("bdpt", None, 1 << 32);
        assert_eq!(large.of_sample, 5 + 4);
        assert_eq!(u64::from(large.samples), SAMPLE_BYTES / (9 * 76));
        assert_eq!(room("bdpt", None, LEAST_RANGE).rows(1920), 102);
        let at_once = room("bdpt", Some(3), LEAST_RANGE);
        assert_eq!(at_once.samples, 1920 * 1080 * 3);
        let shared = 1920 * 1080 * 4 * VERTEX_BYTES;
        assert_eq!(
            room("lvc", None, shared + 1920 * 3 * 5 * VERTEX_BYTES).rows(1920),
            3
        );
        assert_eq!(room("lvc", None, shared).rows(1920), 1);
    }
}
