//! One plot over time as inline SVG. Axes, lines and areas are kuva's; marks, phases and tooltips are put on top, in
//! the same coordinates.

use super::panels::{Line, Panel, Stroke};
use super::phases::{self, ClassAndName, PHASE_BAND_PX, Stretch};
use super::time_axis::{TimeAxis, Width};
use crate::html_page::chart::plain_decimals;
use crate::html_page::{drawing, markup::Escaped};
use kuva::plot::{BandPlot, LinePlot};
use kuva::render::annotations::ReferenceLine;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use std::fmt;

/// A number on a mark.
const BADGE_PX: f64 = 16.0;
/// Numbers of marks close to each other are put in this many rows at most.
const BADGE_ROWS_MOST: usize = 3;
/// Points drawn of one line: more than there are pixels.
const POINTS_MOST: [usize; 2] = [1600, 500];
/// Tooltips of one plot.
const TOOLTIPS_MOST: [usize; 2] = [180, 60];
/// Height of a narrow plot, as a share of that of a wide one.
const NARROW_HEIGHT_FRACTION: f64 = 0.8;
/// Numbers beyond this are drawn as gaps: no force, angle or distance of a hand is that large.
const DRAWN_MOST: f64 = 1e7;

/// A slip, marked through all plots.
#[derive(Debug)]
pub(super) struct Mark {
    pub slip: u32,
    pub time_ns: u64,
    pub title: String,
}

/// What all plots of a page share.
pub(super) struct Timeline {
    /// The axis.
    pub axis: TimeAxis,
    /// The time of every value, ns.
    pub times_ns: Vec<u64>,
    /// What is shown in the thin band above each plot.
    pub band: Vec<Stretch<ClassAndName>>,
    /// Slips, marked through all plots.
    pub marks: Vec<Mark>,
}

impl Timeline {
    /// Writes a plot with its title and the names of its lines, wide and narrow.
    pub fn write(&self, f: &mut fmt::Formatter<'_>, panel: &Panel, number: usize, is_last: bool) -> fmt::Result {
        writeln!(f, "<figure class=\"plot\">\n<figcaption><b>{}</b>, {}", panel.title, panel.unit)?;
        // A single line is named by the title, unless it has a name of its own.
        let is_named = |line: &&Line| !line.name.is_empty();
        for line in panel.lines.iter().filter(is_named) {
            let class = match line.stroke {
                Stroke::Dashed => "dashed",
                Stroke::Area => "area",
                Stroke::Solid | Stroke::Step => "solid",
            };
            let (colour, name) = (line.colour, line.name);
            writeln!(f, "<span class=\"line\"><i class=\"{class}\" style=\"--c:var({colour})\"></i>{name}</span>")?;
        }
        writeln!(f, "</figcaption>")?;
        for width in Width::BOTH {
            self.write_one(f, panel, number, is_last, width)?;
        }
        if !panel.note.is_empty() {
            writeln!(f, "<p class=\"key\">{}</p>", panel.note)?;
        }
        writeln!(f, "</figure>")
    }

    fn write_one(
        &self,
        f: &mut fmt::Formatter<'_>,
        panel: &Panel,
        number: usize,
        is_last: bool,
        width: Width,
    ) -> fmt::Result {
        let (time, class) = (&self.axis.drawn(width), width.class());
        let height_px = match width {
            Width::Wide => panel.height_px,
            Width::Narrow => NARROW_HEIGHT_FRACTION * panel.height_px,
        };
        let rows = badge_rows(time, &self.marks);
        let rows_count = rows.iter().flatten().max().map_or(0, |most| most + 1);
        let top_px = 10.0 + BADGE_PX * rows_count as f64 + PHASE_BAND_PX;
        let bottom_px = if is_last { 42.0 } else { 22.0 };
        let frame = Frame { top_px, height_px, bottom_px, is_last };
        let (width_px, whole_px) = (width.px(), top_px + height_px + bottom_px);
        write!(f, "<svg class=\"{class}\" viewBox=\"0 0 {width_px} {whole_px}\" role=\"img\" ")?;
        writeln!(f, "aria-label=\"{} over time\">", panel.title)?;
        let drawn = drawn(time, panel, &self.times_ns, frame);
        writeln!(f, "{}", drawn.replace("kuva-clip", &format!("clip-{class}-{number}")))?;
        phases::band(f, time, &self.band, top_px - PHASE_BAND_PX)?;
        tooltips(f, time, panel, &self.times_ns, frame)?;
        for (mark, row) in self.marks.iter().zip(rows) {
            let (x_px, foot_px) = (time.x_px(mark.time_ns), top_px + height_px);
            writeln!(f, "<g class=\"slip\" data-slip=\"{}\"><title>{}</title>", mark.slip, Escaped(&mark.title))?;
            let y_px = top_px - PHASE_BAND_PX - BADGE_PX * (row.unwrap_or(0) as f64 + 0.5) - 2.0;
            writeln!(f, "<line x1=\"{x_px:.1}\" y1=\"{y_px:.1}\" x2=\"{x_px:.1}\" y2=\"{foot_px:.1}\"/>")?;
            if row.is_some() {
                writeln!(f, "<circle cx=\"{x_px:.1}\" cy=\"{y_px:.1}\" r=\"{:.1}\"/>", BADGE_PX / 2.0 - 0.5)?;
                writeln!(f, "<text x=\"{x_px:.1}\" y=\"{:.1}\">{}</text>", y_px + 3.8, mark.slip)?;
            }
            writeln!(f, "</g>")?;
        }
        writeln!(f, "</svg>")
    }
}

/// Position of a plot's axes, and whether the time below them has a name.
#[derive(Debug, Clone, Copy)]
struct Frame {
    top_px: f64,
    height_px: f64,
    bottom_px: f64,
    is_last: bool,
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

/// Axes, grid, areas and lines: the content between kuva's `<svg ...>` and `</svg>`.
fn drawn(time: &TimeAxis, panel: &Panel, times_ns: &[u64], frame: Frame) -> String {
    let Frame { top_px, height_px, bottom_px, is_last } = frame;
    let width = time.width;
    let (from_s, to_s) = time.range_s();
    let (least, most) = y_range(panel);
    let mut layout = Layout::new((from_s, to_s), (least, most))
        .with_width(width.px())
        .with_height(top_px + height_px + bottom_px)
        .with_force_margins(width.left_px(), width.right_px())
        .with_force_margins_y(top_px, bottom_px)
        .with_x_axis_min(from_s)
        .with_x_axis_max(to_s)
        .with_y_axis_min(least)
        .with_y_axis_max(most)
        .with_tick_format(plain_decimals())
        .with_tick_size(12)
        .with_label_size(12);
    if width == Width::Wide {
        layout = layout.with_y_label(panel.unit); // a narrow plot has no room for it
    }
    if is_last {
        layout = layout.with_x_label(time.label());
    }
    if least < 0.0 {
        layout =
            layout.with_reference_line(ReferenceLine::horizontal(0.0).with_color("var(--axis)").with_dasharray(""));
    }
    let plots = panel.lines.iter().flat_map(|line| strokes(line, times_ns, width)).collect();
    drawing::drawn(plots, layout)
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
fn strokes(line: &Line, times_ns: &[u64], width: Width) -> Vec<Plot> {
    let colour = format!("var({})", line.colour);
    let mut plots = Vec::new();
    for points in pieces(line, times_ns, POINTS_MOST[width as usize]) {
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

fn pieces(line: &Line, times_ns: &[u64], most: usize) -> Vec<Vec<(f64, f64)>> {
    let points: Vec<Option<(f64, f64)>> = times_ns
        .iter()
        .zip(&line.values)
        .map(|(time_ns, value)| Some((*time_ns as f64 / 1e9, value.filter(|v| v.abs() <= DRAWN_MOST)?)))
        .collect();
    points
        .split(Option::is_none)
        .filter(|piece| !piece.is_empty())
        .map(|piece| thinned(&piece.iter().copied().flatten().collect::<Vec<_>>(), most))
        .collect()
}

/// The same curve with fewer points: the least and the largest of each stretch, in their order.
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

/// A transparent column for each stretch of time; its tooltip gives the values of the lines.
fn tooltips(
    f: &mut fmt::Formatter<'_>,
    time: &TimeAxis,
    panel: &Panel,
    times_ns: &[u64],
    Frame { top_px, height_px, .. }: Frame,
) -> fmt::Result {
    let stretch = times_ns.len().div_ceil(TOOLTIPS_MOST[time.width as usize]).max(1);
    writeln!(f, "<g class=\"tips\">")?;
    for (i, &time_ns) in times_ns.iter().enumerate().step_by(stretch) {
        let (from_px, next_ns) = (time.x_px(time_ns), times_ns.get(i + stretch).copied().unwrap_or(u64::MAX));
        let width_px = (time.x_px(next_ns) - from_px).max(0.5);
        write!(f, "<rect x=\"{from_px:.1}\" y=\"{top_px}\" width=\"{width_px:.1}\" height=\"{height_px}\">")?;
        write!(f, "<title>{}", time.words(time_ns))?;
        for line in &panel.lines {
            if let Some(value) = line.values[i] {
                let name = if line.name.is_empty() { panel.title } else { line.name };
                write!(f, "\n{name}: {value:.*} {}", panel.decimals, panel.unit)?;
            }
        }
        writeln!(f, "</title></rect>")?;
    }
    writeln!(f, "</g>")
}

#[cfg(test)]
mod tests {
    use super::super::time_axis::TimeUnit;
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
        let time = TimeAxis::over(0, 10_000_000_000, TimeUnit::Seconds);
        let mark = |ms: u64| Mark { slip: 1, time_ns: ms * 1_000_000, title: String::new() };
        let marks = [mark(1000), mark(1050), mark(1100), mark(1120), mark(5000)];
        assert_eq!(badge_rows(&time, &marks), [Some(0), Some(1), Some(2), None, Some(0)]);
    }
}
