//! Where commands write: foreign files stay, and a failure to write is an error (exit code 1) that names the path.

mod program;

use program::{command, printed, slipbound_in};
use std::fs;
use std::path::Path;
use std::process::Output;

/// Runs the command that this line types.
fn typed(folder: &Path, line: &str) -> Output {
    slipbound_in(folder, &line.split(' ').collect::<Vec<_>>())
}

/// A folder with a short press of a finger, `clip`, and a foreign file, `notes`.
fn clip() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "press?rest_frames=3&press_s=0.1&settle_s=0.1&hold_s=0.1&grid=fast";
    let done = typed(folder.path(), &format!("simulate {scene} -o clip"));
    assert!(done.status.success(), "{}", printed(&done));
    fs::write(folder.path().join("notes"), "mine").expect("written");
    folder
}

/// Sources are recognised by their ending: under another name a recording is never found again.
#[test]
fn a_recording_has_the_name_of_one() {
    let folder = clip();
    let hold = "hold clip --sensor clip/sensor.toml --gripper dry --for-s 0";
    for (line, said) in [
        ("record clip -o r.txt", "--output r.txt: expected a FILE.mcap, got a name that ends in .txt"),
        ("record clip -o r.MCAP", "--output r.MCAP: expected a FILE.mcap, got a name that ends in .MCAP"),
        ("watch clip --record r", "--record r: expected a FILE.mcap, got a name without an ending"),
        ("demo --task lift --record=r.bag", "--record r.bag: expected a FILE.mcap"),
        (&format!("{hold} --record=r.jsonl"), "--record r.jsonl: expected a FILE.mcap"),
    ] {
        let done = typed(folder.path(), line);
        assert!(done.status.code() == Some(2) && printed(&done).contains(said), "{line}: {}", printed(&done));
    }
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2, "nothing was written");
}

/// Whatever the format; an ending that stands for none is a name like any other.
#[test]
fn an_output_whose_name_promises_another_format_is_refused() {
    let folder = clip();
    for (line, said) in [
        ("watch clip --json p.html", "--json p.html: expected a file of JSON lines"),
        ("watch clip --json x.CSV", "--json x.CSV: expected a file of JSON lines (--csv FILE.csv writes a table)"),
        (
            "watch clip --csv t.tsv",
            "--csv t.tsv: expected a file of comma-separated values, got a name that ends in .tsv",
        ),
        ("watch clip --slips s.csv", "--slips s.csv: expected a file of JSON lines"),
        ("watch clip --report page.txt", "--report page.txt: expected a page, FILE.html"),
        ("watch clip --timings p.png", "--timings p.png: expected a file of JSON lines"),
        ("watch clip --overlay p.mcap", "--overlay p.mcap: expected a folder for pictures, or FILE.avi for a video"),
    ] {
        let done = typed(folder.path(), line);
        assert!(done.status.code() == Some(2) && printed(&done).contains(said), "{line}: {}", printed(&done));
    }
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 2, "nothing was written");
    let done = typed(folder.path(), "watch clip --json a.txt --csv b --slips c.2026 --report d.htm --timings e.ndjson");
    assert!(done.status.success(), "{}", printed(&done));
}

#[test]
fn what_cannot_be_written_is_a_failure_told_by_its_path() {
    let folder = clip();
    let hold = "hold clip --sensor clip/sensor.toml --gripper dry --for-s 0";
    for (line, place) in [
        ("record clip -o notes/r.mcap", "notes/r.mcap"),
        ("watch clip --record notes/r.mcap", "notes/r.mcap"),
        (&format!("{hold} --record=notes/r.mcap"), "notes/r.mcap"),
        (&format!("{hold} -o notes/run"), "notes/run"),
        ("demo --task lift --record=notes/r.mcap", "notes/r.mcap"),
        ("demo --task lift -o notes/run", "notes/run"),
        ("eval table1 --trials 1 --detector paper -o notes/ev", "notes/ev"),
        ("paper --trials 1 -o notes/paper", "notes/paper"),
    ] {
        let done = typed(folder.path(), line);
        let said = format!("{place}: cannot write: ");
        assert!(done.status.code() == Some(1) && printed(&done).contains(&said), "{line}: {}", printed(&done));
    }
}

/// Not after an hour of frames.
#[test]
fn a_page_that_cannot_be_written_is_told_of_before_the_first_frame() {
    let folder = clip();
    let done = typed(folder.path(), "watch clip --report nowhere/page.html --json lines.jsonl");
    assert!(done.status.code() == Some(1), "{}", printed(&done));
    assert!(
        printed(&done).contains("nowhere/page.html: cannot write: ") && !printed(&done).contains("frames"),
        "{}",
        printed(&done)
    );
    let lines = fs::read_to_string(folder.path().join("lines.jsonl")).unwrap_or_default();
    assert!(lines.lines().count() <= 1, "{lines}");
    let done = typed(folder.path(), "watch clip --report page.html");
    assert!(done.status.success(), "{}", printed(&done));
}

#[test]
fn files_and_folders_of_somebody_else_stay() {
    let folder = clip();
    for name in ["notes", "mine/report.html", "mine/paper.html"] {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(&path, "mine").expect("written");
    }
    for (line, said) in [
        (
            "eval table1 --trials 1 --detector paper -o mine",
            "mine: expected a new or empty folder, or one with sweep.json",
        ),
        ("paper --trials 1 -o mine", "mine: expected a new or empty folder, or one with table1/sweep.json"),
        ("paper --trials 0 -o made", "invalid value '0' for '--trials <N>': 0 is not in 1.."),
        ("emulate wsg50 --log notes", "--log: expected a new file, or one that slipbound wrote, got notes"),
    ] {
        let done = typed(folder.path(), line);
        assert!(done.status.code() == Some(2) && printed(&done).contains(said), "{line}: {}", printed(&done));
    }
    for name in ["notes", "mine/report.html", "mine/paper.html"] {
        assert_eq!(fs::read_to_string(folder.path().join(name)).expect("there"), "mine", "{name}");
    }
    assert_eq!(fs::read_dir(folder.path().join("mine")).expect("there").count(), 2, "nothing beside them");
}

/// The name is neither a camera to be plugged in nor a folder of a run.
#[test]
fn a_name_that_leads_nowhere_is_told_what_to_do() {
    let folder = clip();
    fs::write(folder.path().join("run.mcap"), "").expect("written");
    for (line, said) in [
        ("doctor nowhere", "nowhere: expected a folder, an image, a video"),
        (
            "replay run.mcap",
            "run.mcap: expected the folder of a run, got a file; `slipbound convert run.mcap -o FOLDER`",
        ),
        ("replay notes", "notes: expected the folder of a run, got a file"),
        ("replay clip", "clip: expected the folder of a run, got a folder without run.toml"),
        ("replay nowhere", "nowhere: expected the folder of a run, got none"),
        ("eval lifts --data nowhere", "nowhere: expected a folder of clips, got none"),
        ("eval lifts --data notes", "notes: expected a folder of clips: Not a directory"),
    ] {
        let done = typed(folder.path(), line);
        assert!(done.status.code() == Some(2) && printed(&done).contains(said), "{line}: {}", printed(&done));
    }
    let mut lifts = command(&["eval", "lifts"]);
    let done = lifts.env("SLIPBOUND_DATA", "nowhere").current_dir(folder.path()).output().expect("runs");
    let said = "nowhere/gelsight-lift: expected a folder of clips, got none; `--data FOLDER` names yours";
    assert!(done.status.code() == Some(2) && printed(&done).contains(said), "{}", printed(&done));
    let done = typed(folder.path(), "scenes ramp");
    assert!(
        printed(&done).contains("see `slipbound scenes`") && !printed(&done).contains("see below"),
        "{}",
        printed(&done)
    );
}
