//! Films of cameras in scene files, of which a part may be rendered.

use lumbre_light::scene::desc::ViewWindow;

/// Size of a film, and the part of it that is rendered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Film {
    /// Width and height of the whole film in pixels.
    pub size: [u32; 2],
    /// First and last column, then row, of the picture, the last exclusive.
    pub pixels: [[u32; 2]; 2],
}

impl Film {
    /// Creates a film that is rendered whole.
    pub fn whole(size: [u32; 2]) -> Film {
        let pixels = size.map(|n| [0, n]);
        Film { size, pixels }
    }

    /// Returns width and height of the picture in pixels.
    pub fn resolution(&self) -> [u32; 2] {
        self.pixels.map(|[first, end]| end - first)
    }

    /// Returns what the picture shows of a view that the film shows moved by `offset`, in sizes of
    /// the film, to the right and downwards.
    pub fn window(&self, offset: [f64; 2]) -> ViewWindow {
        let edge = |i: usize, k: usize| {
            (f64::from(self.pixels[i][k]) / f64::from(self.size[i]) + offset[i]) as f32
        };
        ViewWindow::from_array([edge(0, 0), edge(0, 1), edge(1, 0), edge(1, 1)])
    }
}
