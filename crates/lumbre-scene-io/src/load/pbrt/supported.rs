//! Supported directives of pbrt's scenes.

use crate::load::SupportedElement;

/// One row for each directive or type, from which `docs/reference/formats.md` is generated.
pub(in crate::load) const SUPPORTED: &[SupportedElement] = &[
    SupportedElement {
        name: "`Include`, `Import`",
        support: "files beside the main one",
        limits: "cycles, and files that are included too often for their size, are refused",
    },
    SupportedElement {
        name: "`Identity`, `Translate`, `Scale`, `Rotate`, `LookAt`, `Transform`, \
               `ConcatTransform`, `CoordinateSystem`, `CoordSysTransform`",
        support: "transforms; a left-handed world is mirrored",
        limits: "transforms that are not affine are refused",
    },
    SupportedElement {
        name: "`TransformTimes`, `ActiveTransform`",
        support: "",
        limits: "motion is noted; transforms of the start are used",
    },
    SupportedElement {
        name: "`AttributeBegin`, `TransformBegin`, `Attribute`, `ReverseOrientation`, `ColorSpace`",
        support: "graphics state; defaults of shapes, lights, materials and textures; `srgb`, \
                  `dci-p3`, `rec2020`. In version 3 names of textures and materials have the meaning \
                  of the last directive, up to the end of its block",
        limits: "other colour spaces are noted",
    },
    SupportedElement {
        name: "`ObjectBegin`, `ObjectInstance`",
        support: "instances that share a mesh",
        limits: "area lights in an object are ignored, as in pbrt, with a note",
    },
    SupportedElement {
        name: "`Integrator`",
        support: "`maxdepth`, plus one edge",
        limits: "the script sets the integrator",
    },
    SupportedElement {
        name: "`Film`, `PixelFilter`",
        support: "`xresolution`, `yresolution`, `cropwindow`, `pixelbounds`; exposure by `iso` and \
                  the shutter, or `scale`",
        limits: "other sensors and the filter are noted",
    },
    SupportedElement {
        name: "`perspective`",
        support: "`fov`, `screenwindow`, `frameaspectratio`, `lensradius`, `focaldistance`",
        limits: "pixels that are not square are noted",
    },
    SupportedElement {
        name: "`orthographic`",
        support: "`screenwindow`, `frameaspectratio`",
        limits: "lenses and pixels that are not square are noted",
    },
    SupportedElement {
        name: "`spherical`, in version 3 `environment`",
        support: "`mapping` with the value `equirectangular`",
        limits: "crops, and the mapping `equalarea`, are noted and replaced",
    },
    SupportedElement {
        name: "other cameras",
        support: "",
        limits: "replaced by a perspective one at the same place, with a note",
    },
    SupportedElement {
        name: "`trianglemesh`, `plymesh`",
        support: "`P`, `indices`, `N`, `uv` or `st`; `filename`, also compressed as `.ply.gz`; \
                  `alpha` of every shape as a probability",
        limits: "quadrilaterals are split",
    },
    SupportedElement {
        name: "`sphere`",
        support: "an analytic sphere, or a mesh if it is partial, textured, anisotropic, stretched \
                  or reversed",
        limits: "meshes are noted",
    },
    SupportedElement {
        name: "`disk`, `cylinder`, `bilinearmesh`",
        support: "meshes with the texture coordinates of pbrt; patches that are no parallelograms \
                  as 8 by 8 fields",
        limits: "",
    },
    SupportedElement {
        name: "`curve`",
        support: "`P`, `basis`, `degree`, `type`, `width`, `width0`, `width1`, `N`: tubes of six sides, \
                  and strips for ribbons",
        limits: "flat curves, which turn to the viewer, become tubes, with a note",
    },
    SupportedElement {
        name: "`loopsubdiv`",
        support: "`levels` of subdivision, and the limit surface",
        limits: "fewer levels, with a note, beyond a million triangles",
    },
    SupportedElement {
        name: "other shapes",
        support: "",
        limits: "ignored, with a note",
    },
    SupportedElement {
        name: "`diffuse`, `matte`",
        support: "`reflectance`; in version 3 `Kd`, and `sigma` by the model `oren_nayar`",
        limits: "an image as `sigma` is replaced by its mean, with a note",
    },
    SupportedElement {
        name: "`conductor`, `metal`, `mirror`",
        support: "`eta` and `k`, or `reflectance`; `Kr`; `roughness`, `uroughness`, `vroughness`, \
                  `remaproughness`",
        limits: "images as `eta` or `k` are noted",
    },
    SupportedElement {
        name: "`dielectric`, `thindielectric`, `glass`",
        support: "`eta` or `index`, `Kr`, `Kt`, roughness",
        limits: "dispersion is noted",
    },
    SupportedElement {
        name: "`coateddiffuse`, `plastic`, `substrate`, `uber`",
        support: "the model `plastic`; `opacity` as a mask",
        limits: "the size of the difference is noted; media between layers are not supported",
    },
    SupportedElement {
        name: "`coatedconductor`",
        support: "the conductor, with its index relative to the coat",
        limits: "the size of the difference is noted",
    },
    SupportedElement {
        name: "`diffusetransmission`, `translucent`",
        support: "the model `translucent`: `reflectance`, `transmittance` and `scale`; `Kd`, \
                  `reflect` and `transmit`",
        limits: "`Ks` is noted",
    },
    SupportedElement {
        name: "`mix`",
        support: "`materials` and `amount`, a number or a texture, in version 3 also a colour: one of the \
                  two is drawn at every vertex",
        limits: "a coloured `amount` becomes grey, with a note",
    },
    SupportedElement {
        name: "`interface`, `none`",
        support: "transmits everything",
        limits: "media are noted",
    },
    SupportedElement {
        name: "`disney`",
        support: "the model `disney`",
        limits: "noted",
    },
    SupportedElement {
        name: "`displacement`, `bumpmap`, `normalmap`",
        support: "bump maps and normal maps",
        limits: "",
    },
    SupportedElement {
        name: "other materials",
        support: "",
        limits: "replaced by a diffuse one, with a note",
    },
    SupportedElement {
        name: "`rgb`, `xyz`, `blackbody`, `spectrum`",
        support: "linear sRGB; named metals, glasses and illuminants, and files of samples",
        limits: "",
    },
    SupportedElement {
        name: "`constant`, `scale`, `mix`",
        support: "images that repeat together become one; those that are clamped need the same map",
        limits: "of others all but one are replaced by their mean, with a note",
    },
    SupportedElement {
        name: "`imagemap`",
        support: "`filename`, `encoding` or `gamma`, `wrap`, `filter`, `scale`, `invert`, \
                  `uscale`, `vscale`, `udelta`, `vdelta`",
        limits: "other mappings are replaced by the mean, with a note",
    },
    SupportedElement {
        name: "`checkerboard`",
        support: "two colours or images",
        limits: "mappings other than `uv`, and 3 dimensions, are replaced by the mean, with a \
                 note; images that do not repeat with the fields by their mean",
    },
    SupportedElement {
        name: "`dots`, `bilerp`, `uv`",
        support: "images that are computed; those of `inside` and `outside` as in `checkerboard`",
        limits: "other cells have dots than in pbrt; `bilerp` is clamped to coordinates from 0 to \
                 1; noted",
    },
    SupportedElement {
        name: "other textures",
        support: "",
        limits: "replaced by their mean, with a note; of `ptex` by grey",
    },
    SupportedElement {
        name: "`AreaLightSource`",
        support: "`L`, `scale`, `power`, `filename`, `twosided`; in version 3 also the type `area`",
        limits: "lights with an `alpha` of 0 are visible, with a note; those on an interface are \
                 ignored in version 4, as in pbrt, with a note",
    },
    SupportedElement {
        name: "`point`, `distant`",
        support: "`I` or `L`, `scale`, `power` or `illuminance`, `from`, `to`",
        limits: "",
    },
    SupportedElement {
        name: "`spot`",
        support: "`coneangle`, `conedeltaangle`",
        limits: "the size of the difference of its falloff is noted",
    },
    SupportedElement {
        name: "`projection`",
        support: "`fov`; `filename`, `scale` and `power` in version 4, `mapname` and `I` in version 3",
        limits: "the image is interpolated, with a note",
    },
    SupportedElement {
        name: "`goniometric`",
        support: "`I`, and a map: `filename` of equal areas in version 4, `mapname` by longitude \
                  and latitude in version 3; `power` in version 4",
        limits: "a map of equal areas is resampled, with a note",
    },
    SupportedElement {
        name: "`infinite`",
        support: "`L`, or a map: of equal areas in version 4, by longitude and latitude in version \
                  3; `illuminance`",
        limits: "a `portal` and further environments are noted",
    },
    SupportedElement {
        name: "`MakeNamedMedium`, `MediumInterface`",
        support: "",
        limits: "media are noted",
    },
];
