//! The Vulkan instance: loader, validation layers, debug messages.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex};

use ash::vk;

use crate::{Error, Result};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";
const CAPTURE_LAYER: &CStr = c"VK_LAYER_RENDERDOC_Capture";
/// What is said where the loader is missing.
const NO_LOADER: &str = if cfg!(target_os = "macos") {
    "no Vulkan loader (libvulkan.dylib): install vulkan-loader and molten-vk, or the Vulkan SDK"
} else if cfg!(windows) {
    "no Vulkan loader (vulkan-1.dll): install the driver of your GPU"
} else {
    "no Vulkan loader (libvulkan.so.1): install libvulkan1 and a driver, mesa-vulkan-drivers for one that needs no GPU"
};

/// Messages of the validation layers, in the order they came.
pub(super) type Messages = Arc<Mutex<Vec<String>>>;

/// An instance and what hangs on it.
pub struct Instance {
    // Keeps the loader in memory for as long as its functions are called.
    _entry: ash::Entry,
    pub(super) raw: ash::Instance,
    pub(super) debug_utils: bool,
    pub(super) messages: Messages,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    owned: bool,
}

impl Instance {
    /// Loads Vulkan and makes an instance, with the validation layers (core and synchronisation) if requested.
    ///
    /// # Errors
    /// Where there is no loader, or the layers were requested and are not installed; the message names what to install.
    pub fn new(validation: bool) -> Result<Self> {
        Self::with_layers(validation, false)
    }

    /// The same, with RenderDoc's layer too if captures are wanted.
    pub(super) fn with_layers(validation: bool, capture: bool) -> Result<Self> {
        // SAFETY: loading the system's Vulkan loader runs its initialisers; it has no other preconditions.
        let entry = unsafe { ash::Entry::load() }.map_err(|_| Error::NoDevice(NO_LOADER.into()))?;
        // SAFETY: `entry` is a loaded Vulkan library; the same holds for each call on it below.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap_or_default();
        let missing = |name| !layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(name));
        if validation && missing(VALIDATION_LAYER) {
            return Err(Error::NoDevice(
                "the validation layers are not installed: install vulkan-validationlayers".into(),
            ));
        }
        if capture && missing(CAPTURE_LAYER) {
            return Err(Error::NoDevice(
                "RenderDoc's Vulkan layer is not registered: see what `renderdoccmd vulkanlayer` says".into(),
            ));
        }
        // SAFETY: no layer's name is given, and the loader fills the list.
        let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }.unwrap_or_default();
        let has = |name| extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
        let debug_utils = has(ash::ext::debug_utils::NAME);
        // Without it the loader hides drivers that are Vulkan by translation, such as MoltenVK.
        let portability = has(ash::khr::portability_enumeration::NAME);

        let application = vk::ApplicationInfo::default()
            .application_name(c"camsplat")
            .engine_name(c"camsplat")
            .api_version(vk::API_VERSION_1_2);
        let layer_names: Vec<_> = [(validation, VALIDATION_LAYER), (capture, CAPTURE_LAYER)]
            .into_iter()
            .filter_map(|(wanted, name)| wanted.then_some(name.as_ptr()))
            .collect();
        let wanted =
            [(debug_utils, ash::ext::debug_utils::NAME), (portability, ash::khr::portability_enumeration::NAME)];
        let extension_names: Vec<_> =
            wanted.iter().filter(|(there, _)| *there).map(|(_, name)| name.as_ptr()).collect();
        let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
        let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
        let messages = Messages::default();
        let mut messenger_info = messenger_info(&messages);
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .flags(match portability {
                true => vk::InstanceCreateFlags::ENUMERATE_PORTABILITY_KHR,
                false => vk::InstanceCreateFlags::empty(),
            })
            .enabled_layer_names(&layer_names)
            .enabled_extension_names(&extension_names);
        if validation {
            info = info.push_next(&mut features);
            if debug_utils {
                info = info.push_next(&mut messenger_info);
            }
        }
        // SAFETY: every pointer in `info` outlives the call.
        let raw = unsafe { entry.create_instance(&info, None) }.map_err(|code| match code {
            vk::Result::ERROR_INCOMPATIBLE_DRIVER => no_driver(),
            vk::Result::ERROR_LAYER_NOT_PRESENT | vk::Result::ERROR_EXTENSION_NOT_PRESENT if capture => {
                Error::NoDevice(
                    "RenderDoc could not take the capture: its layer is switched off or broken; see `renderdoccmd vulkanlayer`".into(),
                )
            }
            code => Error::Vulkan { what: "vkCreateInstance", code },
        })?;
        let messenger = if validation && debug_utils {
            let functions = ash::ext::debug_utils::Instance::new(&entry, &raw);
            let info = self::messenger_info(&messages);
            // SAFETY: the user data behind `info` is `messages`, which lives as long as the messenger: see `drop`.
            let handle = unsafe { functions.create_debug_utils_messenger(&info, None) }
                .map_err(|code| Error::Vulkan { what: "vkCreateDebugUtilsMessengerEXT", code })?;
            Some((functions, handle))
        } else {
            None
        };
        Ok(Self { _entry: entry, raw, debug_utils, messages, messenger, owned: true })
    }

    /// Wraps a host application's instance, which stays the host's to destroy.
    pub(super) fn adopt(entry: ash::Entry, raw: ash::Instance, debug_utils: bool) -> Self {
        Self { _entry: entry, raw, debug_utils, messages: Messages::default(), messenger: None, owned: false }
    }

    /// Every physical device, in the driver's order.
    ///
    /// # Errors
    /// Where no driver is installed; the message names the package that brings lavapipe.
    pub fn physical_devices(&self) -> Result<Vec<vk::PhysicalDevice>> {
        // SAFETY: `raw` is a live instance.
        let devices = unsafe { self.raw.enumerate_physical_devices() }
            .map_err(|code| Error::Vulkan { what: "vkEnumeratePhysicalDevices", code })?;
        if devices.is_empty() { Err(no_driver()) } else { Ok(devices) }
    }
}

fn no_driver() -> Error {
    Error::NoDevice(
        "no Vulkan driver: install your GPU's, or mesa-vulkan-drivers for lavapipe, which needs no GPU".into(),
    )
}

fn messenger_info(messages: &Messages) -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(vk::DebugUtilsMessageSeverityFlagsEXT::WARNING | vk::DebugUtilsMessageSeverityFlagsEXT::ERROR)
        .message_type(vk::DebugUtilsMessageTypeFlagsEXT::VALIDATION | vk::DebugUtilsMessageTypeFlagsEXT::PERFORMANCE)
        .pfn_user_callback(Some(on_message))
        .user_data(Arc::as_ptr(messages).cast_mut().cast())
}

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: `user` is the `Mutex` behind `Instance::messages`, alive until the messenger is destroyed, and the layer
    // passes a valid `data` whose message, where there is one, ends in NUL.
    unsafe {
        let messages = &*user.cast::<Mutex<Vec<String>>>();
        let text = (*data).message_as_c_str().map(|text| text.to_string_lossy().into_owned());
        if let (Some(text), Ok(mut messages)) = (text, messages.lock()) {
            messages.push(text);
        }
    }
    vk::FALSE
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: the context that owns this instance destroys its device first; an adopted instance is the host's.
        unsafe {
            if let Some((functions, handle)) = self.messenger.take() {
                functions.destroy_debug_utils_messenger(handle, None);
            }
            if self.owned {
                self.raw.destroy_instance(None);
            }
        }
    }
}
