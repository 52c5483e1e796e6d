//! Identities of runs, references and plans, and the seeds derived from the experiment's seed.
//!
//! An identity is a canonical [`Value`] of everything that determines a picture and its
//! measurements; its hash is the run id. Names of axes and experiments, paths, and the location of
//! the script are excluded, so that renaming an axis renders nothing again, but where a stop rule is a
//! function. So are the number of threads, which never changes a picture, and the tone map of the
//! PNG files.
//!
//! All runs of one repeat share one seed, whatever their technique. Two runs thus use common random
//! numbers where they request the same dimension of the same sample, and the difference between two
//! techniques does not depend on the choice of seeds. References have seeds that no cell can have:
//! a run with the same seed would share its noise with its reference and appear better than it is.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Plan, RunId};
use crate::experiment::spec::{
    FigureKind, FigureSpec, MeasureSpec, Point, SheetSpec, Snapshots, TableSpec, TableValue,
};
use crate::experiment::stop::StopRule;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_render::Settings;
use lumbre_render::settings::LIBRARY;
use lumbre_scene_io::load::files;

/// Version of the identity format. Raising it makes all earlier runs unreachable.
pub const FORMAT: i64 = 1;

/// Bit that is set in all seeds of references and in no seed of a cell.
const REFERENCE_BIT: u64 = 1 << 63;

/// Returns the seed of every cell of repeat number `repeat`.
pub fn cell_seed(experiment: u64, repeat: u32) -> u64 {
    derive("lumbre 1 seed of a cell", experiment, repeat) & !REFERENCE_BIT
}

/// Returns the seeds of the two halves of every reference. They are the same in every experiment,
/// so that experiments with different seeds can share a reference.
pub fn reference_seeds() -> [u64; 2] {
    [0, 1].map(|half| derive("lumbre 1 seed of a reference", 0, half) | REFERENCE_BIT)
}

/// Returns the seeds of the two halves of every second picture of a bias check. They differ from
/// those of cells and references, because the comparison assumes independent pictures.
pub fn bias_check_seeds() -> [u64; 2] {
    [2, 3].map(|half| derive("lumbre 1 seed of a reference", 0, half) | REFERENCE_BIT)
}

/// Returns the seeds of the two halves of a picture that confirms a bias check, for those of the
/// picture that it replaces.
pub fn confirming_seeds(seeds: [u64; 2]) -> [u64; 2] {
    seeds.map(|seed| !seed | REFERENCE_BIT)
}

/// Returns the seed of all warm-ups, which nothing else uses.
pub fn warmup_seed() -> u64 {
    derive("lumbre 1 seed of a warm-up", 0, 0) | REFERENCE_BIT
}

/// Derives a seed from a context string and two numbers.
fn derive(context: &str, experiment: u64, repeat: u32) -> u64 {
    let mut material = [0; 12];
    material[..8].copy_from_slice(&experiment.to_le_bytes());
    material[8..].copy_from_slice(&repeat.to_le_bytes());
    let key = blake3::derive_key(context, &material);
    key[..8]
        .iter()
        .rev()
        .fold(0, |seed, byte| seed << 8 | u64::from(*byte))
}

/// Returns the id of an identity: the first 32 hex digits of its hash. Cells are hashed field by
/// field in `cell_identity.rs`, with the same result.
pub fn run_id(identity: &Value) -> RunId {
    let mut hasher = blake3::Hasher::new();
    identity.hash_into(&mut hasher);
    id_of_hash(&hasher.finalize())
}

/// Returns the id of the identity with this hash.
pub(super) fn id_of_hash(hash: &blake3::Hash) -> RunId {
    RunId(hash.to_hex()[..32].to_owned())
}

/// Returns the hash of a file's content.
///
/// # Errors
/// When it cannot be read, or is outside the folder to which files are confined.
pub fn file_hash(file: &Path) -> std::io::Result<blake3::Hash> {
    files::check(file).map_err(std::io::Error::other)?;
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(std::fs::File::open(file)?)?;
    Ok(hasher.finalize())
}

/// Returns everything that determines a picture, except for its seed and its stop rule, from settings
/// that are fully resolved.
pub(super) fn picture(settings: &Settings, scene_hash: &[u8; 32]) -> BTreeMap<String, Value> {
    let mut picture = settings.identity();
    picture.insert("format".to_owned(), Value::Int(FORMAT));
    picture.insert(SCENE.to_owned(), hex(scene_hash));
    picture
}

/// Returns the stem of a rendered reference: a picture with the seeds of its halves. References
/// with the same stem differ only in their stop rule, so that a shorter one can be continued to a
/// longer one. `shard_samples` is the number of samples per pixel of each shard, if the reference
/// is split; the last bits of its sums depend on it.
pub(super) fn stem(
    mut picture: BTreeMap<String, Value>,
    seeds: [u64; 2],
    shard_samples: Option<u64>,
) -> BTreeMap<String, Value> {
    picture.insert(
        "halves".to_owned(),
        Value::List(seeds.map(seed_value).into()),
    );
    // Omitted if not split, so that references keep the ids from before shards existed.
    if let Some(samples) = shard_samples {
        picture.insert(
            "part".to_owned(),
            Value::Int(i64::try_from(samples).unwrap_or(i64::MAX)),
        );
    }
    picture
}

/// Returns the identity of a rendered reference: a stem with its stop rule.
pub(super) fn reference(mut stem: BTreeMap<String, Value>, stop: Value) -> Value {
    stem.insert("stop".to_owned(), stop);
    Value::Map(stem)
}

/// Key of a cell's seed.
pub(super) const SEED: &str = "seed";

/// Canonical form of a seed: 16 hex digits.
pub(super) fn seed_value(seed: u64) -> Value {
    Value::Str(format!("{seed:016x}"))
}

/// Key of the hash of the scene's content in the identity of a run.
const SCENE: &str = "scene";

/// Returns the hash of the scene's content in the identity of a run, in hexadecimal. Image files have
/// none.
pub fn scene_hash(identity: &Value) -> Option<&str> {
    identity.as_map()?.get(SCENE)?.as_str()
}

/// Key of the integrator in the identity of a run.
const INTEGRATOR: &str = "integrator";

/// Returns the hash of the library that rendered a run, in hexadecimal. Only techniques of shared
/// libraries have one.
pub fn library_hash(identity: &Value) -> Option<&str> {
    let integrator = identity.as_map()?.get(INTEGRATOR)?.as_map()?;
    integrator.get(LIBRARY)?.as_str()
}

/// Key of a file's content hash in the identity of a reference from a file.
pub(super) const FILE: &str = "file";

/// Returns the identity of a reference from a file: the hash of its content, wherever it is.
pub(super) fn reference_file(content: &blake3::Hash) -> Value {
    Value::from_iter([
        ("format", Value::Int(FORMAT)),
        (FILE, Value::Str(content.to_hex().to_string())),
    ])
}

/// Returns everything that determines the measurements and the stored pictures of a run. `measured`
/// is whether it has a reference; without one, metrics are omitted. `every_s` is included because
/// it determines when metrics are computed and thus the input of rules with `hold`, and column
/// names because they occur in the run's files. The tone map of the PNG files is excluded, since
/// the EXR files beside them do not depend on it.
pub(super) fn measure(measure: &MeasureSpec, measured: bool) -> Value {
    let metric = |m: &MetricSpec| {
        Value::from_iter([
            ("column", m.column.as_str().into()),
            ("value", m.identity()),
        ])
    };
    let metrics = if measured {
        measure.metrics.iter().map(metric).collect()
    } else {
        Vec::new()
    };
    let keep = match measure.snapshots {
        Snapshots::Last => "last",
        Snapshots::Pow2 => "pow2",
    };
    let fields = [
        ("every_s", Value::number(measure.every_s)),
        ("metrics", Value::List(metrics)),
        ("keep", keep.into()),
    ];
    // Omitted if absent, so that runs keep the ids from before these existed.
    let captures = measure.captures.then_some(("captures", "every".into()));
    let films = measure.film_files.then_some(("films", "files".into()));
    Value::Map(
        fields
            .into_iter()
            .chain(captures)
            .chain(films)
            .map(|(key, value)| (key.to_owned(), value))
            .collect(),
    )
}

/// Returns the canonical form of a cell's stop rule. A predicate is identified by the script's hash
/// and the point at which it was created, because a function may depend on the point. Its number is
/// excluded, since it depends on which other points were evaluated.
pub(super) fn cell_stop(rule: &StopRule, script_hash: &[u8; 32], point: &Point) -> Value {
    rule.canonical(&|_| {
        let point = point
            .iter()
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect();
        Value::from_iter([("script", hex(script_hash)), ("point", Value::Map(point))])
    })
}

/// Returns the canonical form of a reference's stop rule. Predicates are identified by the script's
/// hash and their number, so that the points which share a reference continue to share it.
pub(super) fn reference_stop(rule: &StopRule, script_hash: &[u8; 32]) -> Value {
    rule.canonical(&|id| {
        Value::from_iter([
            ("script", hex(script_hash)),
            ("number", Value::Int(id as i64)),
        ])
    })
}

/// Returns the hash of a plan as 32 hex digits: of its name, cells with their points, figures,
/// tables and sheets.
pub(super) fn plan_hash(plan: &Plan) -> String {
    let cell = |cell: &super::Cell| {
        let point = cell
            .point
            .iter()
            .flat_map(|(name, value)| [Value::from(name.as_str()), value.clone()])
            .collect();
        Value::List(vec![
            Value::Str(cell.id.0.clone()),
            Value::Int(i64::from(cell.repeat)),
            Value::List(point),
        ])
    };
    let fields = [
        ("format", Value::Int(FORMAT)),
        ("name", plan.name.as_str().into()),
        ("cells", Value::List(plan.cells.iter().map(cell).collect())),
        (
            "figures",
            Value::List(plan.figures.iter().map(figure).collect()),
        ),
        (
            "tables",
            Value::List(plan.tables.iter().map(table).collect()),
        ),
    ];
    // Omitted if there are none, so that plans keep the hashes from before sheets existed.
    let sheet = |sheet: &SheetSpec| Value::Map(sheet.options.clone());
    let sheets = || Value::List(plan.sheets.iter().map(sheet).collect());
    let sheets = (!plan.sheets.is_empty()).then(|| ("sheets", sheets()));
    run_id(&Value::from_iter(fields.into_iter().chain(sheets))).0
}

/// Canonical form of a figure.
fn figure(figure: &FigureSpec) -> Value {
    let mut fields = match &figure.kind {
        FigureKind::Convergence { x, y } => {
            let x = x.row().name;
            vec![("x", x.into()), ("y", texts(y))]
        }
        FigureKind::Sweep { over, y } => {
            vec![
                ("over", over.as_str().into()),
                ("y", Value::List(y.iter().map(table_value).collect())),
            ]
        }
    };
    fields.extend([
        ("name", figure.name.as_str().into()),
        ("by", figure.by.as_deref().map_or(Value::Nil, Value::from)),
        ("facet", texts(&figure.facet)),
    ]);
    if !figure.only.is_empty() {
        let kept = figure
            .only
            .iter()
            .map(|(axis, values)| (axis.clone(), Value::List(values.clone())));
        fields.push(("only", Value::Map(kept.collect())));
    }
    Value::from_iter(fields)
}

/// Canonical form of a quantity.
fn table_value(value: &TableValue) -> Value {
    match value {
        TableValue::Metric(column) => Value::from_iter([("metric", column.as_str().into())]),
        TableValue::Run(column) => column.row().hashed.into(),
        TableValue::TimeTo { column, threshold } => Value::from_iter([
            ("time_to", column.as_str().into()),
            ("threshold", Value::number(*threshold)),
        ]),
    }
}

/// Canonical form of a table. The names of its formats are those of the enum in lower case.
fn table(table: &TableSpec) -> Value {
    let formats = table
        .formats
        .iter()
        .map(|f| Value::Str(format!("{f:?}").to_lowercase()))
        .collect();
    Value::from_iter([
        ("name", table.name.as_str().into()),
        ("value", table_value(&table.value)),
        ("rows", texts(&table.rows)),
        ("cols", texts(&table.cols)),
        ("formats", Value::List(formats)),
    ])
}

fn texts(texts: &[String]) -> Value {
    Value::List(texts.iter().map(|t| t.as_str().into()).collect())
}

/// Canonical form of a hash: 64 hex digits.
fn hex(hash: &[u8; 32]) -> Value {
    Value::Str(blake3::Hash::from_bytes(*hash).to_hex().to_string())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use lumbre_light::transport::delay;
    use lumbre_light::transport::integrator::integrator;
    use lumbre_light::transport::sampler::INDEPENDENT;
    use lumbre_light::transport::time_settings::Timing;

    #[test]
    fn the_revisions_of_technique_sampler_and_delays_are_in_the_identity() {
        let bins = serde_json::json!({ "time": { "start": 0, "bin": 0.5, "bins": 8 } });
        let bins = Value::from_json(&bins);
        let row = integrator("nee").unwrap();
        assert!(row.revision > 1);
        let mut settings = Settings::new(row.name);
        settings.timing = Timing::from_film(bins.as_map().unwrap(), "film").unwrap();
        let fields = picture(&settings, &[0; 32]);
        let revision = |key: &str| fields[key].as_map().unwrap()["revision"].as_i64();
        assert_eq!(revision("integrator"), Some(row.revision.into()));
        assert_eq!(revision("sampler"), Some(INDEPENDENT.revision.into()));
        assert_eq!(fields["delays"].as_i64(), Some(delay::REVISION.into()));
        settings.timing = None;
        let fields = picture(&settings, &[0; 32]);
        assert!(!fields.contains_key("delays"), "only path times have any");
    }

    #[test]
    fn no_two_repeats_share_a_seed_and_no_reference_shares_one_with_a_cell() {
        let mut seeds = BTreeSet::new();
        for seed in reference_seeds()
            .into_iter()
            .chain(bias_check_seeds())
            .chain([warmup_seed()])
        {
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

    /// Recorded value: a change of this number makes every finished run unreachable.
    const SEED_OF_EXPERIMENT_1: u64 = 6_808_896_390_189_072_400;
}
