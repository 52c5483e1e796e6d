//! Registration of the techniques of a program of one's own.

use std::path::PathBuf;
use std::sync::OnceLock;

use crate::cli::format::display_path;
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_lua::RENDER;
use lumbre_render::own_technique::{self, OwnTechnique};
use lumbre_render::plugin::{self, Plugin};

/// The techniques of shared libraries.
static PLUGINS: OnceLock<Vec<Plugin>> = OnceLock::new();

/// Checks and registers techniques, and those of shared libraries. Returns the reason if one cannot be used.
pub(super) fn register(techniques: &[OwnTechnique]) -> Result<(), String> {
    let plugins = plugin::load_named()?;
    let rows = techniques.iter().map(OwnTechnique::row);
    rows.chain(plugins.iter().map(|plugin| &plugin.row))
        .try_for_each(check)?;
    own_technique::register(techniques, &plugins).map_err(|e| e.to_string())?;
    let _ = PLUGINS.set(plugins);
    Ok(())
}

/// Returns a line for each technique of a shared library: its name, file and hash.
pub(super) fn libraries() -> Vec<String> {
    let plugins = PLUGINS.get().map_or(&[][..], Vec::as_slice);
    let line = |plugin: &Plugin| {
        format!(
            "technique {} of the library {} ({})",
            plugin.row.name,
            display_path(&plugin.file),
            &plugin.hash[..8]
        )
    };
    plugins.iter().map(line).collect()
}

/// Returns the absolute paths of the shared libraries with techniques.
pub(super) fn files() -> Vec<PathBuf> {
    let plugins = PLUGINS.get().map_or(&[][..], Vec::as_slice);
    plugins.iter().map(|plugin| plugin.file.clone()).collect()
}

/// Returns the error if a parameter of a technique is a key of the render table, or occurs twice, or
/// if a text that tables and the reference show is empty.
fn check(row: &IntegratorRow) -> Result<(), String> {
    let name = row.name;
    if row.long_name.is_empty() || row.doc.is_empty() {
        return Err(format!("`{name}` needs a long_name and a doc"));
    }
    for (i, field) in row.params.fields.iter().enumerate() {
        let key = field.key;
        if RENDER.fields.iter().any(|other| other.key == key) {
            return Err(format!(
                "the parameter `{key}` of `{name}` is a key of every render table: give it another \
                 name"
            ));
        }
        if row.params.fields[..i].iter().any(|other| other.key == key) {
            return Err(format!("`{name}` has two parameters `{key}`"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::transport::integrator::{INTEGRATORS, nee};
    use lumbre_light::value::schema::{Field, Table, Ty};

    #[test]
    fn built_in_rows_pass_and_parameters_that_are_taken_are_named() {
        assert!(INTEGRATORS.iter().all(|row| check(row).is_ok()));
        const TAKEN: Field = Field::optional("rr", Ty::Bool, "false", "taken");
        const MINE: Field = Field::optional("mine", Ty::Bool, "false", "free");
        let with = |fields| {
            check(&IntegratorRow {
                params: Table {
                    fields,
                    ..nee::ROW.params
                },
                ..nee::ROW
            })
        };
        assert!(with(&[TAKEN]).unwrap_err().contains("`rr` of `nee`"));
        assert!(
            with(&[MINE, MINE])
                .unwrap_err()
                .contains("two parameters `mine`")
        );
        assert!(with(&[MINE]).is_ok());
        let undescribed = IntegratorRow {
            doc: "",
            ..nee::ROW
        };
        assert!(check(&undescribed).unwrap_err().contains("a doc"));
    }
}
