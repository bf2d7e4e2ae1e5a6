//! The plots of a run, depending on what is known.

use crate::run::info::RunInfo;
use slipbound::control::Cycle;
use slipbound::hand::HandVector;
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

use Stroke::{Area, Dashed, Solid, Step};

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
    /// How to read it, below the plot; empty for nothing.
    pub note: &'static str,
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
        Panel { title, unit, height_px, bounds, shown: (0.0, 0.0), decimals, lines, note: "" }
    }
}

/// The plots of these cycles. A line without a value is left out, and a plot without a line. Lengths are in mm where the pitch
/// of some finger is known, else in pitches.
pub(super) fn of(cycles: &[Cycle], slips_pitch: &[Option<f64>], info: &RunInfo) -> Vec<Panel> {
    let knows_mm = info.fingers.iter().any(|finger| finger.sensor.pitch_mm.is_some());
    let values = Values(cycles);
    let mut panels = vec![
        grip_force(values),
        angle(values),
        lowered(values),
        torque(values),
        load(values),
        margin(values, info.monitor_settings.slip.alarm_margin()),
        slip(values, (!knows_mm).then_some(slips_pitch)),
        shear(values),
    ];
    for panel in &mut panels {
        panel.lines.retain(|line| line.values.iter().any(Option::is_some));
    }
    panels.retain(|panel| !panel.lines.is_empty());
    panels
}

/// The cycles that lines are made of.
#[derive(Clone, Copy)]
struct Values<'a>(&'a [Cycle]);

impl Values<'_> {
    /// A line of what the loop knew.
    fn line(
        self,
        name: &'static str,
        colour: &'static str,
        stroke: Stroke,
        value: impl Fn(&Cycle) -> Option<f64>,
    ) -> Line {
        let values = self.0.iter().map(|c| value(c).filter(|v| v.is_finite())).collect();
        Line { name, colour, stroke, values }
    }

    /// A line of the ground truth of a simulation.
    fn truth(
        self,
        name: &'static str,
        colour: &'static str,
        stroke: Stroke,
        value: impl Fn(&PlantTruth) -> Option<f64>,
    ) -> Line {
        self.line(name, colour, stroke, |c| c.truth.as_ref().and_then(&value))
    }

    /// Whether the wrist has moved.
    fn moved(self, value: impl Fn(&Cycle) -> f64) -> bool {
        self.0.iter().any(|c| value(c).abs() > MOVED)
    }
}

fn grip_force(of: Values<'_>) -> Panel {
    let lines = vec![
        of.truth("least that holds (truth)", "--c3", Area, |t| t.required_n),
        of.line("commanded", "--c2", Step, |c| c.grip_command.force_n()),
        of.line("measured", "--c1", Solid, |c| c.gripper.force_n),
    ];
    Panel::new("Grip force", "N per finger", 230.0, 1, lines)
}

fn angle(of: Values<'_>) -> Panel {
    let turned = of.moved(|c| c.wrist.angle_rad);
    let lines = vec![
        of.line("wrist", "--c1", Solid, |c| Some(c.wrist.angle_rad.to_degrees()).filter(|_| turned)),
        of.truth("cap (truth)", "--c2", Dashed, |t| t.cap_angle_rad.map(f64::to_degrees)),
    ];
    Panel::new("Angle", "deg", 150.0, 1, lines)
}

fn lowered(of: Values<'_>) -> Panel {
    let lowered = of.moved(|c| c.wrist.lowered_mm);
    let lines = vec![of.line("wrist", "--c1", Solid, |c| Some(c.wrist.lowered_mm).filter(|_| lowered))];
    Panel::new("Lowered", "mm", 150.0, 2, lines)
}

fn torque(of: Values<'_>) -> Panel {
    let lines = vec![
        of.truth("carried (truth)", "--c3", Solid, |t| t.torque_n_mm),
        of.truth("2 mu P R, flat contact (truth)", "--c2", Dashed, |t| t.torque_limit_n_mm),
    ];
    let note = "More than 2 mu P R is no error: that is the limit of a flat contact, while the gel wraps around the cap and \
                presses on it from the sides, too. From 40 N on the gel is also strained beyond its linear range.";
    Panel { note, ..Panel::new("Torque on the cap", "N mm", 150.0, 0, lines) }
}

fn load(of: Values<'_>) -> Panel {
    let lines = vec![
        of.truth("on the fingers (truth)", "--c3", Solid, |t| t.load_n),
        of.truth("on the ground (truth)", "--c4", Solid, |t| t.ground_force_n),
        of.truth("weight (truth)", "--c2", Dashed, |t| t.mass_kg.map(|kg| kg * GRAVITY_M_PER_S2)),
    ];
    Panel::new("Load", "N", 150.0, 2, lines)
}

/// `alarm`: the margin at which incipient slip is reported, if it is.
fn margin(of: Values<'_>, alarm: Option<f64>) -> Panel {
    let lines = vec![
        of.truth("stick ratio (truth)", "--c4", Dashed, |t| t.stick_ratio),
        of.truth("margin (truth)", "--c3", Solid, |t| t.margin),
        of.line("margin as estimated, least of the fingers", "--c1", Solid, |c| c.hand.margin),
        of.line("margin of the controller", "--c2", Step, |c| c.margin),
        of.line("alarm", "--c2", Dashed, |c| c.hand.margin.and(alarm)),
    ];
    let panel = Panel::new("Slip margin and stick ratio", "fraction", 180.0, 2, lines);
    Panel { bounds: (-0.3, 1.0), shown: (0.0, 1.0), ..panel }
}

/// `in_pitches`: the largest slip of a marker in every cycle, in pitches, where no pitch is known in mm.
fn slip(of: Values<'_>, in_pitches: Option<&[Option<f64>]>) -> Panel {
    let mut largest = of.line("largest deviation of a marker from rigid motion", "--c1", Solid, |c| c.hand.slip_max_mm);
    let mut unit = "mm";
    if let Some(slips_pitch) = in_pitches {
        (largest.values, unit) = (slips_pitch.to_vec(), "marker pitches");
    }
    let lines = vec![of.truth("object through the fingers (truth)", "--c3", Solid, |t| t.slid_mm), largest];
    Panel::new("Slip", unit, 150.0, 3, lines)
}

fn shear(of: Values<'_>) -> Panel {
    let part = |part: fn(HandVector) -> f64, separated: bool| {
        move |c: &Cycle| c.hand.shear_mm.filter(|_| c.hand.separated == separated).map(part)
    };
    let lines = vec![
        of.line("along", "--c2", Solid, |c| c.hand.shear_mm.map(|v| v.along)),
        of.line("around", "--c1", Solid, part(|v| v.around, true)),
        of.line("across", "--c4", Solid, part(|v| v.across, true)),
        of.line("around or across", "--c3", Solid, part(|v| v.around, false)),
    ];
    Panel::new("Shear of the gels", "mm", 150.0, 3, lines)
}
