//! The schedule of the samples of a pixel in a dispatch: one after another in one invocation, or each in
//! its own, which keeps a device busy with small pictures. All schedules add the same values in the same
//! order, so films have the same bits.

use lumbre_render::Job;

use crate::context::physical_device::DeviceInfo;
use crate::memory::subpaths;

/// Number of pixels below which samples run in parallel: about as many as an H100 can hold invocations.
const FEW_PIXELS: u64 = 1 << 18;

/// Maximum number of samples whose values are kept until they are added: 40 MiB.
const MAX_VALUES: u64 = 1 << 21;

/// Maximum number of samples of a pixel in parallel, below the least limit of the number of
/// workgroups.
const MAX_AT_ONCE: u64 = 1 << 15;

/// Environment variable that chooses a schedule wherever it is possible: `in-turn`, `regenerated` or
/// `parallel`.
const VARIABLE: &str = "LUMBRE_PIXEL_SAMPLES";

/// The schedule of the samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PixelSamples {
    /// One after another.
    InTurn,
    /// One after another, but a camera path starts as soon as the one before it has ended, while
    /// paths of other pixels go on [Novák, Havran, Dachsbacher 2010, *Path Regeneration for
    /// Interactive Path Tracing*]. Otherwise all invocations of a group wait for its longest path.
    Regenerated,
    /// One after another, and their events are recorded.
    Recorded,
    /// At most this many at once; of films without layers and time axis only.
    Parallel(u32),
}

impl PixelSamples {
    /// Returns how a job's samples are rendered on a device.
    pub fn suitable(device: &DeviceInfo, job: &Job) -> PixelSamples {
        let requested = std::env::var(VARIABLE).ok();
        let wanted = match requested.as_deref() {
            Some("regenerated") => return PixelSamples::Regenerated,
            Some("parallel") => true,
            Some("in-turn") => false,
            _ => pixels(job) < FEW_PIXELS && !device.software,
        };
        match PixelSamples::parallel(job) {
            Some(parallel) if wanted => parallel,
            _ => PixelSamples::InTurn,
        }
    }

    /// Returns the largest number of samples of a pixel that a job can render at once, or `None` if
    /// its film has layers or a time axis, whose values of a sample are many, or too many pixels, or if
    /// each sample shares data of its own between pixels. The vertices that samples store limit it, too.
    pub fn parallel(job: &Job) -> Option<PixelSamples> {
        let values = MAX_VALUES.min(subpaths::samples_anywhere(job));
        let at_once = (values / pixels(job).max(1)).min(MAX_AT_ONCE);
        let is_plain = job.settings.films.is_empty()
            && job.settings.timing.is_none()
            && job.integrator.sharing.is_none();
        (is_plain && at_once > 1).then_some(PixelSamples::Parallel(at_once as u32))
    }

    /// Returns the maximum number of samples of a pixel at once, or `None` if they are rendered one after
    /// another.
    pub fn at_once(self) -> Option<u32> {
        match self {
            PixelSamples::InTurn | PixelSamples::Regenerated | PixelSamples::Recorded => None,
            PixelSamples::Parallel(at_once) => Some(at_once),
        }
    }
}

/// Returns the number of pixels of a job.
fn pixels(job: &Job) -> u64 {
    u64::from(job.resolution[0]) * u64::from(job.resolution[1])
}

#[cfg(test)]
mod tests {
    use lumbre_light::film::layer::Layer;
    use lumbre_light::transport::integrator::integrator;

    use super::*;
    use crate::context::limits::Limits;
    use crate::context::physical_device::Caps;

    #[test]
    fn small_plain_pictures_on_cards_have_samples_in_parallel() {
        let mut device = DeviceInfo::made_up("card", 0, Caps::default(), Limits::default());
        let job = |resolution| Job::plain(integrator("nee").unwrap(), resolution, 5, 1);
        let suitable = |device: &DeviceInfo, job: &Job| PixelSamples::suitable(device, job);
        let small = job([160, 90]);
        assert_eq!(suitable(&device, &small), PixelSamples::Parallel(145));
        assert_eq!(suitable(&device, &job([1, 1])).at_once(), Some(32768));
        assert_eq!(suitable(&device, &job([1280, 720])), PixelSamples::InTurn);
        let with_layers = small
            .clone()
            .with(|settings| settings.films = vec![Layer::Depth]);
        assert_eq!(suitable(&device, &with_layers), PixelSamples::InTurn);
        assert_eq!(PixelSamples::parallel(&job([8192, 8192])), None);
        // The vertices of these fit into 128 MiB.
        let bdpt = Job::plain(integrator("bdpt").unwrap(), [160, 90], 5, 1);
        assert_eq!(suitable(&device, &bdpt), PixelSamples::Parallel(13));
        device.software = true;
        assert_eq!(suitable(&device, &small), PixelSamples::InTurn);
    }
}
