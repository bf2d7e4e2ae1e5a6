use slipbound_lab::contact::*;
use slipbound_lab::contact::shape::*;
use slipbound::plane::Vec2;
fn main(){
  for p in [10.0,20.,40.,60.0] { for mu in [0.4,0.8,1.2] { for sh in 0..4 { for tw in [false,true] {
    let s = FingerSettings { friction: Friction::constant(mu), body: Body{drive:Drive::Free(Inertia{mass_kg:0.1,gyration_radius_mm:20.0,centre_of_mass_mm:Vec2::ZERO}),fingers_count:1}, ..FingerSettings::standard() };
    let (mut f,name) = match sh {0=>(Finger::new(s,Cylinder{radius_mm:14.,length_mm:12.,edge_radius_mm:1.0}),"cap"),1=>(Finger::new(s,Sphere{radius_mm:15.}),"sphere"),2=>(Finger::new(s,FlatBox{length_mm:20.,width_mm:15.,edge_radius_mm:1.0}),"flat"),_=>(Finger::new(s,FlatBox{length_mm:24.,width_mm:8.,edge_radius_mm:2.0}),"bar")};
    let f=f.as_mut().unwrap();
    let w = if tw {Wrench{force_n:Vec2::ZERO,torque_n_mm:mu*p*12.0}} else {Wrench{force_n:Vec2::new(mu*p*1.2,0.),torque_n_mm:0.}};
    let path=Path::new(vec![Leg::press(p,0.25),Leg::pull(w,1.0)]).unwrap();
    let mut minphi=1.0f64; let mut gross=None; let mut conv=true; let t0=std::time::Instant::now(); let mut n=0; let mut its=0; let mut maxits=0; let mut strain=0.0f64; let mut at=0.;
    for c in path.commands(s.substep_s){ let t=*f.step(&c).unwrap(); n+=1; its+=t.tangential_iterations_count; maxits=maxits.max(t.tangential_iterations_count); conv&=t.converged; if t.time_s<0.3{continue;} if t.at_border||t.stick_ratio.is_none(){at=t.time_s;break;} let phi=t.stick_ratio.unwrap(); if gross.is_none(){strain=strain.max(t.largest_strain_fraction);} if phi<minphi{minphi=phi;} if phi<0.01&&gross.is_none(){gross=Some(if tw{t.wrench.torque_n_mm}else{t.wrench.force_n.x/mu/p}); } if t.pose.position_mm.x>8.0||t.pose.turn_rad>1.0{at=t.time_s;break;} }
    println!("{name:7} P {p} mu {mu} {} min phi {minphi:.4} gross {gross:?} conv {conv} {:.2} ms/step its {:.1} max {maxits} strain {strain:.2} at {at:.3}", if tw{"twist"}else{"shear"}, t0.elapsed().as_secs_f64()*1e3/n as f64, its as f64/n as f64);
  }}}}
}
