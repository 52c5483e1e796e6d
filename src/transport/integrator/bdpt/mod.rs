//! Bidirectional path tracing [Veach 1997, ch. 10]: a subpath from the camera and one from a light, joined in every way.
//!
//! With `mis = "none"` all strategies that can find a path share it equally, by their number; that keeps the mean, and
//! shows how much the densities help. With one strategy kept as well, `mis = "none"` gives it the weight one: what this
//! strategy alone would say, which is all of the light of its depth where it can find every path, and part of it where
//! it cannot.

pub mod connect;
pub mod subpath;
pub mod weights;

use std::cell::RefCell;

use glam::Vec3;

use super::{Context, IntegratorRow, settings};
use crate::transport::contribution::Contribution;
use crate::transport::light::{LightPoint, SELECT_FIELD};
use crate::transport::mis;
use crate::transport::sampler::Sampler;
use crate::value::schema::Table;
use connect::Connection;
use subpath::Subpaths;

/// The row of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "bdpt",
    long_name: "bidirectional path tracing",
    revision: 5,
    doc: "Paths from the camera and from the lights are joined in every way, weighted so that each finds what it finds \
          best [Veach 1997, ch. 10].",
    params: Table {
        name: "BdptParams",
        doc: "Parameters of `bdpt`.",
        fields: &[mis::FIELD, SELECT_FIELD, settings::STRATEGIES, settings::CONTRIBUTION],
    },
    splats: true,
    sample,
};

/// Light that was found, with all that led to it.
#[derive(Clone, Copy, Debug)]
pub struct Found<'a> {
    /// What goes to the film.
    pub contribution: Contribution,
    /// The weight in it.
    pub weight: f64,
    /// The subpaths.
    pub subpaths: &'a Subpaths,
    /// The point of the light, where it is not the start of the light subpath: for `s <= 1` and `t >= 2`.
    pub point: Option<LightPoint>,
    /// Unit direction of the edge that joins the subpaths, towards the light; zero for `s = 0`.
    pub wi: Vec3,
    /// The point of the lens.
    pub lens: Vec3,
}

thread_local! {
    /// Kept from sample to sample, so that nothing is allocated per path.
    static SUBPATHS: RefCell<Subpaths> = RefCell::default();
}

fn sample(context: &Context, pixel: [u32; 2], sampler: &mut Sampler, sink: &mut dyn FnMut(Contribution)) {
    SUBPATHS.with_borrow_mut(|subpaths| {
        each(context, pixel, sampler, subpaths, &mut |found| sink(found.contribution));
    });
}

/// One sample: makes both subpaths and hands over everything that joining them finds.
pub fn each(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    subpaths: &mut Subpaths,
    visit: &mut dyn FnMut(Found),
) {
    let settings = context.settings;
    let h = settings.heuristic();
    let max = context.max_depth;
    if context.timed() {
        subpaths.trace::<true>(context, h, pixel, sampler);
    } else {
        subpaths.trace::<false>(context, h, pixel, sampler);
    }
    let subpaths = &*subpaths;
    let mut found = |c: Connection, s: u32, t: u32, pixel: [u32; 2], lens: Vec3| {
        let weight = c.weight(settings);
        let value = c.unweighted * weight as f32;
        let contribution = Contribution { pixel, value, unweighted: c.unweighted, s, t, length: c.length };
        visit(Found { contribution, weight, subpaths, point: c.point, wi: c.wi, lens });
    };
    let escaped = subpaths.camera.len() as u32 + 2;
    if settings.wants(0, escaped)
        && let Some(e) = &subpaths.escape
        && let Some(c) = connect::escape(context, h, e, escaped)
    {
        found(c, 0, escaped, pixel, subpaths.lens);
    }
    for (z, t) in subpaths.camera.iter().zip(2..) {
        if settings.wants(0, t)
            && let Some(c) = connect::hit(context, h, z, t)
        {
            found(c, 0, t, pixel, subpaths.lens);
        }
        if !z.connectible || t > max {
            continue;
        }
        if settings.wants(1, t) {
            for z in std::iter::once(z).chain(z.raised().as_ref()) {
                if let Some(c) = connect::next_event(context, h, z, sampler) {
                    found(c, 1, t, pixel, subpaths.lens);
                }
            }
        }
        for (y, s) in subpaths.light.iter().zip(2..).take_while(|(_, s)| s + t - 1 <= max) {
            if y.connectible
                && settings.wants(s, t)
                && let Some(c) = connect::ends(context, h, y, z)
            {
                found(c, s, t, pixel, subpaths.lens);
            }
        }
    }
    if settings.wants(1, 1)
        && let Some(start) = &subpaths.start
        && let Some((c, camera)) = connect::seen(context, h, start, subpaths.emitted, sampler)
    {
        found(c, 1, 1, camera.pixel, camera.lens);
    }
    for (y, s) in subpaths.light.iter().zip(2..) {
        if y.connectible
            && settings.wants(s, 1)
            && let Some((c, camera)) = connect::lens(context, h, y, subpaths.emitted, sampler)
        {
            found(c, s, 1, camera.pixel, camera.lens);
        }
    }
}
