//! Schema of the render table: the keys that a script's `render` function may return.

use lumbre_light::value::schema::{Field, Table, Ty};
use lumbre_night::backends::BACKENDS;
use lumbre_render::settings::SETTINGS;

/// Names of the backends, for the annotations.
pub const BACKEND_NAMES: [&str; BACKENDS.len() + 1] = {
    let mut names = ["auto"; BACKENDS.len() + 1];
    let mut i = 0;
    while i < BACKENDS.len() {
        names[i + 1] = BACKENDS[i].name;
        i += 1;
    }
    names
};

/// Keys of the render table: those of [`SETTINGS`], with the names of the backends.
const FIELDS: [Field; SETTINGS.len()] = {
    let mut fields = [SETTINGS[0].field; SETTINGS.len()];
    let mut i = 0;
    while i < fields.len() {
        fields[i] = SETTINGS[i].field;
        if matches!(fields[i].key.as_bytes(), b"backend") {
            fields[i].ty = Ty::Word(&BACKEND_NAMES);
        }
        i += 1;
    }
    fields
};

/// Table that the render function returns, without the integrators' own parameters.
pub const RENDER: Table = Table {
    name: "Render",
    doc: "Settings of one cell. The integrator's own parameters are keys of the same table.",
    fields: &FIELDS,
};
