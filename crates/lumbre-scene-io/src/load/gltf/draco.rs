//! Meshes compressed by Draco: `KHR_draco_mesh_compression`.

use draco_core::{DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use serde_json::Value as Json;

use super::document::Document;
use crate::load::packed;
use lumbre_light::scene::SceneError;

/// Least number of bytes that a decoded triangle counts.
const TRIANGLE_BYTES: u64 = 32;

/// Decodes a compressed primitive into the accessors of its attributes and indices. Returns whether it
/// is compressed.
///
/// # Errors
/// Fails for damaged data, for attributes that the data lack, and for data that expand to more than
/// the size of the file justifies.
pub(super) fn unpack(
    document: &Document,
    place: &str,
    primitive: &Json,
) -> Result<bool, SceneError> {
    let extension = &primitive["extensions"]["KHR_draco_mesh_compression"];
    if !extension.is_object() {
        return Ok(false);
    }
    let place = format!("{place}.KHR_draco_mesh_compression");
    let (indices, _) = document.resolve(&place, "accessors", &primitive["indices"])?;
    let (bytes, _) = document.view(&place, &extension["bufferView"])?;
    let most = packed::budget(bytes.len());
    let limits = DecodeLimits::default()
        .with_max_decoded_bytes(most)
        .with_max_points(most / TRIANGLE_BYTES)
        .with_max_faces(most / TRIANGLE_BYTES);
    let mut mesh = Mesh::new();
    MeshDecoder::new()
        .decode(
            &mut DecoderBuffer::new(bytes).with_limits(limits),
            &mut mesh,
        )
        .map_err(|e| document.error(&place, format!("Draco: {e}")))?;
    let points = mesh.num_points();
    for (key, id) in extension["attributes"].as_object().into_iter().flatten() {
        let (i, accessor) = document.resolve(&place, "accessors", &primitive["attributes"][key])?;
        let attribute = id.as_u64().and_then(|id| u32::try_from(id).ok());
        let attribute = attribute.and_then(|id| mesh.attribute_by_unique_id(id));
        let (Some(attribute), Some(width)) = (attribute, Document::width(accessor)) else {
            let problem = format!("the compressed mesh has no attribute {id:.20} for `{key:.20}`");
            return Err(document.error(&place, problem));
        };
        document.charge(&place, (points * width) as u64)?;
        let values = attribute.read_f32s(points, width);
        let greatest = Document::greatest(accessor);
        let number = |x| greatest.map_or(f64::from(x), |one| (f64::from(x) / one).max(-1.0));
        document.store(i, values.into_iter().map(number).collect())?;
    }
    document.charge(&place, 3 * mesh.num_faces() as u64)?;
    let corners = mesh.faces().iter().flatten();
    document.store(indices, corners.map(|point| f64::from(point.0)).collect())?;
    Ok(true)
}
