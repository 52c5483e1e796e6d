//! Names of techniques: those of other crates, and of programs of others.

use lumbre_light::transport::integrator::external::{is_external, is_free_name};
use lumbre_light::transport::integrator::own::{Registered, RegistrationError};
use lumbre_light::transport::integrator::register;
use lumbre_light::transport::integrator::{
    INTEGRATORS, IntegratorRow, bpt, integrator, integrators,
};

/// Returns the row of `bpt` with another name.
fn named(name: &'static str) -> Registered {
    Registered {
        row: IntegratorRow { name, ..bpt::ROW },
        library: None,
    }
}

#[test]
fn invalid_and_taken_names_and_late_registrations_are_refused() {
    for name in [
        "",
        "Mine",
        "2d",
        "a b",
        "../x",
        "external:mine",
        "mine-2",
        "caf\u{e9}",
    ] {
        let refused = register(vec![named(name)]);
        assert_eq!(
            refused,
            Err(RegistrationError::InvalidName(name.to_owned()))
        );
    }
    for name in ["bpt", "pt", "vcm", "external"] {
        let refused = register(vec![named(name)]);
        assert_eq!(refused, Err(RegistrationError::TakenName(name.to_owned())));
    }
    let twice = register(vec![named("mine"), named("mine")]);
    assert_eq!(twice, Err(RegistrationError::TakenName("mine".to_owned())));
    let mut biased = named("mine");
    biased.row.bias = Some("it is a test");
    let hidden = RegistrationError::HiddenBias("mine".to_owned());
    assert_eq!(register(vec![biased]), Err(hidden));
    assert_eq!(integrators().count(), INTEGRATORS.len());
    assert_eq!(
        register(vec![named("mine")]),
        Err(RegistrationError::TooLate)
    );
}

#[test]
fn declared_techniques_have_one_row_and_bridges_their_own() {
    let row = |name: &str| integrator(name).map(|row| row.name);
    assert_eq!(row("external:mitsuba"), Some("external:mitsuba"));
    assert_eq!(row("external:pbrt-v4.1"), Some("external"));
    for name in [
        "external:",
        "external:a b",
        "external:../x",
        "external",
        "pbrt",
    ] {
        assert_eq!(row(name), None, "{name}");
    }
    assert!(is_external(integrator("external:x").unwrap()));
    assert!(!is_free_name("mitsuba") && is_free_name("mitsuba2"));
}
