//! The distribution of a material's delay, for figures of its density.

use super::Profile;
use crate::scene::desc::{MaterialDesc, SceneDesc, TextureSlot};
use crate::value::suggest;

/// Returns the distribution of the delay of a material of a scene that
/// [`delay::check`](crate::scene::desc::delay::check) accepts: profiles with weights that sum to
/// one. A material without a delay has [`Profile::NONE`].
///
/// # Errors
/// States why there is no such distribution: the scene has no material of this name, the
/// distribution differs between points because of a texture, or delays of a composed material and
/// of its parts add up.
pub fn mixture(scene: &SceneDesc, material: &str) -> Result<Vec<(f32, Profile)>, String> {
    let named = |name: &str| scene.materials.iter().find(|m| m.name == name);
    let Some(found) = named(material) else {
        let names = || scene.materials.iter().map(|m| m.name.as_str());
        let help = suggest::nearest(material, names()).map_or_else(
            || format!("materials: {}", names().collect::<Vec<_>>().join(", ")),
            |near| format!("did you mean `{near}`?"),
        );
        return Err(format!("the scene has no material `{material}` ({help})"));
    };
    let mut mixture = Vec::new();
    let mut open: Vec<(f32, &MaterialDesc)> = vec![(1.0, found)];
    while let Some((weight, m)) = open.pop() {
        let slots = m.delay.params().iter().map(|(.., slot)| *slot);
        let mut slots = slots.chain([TextureSlot::Weights]);
        if let Some(slot) = slots.find(|slot| m.texture(*slot).is_some()) {
            return Err(format!(
                "the delay of `{}` differs between points: it has the texture `{}`",
                m.name,
                slot.name()
            ));
        }
        let own = Profile::of(&m.delay);
        if m.parts.is_empty() {
            mixture.push((weight, own));
        } else if own == Profile::NONE {
            let parts = m.parts.iter().zip(&m.weights);
            open.extend(parts.filter_map(|(name, share)| Some((weight * share, named(name)?))));
        } else {
            return Err(format!(
                "the delay of `{}` is added to those of its parts, so it has no single profile",
                m.name
            ));
        }
    }
    Ok(mixture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::desc::DelayKind;

    fn scene() -> SceneDesc {
        let mut red = MaterialDesc::new("red");
        (red.delay.kind, red.delay.constant) = (DelayKind::Constant, [1.0, 0.5]);
        let mut leaf = MaterialDesc::new("leaf");
        leaf.parts = vec!["green".to_owned(), "red".to_owned()];
        leaf.weights = vec![0.75, 0.25];
        SceneDesc {
            materials: vec![MaterialDesc::new("green"), red, leaf].into(),
            ..SceneDesc::default()
        }
    }

    #[test]
    fn a_composed_material_has_the_weighted_profiles_of_its_parts() {
        let found = mixture(&scene(), "leaf").unwrap();
        let expected = [(0.25, Profile::Constant(1.5)), (0.75, Profile::NONE)];
        assert_eq!(found, expected);
    }

    #[test]
    fn materials_without_a_single_distribution_are_explained() {
        let mut scene = scene();
        let unknown = mixture(&scene, "laef").unwrap_err();
        assert!(unknown.contains("did you mean `leaf`?"), "{unknown}");
        let mut leaf = scene.materials[2].clone();
        leaf.delay.kind = DelayKind::Exponential;
        scene.materials = vec![leaf].into();
        assert!(mixture(&scene, "leaf").unwrap_err().contains("its parts"));
    }
}
