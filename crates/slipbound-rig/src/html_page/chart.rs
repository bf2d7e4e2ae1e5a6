//! Lines over two axes, as inline SVG. Axes and lines are kuva's.

use super::drawing;
use super::markup::Escaped;
use kuva::plot::LinePlot;
use kuva::render::annotations::{ReferenceLine, ShadedRegion};
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use std::fmt;

/// A chart is drawn for a window and for one as narrow as a phone; the style sheet shows one of them: class, width and
/// height in px.
const SIZES: [(&str, f64, f64); 2] = [("wide", 560.0, 340.0), ("narrow", 390.0, 290.0)];

/// Colours of the style sheet; further series repeat them.
const COLOURS_COUNT: usize = 9;

/// A chart.
#[derive(Debug, Clone)]
pub struct Chart {
    /// What it shows.
    pub title: String,
    /// Name of the horizontal axis, with its unit.
    pub x_label: String,
    /// Name of the vertical axis, with its unit.
    pub y_label: String,
    /// From where to where the horizontal axis goes.
    pub x: (f64, f64),
    /// The vertical axis.
    pub y: (f64, f64),
    /// What is drawn.
    pub series: Vec<Series>,
    /// Dashed vertical lines.
    pub lines_at: Vec<f64>,
    /// Ranges of the horizontal axis behind the lines.
    pub ranges: Vec<Range>,
}

/// A shaded range of the horizontal axis.
#[derive(Debug, Clone)]
pub struct Range {
    /// What it is called.
    pub name: String,
    /// From where to where it goes.
    pub x: (f64, f64),
    /// Whether values in it are good.
    pub is_good: bool,
}

/// Share of its colour in a range.
const RANGE_OPACITY: f64 = 0.18;

impl Range {
    fn colour(&self) -> &'static str {
        if self.is_good { "var(--good)" } else { "var(--bad)" }
    }

    fn region(&self) -> ShadedRegion {
        ShadedRegion::vertical(self.x.0, self.x.1).with_color(self.colour()).with_opacity(RANGE_OPACITY)
    }
}

/// A line.
#[derive(Debug, Clone)]
pub struct Series {
    /// What it is called.
    pub name: String,
    /// Its points.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub draw: Draw,
    /// Number of its colour, from 1.
    pub colour: usize,
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Draw {
    /// From point to point.
    Line,
    /// The same with a thicker line.
    Thick,
}

impl Series {
    fn colour(&self) -> String {
        format!("var(--c{})", self.colour.saturating_sub(1) % COLOURS_COUNT + 1)
    }

    fn plot(&self) -> Plot {
        let width = match self.draw {
            Draw::Line => 1.8,
            Draw::Thick => 3.2,
        };
        let points = self.points.clone();
        LinePlot::new().with_data(points).with_color(self.colour().as_str()).with_stroke_width(width).into()
    }
}

impl Chart {
    /// Writes it; `number` distinguishes it from the others of the page.
    pub(super) fn write(&self, f: &mut fmt::Formatter<'_>, number: usize) -> fmt::Result {
        writeln!(f, "<figure class=\"plot chart\">\n<figcaption><b>{}</b>", Escaped(&self.title))?;
        for series in &self.series {
            let (colour, name) = (series.colour(), Escaped(&series.name));
            writeln!(f, "<span class=\"line\"><i class=\"solid\" style=\"--c:{colour}\"></i>{name}</span>")?;
        }
        for range in &self.ranges {
            let (colour, name, percent) = (range.colour(), Escaped(&range.name), 100.0 * RANGE_OPACITY);
            let tint = format!("color-mix(in srgb, {colour} {percent}%, transparent)");
            writeln!(f, "<span class=\"line\"><i class=\"fill\" style=\"--c:{tint}\"></i>{name}</span>")?;
        }
        let label = Escaped(&self.title);
        writeln!(f, "</figcaption>")?;
        for (class, width_px, height_px) in SIZES {
            write!(f, "<svg class=\"{class}\" viewBox=\"0 0 {width_px} {height_px}\" role=\"img\" ")?;
            writeln!(f, "aria-label=\"{label}\">")?;
            let drawn = self.drawn(width_px, height_px);
            writeln!(f, "{}\n</svg>", drawn.replace("kuva-clip", &format!("clip-{class}-{number}")))?;
        }
        writeln!(f, "</figure>")
    }

    /// What stands between kuva's `<svg ...>` and `</svg>`.
    fn drawn(&self, width_px: f64, height_px: f64) -> String {
        let mut layout = Layout::new(self.x, self.y)
            .with_width(width_px)
            .with_height(height_px)
            .with_force_margins(64.0, 20.0)
            .with_force_margins_y(12.0, 46.0)
            .with_x_axis_min(self.x.0)
            .with_x_axis_max(self.x.1)
            .with_y_axis_min(self.y.0)
            .with_y_axis_max(self.y.1)
            .with_x_label(self.x_label.as_str())
            .with_y_label(self.y_label.as_str())
            .with_tick_format(plain_decimals())
            .with_tick_size(12)
            .with_label_size(12);
        for range in &self.ranges {
            layout = layout.with_shaded_region(range.region());
        }
        for &x in &self.lines_at {
            layout = layout.with_reference_line(ReferenceLine::vertical(x).with_color("var(--axis)"));
        }
        drawing::drawn(self.series.iter().map(Series::plot).collect(), layout)
    }
}

/// `0.005` and `12000`, all labels of an axis alike; powers of ten only for what would be lost in zeros.
pub(crate) fn plain_decimals() -> TickFormat {
    let shown = |value: f64| match value.abs() {
        1e-6..1e9 => format!("{value:.6}").trim_end_matches('0').trim_end_matches('.').to_owned(),
        _ => TickFormat::Auto.format(value),
    };
    TickFormat::Custom(std::sync::Arc::new(shown))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_an_axis_are_plain_decimals() {
        let shown = [0.0, 0.005, 0.01, 0.3, 20.0, 12500.5, -0.0025].map(|value| plain_decimals().format(value));
        assert_eq!(shown, ["0", "0.005", "0.01", "0.3", "20", "12500.5", "-0.0025"]);
    }
}
