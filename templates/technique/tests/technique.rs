//! What must hold for a technique: `Trial` renders small pictures with fixed seeds and compares
//! them. A test that fails says what differs. Paths have at most 5 edges, unless `Trial::max_depth`
//! sets another number.

use lumbre::Trial;
use own_technique::{CONNECT, TECHNIQUE};

/// Returns the technique with a value of its parameter.
fn trial(connect: f64) -> Trial {
    Trial::new(&TECHNIQUE, &[(CONNECT.key, connect.into())]).expect("a value in the range")
}

#[test]
fn the_radiance_in_a_furnace_is_the_known_one() {
    trial(0.5).furnace().unwrap();
    trial(1.0).furnace().unwrap();
}

#[test]
fn pictures_agree_with_path_tracing() {
    trial(0.25).agreement("bpt").unwrap();
    trial(1.0).agreement("bpt").unwrap();
}

#[test]
fn pictures_have_the_same_bits_for_any_number_of_threads() {
    trial(0.5).same_bits().unwrap();
}

#[test]
fn another_seed_gives_another_picture() {
    trial(0.5).seeds().unwrap();
}
