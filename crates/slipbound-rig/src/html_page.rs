//! A page of tables, charts and images in one file, without script, for the results of an evaluation or a paper.
//!
//! ```text
//!   HtmlPage: title, then parts in their order: Heading, Text, Table, Chart, Figures
//! ```
//!
//! It is well-formed XML as well as HTML, and looks like the page of a run.

pub(crate) mod chart;
pub(crate) mod drawing;
pub(crate) mod markup;
pub(crate) mod picture;

pub use chart::{Chart, Draw, Range, Series};

use markup::{Escaped, base64};
use slipbound::image::SizePx;
use std::fmt;

/// A longer text in a table is wrapped.
const WORDS_MOST: usize = 28;

/// A page.
#[derive(Debug, Clone, Default)]
pub struct HtmlPage {
    /// Above the title, in small letters.
    pub above: String,
    /// The title.
    pub title: String,
    /// Below it.
    pub below: String,
    /// What follows.
    pub parts: Vec<Part>,
}

/// A part of a page.
#[derive(Debug, Clone)]
pub enum Part {
    /// A heading.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// Column names, then rows.
    Table(Vec<String>, Vec<Vec<String>>),
    /// A chart.
    Chart(Chart),
    /// Images side by side; a click enlarges one.
    Figures(Vec<Figure>),
}

/// An image with what it shows.
#[derive(Debug, Clone)]
pub struct Figure {
    title: String,
    caption: String,
    jpeg: Vec<u8>,
}

/// An image that cannot be put on a page.
#[derive(Debug, thiserror::Error)]
#[error("picture {title:?}: {why}")]
pub struct FigureError {
    title: String,
    why: String,
}

impl Figure {
    /// An image of red, green and blue, rows without gaps, made smaller where it is wide.
    pub fn new(title: &str, caption: &str, rgb: &[u8], size: SizePx) -> Result<Self, FigureError> {
        let jpeg = picture::jpeg(rgb, size.width as u32, size.height as u32)
            .map_err(|why| FigureError { title: title.into(), why })?;
        Ok(Figure { title: title.into(), caption: caption.into(), jpeg })
    }
}

impl fmt::Display for HtmlPage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [above, title, below] = [&self.above, &self.title, &self.below].map(|text| Escaped(text));
        writeln!(f, "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>")?;
        writeln!(f, "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>")?;
        writeln!(f, "<meta name=\"color-scheme\" content=\"light dark\"/>")?;
        let (page, own) = (include_str!("run/page/style.css"), include_str!("html_page/style.css"));
        writeln!(f, "<title>{title}</title>\n<style>{page}{own}</style>\n</head>\n<body>\n<main>")?;
        writeln!(
            f,
            "<header>\n<p class=\"above\">{above}</p>\n<h1>{title}</h1>\n<p class=\"below\">{below}</p>\n</header>"
        )?;
        for (n, part) in self.parts.iter().enumerate() {
            match part {
                Part::Heading(text) => writeln!(f, "<h2>{}</h2>", Escaped(text))?,
                Part::Text(text) => writeln!(f, "<p class=\"note\">{}</p>", Escaped(text))?,
                Part::Table(columns, rows) => table(f, columns, rows)?,
                Part::Chart(chart) => chart.write(f, n)?,
                Part::Figures(figures) => pictures(f, figures)?,
            }
        }
        writeln!(f, "<footer>slipbound {}</footer>\n</main>\n</body>\n</html>", env!("CARGO_PKG_VERSION"))
    }
}

fn table(f: &mut fmt::Formatter<'_>, columns: &[String], rows: &[Vec<String>]) -> fmt::Result {
    writeln!(f, "<div class=\"wide\"><table class=\"results sheet\">\n<tr>")?;
    columns.iter().try_for_each(|column| writeln!(f, "<th>{}</th>", Escaped(column)))?;
    writeln!(f, "</tr>")?;
    for row in rows {
        write!(f, "<tr>")?;
        for cell in row {
            // An interval follows its number in smaller type; a sentence is wrapped.
            match cell.split_once(" [") {
                Some((value, interval)) => {
                    write!(f, "<td>{} <small>[{}</small></td>", Escaped(value), Escaped(interval))?;
                }
                None if cell.len() > WORDS_MOST => write!(f, "<td class=\"words\">{}</td>", Escaped(cell))?,
                None => write!(f, "<td>{}</td>", Escaped(cell))?,
            }
        }
        writeln!(f, "</tr>")?;
    }
    writeln!(f, "</table></div>")
}

fn pictures(f: &mut fmt::Formatter<'_>, figures: &[Figure]) -> fmt::Result {
    writeln!(f, "<article>\n<div class=\"figures\">")?;
    for figure in figures {
        let (title, caption) = (Escaped(&figure.title), Escaped(&figure.caption));
        writeln!(f, "<figure>\n<label><input type=\"checkbox\" aria-label=\"enlarge\"/>")?;
        writeln!(f, "<img alt=\"{title}\" src=\"data:image/jpeg;base64,{}\"/></label>", base64(&figure.jpeg))?;
        writeln!(f, "<figcaption><b>{title}</b> {caption}</figcaption>\n</figure>")?;
    }
    writeln!(f, "</div>\n</article>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_well_formed_and_keeps_its_order() {
        let size = SizePx::new(40, 20);
        let series = Series { name: "a < b".into(), points: vec![(0.0, 0.0), (1.0, 1.0)], draw: Draw::Line, colour: 1 };
        let thick = Series { name: "thick".into(), draw: Draw::Thick, colour: 2, ..series.clone() };
        let chart = Chart {
            title: "ROC".into(),
            x_label: "false".into(),
            y_label: "true".into(),
            x: (0.0, 1.0),
            y: (0.0, 1.0),
            series: vec![series, thick],
            lines_at: vec![0.2],
            ranges: vec![Range { name: "f < 0.2".into(), x: (0.0, 0.2), is_good: false }],
        };
        let figure = Figure::new("worst", "missed", &vec![128; 3 * size.area()], size).expect("a picture");
        let page = HtmlPage {
            above: "Evaluation".into(),
            title: "ramps & more".into(),
            below: String::new(),
            parts: vec![
                Part::Heading("One".into()),
                Part::Text("x < y".into()),
                Part::Table(vec!["a".into()], vec![vec!["1.0 [0.5, 2.0]".into()]]),
                Part::Chart(chart),
                Part::Figures(vec![figure]),
            ],
        };
        let text = page.to_string();
        let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
        let document = roxmltree::Document::parse_with_options(&text, options).expect("well-formed");
        let names: Vec<&str> = document.descendants().map(|node| node.tag_name().name()).collect();
        let place = |name: &str| names.iter().position(|other| *other == name).unwrap_or_else(|| panic!("no {name}"));
        assert!(place("h2") < place("table") && place("table") < place("svg") && place("svg") < place("img"));
        assert!(text.contains("1.0 <small>[0.5, 2.0]</small>") && text.contains("a &lt; b"));
    }
}
