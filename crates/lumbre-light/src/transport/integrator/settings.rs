//! The parameters of integrators, parsed once per job.

use std::collections::BTreeMap;

use super::guided::settings::Guiding;
use crate::transport::mis::Heuristic;
use crate::value::Value;
use crate::value::schema::{AUTO, Field, Ty};

/// Name of the integrator that counts hits and connections in full, whatever its parameters are.
pub const ALL_HITS: &str = "nee_sum";

/// The parameter `lights` of integrators that sample lights from the vertices of camera paths.
pub const LIGHTS: Field = crate::field! {
    lights = "one": Ty::Word(&["one", "all"]),
        "whether a vertex is connected to one light, chosen at random, or to every light in turn, \
         as in S0 (docs/inside/transport.md); the latter traces as many shadow rays as there are \
         emissive triangles, spheres and other lights"
};

/// The parameter `directions` of integrators that continue paths from surfaces by one direction.
pub const DIRECTIONS: Field = crate::field! {
    directions = "bsdf": Ty::Word(&["bsdf", "uniform"]),
        "distribution of the directions in which paths continue: that of the BSDF, or `uniform` \
         over the hemisphere of the side, and over the sphere where light is transmitted; Dirac \
         lobes are sampled in any case"
};

/// The parameter `strategies` of integrators that combine strategies.
pub const STRATEGIES: Field = crate::field! {
    strategies = "all": Ty::nums(2, 0.0, 10_000.0),
        "the one strategy { s, t } to keep: s vertices from the light, t from the camera, the lens \
         included; with mis = \"none\" its weight is one"
};

/// The parameter `contribution` of integrators that combine strategies.
pub const CONTRIBUTION: Field = crate::field! {
    contribution = "true": Ty::Bool,
        "false leaves the strategy of `strategies` out instead, and keeps all others"
};

/// The parameter `photons` of integrators that trace photons or share light subpaths.
pub const PHOTONS: Field = Field {
    key: "photons",
    ty: Ty::OrAuto(&Ty::int(1, 1 << 28)),
    required: false,
    default: AUTO,
    doc: "number of photons (light subpaths) that each iteration (one sample of every pixel) \
          traces from the lights; auto takes the number of pixels",
};

/// The parameter `connections` of integrators that choose vertices of light subpaths.
pub const CONNECTIONS: Field = crate::field! {
    connections = "1": Ty::int(1, 1024),
        "number of vertices of light subpaths with which each camera vertex is connected"
};

/// The parameter `candidates` of integrators that choose vertices of light subpaths by resampling.
pub const CANDIDATES: Field = crate::field! {
    candidates = "8": Ty::int(1, 1024),
        "number of vertices that are drawn for each connection, of which one is chosen in \
         proportion to the light that it would bring without occlusion; 1 connects the drawn vertex"
};

/// The parameter `radius` of integrators that gather photons.
pub const RADIUS: Field = Field {
    key: "radius",
    ty: Ty::OrAuto(&Ty::num(1e-6, 1e6)),
    required: false,
    default: AUTO,
    doc: "radius of the first iteration within which photons are gathered, in scene units; auto \
          takes three times the median width of a pixel on the surfaces that the camera sees, and \
          once where connections find light as well",
};

/// The parameter `alpha` of integrators that gather photons.
pub const ALPHA: Field = crate::field! {
    alpha = "2/3": Ty::num(0.0, 1.0),
        "how slowly the radius shrinks: in iteration i it is radius * i^((alpha - 1) / 2); 1 keeps \
         the radius and its bias, less gives less bias and more noise"
};

/// The parameter `join` of integrators that connect and merge vertices.
pub const JOIN: Field = crate::field! {
    join = "both": Ty::Word(&["both", "connect", "merge"]),
        "how light subpaths are joined with camera subpaths: \"connect\" gives the samples of \
         bdpt, \"merge\" only gathers their vertices, as photon mapping does, and adds light that \
         camera paths hit"
};

/// Ways of joining light subpaths with camera subpaths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Join {
    /// By connections and by merging.
    Both,
    /// By connections alone.
    Connect,
    /// By merging alone.
    Merge,
}

impl Join {
    /// Returns the value that the parameter [`JOIN`] names.
    fn from_params(params: &BTreeMap<String, Value>) -> Join {
        match params.get(JOIN.key).and_then(Value::as_str) {
            Some("connect") => Join::Connect,
            Some("merge") => Join::Merge,
            _ => Join::Both,
        }
    }
}

/// Returns whether parameters ask for uniform directions: see [`DIRECTIONS`].
pub fn has_uniform_directions(params: &BTreeMap<String, Value>) -> bool {
    params.get(DIRECTIONS.key).and_then(Value::as_str) == Some("uniform")
}

/// The parameters of all integrators; those that an integrator does not have keep their default.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Heuristic of the weights; `None` if strategies are not weighted by densities.
    pub mis: Option<Heuristic>,
    /// Whether light that paths hit counts in full beside that of connections, as by [`ALL_HITS`].
    pub all_hits: bool,
    /// Whether every light is sampled at every vertex.
    pub all_lights: bool,
    /// Whether paths continue in uniform directions instead of those of the BSDF.
    pub uniform_directions: bool,
    /// The strategy `[s, t]` that is kept or left out.
    pub one: Option<[u32; 2]>,
    /// Whether that strategy is kept rather than left out.
    pub keep: bool,
    /// Number of photons of an iteration; `None` is the number of pixels.
    pub photons: Option<u32>,
    /// Radius of the first iteration within which photons are gathered, in scene units; `None`
    /// derives it from the size of pixels.
    pub radius: Option<f32>,
    /// Exponent of the radius: see [`ALPHA`].
    pub alpha: f32,
    /// Way of joining light subpaths with camera subpaths.
    pub join: Join,
    /// Number of connections of a camera vertex with chosen vertices of light subpaths.
    pub connections: u32,
    /// Number of vertices that are drawn for each such connection.
    pub candidates: u32,
    /// Parameters of [`guided`](super::guided).
    pub guiding: Guiding,
}

impl Settings {
    /// Returns the number of photons or light subpaths of an iteration for a picture of `pixels` pixels:
    /// see [`PHOTONS`].
    pub fn light_paths(&self, pixels: u64) -> u64 {
        self.photons.map_or(pixels, u64::from)
    }

    /// Parses parameters of the integrator with this name that satisfy its schema.
    pub fn of(integrator: &str, params: &BTreeMap<String, Value>) -> Settings {
        let all_hits = integrator == ALL_HITS;
        let settings = Settings::new(params);
        Settings {
            mis: settings.mis.filter(|_| !all_hits),
            all_hits,
            ..settings
        }
    }

    /// Parses parameters that satisfy the schema of an integrator other than [`ALL_HITS`].
    pub fn new(params: &BTreeMap<String, Value>) -> Settings {
        let one = match params.get(STRATEGIES.key) {
            Some(Value::List(pair)) => {
                let at = |i: usize| pair.get(i).and_then(Value::as_f64).unwrap_or(0.0) as u32;
                Some([at(0), at(1)])
            }
            _ => None,
        };
        let number = |field: Field| params.get(field.key).and_then(Value::as_f64);
        Settings {
            mis: Heuristic::from_params(params),
            all_hits: false,
            all_lights: params.get(LIGHTS.key).and_then(Value::as_str) == Some("all"),
            uniform_directions: has_uniform_directions(params),
            one,
            keep: !matches!(params.get(CONTRIBUTION.key), Some(Value::Bool(false))),
            photons: number(PHOTONS).map(|photons| photons as u32),
            radius: number(RADIUS).map(|radius| radius as f32),
            alpha: number(ALPHA).map_or(2.0 / 3.0, |alpha| alpha as f32),
            join: Join::from_params(params),
            connections: number(CONNECTIONS).map_or(1, |connections| connections as u32),
            candidates: number(CANDIDATES).map_or(8, |candidates| candidates as u32),
            guiding: Guiding::from_params(params),
        }
    }

    /// Returns the heuristic for integrators that weight every strategy: uniform if none is set.
    #[inline]
    pub fn heuristic(&self) -> Heuristic {
        self.mis.unwrap_or(Heuristic::Uniform)
    }

    /// Returns whether a single strategy is kept with the weight one.
    #[inline]
    pub fn unweighted(&self) -> bool {
        self.mis.is_none() && self.one.is_some() && self.keep
    }

    /// Returns whether the strategy of `s` light vertices and `t` camera vertices is enabled.
    #[inline]
    pub fn includes(&self, s: u32, t: u32) -> bool {
        self.one.is_none_or(|one| (one == [s, t]) == self.keep)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absent_keys_are_defaults_and_given_ones_are_read() {
        let plain = Settings::new(&BTreeMap::new());
        assert_eq!(
            plain,
            Settings {
                mis: Some(Heuristic::Power),
                all_hits: false,
                all_lights: false,
                uniform_directions: false,
                one: None,
                keep: true,
                photons: None,
                radius: None,
                alpha: 2.0 / 3.0,
                join: Join::Both,
                connections: 1,
                candidates: 8,
                guiding: Guiding::from_params(&BTreeMap::new()),
            }
        );
        assert!(plain.includes(3, 4) && !plain.unweighted());
        let pair = Value::List(vec![Value::Int(2), Value::Int(3)]);
        let given = [
            ("mis", "none".into()),
            ("lights", "all".into()),
            ("directions", "uniform".into()),
            ("strategies", pair),
            ("photons", Value::Int(5)),
            ("radius", Value::Num(0.25)),
            ("alpha", Value::Num(0.5)),
            ("join", "merge".into()),
            ("connections", Value::Int(3)),
            ("candidates", Value::Int(5)),
        ];
        let mut params: BTreeMap<String, Value> =
            given.map(|(k, v): (&str, Value)| (k.to_owned(), v)).into();
        let one = Settings::new(&params);
        assert_eq!(
            one,
            Settings {
                mis: None,
                all_hits: false,
                all_lights: true,
                uniform_directions: true,
                one: Some([2, 3]),
                keep: true,
                photons: Some(5),
                radius: Some(0.25),
                alpha: 0.5,
                join: Join::Merge,
                connections: 3,
                candidates: 5,
                guiding: plain.guiding,
            }
        );
        assert!(one.unweighted() && one.includes(2, 3) && !one.includes(3, 2));
        params.insert("contribution".to_owned(), Value::Bool(false));
        let others = Settings::new(&params);
        assert!(!others.unweighted() && !others.includes(2, 3) && others.includes(3, 2));
    }
}
