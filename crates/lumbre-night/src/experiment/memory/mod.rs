//! Memory requirements of runs, and the memory that they may use.

mod limit;

pub use limit::{
    MemoryLimit, address_space_shortage, available_and_total, free, process_bytes, total,
};

use self::limit::gibibytes;
use lumbre_light::film::layer::{BYTES_PER_PIXEL, LayerLayout, SPLAT_BYTES_PER_PIXEL};
use lumbre_light::film::time;
use lumbre_light::transport::integrator::iteration::PathSize;
use lumbre_light::transport::integrator::{self, integrator};
use lumbre_render::Settings;
use lumbre_render::denoise::Denoise;

/// Bytes per pixel that measuring needs beside the film: the picture, the reference, tone-mapped
/// copies of both, and FLIP's filtered reference.
const MEASURING_BYTES: u64 = 80;

/// Upper bound of the bytes taken by the layers and time bins of a run.
pub fn layer_and_bin_bytes(config: &Settings) -> u64 {
    let pixels = pixels(config);
    // The planner has already rejected layouts that are too large.
    let layers = LayerLayout::new(
        &config.rendered_layers(),
        config.max_depth.unwrap_or(1),
        pixels,
    )
    .map_or(0, |layout| layout.bytes());
    let timing = config.timing.as_ref();
    let bins = timing
        .and_then(|timing| time::bytes(&timing.axis, pixels, splats(config)).ok())
        .unwrap_or(0);
    layers + bins
}

/// Upper bound of the bytes that a run takes while it renders: film, layers, time bins, the buffers
/// of measuring and denoising, and the photons, light subpaths or tree of an iteration. The scene with its
/// hierarchy, material and light tables is not included.
pub fn run_bytes(config: &Settings) -> u64 {
    let each =
        BYTES_PER_PIXEL + u64::from(splats(config)) * SPLAT_BYTES_PER_PIXEL + MEASURING_BYTES;
    let denoising = config.denoise.as_ref().map_or(0, Denoise::bytes_per_pixel);
    pixels(config) * (each + denoising) + layer_and_bin_bytes(config) + shared_bytes(config)
}

/// Upper bound of the bytes taken by the data that the samples of an iteration share.
fn shared_bytes(config: &Settings) -> u64 {
    let sharing = integrator(&config.integrator).and_then(|row| row.sharing);
    sharing.map_or(0, |sharing| {
        let size = PathSize {
            pixels: pixels(config),
            max_depth: config.max_depth.unwrap_or(1),
            rr_start: config.rr_start,
            each: !config.rendered_layers().is_empty() || config.timing.is_some(),
        };
        sharing.bytes(&integrator::Settings::new(&config.params), &size)
    })
}

/// Number of pixels of the picture; 0 if its size is not set.
pub(super) fn pixels(config: &Settings) -> u64 {
    let [width, height] = config.resolution.unwrap_or_default();
    u64::from(width) * u64::from(height)
}

/// Whether the integrator needs a splat buffer.
fn splats(config: &Settings) -> bool {
    integrator(&config.integrator).is_some_and(|row| row.splats)
}

/// Returns an error message if `runs` runs that are in memory at the same time need more than the
/// limit. `need` is the sum of their bytes.
pub fn shortage(runs: usize, need: u64, limit: &MemoryLimit) -> Option<String> {
    if need <= limit.bytes {
        return None;
    }
    let need = gibibytes(need);
    Some(if runs > 1 {
        format!(
            "{runs} interleaved techniques need {need} of memory together, and {limit}: use \
             another order than \"interleave\", a smaller picture, fewer films or photons, or less \
             tree_memory"
        )
    } else {
        format!(
            "the run needs {need} of memory for its films and measurements, and {limit}: use a \
             smaller picture, fewer bins, films or photons, or less tree_memory"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shortage_is_reported_in_gibibytes() {
        let limit = MemoryLimit {
            bytes: 1 << 30,
            source: "are free".to_owned(),
        };
        assert_eq!(shortage(3, 1 << 30, &limit), None);
        for (runs, words) in [
            (3, "3 interleaved techniques need 2.5 GiB"),
            (1, "the run needs 2.5 GiB"),
        ] {
            let reason = shortage(runs, 5 << 29, &limit).unwrap();
            let words = [words, "and 1.0 GiB are free: use"];
            assert!(words.iter().all(|part| reason.contains(part)), "{reason}");
        }
    }

    #[test]
    fn a_run_that_splats_needs_a_second_film() {
        let bytes = |integrator: &str| {
            run_bytes(&Settings {
                resolution: Some([100, 10]),
                ..Settings::new(integrator)
            })
        };
        assert_eq!(bytes("bdpt") - bytes("nee"), 1000 * SPLAT_BYTES_PER_PIXEL);
        assert_eq!(bytes("nee"), 1000 * (BYTES_PER_PIXEL + MEASURING_BYTES));
    }
}
