//! How a night that can only wait for others waits: a thousand of them must not wear out the folder that they share.

/// Runs of others that one look takes in, once there was nothing else to do.
pub const LOOKS: usize = 8;
/// Most moments between two looks.
const LONGEST: u64 = 600;
/// Seconds of a moment, which [`Seams::wait`](super::Seams::wait) waits.
pub const MOMENT_S: f64 = 0.05;

/// Waits a tenth of the time that it has waited already, at least a moment and at most half a minute, give or take a
/// quarter. So whatever becomes free is found within a tenth of the time that it took.
#[derive(Debug)]
pub struct Patience {
    waited: u64,
    seed: u64,
}

impl Patience {
    /// Nothing was waited for yet. The seed makes many that begin at once look at different moments.
    pub fn new(seed: u64) -> Patience {
        Patience { waited: 0, seed }
    }

    /// Something happened.
    pub fn forget(&mut self) {
        self.waited = 0;
    }

    /// Moments until the next look.
    pub fn moments(&mut self) -> u64 {
        let longest = (self.waited / 10).clamp(1, LONGEST);
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let spread = longest / 2;
        let moments = longest - spread / 2 + if spread > 0 { (self.seed >> 33) % (spread + 1) } else { 0 };
        self.waited += moments;
        moments
    }

    /// Of what others work on, what is looked at next, and the rest.
    pub(super) fn window<T>(&self, mut all: Vec<T>) -> (Vec<T>, Vec<T>) {
        if self.waited == 0 {
            return (all, Vec::new());
        }
        let rest = all.split_off(all.len().min(LOOKS));
        (all, rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::event::CellRef;

    #[test]
    fn looks_become_rarer_up_to_half_a_minute() {
        let mut patience = Patience::new(7);
        let moments: Vec<u64> = (0..400).map(|_| patience.moments()).collect();
        assert!(moments[..10].iter().all(|n| *n == 1), "{moments:?}");
        assert!(moments.iter().all(|n| (1..=LONGEST * 5 / 4).contains(n)));
        let last = &moments[300..];
        assert!(last.iter().all(|n| *n >= LONGEST * 3 / 4) && last.iter().any(|n| *n != last[0]));
        patience.forget();
        assert_eq!(patience.moments(), 1);
    }

    #[test]
    fn one_look_takes_in_few_once_it_waits() {
        let all: Vec<CellRef> = (0..40).map(CellRef::Cell).collect();
        let mut patience = Patience::new(1);
        assert_eq!(patience.window(all.clone()).0.len(), 40);
        patience.moments();
        let (now, later) = patience.window(all.clone());
        assert_eq!((now.len(), later.len()), (LOOKS, 40 - LOOKS));
        assert_eq!([now, later].concat(), all);
    }
}
