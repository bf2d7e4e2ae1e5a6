//! A report as a table row, and a checksum of everything without a column.

use crate::motion_profile::ProfileStep;
use crate::snapshot::Checksum;
use slipbound::monitor::{Estimate, SlipMonitor, SlipReport};
use slipbound::plane::Vec2;

pub const HEAD: &str = "Lengths in px. shear: of the gel since rest, x y and turn in mrad. motion: of the inner region since the reference. slip: markers over the\n\
    threshold of those needed, longest in pitches, direction in rad. load: shear force in N and torque in N mm. @: frames since it was measured.\n\
    evidence: slide score, change of the imprint, slide x y and turn in mrad, ! where it slides, probability of gross slip. sum: of all reports, markers, regions and features so far.\n\n";

const TITLES: &str = "part     seq state    area qual  match lost inner     shear x      y    turn    motion x      y    turn \
    | slip  longest  way   | stick          margin           mu             load            | evidence                                           sum";

pub fn titles() -> String {
    format!("{TITLES}\n")
}

/// Adds everything known after a frame except the regions.
pub fn add(sum: &mut Checksum, report: &SlipReport, monitor: &SlipMonitor) {
    sum.add(&serde_json::to_vec(report).expect("data"));
    for m in monitor.markers() {
        for p in [m.reference, m.now, m.slip] {
            sum.add(&p.x.to_bits().to_le_bytes());
            sum.add(&p.y.to_bits().to_le_bytes());
        }
        sum.add(&[m.matched, m.whole, m.in_reference, m.in_contact, m.inner, m.over].map(u8::from));
    }
    let numbers = monitor.features().into_iter().flatten().chain(monitor.slide_features().into_iter().flatten());
    numbers.for_each(|number| sum.add(&number.to_bits().to_le_bytes()));
}

/// Adds the contact region and its inner region.
pub fn add_regions(sum: &mut Checksum, monitor: &SlipMonitor) {
    let inner = monitor.inner_region();
    for region in [monitor.contact_region(), &inner] {
        let size = region.size();
        for y in 0..size.height {
            let covered = (0..size.width).filter(|&x| region.get(x as isize, y as isize));
            covered.for_each(|x| sum.add(&[x as u8, y as u8]));
        }
    }
}

pub fn row(step: &ProfileStep, report: &SlipReport, sum: &Checksum) -> String {
    let state = serde_json::to_value(report.state).expect("data");
    let motion = |motion: Option<(Vec2, f64)>| {
        motion.map_or(format!("{:>24}", "-"), |(p, rad)| format!("{:8.3} {:6.3} {:8.3}", p.x, p.y, 1e3 * rad))
    };
    let estimate = |estimate: Option<Estimate>| {
        estimate.map_or(format!("{:<14}", "-"), |e| format!("{:6.4}±{:.4}@{:<1}", e.value, e.sd, e.age_frames))
    };
    let slip = &report.slip;
    let way = slip.direction_rad.map_or("-".into(), |rad| format!("{rad:.3}"));
    let load = report.estimates.shear_n.zip(report.estimates.torque_nmm);
    let load = load.map_or(format!("{:<15}", "-"), |(n, nmm)| format!("{:6.4} {:8.3}", n.value, nmm.value));
    let evidence = report.evidence.map_or(format!("{:<49}", "-"), |e| {
        let change = e.imprint_change.map_or("-".into(), |change| format!("{change:.4}"));
        let slides = if e.slides { '!' } else { ' ' };
        let (p, rad) = (e.slide_px, 1e3 * e.slide_rad);
        let gross = e.gross_probability.map_or("-".into(), |gross| format!("{gross:.4}"));
        format!("{:.4} {change:>6} {:7.3} {:7.3} {rad:8.3} {slides} {gross:>6}", e.slide_score, p.x, p.y)
    });
    let reason = report.reason.map_or(String::new(), |reason| format!("  {reason}"));
    let (markers, contact) = (&report.markers, &report.contact);
    format!(
        "{:<8} {:3} {:<9} {:5} {:.3}  {:3} {:3}  {:3}   {}  {} | {:>2}/{:<2} {:6.4} {way:>6} | {} {} {} {load} | {evidence} {}{reason}\n",
        step.part,
        report.seq,
        state.as_str().unwrap_or("?"),
        contact.area_px2,
        contact.quality,
        markers.matched,
        markers.lost,
        markers.inner,
        motion(report.shear.map(|s| (s.translation_px, s.rotation_rad))),
        motion(report.motion.map(|m| (m.translation_px, m.rotation_rad))),
        slip.markers_over,
        slip.markers_needed,
        slip.max_pitch,
        estimate(report.estimates.stick_ratio),
        estimate(report.estimates.margin),
        estimate(report.estimates.friction),
        sum.shown(),
    )
}
