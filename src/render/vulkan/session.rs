//! What runs in one process share: the open device, and the scene that was copied to it last.

use std::sync::{Arc, Mutex, PoisonError, Weak};

use super::device::{self, Device};
use super::error::VulkanError;
use super::upload::SceneBuffers;
use crate::scene::CompiledScene;

/// The open device. It is kept for the next run, and forgotten once it failed.
static DEVICE: Mutex<Option<Arc<Device>>> = Mutex::new(None);

/// A scene on a device: which device, the hash of the scene with its numbers of triangles and of copies, which unfolding
/// changes, its buffers.
type Copied = (Weak<Device>, ([u8; 32], usize, usize), Weak<SceneBuffers>);

/// The last scene, as long as a run uses it.
static SCENE: Mutex<Option<Copied>> = Mutex::new(None);

/// The device that this process renders on.
///
/// # Errors
/// When there is none, or it does not open.
pub fn device() -> Result<Arc<Device>, VulkanError> {
    let mut shared = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(device) = &*shared {
        return Ok(Arc::clone(device));
    }
    let info = device::choose()?;
    let caps = info.caps;
    let device = Device::open(info, caps)?;
    *shared = Some(Arc::clone(&device));
    Ok(device)
}

/// Forgets a device that failed, so that the next run opens a fresh one.
pub fn forget(device: &Arc<Device>) {
    let mut shared = DEVICE.lock().unwrap_or_else(PoisonError::into_inner);
    if shared.as_ref().is_some_and(|d| Arc::ptr_eq(d, device)) {
        *shared = None;
    }
}

/// A scene on a device: the buffers of a run in progress where it is the same scene.
///
/// # Errors
/// When it does not fit.
pub fn scene(device: &Arc<Device>, scene: &CompiledScene) -> Result<Arc<SceneBuffers>, VulkanError> {
    let mut shared = SCENE.lock().unwrap_or_else(PoisonError::into_inner);
    // Scenes made in code have no hash.
    let known = scene.content_hash != [0; 32];
    let key = (scene.content_hash, scene.triangles.len(), scene.instances.places.len());
    if let Some((on, made_of, buffers)) = &*shared
        && known
        && *made_of == key
        && std::ptr::eq(on.as_ptr(), Arc::as_ptr(device))
        && let Some(buffers) = buffers.upgrade()
    {
        return Ok(buffers);
    }
    let buffers = Arc::new(SceneBuffers::new(device, scene)?);
    *shared = Some((Arc::downgrade(device), key, Arc::downgrade(&buffers)));
    Ok(buffers)
}
