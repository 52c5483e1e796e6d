//! The part of a camera's view that its picture shows.

use serde::{Deserialize, Serialize};

/// Bound on the absolute values of the edges of a window, in sizes of the whole view.
pub const MAX_WINDOW_EDGE: f64 = 1e3;

/// Smallest width and height of a window, in sizes of the whole view.
const MIN_WINDOW_SIZE: f32 = 1e-6;

/// The part of a camera's whole view that its picture shows: a crop, or a view off the axis.
///
/// Edges are fractions of the width of the whole view from its left edge, and of its height from its
/// upper edge; they may lie beyond it. The whole view is centred on the optical axis, its height is
/// that of the field of view (of an orthographic camera, the view height), and its width is such
/// that pixels are square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewWindow {
    /// Place that the left edge of the picture shows. Beyond `right`, the picture is mirrored.
    pub left: f32,
    /// Place that the right edge of the picture shows.
    pub right: f32,
    /// Place that the upper edge of the picture shows.
    pub top: f32,
    /// Place that the lower edge of the picture shows, below `top`.
    pub bottom: f32,
}

impl Default for ViewWindow {
    fn default() -> ViewWindow {
        ViewWindow::WHOLE
    }
}

impl ViewWindow {
    /// The whole view.
    pub const WHOLE: ViewWindow = ViewWindow {
        left: 0.0,
        right: 1.0,
        top: 0.0,
        bottom: 1.0,
    };

    /// Creates a window from its left, right, upper and lower edge.
    pub fn from_array([left, right, top, bottom]: [f32; 4]) -> ViewWindow {
        ViewWindow {
            left,
            right,
            top,
            bottom,
        }
    }

    /// Returns the edges in the order of [`ViewWindow::from_array`].
    pub fn to_array(self) -> [f32; 4] {
        [self.left, self.right, self.top, self.bottom]
    }

    /// Returns whether left and right are exchanged.
    pub fn mirrors(self) -> bool {
        self.left > self.right
    }

    /// Returns the window with left and right of the view exchanged.
    pub fn mirrored(self) -> ViewWindow {
        ViewWindow {
            left: 1.0 - self.left,
            right: 1.0 - self.right,
            ..self
        }
    }

    /// Returns width and height in sizes of the whole view, positive.
    pub fn size(self) -> [f32; 2] {
        [(self.right - self.left).abs(), self.bottom - self.top]
    }

    /// Returns the vector from the middle of the whole view to that of the window, in sizes of the
    /// window: to the right of the picture, and downwards.
    pub fn offset(self) -> [f32; 2] {
        let [width, height] = self.size();
        let right = 0.5 * (self.left + self.right - 1.0) / width;
        [
            if self.mirrors() { -right } else { right },
            0.5 * (self.top + self.bottom - 1.0) / height,
        ]
    }

    /// Returns why no picture can show this window, if so.
    pub fn problem(self) -> Option<String> {
        let edges = self.to_array();
        let known = |edge: &f32| f64::from(edge.abs()) <= MAX_WINDOW_EDGE;
        if !edges.iter().all(known) {
            return Some(format!(
                "the edges of a window must be between -{MAX_WINDOW_EDGE:e} and \
                 {MAX_WINDOW_EDGE:e}, found {edges:?}"
            ));
        }
        (!self.size().iter().all(|size| *size >= MIN_WINDOW_SIZE)).then(|| {
            format!(
                "a window needs a left edge apart from its right one and an upper edge above its \
                 lower one, found {edges:?}"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_have_sizes_offsets_and_mirror_images() {
        let corner = ViewWindow::from_array([0.5, 1.0, 0.0, 0.25]);
        assert_eq!((corner.size(), corner.offset()), ([0.5, 0.25], [0.5, -1.5]));
        assert!(!corner.mirrors() && corner.mirrored().mirrors());
        assert_eq!(corner.mirrored().to_array(), [0.5, 0.0, 0.0, 0.25]);
        // The mirrored picture shows the left half of the view, whose middle is to the right of
        // that of the mirrored view.
        assert_eq!(corner.mirrored().offset(), [0.5, -1.5]);
        assert_eq!(ViewWindow::WHOLE.offset(), [0.0; 2]);
        assert_eq!(ViewWindow::WHOLE.problem(), None);
    }

    #[test]
    fn windows_without_an_extent_are_a_problem() {
        for edges in [
            [0.5, 0.5, 0.0, 1.0],
            [0.0, 1.0, 0.5, 0.5],
            [0.0, 1.0, 1.0, 0.0],
            [0.0, f32::NAN, 0.0, 1.0],
            [0.0, f32::INFINITY, 0.0, 1.0],
            [0.0, 1.0, -2e3, 1.0],
        ] {
            assert!(
                ViewWindow::from_array(edges).problem().is_some(),
                "{edges:?}"
            );
        }
    }
}
