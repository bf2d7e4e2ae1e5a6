//! The report of testdata/twist.avi, byte for byte. `REGENERATE=1 cargo test -p slipbound-cli --test golden` writes it
//! again; check the difference before you commit it.

mod program;

use program::slipbound_in;
use std::path::Path;

#[test]
fn the_test_recording_has_the_same_report_everywhere() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let golden = root.join("testdata/twist.report.txt");
    let output =
        slipbound_in(&root, &["watch", "testdata/twist.avi", "--sensor", "testdata/painted.toml", "--json", "-"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report = String::from_utf8(output.stdout).expect("JSON is text");
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(&golden, &report).expect("testdata can be written");
    }
    let expected = std::fs::read_to_string(&golden).expect("testdata/twist.report.txt is there");
    for (i, (line, wanted)) in report.lines().zip(expected.lines()).enumerate() {
        assert_eq!(line, wanted, "line {} of the report", i + 1);
    }
    assert_eq!(report.lines().count(), expected.lines().count(), "lines of the report");
    assert!(report.contains("\"state\":\"incipient\""), "the recording shows slip");
}
