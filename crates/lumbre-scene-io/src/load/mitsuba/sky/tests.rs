//! Parameters of suns and skies, their ranges, axes and notes.

use super::*;
use crate::load::MissingTextures;
use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::Texels;

/// Loads a scene of a version with one emitter.
fn load(version: &str, plugin: &str, inner: &str) -> Result<(SceneDesc, String), String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xml");
    let text = format!(
        "<scene version=\"{version}\"><emitter type=\"{plugin}\">{inner}</emitter></scene>"
    );
    std::fs::write(&path, text).unwrap();
    image::GrayImage::from_pixel(2, 2, image::Luma([255]))
        .save(folder.path().join("white.png"))
        .unwrap();
    let loaded = crate::load::mitsuba::load(&path, MissingTextures::Fail);
    let (desc, notes) = loaded.map_err(|e| e.to_string())?;
    let lines = notes
        .iter()
        .map(|n| format!("{}: {}\n", n.place, n.message));
    Ok((desc, lines.collect()))
}

/// Returns the map of a scene, and its texels.
fn map_of(desc: &SceneDesc) -> (&TextureDesc, &[[f32; 4]]) {
    let Some(EnvironmentSource::Map(map)) = desc.environment.as_ref().map(|e| &e.source) else {
        panic!("a map expected")
    };
    let Texels::RgbaF32(texels) = &map.texels else {
        panic!("floats expected")
    };
    (map, texels)
}

/// Returns the direction of the brightest texel, and the sum of the radiance over all directions.
fn brightest(desc: &SceneDesc) -> (DVec3, DVec3) {
    let (map, texels) = map_of(desc);
    let (width, height) = (f64::from(map.width), f64::from(map.height));
    let (mut peak, mut towards, mut power) = (0.0, DVec3::ZERO, DVec3::ZERO);
    for (i, t) in texels.iter().enumerate() {
        let (x, y) = (i % map.width as usize, i / map.width as usize);
        let (u, v) = ((x as f64 + 0.5) / width, (y as f64 + 0.5) / height);
        let d = crate::load::environment::direction(u, v);
        let area = 2.0 * std::f64::consts::PI.powi(2) / (width * height);
        power += DVec3::new(t[0].into(), t[1].into(), t[2].into())
            * (area * (std::f64::consts::PI * v).sin());
        if t[0] > peak {
            (peak, towards) = (t[0], d);
        }
    }
    (towards, power)
}

const DIRECTION: &str = "<vector name=\"sun_direction\" x=\"0.3\" y=\"0.8\" z=\"0.5\"/>";

#[test]
fn the_sun_is_in_its_direction_in_the_axes_of_the_scene() {
    let turned = "<transform name=\"to_world\"><rotate x=\"1\" angle=\"-50\"/>\
                  <rotate y=\"1\" angle=\"70\"/></transform>";
    let no_sky = "<float name=\"sky_scale\" value=\"0\"/>";
    let expected = DVec3::new(0.3, 0.8, 0.5).normalize();
    for (version, inner) in [
        ("3.0.0", format!("{DIRECTION}{no_sky}")),
        ("3.0.0", format!("{DIRECTION}{no_sky}{turned}")),
        ("0.6.0", format!("{DIRECTION}{no_sky}")),
        ("0.6.0", format!("{DIRECTION}{no_sky}{turned}")),
    ] {
        let (desc, _) = load(version, "sunsky", &inner).unwrap();
        let (towards, _) = brightest(&desc);
        let degrees = towards.angle_between(expected).to_degrees();
        assert!(degrees < 0.4, "{version} {inner}: {towards}");
    }
}

#[test]
fn a_turned_sky_is_that_of_mitsuba() {
    let inner = "<float name=\"sun_scale\" value=\"0\"/><transform name=\"to_world\">\
                 <rotate x=\"1\" angle=\"-50\"/><rotate y=\"1\" angle=\"70\"/></transform>";
    let (desc, _) = load("3.0.0", "sunsky", &format!("{DIRECTION}{inner}")).unwrap();
    let (map, texels) = map_of(&desc);
    // Mitsuba 3.9.1, `scalar_rgb`.
    for (d, expected) in [
        ([0.6, 0.64, -0.48], [0.02787, 0.05383, 0.11089]),
        ([-0.48, 0.6, 0.64], [0.08498, 0.13634, 0.22517]),
        ([0.8, 0.0, 0.6], [0.03781, 0.06927, 0.13419]),
        ([-0.6, 0.0, -0.8], [0.0; 3]),
    ] {
        let d = DVec3::from(d);
        // The map is read as its convention states, not by the code that made it.
        let u = 0.5 - d.x.atan2(d.z) / std::f64::consts::TAU;
        let v = d.y.acos() / std::f64::consts::PI;
        let x = (u * f64::from(map.width)) as usize;
        let y = (v * f64::from(map.height)) as usize;
        let t = texels[y * map.width as usize + x];
        let found = DVec3::new(t[0].into(), t[1].into(), t[2].into());
        let error = (found - DVec3::from(expected)).length();
        assert!(
            error <= 0.01 * found.length(),
            "{d}: {found}, not {expected:?}"
        );
    }
}

#[test]
fn a_sun_of_a_time_turns_with_to_world() {
    let no_sky = "<float name=\"sky_scale\" value=\"0\"/>";
    let turned = "<transform name=\"toWorld\"><rotate x=\"1\" angle=\"90\"/></transform>";
    // Mitsuba 3.9.1 for the first, whose south is +x and west +y; east is +x in version 0.6.
    for (version, inner, expected) in [
        ("3.0.0", "", DVec3::new(0.0514, 0.6917, 0.7203)),
        ("3.0.0", turned, DVec3::new(0.0514, -0.7203, 0.6917)),
        ("0.6.0", "", DVec3::new(-0.6917, 0.7203, 0.0514)),
        ("0.6.0", turned, DVec3::new(-0.6917, -0.0514, 0.7203)),
    ] {
        let (desc, _) = load(version, "sunsky", &format!("{no_sky}{inner}")).unwrap();
        let (towards, _) = brightest(&desc);
        let degrees = towards.angle_between(expected).to_degrees();
        assert!(degrees < 0.4, "{version} {inner}: {towards}");
    }
}

#[test]
fn scales_and_plugins_select_sun_and_sky() {
    let power = |version: &str, plugin: &str, inner: &str| {
        let (desc, notes) = load(version, plugin, &format!("{DIRECTION}{inner}")).unwrap();
        assert!(!notes.contains("not supported"), "{notes}");
        brightest(&desc).1
    };
    let scale = |name: &str, x: f64| format!("<float name=\"{name}\" value=\"{x}\"/>");
    let [sky, sun, both] = ["sky", "sun", "sunsky"].map(|p| power("0.6.0", p, ""));
    assert!(
        (sky + sun - both).length() < 2e-3 * both.length(),
        "{sky} {sun} {both}"
    );
    let doubled = power(
        "0.6.0",
        "sunsky",
        &(scale("scale", 2.0) + &scale("sunScale", 0.0)),
    );
    assert!(
        (doubled - 2.0 * sky).length() < 2e-3 * sky.length(),
        "{doubled} {sky}"
    );
    let new = power(
        "3.0.0",
        "sunsky",
        &(scale("sun_scale", 3.0) + &scale("sky_scale", 0.0)),
    );
    let expected = 3.0 * hosek_irradiance((0.5 / 0.98f64.sqrt()).acos(), 3.0);
    assert!(
        (new - expected).length() < 2e-3 * expected.length(),
        "{new} {expected}"
    );
    let wide = power(
        "3.0.0",
        "sunsky",
        &(scale("sky_scale", 0.0) + &scale("sun_aperture", 5.0)),
    );
    assert!(
        (3.0 * wide - new).length() < 2e-3 * new.length(),
        "{wide} {new}"
    );
}

#[test]
fn parameters_out_of_range_are_refused() {
    let float = |name: &str, x: &str| format!("<float name=\"{name}\" value=\"{x}\"/>");
    let vector = |x: &str| format!("<vector name=\"sun_direction\" x=\"{x}\" y=\"0\" z=\"0\"/>");
    for (version, inner, expected) in [
        (
            "3.0.0",
            float("turbidity", "0.9"),
            "`turbidity` must be between 1 and 10",
        ),
        (
            "0.6.0",
            float("turbidity", "11"),
            "`turbidity` must be between 1 and 10",
        ),
        (
            "3.0.0",
            float("albedo", "1.5"),
            "`albedo` must be between 0 and 1",
        ),
        ("3.0.0", float("sun_scale", "-1"), "`sun_scale` must be"),
        ("0.6.0", float("skyScale", "-1"), "`sky_scale` must be"),
        (
            "3.0.0",
            float("sun_aperture", "0"),
            "`sun_aperture` must be above 0",
        ),
        (
            "0.6.0",
            float("stretch", "3"),
            "`stretch` must be between 1 and 2",
        ),
        (
            "3.0.0",
            float("month", "13"),
            "`month` must be between 1 and 12",
        ),
        ("3.0.0", vector("0"), "length above 0"),
        ("3.0.0", vector("1") + &float("hour", "3"), "beside `hour`"),
        ("0.6.0", vector("1") + &float("day", "3"), "beside `day`"),
        ("0.6.0", float("hour", "1"), "below the horizon"),
    ] {
        let error = load(version, "sunsky", &inner).map(|_| ()).unwrap_err();
        assert!(error.contains(expected), "{inner}: {error}");
        assert!(error.contains("line 1"), "{error}");
    }
}

#[test]
fn what_is_not_modelled_is_noted() {
    let texture = "<texture type=\"bitmap\" name=\"albedo\">\
                   <string name=\"filename\" value=\"white.png\"/></texture>";
    for (version, plugin, inner, expected) in [
        (
            "3.0.0",
            "sunsky",
            "",
            "environment map of 2048 x 1024 texels",
        ),
        ("0.6.0", "sky", "", "environment map of 1024 x 512 texels"),
        (
            "3.0.0",
            "sunsky",
            "<float name=\"zzz\" value=\"1\"/>",
            "`zzz`",
        ),
        (
            "0.6.0",
            "sky",
            "<float name=\"sunScale\" value=\"1\"/>",
            "`sun_scale`",
        ),
        (
            "3.0.0",
            "sunsky",
            "<boolean name=\"complex_sun\" value=\"true\"/>",
            "is uniform",
        ),
        (
            "3.0.0",
            "sunsky",
            "<float name=\"hour\" value=\"23\"/>",
            "below the horizon",
        ),
        ("3.0.0", "sunsky", texture, "mean of this texture"),
        (
            "0.6.0",
            "sun",
            "<float name=\"sunRadiusScale\" value=\"0\"/>",
            "widened",
        ),
        (
            "3.0.0",
            "sunsky",
            "<transform name=\"to_world\"><scale y=\"2\"/></transform>",
            "distorts the sky",
        ),
        ("3.0.0", "sun", "", "`sun` is not supported"),
        (
            "3.0.0",
            "constant",
            "</emitter><emitter type=\"sunsky\">",
            "only the first environment",
        ),
    ] {
        let (_, notes) = load(version, plugin, inner).unwrap();
        assert!(notes.contains(expected), "{inner}: {notes}");
    }
}

#[test]
fn the_mean_of_a_white_texture_is_white() {
    let texture = "<texture type=\"bitmap\" name=\"albedo\">\
                   <string name=\"filename\" value=\"white.png\"/></texture>";
    let white = "<rgb name=\"albedo\" value=\"1, 1, 1\"/>";
    let [a, b] = [texture, white].map(|inner| load("3.0.0", "sunsky", inner).unwrap().0);
    assert_eq!(brightest(&a), brightest(&b));
}
