use slipbound::monitor::*;
use slipbound::plane::Vec2;
use slipbound::port::*;
use slipbound_lab::{scenes::Trial, world::World};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    for object in a[1].split(',') {
        for dir in [0, 90] {
            for force in [10, 30, 60] {
                for mu in ["0.4", "0.9"] {
                    let t = Trial::parse(&format!("ramp?object={object}&force_n={force}&mu={mu}&ramp_s=1&direction_deg={dir}&twist_fraction=0&grid=fast&seed=5")).unwrap();
                    let mut w = World::new(&t).unwrap();
                    let sensor = w.sensor();
                    let settings = Settings::default();
                    let mut f = FrameBuffer::default();
                    let mut builder =
                        RestBuilder::new(&sensor, &settings, slipbound::image::SizePx::new(640, 480)).unwrap();
                    let mut m: Option<SlipMonitor> = None;
                    let mut n = 0;
                    let mut rows = vec![];
                    while w.next(&mut f).unwrap() == Next::Frame {
                        let fr = f.frame().unwrap();
                        n += 1;
                        if n <= 10 {
                            builder.add(&fr).unwrap();
                            continue;
                        }
                        if m.is_none() {
                            m = Some(
                                SlipMonitor::new(
                                    &sensor,
                                    &settings,
                                    std::mem::replace(
                                        &mut builder,
                                        RestBuilder::new(&sensor, &settings, slipbound::image::SizePx::new(640, 480))
                                            .unwrap(),
                                    )
                                    .build(RestKind::Unloaded)
                                    .unwrap(),
                                )
                                .unwrap(),
                            );
                        }
                        let mon = m.as_mut().unwrap();
                        let grip = w.truth().grip_force_n;
                        let r = mon.step(&fr, Some(GripSample { force_n: grip }));
                        let Some(load) = w.truth().load else { continue };
                        let Some(sh) = r.shear else { continue };
                        let mm = sensor.mm_per_px().unwrap();
                        let core: Vec<(Vec2, Vec2)> =
                            mon.markers().iter().filter(|k| k.inner).map(|k| (k.rest, k.now)).collect();
                        let Some(c) = fit_most(core.iter().copied(), sensor.pitch_px) else { continue };
                        let u = sh.translation_px / sh.translation_px.length().max(1e-9);
                        let (mut maxr, mut lag, mut cnt, mut proj) = (0.0f64, 0.0, 0.0, vec![]);
                        for k in mon.markers().iter().filter(|k| k.in_contact && k.whole && k.matched) {
                            let d = c.displacement(k.rest) - k.now_from_rest();
                            maxr = maxr.max(d.length());
                            proj.push(d.dot(u));
                            if !k.inner {
                                lag += d.dot(u);
                                cnt += 1.0;
                            }
                        }
                        proj.sort_by(f64::total_cmp);
                        let q = |p: f64| proj[(p * (proj.len() - 1) as f64) as usize] * mm;
                        rows.push((
                            load,
                            r.state,
                            sh.translation_px.length() * mm,
                            c.translation.length() * mm,
                            maxr * mm,
                            lag / cnt * mm,
                            q(0.9),
                            q(0.75),
                            r.contact.area_mm2.unwrap(),
                            r.slip.max_mm.unwrap(),
                        ));
                    }
                    let g = w.gross().map_or(1.0, |g| g.load);
                    println!("{object} dir {dir} P {force} mu {mu} gross {g:.3}");
                    for want in [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.05] {
                        if let Some(r) =
                            rows.iter().min_by(|a, b| (a.0 / g - want).abs().total_cmp(&(b.0 / g - want).abs()))
                        {
                            let s = mu.parse::<f64>().unwrap() * force as f64 / (0.0561 * r.8);
                            println!(
                                "  f {:.2} {:?} shear {:.3} core {:.3} max {:.3} rim {:.3} q90 {:.3} q75 {:.3} A {:.0} s* {:.3} | shear/s* {:.2} max/s* {:.2} rim/s* {:.2} | max/sh {:.2} rim/sh {:.2} q90/sh {:.2} slip {:.3}",
                                r.0 / g,
                                r.1,
                                r.2,
                                r.3,
                                r.4,
                                r.5,
                                r.6,
                                r.7,
                                r.8,
                                s,
                                r.2 / s,
                                r.4 / s,
                                r.5 / s,
                                r.4 / r.2,
                                r.5 / r.2,
                                r.6 / r.2,
                                r.9
                            );
                        }
                    }
                }
            }
        }
    }
}
