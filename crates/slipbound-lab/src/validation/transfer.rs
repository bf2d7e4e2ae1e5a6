//! An independent solution of the layer: its differential equations through the thickness, integrated by matrix
//! exponentials of thin slices, from the bonded base up.

use super::row::Row;
use crate::layer::{Compliance, layer_compliance};

type Square = [[f64; 4]; 4];
type Block = [[f64; 2]; 2];

/// Slices are at most this thick, in units of 1/k.
const SLICE: f64 = 0.25;

/// Compliance of a bonded layer from the state (U, w, tau, sigma), ds/dz = M s, in units G = k = 1.
pub fn layer_by_slices(poisson: f64, flatness: f64) -> Compliance {
    let nu = poisson;
    let r = 1.0 / (1.0 - nu);
    let rate = [
        [0.0, 1.0, 1.0, 0.0],
        [-nu * r, 0.0, 0.0, 0.5 * (1.0 - 2.0 * nu) * r],
        [2.0 * r, 0.0, 0.0, nu * r],
        [0.0, 0.0, -1.0, 0.0],
    ];
    let slices = (flatness / SLICE).ceil().max(1.0);
    let slice = exponential(&rate, flatness / slices);
    // u = Z s at the lower face of a slice gives (Phi_uu - Z Phi_su) u = (Z Phi_ss - Phi_us) s at its upper face.
    let block = |i: usize, j: usize| [[slice[i][j], slice[i][j + 1]], [slice[i + 1][j], slice[i + 1][j + 1]]];
    let (uu, us, su, ss) = (block(0, 0), block(0, 2), block(2, 0), block(2, 2));
    let mut z: Block = [[0.0; 2]; 2];
    // Out of the plane: du/dz = tau, dtau/dz = u.
    let (c, s) = (libm::cosh(flatness / slices), libm::sinh(flatness / slices));
    let mut across = 0.0;
    for _ in 0..slices as u64 {
        z = product(&inverse(&less(&uu, &product(&z, &su))), &less(&product(&z, &ss), &us));
        across = (across * c - s) / (c - across * s);
    }
    Compliance {
        along_mm_per_mpa: -z[0][0],
        across_mm_per_mpa: -across,
        normal_mm_per_mpa: -z[1][1],
        coupling_mm_per_mpa: -z[0][1],
    }
}

fn exponential(rate: &Square, length: f64) -> Square {
    let mut term: Square = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let mut sum = term;
    for n in 1..24 {
        term = std::array::from_fn(|i| {
            std::array::from_fn(|j| (0..4).map(|m| term[i][m] * rate[m][j]).sum::<f64>() * length / f64::from(n))
        });
        for (sum, term) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
            *sum += term;
        }
    }
    sum
}

fn product(a: &Block, b: &Block) -> Block {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

fn less(a: &Block, b: &Block) -> Block {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] - b[i][j]))
}

fn inverse(m: &Block) -> Block {
    let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    [[m[1][1] / det, -m[0][1] / det], [-m[1][0] / det, m[0][0] / det]]
}

/// Closed forms against slices, over Poisson's ratio and H = k h from 1e-4 to 60; errors relative to A_l.
pub fn compliance() -> Vec<Row> {
    [0.0, 0.25, 0.45, 0.485, 0.499, 0.5]
        .into_iter()
        .map(|nu| {
            let mut worst = 0.0f64;
            for step in 0..=120 {
                let flatness = 1e-4 * libm::pow(6e5, f64::from(step) / 120.0);
                let closed = layer_compliance(1.0, nu, flatness, 1.0);
                let sliced = layer_by_slices(nu, flatness);
                for (a, b) in [
                    (closed.along_mm_per_mpa, sliced.along_mm_per_mpa),
                    (closed.across_mm_per_mpa, sliced.across_mm_per_mpa),
                    (closed.normal_mm_per_mpa, sliced.normal_mm_per_mpa),
                    (closed.coupling_mm_per_mpa, sliced.coupling_mm_per_mpa),
                ] {
                    worst = worst.max((a - b).abs() / closed.along_mm_per_mpa);
                }
            }
            Row::deviation(format!("layer compliances against thin slices, nu {nu}, kh 1e-4 to 60"), worst, 1e-9)
        })
        .collect()
}
