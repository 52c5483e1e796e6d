//! Reproducible randomness for scenes: `random`, `scatter` and `noise`, all derived from seeds.

use mlua::{UserData, UserDataFields, UserDataMethods, Value as LuaValue};

use crate::api::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::kind::KIND;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::scene::noise;
use lumbre_light::value::schema::Ty;

/// Largest number of points of one `scatter`.
const MAX_POINTS: i64 = 1_000_000;

lumbre_light::table! {
    /// Options of `scatter`.
    pub const SCATTER = "Scatter",
        "Points on a rectangle in the plane y = 0, centred at the origin.";
    size: Ty::nums(2, 1e-9, 1e9), "lengths of the rectangle along x and z, in scene units";
    count: Ty::int(1, MAX_POINTS), "number of points";
    seed = "0": Ty::int(0, u32::MAX as i64), "seed of the offset of the sequence";
}

functions! {
    /// Functions of this module for scripts.
    pub const GLOBALS;
    "random" -> "Random" = random,
        "Returns a stream of random numbers that is the same in every run: r:next() is at least 0 \
         and below 1, r:between(a, b) is uniform between a and b, r:integer(a, b) includes both \
         ends, r:pick(list) is an item of a list." {
        "seed": "integer", "Seed of the stream, from 0 to 4294967295.";
    }
    "scatter" -> "number[][]" = scatter,
        "Returns points that are evenly spread without a visible pattern: the plastic-number \
         sequence [Roberts 2018], offset by the seed." {
        "options": "Scatter", "Rectangle, number and seed.";
    }
    "noise" -> "number" = noise_at,
        "Returns gradient noise [Perlin 2002]: smooth, mostly between -1 and 1, with mean 0." {
        "x": "number", "First coordinate; the noise varies on a scale of 1.";
        "y": "number", "Second coordinate.";
        "z?": "number", "Third coordinate, default 0.";
        "octaves?": "integer",
            "Number of octaves from 1 to 16, default 1; each has twice the frequency and half the \
             amplitude of the previous one.";
    }
}

/// Lua object of a stream of random numbers.
#[derive(Debug)]
pub struct RandomObject {
    seed: u32,
    count: u32,
}

impl RandomObject {
    /// Returns the next number, at least 0 and below 1.
    fn next(&mut self) -> f64 {
        let [word, low, ..] = pcg4d([self.seed, self.count, 0x5eed, 0]);
        self.count = self.count.wrapping_add(1);
        f64::from(unit(word)) + f64::from(low >> 8) / f64::from(1u32 << 24) / f64::from(1u32 << 24)
    }
}

impl UserData for RandomObject {
    fn add_fields<F: UserDataFields<Self>>(fields: &mut F) {
        fields.add_meta_field(KIND, "a source of random numbers");
    }

    fn add_methods<M: UserDataMethods<Self>>(methods: &mut M) {
        methods.add_method_mut("next", |_, this, ()| Ok(this.next()));
        methods.add_method_mut("between", |_, this, (a, b): (f64, f64)| {
            Ok(a + (b - a) * this.next())
        });
        methods.add_method_mut("integer", |_, this, (a, b): (i64, i64)| {
            let span = b
                .checked_sub(a)
                .and_then(|d| d.checked_add(1))
                .filter(|n| *n > 0);
            let span = span.ok_or_else(|| {
                mlua::Error::runtime(format!("there are no integers from {a} to {b}"))
            })?;
            Ok(a + ((this.next() * span as f64) as i64).min(span - 1))
        });
        methods.add_method_mut("pick", |_, this, list: mlua::Table| {
            let count = list.raw_len();
            if count == 0 {
                return Err(mlua::Error::runtime("pick: the list is empty"));
            }
            list.raw_get::<LuaValue>(1 + ((this.next() * count as f64) as usize).min(count - 1))
        });
    }
}

fn random(args: &Args) -> Result<LuaValue, ScriptError> {
    let seed = args.integer(0, "seed", 0, i64::from(u32::MAX))?;
    args.object(RandomObject {
        seed: seed as u32,
        count: 0,
    })
}

fn scatter(args: &Args) -> Result<LuaValue, ScriptError> {
    let fields = args.fields(0, "options", &SCATTER, "scatter")?;
    let [x, z] = fields.numbers("size").unwrap_or([1.0; 2]);
    let integer = |key: &str| fields.i64(key).unwrap_or(0);
    let [first, second, ..] = pcg4d([integer("seed") as u32, 1, 2, 3]);
    let start = [first, second].map(|word| f64::from(unit(word)));
    // Real root of p^3 = p + 1.
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let step = [1.0 / PLASTIC, 1.0 / (PLASTIC * PLASTIC)];
    let point = |i: i64| {
        let along = |k: usize| (start[k] + step[k] * i as f64).fract() - 0.5;
        args.lua
            .create_sequence_from([along(0) * f64::from(x), 0.0, along(1) * f64::from(z)])
    };
    let points: mlua::Result<Vec<mlua::Table>> = (0..integer("count")).map(point).collect();
    let table = points
        .and_then(|points| args.lua.create_sequence_from(points))
        .map_err(|e| args.shared.convert(&e))?;
    Ok(LuaValue::Table(table))
}

fn noise_at(args: &Args) -> Result<LuaValue, ScriptError> {
    let coordinate = |i: usize, what: &str| match args.get(i) {
        LuaValue::Nil if i > 1 => Ok(0.0),
        _ => args.number(i, what),
    };
    let point = [
        coordinate(0, "x")?,
        coordinate(1, "y")?,
        coordinate(2, "z")?,
    ];
    let octaves = if args.len() > 3 {
        args.integer(3, "octaves", 1, 16)?
    } else {
        1
    };
    Ok(LuaValue::Number(noise::fractal(point, octaves as u32)))
}
