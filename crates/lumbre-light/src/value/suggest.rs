//! Suggestions of the known name most similar to a misspelt one.

/// Returns the name in `known` closest to `given` by edit distance with transpositions, if it is
/// close enough to be meant.
///
/// The distance may be at most a third of the longer name's letters, and at least one edit is
/// always allowed; names that share their first four letters and half of the longer one, such as
/// `rotate` and `rotation`, are close too. Differences of case and between `_` and `-` are ignored.
pub fn nearest<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let fold = |s: &str| -> Vec<char> { s.to_lowercase().replace('-', "_").chars().collect() };
    let given_folded = fold(given);
    let close = |name: &str| {
        let name = fold(name);
        let (edits, longer) = (
            distance(&given_folded, &name),
            given_folded.len().max(name.len()),
        );
        let same = given_folded.iter().zip(&name).take_while(|(a, b)| a == b);
        let shared = same.count();
        let is_close = edits <= (longer / 3).max(1) || shared >= 4 && 2 * shared >= longer;
        is_close.then_some(edits)
    };
    known
        .into_iter()
        .filter_map(|name| Some((close(name)?, name)))
        .min_by_key(|(d, _)| *d)
        .map(|(_, name)| name)
}

/// Computes the optimal string alignment distance: insert, delete, replace, or swap two neighbours,
/// each at cost 1.
fn distance(a: &[char], b: &[char]) -> usize {
    let mut before_last: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replace = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replace.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before_last[j - 2] + 1);
            }
        }
        before_last = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_was_meant_and_nothing_far_away() {
        let known = ["integrator", "max_depth", "resolution", "aa"];
        assert_eq!(nearest("max_dpeth", known), Some("max_depth"));
        assert_eq!(nearest("maxdepth", known), Some("max_depth"));
        assert_eq!(nearest("Resolution", known), Some("resolution"));
        assert_eq!(nearest("zebra", known), None);
        let parts = ["rotation", "scale", "sampling"];
        assert_eq!(nearest("rotate", parts), Some("rotation"));
        assert_eq!(nearest("rot", parts), None);
    }

    #[test]
    fn a_swap_of_neighbours_is_one_edit() {
        let chars = |s: &str| s.chars().collect::<Vec<_>>();
        assert_eq!(distance(&chars("depth"), &chars("dpeth")), 1);
        assert_eq!(distance(&chars(""), &chars("abc")), 3);
        assert_eq!(distance(&chars("abc"), &chars("abc")), 0);
    }
}
