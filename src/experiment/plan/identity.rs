//! The identity of runs, references and plans, and the seeds that follow from the experiment's.
//!
//! An identity is a canonical [`Value`] of everything that decides a picture and its measurements; its hash is the
//! run's id. Names of axes and experiments, paths, and the place of the script are not part of it: renaming an axis
//! renders nothing again. Neither are threads (they never change a picture) and the tone map of the PNG files.
//!
//! All runs of one repeat share one seed, whatever their technique, so two runs use common random numbers exactly where
//! they ask for the same dimension of the same sample, and a difference between two techniques is not a difference of
//! luck in choosing seeds. References have a seed that no cell can have: were it the same, a run would share its noise
//! with the truth it is measured against and look better than it is.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Plan, RunId};
use crate::experiment::spec::{
    CellConfig, FigureKind, FigureSpec, FigureX, Measure, Point, Snapshots, TableSpec, TableValue,
};
use crate::experiment::stop::StopRule;
use crate::metrics::MetricSpec;
use crate::render::hierarchy::AccelSpec;
use crate::transport::delay;
use crate::transport::integrator::IntegratorRow;
use crate::transport::integrator::external::PYTHON;
use crate::transport::sampler::SamplerRow;
use crate::value::Value;

/// Raised whenever the meaning of an identity changes; earlier runs are then no longer found.
pub const FORMAT: i64 = 1;

/// Marks the seeds of references; no seed of a cell has this bit.
const REFERENCE_BIT: u64 = 1 << 63;

/// The seed of every cell of repeat number `repeat`.
pub fn cell_seed(experiment: u64, repeat: u32) -> u64 {
    derive("lumbre 1 seed of a cell", experiment, repeat) & !REFERENCE_BIT
}

/// The seeds of the two halves of every reference. They are the same in every experiment, so that experiments with
/// other seeds can share a reference; no cell of any of them has either.
pub fn reference_seeds() -> [u64; 2] {
    [0, 1].map(|half| derive("lumbre 1 seed of a reference", 0, half) | REFERENCE_BIT)
}

/// The seeds of the two halves of every picture that a reference is compared with: those of neither a cell nor a
/// reference, because a comparison takes both for independent.
pub fn second_seeds() -> [u64; 2] {
    [2, 3].map(|half| derive("lumbre 1 seed of a reference", 0, half) | REFERENCE_BIT)
}

/// The seed of what is rendered before a cell's clock starts and thrown away: that of nothing else.
pub fn warmup_seed() -> u64 {
    derive("lumbre 1 seed of a warm-up", 0, 0) | REFERENCE_BIT
}

fn derive(context: &str, experiment: u64, repeat: u32) -> u64 {
    let mut material = [0; 12];
    material[..8].copy_from_slice(&experiment.to_le_bytes());
    material[8..].copy_from_slice(&repeat.to_le_bytes());
    let key = blake3::derive_key(context, &material);
    key[..8].iter().rev().fold(0, |seed, byte| seed << 8 | u64::from(*byte))
}

/// The id of an identity: the first 32 hex digits of its hash.
pub fn run_id(identity: &Value) -> RunId {
    RunId(digest(identity)[..32].to_owned())
}

/// The hash of a file's content.
///
/// # Errors
/// When it cannot be read.
pub fn of_file(file: &Path) -> std::io::Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(std::fs::File::open(file)?)?;
    Ok(hasher.finalize())
}

/// What decides a picture, but for its seed and its end. The configuration has nothing left open.
pub(super) fn picture(
    config: &CellConfig,
    row: &IntegratorRow,
    sampler: &SamplerRow,
    scene_hash: &[u8; 32],
) -> BTreeMap<String, Value> {
    let kind = config.filter.kind.name();
    let mut params = config.params.clone();
    params.remove(PYTHON.key);
    let integrator = map([
        ("name", row.name.into()),
        ("revision", Value::Int(i64::from(row.revision))),
        ("params", Value::Map(params)),
    ]);
    let filter = map([("kind", kind.into()), ("radius", Value::number(f64::from(config.filter.radius)))]);
    let sampler = map([("name", sampler.name.into()), ("revision", Value::Int(i64::from(sampler.revision)))]);
    // What may have been rendered by another backend than its own must not pass for what cannot.
    let backend = if config.fallback.is_some() { "auto" } else { config.backend.as_str() };
    let whole = |n: Option<u32>| n.map_or(Value::Nil, |n| Value::Int(i64::from(n)));
    let resolution = config.resolution.map_or(Value::Nil, |r| Value::List(r.map(|n| Value::Int(i64::from(n))).into()));
    let fields = [
        ("format", Value::Int(FORMAT)),
        ("scene", Value::Str(blake3::Hash::from_bytes(*scene_hash).to_hex().to_string())),
        ("integrator", integrator),
        ("resolution", resolution),
        ("max_depth", whole(config.max_depth)),
        ("rr_start", whole(config.rr_start)),
        ("filter", filter),
        ("sampler", sampler),
        ("backend", backend.into()),
    ];
    // Left out where there are none, so that runs without layers and bins keep the ids they had before these existed.
    let films: Vec<Value> = config.films.iter().map(|layer| layer.row().name.into()).collect();
    let films = (!films.is_empty()).then_some(("films", Value::List(films)));
    let film = config.timing.as_ref().map(|timing| ("film", timing.to_film(false)));
    let delays = film.is_some().then_some(("delays", Value::Int(i64::from(delay::REVISION))));
    let mut picture: BTreeMap<String, Value> =
        fields.into_iter().chain(films).chain(film).chain(delays).map(|(key, value)| (key.to_owned(), value)).collect();
    put_accel(&mut picture, &config.accel);
    picture
}

/// Says how the hierarchy is built and paths go, in place of what was said before: nothing where it is as it was when
/// nothing could be said, for the same reason. It changes no picture, but what a run measures.
pub(super) fn put_accel(picture: &mut BTreeMap<String, Value>, accel: &AccelSpec) {
    let accel = accel.identity();
    match accel.is_empty() {
        true => drop(picture.remove("accel")),
        false => drop(picture.insert("accel".to_owned(), Value::Map(accel))),
    }
}

/// A picture with its seed and end.
pub(super) fn run(mut picture: BTreeMap<String, Value>, seed: u64, stop: Value) -> BTreeMap<String, Value> {
    picture.insert("seed".to_owned(), seed_value(seed));
    picture.insert("stop".to_owned(), stop);
    picture
}

/// The stem of a rendered reference: a picture with the seeds of its halves. References with one stem differ only in
/// when they end, so that one can be the beginning of another. `part` is the number of samples per pixel of each part, where
/// there are several: the last bits of sums depend on it.
pub(super) fn stem(
    mut picture: BTreeMap<String, Value>,
    seeds: [u64; 2],
    part: Option<u64>,
) -> BTreeMap<String, Value> {
    picture.insert("halves".to_owned(), Value::List(seeds.map(seed_value).into()));
    // Left out where there are none, so that references keep the ids they had before there were parts.
    if let Some(samples) = part {
        picture.insert("part".to_owned(), Value::Int(i64::try_from(samples).unwrap_or(i64::MAX)));
    }
    picture
}

/// A stem with its end: the identity of a rendered reference.
pub(super) fn reference(mut stem: BTreeMap<String, Value>, stop: Value) -> Value {
    stem.insert("stop".to_owned(), stop);
    Value::Map(stem)
}

fn seed_value(seed: u64) -> Value {
    Value::Str(format!("{seed:016x}"))
}

/// A run with its measurements: the identity of a cell.
pub(super) fn cell(mut run: BTreeMap<String, Value>, measure: Value, reference: Option<&RunId>) -> Value {
    run.insert("measure".to_owned(), measure);
    run.insert("reference".to_owned(), reference.map_or(Value::Nil, |id| Value::Str(id.0.clone())));
    Value::Map(run)
}

/// The identity of a reference that comes from a file: its content, wherever it lies.
pub(super) fn reference_file(content: &blake3::Hash) -> Value {
    map([("format", Value::Int(FORMAT)), ("file", Value::Str(content.to_hex().to_string()))])
}

/// What decides the measurements and the kept pictures of a run; `measured` says whether it has a reference, without
/// which no metric counts. `every_s` is part of it because it decides when metrics are computed and thus what a rule
/// with `hold` sees, and names of columns because the run's files bear them. The tone map of the PNG files is not,
/// since the EXR files beside them do not depend on it.
pub(super) fn measure(measure: &Measure, measured: bool) -> Value {
    let metric = |m: &MetricSpec| map([("column", m.column.as_str().into()), ("value", m.identity())]);
    let metrics = if measured { measure.metrics.iter().map(metric).collect() } else { Vec::new() };
    let keep = match measure.snapshots {
        Snapshots::Last => "last",
        Snapshots::Pow2 => "pow2",
    };
    let fields =
        [("every_s", Value::number(measure.every_s)), ("metrics", Value::List(metrics)), ("keep", keep.into())];
    // Left out where there are none, so that runs without captures keep the ids they had before captures existed.
    let captures = measure.captures.then_some(("captures", "every".into()));
    Value::Map(fields.into_iter().chain(captures).map(|(key, value)| (key.to_owned(), value)).collect())
}

/// A cell's stop rule. A predicate is identified by the script's hash and the point at which it was made, because a
/// function may remember the point; its number is left out, since it depends on which other points were asked for.
pub(super) fn cell_stop(rule: &StopRule, script_hash: &[u8; 32], point: &Point) -> Value {
    rule.canonical(&|_| {
        let point = point.iter().map(|(name, value)| (name.clone(), value.clone())).collect();
        map([("script", hex(script_hash)), ("point", Value::Map(point))])
    })
}

/// A reference's stop rule. Its predicates are identified by the script's hash and their number, so that the points
/// which share a reference go on sharing it.
pub(super) fn reference_stop(rule: &StopRule, script_hash: &[u8; 32]) -> Value {
    rule.canonical(&|id| map([("script", hex(script_hash)), ("number", Value::Int(id as i64))]))
}

/// The hash of a plan, 32 hex digits: its name, its cells with their points, its figures and tables.
pub(super) fn plan_hash(plan: &Plan) -> String {
    let cell = |cell: &super::Cell| {
        let point = cell.point.iter().flat_map(|(name, value)| [Value::from(name.as_str()), value.clone()]).collect();
        Value::List(vec![Value::Str(cell.id.0.clone()), Value::Int(i64::from(cell.repeat)), Value::List(point)])
    };
    let whole = map([
        ("format", Value::Int(FORMAT)),
        ("name", plan.name.as_str().into()),
        ("cells", Value::List(plan.cells.iter().map(cell).collect())),
        ("figures", Value::List(plan.figures.iter().map(figure).collect())),
        ("tables", Value::List(plan.tables.iter().map(table).collect())),
    ]);
    digest(&whole)[..32].to_owned()
}

fn figure(figure: &FigureSpec) -> Value {
    let mut fields = match &figure.kind {
        FigureKind::Convergence { x, y } => {
            let x = match x {
                FigureX::RenderS => "render_s",
                FigureX::Samples => "samples",
            };
            vec![("x", x.into()), ("y", texts(y))]
        }
        FigureKind::Sweep { over, y } => {
            vec![("over", over.as_str().into()), ("y", Value::List(y.iter().map(shown).collect()))]
        }
    };
    fields.extend([
        ("name", figure.name.as_str().into()),
        ("by", figure.by.as_deref().map_or(Value::Nil, Value::from)),
        ("facet", texts(&figure.facet)),
    ]);
    if !figure.only.is_empty() {
        let kept = figure.only.iter().map(|(axis, values)| (axis.clone(), Value::List(values.clone())));
        fields.push(("only", Value::Map(kept.collect())));
    }
    map(fields)
}

fn shown(value: &TableValue) -> Value {
    match value {
        TableValue::Metric(column) => map([("metric", column.as_str().into())]),
        TableValue::Samples => "samples".into(),
        TableValue::RenderS => "render_s".into(),
        TableValue::MpathsPerS => "mpaths_per_s".into(),
        TableValue::Fps => "fps".into(),
        TableValue::MraysPerS => "mrays_per_s".into(),
        TableValue::AccelBuildS => "accel_build_s".into(),
        TableValue::AccelNodes => "accel_nodes".into(),
        TableValue::AccelMib => "accel_mib".into(),
        TableValue::AccelCost => "accel_cost".into(),
        TableValue::TimeTo { column, threshold } => {
            map([("time_to", column.as_str().into()), ("threshold", Value::number(*threshold))])
        }
    }
}

fn table(table: &TableSpec) -> Value {
    let formats = table.formats.iter().map(|f| Value::Str(format!("{f:?}").to_lowercase())).collect();
    map([
        ("name", table.name.as_str().into()),
        ("value", shown(&table.value)),
        ("rows", texts(&table.rows)),
        ("cols", texts(&table.cols)),
        ("formats", Value::List(formats)),
    ])
}

fn texts(texts: &[String]) -> Value {
    Value::List(texts.iter().map(|t| t.as_str().into()).collect())
}

fn hex(hash: &[u8; 32]) -> Value {
    Value::Str(blake3::Hash::from_bytes(*hash).to_hex().to_string())
}

fn digest(value: &Value) -> String {
    let mut hasher = blake3::Hasher::new();
    value.hash_into(&mut hasher);
    hasher.finalize().to_hex().to_string()
}

fn map<'a>(fields: impl IntoIterator<Item = (&'a str, Value)>) -> Value {
    Value::Map(fields.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn no_two_repeats_share_a_seed_and_no_reference_shares_one_with_a_cell() {
        let mut seeds = BTreeSet::new();
        for seed in reference_seeds().into_iter().chain(second_seeds()).chain([warmup_seed()]) {
            assert!(seeds.insert(seed) && seed >= REFERENCE_BIT);
        }
        for experiment in [0, 1, 20_260_427, u64::MAX] {
            assert!((0..1000).all(|repeat| seeds.insert(cell_seed(experiment, repeat))));
            assert!((0..1000).all(|repeat| cell_seed(experiment, repeat) < REFERENCE_BIT));
        }
    }

    #[test]
    fn seeds_are_the_same_on_every_machine_and_in_every_version() {
        assert_eq!(cell_seed(1, 0), SEED_OF_EXPERIMENT_1);
        assert_eq!(run_id(&Value::Nil).0.len(), 32);
    }

    /// Written down once: a change of this number makes every finished run unreachable.
    const SEED_OF_EXPERIMENT_1: u64 = 6_808_896_390_189_072_400;
}
