//! The tests that a technique of one's own has: what is right passes them, what is not does not.

use lumbre_light::value::Value;
use lumbre_render::trial::Trial;

#[test]
fn built_in_techniques_pass_and_another_picture_is_noticed() {
    for name in ["bpt", "nee"] {
        Trial::named(name, &[]).unwrap().furnace().unwrap();
    }
    let nee = Trial::named("nee", &[]).unwrap();
    nee.agreement("bpt").unwrap();
    nee.same_bits().unwrap();
    nee.seeds().unwrap();
    // One strategy of bdpt alone is another picture.
    let pair = Value::List(vec![Value::Int(0), Value::Int(3)]);
    let one = Trial::named("bdpt", &[("strategies", pair)]).unwrap();
    assert!(one.furnace().unwrap_err().contains("instead of"));
    assert!(one.furnace().unwrap_err().contains("up to 5 edges"));
    assert!(one.agreement("bpt").unwrap_err().contains("by bpt"));
    assert!(Trial::named("nee", &[("mis", 3.0.into())]).is_err());
    assert!(nee.agreement("nothing").is_err());
}

#[test]
fn the_depth_holds_for_both_pictures_and_the_closed_form() {
    for edges in [1, 2, 7] {
        let nee = Trial::named("nee", &[]).unwrap().max_depth(edges);
        nee.furnace().unwrap();
        nee.agreement("bpt").unwrap();
    }
    // This strategy has paths of two edges alone, which are all of the direct light.
    let pair = Value::List(vec![Value::Int(1), Value::Int(2)]);
    let direct = Trial::named("bdpt", &[("strategies", pair)]).unwrap();
    let error = direct.max_depth(2).furnace().unwrap_err();
    assert!(error.contains("up to 2 edges"), "{error}");
}
