//! Techniques in shared libraries, which implement the C interface `docs/external/technique.h`. The
//! user names the libraries in the environment variable [`VARIABLE`]; scripts cannot.
//!
//! [`load`] opens the libraries and returns a row for each, to be registered like that of any
//! [technique of one's own](crate::own_technique).

#![allow(
    unsafe_code,
    reason = "calls functions of C libraries that are loaded when the program runs"
)]

mod abi;
mod host;

use std::ffi::{CStr, c_char, c_void};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use libloading::Library;

use abi::{ABI, CHost, CSample, CTechnique};
use host::SampleState;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::integrator::iteration::{
    BeginFn, Iteration, PrepareFn, Resources, Shared, Sharing,
};
use lumbre_light::transport::integrator::{Context, IntegratorRow, SampleFn};
use lumbre_light::transport::sampler::Sampler;
use lumbre_light::value::schema::{Field, Table, Ty};

/// Environment variable that names the libraries, separated as the folders of `PATH` are.
pub const VARIABLE: &str = "LUMBRE_PLUGINS";

/// Greatest number of libraries. Each has functions of its own, since a row has no other data.
const SLOTS: usize = 4;

/// The loaded techniques.
static LOADED: [OnceLock<Loaded>; SLOTS] = [const { OnceLock::new() }; SLOTS];

/// Functions of each slot, for rows.
const FUNCTIONS: [(SampleFn, PrepareFn, BeginFn); SLOTS] = [
    functions::<0>(),
    functions::<1>(),
    functions::<2>(),
    functions::<3>(),
];

/// A technique of a library, as it is registered.
#[derive(Clone, Debug)]
pub struct Plugin {
    /// Row of the technique.
    pub row: IntegratorRow,
    /// File of the library.
    pub file: PathBuf,
    /// Hash of the file's content, in hexadecimal; part of the identity of runs.
    pub hash: String,
}

/// A technique of a library, as samples need it.
struct Loaded {
    begin: Option<unsafe extern "C" fn(*const f64, u64) -> *mut c_void>,
    end: Option<unsafe extern "C" fn(*mut c_void)>,
    sample: unsafe extern "C" fn(*const CHost, CSample, *const c_void),
    parameters: &'static [Parameter],
    /// Keeps the library loaded until the process ends.
    _library: Library,
}

/// A parameter with its default.
struct Parameter {
    field: Field,
    default: f32,
}

/// Data of an iteration, which the library computed, and the values of the parameters.
struct IterationData {
    pointer: *mut c_void,
    end: Option<unsafe extern "C" fn(*mut c_void)>,
    parameters: Arc<Vec<f64>>,
}

// SAFETY: the header requires that the data of an iteration may be read from many threads at a time,
// and freed from another one.
unsafe impl Send for IterationData {}
// SAFETY: as above.
unsafe impl Sync for IterationData {}

impl Drop for IterationData {
    fn drop(&mut self) {
        if let Some(end) = self.end.filter(|_| !self.pointer.is_null()) {
            // SAFETY: the library returned this pointer, and it is freed once.
            unsafe { end(self.pointer) };
        }
    }
}

/// Loads the libraries that the environment variable [`VARIABLE`] names, in order. Called once.
///
/// # Errors
/// Returns a message if one is no library, has no technique, or implements another version of the
/// interface.
pub fn load_named() -> Result<Vec<Plugin>, String> {
    let Some(named) = std::env::var_os(VARIABLE) else {
        return Ok(Vec::new());
    };
    let files = std::env::split_paths(&named).filter(|file| !file.as_os_str().is_empty());
    let files: Vec<PathBuf> = files.collect();
    if files.len() > SLOTS {
        return Err(format!(
            "{VARIABLE} names {} libraries, but at most {SLOTS} can be loaded",
            files.len()
        ));
    }
    let load = |(slot, file): (usize, &PathBuf)| {
        load(slot, file).map_err(|reason| format!("{VARIABLE}: {}: {reason}", file.display()))
    };
    files.iter().enumerate().map(load).collect()
}

/// Loads a library into a slot.
fn load(slot: usize, file: &Path) -> Result<Plugin, String> {
    // A name without a folder would be looked for among the libraries of the system.
    let file = file.canonicalize().map_err(|e| e.to_string())?;
    let content = std::fs::read(&file).map_err(|e| e.to_string())?;
    let hash = blake3::hash(&content).to_hex().to_string();
    // SAFETY: the user named the library to run its code, as that of any program that the user runs.
    let library = unsafe { Library::new(&file) }
        .map_err(|e| format!("this is no shared library that can be loaded: {e}"))?;
    let missing = |name: &str| format!("the library has no function `{name}`: see technique.h");
    // SAFETY: the type is that of the function in every version of the header.
    let version = unsafe {
        library
            .get::<unsafe extern "C" fn() -> u32>(b"lumbre_technique_abi\0")
            .map_err(|_| missing("lumbre_technique_abi"))?()
    };
    if version != ABI {
        return Err(format!(
            "the library implements version {version} of technique.h, and this program version \
             {ABI}: build it with the header of this program"
        ));
    }
    // SAFETY: the type is that of the function in this version of the header.
    let described = unsafe {
        library
            .get::<unsafe extern "C" fn() -> *const CTechnique>(b"lumbre_technique_describe\0")
            .map_err(|_| missing("lumbre_technique_describe"))?()
    };
    // SAFETY: the header requires a description that stays valid, or null.
    let described = unsafe { described.as_ref() }.ok_or("the library describes no technique")?;
    let (row, loaded) = read_description(slot, described, library)?;
    if LOADED[slot].set(loaded).is_err() {
        return Err("libraries are loaded once".to_owned());
    }
    Ok(Plugin { row, file, hash })
}

/// Returns the row of a technique, and what its samples need.
fn read_description(
    slot: usize,
    described: &CTechnique,
    library: Library,
) -> Result<(IntegratorRow, Loaded), String> {
    let parameters = parameters(described)?;
    let fields: Vec<Field> = parameters.iter().map(|parameter| parameter.field).collect();
    let name = text(described.name, "name")?;
    let sample = described
        .sample
        .ok_or("the technique has no function `sample`")?;
    let (sample_fn, prepare, begin) = FUNCTIONS[slot];
    let row = IntegratorRow {
        name,
        long_name: text(described.long_name, "long_name")?,
        revision: described.revision,
        doc: text(described.doc, "doc")?,
        params: Table {
            name: leak(format!("Params_{name}")),
            doc: leak(format!("Parameters of `{name}`.")),
            fields: fields.leak(),
        },
        splats: false,
        bias: if described.bias.is_null() {
            None
        } else {
            Some(text(described.bias, "bias")?)
        },
        sharing: Some(Sharing {
            prepare,
            begin,
            vertex_bytes: 0,
            batch: Some(0),
            fixed_bytes: |_| 0,
            constant_from: match described.begin_iteration {
                None => Some(|_| 0),
                Some(_) => None,
            },
            recorded: None,
        }),
        sample: sample_fn,
    };
    let loaded = Loaded {
        begin: described.begin_iteration,
        end: described.end_iteration,
        sample,
        parameters: parameters.leak(),
        _library: library,
    };
    Ok((row, loaded))
}

/// Returns the parameters of a technique.
fn parameters(described: &CTechnique) -> Result<Vec<Parameter>, String> {
    let count = described.parameter_count as usize;
    if count == 0 {
        return Ok(Vec::new());
    }
    if described.parameters.is_null() || count > 100 {
        return Err("the technique has no list of its parameters, or more than 100".to_owned());
    }
    // SAFETY: the header requires this number of parameters.
    let all = unsafe { std::slice::from_raw_parts(described.parameters, count) };
    let parameter = |parameter: &abi::CParameter| {
        let key = text(parameter.key, "key")?;
        let (min, max, value) = (parameter.min, parameter.max, parameter.value);
        if !(min.is_finite() && max.is_finite() && (min..=max).contains(&value)) {
            return Err(format!(
                "the default {value} of the parameter `{key}` is not in its range {min} to {max}"
            ));
        }
        let doc = text(parameter.doc, "doc")?;
        let default = leak(value.to_string());
        Ok(Parameter {
            field: Field::optional(key, Ty::Num { min, max }, default, doc),
            default: value as f32,
        })
    };
    all.iter().map(parameter).collect()
}

/// Returns a copy of a text of the description that is never freed.
fn text(pointer: *const c_char, what: &str) -> Result<&'static str, String> {
    if pointer.is_null() {
        return Err(format!("the technique has no `{what}`"));
    }
    // SAFETY: the header requires a text that ends with zero.
    let text = unsafe { CStr::from_ptr(pointer) };
    match text.to_str() {
        Ok(text) if !text.is_empty() && !text.contains(char::is_control) => {
            Ok(leak(text.to_owned()))
        }
        _ => Err(format!(
            "the `{what}` of the technique is empty, not UTF-8, or has control characters"
        )),
    }
}

/// Returns a text for the rest of the process, in which rows live.
fn leak(text: String) -> &'static str {
    text.leak()
}

/// Returns the functions of a slot.
const fn functions<const SLOT: usize>() -> (SampleFn, PrepareFn, BeginFn) {
    (sample::<SLOT>, prepare::<SLOT>, begin::<SLOT>)
}

/// Returns the technique of a slot.
///
/// # Panics
/// Panics if there is none; then no row has the functions of the slot.
fn loaded(slot: usize) -> &'static Loaded {
    LOADED[slot]
        .get()
        .expect("rows of libraries exist only after loading")
}

/// Returns the values of a job's parameters.
fn prepare<const SLOT: usize>(resources: &Resources) -> Box<Shared> {
    let values = OnceLock::new();
    resources.workers.for_each(1, &|context: &Context, _| {
        let parameters = loaded(SLOT).parameters.iter();
        let value = |p: &Parameter| f64::from(context.number(&p.field, p.default));
        values.get_or_init(|| parameters.map(value).collect::<Vec<f64>>());
    });
    Box::new(Arc::new(values.into_inner().unwrap_or_default()))
}

/// Lets the library compute the data of an iteration.
fn begin<const SLOT: usize>(iteration: &Iteration) -> Box<Shared> {
    let parameters: &Arc<Vec<f64>> = iteration.prepared();
    let Loaded { begin, end, .. } = loaded(SLOT);
    let pointer = begin.map_or(std::ptr::null_mut(), |begin| {
        // SAFETY: the function gets the number of parameters that the library declares.
        unsafe { begin(parameters.as_ptr(), iteration.index) }
    });
    Box::new(IterationData {
        pointer,
        end: *end,
        parameters: Arc::clone(parameters),
    })
}

/// Lets the library compute a sample.
fn sample<const SLOT: usize>(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    let data: &IterationData = context.shared();
    let mut state = SampleState::new(context, pixel, sampler, sink);
    let host = state.host(&data.parameters);
    // SAFETY: the functions of `host` may be called with the pointer until this call returns, and
    // `state` is not used before.
    unsafe { (loaded(SLOT).sample)(&raw const host, state.pointer(), data.pointer) };
}
