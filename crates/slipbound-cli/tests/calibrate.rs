//! The command on the paper's finger as simulated, also with a known mass hanging on it; on what cannot be calibrated;
//! and on its own outputs.

mod program;

use program::{printed, slipbound_in};
use slipbound::plane::Vec2;
use std::path::Path;

/// The grid's corners, 21 columns and 20 rows of it, where the published homography of finger gs1 puts them.
#[test]
fn one_frame_of_the_papers_finger_gives_its_homography_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let done = slipbound_in(folder.path(), &["simulate", "twist?seed=3", "-o", "twist"]);
    assert!(done.status.success(), "{done:?}");
    let words = ["calibrate", "twist/frame_000000.jpg", "-o", "gs.toml", "--flip", "vertical", "--skin", "fabric"];
    let done = slipbound_in(folder.path(), &words);
    assert!(done.status.success(), "{done:?}");
    assert!(folder.path().join("gs.png").exists());
    let path = folder.path().join("gs.toml");
    let ours = slipbound_rig::sensors::load(path.to_str().expect("UTF-8")).expect("valid");
    let paper = slipbound_rig::sensors::load("gelslim").expect("built in").at_size(ours.image_px).expect("same shape");
    assert_eq!(ours.rectification.and_then(|r| r.distortion), None, "the lens is straight");

    let size = paper.rectified_px();
    let middle = Vec2::new((size.width - 1) as f64, (size.height - 1) as f64) * 0.5;
    let margin_px = (0.75 * ours.pitch_px).round();
    // The detected grid begins at the first marker in view, which may be a few pitches before the paper's.
    let found = |column: f64, row: f64| {
        ours.camera_from_rectified(Vec2::new(margin_px + column * ours.pitch_px, margin_px + row * ours.pitch_px))
    };
    let truth = |column: f64, row: f64| {
        paper.camera_from_rectified(middle + Vec2::new(column - 10.0, row - 9.5) * paper.pitch_px)
    };
    let starts = (0..8).flat_map(|c| (0..8).map(move |r| (f64::from(c), f64::from(r))));
    let off_px = |(c, r): (f64, f64)| (found(c, r) - truth(0.0, 0.0)).length();
    let (c, r) = starts.min_by(|a, b| off_px(*a).total_cmp(&off_px(*b))).expect("starts");
    for (column, row) in [(0.0, 0.0), (20.0, 0.0), (0.0, 19.0), (20.0, 19.0)] {
        let (found, truth) = (found(column + c, row + r), truth(column, row));
        assert!((found - truth).length() < 1.0, "corner {column}, {row}: {found:?}, expected {truth:?}");
    }
}

/// A clear gel shows so little that most of a single frame is noise; the mean of ten has a third of that noise.
#[test]
fn a_calibrated_clear_gel_is_untouched_in_every_frame_at_rest() {
    let folder = tempfile::tempdir().expect("a folder");
    for seed in ["1", "2"] {
        let scene = format!("press?camera=gelsight_mini&grid=fast&jpeg_quality=85&seed={seed}");
        let [name, file, rest] = [seed.to_owned(), format!("{seed}.toml"), format!("{seed}.rest")];
        for words in [
            &["simulate", &scene, "-o", &name][..],
            &["calibrate", &name, "-o", &file],
            &["tare", &name, "--sensor", &file, "--frames", "10", "-o", &rest],
        ] {
            let done = slipbound_in(folder.path(), words);
            assert!(done.status.success(), "{words:?}: {}", String::from_utf8_lossy(&done.stderr));
        }
    }
}

#[test]
fn the_command_to_go_on_with_is_quoted_for_the_shell() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |words: &[&str]| printed(&slipbound_in(folder.path(), words));
    let (scene, rest) = ("sim:press?grid=fast&hold_s=1", "my finger.rest");
    let tared = told(&["tare", scene, "--frames", "10", "-o", rest]);
    assert!(tared.contains(&format!("next: slipbound watch '{scene}' --rest '{rest}'\n")), "{tared}");
    let calibrated = told(&["calibrate", scene, "-o", "my gel.toml", "--skin", "fabric", "--flip", "vertical"]);
    assert!(calibrated.contains("slipbound watch RECORDING --sensor 'my gel.toml'\n"), "{calibrated}");
}

/// A weave looks like an imprint if the finger is taken for a bare gel; that is reported.
#[test]
fn a_weave_that_was_taken_for_a_gel_is_told_of() {
    let folder = tempfile::tempdir().expect("a folder");
    let told = |words: &[&str]| {
        let done = slipbound_in(folder.path(), words);
        printed(&done)
    };
    told(&["simulate", "twist?grid=fast", "--seed", "3", "-o", "weave"]);
    let calibrated = told(&["calibrate", "weave", "-o", "gel.toml", "--flip", "vertical"]);
    assert!(calibrated.contains("look touched") && calibrated.contains("--skin fabric"), "{calibrated}");
    for words in [["tare", "weave", "--sensor", "gel.toml"], ["doctor", "weave", "--sensor", "gel.toml"]] {
        let refused = told(&words);
        assert!(refused.contains("free it and start again") && refused.contains("--skin fabric"), "{refused}");
    }
}

/// The weave of the simulated GelSlim is sharper in the colour mixture chosen by calibration than in that of the
/// built-in finger.
#[test]
fn a_calibrated_fabric_skin_is_untouched_at_rest_and_slips_where_the_built_in_one_does() {
    let folder = tempfile::tempdir().expect("a folder");
    for seed in ["3", "8"] {
        let done = slipbound_in(folder.path(), &["simulate", "twist?grid=fast", "--seed", seed, "-o", seed]);
        assert!(done.status.success(), "{done:?}");
        let pressed = format!("{seed}/frame_000060.jpg");
        let done = slipbound_in(
            folder.path(),
            &["calibrate", &pressed, "-o", "pressed.toml", "--flip", "vertical", "--skin", "fabric", "--force"],
        );
        let told = printed(&done);
        assert!(told.contains("frame 0 looks touched"), "{told}");
        let text = std::fs::read_to_string(folder.path().join("pressed.toml")).expect("a finger");
        assert!(
            text.contains("not raised, as these frames look touched") && !text.contains("bare_sharpness"),
            "{text}"
        );
        let file = format!("{seed}.toml");
        let words = ["calibrate", seed, "-o", &file, "--flip", "vertical", "--skin", "fabric", "--pitch-mm", "1.5"];
        let done = slipbound_in(folder.path(), &words);
        assert!(done.status.success(), "{done:?}");
        let slips = |words: &[&str]| {
            let name = format!("{seed}.jsonl");
            let done = slipbound_in(folder.path(), &[words, &["--slips", &name, "--force"]].concat());
            let told = printed(&done);
            assert!(done.status.success() && !told.contains("starts in contact"), "{told}");
            let slips = std::fs::read_to_string(folder.path().join(name)).expect("slips");
            let first =
                |line: &str| serde_json::from_str::<serde_json::Value>(line).expect("JSON")["first_seq"].as_u64();
            slips.lines().filter_map(first).collect::<Vec<u64>>()
        };
        let (ours, built_in) = (slips(&["watch", seed, "--sensor", &file]), slips(&["watch", seed]));
        assert_eq!((ours.len(), built_in.len()), (1, 1), "seed {seed}: {ours:?} and {built_in:?}");
        assert!(ours[0].abs_diff(built_in[0]) <= 6, "seed {seed}: {ours:?} and {built_in:?}");
    }
}

#[test]
fn what_cannot_be_done_is_refused_with_the_reason_and_leaves_no_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let even = vec![128u8; 320 * 240];
    let encoder = jpeg_encoder::Encoder::new_file(folder.path().join("even.jpg"), 90).expect("writes");
    encoder.encode(&even, 320, 240, jpeg_encoder::ColorType::Luma).expect("writes");
    for (words, said) in [
        (&["calibrate", "even.jpg", "-o", "a.toml"][..], "no grid of markers: expected at least 16 dots"),
        (&["calibrate", "none.jpg", "-o", "a.toml"], "none.jpg"),
        (&["calibrate", "even.jpg", "-o", "a.json"], "expected a name that ends in .toml, got a.json"),
        (
            &["calibrate", "even.jpg", "-o", "a.toml", "--frames", "5..9"],
            "--frames 5..9: even.jpg ends before frame 8: it has 1 frame",
        ),
        (&["calibrate", "even.jpg", "-o", "a.toml", "--frames", "0..2"], "ends before frame 1: it has 1 frame"),
        (
            &["calibrate", "even.jpg", "-o", "a.toml", "--pitch-mm", "0"],
            ": --pitch-mm: expected a number from 0.1 to 20, got 0",
        ),
        (
            &["calibrate", "http://[::1]:9/a", "-o", "a.toml", "--weight-g", "100", "--sensor", "gelslim"],
            "--weight-g: expected a recording, which ends, got the camera http://[::1]:9/a: record it first",
        ),
        (&["calibrate", "even.jpg", "-o", "a.toml", "--weight-g", "100"], "--sensor"),
        (
            &["calibrate", "even.jpg", "-o", "a.toml", "--weight-g", "0", "--sensor", "gelslim"],
            "expected grams above 0",
        ),
    ] {
        let done = slipbound_in(folder.path(), words);
        let message = String::from_utf8_lossy(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{words:?}: {message}");
        assert!(message.contains(said), "{words:?}: `{message}` lacks `{said}`");
        assert!(!folder.path().join("a.toml").exists());
    }
}

/// The image with the grid may be somebody's photo; --weight-g writes none.
#[test]
fn a_picture_that_is_there_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let photo = folder.path().join("a.png");
    let done = slipbound_in(folder.path(), &["simulate", "twist?grid=fast", "--seed", "3", "-o", "twist"]);
    assert!(done.status.success(), "{done:?}");
    std::fs::write(&photo, "mine").expect("writes");
    let told = |words: &[&str]| {
        let done = slipbound_in(folder.path(), words);
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let words = ["calibrate", "twist", "-o", "a.toml", "--flip", "vertical", "--skin", "fabric"];
    let (code, message) = told(&words);
    let expected = "expected a new file, or --force to overwrite it, got a.png, which is there";
    assert!(code == Some(2) && message.contains(expected), "{message}");
    assert!(!folder.path().join("a.toml").exists());
    let (_, message) = told(&[&words[..4], &["--weight-g", "100", "--sensor", "gelslim"]].concat());
    assert!(!message.contains("a.png") && !message.is_empty(), "{message}");
    assert_eq!(std::fs::read_to_string(&photo).expect("there"), "mine");
    let (code, message) = told(&[&words[..], &["--force"]].concat());
    assert_eq!(code, Some(0), "{message}");
    assert!(std::fs::read(&photo).expect("there").starts_with(b"\x89PNG"));
}

/// A user who names the file after the photo did not name the picture that goes beside it.
#[test]
fn a_picture_that_would_fall_on_the_photo_is_told_of_by_the_name_that_was_given() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("photo.png"), "mine").expect("writes");
    let done = slipbound_in(folder.path(), &["calibrate", "photo.png", "-o", "photo.toml", "--force"]);
    let message = String::from_utf8_lossy(&done.stderr);
    let expected =
        "--output photo.toml: expected a place of its own for the picture of the grid beside it, got photo.png";
    assert!(done.status.code() == Some(2) && message.contains(expected), "{message}");
    assert_eq!(std::fs::read_to_string(folder.path().join("photo.png")).expect("there"), "mine");
}

/// Exit code 3 comes with what was lost.
#[test]
fn frames_that_are_torn_or_of_another_size_are_told_of() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = "press?camera=gelsight_mini&grid=fast&hold_s=0.1";
    let done = slipbound_in(folder.path(), &["simulate", scene, "-o", "run"]);
    assert!(done.status.success(), "{done:?}");
    let frame = |i: usize| folder.path().join(format!("run/frame_{i:06}.jpg"));
    let told = |output: &str| {
        let done = slipbound_in(folder.path(), &["calibrate", "run", "-o", output, "--frames", "0..10"]);
        (done.status.code(), String::from_utf8_lossy(&done.stderr).into_owned())
    };
    std::fs::write(frame(3), "").expect("writes");
    std::fs::write(frame(12), "").expect("writes"); // not asked for
    let (code, message) = told("torn.toml");
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains("run: frame 3 (frame_000003.jpg) is torn: empty: zero bytes\n"), "{message}");
    std::fs::write(frame(5), "").expect("writes");
    assert!(told("both.toml").1.contains("zero bytes; 2 are torn in all"));
    for i in [3, 5] {
        std::fs::copy(frame(2), frame(i)).expect("copies");
    }
    assert_eq!(told("whole.toml"), (Some(0), String::new()));
    let tare = || {
        let done = slipbound_in(folder.path(), &["tare", "run", "--frames", "8"]);
        (done.status.code(), printed(&done))
    };
    assert_eq!(tare().0, Some(0));
    std::fs::write(frame(6), "").expect("writes");
    let (code, message) = tare();
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains("run: frame 6 (frame_000006.jpg) is torn: empty: zero bytes\n"), "{message}");
    std::fs::copy(frame(2), frame(6)).expect("copies");
    let small = vec![128u8; 32 * 32];
    let encoder = jpeg_encoder::Encoder::new_file(frame(4), 90).expect("writes");
    encoder.encode(&small, 32, 32, jpeg_encoder::ColorType::Luma).expect("writes");
    let (code, message) = told("sizes.toml");
    assert_eq!(code, Some(3), "{message}");
    let expected = "1 frame of another size passed over; the first is frame 4 (frame_000004.jpg): expected ";
    assert!(message.contains(expected) && message.contains(", got 32x32"), "{message}");
    let (code, message) = tare();
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains(expected) && message.contains(", got 32x32"), "{message}");
}

/// The sensor file goes where `watch` finds it, into the folder of the frames; the image with the grid is no frame.
#[test]
fn a_sensor_file_in_the_folder_of_its_frames_adds_no_frame() {
    let folder = tempfile::tempdir().expect("a folder");
    let done = slipbound_in(folder.path(), &["simulate", "twist?grid=fast", "--seed", "3", "-o", "run"]);
    assert!(done.status.success(), "{done:?}");
    let frames = || slipbound_rig::source::image_files(&folder.path().join("run").display().to_string());
    let before = frames();
    for (source, output) in [
        ("run", "run/sensor.toml"),
        ("run/*.jpg", "run/other.toml"),
        ("run", "./run/../run/x.toml"),
        ("run/frame_000000.jpg", "run/y.toml"),
    ] {
        let words = ["calibrate", source, "-o", output, "--flip", "vertical", "--skin", "fabric", "--force"];
        let done = slipbound_in(folder.path(), &words);
        assert!(done.status.success(), "{done:?}");
        let told = String::from_utf8_lossy(&done.stdout);
        let name = Path::new(output).with_extension("png");
        let picture = Path::new(output).with_file_name("calibration").join(name.file_name().expect("a name"));
        assert!(told.contains(&format!("and {}", picture.display())), "{told}");
        assert!(folder.path().join(picture).is_file() && folder.path().join(output).is_file());
        assert_eq!(frames(), before, "{output}");
    }
    let done = slipbound_in(folder.path(), &["calibrate", "run", "-o", "run/sensor.toml"]);
    assert_eq!(done.status.code(), Some(2), "a sensor file that is there: {done:?}");
}

/// Two simulated fingers hold 300 g that first stand and then hang. The result is the stiffness of the simulated gel,
/// shear modulus over thickness, to 15 %: markers under a pressed weave are not all found.
#[test]
fn a_hanging_mass_gives_the_stiffness_of_the_simulated_gel_and_a_cut_view_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let held = "fill?force_n=15&mu=0.8&settle_s=0.6&fill_kg_per_s=0.5&hold_s=1&most_kg=0.3";
    let simulate = |scene: &str, name: &str| {
        let done = slipbound_in(folder.path(), &["simulate", scene, "-o", name]);
        assert!(done.status.success(), "{done:?}");
    };
    fn words<'a>(name: &'a str, sensor: &'a str) -> [&'a str; 10] {
        ["calibrate", name, "-o", "stiff.toml", "--sensor", sensor, "--weight-g", "300", "--fingers", "2"]
    }
    simulate(&format!("{held}&object=toy_duck"), "duck");
    // The pads bear it: half of 0.3 kg.
    let truth = std::fs::read_to_string(folder.path().join("duck/truth.jsonl")).expect("truth");
    let last: serde_json::Value =
        truth.lines().filter_map(|l| serde_json::from_str(l).ok()).next_back().expect("a line");
    let force_n = last["wrench"]["force_n"][0].as_f64().expect("a force");
    assert!((force_n / (0.3 * 9.80665 / 2.0) - 1.0).abs() < 0.01, "{force_n} N");

    let done = slipbound_in(folder.path(), &words("duck", "duck/sensor.toml"));
    assert!(done.status.success(), "{done:?}");
    let path = folder.path().join("stiff.toml");
    let shear = slipbound_rig::sensors::load(path.to_str().expect("UTF-8")).expect("valid").shear.expect("measured");
    assert!(shear.provenance.contains("300 g shared by 2 fingers"), "{}", shear.provenance);
    let scene = slipbound_lab::hand::HandScene::parse("lift").expect("a scene");
    let gel = slipbound_lab::hand::SimHand::new(&scene).expect("a hand").sensor(0).shear.expect("known");
    let ratio = shear.stiffness_n_per_pitch / gel.stiffness_n_per_pitch;
    assert!((ratio - 1.0).abs() < 0.15, "{ratio} of the gel's; {}", shear.provenance);

    std::fs::remove_file(&path).expect("written");
    // In kilograms.
    let light = words("duck", "duck/sensor.toml").map(|word| if word == "300" { "0.3" } else { word });
    let done = slipbound_in(folder.path(), &light);
    let message = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.code() == Some(2) && message.contains("--weight-g 0.3: expected grams that give"), "{message}");
    assert!(message.contains("from 0.0027 to 6.8 N per marker and pitch, got 0.00020") && !path.exists(), "{message}");

    // A sensor file of another finger, or with another flip, is not taken for a touched finger.
    let text = std::fs::read_to_string(folder.path().join("duck/sensor.toml")).expect("a finger");
    for (from, to, said) in [
        ("flip = \"vertical\"", "flip = \"none\"", "with flip = \"vertical\" they stand"),
        ("pitch_px = 22.", "pitch_px = 30.", "is it the right sensor file?"),
    ] {
        assert!(text.contains(from), "{text}");
        std::fs::write(folder.path().join("wrong.toml"), text.replace(from, to)).expect("writes");
        let done = slipbound_in(folder.path(), &words("duck", "wrong.toml"));
        let message = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.code() == Some(2) && message.contains(said), "{message}");
        assert!(message.contains("duck: markers expected on a grid of "), "{message}");
    }
    // Frames that are not there, by the option that asked for them.
    for (option, range) in [("--held", "500..600"), ("--hanging", "68..900")] {
        let asked = [&words("duck", "duck/sensor.toml")[..], &[option, range]].concat();
        let done = slipbound_in(folder.path(), &asked);
        let message = String::from_utf8_lossy(&done.stderr);
        let said = format!("duck: {option} {range}: expected frames of the recording, got one that ends before frame ");
        assert!(done.status.code() == Some(2) && message.contains(&said), "{message}");
    }
    // A frame of another size is left out like a torn one, and told of.
    let frame = |i: usize| folder.path().join(format!("duck/frame_{i:06}.jpg"));
    let whole = std::fs::read(frame(55)).expect("there");
    let encoder = jpeg_encoder::Encoder::new_file(frame(55), 90).expect("writes");
    encoder.encode(&[128; 32 * 32], 32, 32, jpeg_encoder::ColorType::Luma).expect("writes");
    let done = slipbound_in(folder.path(), &words("duck", "duck/sensor.toml"));
    let message = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(3), "{message}");
    let expected = "duck: 1 frame of another size passed over; the first is frame 55 (frame_000055.jpg): expected ";
    assert!(message.contains(expected) && message.contains(", got 32x32"), "{message}");
    std::fs::write(frame(55), whole).expect("writes");
    std::fs::remove_file(&path).expect("written");

    // An older measurement in the finger's own file is replaced, however its header is written.
    let own = folder.path().join("own.toml");
    let text = std::fs::read_to_string(folder.path().join("duck/sensor.toml")).expect("a finger");
    let text = text.replace("[shear]\n", "[ shear ]  # of the data sheet\n");
    assert!(text.contains("of the data sheet"), "{text}");
    std::fs::write(&own, text).expect("writes");
    let onto = |file: &'static str| words("duck", file).map(|word| if word == "stiff.toml" { file } else { word });
    let done = slipbound_in(folder.path(), &onto("own.toml"));
    assert!(done.status.success(), "{done:?}");
    let again = slipbound_rig::sensors::load(own.to_str().expect("UTF-8")).expect("valid").shear.expect("measured");
    assert_eq!(again, shear);
    // A file that extends another stays in its folder, however that is written.
    let absolute = folder.path().join("s4.toml").display().to_string();
    for (file, output) in [("./own.toml", "s3.toml"), ("own.toml", "./own.toml"), ("own.toml", absolute.as_str())] {
        std::fs::write(&own, "extends = \"duck/sensor.toml\"\n").expect("writes");
        let onto = words("duck", file).map(|word| if word == "stiff.toml" { output } else { word });
        let done = slipbound_in(folder.path(), &onto);
        assert!(done.status.success(), "{done:?}");
    }
    // A file that would become invalid stays as it is.
    let text = "extends = \"duck/sensor.toml\"\nshear = { stiffness_n_per_pitch = 1.0, provenance = \"data sheet\" }\n";
    let inline = folder.path().join("inline.toml");
    std::fs::write(&inline, text).expect("writes");
    let done = slipbound_in(folder.path(), &onto("inline.toml"));
    let message = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.code() == Some(1) && message.contains("inline.toml: "), "{message}");
    assert_eq!(std::fs::read_to_string(&inline).expect("there"), text);

    simulate(&format!("{held}&object=water_bottle&camera=gelsight_mini"), "bottle");
    let done = slipbound_in(folder.path(), &words("bottle", "bottle/sensor.toml"));
    let message = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(2), "{message}");
    assert!(message.contains("expected the sheared skin in full view"), "{message}");
    assert!(!path.exists());
}
