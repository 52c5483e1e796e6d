//! Bidirectional path tracing [Veach 1997, ch. 10]: a subpath from the camera and one from a light, joined in every way.
//!
//! With `mis = "none"` all strategies that can find a path share it equally, by their number; that keeps the mean, and
//! shows how much the densities help. With one strategy kept as well, `mis = "none"` gives it the weight one: what this
//! strategy alone would say, which is all of the light of its depth where it can find every path, and part of it where
//! it cannot.

mod connect;
pub mod subpath;
mod weights;

use std::cell::RefCell;
use std::collections::BTreeMap;

use super::{Context, IntegratorRow};
use crate::transport::contribution::Contribution;
use crate::transport::light::{LightPoint, SELECT_FIELD};
use crate::transport::mis::{self, Heuristic};
use crate::transport::sampler::Sampler;
use crate::value::Value;
use crate::value::schema::{Field, Table, Ty};
use connect::Connection;
use subpath::Subpaths;

/// The row of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "bdpt",
    long_name: "bidirectional path tracing",
    revision: 1,
    doc: "Paths from the camera and from the lights are joined in every way, weighted so that each finds what it finds \
          best [Veach 1997, ch. 10].",
    params: Table {
        name: "BdptParams",
        doc: "Parameters of `bdpt`.",
        fields: &[
            mis::FIELD,
            SELECT_FIELD,
            Field {
                key: "strategies",
                ty: Ty::Nums { len: 2, min: 0.0, max: 10_000.0 },
                required: false,
                default: "all",
                doc: "the one strategy { s, t } to keep: s vertices from the light, t from the camera, the lens included; \
                      with mis = \"none\" its weight is one",
            },
            Field {
                key: "contribution",
                ty: Ty::Bool,
                required: false,
                default: "true",
                doc: "false leaves the strategy of `strategies` out instead, and keeps all others",
            },
        ],
    },
    sample,
};

/// The parameters of a script, typed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How strategies are weighted.
    pub heuristic: Heuristic,
    /// The strategy that is kept or left out.
    pub one: Option<[u32; 2]>,
    /// Whether it is kept.
    pub keep: bool,
    /// Whether every weight is one.
    pub raw: bool,
}

impl Settings {
    /// From parameters that their schema has checked.
    pub fn new(params: &BTreeMap<String, Value>) -> Settings {
        let one = match params.get("strategies") {
            Some(Value::List(pair)) => {
                let at = |i: usize| pair.get(i).and_then(Value::as_f64).unwrap_or(0.0) as u32;
                Some([at(0), at(1)])
            }
            _ => None,
        };
        let keep = !matches!(params.get("contribution"), Some(Value::Bool(false)));
        let heuristic = Heuristic::from_params(params);
        Settings {
            heuristic: heuristic.unwrap_or(Heuristic::Uniform),
            one,
            keep,
            raw: heuristic.is_none() && one.is_some() && keep,
        }
    }

    #[inline]
    fn wants(&self, s: u32, t: u32) -> bool {
        self.one.is_none_or(|one| (one == [s, t]) == self.keep)
    }
}

/// Light that was found, with all that led to it.
#[derive(Clone, Copy, Debug)]
pub struct Found<'a> {
    /// What goes to the film.
    pub contribution: Contribution,
    /// The weight in it.
    pub weight: f64,
    /// The subpaths.
    pub subpaths: &'a Subpaths,
    /// The point of the light that was sampled for `s = 1`.
    pub sampled: Option<LightPoint>,
}

thread_local! {
    /// Kept from sample to sample, so that nothing is allocated per path.
    static SUBPATHS: RefCell<Subpaths> = RefCell::default();
}

fn sample(context: &Context, pixel: [u32; 2], sampler: &mut Sampler, sink: &mut dyn FnMut(Contribution)) {
    let settings = Settings::new(context.params);
    SUBPATHS.with_borrow_mut(|subpaths| {
        each(context, &settings, pixel, sampler, subpaths, &mut |found| sink(found.contribution));
    });
}

/// One sample: makes both subpaths and hands over everything that joining them finds.
pub fn each(
    context: &Context,
    settings: &Settings,
    pixel: [u32; 2],
    sampler: &mut Sampler,
    subpaths: &mut Subpaths,
    visit: &mut dyn FnMut(Found),
) {
    let h = settings.heuristic;
    let max = context.max_depth;
    subpaths.trace_camera(context, h, pixel, max, sampler);
    subpaths.trace_light(context, h, max.saturating_sub(2), sampler);
    let subpaths = &*subpaths;
    let mut found = |c: Connection, s: u32, t: u32, sampled: Option<LightPoint>| {
        let weight = if settings.raw { 1.0 } else { 1.0 / (1.0 + c.others) };
        let value = c.unweighted * weight as f32;
        let contribution = Contribution { pixel, value, unweighted: c.unweighted, s, t };
        visit(Found { contribution, weight, subpaths, sampled });
    };
    for (z, t) in subpaths.camera.iter().zip(2..) {
        if settings.wants(0, t)
            && let Some(c) = connect::hit(context, h, z, t)
        {
            found(c, 0, t, None);
        }
        if !z.connectible || t > max {
            continue;
        }
        if settings.wants(1, t)
            && let Some((c, point)) = connect::next_event(context, h, z, sampler)
        {
            found(c, 1, t, Some(point));
        }
        for (y, s) in subpaths.light.iter().zip(2..).take_while(|(_, s)| s + t - 1 <= max) {
            if y.connectible
                && settings.wants(s, t)
                && let Some(c) = connect::ends(context, h, y, z)
            {
                found(c, s, t, None);
            }
        }
    }
}
