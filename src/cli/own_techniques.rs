//! Registration of the techniques of a program of one's own.

use crate::script::RENDER;
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_render::own_technique::{self, OwnTechnique};

/// Checks and registers techniques. Returns the reason if one cannot be used.
pub(super) fn register(techniques: &[OwnTechnique]) -> Result<(), String> {
    techniques
        .iter()
        .try_for_each(|technique| check(technique.row()))?;
    own_technique::register(techniques).map_err(|e| e.to_string())
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
