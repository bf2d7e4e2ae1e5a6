//! `slipbound sensors`: the built-in fingers as a table.

use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;

/// Prints the table.
pub fn run() -> Result<Outcome, Failure> {
    let mut rows = vec![["NAME", "IMAGE_PX", "PITCH_PX", "PITCH_MM", "SKIN", "WHAT"].map(str::to_owned)];
    for name in slipbound_rig::sensors::names() {
        let sensor = slipbound_rig::sensors::load(name).map_err(Failure::arguments)?;
        rows.push([
            sensor.name,
            sensor.image_px.to_string(),
            sensor.pitch_px.to_string(),
            sensor.pitch_mm.map_or_else(|| "unknown".into(), |mm| mm.to_string()),
            format!("{:?}", sensor.skin).to_lowercase(),
            sensor.description,
        ]);
    }
    let width = |column: usize| rows.iter().map(|row| row[column].len()).max().unwrap_or(0);
    let widths: [usize; 6] = std::array::from_fn(width);
    let mut terminal = Terminal::plain();
    for row in &rows {
        let cells: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        terminal.say(cells.join("  ").trim_end())?;
    }
    Ok(Outcome::Done)
}
