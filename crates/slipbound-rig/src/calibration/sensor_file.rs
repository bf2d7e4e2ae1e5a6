//! A calibration as a commented sensor file, and as an image with the grid drawn in.

use crate::overlay;
use slipbound::calibrate::Calibration;
use slipbound::sensor::{Polarity, Rectification, Sensor, Shear, Skin};
use std::fmt::Write;
use std::path::Path;

/// The text of a sensor file. `pitch_mm` and the like are only written where they are known.
pub fn sensor_file(calibration: &Calibration) -> String {
    let sensor = &calibration.sensor;
    let (markers_count, residual) = (calibration.markers.len(), calibration.residual_pitch);
    let straight = calibration.residual_without_distortion_pitch;
    let head = format!(
        "# Written by `slipbound calibrate`. {markers_count} markers on the grid, {residual:.3} pitch RMS off it{}.\n\
         # Look at the picture beside this file: every marker once, no line astray.\n",
        match sensor.rectification.is_some_and(|r| r.distortion.is_some()) {
            true => format!(" ({straight:.3} with a homography alone)"),
            false => String::new(),
        }
    );
    head + &facts(sensor, calibration.untouched)
}

/// The facts as TOML, each with its origin. `untouched`: whether they are from frames that look so.
fn facts(sensor: &Sensor, untouched: bool) -> String {
    let mut out = String::new();
    let mut line = |text: String| {
        out.push_str(&text);
        out.push('\n');
    };
    line(format!("name = {}", quoted(&sensor.name)));
    line(format!("description = {}", quoted(&sensor.description)));
    if let Some(serial) = &sensor.serial {
        line(format!("serial = {}", quoted(serial)));
    }
    line(format!("image_px = [{}, {}]", sensor.image_px.width, sensor.image_px.height));
    let flip = sensor.flip;
    line(format!(
        "flip = \"{flip}\"                     # by --flip, else assumed: a grid looks like one in the mirror, too"
    ));
    let weights: Vec<String> = sensor.grey_weights_rgb.iter().map(|w| number(*w)).collect();
    line(format!("grey_weights_rgb = [{}]   # markers stand out most steadily in this mixture", weights.join(", ")));
    let polarity = if sensor.polarity == Polarity::Dark { "dark" } else { "bright" };
    line(format!("polarity = \"{polarity}\""));
    line(format!("pitch_px = {}                   # in the rectified image", number(sensor.pitch_px)));
    match sensor.pitch_mm {
        Some(mm) => line(format!("pitch_mm = {}                    # as given by --pitch-mm", number(mm))),
        None => line("# pitch_mm: not given, so it is left out: no millimetres, thresholds act in pitches".into()),
    }
    if let Some([x_mm, y_mm]) = sensor.gel_mm {
        line(format!("gel_mm = [{}, {}]             # the whole gel, beyond the view", number(x_mm), number(y_mm)));
    }
    line(format!(
        "marker_diameter_px = {}          # width of the mean marker at half its depth",
        number(sensor.marker_diameter_px)
    ));
    let skin = if sensor.skin == Skin::Fabric { "fabric" } else { "smooth" };
    line(format!("skin = \"{skin}\"                   # as given by --skin: a weave shows only where it is pressed"));
    if let Some(sharpness) = sensor.bare_sharpness {
        line(format!("bare_sharpness = {}          # of the frames at rest; sharper is an imprint", number(sharpness)));
    }
    if !sensor.defects_px.is_empty() {
        line(
            "# Stands out at rest and is no marker: glare, scratches. Left, top, right, bottom in the rectified image."
                .into(),
        );
        let all: Vec<String> = sensor.defects_px.iter().map(|d| format!("{d:?}")).collect();
        line(format!("defects_px = [{}]", all.join(", ")));
    }
    if !sensor.edge_bands.is_empty() {
        let raised = match untouched {
            true => "raised until the untouched weave shows no contact",
            false => "not raised, as these frames look touched",
        };
        line(format!("\n# Canny's thresholds: those of the paper's finger, {raised}."));
    }
    for band in &sensor.edge_bands {
        let (low, high) = (band.low_levels, band.high_levels);
        let to = number(band.rows_to_fraction);
        line(format!("[[edge_bands]]\nrows_to_fraction = {to}\nlow_levels = {low}\nhigh_levels = {high}"));
    }
    if let Some(r) = &sensor.rectification {
        line(rectification(r));
    }
    if let Some(shear) = &sensor.shear {
        line(format!("\n{}", shear_table(shear).trim_end()));
    }
    out
}

fn rectification(r: &Rectification) -> String {
    let mut text =
        "\n# From the upright camera image to the plane of the gel, where markers stand a pitch apart, and the part \
                    of it that is used.\n[rectification]\nhomography = [\n"
            .to_owned();
    for row in r.homography.0 {
        let row: Vec<String> = row.iter().map(|v| number(*v)).collect();
        let _ = writeln!(text, "  [{}],", row.join(", ")); // a String accepts everything
    }
    let _ = write!(text, "]\ncrop_px = {:?}", r.crop_px);
    if let Some(d) = &r.distortion {
        let (x, y) = d.terms_px();
        let list = |terms: &[f64]| terms.iter().map(|v| number((v * 1e5).round() / 1e5)).collect::<Vec<_>>().join(", ");
        let _ = write!(
            text,
            "\n\n# What a homography cannot do: a displacement of that plane, polynomial of degree {} in (u, v) = (p - centre) \
             / span.\n# Terms: 1, u, v, u2, uv, v2, u3, u2v, uv2, v3, ...; beyond -1..1 it goes straight on.\n[rectification.distortion]\n\
             centre_px = [{}, {}]\nspan_px = [{}, {}]\nx_px = [{}]\ny_px = [{}]",
            d.degree(),
            number(d.centre_px.x),
            number(d.centre_px.y),
            number(d.span_px.x),
            number(d.span_px.y),
            list(x),
            list(y),
        );
    }
    text
}

/// The comment above the table of a shear stiffness.
pub const STIFFNESS_COMMENT: &str =
    "# Newtons for one marker displaced by one pitch; the tangential force is the sum over all markers.";

/// The table of a shear stiffness.
pub fn shear_table(shear: &Shear) -> String {
    format!(
        "{STIFFNESS_COMMENT}\n[shear]\n\
         stiffness_n_per_pitch = {}\nprovenance = {}\n",
        number(shear.stiffness_n_per_pitch),
        quoted(&shear.provenance)
    )
}

/// A number in TOML, to ten digits.
fn number(value: f64) -> String {
    let rounded: f64 = format!("{value:.9e}").parse().unwrap_or(value);
    let text = match rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) {
        true => format!("{rounded}"),
        false => format!("{rounded:e}"),
    };
    if text.contains(['.', 'e']) { text } else { format!("{text}.0") }
}

/// A string in TOML.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

/// Writes the averaged image with the grid drawn in as a PNG.
pub fn write_grid_picture(path: &Path, calibration: &Calibration) -> Result<(), overlay::Error> {
    let (rgb, size) = overlay::grid_picture(calibration);
    overlay::write_png(path, &rgb, size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors;
    use slipbound::image::SizePx;
    use slipbound::plane::{Homography, Vec2};
    use slipbound::sensor::{Distortion, EdgeBand, Flip};

    fn calibration(sensor: Sensor) -> Calibration {
        Calibration {
            sensor,
            markers: Vec::new(),
            residual_pitch: 0.0123,
            residual_without_distortion_pitch: 0.3,
            off_grid: Vec::new(),
            averaged: [0, 9],
            untouched: true,
            mean_rgb: Vec::new(),
        }
    }

    /// Reading returns what was written: every fact, to ten digits.
    #[test]
    fn the_file_says_what_was_found() {
        let terms: Vec<f64> = (0..21).map(|i| f64::from(i * i) * 0.25 - 20.0).collect();
        let sensor = Sensor {
            name: "mine \"A\"".into(),
            description: "one\\two".into(),
            serial: Some("007".into()),
            image_px: SizePx::new(427, 320),
            flip: Flip::Both,
            grey_weights_rgb: [0.12, 0.88, 0.0],
            polarity: Polarity::Bright,
            pitch_px: 20.0,
            pitch_mm: Some(1.25),
            gel_mm: Some([25.25, 20.75]),
            marker_diameter_px: 6.3,
            skin: Skin::Fabric,
            bare_sharpness: Some(0.05),
            edge_bands: vec![EdgeBand { rows_to_fraction: 1.0, low_levels: 90, high_levels: 120 }],
            rectification: Some(Rectification {
                homography: Homography([[0.798, -0.338, 41.2], [0.0367, 0.8436, -24.6], [-1.0275817e-5, -0.0014, 1.0]]),
                crop_px: [0, 0, 400, 300],
                distortion: Distortion::new(Vec2::new(200.0, 150.5), Vec2::new(400.0, 300.0), &terms, &terms).ok(),
            }),
            defects_px: vec![[10, 20, 30, 40], [1, 2, 3, 4]],
            shear: Some(Shear { stiffness_n_per_pitch: 0.125, provenance: "200 g".into() }),
        };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("mine.toml");
        for sensor in [
            sensor.clone(),
            Sensor { serial: None, pitch_mm: None, gel_mm: None, defects_px: vec![], shear: None, ..sensor },
        ] {
            std::fs::write(&path, sensor_file(&calibration(sensor.clone()))).expect("writes");
            assert_eq!(sensors::load(path.to_str().expect("UTF-8")).expect("valid"), sensor);
        }
    }

    #[test]
    fn numbers_are_floats_of_ten_digits() {
        for (value, text) in [(20.0, "20.0"), (0.1 + 0.2, "0.3"), (-1.0275817e-5, "-1.0275817e-5"), (0.0, "0.0")] {
            assert_eq!(number(value), text);
        }
    }
}
