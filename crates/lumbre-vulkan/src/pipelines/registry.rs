//! The pipelines of a device, each created once.

use ash::vk;

use super::once_per_key::OncePerKey;

/// Pipelines of a device by the hash of everything they are made of, shared by all runs. A new
/// scene, seed or resolution needs no new pipeline, nor does a return to an earlier technique.
#[derive(Default)]
pub struct PipelineRegistry(pub(super) OncePerKey<Pipeline>);

/// Pipeline with its layout. Owned by the device.
#[derive(Clone, Copy)]
pub struct Pipeline {
    /// Handle of the layout.
    pub layout: vk::PipelineLayout,
    /// Handle of the pipeline.
    pub raw: vk::Pipeline,
}

impl PipelineRegistry {
    /// Returns the number of pipelines created so far.
    pub fn count(&self) -> usize {
        self.0.values().len()
    }

    /// Removes all pipelines, before their device is destroyed.
    pub fn drain(&self) -> impl Iterator<Item = Pipeline> {
        let all = self.0.values();
        self.0.clear();
        all.into_iter()
    }
}
