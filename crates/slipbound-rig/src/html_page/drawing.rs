//! kuva's plots in the colours of the style sheet: plots and layout in, the content of an SVG out.

use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::theme::Theme;

/// What stands between kuva's `<svg ...>` and `</svg>`.
pub(crate) fn drawn(plots: Vec<Plot>, layout: Layout) -> String {
    let theme = Theme {
        background: "none".into(),
        axis_color: "var(--axis)".into(),
        grid_color: "var(--grid)".into(),
        tick_color: "var(--axis)".into(),
        text_color: "var(--soft)".into(),
        ..Theme::light()
    };
    let svg = kuva::render_to_svg(plots, layout.with_theme(theme));
    let inside = svg.find('>').map_or("", |end| &svg[end + 1..]);
    inside.trim_end().trim_end_matches("</svg>").to_owned()
}
