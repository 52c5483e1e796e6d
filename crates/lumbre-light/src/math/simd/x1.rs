//! One lane: plain numbers.

use super::{F32x8, Lanes};

impl Lanes<1> for f32 {
    inlined! {
        load([number]: &[f32; 1]) -> f32 = *number;
        store(self) -> [f32; 1] = [self];
        load_doubles([number]: &[f64; 1]) -> f64 = *number;
        store_doubles(numbers: f64) -> [f64; 1] = [numbers];
        transpose_load([row]: [&F32x8; 1]) -> [f32; 8] = row.0;
        transpose_store(columns: [f32; 8]) -> [F32x8; 1] = [F32x8(columns)];
    }
}
