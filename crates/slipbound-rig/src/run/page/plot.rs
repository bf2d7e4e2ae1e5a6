//! One plot over time as inline SVG. Axes, lines and areas are kuva's; marks, phases and tooltips are put on top, in
//! the same coordinates.

use super::panels::{Line, Panel, Stroke};
use super::phases::{PHASE_BAND_PX, phase_band};
use super::text::seconds;
use super::time_axis::{LEFT_PX, RIGHT_PX, TimeAxis, WIDTH_PX};
use crate::sheet::markup::Escaped;
use kuva::plot::{BandPlot, LinePlot};
use kuva::render::annotations::ReferenceLine;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::theme::Theme;
use slipbound::control::Cycle;
use std::fmt;

/// A number on a mark.
const BADGE_PX: f64 = 16.0;
/// Numbers of marks close to each other stand in so many rows at most.
const BADGE_ROWS_MOST: usize = 3;
/// Points drawn of one line: more than there are pixels.
const POINTS_MOST: usize = 1600;
/// Tooltips of one plot.
const TOOLTIPS_MOST: usize = 180;
/// Numbers beyond this are drawn as gaps: no force, angle or distance of a hand is there.
const DRAWN_MOST: f64 = 1e7;

/// A slip, marked through all plots.
#[derive(Debug)]
pub(super) struct Mark {
    pub slip: u32,
    pub time_ns: u64,
    pub title: String,
}

/// Writes a plot with its title and the names of its lines.
pub(super) fn write(
    f: &mut fmt::Formatter<'_>,
    time: &TimeAxis,
    panel: &Panel,
    marks: &[Mark],
    cycles: &[Cycle],
    number: usize,
    is_last: bool,
) -> fmt::Result {
    let rows = badge_rows(time, marks);
    let rows_count = rows.iter().flatten().max().map_or(0, |most| most + 1);
    let top_px = 10.0 + BADGE_PX * rows_count as f64 + PHASE_BAND_PX;
    let bottom_px = if is_last { 42.0 } else { 22.0 };
    let height_px = top_px + panel.height_px + bottom_px;
    writeln!(f, "<figure class=\"plot\">\n<figcaption><b>{}</b>, {}", panel.title, panel.unit)?;
    for line in &panel.lines {
        let class = match line.stroke {
            Stroke::Dashed => "dashed",
            Stroke::Area => "area",
            Stroke::Solid | Stroke::Step => "solid",
        };
        writeln!(
            f,
            "<span class=\"line\"><i class=\"{class}\" style=\"--c:var({})\"></i>{}</span>",
            line.colour, line.name
        )?;
    }
    writeln!(f, "</figcaption>")?;
    writeln!(f, "<svg viewBox=\"0 0 {WIDTH_PX} {height_px}\" role=\"img\" aria-label=\"{} over time\">", panel.title)?;
    writeln!(
        f,
        "{}",
        drawn(time, panel, cycles, (top_px, bottom_px), is_last).replace("kuva-clip", &format!("clip-{number}"))
    )?;
    phase_band(f, time, cycles, top_px - PHASE_BAND_PX)?;
    tooltips(f, time, panel, cycles, top_px)?;
    for (mark, row) in marks.iter().zip(rows) {
        let (x_px, foot_px) = (time.x_px(mark.time_ns), top_px + panel.height_px);
        writeln!(f, "<g class=\"slip\" data-slip=\"{}\"><title>{}</title>", mark.slip, Escaped(&mark.title))?;
        let y_px = top_px - PHASE_BAND_PX - BADGE_PX * (row.unwrap_or(0) as f64 + 0.5) - 2.0;
        writeln!(f, "<line x1=\"{x_px:.1}\" y1=\"{y_px:.1}\" x2=\"{x_px:.1}\" y2=\"{foot_px:.1}\"/>")?;
        if row.is_some() {
            writeln!(f, "<circle cx=\"{x_px:.1}\" cy=\"{y_px:.1}\" r=\"{:.1}\"/>", BADGE_PX / 2.0 - 0.5)?;
            writeln!(f, "<text x=\"{x_px:.1}\" y=\"{:.1}\">{}</text>", y_px + 3.8, mark.slip)?;
        }
        writeln!(f, "</g>")?;
    }
    writeln!(f, "</svg>\n</figure>")
}

/// The row of each mark's number, so that none covers another; None where there is no room.
fn badge_rows(time: &TimeAxis, marks: &[Mark]) -> Vec<Option<usize>> {
    let mut ends_px = [f64::NEG_INFINITY; BADGE_ROWS_MOST];
    let mut row = |mark: &Mark| {
        let x_px = time.x_px(mark.time_ns);
        let row = ends_px.iter().position(|end_px| x_px >= end_px + BADGE_PX)?;
        ends_px[row] = x_px;
        Some(row)
    };
    marks.iter().map(&mut row).collect()
}

/// Axes, grid, areas and lines: what stands between kuva's `<svg ...>` and `</svg>`.
fn drawn(time: &TimeAxis, panel: &Panel, cycles: &[Cycle], (top_px, bottom_px): (f64, f64), is_last: bool) -> String {
    let (from_s, to_s) = time.range_s();
    let (least, most) = y_range(panel);
    let theme = Theme {
        background: "none".into(),
        axis_color: "var(--axis)".into(),
        grid_color: "var(--grid)".into(),
        tick_color: "var(--axis)".into(),
        text_color: "var(--soft)".into(),
        ..Theme::light()
    };
    let mut layout = Layout::new((from_s, to_s), (least, most))
        .with_width(WIDTH_PX)
        .with_height(top_px + panel.height_px + bottom_px)
        .with_force_margins(LEFT_PX, RIGHT_PX)
        .with_force_margins_y(top_px, bottom_px)
        .with_x_axis_min(from_s)
        .with_x_axis_max(to_s)
        .with_y_axis_min(least)
        .with_y_axis_max(most)
        .with_theme(theme)
        .with_y_label(panel.unit)
        .with_tick_size(12)
        .with_label_size(12);
    if is_last {
        layout = layout.with_x_label("time, s");
    }
    if least < 0.0 {
        layout =
            layout.with_reference_line(ReferenceLine::horizontal(0.0).with_color("var(--axis)").with_dasharray(""));
    }
    let plots = panel.lines.iter().flat_map(|line| strokes(line, cycles)).collect();
    let svg = kuva::render_to_svg(plots, layout);
    let inside = svg.find('>').map_or("", |end| &svg[end + 1..]);
    inside.trim_end().trim_end_matches("</svg>").to_owned()
}

/// What the axis shows: all values within the bounds, and what is always shown.
fn y_range(panel: &Panel) -> (f64, f64) {
    let values = panel.lines.iter().flat_map(|line| &line.values).flatten().filter(|v| v.abs() <= DRAWN_MOST);
    let clamped = values.map(|v| v.clamp(panel.bounds.0, panel.bounds.1));
    let (least, most) = clamped.fold(panel.shown, |(least, most), v| (least.min(v), most.max(v)));
    let room = if most > least { 0.06 * (most - least) } else { 1.0 };
    (if least < 0.0 { least - room } else { least }, most + room)
}

/// The pieces of a line between its gaps.
fn strokes(line: &Line, cycles: &[Cycle]) -> Vec<Plot> {
    let colour = format!("var({})", line.colour);
    let mut plots = Vec::new();
    for points in pieces(line, cycles) {
        if line.stroke == Stroke::Area {
            let (x, y): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
            let floor = vec![0.0; x.len()];
            plots.push(BandPlot::new(x, floor, y).with_color(colour.as_str()).with_opacity(0.22).into());
        }
        let plot = LinePlot::new().with_data(points).with_color(colour.as_str()).with_stroke_width(1.8);
        plots.push(match line.stroke {
            Stroke::Dashed => plot.with_dashed().into(),
            Stroke::Step => plot.with_step().into(),
            Stroke::Area => plot.with_stroke_width(1.0).into(),
            Stroke::Solid => plot.into(),
        });
    }
    plots
}

fn pieces(line: &Line, cycles: &[Cycle]) -> Vec<Vec<(f64, f64)>> {
    let points: Vec<Option<(f64, f64)>> = cycles
        .iter()
        .zip(&line.values)
        .map(|(cycle, value)| Some((cycle.time_ns as f64 / 1e9, value.filter(|v| v.abs() <= DRAWN_MOST)?)))
        .collect();
    let most = POINTS_MOST.max(4);
    points
        .split(Option::is_none)
        .filter(|piece| !piece.is_empty())
        .map(|piece| thinned(&piece.iter().copied().flatten().collect::<Vec<_>>(), most))
        .collect()
}

/// The same picture with fewer points: of each stretch the least and the largest, in their order.
fn thinned(points: &[(f64, f64)], most: usize) -> Vec<(f64, f64)> {
    if points.len() <= most {
        return points.to_vec();
    }
    let stretch = (2 * points.len()).div_ceil(most);
    let mut kept = Vec::with_capacity(most + 2);
    for part in points.chunks(stretch) {
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (Some(least), Some(most)) = (part.iter().min_by(by_value), part.iter().max_by(by_value)) else { continue };
        let (first, second) = if least.0 <= most.0 { (least, most) } else { (most, least) };
        kept.push(*first);
        kept.push(*second);
    }
    kept
}

/// A transparent column for each stretch of time that says what the lines are there.
fn tooltips(f: &mut fmt::Formatter<'_>, time: &TimeAxis, panel: &Panel, cycles: &[Cycle], top_px: f64) -> fmt::Result {
    let stretch = cycles.len().div_ceil(TOOLTIPS_MOST).max(1);
    writeln!(f, "<g class=\"tips\">")?;
    for (i, cycle) in cycles.iter().enumerate().step_by(stretch) {
        let (from_px, next) = (time.x_px(cycle.time_ns), cycles.get(i + stretch).map_or(u64::MAX, |c| c.time_ns));
        let (width_px, height_px) = ((time.x_px(next) - from_px).max(0.5), panel.height_px);
        write!(f, "<rect x=\"{from_px:.1}\" y=\"{top_px}\" width=\"{width_px:.1}\" height=\"{height_px}\">")?;
        write!(f, "<title>{}", seconds(cycle.time_ns))?;
        for line in &panel.lines {
            if let Some(value) = line.values[i] {
                write!(f, "\n{}: {value:.*} {}", line.name, panel.decimals, panel.unit)?;
            }
        }
        writeln!(f, "</title></rect>")?;
    }
    writeln!(f, "</g>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_the_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|i| (f64::from(i), 0.0)).collect();
        points[70_001].1 = 5.0;
        points[30_001].1 = -5.0;
        let kept = thinned(&points, 1000);
        assert!(kept.len() <= 1002 && kept.contains(&(70_001.0, 5.0)) && kept.contains(&(30_001.0, -5.0)));
        assert!(kept.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn numbers_of_close_marks_stand_above_each_other() {
        let time = TimeAxis { first_ns: 0, last_ns: 10_000_000_000 };
        let mark = |ms: u64| Mark { slip: 1, time_ns: ms * 1_000_000, title: String::new() };
        let marks = [mark(1000), mark(1050), mark(1100), mark(1120), mark(5000)];
        assert_eq!(badge_rows(&time, &marks), [Some(0), Some(1), Some(2), None, Some(0)]);
    }
}
