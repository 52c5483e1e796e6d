//! Memory of a compiled scene by content.

use serde::{Deserialize, Serialize};

use super::{CompiledScene, Texture};

/// Memory of a compiled scene in bytes, without its acceleration structure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneMemory {
    /// Vertices, attributes of triangles, spheres, emitters, and placements of instances.
    pub geometry: u64,
    /// Texels of textures and of the environment map; shared ones count once.
    pub textures: u64,
}

impl CompiledScene {
    /// Returns the memory of the scene's geometry and textures.
    pub fn memory(&self) -> SceneMemory {
        let geometry = size_of_val(self.triangles.as_slice())
            + size_of_val(self.attributes.as_slice())
            + self.normals.bytes()
            + size_of_val(self.uvs.as_slice())
            + size_of_val(self.tangents.as_slice())
            + size_of_val(self.colors.as_slice())
            + size_of_val(self.second_uvs.as_slice())
            + size_of_val(self.spheres.as_slice())
            + size_of_val(self.emitters.as_slice())
            + size_of_val(self.instances.placements.as_slice());
        let map = self
            .environment
            .as_ref()
            .and_then(|environment| environment.map.as_deref());
        let mut seen: Vec<usize> = Vec::new();
        let mut texels = 0;
        for Texture { texels: own, .. } in self.textures.iter().chain(map) {
            if !seen.contains(&own.address()) {
                seen.push(own.address());
                texels += own.memory();
            }
        }
        SceneMemory {
            geometry: geometry as u64,
            textures: texels as u64,
        }
    }
}
