//! FLIP, the perceived difference of two images that alternate on a display [Andersson et al.
//! 2020], and HDR-FLIP, its maximum over a range of exposures [Andersson et al. 2021].
//!
//! Both are implemented from the papers and equal the authors' program within single precision.

mod difference;
mod exposure;
mod filters;

use std::collections::BTreeMap;

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::tonemap::srgb_light;
use super::{DEFAULTS, MetricRow, MetricSpec, ON};
use difference::Target;
use exposure::{Exposures, ToneMapper};
use lumbre_light::field;
use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{Field, Table, Ty};

/// Option of the number of pixels per degree of visual angle.
const PPD: Field = field! {
    ppd = "67.0206": Ty::num(1.0, 1000.0),
        "pixels per degree of visual angle; the default is 3840 pixels over 0.7 m seen from 0.7 m"
};

/// Table row of the metric `flip`.
pub const ROW: MetricRow = MetricRow {
    name: "flip",
    label: "FLIP",
    long_name: "perceived difference on a display",
    doc: "Mean FLIP of what an sRGB display shows [Andersson et al. 2020], equal to the authors' program. Without a tone \
          map, radiance clamped to 0..1 is what the display emits.",
    options: Table {
        name: "FlipOptions",
        doc: "Options of `flip`.",
        fields: &[PPD, ON],
    },
    eval: |image, reference, spec| mean(&ldr(image, reference, spec)),
    prepare: Some(|reference, spec| {
        let shown = shown(spec);
        let target = Target::new(reference, spec.number(PPD.key), &shown);
        Box::new(move |image| mean(&target.difference(image, &shown)))
    }),
    map: Some(PixelMap {
        eval: ldr,
        colours: Colours::Magma,
        top: Some(1.0),
    }),
    noise: Noise::Bounds,
    ..DEFAULTS
};

/// Table row of the metric `hdr_flip`.
pub const HDR_ROW: MetricRow = MetricRow {
    name: "hdr_flip",
    label: "HDR-FLIP",
    long_name: "perceived difference over exposures",
    doc: "Mean over pixels of the largest FLIP over a range of exposures [Andersson et al. 2021], equal to the authors' \
          program. Exposures that are not given follow from the reference.",
    options: Table {
        name: "HdrFlipOptions",
        doc: "Options of `hdr_flip`, which takes linear radiance and maps it itself.",
        fields: &[
            PPD,
            field! {
                tonemapper = "aces": Ty::Word(exposure::NAMES),
                    "tone mapper from exposed radiance to display values"
            },
            field! {
                start = "auto": Ty::OrAuto(&Ty::num(-100.0, 100.0)),
                    "first exposure in stops; `auto` maps the reference's brightest pixel to 0.85"
            },
            field! {
                stop = "auto": Ty::OrAuto(&Ty::num(-100.0, 100.0)),
                    "last exposure in stops; `auto` maps the reference's median luminance to 0.85"
            },
            field! {
                exposures = "auto": Ty::OrAuto(&Ty::int(2, 64)),
                    "number of evenly spaced exposures; `auto` is one per stop, at least 2"
            },
        ],
    },
    eval: |image, reference, spec| mean(&hdr(image, reference, spec)),
    map: Some(PixelMap {
        eval: hdr,
        colours: Colours::Magma,
        top: Some(1.0),
    }),
    noise: Noise::Bounds,
    settle: Some(|reference, spec| {
        let Exposures { start, stop, count } = exposures(reference, spec);
        BTreeMap::from([
            ("start".to_owned(), Value::number(start)),
            ("stop".to_owned(), Value::number(stop)),
            ("exposures".to_owned(), Value::Int(count as i64)),
        ])
    }),
    ..DEFAULTS
};

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// FLIP of every pixel. Values are sRGB display values with a tone map, and linear light without.
fn ldr(image: &Image, reference: &Image, spec: &MetricSpec) -> Vec<f32> {
    let (ppd, shown) = (spec.number(PPD.key), shown(spec));
    Target::new(reference, ppd, &shown).difference(image, &shown)
}

/// Returns the function from a pixel to the linear light that an sRGB display emits.
fn shown(spec: &MetricSpec) -> impl Fn([f32; 3]) -> [f32; 3] + Copy + Send + Sync + 'static {
    let values = spec.tonemap().is_some();
    move |pixel| {
        if values {
            pixel.map(srgb_light)
        } else {
            pixel.map(|x| x.clamp(0.0, 1.0))
        }
    }
}

fn exposures(reference: &Image, spec: &MetricSpec) -> Exposures {
    let given = |key: &str| spec.option(key).and_then(|v| v.as_f64());
    let count = spec
        .option("exposures")
        .and_then(|v| v.as_i64())
        .and_then(|n| usize::try_from(n).ok());
    Exposures::new(
        reference,
        tone_mapper(spec),
        [given("start"), given("stop")],
        count,
    )
}

fn tone_mapper(spec: &MetricSpec) -> ToneMapper {
    let name = spec.option("tonemapper");
    ToneMapper::named(name.as_ref().and_then(Value::as_str).unwrap_or_default())
}

/// HDR-FLIP of every pixel, in row order.
fn hdr(image: &Image, reference: &Image, spec: &MetricSpec) -> Vec<f32> {
    let (ppd, tone) = (spec.number(PPD.key), tone_mapper(spec));
    let mut worst = vec![0.0f32; image.data.len()];
    for scale in exposures(reference, spec).scales() {
        let shown = |p: [f32; 3]| tone.apply(p.map(|x| x * scale));
        let now = Target::new(reference, ppd, &shown).difference(image, &shown);
        for (worst, now) in worst.iter_mut().zip(now) {
            // `max` would lose a NaN.
            if now.is_nan() || now > *worst {
                *worst = now;
            }
        }
    }
    worst
}
