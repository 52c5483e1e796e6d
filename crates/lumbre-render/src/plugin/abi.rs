//! The C interface of techniques in shared libraries, version [`ABI`]. Every type is the twin of the
//! one in `docs/external/technique.h`, which documents it.

use std::ffi::{c_char, c_void};

/// Version of the interface. Raised whenever a type or the meaning of a function changes.
pub const ABI: u32 = 2;

/// The C type `lumbre_ray`.
#[repr(C)]
pub struct CRay {
    pub origin: [f32; 3],
    pub dir: [f32; 3],
}

/// The C type `lumbre_surface`.
#[repr(C)]
pub struct CSurface {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub emits: i32,
    pub ends: i32,
    pub has_density: i32,
}

/// The C type `lumbre_bsdf_sample`.
#[repr(C)]
pub struct CBsdfSample {
    pub wi: [f32; 3],
    pub weight: [f32; 3],
    pub pdf: f32,
    pub eta: f32,
    pub delta: i32,
}

/// The C type `lumbre_light_sample`.
#[repr(C)]
pub struct CLightSample {
    pub wi: [f32; 3],
    pub distance: f32,
    pub radiance: [f32; 3],
    pub pdf: f32,
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub extent: f32,
    pub delta: i32,
}

/// `lumbre_sample`: the state of a sample in the host.
pub type CSample = *mut c_void;

/// `lumbre_vertex`: a point of a surface, which the host keeps until the sample ends.
pub type CVertex = *const c_void;

/// `lumbre_host`: the functions that a technique may call during a sample.
#[repr(C)]
pub struct CHost {
    pub abi: u32,
    pub max_depth: u32,
    pub rr_start: u32,
    pub parameters: *const f64,
    pub camera_ray: unsafe extern "C" fn(CSample, *mut CRay),
    pub closest: unsafe extern "C" fn(CSample, *const CRay, *mut CSurface) -> CVertex,
    pub occluded: unsafe extern "C" fn(CSample, CVertex, *const CLightSample) -> i32,
    pub next_1d: unsafe extern "C" fn(CSample) -> f32,
    pub next_2d: unsafe extern "C" fn(CSample, *mut f32),
    pub bsdf_sample: unsafe extern "C" fn(CSample, CVertex, *mut CBsdfSample) -> i32,
    pub bsdf_evaluate: unsafe extern "C" fn(CSample, CVertex, *const f32, *mut f32) -> f32,
    pub leave: unsafe extern "C" fn(CSample, CVertex, *const f32, *mut CRay),
    pub light_sample: unsafe extern "C" fn(CSample, CVertex, *mut CLightSample) -> i32,
    pub light_pdf: unsafe extern "C" fn(CSample, CVertex, CVertex) -> f32,
    pub emission: unsafe extern "C" fn(CSample, CVertex, *mut f32),
    pub environment: unsafe extern "C" fn(CSample, *const f32, *mut f32) -> f32,
    pub add: unsafe extern "C" fn(CSample, *const f32, u32, u32),
}

/// The C type `lumbre_parameter`.
#[repr(C)]
pub struct CParameter {
    pub key: *const c_char,
    pub doc: *const c_char,
    pub min: f64,
    pub max: f64,
    pub value: f64,
}

/// `lumbre_technique`: the description of a technique.
#[repr(C)]
pub struct CTechnique {
    pub name: *const c_char,
    pub long_name: *const c_char,
    pub doc: *const c_char,
    pub bias: *const c_char,
    pub revision: u32,
    pub parameter_count: u32,
    pub parameters: *const CParameter,
    pub begin_iteration: Option<unsafe extern "C" fn(*const f64, u64) -> *mut c_void>,
    pub end_iteration: Option<unsafe extern "C" fn(*mut c_void)>,
    pub sample: Option<unsafe extern "C" fn(*const CHost, CSample, *const c_void)>,
}
