//! The pane of the inspector: value and noise of a pixel, the surface there, and one of its samples.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::Screen;
use crate::explore::inspect::{Inspection, Inspector};
use crate::explore::session::Frame as Picture;
use crate::tui::format::{self, number};
use crate::tui::panes::{framed, pane};
use lumbre_light::math::luminance::luminance;

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen, inspector: &Inspector) {
    let (state, caps) = (screen.state, screen.caps);
    let Some([x, y]) = state.cursor else {
        return;
    };
    let title = format!(" Pixel {x}, {y} ");
    let hint = Line::styled(" Enter: steps and lobe ", caps.dim()).right_aligned();
    let block = pane(caps, Span::styled(title, caps.strong())).title_bottom(hint);
    let inner = framed(frame, area, block);
    let picture = screen.published.slot(state.side).frame.as_ref();
    let mut rows = picture.map_or_else(Vec::new, |picture| values(picture, [x, y]));
    match &inspector.found {
        // What was found for another pixel is shown until that of this one is there.
        Some(found) => rows.extend(surface(found)),
        None => rows.push("tracing".to_owned()),
    }
    if let Some(picture) = picture {
        rows.extend(layers(picture, [x, y]));
    }
    let ellipsis = caps.glyphs().ellipsis;
    let lines: Vec<Line> = rows
        .into_iter()
        .map(|row| Line::from(format::fit(&row, usize::from(inner.width), ellipsis)))
        .collect();
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Returns three numbers as text.
fn triple(rgb: [f32; 3]) -> String {
    rgb.map(|x| number(f64::from(x))).join(" ")
}

/// Value and standard error of a pixel.
fn values(picture: &Picture, [x, y]: [u32; 2]) -> Vec<String> {
    if x >= picture.image.width || y >= picture.image.height || picture.samples == 0 {
        return Vec::new();
    }
    let rgb = picture.image.at(x, y);
    let level = luminance(rgb.map(f64::from));
    let mut rows = vec![
        format!("rgb {}", triple(rgb)),
        format!(
            "luminance {}, {} spp",
            number(level),
            format::count(picture.samples)
        ),
    ];
    if let Some((variance, samples)) = &picture.variance {
        // Standard error of the samples since then, by which the variance of the mean falls.
        let share = *samples as f64 / picture.samples as f64;
        let errors = variance
            .at(x, y)
            .map(|v| (f64::from(v) * share).sqrt() as f32);
        rows.push(format!("std. error {}", triple(errors)));
        let single = variance
            .at(x, y)
            .map(|v| (f64::from(v) * *samples as f64) as f32);
        rows.push(format!("variance of a sample {}", triple(single)));
    }
    rows
}

/// Surface and light at the pixel, and its sample.
fn surface(found: &Inspection) -> Vec<String> {
    let mut rows = match &found.surface {
        None => vec!["no surface".to_owned()],
        Some(surface) => vec![
            format!("{} ({})", format::clean(&surface.material), surface.model),
            format!(
                "{}, at {}",
                surface.primitive,
                number(f64::from(surface.distance))
            ),
            match surface.light {
                Some((index, emitted)) => format!("light {index}: {}", triple(emitted)),
                None => "no light".to_owned(),
            },
        ],
    };
    rows.push(format!(
        "sample {}: {} rays",
        found.target.sample, found.rays
    ));
    let depths = found.depths.iter();
    rows.extend(depths.map(|(depth, light)| format!(" depth {depth}: {}", triple(*light))));
    if found.depths.is_empty() {
        rows.push(" no light for this pixel".to_owned());
    }
    rows
}

/// Values of the films of the layers.
fn layers(picture: &Picture, [x, y]: [u32; 2]) -> Vec<String> {
    let layers = picture.layers.iter();
    let inside = layers.filter(|layer| x < layer.image.width && y < layer.image.height);
    inside
        .map(|layer| format!("{}: {}", layer.film.name(), triple(layer.image.at(x, y))))
        .collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use lumbre_light::film::Image;

    #[test]
    fn the_error_of_a_pixel_falls_with_the_samples_since_its_estimate() {
        let flat = |x: f32| Arc::new(Image::from_fn(2, 1, |_, _| [x; 3]));
        let picture = Picture {
            image: flat(0.5),
            samples: 64,
            render_s: 1.0,
            paths: 1,
            rays: 1,
            invalid: 0,
            noise: None,
            // A sample has the variance 0.64, so that the mean of 64 has 0.01.
            variance: Some((flat(0.04), 16)),
            part: None,
            layers: Vec::new(),
        };
        let rows = values(&picture, [1, 0]);
        let row = |name: &str| rows.iter().find_map(|row| row.strip_prefix(name)).unwrap();
        let three = |x: f32| format!(" {}", triple([x; 3]));
        assert_eq!(row("std. error"), three(0.1));
        assert_eq!(row("variance of a sample"), three(0.64));
        assert!(
            values(&picture, [2, 0]).is_empty(),
            "outside of the picture"
        );
    }
}
