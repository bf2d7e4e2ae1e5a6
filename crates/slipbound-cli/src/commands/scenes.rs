//! `slipbound scenes`: scenes, their parameters and the objects as tables, or one scene with all it takes.

use crate::outcome::{Failure, Outcome};
use crate::terminal::Terminal;
use slipbound_lab::objects::OBJECTS;
use slipbound_lab::scenes::{COMMON_KEYS, Key, Kind, SCENE_KEYS, SCENES, Scene};

/// Prints the tables, or one scene.
pub fn run(name: Option<&str>) -> Result<Outcome, Failure> {
    let mut terminal = Terminal::plain();
    if let Some(name) = name {
        let scene = Scene::named(name).map_err(Failure::arguments)?;
        terminal.say(&format!("{}: {}", scene.name, scene.what))?;
        terminal.say("")?;
        let mut rows = vec![["PARAMETER", "RANGE", "DEFAULT", "WHAT"].map(str::to_owned)];
        rows.extend(scene.keys().map(|key| {
            let own = scene.defaults.iter().find(|(own, _)| *own == key.name).map(|(_, value)| *value);
            [key.name, &range(key, "see `slipbound scenes`"), own.unwrap_or(key.default), key.what].map(str::to_owned)
        }));
        table(&mut terminal, &rows)?;
        terminal.say("")?;
        terminal.say(&format!("slipbound watch 'sim:{}?seed=1' --overlay pictures", scene.name))?;
        return Ok(Outcome::Done);
    }
    let mut rows = vec![["SCENE", "WHAT HAPPENS", "OWN PARAMETERS"].map(str::to_owned)];
    rows.extend(SCENES.iter().map(|scene| {
        let defaults: Vec<String> = scene.defaults.iter().map(|(key, value)| format!("{key}={value}")).collect();
        [scene.name.to_owned(), scene.what.to_owned(), defaults.join(" ")]
    }));
    table(&mut terminal, &rows)?;

    terminal.say("")?;
    let mut rows = vec![["PARAMETER", "RANGE", "DEFAULT", "WHAT"].map(str::to_owned)];
    rows.push(["seed", "a whole number", "0", "what noise and faults are drawn from"].map(str::to_owned));
    rows.extend(COMMON_KEYS.iter().chain(SCENE_KEYS).map(|key| {
        let default = if key.default.is_empty() { "by scene" } else { key.default };
        [key.name.to_owned(), range(key, "see below"), default.to_owned(), key.what.to_owned()]
    }));
    table(&mut terminal, &rows)?;

    terminal.say("")?;
    let mut rows = vec![["OBJECT", "SHAPE", "SOFT", "MU", "MASS_KG", "NOTE"].map(str::to_owned)];
    rows.extend(OBJECTS.iter().map(|object| {
        let soft = object.softness.map_or_else(|| "rigid".into(), |soft| format!("{} MPa", soft.modulus_mpa));
        let (mu, mass_kg) = (object.mu.to_string(), object.mass_kg.to_string());
        [object.name.to_owned(), object.form.in_words(), soft, mu, mass_kg, object.note.to_owned()]
    }));
    table(&mut terminal, &rows)?;
    terminal.say("Shapes, stiffness and friction of objects are estimates, not measured on any object.")?;
    Ok(Outcome::Done)
}

/// `objects`: where the objects are listed.
fn range(key: &Key, objects: &str) -> String {
    match key.kind {
        Kind::Number(low, high) => format!("{low} to {high}"),
        Kind::Count(low, high) => format!("{low} to {high}"),
        Kind::OfObject(low, high) => format!("{low} to {high}, object"),
        Kind::Word(words) => words.join(", "),
        Kind::Object => objects.to_owned(),
        Kind::Faults => "drop late stale torn blur dead drift flicker".into(),
    }
}

/// Prints rows in columns of the necessary width.
fn table<const COLUMNS: usize>(terminal: &mut Terminal, rows: &[[String; COLUMNS]]) -> Result<(), Failure> {
    let widths: [usize; COLUMNS] = std::array::from_fn(|i| rows.iter().map(|row| row[i].len()).max().unwrap_or(0));
    for row in rows {
        let cells: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        terminal.say(cells.join("  ").trim_end())?;
    }
    Ok(())
}
