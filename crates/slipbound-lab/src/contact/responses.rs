//! One response at several sizes: a small contact is solved on small transforms. Responses of a gel are cached: every
//! trial needs the same few, and computing them takes longer than a second of contact.

use super::grid::{Grid, Region, smooth_even_at_least};
use super::response::Response;
use crate::layer::{Compliance, Gel, SoftObject};
use std::sync::{Mutex, PoisonError};

/// Cached gels. Trials of an evaluation have at most a handful: the gel alone, and with each soft object.
const KEPT_COUNT: usize = 8;

/// Materials of the surfaces in contact, and how they are computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Material {
    pub grid: Grid,
    pub gel: Gel,
    /// Factor by which creep increases the gel's compliance within a step; 1 without creep.
    pub compliance_factor: f64,
    pub soft_object: Option<SoftObject>,
}

impl Material {
    /// Compliance of gel and object together.
    fn compliance(&self, k_rad_per_mm: f64) -> Compliance {
        let gel = self.gel.compliance(k_rad_per_mm);
        let object = self.soft_object.map_or(Compliance::default(), |object| object.compliance(k_rad_per_mm));
        Compliance {
            along_mm_per_mpa: self.compliance_factor * gel.along_mm_per_mpa + object.along_mm_per_mpa,
            across_mm_per_mpa: self.compliance_factor * gel.across_mm_per_mpa + object.across_mm_per_mpa,
            normal_mm_per_mpa: self.compliance_factor * gel.normal_mm_per_mpa + object.normal_mm_per_mpa,
            coupling_mm_per_mpa: self.compliance_factor * gel.coupling_mm_per_mpa + object.coupling_mm_per_mpa,
        }
    }
}

/// The response of a material on windows of every size.
#[derive(Debug, Clone)]
pub(super) struct Responses {
    /// In order of increasing cost; the last one fits the whole grid.
    sizes: Vec<Response>,
}

/// The most recent ones, the latest at the end.
static KEPT: Mutex<Vec<(Material, Responses)>> = Mutex::new(Vec::new());

impl Responses {
    /// The response of a material: a copy of the cached one, or computed here, outside the lock.
    pub fn of(material: &Material) -> Self {
        let kept = || KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, found)) = kept().iter().find(|(known, _)| known == material) {
            return found.clone();
        }
        let whole = Response::of_layer(&material.grid, |k| material.compliance(k));
        let made = Self::new(whole);
        let mut kept = kept();
        if kept.len() == KEPT_COUNT {
            kept.remove(0);
        }
        kept.push((*material, made.clone()));
        made
    }

    /// The response and its truncations to 1/8, 1/4, ... of the padded size.
    fn new(whole: Response) -> Self {
        let steps = |n: usize| [n / 8, n * 3 / 16, n / 4, n * 3 / 8, n / 2];
        let in_space = whole.in_space();
        let mut sizes = Vec::new();
        for w in steps(whole.transform.nx) {
            for h in steps(whole.transform.ny) {
                let (w, h) = (w.min(whole.most_width), h.min(whole.most_height));
                let points = smooth_even_at_least(2 * w) * smooth_even_at_least(2 * h);
                if w >= 4 && h >= 4 && points * 10 <= whole.points_count() * 9 {
                    sizes.push(in_space.cut_to([w, h]));
                }
            }
        }
        sizes.push(whole);
        sizes.sort_by_key(Response::points_count);
        Responses { sizes }
    }

    /// The cheapest response on which the window fits.
    pub fn for_window(&mut self, window: Region) -> &mut Response {
        let last = self.sizes.len() - 1;
        let fit = self.sizes.iter().position(|r| r.fits(window)).unwrap_or(last);
        &mut self.sizes[fit]
    }

    /// The response of the whole grid.
    pub fn whole(&mut self) -> &mut Response {
        self.sizes.last_mut().expect("the whole grid is always there")
    }
}
