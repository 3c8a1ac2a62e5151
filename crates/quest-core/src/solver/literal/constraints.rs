//! The quartics (39) of any number of matches, at a cost that does not grow with their number.
//!
//! The quartics of all triples of `N` matches are `N choose 3`. Their squares, summed, depend on `Σ y yᵀ` alone, with the nine
//! products `y` of the bearings of a match, as a sum of squares of minors does by the formula of Cauchy and Binet. So for more
//! than nine matches the rows of the triangular factor of the `y` stand for all of them: 84 triples, and the same
//! least squares.

use nalgebra::{Matrix3, Matrix4};

use super::buffers::{Factored, Matrix, zeros};
use crate::Correspondence;
use crate::quaternion::monomials::Quartic;
use crate::quaternion::{bilinear, minor_with_q};

/// The matches that stand for any number of them.
const MOST: usize = 9;

/// How many matches the triangular factor takes in at once.
const CHUNK: usize = 64;

/// `M_i` of (39) for each match, or for the nine that stand for more of them.
#[derive(Default)]
pub(super) struct Constraints {
    stacked: Matrix,
    factored: Factored,
}

impl Constraints {
    /// The quartics. Those of single matches have norm 1 each; of the nine that stand for more they keep the weights that make the
    /// sum of their squares that of all.
    pub(super) fn quartics(&mut self, matches: &[Correspondence], out: &mut Vec<Quartic>) {
        let (matrices, count) = self.matrices(matches);
        quartics(&matrices[..count], out);
        normalize(out, matches.len() == count);
    }

    /// The matrices and how many there are.
    fn matrices(&mut self, matches: &[Correspondence]) -> ([Matrix4<f64>; MOST], usize) {
        let product = |m: &Correspondence| m.bearing2() * m.bearing1().transpose();
        let mut out = [Matrix4::zeros(); MOST];
        if matches.len() <= MOST {
            for (place, m) in out.iter_mut().zip(matches) {
                *place = bilinear(&product(m));
            }
            return (out, matches.len());
        }
        let mut triangle = [[0.0; MOST]; MOST];
        for chunk in matches.chunks(CHUNK) {
            zeros(&mut self.stacked, MOST + CHUNK, MOST);
            for (i, row) in triangle.iter().enumerate() {
                for j in i..MOST {
                    self.stacked[(i, j)] = row[j];
                }
            }
            for (i, m) in chunk.iter().enumerate() {
                for (j, x) in product(m).iter().enumerate() {
                    self.stacked[(MOST + i, j)] = *x;
                }
            }
            self.factored.factor(&mut self.stacked);
            for (i, row) in triangle.iter_mut().enumerate() {
                for j in i..MOST {
                    row[j] = self.stacked[(i, j)];
                }
            }
        }
        for (place, row) in out.iter_mut().zip(&triangle) {
            *place = bilinear(&Matrix3::from_column_slice(row));
        }
        (out, MOST)
    }
}

/// The quartics of all triples of some matrices.
fn quartics(matrices: &[Matrix4<f64>], out: &mut Vec<Quartic>) {
    out.clear();
    let n = matrices.len();
    for i in 0..n {
        for j in i + 1..n {
            for k in j + 1..n {
                out.push(minor_with_q([&matrices[i], &matrices[j], &matrices[k]]));
            }
        }
    }
}

/// Scales quartics to norm 1, each or all by one factor.
fn normalize(quartics: &mut [Quartic], each: bool) {
    let norm = |quartic: &Quartic| quartic.iter().map(|c| c * c).sum::<f64>().sqrt();
    let common = quartics.iter().map(norm).fold(f64::MIN_POSITIVE, f64::max);
    for quartic in quartics {
        let scale = if each { norm(quartic).max(f64::MIN_POSITIVE) } else { common };
        *quartic = quartic.map(|c| c / scale);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Scene, SceneOptions};

    #[test]
    fn nine_stand_for_all() {
        let options = SceneOptions { points: 12, noise_px: 2.0, ..SceneOptions::default() };
        let scene = Scene::generate(&options, 432, 0).unwrap();
        let all = scene.matches.iter().map(|m| bilinear(&(m.bearing2() * m.bearing1().transpose())));
        let all: Vec<_> = all.collect();
        let (nine, count) = Constraints::default().matrices(&scene.matches);
        assert_eq!(count, 9);
        let mut squares = vec![[[0.0; 35]; 35]; 2];
        let mut add = |to: usize, quartic: &Quartic| {
            for i in 0..35 {
                for j in 0..35 {
                    squares[to][i][j] += quartic[i] * quartic[j];
                }
            }
        };
        for i in 0..12 {
            for j in i + 1..12 {
                for k in j + 1..12 {
                    add(0, &minor_with_q([&all[i], &all[j], &all[k]]));
                }
            }
        }
        let mut of_nine = Vec::new();
        quartics(&nine, &mut of_nine);
        assert_eq!(of_nine.len(), 84);
        for quartic in &of_nine {
            add(1, quartic);
        }
        let largest = squares[0].iter().flatten().fold(0.0_f64, |a, b| a.max(b.abs()));
        for (a, b) in squares[0].iter().flatten().zip(squares[1].iter().flatten()) {
            assert!((a - b).abs() < 1e-12 * largest);
        }
    }
}
