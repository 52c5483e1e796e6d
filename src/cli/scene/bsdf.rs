//! `lumbre bsdf`: figures of the lobe of a material, and of its samples beside their density.

use std::path::PathBuf;

use glam::{Vec2, Vec3};
use serde_json::{Value as Json, json};

use crate::cli::args::{BsdfArgs, Global, unknown_name};
use crate::cli::exit::{Exit, Failure, print_result};
use crate::cli::figure_files;
use crate::cli::format::rounded;
use lumbre_light::math::Frame;
use lumbre_light::scene::compile::{Material, NONE, Share, Uv};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::bsdf::Bsdf;
use lumbre_light::transport::delay::{Profile, profile_at};
use lumbre_light::transport::surface::{Surface, lookup};
use lumbre_render::lobe::Lobe;
use lumbre_render::lobe::fit::{DelayFit, DirectionFit};
use lumbre_report::lobe::{LobeFigure, draw};
use lumbre_scene_io::edit;

/// P-value below which samples do not follow the stated density, so that the verb fails.
const SIGNIFICANCE: f64 = 1e-4;

/// Lobe of a material, and its samples beside their density. Of a composed material the lobe is the
/// sum of its parts' lobes.
struct Found {
    shares: Vec<Share>,
    lobe: Lobe,
    directions: DirectionFit,
    delays: Vec<(String, DelayFit)>,
}

/// Runs `lumbre bsdf`.
pub fn main(args: &BsdfArgs, global: &Global) -> Result<Exit, Failure> {
    let options = args.file.settings.iter().chain(&args.option);
    let options = options.cloned().collect();
    let read = lumbre_lua::scene::read(&args.file.file, &options, global.missing());
    let (mut desc, _) = read.map_err(Failure::usage)?;
    for (path, value) in &args.set {
        edit::set(&mut desc, path, value).map_err(Failure::usage)?;
    }
    let names: Vec<&str> = desc.materials.iter().map(|m| m.name.as_str()).collect();
    let Some(index) = names.iter().position(|name| *name == args.material) else {
        let message = unknown_name("material", &args.material, &names);
        return Err(Failure::usage(message));
    };
    let (scene, _) = compile(&desc).map_err(Failure::usage)?;
    let found = find(args, &scene, index);
    let [theta, phi] = args.at;
    let heading = format!(
        "{} ({}) from {theta}° to the normal, azimuth {phi}°",
        args.material,
        found.parts(&scene, &names)
    );
    let description = format!(
        "{}\nscene {}\nmaterial {}",
        lumbre_night::text::program(),
        args.file.text,
        args.material
    );
    let svg = draw(&LobeFigure {
        heading: &heading,
        description: &description,
        lobe: &found.lobe,
        directions: &found.directions,
        delays: &found.delays,
    })
    .map_err(Failure::internal)?;
    let files = figure_files::write(&stem(args), &svg)?;
    let text = if args.json {
        format!("{:#}\n", report(args, &found, &files))
    } else {
        page(&heading, &found)
    };
    print_result(&text)?;
    if !global.quiet {
        figure_files::print(&files);
    }
    Ok(if found.disagrees() {
        Exit::NotVerified
    } else {
        Exit::Done
    })
}

impl Found {
    /// Names what the material is: its model, or its parts with their probabilities.
    fn parts(&self, scene: &CompiledScene, names: &[&str]) -> String {
        match self.shares.as_slice() {
            [only] => scene.materials[only.material as usize]
                .model
                .name()
                .to_owned(),
            parts => {
                let part = |s: &Share| {
                    let percent = rounded(100.0 * f64::from(s.probability));
                    format!("{percent} % {}", names[s.material as usize])
                };
                parts.iter().map(part).collect::<Vec<_>>().join(", ")
            }
        }
    }

    /// Returns whether samples do not follow the stated density.
    fn disagrees(&self) -> bool {
        let delays = self.delays.iter().map(|(_, fit)| fit.p_value);
        delays
            .chain([self.directions.p_value])
            .any(|p| p < SIGNIFICANCE)
    }
}

/// Evaluates and samples the BSDF and the delays of a material on a surface with the normal +z.
fn find(args: &BsdfArgs, scene: &CompiledScene, index: usize) -> Found {
    let uv = Uv::same(Vec2::from_array(args.uv));
    let [theta, phi] = args.at.map(f32::to_radians);
    let around = Vec3::new(phi.cos(), phi.sin(), 0.0);
    let wo = around * theta.sin() + Vec3::Z * theta.cos();
    // Away from the viewer, so that mirror reflection is in the middle of the map.
    let frame = Frame {
        s: -around,
        t: Vec3::Z.cross(-around),
        n: Vec3::Z,
    };
    let shares = scene.delays.shares(index as u32, |blend| {
        if blend.by_side {
            return if wo.z < 0.0 { 1.0 } else { 0.0 };
        }
        lookup(&scene.textures, blend.texture, uv, blend.tiling).x
    });
    let (mut lobes, mut directions) = (Vec::new(), Vec::new());
    for share in &shares {
        let material = &scene.materials[share.material as usize];
        let surface = surface(material, uv);
        let bsdf = Bsdf::new(&surface, &scene.textures);
        let probability = f64::from(share.probability);
        lobes.push((probability, Lobe::new(&bsdf, Vec3::Z, wo)));
        directions.push((probability, DirectionFit::new(&bsdf, material, &frame, wo)));
    }
    let none = "a material has parts whose probabilities sum to 1";
    Found {
        lobe: Lobe::composed(&lobes).expect(none),
        directions: DirectionFit::composed(&directions).expect(none),
        delays: delays(scene, &shares, uv),
        shares,
    }
}

/// Samples the delays of a material: of each profile, and, if it is composed of parts that have at
/// most one profile each, of the whole.
fn delays(scene: &CompiledScene, shares: &[Share], uv: Uv) -> Vec<(String, DelayFit)> {
    let profiles = |share: &Share| -> Vec<Profile> {
        let component = scene.delays.components.get(share.component as usize);
        let profiles = component.map_or(&[][..], |c| scene.delays.profiles(c));
        let at = |profile| profile_at(profile, &scene.textures, uv);
        profiles.iter().map(at).collect()
    };
    let parts: Vec<Vec<Profile>> = shares.iter().map(profiles).collect();
    let named = |profile: &Profile| {
        let name = format!("delay, {}", profile.to_parts().0.name());
        (name, DelayFit::new(profile))
    };
    let mut fits: Vec<_> = parts.iter().flatten().map(named).collect();
    if shares.len() > 1 && !fits.is_empty() && parts.iter().all(|part| part.len() <= 1) {
        let one = |part: &Vec<Profile>| part.first().cloned().unwrap_or(Profile::NONE);
        let probabilities = shares.iter().map(|share| f64::from(share.probability));
        let composed: Vec<_> = probabilities.zip(parts.iter().map(one)).collect();
        fits.push(("delay, composed".to_owned(), DelayFit::composed(&composed)));
    }
    fits
}

/// Returns a point of a plane with the normal +z and texture coordinates along +x and +y. Normal and
/// bump maps are not applied.
fn surface(material: &Material, uv: Uv) -> Surface<'_> {
    let own = material.anisotropic_direction;
    Surface {
        position: Vec3::ZERO,
        n_geometric: Vec3::Z,
        extent: 0.0,
        n_shading: Vec3::Z,
        tangent: if own == Vec3::ZERO { Vec3::X } else { own },
        uv,
        tint: Vec3::ONE,
        materials: [material],
        emitter: NONE,
        terminator: None,
    }
}

/// Returns the path of the figures without an extension.
fn stem(args: &BsdfArgs) -> PathBuf {
    args.to.clone().unwrap_or_else(|| {
        let safe = |c: char| {
            if c.is_ascii_alphanumeric() || "-_.".contains(c) {
                c
            } else {
                '_'
            }
        };
        PathBuf::from(format!(
            "bsdf-{}",
            args.material.chars().map(safe).collect::<String>()
        ))
    })
}

/// Formats what was found for people.
fn page(heading: &str, found: &Found) -> String {
    let Found {
        lobe,
        directions,
        delays,
        ..
    } = found;
    let mut lines = vec![
        heading.to_owned(),
        format!(
            "value times cosine: at most {} /sr; albedo {}",
            rounded(lobe.greatest_value()),
            rounded(lobe.albedo)
        ),
        format!(
            "samples: {} % in Dirac lobes, {} % without a direction",
            rounded(100.0 * lobe.delta),
            rounded(100.0 * lobe.lost)
        ),
        format!(
            "density: integrates to {}; {} samples follow it with p = {}",
            rounded(directions.mass),
            directions.samples,
            rounded(directions.p_value)
        ),
    ];
    lines.extend(delays.iter().map(|(name, fit)| {
        format!(
            "{name}: mean {} ({} stated); {} samples follow the density with p = {}",
            rounded(fit.drawn_mean),
            rounded(fit.mean),
            fit.samples,
            rounded(fit.p_value)
        )
    }));
    lines.push(String::new());
    lines.join("\n")
}

/// Returns what was found as JSON.
fn report(args: &BsdfArgs, found: &Found, files: &[PathBuf; 2]) -> Json {
    let Found {
        lobe,
        directions,
        delays,
        ..
    } = found;
    let delay = |(name, fit): &(String, DelayFit)| {
        json!({
            "name": name, "samples": fit.samples, "range": fit.range, "p": fit.p_value,
            "mean": fit.mean, "drawn_mean": fit.drawn_mean,
            "stated": fit.stated, "drawn": fit.drawn,
        })
    };
    json!({
        "scene": args.file.text, "material": args.material, "at_deg": args.at, "uv": args.uv,
        "files": files,
        "slice": {
            "value_times_cosine": lobe.values, "stated": lobe.densities, "drawn": lobe.histogram,
        },
        "albedo": lobe.albedo, "dirac_share": lobe.delta, "lost_share": lobe.lost,
        "sphere": {
            "samples": directions.samples, "without_density": directions.without_density,
            "mass": directions.mass, "p": directions.p_value,
            "stated": directions.stated, "drawn": directions.drawn,
        },
        "delays": delays.iter().map(delay).collect::<Vec<_>>(),
    })
}

/// Parses `theta` or `theta,phi` in degrees.
pub fn direction(text: &str) -> Result<[f32; 2], String> {
    let numbers: Vec<f32> = text
        .split(',')
        .filter_map(|part| part.trim().parse().ok())
        .filter(|x: &f32| x.is_finite())
        .collect();
    match (numbers.as_slice(), text.split(',').count()) {
        (&[theta], 1) if (0.0..=180.0).contains(&theta) => Ok([theta, 0.0]),
        (&[theta, phi], 2) if (0.0..=180.0).contains(&theta) => Ok([theta, phi]),
        _ => Err(format!(
            "expected an angle from the normal of 0 to 180 degrees and optionally an azimuth, such \
             as 60 or 60,45, found `{text}`"
        )),
    }
}

/// Parses texture coordinates `u,v`.
pub fn texture_coordinates(text: &str) -> Result<[f32; 2], String> {
    let pair = text.split_once(',').and_then(|(u, v)| {
        let [u, v]: [f32; 2] = [u.trim().parse().ok()?, v.trim().parse().ok()?];
        (u.is_finite() && v.is_finite()).then_some([u, v])
    });
    pair.ok_or_else(|| format!("expected texture coordinates such as 0.5,0.25, found `{text}`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_one_or_two_angles_within_their_range() {
        assert_eq!(direction("60"), Ok([60.0, 0.0]));
        assert_eq!(direction("120, 45"), Ok([120.0, 45.0]));
        for wrong in ["", "a", "60,", "-1", "181", "1,2,3", "nan"] {
            assert!(direction(wrong).is_err(), "{wrong}");
        }
        assert_eq!(texture_coordinates("0.5,0.25"), Ok([0.5, 0.25]));
        assert!(texture_coordinates("0.5").is_err());
    }
}
