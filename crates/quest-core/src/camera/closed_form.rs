//! Radial distortions of the plane `z = 1` whose inverse has a closed form.

use super::MAX_IMAGE_COORDINATE;

/// The distorted radius `rd` as a function of the radius `r` on the plane. Each grows with `r` as far as its domain goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ClosedForm {
    /// `rd = atan(2 r tan(ω/2)) / ω`.
    Fov {
        /// The field of view in radians, zero or a normal number below π.
        omega: f64,
    },
    /// `r = rd / (1 + k rd²)`.
    Division {
        /// The coefficient.
        k: f64,
    },
    /// `rd = r / (α √(β r² + 1) + 1 - α)`.
    Eucm {
        /// From 0 to 1.
        alpha: f64,
        /// Positive.
        beta: f64,
    },
}

impl ClosedForm {
    /// The largest radius on the plane.
    pub(super) fn max_radius(self) -> f64 {
        match self {
            // rd / (1 + k rd²) grows up to rd = 1 / √k.
            Self::Division { k } if k > 0.0 => (0.5 / k.sqrt()).min(MAX_IMAGE_COORDINATE),
            _ => MAX_IMAGE_COORDINATE,
        }
    }

    /// The distorted radius of the largest one.
    pub(super) fn max_distorted(self) -> f64 {
        self.distorted(self.max_radius())
    }

    /// The distorted radius of a radius on the plane, up to the largest one.
    pub(super) fn distorted(self, r: f64) -> f64 {
        match self {
            Self::Fov { omega: 0.0 } => r,
            Self::Fov { omega } => (2.0 * r * (0.5 * omega).tan()).atan() / omega,
            // The smaller root of k r rd² - rd + r = 0. Rounding may leave less than zero under the root at the border.
            Self::Division { k } => 2.0 * r / (1.0 + (1.0 - 4.0 * k * r * r).max(0.0).sqrt()),
            Self::Eucm { alpha, beta } => r / (alpha * (beta * r * r + 1.0).sqrt() + 1.0 - alpha),
        }
    }

    /// The radius on the plane of a distorted one, `None` beyond the largest.
    pub(super) fn undistorted(self, rd: f64) -> Option<f64> {
        if rd > self.max_distorted() {
            return None;
        }
        let (numerator, denominator) = match self {
            Self::Fov { omega: 0.0 } => (rd, 1.0),
            Self::Fov { omega } => ((rd * omega).tan(), 2.0 * (0.5 * omega).tan()),
            Self::Division { k } => (rd, 1.0 + k * rd * rd),
            Self::Eucm { alpha, beta } => {
                let square = beta * rd * rd;
                let root = (1.0 - (2.0 * alpha - 1.0) * square).max(0.0).sqrt();
                (rd * (alpha * root + 1.0 - alpha), 1.0 - alpha * alpha * square)
            }
        };
        // Rounding may make a quotient infinite or negative that is as large as the domain.
        let limit = self.max_radius();
        let is_inside = numerator >= 0.0 && denominator > 0.0 && numerator < limit * denominator;
        Some(if is_inside { numerator / denominator } else { limit })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_radius_comes_back_and_none_beyond_it() {
        let fov = [0.0, 0.3, 0.93, 2.0, 3.1].map(|omega| ClosedForm::Fov { omega });
        let division = [-2.0, -0.25, -1e-9, 0.0, 0.1, 3.0].map(|k| ClosedForm::Division { k });
        let eucm = [(0.0, 1.0), (0.5, 0.1), (0.6, 1.1), (0.9, 2.0), (1.0, 1.0), (1.0, 7.0)]
            .map(|(alpha, beta)| ClosedForm::Eucm { alpha, beta });
        for form in fov.into_iter().chain(division).chain(eucm) {
            let (r, rd) = (form.max_radius(), form.max_distorted());
            assert!(r > 0.0 && rd.is_finite(), "{form:?}");
            let back = form.undistorted(rd).unwrap();
            // At the border a rounding of the distorted radius may be most of the radius.
            assert!(back <= r && form.distorted(back) >= rd * (1.0 - 1e-15), "{form:?}: {back} of {r}");
            assert_eq!(form.undistorted(rd * (1.0 + 1e-9)), None, "{form:?}");
        }
    }
}
