//! The Vulkan backends.
//!
//! `layout` and `spirv` need no device. `instance`, `device`, `buffer` and `pipeline` are a thin layer over Vulkan: each
//! object owns what it was made from and goes when it is dropped, and every submission is waited for before what it uses goes, so
//! that nothing is destroyed while it is in use.
#![allow(unsafe_code, reason = "Vulkan is a C interface; each block says why it may be called")]

mod accel;
pub mod buffer;
pub mod bvh;
mod cache;
mod delays;
pub mod device;
pub mod error;
mod films;
pub mod instance;
pub mod kernel;
pub mod layout;
mod pace;
pub mod pipeline;
pub mod program;
pub mod renderer;
mod session;
pub mod spirv;
mod submission;
mod texels;
mod times;
mod tracing;
pub mod upload;

use std::sync::Arc;

use super::paths::{SampleAt, Step};
use super::{BackendRow, Job, RenderError, Renderer, choice, worker};
use crate::scene::CompiledScene;
use crate::transport::integrator::IntegratorRow;
use error::VulkanError;
use program::{Kind, shader_of};
use renderer::VulkanRenderer;
use spirv::Sources;

/// The row of ray-tracing pipelines.
pub const PIPELINE: BackendRow = BackendRow {
    name: "vulkan",
    doc: "A graphics device that traces rays: ray-tracing pipelines.",
    probe: || probe(Kind::Pipeline),
    layers: true,
    times: true,
    models: upload::MODELS,
    refuses,
    edited,
    accel: false,
    open: |scene, job| open(Kind::Pipeline, &scene, job),
    paths: |scene, job, samples| paths(Kind::Pipeline, scene, job, samples),
};

/// The row of ray queries.
pub const QUERY: BackendRow = BackendRow {
    name: "vulkan-query",
    doc: "The same device and the same code in a compute shader, by ray queries.",
    probe: || probe(Kind::Query),
    layers: true,
    times: true,
    models: upload::MODELS,
    refuses,
    edited,
    accel: false,
    open: |scene, job| open(Kind::Query, &scene, job),
    paths: |scene, job, samples| paths(Kind::Query, scene, job, samples),
};

/// The row of hierarchies of our own.
pub const COMPUTE: BackendRow = BackendRow {
    name: "vulkan-compute",
    doc: "A graphics device that need not trace rays: a compute shader over a hierarchy of our own.",
    probe: || probe(Kind::Compute),
    layers: true,
    times: true,
    models: upload::MODELS,
    refuses,
    edited,
    accel: true,
    open: |scene, job| open(Kind::Compute, &scene, job),
    paths: |scene, job, samples| paths(Kind::Compute, scene, job, samples),
};

/// The most path edges of integrators that keep both subpaths: their shaders hold two vertices of about 400 bytes for each
/// edge in the private memory of every invocation, here 25 KiB.
const MOST_KEPT: u32 = 32;

fn refuses(integrator: &IntegratorRow, max_depth: u32) -> Option<String> {
    let name = integrator.name;
    if shader_of(&Sources::chosen(), name).is_none() {
        return Some(format!("there is no shader for the integrator `{name}`"));
    }
    (integrator.splats && max_depth > MOST_KEPT).then(|| {
        format!("its shader of `{name}` keeps the vertices of both subpaths in private memory, which has room for max_depth {MOST_KEPT}, not {max_depth}")
    })
}

/// What of the shaders is not as it was built.
fn edited() -> Result<Option<String>, String> {
    Sources::chosen().edited().map_err(|e| e.to_string())
}

/// Opens a run: in a worker process, where this one has any.
fn open(kind: Kind, scene: &Arc<CompiledScene>, job: Job) -> Result<Box<dyn Renderer>, RenderError> {
    Ok(match worker::pool() {
        Some(pool) => Box::new(pool.open(kind.backend(), scene, job)?),
        None => Box::new(VulkanRenderer::open(kind, scene, &job)?),
    })
}

/// What samples do on the device of this process.
fn paths(kind: Kind, scene: &CompiledScene, job: &Job, samples: &[SampleAt]) -> Result<Vec<Vec<Step>>, RenderError> {
    let steps = || {
        let device = session::device()?;
        VulkanRenderer::stepwise(&device, kind, &Sources::chosen(), scene, job)?.paths(samples)
    };
    steps().map_err(|e| renderer::into_render_error(kind, e))
}

/// The device that a kind would run on, or why none can.
fn probe(kind: Kind) -> Result<String, String> {
    let device = device::choose().map_err(|e| e.to_string())?;
    match kind.lacking(&device.caps) {
        None => Ok(device.line()),
        Some(what) => Err(format!("{} has no {what}", device.line())),
    }
}

/// The place of the device that one of these backends renders on in the list of devices; `None` for other backends.
pub fn place(backend: &str) -> Option<String> {
    Kind::ALL.iter().find(|kind| kind.backend() == backend)?;
    device::choose().ok().map(|device| device.index.to_string())
}

/// The places of further devices of this machine of the model that one of these backends renders on. None where a device
/// was named: that one is meant alone.
pub fn alike(backend: &str) -> Vec<String> {
    if Kind::ALL.iter().all(|kind| kind.backend() != backend) || choice::device(device::DEVICE_VARIABLE).is_some() {
        return Vec::new();
    }
    let found = || Ok::<_, VulkanError>((device::choose()?, device::list()?));
    found().map_or_else(|_| Vec::new(), |(chosen, all)| chosen.alike(&all).iter().map(usize::to_string).collect())
}

/// The places of the devices of these names, each once.
///
/// # Errors
/// When there is none of a name, or two names mean one.
pub fn places(names: &[String]) -> Result<Vec<String>, String> {
    let all = device::list().map_err(|e| e.to_string())?;
    let mut places: Vec<String> = Vec::new();
    for name in names {
        let place = device::find(&all, name).map_err(|e| e.to_string())?.index.to_string();
        if places.contains(&place) {
            return Err(format!("device {place} is named twice"));
        }
        places.push(place);
    }
    Ok(places)
}

/// The backend that suits this machine's device, and why; where none does, why not.
pub fn automatic() -> Result<(&'static str, String), String> {
    let device = device::choose().map_err(|e| e.to_string())?;
    if device.software {
        return Err(format!("{} is a program on the processor", device.line()));
    }
    let kind = [Kind::Pipeline, Kind::Compute].into_iter().find(|kind| kind.lacking(&device.caps).is_none());
    let kind = kind.ok_or_else(|| format!("{} lacks what every backend needs", device.line()))?;
    let why = if kind == Kind::Pipeline { "it traces rays" } else { "it computes, but does not trace rays" };
    Ok((kind.backend(), format!("{}: {why}", device.line())))
}

/// Every device of this machine for people: its name and driver, and per kind of backend whether it can do it.
pub fn devices() -> Vec<(String, String)> {
    let listed = match device::list() {
        Ok(devices) => devices,
        Err(e) => return vec![("devices".to_owned(), e.to_string())],
    };
    let line = |d: &device::DeviceInfo| {
        let able = |kind: &Kind| kind.lacking(&d.caps).is_none();
        let can: Vec<&str> = Kind::ALL.iter().filter(|kind| able(kind)).map(|kind| kind.backend()).collect();
        let splats = if d.caps.float_atomics { "splats by float atomics" } else { "splats in whole numbers" };
        let sort = if d.software { "a program" } else { "hardware" };
        let heap = error::mib(d.limits.heap);
        (format!("device {}", d.index), format!("{}: {sort}, {heap:.0} MiB, {splats}; {}", d.line(), can.join(", ")))
    };
    listed.iter().map(line).collect()
}
