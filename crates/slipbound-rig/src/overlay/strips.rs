//! The strips above and below the panels: verdict in words, legend.

use super::canvas::{Canvas, Colour, Text};
use super::palette::{CONTACT, GROSS, INNER, LOST, MEASURED, PAPER, RIGID, SLIP, SLIPPING};
use crate::report_summary::whole_degrees;
use slipbound::monitor::{Estimate, Marker, SlipKind, SlipReport, SlipState, SlipSummary};
use slipbound::plane::Vec2;

/// Height of the strip with the verdict.
pub(super) const HEAD_PX: usize = 76;
/// Height of the strip with the legend.
pub(super) const LEGEND_PX: usize = 40;

const WORDS: Colour = Colour::new(236, 239, 243);
const QUIET: Colour = Colour::new(160, 168, 178);

/// State, frame and the numbers behind them. The margin is shown where it decides.
pub(super) fn head(canvas: &mut Canvas, report: &SlipReport, markers: &[Marker], alarm_margin: Option<f64>) {
    let (name, colour) = badge(report.state);
    let width = Text::Large.width(name) + 28;
    canvas.rectangle(12, 10, width, 32, colour);
    canvas.text((26, 14), Text::Large, PAPER, name);
    let time = report.time_ns.map_or_else(String::new, |ns| format!("   {:.3} s", ns as f64 / 1e9));
    let mut line = format!("frame {}{time}", report.seq);
    if let Some(reason) = &report.reason {
        line += &format!("   {reason}");
    }
    line += &margin_in_words(report.estimates.margin, alarm_margin);
    line += &slip_in_words(report.state, &report.slip);
    canvas.text((12 + width + 16, 14), Text::Large, WORDS, &line);
    if report.state != SlipState::Unjudged {
        canvas.text((14, 50), Text::Small, QUIET, &numbers(report, markers));
    }
}

/// The margin beside the one at which it raises the alarm; nothing where another rule does.
fn margin_in_words(margin: Option<Estimate>, alarm_margin: Option<f64>) -> String {
    let Some((margin, alarm)) = margin.zip(alarm_margin) else { return String::new() };
    format!("   margin {:.2}, alarm below {alarm:.2}", margin.value)
}

/// How the object slides, or would slide if the load grew.
fn slip_in_words(state: SlipState, slip: &SlipSummary) -> String {
    let verb = match state {
        SlipState::Incipient => "   object would ",
        SlipState::Gross => "   object ",
        _ => return String::new(),
    };
    let Some(kind) = slip.kind else { return String::new() };
    let ending = if state == SlipState::Gross { "s" } else { "" };
    let motion = match kind {
        SlipKind::Translation => format!("slide{ending}"),
        SlipKind::Rotation => format!("turn{ending}"),
        SlipKind::Both => format!("turn{ending} and slide{ending}"),
    };
    let direction = slip.direction_rad.map(|rad| format!(" towards {} deg", whole_degrees(rad)));
    verb.to_owned() + &motion + &direction.unwrap_or_default()
}

/// The second line: contact, motion, slip, markers.
fn numbers(report: &SlipReport, markers: &[Marker]) -> String {
    let mut parts = Vec::new();
    parts.push(match report.contact.area_mm2 {
        Some(mm2) => format!("contact {mm2:.1} mm2"),
        None => format!("contact {:.0} px2", report.contact.area_px2),
    });
    parts.push(format!("quality {:.2}", report.contact.quality));
    if let Some(motion) = &report.motion {
        let (shift, unit) = match motion.translation_mm {
            Some(mm) => (mm.length(), "mm"),
            None => (motion.translation_px.length(), "px"),
        };
        parts.push(format!("moved {shift:.2} {unit}, turned {:+.2} deg", motion.rotation_rad.to_degrees()));
    }
    let in_contact = markers.iter().filter(|m| m.in_contact).count();
    let slip = &report.slip;
    let (over, threshold_pitch, most_pitch) = (slip.markers_over, slip.threshold_pitch, slip.max_pitch);
    parts.push(format!("slip over {threshold_pitch:.2} pitch: {over} of {in_contact} markers, most {most_pitch:.2}"));
    parts.extend(report.estimates.stick_ratio.map(|ratio| format!("stick ratio {:.2}", ratio.value)));
    parts.push(format!("matched {}, lost {}", report.markers.matched, report.markers.lost));
    parts.push(format!("reference: frame {}", report.reference_seq));
    parts.join("  |  ")
}

fn badge(state: SlipState) -> (&'static str, Colour) {
    match state {
        SlipState::NoContact => ("NO CONTACT", Colour::new(92, 102, 116)),
        SlipState::Unsure => ("UNSURE", Colour::new(196, 138, 20)),
        SlipState::Stick => ("STICK", Colour::new(28, 140, 66)),
        SlipState::Incipient => ("INCIPIENT SLIP", SLIPPING),
        SlipState::Gross => ("GROSS SLIP", GROSS),
        SlipState::Unjudged => ("UNJUDGED", Colour::new(76, 104, 140)),
    }
}

/// What a panel shows and how much its arrows are magnified.
pub(super) fn caption(panel: &mut Canvas, text: &str) {
    panel.rectangle(6, 6, Text::Small.width(text) + 8, Text::Small.height() + 4, SLIP.with_alpha(0.6));
    panel.text((10, 8), Text::Small, PAPER, text);
}

/// Replaces the panels when the frame has no image that could be rectified.
pub(super) fn no_picture(canvas: &mut Canvas) {
    let size = canvas.size();
    let text = "no picture of this frame";
    let left = (size.width as i32 - Text::Large.width(text)) / 2;
    canvas.text((left, size.height as i32 / 2), Text::Large, QUIET, text);
}

/// Symbol and name of everything that is drawn.
pub(super) fn legend(canvas: &mut Canvas, threshold_pitch: f64) {
    let size = canvas.size();
    let middle = size.height as f64 - LEGEND_PX as f64 / 2.0;
    let top = size.height as i32 - LEGEND_PX as i32 / 2 - Text::Small.height() / 2;
    // A frame that was not judged has no threshold.
    let over = if threshold_pitch > 0.0 { format!("{threshold_pitch:.2} pitch") } else { "threshold".into() };
    let over = format!("slip over {over}");
    let entries = [
        (Sign::Patch(CONTACT), "contact"),
        (Sign::Patch(INNER), "inner"),
        (Sign::Arrow(MEASURED, 4.4), "measured"),
        (Sign::Arrow(RIGID, 2.8), "rigid"),
        (Sign::Reference, "reference point"),
        (Sign::Dot(MEASURED), "ICR"),
        (Sign::Arrow(SLIP, 2.8), "slip"),
        (Sign::Dot(SLIPPING), &over),
        (Sign::Ring(LOST), "lost"),
    ];
    let words: i32 = entries.iter().map(|(_, word)| Text::Small.width(word)).sum();
    let sign_px = 34;
    let room = size.width as i32 - 24 - words - entries.len() as i32 * (sign_px + 6);
    let gap = (room / entries.len() as i32).clamp(4, 60);
    let mut x = 14;
    for (sign, word) in entries {
        let (from, to) = (Vec2::new(f64::from(x), middle), Vec2::new(f64::from(x + sign_px), middle));
        let centre = (from + to) / 2.0;
        match sign {
            Sign::Patch(colour) => {
                canvas.rectangle(x + 6, middle as i32 - 8, sign_px - 10, 16, colour.with_alpha(0.35));
                for (dx, dy, w, h) in
                    [(6, -8, sign_px - 10, 2), (6, 6, sign_px - 10, 2), (6, -8, 2, 16), (sign_px - 6, -8, 2, 16)]
                {
                    canvas.rectangle(x + dx, middle as i32 + dy, w, h, colour);
                }
            }
            Sign::Arrow(colour, width) => canvas.arrow(from, to, width, colour, (1.8, PAPER.with_alpha(0.85))),
            Sign::Dot(colour) => {
                canvas.dot(centre, 9.0, PAPER);
                canvas.dot(centre, 7.5, colour);
            }
            Sign::Ring(colour) => canvas.ring(centre, 6.0, 1.8, colour),
            Sign::Reference => {
                let tail = from + Vec2::new(6.0, 0.0);
                canvas.dot(tail, 7.5, PAPER);
                canvas.dot(tail, 6.0, RIGID);
                canvas.arrow(tail, to, 5.0, RIGID, (1.8, PAPER.with_alpha(0.6)));
            }
        }
        x += sign_px + 6;
        canvas.text((x, top), Text::Small, WORDS, word);
        x += Text::Small.width(word) + gap;
    }
}

/// How an entry of the legend looks.
enum Sign {
    Patch(Colour),
    Arrow(Colour, f64),
    Dot(Colour),
    Ring(Colour),
    Reference,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the paper's rule decides, ours would contradict the badge.
    #[test]
    fn the_margin_is_shown_beside_its_alarm_and_only_where_it_decides() {
        let margin = Some(Estimate { value: 0.41, sd: 0.02, age_frames: 0 });
        assert_eq!(margin_in_words(margin, Some(0.5)), "   margin 0.41, alarm below 0.50");
        assert_eq!([margin_in_words(margin, None), margin_in_words(None, Some(0.5))], ["", ""]);
    }

    /// Incipient slip is not yet a motion of the object.
    #[test]
    fn only_an_object_that_slides_is_said_to() {
        let slip = |kind, direction_rad| SlipSummary { kind: Some(kind), direction_rad, ..SlipSummary::default() };
        let down = slip(SlipKind::Translation, Some(-std::f64::consts::FRAC_PI_2));
        assert_eq!(slip_in_words(SlipState::Incipient, &down), "   object would slide towards -90 deg");
        assert_eq!(slip_in_words(SlipState::Gross, &down), "   object slides towards -90 deg");
        let ahead = slip(SlipKind::Translation, Some(-0.001));
        assert_eq!(slip_in_words(SlipState::Gross, &ahead), "   object slides towards 0 deg");
        assert_eq!(slip_in_words(SlipState::Gross, &slip(SlipKind::Both, None)), "   object turns and slides");
        assert_eq!(slip_in_words(SlipState::Stick, &down), "");
        assert_eq!(slip_in_words(SlipState::Gross, &SlipSummary::default()), "");
    }
}
