#![allow(missing_docs)]
use nalgebra::*;
use quest_core::solver::*;
use quest_core::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::time::Instant;
fn vec(r: &mut ChaCha8Rng, s: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| r.random_range(-s..s))
}
fn scene(
    r: &mut ChaCha8Rng,
    kind: &str,
    n: usize,
    par: f64,
    noise: f64,
) -> (RelativePose, Vec<Correspondence>) {
    let axis = loop {
        let v = vec(r, 1.0);
        if v.norm() < 1.0 && v.norm() > 0.1 {
            break v.normalize();
        }
    };
    let ang: f64 = match kind {
        "half" => std::f64::consts::PI,
        "identity" => 0.0,
        _ => r.random_range(0.0..0.5),
    };
    let q = UnitQuaternion::new(axis * ang);
    let mut t = vec(r, 1.0);
    if par > 0.0 {
        t = t.normalize() * par * 3.0;
    }
    let nrm = vec(r, 1.0).normalize();
    let mut pts = vec![];
    while pts.len() < n {
        let mut x = vec(r, 1.0) + Vector3::new(0., 0., 3.);
        if kind == "coplanar" {
            x -= nrm * nrm.dot(&(x - Vector3::new(0., 0., 3.)));
        }
        pts.push(x);
    }
    let m = pts
        .iter()
        .map(|x| {
            let y = q * x + t;
            let mut nz = || {
                let a: f64 = r.random_range(1e-12..1.0);
                let b: f64 = r.random();
                noise / 1060. * (-2. * a.ln()).sqrt() * (6.283185307 * b).cos()
            };
            Correspondence::from_image_points(
                [x.x / x.z + nz(), x.y / x.z + nz()],
                [y.x / y.z + nz(), y.y / y.z + nz()],
            )
            .unwrap()
        })
        .collect();
    (RelativePose::new(q, t), m)
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let k: usize = a[2].parse().unwrap();
    let n: usize = a[3].parse().unwrap();
    let par: f64 = a[4].parse().unwrap();
    let noise: f64 = a[5].parse().unwrap();
    let name: SolverName = a.get(6).map(|s| s.parse().unwrap()).unwrap_or(SolverName::QuestEigen);
    let mut r = ChaCha8Rng::seed_from_u64(7);
    let sc: Vec<_> = (0..k).map(|_| scene(&mut r, &a[1], n, par, noise)).collect();
    for kinds in [Kinds::Exact, Kinds::All] {
        let mut out = Candidates::new();
        let t0 = Instant::now();
        let mut cnt = 0;
        for (_, m) in &sc {
            name.solve(kinds, m, &mut out);
            cnt += out.len();
        }
        let us = t0.elapsed().as_secs_f64() * 1e6 / k as f64;
        let mut fail = 0;
        let mut errs = vec![];
        let mut terr = vec![];
        let mut deg = 0;
        let mut first = 0;
        for (p, m) in &sc {
            name.solve(kinds, m, &mut out);
            deg += out.degeneracy().is_some() as usize;
            let e = out.iter().map(|c| p.rotation_error(&c.pose)).fold(9., f64::min);
            if e > 1e-6 {
                fail += 1;
            }
            errs.push(e);
            let te = out
                .iter()
                .filter_map(|c| p.translation_error(&c.pose).map(|t| t.max(p.rotation_error(&c.pose))))
                .fold(9., f64::min);
            terr.push(te);
            if out.len() > 0 && p.rotation_error(&out[0].pose) <= e * 1.0001 {
                first += 1;
            }
        }
        let mean = errs.iter().sum::<f64>() / k as f64;
        errs.sort_by(f64::total_cmp);
        terr.sort_by(f64::total_cmp);
        println!(
            "{kinds:?} us {us:.2} cands {:.2} fail {fail} deg {deg} first {first} mean {mean:.2e} median {:.2e} p99.9 {:.2e} pose median {:.2e} p99.9 {:.2e}",
            cnt as f64 / k as f64,
            errs[k / 2],
            errs[k - 1 - k / 1000],
            terr[k / 2],
            terr[k - 1 - k / 1000]
        );
    }
}
