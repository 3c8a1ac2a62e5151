#![allow(missing_docs)]
use nalgebra::*;
use quest_core::solver::*;
use quest_core::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
fn vec(r: &mut ChaCha8Rng, s: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| r.random_range(-s..s))
}
fn main() {
    let mut r = ChaCha8Rng::seed_from_u64(7);
    let par = 1e-3;
    let mut shown = 0;
    for _ in 0..2000 {
        let q = UnitQuaternion::new(vec(&mut r, 1.0));
        let t = vec(&mut r, 1.0).normalize() * par * 3.0;
        let m: Vec<_> = (0..5)
            .map(|_| {
                let x = vec(&mut r, 1.0) + Vector3::new(0., 0., 3.);
                let y = q * x + t;
                Correspondence::from_image_points([x.x / x.z, x.y / x.z], [y.x / y.z, y.y / y.z]).unwrap()
            })
            .collect();
        let p = RelativePose::new(q, t);
        let mut out = Candidates::new();
        Quest { kinds: Kinds::Exact }.solve(&m, &mut out);
        let e = out.iter().map(|c| p.rotation_error(&c.pose)).fold(9., f64::min);
        if e > 1e-6 {
            shown += 1;
            let r0 = alignment::best_rotation(&m);
            {
                let s: Matrix3<f64> = m.iter().map(|m| m.bearing2() * m.bearing1().transpose()).sum();
                let mm = quaternion::bilinear(&s);
                let e = SymmetricEigen::new(mm);
                println!("eig {:?} q {:?} r0 {:?}", e.eigenvalues, q.coords, r0.coords);
            }
            println!(
                "err {e:.1e} n {} r0 err {:.2e} par {:.2e}",
                out.len(),
                r0.angle_to(&q),
                (m.iter().map(|m| (r0 * m.bearing1()).cross(m.bearing2()).norm_squared()).sum::<f64>() / 5.)
                    .sqrt()
            );
            if shown > 8 {
                break;
            }
        }
    }
}
