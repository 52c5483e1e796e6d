//! Reference page of files, generated from the structures of the schema.

use super::RecordRow;
use super::device::{DEVICE, FEATURES, PEER};
use super::journal::{
    FORECAST, MessageRecord, NightStart, RunEnd, RunStart, ShardEnd, ShardRecord, ShardStart,
    WaveRecord,
};
use super::plan::{
    BiasCheckPlan, EnvFile, FileReference, JobFile, Measurement, MetricRecord, NightNote,
    NightSettings, NotesFile, PlanFile, PlanSnapshot, PlannedCell, PresentationRecord,
    RenderedReference, SceneNote, SkippedPoint, StopRecord, SubmittedJob,
};
use super::process::{AffinityFile, ClaimFile, HeartbeatFile, IndexHeader, Owner, RenderDevice};
use super::run::{
    BiasCheckFile, CheckpointHead, ConfigFile, DifferingBlock, FailedFile, FileSum,
    ImportedReference, OpenCost, RunResults, SETTINGS, WaveCounts,
};
use super::status::{
    CellCounts, CurrentRun, FailureRecord, ReferenceCounts, ShardCounts, StatusReport,
};
use crate::columns::{CSV_FILES, CsvFile};
use lumbre_light::film::layer::LAYERS;
use lumbre_light::value::markdown::{row, sentence, table_head};

/// Structures of each file: that of the file first, then those of its parts.
const FILES: &[(&str, &[RecordRow])] = &[
    (
        "`config.json` of a run or reference",
        &[ConfigFile::ROW, SETTINGS],
    ),
    (
        "`done.json` of a run, `ref.json` of a reference",
        &[
            RunResults::ROW,
            ImportedReference::ROW,
            DEVICE,
            FEATURES,
            PEER,
            OpenCost::ROW,
            FileSum::ROW,
        ],
    ),
    ("`failed.json` of a run", &[FailedFile::ROW]),
    (
        "`bias-check-<technique>.json` of a reference",
        &[BiasCheckFile::ROW, DifferingBlock::ROW],
    ),
    (
        "`ckpt.a`, `ckpt.b`, sums of references and shards",
        &[CheckpointHead::ROW, WaveCounts::ROW],
    ),
    (
        "`plan.json`",
        &[
            PlanFile::ROW,
            NightSettings::ROW,
            Measurement::ROW,
            MetricRecord::ROW,
            PresentationRecord::ROW,
            StopRecord::ROW,
            PlannedCell::ROW,
            RenderedReference::ROW,
            BiasCheckPlan::ROW,
            FileReference::ROW,
            SkippedPoint::ROW,
            SceneNote::ROW,
        ],
    ),
    ("`env.json`", &[EnvFile::ROW]),
    ("`notes.json`", &[NotesFile::ROW, NightNote::ROW]),
    ("`snapshot.json`", &[PlanSnapshot::ROW]),
    ("`index.jsonl`", &[IndexHeader::ROW]),
    ("`claim` of a run", &[ClaimFile::ROW, Owner::ROW]),
    (
        "`workers/<worker>.json`, `planners/<worker>.json`",
        &[HeartbeatFile::ROW, RenderDevice::ROW],
    ),
    ("`affinity/<group>.json`", &[AffinityFile::ROW]),
    ("`job/job.json`", &[JobFile::ROW, SubmittedJob::ROW]),
    (
        "Output of `lumbre status --json`",
        &[
            StatusReport::ROW,
            CellCounts::ROW,
            ReferenceCounts::ROW,
            ShardCounts::ROW,
            CurrentRun::ROW,
            FailureRecord::ROW,
        ],
    ),
];

/// Events of a journal by their names, with their fields.
const EVENTS: &[(&str, Option<RecordRow>)] = &[
    ("night_started", Some(NightStart::ROW)),
    ("worker_started", Some(NightStart::ROW)),
    ("forecast", Some(FORECAST)),
    ("cell_started", Some(RunStart::ROW)),
    ("cell_finished", Some(RunEnd::ROW)),
    ("shard_started", Some(ShardStart::ROW)),
    ("shard_finished", Some(ShardEnd::ROW)),
    ("bias_check", Some(BiasCheckFile::ROW)),
    ("message", Some(MessageRecord::ROW)),
    ("night_finished", None),
    ("worker_finished", None),
    ("night_closed", None),
];

/// Returns the generated part of docs/reference/files.md: the fields of every file with records,
/// and the events of a journal.
pub fn reference() -> String {
    let mut out =
        "## Fields of every file\n\nEvery JSON file has a `version` of its own. A file of \
                   another version is refused with the\nprogram that wrote it, and a file with an \
                   unknown, missing or mistyped field is damaged.\n"
            .to_owned();
    for (title, records) in FILES {
        out += &format!("\n### {title}\n");
        for record in *records {
            out += &record_section(record);
        }
    }
    out += "\n### `journal.jsonl`, `workers/<worker>.jsonl`\n\nOne line for each event of all nights \
            and processes: `date` (UTC), `event`, and the fields of the event.\nNo decision depends \
            on it.\n\n";
    out += &table_head(["event", "fields"]);
    for (name, record) in EVENTS {
        let fields = record.iter().flat_map(|record| record.fields);
        let fields: Vec<String> = fields.map(|field| format!("`{}`", field.name)).collect();
        out += &row([&format!("`{name}`"), &fields.join(", ")]);
    }
    let mut listed: Vec<&str> = vec![BiasCheckFile::ROW.name];
    let parts = [ShardRecord::ROW, WaveRecord::ROW];
    let records = EVENTS.iter().filter_map(|(_, record)| *record);
    for record in records.chain(parts) {
        if !listed.contains(&record.name) {
            listed.push(record.name);
            out += &record_section(&record);
        }
    }
    out += "\n## Channels of layers\n\nChannels in `final.exr`, by the name in `films`. A layer \
            without channels has a file for each of its films.\n\n";
    out += &table_head(["layer", "channels", "meaning"]);
    for layer in LAYERS {
        let channels: Vec<String> = layer.exr.iter().map(|name| format!("`{name}`")).collect();
        let meaning = sentence(layer.doc);
        out += &row([&format!("`{}`", layer.name), &channels.join(", "), &meaning]);
    }
    out += "\n## Columns of CSV files\n";
    for file in CSV_FILES {
        out += &csv_section(file);
    }
    out
}

/// Returns the description of a CSV file and the table of its columns.
fn csv_section(file: &CsvFile) -> String {
    let mut out = format!("\n### {}\n\n{}\n\n", file.name, file.doc);
    out += &table_head(["column", "unit", "meaning"]);
    for column in file.columns.iter().copied().flatten() {
        out += &row([
            &format!("`{}`", column.name),
            column.unit,
            &sentence(column.doc),
        ]);
    }
    out
}

/// Returns the description of a structure and the table of its fields.
fn record_section(record: &RecordRow) -> String {
    let mut out = format!("\n{}\n\n", record.doc.trim());
    out += &table_head(["field", "meaning"]);
    for field in record.fields {
        out += &row([&format!("`{}`", field.name), &sentence(field.doc.trim())]);
    }
    out
}
