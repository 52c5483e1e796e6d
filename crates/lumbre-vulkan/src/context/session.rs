//! State shared by the runs of a process: the open device and the last scene on it.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use super::device::Device;
use super::physical_device;
use crate::error::VulkanError;
use crate::memory::upload::SceneBuffers;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::CompiledKey;

/// Open device, reused by the next run and dropped after a failure.
static DEVICE: Mutex<Option<Arc<Device>>> = Mutex::new(None);

/// Scene on a device: the device, a key and the buffers. The key is the scene's hash with its
/// numbers of triangles and instances, which flattening changes.
type CachedScene = (Weak<Device>, CompiledKey, Weak<SceneBuffers>);

/// Last scene; its buffers live as long as a run uses them.
static SCENE: Mutex<Option<CachedScene>> = Mutex::new(None);

/// Returns the device that this process renders on, opening it on the first call.
///
/// # Errors
/// Returns an error if there is none or it cannot be opened.
pub fn device() -> Result<Arc<Device>, VulkanError> {
    let mut shared = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(device) = &*shared {
        return Ok(Arc::clone(device));
    }
    let info = physical_device::choose()?;
    let caps = info.caps;
    let device = Device::open(info, caps)?;
    *shared = Some(Arc::clone(&device));
    Ok(device)
}

/// Drops a device that failed, so that the next run opens a new one.
pub fn forget(device: &Arc<Device>) {
    let mut shared = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
    if shared.as_ref().is_some_and(|d| Arc::ptr_eq(d, device)) {
        *shared = None;
    }
}

/// Returns the buffers of a scene on a device; runs of the same scene share them.
///
/// # Errors
/// Returns an error if the scene does not fit.
pub fn scene(
    device: &Arc<Device>,
    scene: &CompiledScene,
) -> Result<Arc<SceneBuffers>, VulkanError> {
    let mut shared = SCENE.lock().unwrap_or_else(PoisonError::into_inner);
    let key = scene.key();
    if let Some((on, cached, buffers)) = &*shared
        && key == Some(*cached)
        && std::ptr::eq(on.as_ptr(), Arc::as_ptr(device))
        && let Some(buffers) = buffers.upgrade()
    {
        return Ok(buffers);
    }
    let buffers = Arc::new(SceneBuffers::new(device, scene)?);
    *shared = key.map(|key| (Arc::downgrade(device), key, Arc::downgrade(&buffers)));
    Ok(buffers)
}
