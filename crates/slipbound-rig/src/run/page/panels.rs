//! The plots of a run, depending on what is known.

use crate::run::info::RunInfo;
use slipbound::control::Cycle;
use slipbound::hand::HandVector;
use slipbound::monitor::{SlipRule, SlipSettings};
use slipbound::plant::{GRAVITY_M_PER_S2, PlantTruth};

/// A wrist that has moved less than this, in mm or rad, has not moved.
const MOVED: f64 = 1e-6;

/// How a line is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stroke {
    /// From value to value.
    Solid,
    /// A bound or a target.
    Dashed,
    /// A value that holds until the next one.
    Step,
    /// With the area below it.
    Area,
}

/// One value per cycle.
#[derive(Debug)]
pub(super) struct Line {
    pub name: &'static str,
    /// Name of a colour of the style sheet, `--c1` to `--c4`.
    pub colour: &'static str,
    pub stroke: Stroke,
    pub values: Vec<Option<f64>>,
}

/// One plot.
#[derive(Debug)]
pub(super) struct Panel {
    pub title: &'static str,
    pub unit: &'static str,
    pub height_px: f64,
    /// Bounds of the axis beyond which it does not follow the values.
    pub bounds: (f64, f64),
    /// What the axis always shows.
    pub shown: (f64, f64),
    pub decimals: usize,
    pub lines: Vec<Line>,
}

impl Panel {
    /// A plot whose axis follows its values and always shows zero.
    pub(super) fn new(
        title: &'static str,
        unit: &'static str,
        height_px: f64,
        decimals: usize,
        lines: Vec<Line>,
    ) -> Self {
        let bounds = (f64::NEG_INFINITY, f64::INFINITY);
        Panel { title, unit, height_px, bounds, shown: (0.0, 0.0), decimals, lines }
    }
}

/// The plots of these cycles. A line without a value is left out, and a plot without a line. Lengths are in mm where the pitch
/// of some finger is known, else in pitches.
pub(super) fn of(cycles: &[Cycle], slips_pitch: &[Option<f64>], info: &RunInfo) -> Vec<Panel> {
    let knows_mm = info.fingers.iter().any(|finger| finger.sensor.pitch_mm.is_some());
    let alarm_margin = alarm_margin(&info.monitor_settings.slip);
    let line = |name, colour, stroke, value: &dyn Fn(&Cycle) -> Option<f64>| Line {
        name,
        colour,
        stroke,
        values: cycles.iter().map(|c| value(c).filter(|v| v.is_finite())).collect(),
    };
    let truth = |name, colour, stroke, value: &dyn Fn(&PlantTruth) -> Option<f64>| {
        line(name, colour, stroke, &|c: &Cycle| c.truth.as_ref().and_then(value))
    };
    let panel = Panel::new;
    use Stroke::{Area, Dashed, Solid, Step};
    let shear = |part: fn(HandVector) -> f64, separated: bool| {
        move |c: &Cycle| c.hand.shear_mm.filter(|_| c.hand.separated == separated).map(part)
    };
    let turned = moved(cycles, |c| c.wrist.angle_rad);
    let lowered = moved(cycles, |c| c.wrist.lowered_mm);
    let mut largest = line("largest of a marker, since the reference", "--c1", Solid, &|c| c.hand.slip_max_mm);
    if !knows_mm {
        largest.values = slips_pitch.to_vec();
    }
    let mut panels = vec![
        panel(
            "Grip force",
            "N per finger",
            230.0,
            1,
            vec![
                truth("least that holds (truth)", "--c3", Area, &|t| t.required_n),
                line("commanded", "--c2", Step, &|c| c.grip_command.force_n()),
                line("measured", "--c1", Solid, &|c| c.gripper.force_n),
            ],
        ),
        panel(
            "Angle",
            "deg",
            150.0,
            1,
            vec![
                line("wrist", "--c1", Solid, &|c| Some(c.wrist.angle_rad.to_degrees()).filter(|_| turned)),
                truth("cap (truth)", "--c2", Dashed, &|t| t.cap_angle_rad.map(f64::to_degrees)),
            ],
        ),
        panel(
            "Lowered",
            "mm",
            150.0,
            2,
            vec![line("wrist", "--c1", Solid, &|c| Some(c.wrist.lowered_mm).filter(|_| lowered))],
        ),
        panel(
            "Torque on the cap",
            "N mm",
            150.0,
            0,
            vec![
                truth("carried (truth)", "--c3", Solid, &|t| t.torque_n_mm),
                truth("2 mu P R, as of a flat contact (truth)", "--c2", Dashed, &|t| t.torque_limit_n_mm),
            ],
        ),
        panel(
            "Load",
            "N",
            150.0,
            2,
            vec![
                truth("on the fingers (truth)", "--c3", Solid, &|t| t.load_n),
                truth("on the ground (truth)", "--c4", Solid, &|t| t.ground_force_n),
                truth("weight (truth)", "--c2", Dashed, &|t| t.mass_kg.map(|kg| kg * GRAVITY_M_PER_S2)),
            ],
        ),
        Panel {
            bounds: (-0.3, 1.0),
            shown: (0.0, 1.0),
            ..panel(
                "Slip margin and stick ratio",
                "of 1",
                180.0,
                2,
                vec![
                    truth("stick ratio (truth)", "--c4", Dashed, &|t| t.stick_ratio),
                    truth("margin (truth)", "--c3", Solid, &|t| t.margin),
                    line("margin as estimated, least of the fingers", "--c1", Solid, &|c| c.hand.margin),
                    line("margin of the controller", "--c2", Step, &|c| c.margin),
                    line("alarm", "--c2", Dashed, &|c| c.hand.margin.and(alarm_margin)),
                ],
            )
        },
        panel(
            "Slip",
            if knows_mm { "mm" } else { "marker pitches" },
            150.0,
            3,
            vec![truth("object through the fingers (truth)", "--c3", Solid, &|t| t.slid_mm), largest],
        ),
        panel(
            "Shear of the gels",
            "mm",
            150.0,
            3,
            vec![
                line("along", "--c2", Solid, &|c| c.hand.shear_mm.map(|v| v.along)),
                line("around", "--c1", Solid, &shear(|v| v.around, true)),
                line("across", "--c4", Solid, &shear(|v| v.across, true)),
                line("around or across", "--c3", Solid, &shear(|v| v.around, false)),
            ],
        ),
    ];
    for panel in &mut panels {
        panel.lines.retain(|line| line.values.iter().any(Option::is_some));
    }
    panels.retain(|panel| !panel.lines.is_empty());
    panels
}

/// The margin at which incipient slip is reported; None where another rule reports it.
pub(super) fn alarm_margin(slip: &SlipSettings) -> Option<f64> {
    (slip.rule == SlipRule::Margin).then_some(slip.alarm_margin_fraction)
}

fn moved(cycles: &[Cycle], value: impl Fn(&Cycle) -> f64) -> bool {
    cycles.iter().any(|c| value(c).abs() > MOVED)
}
