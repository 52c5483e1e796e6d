//! Methods by which devices trace rays.

use crate::context::physical_device::DeviceInfo;
use lumbre_render::device::Features;
use lumbre_render::hierarchy::AccelSpec;

/// Method by which rays are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TracingMode {
    /// Rays of a ray-tracing pipeline.
    Pipeline,
    /// Ray queries in a compute shader.
    Query,
    /// Own BVH, traversed in a compute shader.
    Compute,
}

impl TracingMode {
    /// All modes of tracing.
    pub const ALL: [TracingMode; 3] = [
        TracingMode::Pipeline,
        TracingMode::Query,
        TracingMode::Compute,
    ];

    /// Returns the name of its backend.
    pub fn backend(self) -> &'static str {
        match self {
            TracingMode::Pipeline => "vulkan",
            TracingMode::Query => "vulkan-query",
            TracingMode::Compute => "vulkan-compute",
        }
    }

    /// Returns the features that a run in this mode uses; `spec` are the settings of an own BVH.
    pub fn features(self, device: &DeviceInfo, spec: &AccelSpec) -> Features {
        let tracing = match self {
            TracingMode::Pipeline => "ray-tracing pipelines",
            TracingMode::Query => "ray queries",
            TracingMode::Compute => "compute shader",
        };
        let is_emulated = self != TracingMode::Compute && device.emulates_tracing();
        let suffix = if is_emulated { ", emulated" } else { "" };
        Features {
            hierarchy: (self == TracingMode::Compute)
                .then(|| format!("BVH by {}", spec.describe())),
            tracing: Some(format!("{tracing}{suffix}")),
            ..Features::default()
        }
    }

    /// Returns the feature that a device lacks for this mode, if any.
    pub fn lacking(self, device: &DeviceInfo) -> Option<&'static str> {
        let caps = &device.caps;
        let (there, what) = match self {
            _ if !caps.scalar_layout => (false, "scalar block layout"),
            TracingMode::Pipeline if !device.may_use_pipelines() => (
                false,
                "ray tracing in hardware; its driver emulates it, and computed wrong light in tests: \
                 use `vulkan-compute`, which is also faster, or set LUMBRE_EMULATED_TRACING=1",
            ),
            TracingMode::Pipeline => (
                caps.pipeline,
                "ray-tracing pipelines (VK_KHR_ray_tracing_pipeline)",
            ),
            TracingMode::Query => (caps.query, "ray queries (VK_KHR_ray_query)"),
            TracingMode::Compute => (true, ""),
        };
        (!there).then_some(what)
    }
}
