//! The one Vulkan instance of the process, and the messages of the validation layer.

use std::ffi::{CStr, c_void};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

use ash::{ext, vk};

use super::error::VulkanError;

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// Setting this variable to anything but `0` turns the validation layer on, where it is installed; its messages are
/// warnings in the log.
pub const VALIDATION_VARIABLE: &str = "LUMBRE_VALIDATION";

static VALIDATE: AtomicBool = AtomicBool::new(false);
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());
static SHARED: OnceLock<Result<Instance, VulkanError>> = OnceLock::new();

/// The loader and the instance.
pub struct Instance {
    /// Keeps the loaded library.
    _entry: ash::Entry,
    /// The instance.
    pub raw: ash::Instance,
    /// Whether objects can be named and messages heard.
    pub debug: bool,
    /// Whether the validation layer is on.
    pub validated: bool,
}

/// What is missing where the loader makes no instance.
const NO_DRIVER: &str = "there is a Vulkan loader, but it finds no driver that it can load; install that of the graphics card, \
                         or one that needs none (Mesa's lavapipe)";

/// Turns the validation layer on for the instance that the first use makes; call it before. Tests do.
pub fn validate() {
    VALIDATE.store(true, Ordering::Relaxed);
}

/// What the validation layer has said so far: nothing, where all is well.
pub fn messages() -> Vec<String> {
    MESSAGES.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// The instance of this process, made at the first call. It lives as long as the process, like the library itself:
/// unloading drivers is where they crash.
///
/// # Errors
/// When there is no loader, or it makes no instance.
pub fn shared() -> Result<&'static Instance, VulkanError> {
    SHARED.get_or_init(create).as_ref().map_err(Clone::clone)
}

fn create() -> Result<Instance, VulkanError> {
    // SAFETY: the library that is loaded is the system's Vulkan loader, whose initialisers may be run.
    let entry = unsafe { ash::Entry::load() }.map_err(|e| VulkanError::NoLoader(e.to_string()))?;
    let call = |call: &'static str| move |result| VulkanError::Call { call, result, pass: "start".to_owned() };
    let wanted = VALIDATE.load(Ordering::Relaxed)
        || std::env::var(VALIDATION_VARIABLE).is_ok_and(|value| !value.is_empty() && value != "0");
    // SAFETY: the entry is loaded.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
    let validated = wanted && layers.iter().any(|l| l.layer_name_as_c_str() == Ok(VALIDATION));
    if wanted && !validated {
        tracing::warn!("the Vulkan validation layer is wanted, but not installed");
    }
    // SAFETY: the entry is loaded.
    let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
    let debug = validated || extensions.iter().any(|e| e.extension_name_as_c_str() == Ok(ext::debug_utils::NAME));
    let application = vk::ApplicationInfo::default().application_name(c"lumbre").api_version(vk::API_VERSION_1_2);
    let layer_names: Vec<_> = validated.then_some(VALIDATION.as_ptr()).into_iter().collect();
    let extension_names: Vec<_> = debug.then_some(ext::debug_utils::NAME.as_ptr()).into_iter().collect();
    // Missing barriers are what a lax driver hides best.
    let enabled = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&enabled);
    let mut messenger = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION)
        .pfn_user_callback(Some(heard));
    let mut info = vk::InstanceCreateInfo::default()
        .application_info(&application)
        .enabled_layer_names(&layer_names)
        .enabled_extension_names(&extension_names);
    if validated {
        info = info.push_next(&mut features);
    }
    // SAFETY: everything the structure points to lives until the call returns.
    let raw = unsafe { entry.create_instance(&info, None) }.map_err(|result| match result {
        vk::Result::ERROR_INCOMPATIBLE_DRIVER => VulkanError::NoDevice(NO_DRIVER.to_owned()),
        other => call("vkCreateInstance")(other),
    })?;
    if validated {
        messenger.p_next = std::ptr::null();
        let debug_utils = ext::debug_utils::Instance::new(&entry, &raw);
        // SAFETY: the instance has the extension, since the layer provides it; the messenger lives as long.
        unsafe { debug_utils.create_debug_utils_messenger(&messenger, None) }
            .map_err(call("vkCreateDebugUtilsMessengerEXT"))?;
    }
    Ok(Instance { _entry: entry, raw, debug, validated })
}

/// Keeps what the validation layer says.
unsafe extern "system" fn heard(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _kind: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer hands a valid structure, whose text ends with a zero.
    let text = unsafe { (*data).message_as_c_str() }.map(|t| t.to_string_lossy().into_owned()).unwrap_or_default();
    tracing::warn!("Vulkan: {text}");
    MESSAGES.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}
