//! Open Image Denoise, loaded at run time. Its C interface is that of versions 2 and later.

#![allow(
    unsafe_code,
    reason = "calls a C library that is loaded when the program runs"
)]

use std::ffi::{CStr, OsString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::{Arc, Mutex, PoisonError};

use libloading::Library;

use lumbre_light::film::Image;

/// Environment variable that names the library, or the folder that contains it.
pub const VARIABLE: &str = "LUMBRE_OIDN";

/// Kind of device that runs on the processor.
const CPU_DEVICE: c_int = 1;

/// Pixel format of three floats.
const FLOAT3: c_int = 3;

/// Oldest version whose interface is used, as the library counts it: 10,000 major + 100 minor.
const OLDEST: c_int = 20_000;

type Device = *mut c_void;
type FilterHandle = *mut c_void;

/// Functions of the library. The pointers stay valid while the library is loaded.
struct Api {
    new_device: unsafe extern "C" fn(c_int) -> Device,
    set_device_int: unsafe extern "C" fn(Device, *const c_char, c_int),
    set_device_bool: unsafe extern "C" fn(Device, *const c_char, bool),
    get_device_int: unsafe extern "C" fn(Device, *const c_char) -> c_int,
    commit_device: unsafe extern "C" fn(Device),
    get_error: unsafe extern "C" fn(Device, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Device),
    new_filter: unsafe extern "C" fn(Device, *const c_char) -> FilterHandle,
    set_image: SetImage,
    set_filter_bool: unsafe extern "C" fn(FilterHandle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(FilterHandle),
    execute: unsafe extern "C" fn(FilterHandle),
    release_filter: unsafe extern "C" fn(FilterHandle),
    /// Keeps the library loaded.
    _library: Library,
}

/// Type of `oidnSetSharedFilterImage`: filter, name, pixels, format, width, height, and offsets of
/// the first byte, of pixels and of rows.
type SetImage = unsafe extern "C" fn(
    FilterHandle,
    *const c_char,
    *mut c_void,
    c_int,
    usize,
    usize,
    usize,
    usize,
    usize,
);

/// The library, once it is loaded. A failure is not kept, so that it is looked for again.
static LOADED: Mutex<Option<Arc<Api>>> = Mutex::new(None);

/// Returns the version of the library, such as `2.3.1`.
///
/// # Errors
/// Returns a message if the library cannot be loaded or is too old.
pub fn version() -> Result<String, String> {
    let device = DeviceGuard::new(load()?, 1)?;
    let number = device.int(c"version");
    Ok(format!(
        "{}.{}.{}",
        number / 10_000,
        number / 100 % 100,
        number % 100
    ))
}

/// Returns the library.
fn load() -> Result<Arc<Api>, String> {
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(api) = &*loaded {
        return Ok(Arc::clone(api));
    }
    let named = std::env::var_os(VARIABLE).filter(|name| !name.is_empty());
    let mut reasons = Vec::new();
    for candidate in candidates(named.as_deref().map(Path::new)) {
        match Api::open(&candidate) {
            Ok(api) => return Ok(Arc::clone(loaded.insert(Arc::new(api)))),
            Err(reason) => reasons.push(format!("{}: {reason}", candidate.to_string_lossy())),
        }
    }
    Err(format!(
        "Open Image Denoise was not found: install it and name its library or the folder of its \
         library in the environment variable {VARIABLE} ({})",
        reasons.join("; ")
    ))
}

/// Returns the names under which the library is looked for: `named` or in the folder `named`, else
/// where the system looks for libraries.
fn candidates(named: Option<&Path>) -> Vec<OsString> {
    let names: &[&str] = if cfg!(target_os = "windows") {
        &["OpenImageDenoise.dll"]
    } else if cfg!(target_os = "macos") {
        &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
    } else {
        &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
    };
    match named {
        Some(folder) if folder.is_dir() => names
            .iter()
            .map(|name| folder.join(name).into_os_string())
            .collect(),
        Some(file) => vec![PathBuf::from(file).into_os_string()],
        None => names.iter().map(OsString::from).collect(),
    }
}

impl Api {
    fn open(name: &OsString) -> Result<Api, String> {
        // SAFETY: the initialisers of the library that the user installed are trusted, as those of
        // any program that the user runs.
        let library = unsafe { Library::new(name) }.map_err(|e| e.to_string())?;
        macro_rules! function {
            ($name:literal) => {
                // SAFETY: the type is that of the function in the header of version 2.
                unsafe { *library.get($name).map_err(|e| e.to_string())? }
            };
        }
        Ok(Api {
            new_device: function!(b"oidnNewDevice\0"),
            set_device_int: function!(b"oidnSetDeviceInt\0"),
            set_device_bool: function!(b"oidnSetDeviceBool\0"),
            get_device_int: function!(b"oidnGetDeviceInt\0"),
            commit_device: function!(b"oidnCommitDevice\0"),
            get_error: function!(b"oidnGetDeviceError\0"),
            release_device: function!(b"oidnReleaseDevice\0"),
            new_filter: function!(b"oidnNewFilter\0"),
            set_image: function!(b"oidnSetSharedFilterImage\0"),
            set_filter_bool: function!(b"oidnSetFilterBool\0"),
            commit_filter: function!(b"oidnCommitFilter\0"),
            execute: function!(b"oidnExecuteFilter\0"),
            release_filter: function!(b"oidnReleaseFilter\0"),
            _library: library,
        })
    }
}

/// Device of the library on the processor. It is released when the guard is dropped.
struct DeviceGuard {
    api: Arc<Api>,
    device: NonNull<c_void>,
}

impl DeviceGuard {
    /// Opens the processor with this number of threads; 0 means one for each core.
    fn new(api: Arc<Api>, threads: usize) -> Result<DeviceGuard, String> {
        // SAFETY: the function takes any number and returns null if there is no such device.
        let device = unsafe { (api.new_device)(CPU_DEVICE) };
        let device = NonNull::new(device).ok_or("Open Image Denoise cannot use this processor")?;
        let guard = DeviceGuard { api, device };
        let threads = c_int::try_from(threads).unwrap_or(c_int::MAX);
        // SAFETY: the device is valid and the names are null-terminated.
        unsafe {
            let api = &guard.api;
            (api.set_device_int)(guard.device.as_ptr(), c"numThreads".as_ptr(), threads);
            (api.set_device_bool)(guard.device.as_ptr(), c"setAffinity".as_ptr(), false);
            (api.commit_device)(guard.device.as_ptr());
        }
        guard.check()?;
        let version = guard.int(c"version");
        if version < OLDEST {
            return Err(format!(
                "Open Image Denoise {}.{} is too old: install version 2 or later",
                version / 10_000,
                version / 100 % 100
            ));
        }
        Ok(guard)
    }

    /// Returns a number that the device knows by name.
    fn int(&self, name: &CStr) -> c_int {
        // SAFETY: the device is valid and the name is null-terminated.
        unsafe { (self.api.get_device_int)(self.device.as_ptr(), name.as_ptr()) }
    }

    /// Returns the first error since the last call as a message.
    fn check(&self) -> Result<(), String> {
        let mut message: *const c_char = std::ptr::null();
        // SAFETY: the device is valid; the message is valid until the next call of this thread.
        let text = unsafe {
            if (self.api.get_error)(self.device.as_ptr(), &raw mut message) == 0 {
                return Ok(());
            }
            if message.is_null() {
                "unknown error".to_owned()
            } else {
                CStr::from_ptr(message).to_string_lossy().into_owned()
            }
        };
        Err(format!("Open Image Denoise failed: {text}"))
    }
}

impl Drop for DeviceGuard {
    fn drop(&mut self) {
        // SAFETY: the device is valid and is not used afterwards.
        unsafe { (self.api.release_device)(self.device.as_ptr()) }
    }
}

/// Image that the filter reads or writes, `[y][x][rgb]`. Its address does not change.
type Pixels = Box<[[f32; 3]]>;

/// The filter for ray-traced pictures, for one size of picture.
pub struct OidnFilter {
    /// Declared before the device, which must be released after it; see [`Drop`].
    filter: NonNull<c_void>,
    device: DeviceGuard,
    size: [u32; 2],
    /// Colour, albedo and normal.
    inputs: [Pixels; 3],
    output: Pixels,
}

// SAFETY: the handles are not bound to a thread: the library's functions may be called from any
// thread, and this struct is used by one at a time.
unsafe impl Send for OidnFilter {}

impl OidnFilter {
    /// Prepares the filter for pictures of a size in pixels, on `threads` threads; 0 means one for
    /// each core.
    ///
    /// # Errors
    /// Returns a message if the library cannot be loaded or refuses the size.
    pub fn new(size: [u32; 2], threads: usize) -> Result<OidnFilter, String> {
        let device = DeviceGuard::new(load()?, threads)?;
        // SAFETY: the device is valid and the name is null-terminated.
        let filter = unsafe { (device.api.new_filter)(device.device.as_ptr(), c"RT".as_ptr()) };
        let Some(filter) = NonNull::new(filter) else {
            device.check()?;
            return Err("Open Image Denoise has no filter for ray-traced pictures".to_owned());
        };
        let [width, height] = size.map(|n| n as usize);
        let pixels = || vec![[0.0f32; 3]; width * height].into_boxed_slice();
        let mut new = OidnFilter {
            filter,
            device,
            size,
            inputs: [pixels(), pixels(), pixels()],
            output: pixels(),
        };
        let [colour, albedo, normal] = &mut new.inputs;
        let images = [
            (c"color", colour),
            (c"albedo", albedo),
            (c"normal", normal),
            (c"output", &mut new.output),
        ];
        let api = &new.device.api;
        for (name, image) in images {
            let pixels = image.as_mut_ptr().cast();
            // SAFETY: the image has `width * height` pixels of this format, and the filter is
            // released before its memory.
            unsafe {
                (api.set_image)(
                    filter.as_ptr(),
                    name.as_ptr(),
                    pixels,
                    FLOAT3,
                    width,
                    height,
                    0,
                    0,
                    0,
                );
            }
        }
        // SAFETY: the filter is valid and the name is null-terminated.
        unsafe {
            (api.set_filter_bool)(filter.as_ptr(), c"hdr".as_ptr(), true);
            (api.commit_filter)(filter.as_ptr());
        }
        new.device.check()?;
        Ok(new)
    }

    /// Denoises a picture in linear radiance, guided by albedo and normals, which may be noisy.
    ///
    /// # Errors
    /// Returns the message of the library.
    ///
    /// # Panics
    /// Panics if an image has another size than the filter.
    pub fn run(&mut self, colour: &Image, albedo: &Image, normal: &Image) -> Result<Image, String> {
        for (input, image) in self.inputs.iter_mut().zip([colour, albedo, normal]) {
            input.copy_from_slice(&image.data);
        }
        // SAFETY: the filter is committed and its images are valid.
        unsafe { (self.device.api.execute)(self.filter.as_ptr()) };
        self.device.check()?;
        Ok(Image::from_pixels(
            self.size[0],
            self.size[1],
            self.output.to_vec(),
        ))
    }
}

impl Drop for OidnFilter {
    fn drop(&mut self) {
        // SAFETY: the filter is valid and is not used afterwards; device and images are dropped
        // after it.
        unsafe { (self.device.api.release_filter)(self.filter.as_ptr()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_or_a_file_can_be_named() {
        let folder = tempfile::tempdir().unwrap();
        let inside = candidates(Some(folder.path()));
        assert!(
            inside
                .iter()
                .all(|name| Path::new(name).starts_with(folder.path()))
        );
        let file = folder.path().join("libsome.so");
        assert_eq!(candidates(Some(&file)), [file.into_os_string()]);
        assert!(
            candidates(None)
                .iter()
                .all(|name| Path::new(name).is_relative())
        );
    }

    #[test]
    fn a_library_that_is_none_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("libOpenImageDenoise.so.2");
        std::fs::write(&file, "no library").unwrap();
        assert!(Api::open(&file.into_os_string()).is_err());
    }
}
