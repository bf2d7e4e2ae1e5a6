//! `slipbound sensors`: the built-in fingers as a table, or the file of one.

use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;

/// Prints the table, or the whole file of the named finger, as a template for one's own.
pub fn run(name: Option<&str>) -> Result<Outcome, Failure> {
    if let Some(name) = name {
        let sensor = slipbound_rig::sensors::load(name).map_err(Failure::arguments)?;
        let text = toml::to_string(&sensor).map_err(|e| Failure::work(name, e))?;
        Terminal::plain().say(text.trim_end())?;
        return Ok(Outcome::Done);
    }
    let mut rows = vec![["NAME", "IMAGE_PX", "PITCH_PX", "PITCH_MM", "SKIN", "WHAT"].map(str::to_owned)];
    for name in slipbound_rig::sensors::names() {
        let sensor = slipbound_rig::sensors::load(name).map_err(Failure::arguments)?;
        rows.push([
            sensor.name,
            sensor.image_px.to_string(),
            sensor.pitch_px.to_string(),
            sensor.pitch_mm.map_or_else(|| "unknown".into(), |mm| mm.to_string()),
            sensor.skin.name().into(),
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
