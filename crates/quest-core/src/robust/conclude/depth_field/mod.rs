//! The pose of a camera that hardly moves, by the likelihood of all matches with the depths of the points integrated out.
//!
//! An essential matrix gives every point a depth of its own. Where the parallax is about the noise, what that finds is far from
//! linear in the noise, and its first-order covariance is too small (J. Neyman, E. L. Scott, *Consistent estimates based on
//! partially consistent observations*, Econometrica 1948). Here the inverse depths are a smooth function of the image and a
//! spread around that:
//!
//! ```text
//! ρ = 1 + Σj cj φj(x) + s ξ,   cj ~ N(0, gj²),   ξ ~ N(0, 1)
//! ```
//!
//! The unit of length is the mean inverse depth, `φj` are polynomials up to the fourth degree and `s` is estimated. The displacement
//! of a match then has the mean `−ρ̄ b` and the variance `k² σ² I + s² b bᵀ`, with `b` the displacement by a unit of inverse depth
//! and `k` one of the widths of the noise ([`evidence`](crate::robust::conclude::evidence) has the densities of near points and
//! of false matches beside it). The model is regular where there is no translation. Where the parallax is well above the noise
//! `s |b|` is as well, what lies along the epipolar line counts for nothing, and what is left are the equations of an essential
//! matrix.
//!
//! Each round holds the variances, takes the expected share of each explanation of each match, and makes a Gauss–Newton step of
//! the rotation, the translation and the field together.

mod field;
mod fit;
mod mean_depth;
#[cfg(test)]
mod planted;
mod sums;

pub(crate) use field::{DepthField, Terms, terms};
pub(crate) use fit::Fit;
pub(crate) use mean_depth::Mode;
