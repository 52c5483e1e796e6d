//! Numbers of a claim, from the finished runs of a night.

use std::collections::BTreeMap;

use lumbre_light::film::time::CUBE_FILE;
use lumbre_light::value::Value;
use lumbre_metrics::{Better, MetricSpec};
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::spec::TableValue;
use lumbre_night::store::{Evidence, FILMS};
use lumbre_report::exr;
use lumbre_report::quantity::{RunValue, time_to};
use lumbre_report::report::{Member, Study};
use lumbre_report::time::{Movie, TimeCurve};
use serde::Deserialize;

use super::claims::{Claim, Operand, Selection, Side, matches};

/// Factor by which a measurement may be later than the time of `at`, since waves end a little after
/// the time at which a measurement is due.
const LATE: f64 = 1.02;

/// Share of the time of `at` that a run must have rendered.
const RENDERED: f64 = 0.95;

/// Quantity of a run that claims compare, with its name in their files.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "String")]
pub struct Quantity {
    pub name: String,
    kind: QuantityKind,
}

#[derive(Clone, Debug)]
enum QuantityKind {
    /// Value of tables at the end of a run, or time to a threshold.
    Table(TableValue),
    /// Metric column at the last measurement up to a render time in seconds.
    At(String, f64),
    /// Samples per pixel until a metric column reached a threshold for good.
    SamplesTo(String, f64),
    /// Mean radiance of the final picture.
    Mean,
    Light(LightValue),
}

/// Value of light over time.
#[derive(Clone, Copy, Debug, PartialEq)]
enum LightValue {
    /// The light itself.
    Curve,
    /// Mean time.
    Centre,
    /// Standard deviation of the time.
    Spread,
    /// Largest bin.
    Peak,
}

impl TryFrom<String> for Quantity {
    type Error = String;

    fn try_from(name: String) -> Result<Quantity, String> {
        let unknown = || format!("unknown value `{name}`");
        let call = name.strip_suffix(')').and_then(|call| call.split_once('('));
        let kind = if let Some((function, arguments)) = call {
            let (column, number) = arguments.split_once(", ").ok_or_else(unknown)?;
            let column = column.to_owned();
            let threshold = number.parse().map_err(|_| unknown())?;
            match function {
                "at" => QuantityKind::At(column, threshold),
                "time_to" => QuantityKind::Table(TableValue::TimeTo { column, threshold }),
                "samples_to" => QuantityKind::SamplesTo(column, threshold),
                _ => return Err(unknown()),
            }
        } else {
            match name.as_str() {
                "mean" => QuantityKind::Mean,
                "curve" => QuantityKind::Light(LightValue::Curve),
                "centre" => QuantityKind::Light(LightValue::Centre),
                "spread" => QuantityKind::Light(LightValue::Spread),
                "peak" => QuantityKind::Light(LightValue::Peak),
                _ => QuantityKind::Table(TableValue::named(name.clone())),
            }
        };
        Ok(Quantity { name, kind })
    }
}

impl Quantity {
    /// Returns the metric column that must be measured for it.
    pub fn column(&self) -> Option<&str> {
        match &self.kind {
            QuantityKind::Table(TableValue::Metric(column) | TableValue::TimeTo { column, .. })
            | QuantityKind::At(column, _)
            | QuantityKind::SamplesTo(column, _) => Some(column),
            _ => None,
        }
    }

    /// Whether it is computed from light over time.
    pub fn is_over_time(&self) -> bool {
        matches!(self.kind, QuantityKind::Light(_))
    }

    /// Whether it is a value of a metric.
    fn is_metric(&self) -> bool {
        use QuantityKind::{At, Table};
        matches!(self.kind, At(..) | Table(TableValue::Metric(_)))
    }
}

/// Value of one run.
pub enum Reading {
    Number(RunValue),
    /// Light over time: values and width of the bins.
    Curve(Vec<f64>, f64),
}

impl Reading {
    /// Returns the number, if it is one.
    pub fn number(&self) -> Option<RunValue> {
        match self {
            Reading::Number(value) => Some(*value),
            Reading::Curve(..) => None,
        }
    }
}

/// Values of the finished runs of a night.
pub struct NightValues<'a> {
    study: Study<'a>,
    evidence: &'a Evidence,
}

impl<'a> NightValues<'a> {
    pub fn new(night: &'a Night, evidence: &'a Evidence) -> NightValues<'a> {
        let study = Study::of_night(night, &[], &[]);
        NightValues { study, evidence }
    }

    pub fn night(&self) -> &Night {
        &self.study.nights[0]
    }

    fn finished(&self, selection: &Selection) -> impl Iterator<Item = Member<'_>> {
        let finished = self.study.all().filter(|member| member.run.is_done());
        finished.filter(|member| matches(&member.run.point, selection))
    }

    /// Returns the values of an axis of which a run is finished, in the order of the plan.
    pub fn axis_values(&self, axis: &str) -> Vec<Value> {
        let mut values = Vec::new();
        for member in self.finished(&Selection::new()) {
            let value = member.run.point.iter().find(|(name, _)| name == axis);
            values.extend(
                value
                    .map(|(_, value)| value.clone())
                    .filter(|v| !values.contains(v)),
            );
        }
        values
    }

    /// Reads the values of both sides of a claim for each repeat that has both.
    ///
    /// # Errors
    /// Returns why the claim cannot be judged.
    pub fn pairs(&self, claim: &Claim) -> Result<Vec<[Reading; 2]>, String> {
        let a = self.side(claim, &claim.a, Side::A)?;
        let mut b = match &claim.b {
            Some(Operand::Runs(selection)) => self.side(claim, selection, Side::B)?,
            Some(Operand::Number(number)) => {
                let number = self.falling(claim.quantity(Side::B)?, RunValue::exact(*number));
                let repeats = a.keys().copied();
                repeats
                    .map(|repeat| (repeat, Reading::Number(number)))
                    .collect()
            }
            None => BTreeMap::new(),
        };
        let pair = |(repeat, a)| Some([a, b.remove(&repeat)?]);
        Ok(a.into_iter().filter_map(pair).collect())
    }

    /// Reads the values of the runs of a side by their repeats.
    fn side(
        &self,
        claim: &Claim,
        selection: &Selection,
        side: Side,
    ) -> Result<BTreeMap<u32, Reading>, String> {
        let mut readings = BTreeMap::new();
        for member in self.finished(selection) {
            let reading = self.reading(claim, side, &member)?;
            if readings.insert(member.run.repeat, reading).is_some() {
                let selection = Value::Map(selection.clone());
                return Err(format!("several runs match {selection}"));
            }
        }
        Ok(readings)
    }

    /// Reads the positions on the axis `over` of a claim, and the values there.
    ///
    /// # Errors
    /// Returns why the claim cannot be judged.
    pub fn series(&self, claim: &Claim) -> Result<Vec<(f64, f64)>, String> {
        let over = claim.over.as_ref().ok_or("no axis")?;
        let mut points = Vec::new();
        for (position, value) in over.values.iter().enumerate() {
            for member in self.finished(&claim.at(&over.axis, value).a) {
                let number = self.reading(claim, Side::A, &member)?.number();
                let number = number.filter(|value| !value.bound.is_open());
                let number = number.ok_or("a run has only a bound")?.number;
                points.push((position as f64, number));
            }
        }
        Ok(points)
    }

    /// Reads the value of a run.
    fn reading(&self, claim: &Claim, side: Side, member: &Member) -> Result<Reading, String> {
        let quantity = claim.quantity(side)?;
        let number = match &quantity.kind {
            QuantityKind::Table(value) => self.study.run_value(value, member),
            QuantityKind::At(column, seconds) => self.at(member, column, *seconds),
            QuantityKind::SamplesTo(column, threshold) => {
                self.samples_to(member, column, *threshold)
            }
            QuantityKind::Mean => Some(RunValue::exact(self.mean(claim, side, member)?)),
            QuantityKind::Light(LightValue::Curve) => {
                let light = self.light(claim, side, member)?;
                return Ok(Reading::Curve(light.values, light.bin));
            }
            QuantityKind::Light(value) => {
                let light = self.light(claim, side, member)?;
                Some(RunValue::exact(light.number(*value)))
            }
        };
        let number = number.ok_or_else(|| format!("a run has no `{}`", quantity.name))?;
        Ok(Reading::Number(self.falling(quantity, number)))
    }

    fn metric(&self, column: &str) -> Option<(usize, &MetricSpec)> {
        let mut metrics = self.study.metrics.iter().enumerate();
        metrics.find(|(_, metric)| metric.column == column)
    }

    /// Returns the metric of a quantity if its values rise to a best one, as SSIM does to 1.
    /// Distances from that are compared.
    pub fn similarity(&self, quantity: &Quantity) -> Option<&MetricSpec> {
        let column = quantity.column().filter(|_| quantity.is_metric())?;
        let (_, metric) = self.metric(column)?;
        let rises = metric.row.better == Better::Higher && metric.row.perfect.is_finite();
        rises.then_some(metric)
    }

    /// Replaces a value of such a metric by its distance from the best one.
    fn falling(&self, quantity: &Quantity, value: RunValue) -> RunValue {
        match self.similarity(quantity) {
            Some(metric) => RunValue::exact(metric.row.perfect - value.number),
            None => value,
        }
    }

    fn at(&self, member: &Member, column: &str, seconds: f64) -> Option<RunValue> {
        let (index, _) = self.metric(column)?;
        let rows = &member.run.rows;
        rows.last()
            .filter(|row| row.render_s >= RENDERED * seconds)?;
        let row = rows.iter().rfind(|row| row.render_s <= LATE * seconds)?;
        member.value(row, index).map(RunValue::exact)
    }

    fn samples_to(&self, member: &Member, column: &str, threshold: f64) -> Option<RunValue> {
        let (index, metric) = self.metric(column)?;
        let point = |row: &WaveRow| Some((row.samples as f64, member.value(row, index)?));
        let curve: Vec<_> = member.run.rows.iter().filter_map(point).collect();
        time_to(metric.row.better, &curve, threshold)
    }

    /// Computes the mean radiance of the region of a claim in the final picture of a run.
    fn mean(&self, claim: &Claim, side: Side, member: &Member) -> Result<f64, String> {
        let (_, path) = member.run.pictures.last().ok_or("a run has no picture")?;
        let decoded = exr::decode(&self.evidence.read(path)?);
        let (image, _) = decoded.map_err(|e| format!("{}: {e}", path.display()))?;
        let [x0, y0, x1, y1] = pixels(claim, image.width, image.height);
        let rows = image.data.chunks(image.width as usize);
        let rows = rows.take(y1 as usize).skip(y0 as usize);
        let value = |pixel: &[f32; 3]| match claim.channel(side) {
            Some(channel) => f64::from(pixel[channel as usize]),
            None => pixel.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0,
        };
        let sum: f64 = rows
            .flat_map(|row| &row[x0 as usize..x1 as usize])
            .map(value)
            .sum();
        Ok(sum / f64::from((x1 - x0) * (y1 - y0)))
    }

    /// Reads the light over time of the region and channel of a claim.
    fn light(&self, claim: &Claim, side: Side, member: &Member) -> Result<Light, String> {
        let timing = member.run.timing.as_ref();
        let timing = timing.ok_or("the script has no `x:frames`")?;
        let path = member.run.folder.join(FILMS).join(CUBE_FILE);
        let movie = Movie::from_array(&self.evidence.read(&path)?, timing);
        let movie = movie.map_err(|e| format!("{}: {e}", path.display()))?;
        let channel = claim.channel(side).ok_or("no channel")? as usize;
        let region = pixels(claim, movie.width, movie.height);
        let curve = TimeCurve::region(&movie, region, "");
        Ok(Light {
            values: curve.values.iter().map(|bin| bin[channel]).collect(),
            start: movie.axis.start,
            bin: movie.axis.bin,
        })
    }
}

/// Returns the edges of the region of a claim in pixels; without one, those of the picture.
fn pixels(claim: &Claim, width: u32, height: u32) -> [u32; 4] {
    let edges = claim.region.unwrap_or([0.0, 0.0, 1.0, 1.0]);
    let side = |i: usize| f64::from(if i.is_multiple_of(2) { width } else { height });
    std::array::from_fn(|i| (edges[i] * side(i)).round().clamp(0.0, side(i)) as u32)
}

/// Light over time of a part of a picture.
struct Light {
    values: Vec<f64>,
    start: f64,
    bin: f64,
}

impl Light {
    /// Computes a value that is a number; NaN for the curve.
    fn number(&self, value: LightValue) -> f64 {
        let time = |i: usize| self.start + (i as f64 + 0.5) * self.bin;
        let mean = |of_time: &dyn Fn(f64) -> f64| {
            let weighted = self.values.iter().enumerate();
            let sum: f64 = weighted.map(|(i, v)| v * of_time(time(i))).sum();
            sum / self.values.iter().sum::<f64>()
        };
        let centre = mean(&|t| t);
        match value {
            LightValue::Centre => centre,
            LightValue::Spread => mean(&|t| (t - centre).powi(2)).sqrt(),
            LightValue::Peak => self.values.iter().copied().fold(f64::NAN, f64::max),
            LightValue::Curve => f64::NAN,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_with_arguments_are_checked() {
        for name in [
            "rmse",
            "at(rmse, 1)",
            "time_to(ssim, 0.95)",
            "samples_to(ssim, 0.5)",
        ] {
            assert!(Quantity::try_from(name.to_owned()).is_ok(), "{name}");
        }
        for name in ["at(rmse)", "at(rmse, one)", "until(rmse, 1)"] {
            assert!(Quantity::try_from(name.to_owned()).is_err(), "{name}");
        }
    }

    #[test]
    fn times_are_weighted_by_light() {
        let light = Light {
            values: vec![0.0, 1.0, 3.0],
            start: 1.0,
            bin: 0.5,
        };
        // Centres of the bins: 1.25, 1.75 and 2.25.
        let values = [LightValue::Centre, LightValue::Spread, LightValue::Peak];
        let expected = [2.125, 0.75f64.sqrt() / 4.0, 3.0];
        for (value, expected) in values.into_iter().zip(expected) {
            let number = light.number(value);
            assert!((number - expected).abs() < 1e-12, "{value:?}: {number}");
        }
    }
}
