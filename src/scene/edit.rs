//! `set "materials.egg.roughness" = v`: the only door for sweeps into a scene.
