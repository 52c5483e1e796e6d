//! The process of Mitsuba that renders all cases.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde::Serialize;
use serde_json::json;

use crate::cli::verify::picture::NoisyPicture;
use lumbre_light::film::Image;
use lumbre_scene_io::load::openexr;

/// Script that the interpreter runs.
const SCRIPT: &str = include_str!("fidelity.py");

/// Variant of Mitsuba: its start takes no time, unlike that of compiled variants.
const VARIANT: &str = "scalar_rgb";

/// Number of pictures with different seeds, from which the variance is estimated.
const PICTURES: u64 = 8;

/// A picture to render.
pub struct PeerRequest<'a> {
    /// Scene file in XML.
    pub scene: &'a Path,
    /// Beginning of the names of temporary files.
    pub out: &'a Path,
    /// Samples per pixel.
    pub samples: u64,
    /// Seed of the picture.
    pub seed: u64,
    /// Replaces film, filter and depth of the scene.
    pub view: Option<SmallView>,
}

/// Film and depth of a small picture; its filter is a box.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SmallView {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Vertical field of view in degrees.
    pub fov_y: f32,
    /// Height of the picture over that of the whole view.
    pub shown: f32,
    /// Vector from the axis to the middle of the picture, in its own width and height, to the right
    /// and downwards.
    pub offset: [f32; 2],
    /// Greatest number of path edges.
    pub max_depth: u32,
}

/// A running interpreter; it ends when this is dropped.
pub struct Peer {
    child: Child,
    requests: ChildStdin,
    replies: BufReader<ChildStdout>,
    /// Version of Mitsuba.
    pub version: String,
}

impl Peer {
    /// Starts the interpreter.
    ///
    /// # Errors
    /// Returns a message if the interpreter or the package is missing.
    pub fn start(python: &str) -> Result<Peer, String> {
        let mut child = Command::new(python)
            .args(["-c", SCRIPT, VARIANT])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("the interpreter `{python}` cannot be started: {e}"))?;
        let (Some(requests), Some(replies)) = (child.stdin.take(), child.stdout.take()) else {
            return Err("cannot open pipes to the interpreter".to_owned());
        };
        let mut peer = Peer {
            child,
            requests,
            replies: BufReader::new(replies),
            version: String::new(),
        };
        peer.version = peer
            .reply()
            .map_err(|_| format!("`{python}` cannot load the package `mitsuba`"))?;
        Ok(peer)
    }

    /// Reads a reply.
    fn reply(&mut self) -> Result<String, String> {
        let mut line = String::new();
        match self.replies.read_line(&mut line) {
            Ok(read) if read > 0 => Ok(line.trim_end().to_owned()),
            _ => Err("the interpreter has exited".to_owned()),
        }
    }

    /// Renders a scene file.
    ///
    /// # Errors
    /// Returns a message if Mitsuba rejects the scene or exits.
    pub fn render(&mut self, request: &PeerRequest) -> Result<NoisyPicture, String> {
        let out = request.out;
        let seed = (request.seed.wrapping_mul(PICTURES)) as u32 >> 1;
        let request = json!({
            "scene": request.scene, "out": out, "pictures": PICTURES,
            "spp": (request.samples / PICTURES).max(1), "seed": seed, "view": request.view,
        });
        // If the interpreter has exited, reading the reply reports it.
        let _ = writeln!(self.requests, "{request}").and_then(|()| self.requests.flush());
        let reply = self.reply()?;
        if let Some(error) = reply.strip_prefix("error ") {
            return Err(format!("Mitsuba rejects the scene: {error}"));
        }
        let mut pictures = Vec::new();
        for i in 0..PICTURES {
            let file = format!("{}_{i}.exr", out.display());
            let bytes = std::fs::read(&file).map_err(|e| e.to_string())?;
            let (image, _) = openexr::decode(&bytes, MAX_PIXELS).map_err(|e| e.to_string())?;
            pictures.push(image);
        }
        Ok(mean_with_variance(&pictures))
    }
}

/// Greatest number of pixels of a case.
const MAX_PIXELS: usize = 1 << 16;

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have exited already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the mean of pictures of equal size, and the variance of that mean from their differences.
fn mean_with_variance(pictures: &[Image]) -> NoisyPicture {
    let n = pictures.len() as f64;
    let Image { width, height, .. } = pictures[0];
    let at = |x: u32, y: u32, of: &dyn Fn(f64, f64) -> f64| {
        std::array::from_fn(|c| {
            let values = pictures.iter().map(|p| f64::from(p.at(x, y)[c]));
            let (sum, squares) = values.fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
            of(sum, squares) as f32
        })
    };
    let variance = |sum: f64, squares: f64| (squares - sum * sum / n).max(0.0) / (n * (n - 1.0));
    NoisyPicture::from_values(
        Image::from_fn(width, height, |x, y| at(x, y, &|sum, _| sum / n)),
        Image::from_fn(width, height, |x, y| at(x, y, &variance)),
    )
}
