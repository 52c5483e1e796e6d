//! Statistics that drivers report of compiled pipelines, such as registers and spilled bytes
//! (VK_KHR_pipeline_executable_properties).

use std::ffi::{CStr, OsString};
use std::fmt::Write as _;
use std::io::Write as _;

use ash::vk;

use crate::context::device::Device;

/// Environment variable that names a file to which the statistics of every new pipeline are
/// appended: a line for each, separated by tabs, with the names of pipeline, shader and number, and
/// the number.
pub const FILE_VARIABLE: &str = "LUMBRE_PIPELINE_STATS";

fn file() -> Option<OsString> {
    std::env::var_os(FILE_VARIABLE).filter(|file| !file.is_empty())
}

/// Returns the flags with which pipelines are created.
pub(super) fn flags(device: &Device) -> vk::PipelineCreateFlags {
    if device.statistics.is_some() && file().is_some() {
        vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR
    } else {
        vk::PipelineCreateFlags::empty()
    }
}

/// Appends the statistics of a pipeline to the file that [`FILE_VARIABLE`] names. Problems are
/// logged, since statistics must not end a run.
pub(super) fn append(device: &Device, name: &str, pipeline: vk::Pipeline) {
    let Some(file) = file() else { return };
    let Some(text) = collect(device, name, pipeline) else {
        let line = device.info.line();
        tracing::warn!("{FILE_VARIABLE} is set, but {line} reports no statistics of pipelines");
        return;
    };
    let open = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(&file);
    if let Err(e) = open.and_then(|mut file| file.write_all(text.as_bytes())) {
        tracing::warn!("statistics cannot be written to {}: {e}", file.display());
    }
}

/// Returns the lines of a pipeline; `None` if the device has none.
fn collect(device: &Device, name: &str, pipeline: vk::Pipeline) -> Option<String> {
    let functions = device.statistics.as_ref()?;
    let info = vk::PipelineInfoKHR::default().pipeline(pipeline);
    // SAFETY: the pipeline was created by this device, with the flag to capture statistics.
    let executables = unsafe { functions.get_pipeline_executable_properties(&info) }.ok()?;
    let mut text = String::new();
    for (index, executable) in (0..).zip(&executables) {
        let info = vk::PipelineExecutableInfoKHR::default()
            .pipeline(pipeline)
            .executable_index(index);
        // SAFETY: as above.
        let found = unsafe { functions.get_pipeline_executable_statistics(&info) }.ok()?;
        for statistic in &found {
            let (shader, what) = (shown(&executable.name), shown(&statistic.name));
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{name}\t{shader}\t{what}\t{}", value(statistic));
        }
    }
    Some(text)
}

fn shown(name: &[std::ffi::c_char]) -> String {
    let bytes: Vec<u8> = name.iter().map(|c| *c as u8).collect();
    let name = CStr::from_bytes_until_nul(&bytes).unwrap_or_default();
    name.to_string_lossy().replace(['\t', '\n'], " ")
}

/// Returns the number of a statistic as text.
fn value(statistic: &vk::PipelineExecutableStatisticKHR) -> String {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    // SAFETY: the format states which field of the union the driver has set.
    unsafe {
        match statistic.format {
            Format::BOOL32 => statistic.value.b32.to_string(),
            Format::INT64 => statistic.value.i64.to_string(),
            Format::FLOAT64 => statistic.value.f64.to_string(),
            _ => statistic.value.u64.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_their_format_states() {
        use vk::PipelineExecutableStatisticFormatKHR as Format;
        let of = |format, value| {
            let statistic = vk::PipelineExecutableStatisticKHR {
                format,
                value,
                ..Default::default()
            };
            super::value(&statistic)
        };
        let number = |f64| vk::PipelineExecutableStatisticValueKHR { f64 };
        assert_eq!(of(Format::FLOAT64, number(2.5)), "2.5");
        let number = |i64| vk::PipelineExecutableStatisticValueKHR { i64 };
        assert_eq!(of(Format::INT64, number(-3)), "-3");
        assert_eq!(of(Format::UINT64, number(96)), "96");
        assert_eq!(of(Format::BOOL32, number(1)), "1");
        let name = b"SGPRs\0rest".map(|c| c as std::ffi::c_char);
        assert_eq!(shown(&name), "SGPRs");
    }
}
