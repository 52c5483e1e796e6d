//! Writes the samples of all formats as initial inputs of the targets: `seeds FOLDER` creates
//! `FOLDER/<target>/`.

#![allow(clippy::expect_used, reason = "an error ends the tool")]

use std::fs;
use std::path::Path;

use lumbre_fuzz::samples::{self, samples};

fn main() {
    let folder = std::env::args().nth(1).expect("usage: seeds FOLDER");
    for sample in samples() {
        let kind = sample.name.split(',').next().unwrap_or_default();
        for (i, (name, bytes)) in sample.files.iter().enumerate() {
            let target = match (kind, name.rsplit('.').next()) {
                ("obj", Some("mtl")) => "mtl",
                ("exr" | "png" | "jpeg" | "bmp" | "hdr" | "tga", _) => "image",
                (kind, _) if i == 0 => kind,
                _ => continue,
            };
            let target_folder = Path::new(&folder).join(target);
            fs::create_dir_all(&target_folder).expect("the folder can be written");
            fs::write(target_folder.join(sample.name.replace(", ", "-")), bytes)
                .expect("the folder can be written");
        }
    }
    let mut mesh = vec![4];
    mesh.extend(samples::serialized_mesh());
    for (target, bytes) in [
        ("serialized", mesh.as_slice()),
        ("rows", b"wave,samples,render_s,wall_s,measure_s,paths,rays,invalid,rmse\n0,1,0.5,0.6,0.1,1,2,0,inf\n"),
        ("checkpoint", &[0, 1, 0, 0]),
    ] {
        let target_folder = Path::new(&folder).join(target);
        fs::create_dir_all(&target_folder).expect("the folder can be written");
        fs::write(target_folder.join("sample"), bytes).expect("the folder can be written");
    }
}
