//! From an essential matrix to rotations and translation, over the real and the complex numbers.
//!
//! With `E = s [t]× R` and `t·t = 1`
//!
//! ```text
//! cof E = s² t (Rᵀ t)ᵀ        s² R = cof E − s [t]× E        E·E = Σ E_ij² = 2 s²
//! ```
//!
//! where no product is conjugated, so that the formulas hold for complex matrices as well. The other rotation is `t ⊗ q`.

use nalgebra::ComplexField;

use crate::algebra::number::{ComplexNumber, Number, cross};

type Vector<T> = [T; 3];

/// The quaternion of one of the two rotations, scalar first and of any scale, and the translation with `t·t = 1`, of an
/// essential matrix of any scale, row by row.
///
/// `None` for a matrix that is zero or not finite.
#[inline]
pub(crate) fn decompose<T: Number + ComplexField>(e: &[Vector<T>; 3]) -> Option<([T; 4], Vector<T>)> {
    let (q, t) = decomposed(e);
    q.iter().all(ComplexField::is_finite).then_some((q, t))
}

/// The same, not finite for a matrix that is zero or not finite.
#[inline]
pub(crate) fn decomposed<T: Number>(e: &[Vector<T>; 3]) -> ([T; 4], Vector<T>) {
    let entries: [T; 9] = std::array::from_fn(|k| e[k / 3][k % 3]);
    let found = decomposed_in_range(&entries);
    // The formulas take fourth powers.
    if T::is_in_range(&found.0) { found } else { decomposed_in_range(&T::of_order_one(entries)) }
}

/// The same of a matrix, row by row, of an ordinary scale.
#[inline]
fn decomposed_in_range<T: Number>(e: &[T; 9]) -> ([T; 4], Vector<T>) {
    let mut sum = T::real(0.0);
    for x in e {
        sum = sum + *x * *x;
    }
    let square = sum.times(0.5);
    let scale = square.square_root();
    let columns: [Vector<T>; 3] = std::array::from_fn(|j| std::array::from_fn(|i| e[3 * i + j]));
    let cofactors: [Vector<T>; 3] =
        std::array::from_fn(|j| cross(&columns[(j + 1) % 3], &columns[(j + 2) % 3]));
    let longest = T::longer(&T::longer(&cofactors[0], &cofactors[1]), &cofactors[2]);
    let length = (longest[0] * longest[0] + longest[1] * longest[1] + longest[2] * longest[2]).square_root();
    let inverse = T::real(1.0) / length;
    let t = longest.map(|x| x * inverse);
    let scaled = t.map(|x| x * scale);
    let r: [Vector<T>; 3] = std::array::from_fn(|j| {
        let turned = cross(&scaled, &columns[j]);
        std::array::from_fn(|i| cofactors[j][i] - turned[i])
    });
    (quaternion(&r, square), t)
}

/// The quaternion, of any scale, of a multiple of an orthogonal matrix given by its columns: the longest row of `4 q qᵀ`.
#[inline]
fn quaternion<T: Number>(columns: &[Vector<T>; 3], one: T) -> [T; 4] {
    let [[xx, yx, zx], [xy, yy, zy], [xz, yz, zz]] = *columns;
    let (wx, wy, wz) = (zy - yz, xz - zx, yx - xy);
    let (sxy, sxz, syz) = (yx + xy, zx + xz, zy + yz);
    let rows = [
        [one + xx + yy + zz, wx, wy, wz],
        [wx, one + xx - yy - zz, sxy, sxz],
        [wy, sxy, one - xx + yy - zz, syz],
        [wz, sxz, syz, one - xx - yy + zz],
    ];
    T::longer(&T::longer(&rows[0], &rows[1]), &T::longer(&rows[2], &rows[3]))
}

/// The quaternion of the other rotation: `t ⊗ q`, with `t` a pure quaternion.
#[inline]
pub(crate) fn twisted<T: Number>(q: &[T; 4], t: &Vector<T>) -> [T; 4] {
    let v = [q[1], q[2], q[3]];
    let turned = cross(t, &v);
    let scalar = T::real(0.0) - (t[0] * v[0] + t[1] * v[1] + t[2] * v[2]);
    [scalar, q[0] * t[0] + turned[0], q[0] * t[1] + turned[1], q[0] * t[2] + turned[2]]
}

/// The real part of a complex quaternion, scaled by the phase that leaves the most of it.
///
/// `q·q` without conjugation turns by twice the phase, so that the choice does not depend on the frames of the
/// cameras, unlike the one that makes the largest component real.
#[inline]
pub(crate) fn real_part<T: ComplexNumber>(q: [T; 4]) -> [T::Part; 4] {
    let [w, x, y, z] = q.map(|x| x * x);
    let phase = ((w + x) + (y + z)).square_root().conjugate();
    q.map(|x| (x * phase).re())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Complex, Quaternion, UnitQuaternion, Vector3};

    fn planted(rotation: Vector3<f64>, t: Vector3<f64>) -> (UnitQuaternion<f64>, [[f64; 3]; 3]) {
        let q = UnitQuaternion::new(rotation);
        let e = t.cross_matrix() * q.to_rotation_matrix().into_inner();
        (q, std::array::from_fn(|i| std::array::from_fn(|j| e[(i, j)])))
    }

    #[test]
    fn both_rotations_and_the_translation_are_recovered() {
        let pi = std::f64::consts::PI;
        let t = Vector3::new(0.6, -0.3, 1.7);
        let axis = Vector3::new(0.48, -0.6, 0.64);
        for angle in [0.0, 1e-9, 1.0, pi - 1e-9, pi] {
            let (q, e) = planted(axis * angle, t);
            let (found, direction) = decompose(&e).unwrap();
            let other = twisted(&found, &direction);
            let cosine = |f: [f64; 4]| {
                UnitQuaternion::new_normalize(Quaternion::new(f[0], f[1], f[2], f[3]))
                    .coords
                    .dot(&q.coords)
                    .abs()
            };
            assert!(1.0 - cosine(found).max(cosine(other)) < 1e-15);
            assert!(Vector3::from(direction).cross(&t).norm() < 1e-15);
            let complex = decompose(&e.map(|row| row.map(|x| Complex::new(x, 0.0) * Complex::i()))).unwrap();
            let real = real_part(complex.0);
            let twin = real_part(twisted(&complex.0, &complex.1));
            assert!(1.0 - cosine(real).max(cosine(twin)) < 1e-15);
        }
    }

    #[test]
    fn matrices_without_a_pose_have_none() {
        assert!(decompose(&[[0.0; 3]; 3]).is_none());
        assert!(decompose(&[[f64::NAN; 3]; 3]).is_none());
    }

    #[test]
    fn real_part_forgets_the_phase_and_nothing_else() {
        let q = [0.1, -0.7, 0.5, 0.3];
        for angle in [0.0, 0.4, 2.0, 3.0] {
            let turned = q.map(|x| Complex::from_polar(x, angle));
            let real = real_part(turned);
            let sign = real[1].signum() * q[1].signum();
            let length = real.iter().map(|x| x * x).sum::<f64>().sqrt();
            let expected = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            assert!((0..4).all(|k| (sign * real[k] / length - q[k] / expected).abs() < 1e-15));
        }
    }
}
