//! Suns and skies of Mitsuba become environment maps.

use lumbre_light::scene::desc::{EnvironmentSource, Texels};

use super::{Folder, lines};

/// A scene of version 3 with all parameters of `sunsky` but the direction of the sun.
const VERSION_3: &str = r#"<scene version="3.7.0"><emitter type="sunsky">
<float name="turbidity" value="4"/><rgb name="albedo" value="0.4, 0.3, 0.2"/>
<float name="latitude" value="40"/><float name="longitude" value="0"/>
<float name="timezone" value="0"/><integer name="year" value="2024"/>
<integer name="month" value="6"/><integer name="day" value="21"/>
<float name="hour" value="12"/><float name="minute" value="2"/><float name="second" value="1"/>
<float name="sun_scale" value="1"/><float name="sky_scale" value="0.5"/>
<float name="sun_aperture" value="1"/><boolean name="complex_sun" value="false"/>
<transform name="to_world"><rotate x="1" angle="-90"/></transform></emitter></scene>"#;

/// A scene of version 0.6 with all parameters of `sunsky` but those of place and time.
const VERSION_0_6: &str = r#"<scene version="0.6.0"><emitter type="sunsky">
<float name="turbidity" value="4"/><spectrum name="albedo" value="0.2"/>
<vector name="sunDirection" x="0" y="0.957" z="0.29"/>
<float name="sunScale" value="1"/><float name="skyScale" value="0.5"/>
<float name="scale" value="1"/><float name="sunRadiusScale" value="2"/>
<float name="stretch" value="1"/><boolean name="extend" value="false"/>
<integer name="resolution" value="512"/><float name="samplingWeight" value="1"/>
</emitter></scene>"#;

#[test]
fn suns_and_skies_are_environment_maps_with_up_at_the_top() {
    for text in [VERSION_3, VERSION_0_6] {
        let folder = Folder::new(&[("a.xml", text)]);
        let (desc, notes) = folder.load("a.xml").unwrap();
        let notes = lines(&notes);
        assert!(notes.contains("2048 x 1024 texels"), "{notes}");
        assert!(!notes.contains("not supported"), "{notes}");
        let Some(EnvironmentSource::Map(map)) = desc.environment.map(|e| e.source) else {
            panic!("a map expected")
        };
        let Texels::RgbaF32(texels) = &map.texels else {
            panic!("floats expected")
        };
        let (upper, lower) = texels.split_at(texels.len() / 2);
        assert!(upper.iter().all(|t| t[2] > 0.0));
        assert!(lower.iter().all(|t| t[2] == 0.0));
        // At noon of midsummer the sun is 73 degrees high, here in the column of +x or +z.
        let brightest = (0..texels.len()).max_by(|a, b| texels[*a][0].total_cmp(&texels[*b][0]));
        let row = brightest.unwrap() / map.width as usize;
        assert!((row as f64 / 1024.0 * 180.0 - 16.8).abs() < 0.6, "{row}");
    }
}
