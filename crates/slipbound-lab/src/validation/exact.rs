//! Closed-form solutions for an elastic half-space under a rigid sphere.
//! Hertz 1882; R. D. Mindlin 1949 and C. Cattaneo 1938; J. L. Lubkin 1951 and J. Jaeger for torsion.
//! Collected in K. L. Johnson, Contact Mechanics (1985), chapters 4 and 7.

use std::f64::consts::PI;

/// A rigid sphere pressed on an elastic half-space.
#[derive(Debug, Clone, Copy)]
pub struct SphereOnHalfSpace {
    pub modulus_mpa: f64,
    pub poisson: f64,
    pub radius_mm: f64,
    pub force_n: f64,
    pub mu: f64,
}

impl SphereOnHalfSpace {
    pub fn shear_modulus_mpa(&self) -> f64 {
        self.modulus_mpa / (2.0 * (1.0 + self.poisson))
    }

    /// a^3 = 3 P R / (4 E*)
    pub fn contact_radius_mm(&self) -> f64 {
        let plane_strain_mpa = self.modulus_mpa / (1.0 - self.poisson * self.poisson);
        libm::cbrt(3.0 * self.force_n * self.radius_mm / (4.0 * plane_strain_mpa))
    }

    /// a^2 / R
    pub fn depth_mm(&self) -> f64 {
        let a = self.contact_radius_mm();
        a * a / self.radius_mm
    }

    /// p0 = 3 P / (2 pi a^2)
    pub fn peak_pressure_mpa(&self) -> f64 {
        let a = self.contact_radius_mm();
        1.5 * self.force_n / (PI * a * a)
    }

    /// Tangential displacement at the load fraction f = Q / (mu P): 3 mu P (2 - nu) / (16 G a) [1 - (1 - f)^(2/3)]
    pub fn shift_mm(&self, load_fraction: f64) -> f64 {
        3.0 * self.mu * self.force_n * (2.0 - self.poisson)
            / (16.0 * self.shear_modulus_mpa() * self.contact_radius_mm())
            * (1.0 - libm::pow(1.0 - load_fraction, 2.0 / 3.0))
    }

    /// c / a = (1 - f)^(1/3)
    pub fn stick_radius_mm(&self, load_fraction: f64) -> f64 {
        self.contact_radius_mm() * libm::cbrt(1.0 - load_fraction)
    }

    /// Twist at which the stick radius is c: mu p0 / (2 G) [K(k') - E(k')], k'^2 = 1 - c^2/a^2
    pub fn twist_rad(&self, stick_fraction: f64) -> f64 {
        let (k, e) = elliptic((1.0 - stick_fraction * stick_fraction).sqrt());
        self.mu * self.peak_pressure_mpa() / (2.0 * self.shear_modulus_mpa()) * (k - e)
    }

    /// Torque at which the stick radius is c: (16/3) G int_c^a s^3 |d beta/ds| ds, where d beta/ds is
    /// mu p0 / (2 G) E(k'(s)) / s.
    pub fn torque_n_mm(&self, stick_fraction: f64) -> f64 {
        let integrand = |s: f64| s * s * elliptic((1.0 - s * s).max(0.0).sqrt()).1;
        let steps = 2000;
        let width = (1.0 - stick_fraction) / f64::from(steps);
        let simpson: f64 = (0..=steps)
            .map(|i| {
                let weight = if i == 0 || i == steps {
                    1.0
                } else if i % 2 == 1 {
                    4.0
                } else {
                    2.0
                };
                weight * integrand(stick_fraction + f64::from(i) * width)
            })
            .sum::<f64>()
            * width
            / 3.0;
        let a = self.contact_radius_mm();
        8.0 / 3.0 * self.mu * self.peak_pressure_mpa() * a * a * a * simpson
    }
}

/// Complete elliptic integrals K(k) and E(k) of the modulus k in 0..1, by the arithmetic-geometric mean.
pub fn elliptic(modulus: f64) -> (f64, f64) {
    let (mut a, mut b, mut c) = (1.0, (1.0 - modulus * modulus).sqrt(), modulus);
    let (mut sum, mut power) = (0.5 * c * c, 0.5);
    while c.abs() > 1e-16 {
        (a, b, c) = (0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b));
        power *= 2.0;
        sum += power * c * c;
    }
    let k = PI / (2.0 * a);
    (k, k * (1.0 - sum))
}

/// Force in N on a rigid sphere at depth d on an incompressible layer bonded to a rigid base:
/// P. D. Garcia and R. Garcia, Biophys. J. 114 (2018) 2923, with chi = sqrt(R d) / h; a series good to about 1 %
/// for chi up to 0.5.
pub fn sphere_on_layer_n(modulus_mpa: f64, radius_mm: f64, thickness_mm: f64, depth_mm: f64) -> f64 {
    let chi = (radius_mm * depth_mm).sqrt() / thickness_mm;
    let series = 1.0 + chi * (1.133 + chi * (1.497 + chi * (1.469 + chi * 0.755)));
    16.0 / 9.0 * modulus_mpa * radius_mm.sqrt() * libm::pow(depth_mm, 1.5) * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elliptic_integrals_at_known_moduli() {
        let (k, e) = elliptic(0.0);
        assert!((k - PI / 2.0).abs() < 1e-15 && (e - PI / 2.0).abs() < 1e-15);
        // A. Legendre's relation K E' + K' E - K K' = pi/2 ties all four together.
        let (k, e) = elliptic(0.6);
        let (kc, ec) = elliptic(0.8);
        assert!((k * ec + kc * e - k * kc - PI / 2.0).abs() < 1e-14);
    }

    #[test]
    fn torque_of_full_slip_is_the_moment_of_friction() {
        let sphere = SphereOnHalfSpace { modulus_mpa: 0.2, poisson: 0.48, radius_mm: 15.0, force_n: 3.0, mu: 0.8 };
        let most = 3.0 * PI / 16.0 * sphere.mu * sphere.force_n * sphere.contact_radius_mm();
        assert!((sphere.torque_n_mm(0.0) / most - 1.0).abs() < 1e-6);
    }
}
