//! Bidirectional path tracing [Veach 1997, ch. 10]: connects a subpath from the camera and one from
//! a light in every way.
//!
//! With `mis = "none"` all strategies that can find a path share it equally, by their number; this
//! preserves the mean and shows how much the densities help. If only one strategy is kept as well,
//! `mis = "none"` gives it the weight one: the estimate of that strategy alone, which is all of the
//! light of its depth if it can find every path, and part of it otherwise.

pub mod connect;
pub mod subpath;
pub mod weights;

use std::cell::RefCell;

use glam::Vec3;

use super::{Context, IntegratorRow, Settings, settings};
use crate::transport::contribution::Contribution;
use crate::transport::light::{LightPoint, SELECT_FIELD};
use crate::transport::mis::{self, Heuristic};
use crate::transport::sampler::Sampler;
use crate::value::schema::Table;
use connect::Connection;
use subpath::{Subpaths, Vertex};

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "bdpt",
    long_name: "bidirectional path tracing",
    revision: 5,
    doc: "Paths from the camera and from the lights are connected in every way, with weights that \
          favour the strategy that finds a path best [Veach 1997, ch. 10].",
    params: Table {
        name: "BdptParams",
        doc: "Parameters of `bdpt`.",
        fields: &[
            mis::FIELD,
            SELECT_FIELD,
            settings::STRATEGIES,
            settings::CONTRIBUTION,
        ],
    },
    splats: true,
    sample,
};

/// Light found by one connection, with the path that it was found along.
#[derive(Clone, Copy, Debug)]
pub struct ConnectedPath<'a> {
    /// The contribution to the film.
    pub contribution: Contribution,
    /// The MIS weight in it.
    pub weight: f64,
    /// The subpaths of the sample.
    pub subpaths: &'a Subpaths,
    /// The point of the light, if it is not the start of the light subpath: for `s <= 1` and `t >=
    /// 2`.
    pub point: Option<LightPoint>,
    /// Unit direction of the connecting edge, towards the light; zero for `s = 0`.
    pub wi: Vec3,
    /// The point of the lens.
    pub lens: Vec3,
}

thread_local! {
    /// Subpaths reused from sample to sample, so that nothing is allocated per path.
    static SUBPATHS: RefCell<Subpaths> = RefCell::default();
}

fn sample(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    sink: &mut dyn FnMut(Contribution),
) {
    SUBPATHS.with_borrow_mut(|subpaths| {
        for_each_path(context, pixel, sampler, subpaths, &mut |path| {
            sink(path.contribution)
        });
    });
}

/// Traces both subpaths of one sample and visits every path found by connecting them.
pub fn for_each_path(
    context: &Context,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    subpaths: &mut Subpaths,
    visit: &mut dyn FnMut(ConnectedPath),
) {
    let settings = context.settings;
    let h = settings.heuristic();
    if context.timed() {
        subpaths.trace::<true>(context, h, pixel, sampler);
    } else {
        subpaths.trace::<false>(context, h, pixel, sampler);
    }
    let subpaths = &*subpaths;
    let mut reporter = Reporter {
        settings,
        subpaths,
        pixel,
        visit,
    };
    let escaped = subpaths.camera.len() as u32 + 2;
    if settings.includes(0, escaped)
        && let Some(e) = &subpaths.escape
        && let Some(c) = connect::connect_s0_escaped(context, h, e, escaped)
    {
        reporter.report(c, 0, escaped);
    }
    for (z, t) in subpaths.camera.iter().zip(2..) {
        connect_camera_vertex(context, h, z, t, sampler, &mut reporter);
    }
    if settings.includes(1, 1)
        && let Some(start) = &subpaths.start
        && let Some((c, camera)) = connect::connect_s1_t1(
            context,
            h,
            &start.point,
            start.dir,
            subpaths.emitted,
            sampler,
        )
    {
        reporter.report_at(c, 1, 1, camera.pixel, camera.lens);
    }
    for (y, s) in subpaths.light.iter().zip(2..) {
        if y.connectible
            && settings.includes(s, 1)
            && let Some((c, camera)) = connect::connect_t1(context, h, y, subpaths.emitted, sampler)
        {
            reporter.report_at(c, s, 1, camera.pixel, camera.lens);
        }
    }
}

/// Connects the camera vertex number `t` to the light that it hit, to a sampled light, and to every
/// vertex of the light subpath.
fn connect_camera_vertex(
    context: &Context,
    h: Heuristic,
    z: &Vertex,
    t: u32,
    sampler: &mut Sampler,
    reporter: &mut Reporter,
) {
    let (settings, max) = (context.settings, context.max_depth);
    if settings.includes(0, t)
        && let Some(c) = connect::connect_s0(context, h, z, t)
    {
        reporter.report(c, 0, t);
    }
    if !z.connectible || t > max {
        return;
    }
    if settings.includes(1, t) {
        for z in std::iter::once(z).chain(z.lifted().as_ref()) {
            if let Some(c) = connect::connect_s1(context, h, z, sampler) {
                reporter.report(c, 1, t);
            }
        }
    }
    let light = &reporter.subpaths.light;
    for (y, s) in light.iter().zip(2..).take_while(|(_, s)| s + t - 1 <= max) {
        if y.connectible
            && settings.includes(s, t)
            && let Some(c) = connect::connect(context, h, y, z)
        {
            reporter.report(c, s, t);
        }
    }
}

/// Turns connections into contributions and passes them to a visitor.
struct Reporter<'a, 'v> {
    settings: &'a Settings,
    subpaths: &'a Subpaths,
    pixel: [u32; 2],
    visit: &'v mut dyn FnMut(ConnectedPath),
}

impl Reporter<'_, '_> {
    /// Reports a connection that contributes to the sample's own pixel.
    fn report(&mut self, c: Connection, s: u32, t: u32) {
        self.report_at(c, s, t, self.pixel, self.subpaths.lens);
    }

    /// Reports a connection that contributes to `pixel` through the lens point `lens`.
    fn report_at(&mut self, c: Connection, s: u32, t: u32, pixel: [u32; 2], lens: Vec3) {
        let weight = c.weight(self.settings);
        let value = c.unweighted * weight as f32;
        let contribution = Contribution {
            pixel,
            value,
            unweighted: c.unweighted,
            s,
            t,
            length: c.length,
        };
        (self.visit)(ConnectedPath {
            contribution,
            weight,
            subpaths: self.subpaths,
            point: c.point,
            wi: c.wi,
            lens,
        });
    }
}
