//! Normals of smoothing groups: the mean of the normals of all faces of a group at a vertex.

use std::collections::BTreeMap;

use glam::Vec3;

use crate::load::default_scene::mean_normals;

/// The smoothing groups of a file with the triangles of their faces.
#[derive(Default)]
pub(super) struct SmoothingGroups {
    /// Index of the current group; `None` if smoothing is off.
    current: Option<usize>,
    /// Index of each name.
    names: BTreeMap<String, usize>,
    /// Index of the normal of each position in each group.
    indices: BTreeMap<(usize, usize), u32>,
    /// Index of the position of each normal.
    positions: Vec<usize>,
    /// Indices of the normals at the corners of the triangles.
    triangles: Vec<[u32; 3]>,
}

impl SmoothingGroups {
    /// Selects the group of the faces that follow. `off`, `0` and no name turn smoothing off.
    pub fn select(&mut self, name: Option<&str>) {
        let name = name.filter(|name| *name != "off" && name.parse() != Ok(0u32));
        self.current = name.map(|name| {
            let count = self.names.len();
            *self.names.entry(name.to_owned()).or_insert(count)
        });
    }

    /// Adds a polygon, given by the indices of its positions and the corners of its triangles, to
    /// the current group; without triangles it is a fan. Returns the indices of its normals, or
    /// `None` if smoothing is off.
    pub fn add(&mut self, polygon: &[usize], ears: Option<&[[usize; 3]]>) -> Option<Vec<u32>> {
        let group = self.current?;
        let mut normal = |position: usize| {
            *self.indices.entry((group, position)).or_insert_with(|| {
                self.positions.push(position);
                self.positions.len() as u32 - 1
            })
        };
        let normals: Vec<u32> = polygon.iter().map(|position| normal(*position)).collect();
        match ears {
            Some(ears) => self
                .triangles
                .extend(ears.iter().map(|ear| ear.map(|k| normals[k]))),
            None => {
                let fan = normals.windows(2).skip(1);
                self.triangles
                    .extend(fan.map(|pair| [normals[0], pair[0], pair[1]]));
            }
        }
        Some(normals)
    }

    /// Returns all normals, on the side from which faces run counter-clockwise; zero where the
    /// faces of a group have no mean normal. `positions` are those of the file.
    pub fn normals(&self, positions: &[Vec3]) -> impl Iterator<Item = Vec3> {
        let positions: Vec<Vec3> = self.positions.iter().map(|i| positions[*i]).collect();
        mean_normals(&positions, &self.triangles).map(|n| n.unwrap_or(Vec3::ZERO))
    }
}
