//! Output as JSON, which every verb that prints data offers by `--json`.

use serde_json::{Value as Json, json};

use super::exit::{Failure, print_result};

/// Version of the output of all verbs. It rises when a field is removed or changes its meaning.
pub const VERSION: u32 = 1;

/// Prints an object with the field `version`.
///
/// # Errors
/// Returns an error if stdout cannot be written.
pub fn print(object: Json) -> Result<(), Failure> {
    print_result(&format!("{:#}\n", versioned(object)))
}

/// Adds the field `version` to an object.
pub fn versioned(mut object: Json) -> Json {
    if let Some(fields) = object.as_object_mut() {
        fields.insert("version".to_owned(), json!(VERSION));
    }
    object
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_have_a_version() {
        assert_eq!(
            versioned(json!({ "a": 2 })),
            json!({ "a": 2, "version": 1 })
        );
    }
}
