//! The Vulkan instance of the process, and the messages of the validation layer.

use std::ffi::{CStr, c_void};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use ash::{ext, vk};

use crate::error::VulkanError;
use lumbre_render::worker::{self, WorkerPool};

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Environment variable that, set to anything but `0`, enables the validation layer if it is
/// installed; its messages are logged as warnings. `gpu` enables its checks of the accesses of
/// shaders, which make pipelines slow to create, instead of those of synchronisation.
pub const VALIDATION_VARIABLE: &str = "LUMBRE_VALIDATION";

static VALIDATE: AtomicBool = AtomicBool::new(false);
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());
static SHARED: OnceLock<Result<Instance, VulkanError>> = OnceLock::new();

/// Vulkan loader and instance.
pub struct Instance {
    /// Owner of the loaded library.
    _entry: ash::Entry,
    /// Handle of the instance.
    pub raw: ash::Instance,
    /// Whether the debug extension is available, to name objects and receive messages.
    pub debug: bool,
    /// Whether the validation layer is enabled.
    pub validated: bool,
}

/// Variables of the environment that name files of drivers, instead of those in the system's
/// folders.
const DRIVER_VARIABLES: [&str; 2] = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"];

/// Returns the variables of the environment by which the loader and drivers are found, as the end
/// of a message.
fn surroundings() -> String {
    let names = ["LD_LIBRARY_PATH", "VK_LAYER_PATH"].into_iter();
    let set = names.chain(DRIVER_VARIABLES).filter_map(|name| {
        let value = std::env::var(name).ok().filter(|value| !value.is_empty())?;
        Some(format!("{name}={value}"))
    });
    let set: Vec<String> = set.collect();
    match set.is_empty() {
        true => String::new(),
        false => format!(" (with {})", set.join(", ")),
    }
}

/// Returns the message if the loader cannot create an instance.
fn no_driver() -> String {
    let named = DRIVER_VARIABLES
        .iter()
        .find_map(|name| Some((name, std::env::var(name).ok()?)));
    match named {
        Some((name, files)) => format!(
            "the Vulkan loader finds no driver that works in `{files}`, which {name} names; name \
             another file, or unset the variable"
        ),
        None => "the Vulkan loader finds no driver that works; install the driver of the graphics \
                 card, or a software driver (Mesa's lavapipe)"
            .to_owned(),
    }
}

/// Enables the validation layer for the instance that its first use creates; must be called before.
/// Used by tests.
pub fn enable_validation() {
    VALIDATE.store(true, Ordering::Relaxed);
}

/// Returns the messages of the validation layer so far; empty if all is well.
pub fn validation_messages() -> Vec<String> {
    MESSAGES
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone()
}

/// Returns the instance of this process, created by the first call. It is never destroyed, and
/// neither is the library unloaded, since drivers tend to crash when unloaded.
///
/// In a process that renders in workers, a worker opens the device first: a damaged loader or
/// driver, which may crash or hang, then ends the worker and not this process.
///
/// # Errors
/// Returns an error if there is no loader, it cannot create an instance, or a worker cannot open
/// the device.
pub fn shared() -> Result<&'static Instance, VulkanError> {
    let instance =
        SHARED.get_or_init(
            || match worker::pool().map_or(Ok(None), WorkerPool::device) {
                Ok(None) => create(),
                Ok(Some(reason)) | Err(reason) => {
                    Err(VulkanError::Broken(format!("{reason}{}", surroundings())))
                }
            },
        );
    instance.as_ref().map_err(Clone::clone)
}

fn create() -> Result<Instance, VulkanError> {
    // SAFETY: the loaded library is the system's Vulkan loader, whose initialisers are safe to run.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| VulkanError::NoLoader(e.to_string()))?;
    let call = |call: &'static str| {
        move |result| VulkanError::Call {
            call,
            result,
            pass: "start".to_owned(),
        }
    };
    let validated = wants_validation(&entry);
    let debug = validated || has_debug_utils(&entry);
    let application = vk::ApplicationInfo::default()
        .application_name(c"lumbre")
        .api_version(vk::API_VERSION_1_2);
    let layer_names: Vec<_> = validated
        .then_some(VALIDATION.as_ptr())
        .into_iter()
        .collect();
    let extension_names: Vec<_> = debug
        .then_some(ext::debug_utils::NAME.as_ptr())
        .into_iter()
        .collect();
    // Lenient drivers hide missing barriers, and accesses outside of buffers.
    let enabled: &[vk::ValidationFeatureEnableEXT] = match std::env::var(VALIDATION_VARIABLE) {
        Ok(kind) if kind == "gpu" => &[
            vk::ValidationFeatureEnableEXT::GPU_ASSISTED,
            vk::ValidationFeatureEnableEXT::GPU_ASSISTED_RESERVE_BINDING_SLOT,
        ],
        _ => &[vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION],
    };
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(enabled);
    let mut info = vk::InstanceCreateInfo::default()
        .application_info(&application)
        .enabled_layer_names(&layer_names)
        .enabled_extension_names(&extension_names);
    if validated {
        info = info.push_next(&mut features);
    }
    // SAFETY: everything the structure points to lives until the call returns.
    let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => VulkanError::NoDevice(no_driver()),
        other => VulkanError::Broken(format!(
            "vkCreateInstance failed with {other:?}{}",
            surroundings()
        )),
    })?;
    if validated {
        let messenger = vk::DebugUtilsMessengerCreateInfoEXT::default()
            .message_severity(
                vk::DebugUtilsMessageSeverityFlagsEXT::WARNING
                    | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR,
            )
            .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
            .pfn_user_callback(Some(on_validation_message));
        let debug_utils = ext::debug_utils::Instance::new(&entry, &raw);
        // SAFETY: the instance has the extension, since the layer provides it; the messenger lives
        // as long as the instance.
        unsafe { debug_utils.create_debug_utils_messenger(&messenger, None) }
            .map_err(call("vkCreateDebugUtilsMessengerEXT"))?;
    }
    Ok(Instance {
        _entry: entry,
        raw,
        debug,
        validated,
    })
}

/// Returns whether the loader supports the extension to name objects and receive messages.
fn has_debug_utils(entry: &ash::Entry) -> bool {
    // SAFETY: the entry is loaded.
    let extensions =
        unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
    extensions
        .iter()
        .any(|e| e.extension_name_as_c_str() == Ok(ext::debug_utils::NAME))
}

/// Returns whether the validation layer was requested and is installed.
fn wants_validation(entry: &ash::Entry) -> bool {
    let wanted = VALIDATE.load(Ordering::Relaxed)
        || std::env::var(VALIDATION_VARIABLE).is_ok_and(|value| !value.is_empty() && value != "0");
    // SAFETY: the entry is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
    let validated = wanted
        && layers
            .iter()
            .any(|l| l.layer_name_as_c_str() == Ok(VALIDATION));
    if wanted && !validated {
        tracing::warn!("the Vulkan validation layer was requested but is not installed");
    }
    validated
}

/// Callback of the validation layer: logs and stores its message.
unsafe extern "system" fn on_validation_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid structure with zero-terminated text.
    let text = unsafe { (*data).message_as_c_str() }
        .map(|t| t.to_string_lossy().into_owned())
        .unwrap_or_default();
    tracing::warn!("Vulkan: {text}");
    MESSAGES
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .push(text);
    vk::FALSE
}
