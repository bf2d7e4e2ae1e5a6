//! The text below the options of every command: examples, and the exit codes.

use clap::Command;

/// Widest line of help, columns.
const WIDEST: usize = 110;

/// Columns that every terminal has.
const NARROW: usize = 80;

/// Below every help text.
const EXIT_CODES: &str = "Exit codes:
  0  done
  1  failed on the way, or interrupted; what was written so far is kept
  2  invalid request: wrong arguments or settings, or nothing to read
  3  finished, but frames were torn or of another size, or something could not be written";

/// Examples by command: the command line after `slipbound`, and what it does.
const EXAMPLES: [(&str, &[(&str, &str)]); 32] = [
    (
        "",
        &[
            ("demo", "a simulated hand screws a cap on; leaves a page"),
            ("watch clip.avi --sensor gelsight", "judge a recording"),
            ("watch sim:twist --overlay pictures", "no recording at hand"),
        ],
    ),
    (
        "demo",
        &[
            ("demo", "screw a cap onto a bottle"),
            ("demo --task lift --controller margin --seed 7", "a bottle that fills"),
            ("demo --fault lost@2 --record -o run", "cameras fail; `replay run` repeats it"),
        ],
    ),
    (
        "watch",
        &[
            ("watch clips/run_07 --sensor gelsight", "a folder of images"),
            ("watch run.avi --csv run.csv --overlay run_seen.avi", "a table and a video"),
            ("watch 'sim:ramp?object=screwdriver&force_n=20' --json -", "a scene, as JSON"),
        ],
    ),
    (
        "devices",
        &[
            ("devices", "what is plugged in, and how it is named"),
            ("devices --udev", "rules that give every device a lasting name"),
        ],
    ),
    (
        "doctor",
        &[
            ("doctor v4l2:28H8 --sensor finger.toml", "a camera and its markers"),
            ("doctor v4l2:28H8 --gripper wsg50://192.168.1.20:1000", "and a gripper"),
        ],
    ),
    (
        "record",
        &[
            ("record v4l2:28H8 -o rest.mcap --for-s 2", "two seconds of one finger"),
            ("record v4l2:L v4l2:R -o hand.mcap --sensor finger.toml", "a hand"),
        ],
    ),
    (
        "convert",
        &[
            ("convert run -o run.mcap", "a run folder as one file for other tools"),
            ("convert run.mcap -o run", "and back"),
        ],
    ),
    ("replay", &[("replay run", "a run made with `demo --record -o run`")]),
    (
        "trials",
        &[
            ("trials", "screw and unscrew: every controller, three frictions"),
            ("trials --task lift --seeds 20 --controller constant,on_slip", ""),
        ],
    ),
    (
        "eval",
        &[
            ("eval table1", "the paper's 240 trials, ours and rivals"),
            ("eval ramps --trials 40 --detector ours -o quick", "a short sweep"),
            ("eval merge part1 part2 -o whole", "join the folders of --shard"),
        ],
    ),
    (
        "paper",
        &[
            ("paper -o paper", "all of it, which takes a while"),
            ("paper -o quick --trials 8", "the same page from few trials"),
        ],
    ),
    (
        "calibrate",
        &[
            ("calibrate photo.jpg -o finger.toml --pitch-mm 1.5", "an image at rest"),
            ("calibrate rest.mcap -o finger.toml --polarity dark", "a recording"),
            ("calibrate hang.mcap -o stiff.toml --sensor soft.toml --weight-g 200", ""),
        ],
    ),
    (
        "tare",
        &[
            ("tare v4l2:28H8 --sensor finger.toml", "an untouched finger, in finger.rest"),
            ("tare clip.mcap --frames 30 -o clip.rest", "of a recording that begins so"),
        ],
    ),
    (
        "sensors",
        &[("sensors", "all that are built in"), ("sensors gelslim", "the file of one, to be copied and changed")],
    ),
    (
        "settings",
        &[
            ("settings", "the monitor's: copy what you change into a file for `watch --settings FILE`"),
            ("settings task", "those of grip, controllers and tasks"),
        ],
    ),
    (
        "simulate",
        &[
            ("simulate twist --seed 3 -o my_twist", "frames, truth, sensor and scene"),
            ("simulate 'shear?object=screwdriver' --set mu=0.4 -o run", ""),
        ],
    ),
    ("scenes", &[("scenes", "every scene, parameter and object"), ("scenes ramp", "one scene, with its defaults")]),
    (
        "hold",
        &[
            ("hold v4l2:28H8 --sensor finger.toml --gripper dry --rest live:30", "dry run"),
            ("hold v4l2:L v4l2:R --hand hand.toml --gripper gcl://10.0.0.5:1000", ""),
        ],
    ),
    (
        "run",
        &[
            ("run screw v4l2:28H8 --sensor finger.toml --gripper dry --wrist dry", ""),
            (
                "run lift L.mcap R.mcap --hand hand.toml \\
      --gripper wsg50://10.0.0.5:1000 --wrist line://10.0.0.6:4000",
                "",
            ),
        ],
    ),
    (
        "gripper",
        &[
            ("gripper wsg50://192.168.1.20:1000 status", "moves nothing"),
            ("gripper 'robotiq:///dev/ttyUSB0?part_width_mm=28' grasp 20", "20 N per finger"),
        ],
    ),
    ("gripper status", &[("gripper wsg50://192.168.1.20:1000 status", "")]),
    ("gripper home", &[("gripper gcl://192.168.1.20:1000 home", "")]),
    ("gripper open", &[("gripper line://192.168.1.20:4000 open", "")]),
    ("gripper grasp", &[("gripper 'wsg50://192.168.1.20:1000?part_width_mm=28' grasp 20", "")]),
    ("gripper release", &[("gripper robotiq://192.168.1.20:63352 release", "")]),
    ("gripper acknowledge", &[("gripper wsg50://192.168.1.20:1000 acknowledge", "")]),
    ("gripper check-hold", &[("gripper gcl://192.168.1.20:1000 check-hold --low 10 --high 20", "")]),
    (
        "emulate",
        &[
            ("emulate wsg50 --port 4711 --width 28", "a block of 28 mm between its jaws"),
            ("emulate gcl --weight 2 --log block.jsonl", "with something to drop"),
        ],
    ),
    ("emulate hand", &[("emulate hand --task lift", "two cameras, a gripper and a wrist around a bottle")]),
    ("latency", &[("latency", "five rows of 3000 frames each"), ("latency --frames 300 --fingers 1", "a quick look")]),
    ("completions", &[("completions bash > /etc/bash_completion.d/slipbound", "")]),
    ("man", &[("man -o /usr/local/share/man/man1", "one page for each command")]),
];

/// The command and all below it, with examples and exit codes in their help.
pub fn with_examples(command: Command) -> Command {
    below(command.max_term_width(WIDEST), "")
}

/// `path`: the names of the commands below the program's own.
fn below(mut command: Command, path: &str) -> Command {
    let names: Vec<String> = command.get_subcommands().map(|c| c.get_name().to_owned()).collect();
    for name in names {
        let path = format!("{path} {name}").trim_start().to_owned();
        command = command.mut_subcommand(name, |command| below(command, &path));
    }
    let own = command.get_after_help().map(|own| format!("{own}\n\n")).unwrap_or_default();
    let examples = EXAMPLES.iter().find(|(of, _)| *of == path).map(|(_, examples)| shown(examples));
    command.after_help(format!("{own}{}{EXIT_CODES}", examples.unwrap_or_default()))
}

/// Examples as lines, with their purpose beside them, or above them where that is too wide for a narrow terminal.
fn shown(examples: &[(&str, &str)]) -> String {
    let widest = examples.iter().map(|(line, _)| line.len()).max().unwrap_or(0);
    let is_beside =
        examples.iter().all(|(_, what)| "  slipbound ".len() + widest + "  # ".len() + what.len() <= NARROW);
    let mut text = String::from("Examples:\n");
    for (line, what) in examples {
        text += &match (what.is_empty(), is_beside) {
            (true, _) => format!("  slipbound {line}\n"),
            (false, true) => format!("  slipbound {line:<widest$}  # {what}\n"),
            (false, false) => format!("  # {what}\n  slipbound {line}\n"),
        };
    }
    text + "\n"
}
