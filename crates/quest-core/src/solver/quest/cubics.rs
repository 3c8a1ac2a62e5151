//! The five-point problem as ten cubics that survive a vanishing parallax.
//!
//! Five rows of [`Alignment`](crate::solver::shared::parallax_frame::Alignment) leave `(t, S) = x N1 + y N2 + z N3 + w N4`. With `K = [t]×`,
//! `E = K + p S` and `−K² = |t|² I − t tᵀ`,
//!
//! ```text
//! E Eᵀ              = |t|² I − t tᵀ + p (K S − S K) + p² S²
//! 2 E Eᵀ − tr(E Eᵀ) I = −2 t tᵀ + p Λ,      Λ = 2 (K S − S K) + p (2 S² − tr(S²) I)
//! ```
//!
//! and as `tᵀ K = 0`, every term of the trace constraint `(2 E Eᵀ − tr(E Eᵀ) I) E = 0` carries the factor `p`. Divided by it:
//!
//! ```text
//! C = −2 t tᵀ S + Λ E = C0 + p C1 + p² C2 = 0
//! C0 = 2 K S K − 2 S K² − 2 t tᵀ S      C1 = 2 (K S² + S² K) − tr(S²) K − 2 S K S      C2 = (2 S² − tr(S²) I) S
//! ```
//!
//! For a symmetric matrix `S` with `h = tr S` and adjugate `adj S`
//!
//! ```text
//! K S K = −S t tᵀ − t tᵀ S + (tᵀ S t) I + h t tᵀ − |t|² (h I − S)
//! K S + S K = [(h I − S) t]×            S K S = [adj(S) t]×
//! S² = adj S + h S − ½ (h² − tr S²) I   (Cayley, Hamilton)
//! ```
//!
//! so that `C0` and `C2` are symmetric, and `C1` is antisymmetric. With `Z = h I − 2 S`, of the trace `h`, and `A = adj Z`
//!
//! ```text
//! C1 = [c]×,  c = (2 tr(S²) I − h² I − 4 S² + 2 h S) t = −A t
//! C0 / 2 = (Z t) tᵀ + t (Z t)ᵀ − |t|² Z − h t tᵀ + (tᵀ S t) I
//! C2 / 2 = ¼ h (A − tr(A) I) + ⅛ h tr(A) I − ⅛ det(Z) I
//! ```
//!
//! and the antisymmetric part can be divided by `p` once more. The determinant is
//!
//! ```text
//! det E = p tᵀ S t + p³ det S
//! tr C + 2 det(E) / p = −p² det Z
//! ```
//!
//! so that the constraints are together
//!
//! ```text
//! (Z t) tᵀ + t (Z t)ᵀ − |t|² Z − h t tᵀ + ¼ p² h (A − tr(A) I) = 0        six cubics
//! A t = 0                                                                three
//! det Z = 0                                                              one
//! ```
//!
//! In the six the multiples of `I` are left out: they vanish with `det Z` and the trace of what stays,
//! `2 tᵀ Z t − 2 h |t|² − ½ p² h tr A = −4 (tᵀ S t + ⅛ p² h tr A)`. As `p → 0` the ten become the equations of the
//! differential five-point problem, and nothing degenerates.
//!
//! `resultant.rs` reduces them to a polynomial in `z`.

use crate::algebra::number::Number;
use crate::algebra::vectors::two::Two;
use crate::solver::shared::forms::{
    Cubic, Cubics, Linears, Quadratics, crossed, first, firsts, negative, quadratics, second, seconds,
    swapped,
};
use crate::solver::shared::parallax_frame::Coordinates;

/// Entries of `t` and of `Z`, two by two; what has one name stands on both lanes.
struct Forms {
    t_x: Linears,
    t_yz: Linears,
    t_yx: Linears,
    t_zx: Linears,
    trace: Linears,
    z_xx: Linears,
    z_yz: Linears,
    z_yy_zz: Linears,
    z_xy_xz: Linears,
}

impl Forms {
    #[inline]
    fn new(basis: &[Coordinates; 4]) -> Self {
        // Two coordinates at a time as the null space wrote them: what reads across two writes waits for both.
        let pair =
            |k: usize| -> Linears { std::array::from_fn(|m| Two::new([basis[m][k], basis[m][k + 1]])) };
        let (t_xy, t_z_xx, yy_zz) = (pair(0), pair(2), pair(4));
        let (t_x, t_yz, xx) = (first(&t_xy), crossed(&t_xy, &t_z_xx), second(&t_z_xx));
        let (yy, zz) = (first(&yy_zz), second(&yy_zz));
        let trace: Linears = std::array::from_fn(|m| xx[m] + yy[m] + zz[m]);
        let less = |x: Linears| -> Linears { std::array::from_fn(|m| trace[m] - x[m] * 2.0) };
        Self {
            t_x,
            t_yz,
            t_yx: firsts(&t_yz, &t_x),
            t_zx: crossed(&t_yz, &t_x),
            trace,
            z_xx: less(xx),
            z_yz: std::array::from_fn(|m| Two::splat(basis[m][8] * -2.0)),
            z_yy_zz: less(yy_zz),
            z_xy_xz: pair(6).map(|x| x * -2.0),
        }
    }

    /// `Z t` at `y, z`, and at `x` beside `−|t|²`.
    #[inline]
    fn turned(&self) -> [Quadratics; 2] {
        let Self { t_x, t_yz, z_xx, z_yz, z_yy_zz, z_xy_xz, .. } = self;
        let (minus_x, minus_yz) = (negative(t_x), negative(t_yz));
        [
            quadratics([(z_xy_xz, t_x), (z_yy_zz, t_yz), (z_yz, &swapped(t_yz))]),
            quadratics([
                (&firsts(z_xx, &minus_x), t_x),
                (&firsts(z_xy_xz, &minus_yz), &first(t_yz)),
                (&seconds(z_xy_xz, &minus_yz), &second(t_yz)),
            ]),
        ]
    }

    /// `A = adj Z` at `xy, xz`, at `yy, zz`, and at `yz, xx`.
    #[inline]
    fn adjugate(&self) -> [Quadratics; 3] {
        let Self { z_xx, z_yz, z_yy_zz, z_xy_xz, .. } = self;
        let (z_xz_xy, z_zz_yy) = (swapped(z_xy_xz), swapped(z_yy_zz));
        [
            quadratics([(&z_xz_xy, z_yz), (&negative(z_xy_xz), &z_zz_yy)]),
            quadratics([(z_xx, &z_zz_yy), (&negative(&z_xz_xy), &z_xz_xy)]),
            quadratics([
                (&firsts(z_xy_xz, z_yy_zz), &seconds(z_xy_xz, z_yy_zz)),
                (&negative(z_yz), &firsts(z_xx, z_yz)),
            ]),
        ]
    }

    /// `B = t tᵀ + p² / 4 (tr(A) I − A)`, in the places of `A`.
    #[inline]
    fn beside_trace(&self, [a_xy_xz, a_yy_zz, a_yz_xx]: &[Quadratics; 3], p: f64) -> [Quadratics; 3] {
        let Self { t_x, t_yz, t_yx, t_zx, .. } = self;
        let quarter = 0.25 * p * p;
        let mut b = [quadratics([(t_x, t_yz)]), quadratics([(t_yz, t_yz)]), quadratics([(t_yx, t_zx)])];
        let (a_zz_yy, a_xx) = (swapped(a_yy_zz), second(a_yz_xx));
        for k in 0..10 {
            let [minus_yz_and_rest, _] = Two::transpose([-a_yz_xx[k], a_yy_zz[k] + a_zz_yy[k]]);
            b[0][k] -= a_xy_xz[k] * quarter;
            b[1][k] += (a_xx[k] + a_zz_yy[k]) * quarter;
            b[2][k] += minus_yz_and_rest * quarter;
        }
        b
    }
}

/// The ten divided cubics over [`CUBIC`](crate::solver::shared::forms::CUBIC): the six at `xy, xz, yy, zz, yz, xx`, those of `A t` at `y, z, x`,
/// and `det Z`.
pub(crate) fn ten_cubics(basis: &[Coordinates; 4], p: f64) -> [Cubic; 10] {
    let forms = Forms::new(basis);
    let Forms { t_x, t_yz, t_yx, t_zx, trace, z_xx, z_yz, z_yy_zz, z_xy_xz } = &forms;
    let [zt_yz, zt_x_square] = &forms.turned();
    let adjugate = &forms.adjugate();
    let [b_xy_xz, b_yy_zz, b_yz_xx] = &forms.beside_trace(adjugate, p);
    let (zt_x, minus_square, minus_trace) = (&first(zt_x_square), &second(zt_x_square), &negative(trace));
    let mut out = Cubics::new();
    // (Z t) tᵀ + t (Z t)ᵀ − |t|² Z − tr(Z) B.
    out.set(0, [(zt_x, t_yz), (zt_yz, t_x), (minus_square, z_xy_xz), (b_xy_xz, minus_trace)]);
    out.set(1, [(zt_yz, &t_yz.map(|t| t + t)), (minus_square, z_yy_zz), (b_yy_zz, minus_trace)]);
    let (zt_yx, zt_zx, z_yz_xx) = (firsts(zt_yz, zt_x), crossed(zt_yz, zt_x), firsts(z_yz, z_xx));
    out.set(2, [(&zt_yx, t_zx), (&zt_zx, t_yx), (minus_square, &z_yz_xx), (b_yz_xx, minus_trace)]);
    // A t, and det Z by the first row.
    let [a_xy_xz, a_yy_zz, a_yz_xx] = adjugate;
    out.set(3, [(a_xy_xz, t_x), (a_yy_zz, t_yz), (&first(a_yz_xx), &swapped(t_yz))]);
    let (x, y, z) = (firsts(t_x, z_xx), firsts(t_yz, z_xy_xz), seconds(t_yz, z_xy_xz));
    out.set(4, [(&second(a_yz_xx), &x), (&first(a_xy_xz), &y), (&second(a_xy_xz), &z)]);
    out.rows
}

/// `x N1 + y N2 + z N3 + w N4`.
#[inline]
pub(crate) fn combine<T: Number>(basis: &[Coordinates; 4], point: &[T; 4]) -> [T; 9] {
    std::array::from_fn(|k| {
        (1..4).fold(point[0].times(basis[0][k]), |sum, m| sum + point[m].times(basis[m][k]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::monomials::evaluate;
    use crate::solver::shared::forms::CUBIC;
    use nalgebra::Matrix3;

    #[test]
    fn cubics_are_the_trace_constraint_divided_by_p() {
        let basis: [Coordinates; 4] =
            std::array::from_fn(|m| std::array::from_fn(|k| ((3 * m + 7 * k) as f64 * 1.3 + 0.2).sin()));
        let v = [0.3, -0.8, 0.5, 1.0];
        let p = 0.37;
        let [tx, ty, tz, xx, yy, zz, xy, xz, yz] = combine(&basis, &v);
        let t = nalgebra::Vector3::new(tx, ty, tz);
        let s = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let e = t.cross_matrix() + s * p;
        let eet = e * e.transpose();
        let c = (eet * 2.0 - Matrix3::from_diagonal_element(eet.trace())) * e / p;
        let [six_xy, six_xz, six_yy, six_zz, six_yz, six_xx, at_y, at_z, at_x, det] =
            ten_cubics(&basis, p).map(|cubic| evaluate(&CUBIC, &cubic, v));
        let six = Matrix3::new(six_xx, six_xy, six_xz, six_xy, six_yy, six_yz, six_xz, six_yz, six_zz);
        let antisymmetric = nalgebra::Vector3::new(at_x, at_y, at_z).cross_matrix() * -p;
        // C / 2 = six + (tᵀ S t + p² (h tr A − det Z) / 8) I, and tr(six) = −4 tᵀ S t − p² h tr A / 2.
        let multiple = -six.trace() / 4.0 - p * p * det / 8.0;
        let symmetric = (six + Matrix3::from_diagonal_element(multiple)) * 2.0;
        assert!((symmetric + antisymmetric - c).amax() < 1e-13);
        assert!((c.trace() + 2.0 * e.determinant() / p + p * p * det).abs() < 1e-13);
    }
}
