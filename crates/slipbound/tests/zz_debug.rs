include!("calibrate.rs");
#[test]
fn dump() {
    let seed: u64 = std::env::var("S").unwrap().parse().unwrap();
    let f = finger(seed);
    std::fs::write("/tmp/w/5out/d.pgm", [format!("P5 {} {} 255\n", f.size.width, f.size.height).into_bytes(), f.grey.clone()].concat()).unwrap();
    let found = calibrate(&[frame(&f.grey, f.size)], &given()).unwrap();
    let mut t = String::new();
    for m in &found.markers { t += &format!("{} {} {} {} {}\n", m.camera_px.x, m.camera_px.y, m.node[0], m.node[1], m.residual_pitch); }
    std::fs::write("/tmp/w/5out/d.txt", t).unwrap();
    let mut t = String::new();
    for n in &f.nodes { let c = f.truth.camera(*n); t += &format!("{} {}\n", c.x, c.y); }
    std::fs::write("/tmp/w/5out/t.txt", t).unwrap();
    println!("{} {:?} pitch {} d {} without {}", f.what, found.sensor.rectification, found.sensor.pitch_px, found.sensor.marker_diameter_px, found.residual_without_distortion_pitch);
}
