//! Checks of a technique, for the tests of the crate that has it: pictures of scenes whose radiance
//! is known, or which another technique renders too.
//!
//! Every check renders pictures of 16 x 16 pixels with fixed seeds, so one that passes once passes
//! always. It returns what differs as an error. Paths have at most 5 edges, unless
//! [`Trial::max_depth`] sets another number.

use std::collections::BTreeMap;
use std::sync::{Arc, Once};

use glam::Vec3;

use crate::cpu::renderer::CpuRenderer;
use crate::own_technique::{self, OwnTechnique};
use crate::{Job, Renderer};
use lumbre_light::film::Film;
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::{two_sided_p, welch_p};
use lumbre_light::scene::desc::{CameraDesc, EntityDesc, MaterialDesc, Model, SceneDesc};
use lumbre_light::scene::simple::{self, ball, lambert};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::{IntegratorRow, integrator};
use lumbre_light::value::Value;

/// Side of the pictures in pixels.
const SIDE: u32 = 16;

/// Side of the blocks of pixels that are compared.
const BLOCK: u32 = 8;

/// Number of pictures with different seeds, from which errors are estimated.
const PICTURES: u64 = 24;

/// Default of the maximum number of path edges.
const DEPTH: u32 = 5;

/// Number of samples of every pixel of a picture.
const SAMPLES: u64 = 64;

/// Probability that a check of a correct technique fails, over all possible seeds.
const SIGNIFICANCE: f64 = 0.001;

/// A technique with parameters, to be checked.
pub struct Trial {
    row: &'static IntegratorRow,
    params: BTreeMap<String, Value>,
    max_depth: u32,
}

impl Trial {
    /// Registers a technique for this process, in which it must be the only one of its own, and
    /// returns it with parameters.
    ///
    /// # Errors
    /// Returns an error if it cannot be registered, or if its schema refuses the parameters.
    pub fn new(technique: &OwnTechnique, params: &[(&str, Value)]) -> Result<Trial, String> {
        static REGISTERED: Once = Once::new();
        let mut registered = Ok(());
        REGISTERED.call_once(|| registered = own_technique::register(&[*technique], &[]));
        registered.map_err(|e| e.to_string())?;
        Trial::named(technique.row().name, params)
    }

    /// Prepares the trial of a known technique with parameters.
    ///
    /// # Errors
    /// Returns an error if there is no such technique, or its parameters do not allow these.
    pub fn named(name: &str, params: &[(&str, Value)]) -> Result<Trial, String> {
        let row = integrator(name).ok_or_else(|| format!("`{name}` is not registered"))?;
        let params = params.iter().map(|(k, v)| ((*k).to_owned(), v.clone()));
        let params: BTreeMap<String, Value> = params.collect();
        row.params.check(name, &params).map_err(|e| e.to_string())?;
        Ok(Trial {
            row,
            params,
            max_depth: DEPTH,
        })
    }

    /// Sets the maximum number of path edges, which is 5 by default; 1 = emission only, 2 = direct
    /// light. Holds for both pictures of a comparison, and for the radiance that a furnace must
    /// have. For a technique that has a limit of its own, pass at most that limit. 0 counts as 1.
    #[must_use]
    pub fn max_depth(self, edges: u32) -> Trial {
        Trial {
            max_depth: edges.max(1),
            ..self
        }
    }

    /// Checks the furnace: a closed room whose walls emit `e` and reflect the share `a` of light.
    /// After `k` edges, every pixel has the radiance `e (1 + a + .. + a^(k-1))`.
    ///
    /// # Errors
    /// Returns an error if the mean radiance differs, or if rendering fails.
    pub fn furnace(&self) -> Result<(), String> {
        let (emitted, reflected) = (0.5, [0.8, 0.6, 0.3]);
        let walls = MaterialDesc {
            emission: Vec3::splat(emitted as f32),
            ..lambert("walls", Vec3::from(reflected.map(|a| a as f32)))
        };
        let scene = scene(vec![walls], vec![simple::room(1.0)])?;
        let edges = i32::try_from(self.max_depth).unwrap_or(i32::MAX);
        let expected = reflected.map(|a: f64| emitted * (1.0 - a.powi(edges)) / (1.0 - a));
        let pictures = self.pictures(&scene)?;
        for (block, values) in pictures.iter().enumerate() {
            let truth = expected[block % 3];
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            let spread = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
            let error = (spread / (n - 1.0) / n).sqrt().max(1e-6 * truth);
            let p = two_sided_p((mean - truth) / error, n - 1.0);
            if p < sidak(SIGNIFICANCE, pictures.len()) {
                return Err(format!(
                    "furnace: {} has the radiance {mean:.6} +- {error:.6} instead of {truth:.6}; {}",
                    place(block),
                    self.depth()
                ));
            }
        }
        Ok(())
    }

    /// Compares pictures of a room, which has a diffuse, a plastic, a glossy, and a glass ball and a
    /// spherical light, with those of another technique with its default parameters, such as `bpt`.
    ///
    /// # Errors
    /// Returns an error if the pictures do not have the same mean, if there is no technique of that
    /// name, or if rendering fails.
    pub fn agreement(&self, other: &str) -> Result<(), String> {
        let scene = room()?;
        let [own, others] = [
            self.pictures(&scene)?,
            Trial::named(other, &[])?
                .max_depth(self.max_depth)
                .pictures(&scene)?,
        ];
        for (block, (a, b)) in own.iter().zip(&others).enumerate() {
            if welch_p(a, b) < sidak(SIGNIFICANCE, own.len()) {
                let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
                return Err(format!(
                    "agreement: {} has the radiance {:.6}, and {:.6} by {other}; {}",
                    place(block),
                    mean(a),
                    mean(b),
                    self.depth()
                ));
            }
        }
        Ok(())
    }

    /// Checks that pictures of one and of three threads, and of one wave and of several, have the
    /// same bits.
    ///
    /// # Errors
    /// Returns an error if they differ, or if rendering fails.
    pub fn same_bits(&self) -> Result<(), String> {
        let scene = room()?;
        let one = self.film(&scene, 1, 1, &[6])?;
        for (threads, waves) in [(3, vec![6]), (1, vec![1, 5]), (3, vec![2, 3, 1])] {
            let film = self.film(&scene, 1, threads, &waves)?;
            if film.sum != one.sum || film.sum2 != one.sum2 {
                return Err(format!(
                    "the picture depends on the number of threads, {threads}, or on the samples of \
                     a wave, {waves:?}: a sample must be a function of scene, job, seed and index"
                ));
            }
        }
        Ok(())
    }

    /// Checks that pictures with different seeds differ, and that a seed gives the same picture
    /// again.
    ///
    /// # Errors
    /// Returns an error if either does not hold, or if rendering fails.
    pub fn seeds(&self) -> Result<(), String> {
        let scene = room()?;
        let film = |seed| self.film(&scene, seed, 0, &[4]);
        let (one, again, two) = (film(1)?, film(1)?, film(2)?);
        if one.sum != again.sum {
            return Err("the same seed gives another picture".to_owned());
        }
        if one.sum == two.sum {
            return Err(
                "another seed gives the same picture: take numbers from the sampler of the sample"
                    .to_owned(),
            );
        }
        Ok(())
    }

    /// Returns the depth of the pictures for a message of failure.
    fn depth(&self) -> String {
        format!(
            "paths have up to {} edges, which `Trial::max_depth` sets",
            self.max_depth
        )
    }

    /// Renders waves of samples.
    fn film(
        &self,
        scene: &Arc<CompiledScene>,
        seed: u64,
        threads: usize,
        waves: &[u64],
    ) -> Result<Film, String> {
        let mut job = Job::plain(self.row, [SIDE; 2], self.max_depth, seed);
        job.settings.params.clone_from(&self.params);
        job.threads = threads;
        let mut renderer = CpuRenderer::new(Arc::clone(scene), job).map_err(|e| e.to_string())?;
        for samples in waves {
            let stats = renderer.advance(*samples).map_err(|e| e.to_string())?;
            if let Some([x, y, sample]) = stats.first_invalid {
                return Err(format!(
                    "sample {sample} of pixel ({x}, {y}) is infinite or not a number"
                ));
            }
        }
        Ok(renderer.film().clone())
    }

    /// Returns the means of every block and channel, one for each of [`PICTURES`] seeds, which are
    /// independent whatever pixels have in common.
    fn pictures(&self, scene: &Arc<CompiledScene>) -> Result<Vec<Vec<f64>>, String> {
        // The seeds of two techniques differ, since their pictures are compared as independent ones.
        let hash = blake3::hash(self.row.name.as_bytes());
        let [a, b, c, d] = *hash.as_bytes().first_chunk().unwrap_or(&[0; 4]);
        let first = u64::from(u32::from_le_bytes([a, b, c, d])) * PICTURES;
        let mut means = vec![Vec::new(); (SIDE / BLOCK).pow(2) as usize * 3];
        for seed in first..first + PICTURES {
            let film = self.film(scene, seed, 0, &[SAMPLES])?;
            for (index, values) in means.iter_mut().enumerate() {
                values.push(block_mean(&film, index));
            }
        }
        Ok(means)
    }
}

/// Returns the mean of a block and channel.
fn block_mean(film: &Film, index: usize) -> f64 {
    let (block, channel) = (index as u32 / 3, index % 3);
    let (left, top) = (
        block % (SIDE / BLOCK) * BLOCK,
        block / (SIDE / BLOCK) * BLOCK,
    );
    let mut sum = 0.0;
    for y in top..top + BLOCK {
        for x in left..left + BLOCK {
            sum += film.sum[(y * SIDE + x) as usize][channel];
        }
    }
    sum / f64::from(BLOCK * BLOCK) / film.samples as f64
}

/// Returns words for a block and channel.
fn place(index: usize) -> String {
    let blocks = SIDE / BLOCK;
    let block = index as u32 / 3;
    format!(
        "{} of the block at column {}, row {}",
        ["red", "green", "blue"][index % 3],
        block % blocks * BLOCK,
        block / blocks * BLOCK
    )
}

/// Returns a closed room with a light and four balls. The coat of the plastic one is a Dirac lobe
/// beside a diffuse one, next to the light, which the coat reflects into the camera.
fn room() -> Result<Arc<CompiledScene>, String> {
    let light = MaterialDesc {
        emission: Vec3::new(6.0, 5.0, 4.0),
        emitter_reflects: false,
        ..lambert("light", Vec3::ZERO)
    };
    let glossy = MaterialDesc {
        roughness: 0.4,
        metallic: 1.0,
        ..MaterialDesc::new("glossy")
    };
    let plastic = MaterialDesc {
        model: Model::Plastic,
        roughness: 0.0,
        ior: 2.5,
        ..lambert("plastic", Vec3::splat(0.6))
    };
    let glass = MaterialDesc {
        opacity: 0.0,
        roughness: 0.0,
        ..MaterialDesc::new("glass")
    };
    scene(
        vec![
            lambert("walls", Vec3::new(0.6, 0.5, 0.4)),
            lambert("diffuse", Vec3::splat(0.7)),
            plastic,
            light,
            glossy,
            glass,
        ],
        vec![
            simple::room(1.0),
            ball("light", Vec3::new(0.0, 0.55, 0.1), 0.3),
            ball("diffuse", Vec3::new(-0.6, -0.4, -0.4), 0.35),
            ball("plastic", Vec3::new(-0.45, 0.35, -0.3), 0.3),
            ball("glossy", Vec3::new(0.6, -0.4, -0.4), 0.35),
            ball("glass", Vec3::new(0.0, -0.5, 0.2), 0.25),
        ],
    )
}

/// Compiles a scene whose camera looks along -z from near the front.
fn scene(
    materials: Vec<MaterialDesc>,
    entities: Vec<EntityDesc>,
) -> Result<Arc<CompiledScene>, String> {
    let desc = SceneDesc {
        resolution: [SIDE; 2],
        max_depth: DEPTH,
        camera: CameraDesc {
            position: Vec3::Z * 0.95,
            ..CameraDesc::default()
        },
        materials: materials.into(),
        entities: entities.into(),
        ..SceneDesc::default()
    };
    let (scene, _) = compile(&desc).map_err(|e| e.to_string())?;
    Ok(Arc::new(scene))
}
