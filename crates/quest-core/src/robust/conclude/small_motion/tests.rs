//! Modes, minima and directions that are planted.

use super::*;
use crate::Correspondence;
use crate::robust::search::sampling;
use nalgebra::Matrix6;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

/// A mode with this likelihood and translation, known to a tenth.
fn mode(nats: f64, t_21: [f64; 3]) -> Mode {
    Mode {
        at: DepthField::start(UnitQuaternion::identity(), t_21.into(), 0.2),
        nats,
        covariance: Matrix6::identity() * 0.01,
        mean_depth: 1.0,
        covariance_by_depth: Matrix6::identity() * 0.01,
    }
}

fn small(modes: Vec<Mode>) -> SmallMotion {
    SmallMotion {
        q_21: UnitQuaternion::identity(),
        excess: 2.0,
        nats: 0.0,
        sigma: 0.5,
        is_likely: Vec::new(),
        modes,
    }
}

#[test]
fn of_several_modes_the_likely_ones_count() {
    let side = [0.5, 0.0, 0.0];
    let found = small(vec![
        mode(9.0, side),
        mode(7.0, [0.4, 0.2, 0.0]),
        mode(6.5, [0.0, 0.0, 0.5]),
        mode(5.0, [0.0, 0.5, 0.0]),
    ]);
    assert_eq!(found.likely().count(), 3);
    assert!((found.likeliest().unwrap().direction - Vector3::x()).amax() < 1e-15);
    // The farthest of the likely ones, if it is further away than 20°.
    assert!((found.other_mode(&side.into()).unwrap().direction - Vector3::z()).amax() < 1e-15);
    assert!(small(vec![mode(9.0, side), mode(8.0, [0.5, 0.1, 0.0])]).other_mode(&side.into()).is_none());
    let left = found.without_twins();
    assert_eq!(left.modes.len(), 1, "27° away is another");
    // Four deviations are 0.4.
    assert!(left.is_clear() && !small(vec![mode(1.0, [0.39, 0.0, 0.0])]).is_clear());
    let none = small(Vec::new());
    assert!(!none.is_clear() && none.likeliest().is_none() && none.other_mode(&side.into()).is_none());
    assert!(small(vec![mode(1.0, [0.0; 3])]).likeliest().is_none());
}

#[test]
fn directions_cover_half_of_the_sphere() {
    let all: Vec<_> = (0..DIRECTIONS).map(on_half_sphere).collect();
    for (k, direction) in all.iter().enumerate() {
        assert!((direction.norm() - 1.0).abs() < 1e-12 && direction.z > 0.0);
        let others = all.iter().enumerate().filter(|(i, _)| *i != k);
        let nearest = others.map(|(_, other)| other.dot(direction).abs().min(1.0).acos().to_degrees());
        let nearest = nearest.fold(180.0, f64::min);
        assert!((20.0..60.0).contains(&nearest), "{k}: {nearest}");
    }
    // Anything else is within 40° of one or of its opposite.
    for k in 0..100 {
        let k = f64::from(k);
        let any = Vector3::new((1.7 * k).sin(), (2.9 * k).cos(), (0.3 * k).sin()).normalize();
        assert!(all.iter().any(|direction| direction.dot(&any).abs() > 40_f64.to_radians().cos()), "{any}");
    }
}

#[test]
fn minima_of_one_direction_are_one() {
    let minimum = |nats, direction: [f64; 3]| {
        let motion =
            Motion { q_21: UnitQuaternion::identity(), direction: Vector3::from(direction).normalize() };
        Minimum { nats, motion, mean_depth: 0.1 }
    };
    let all = [
        minimum(1.0, [1.0, 0.0, 0.0]),
        minimum(3.0, [1.0, 0.1, 0.0]),
        minimum(2.0, [1.0, 0.4, 0.0]),
        minimum(0.0, [-1.0, 0.0, 0.0]),
    ];
    let nats: Vec<f64> = distinct(&all).iter().map(|minimum| minimum.nats).collect();
    assert_eq!(nats, [3.0, 2.0, 0.0]);
}

#[test]
fn a_few_near_points_tell_the_direction_and_its_sign() {
    let rng = &mut sampling::generator(0x5e_a1, 0);
    for step in
        [Vector3::new(0.1, -0.02, 0.03), Vector3::new(-0.1, 0.02, -0.03), Vector3::new(0.02, 0.05, -0.2)]
    {
        let all = (0..100).map(|k| {
            let mut place = || [rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5)];
            let (a, other) = (place(), place());
            // Ten near points and ten false matches before eighty points at the horizon.
            let z = if k < 10 { 2.0 } else { 1e6 };
            let seen = Vector3::new(a[0], a[1], 1.0) * z + step;
            let b = if (10..20).contains(&k) { other } else { [seen.x / seen.z, seen.y / seen.z] };
            let b = b.map(|x| x + 0.5 / 900.0 * Distribution::<f64>::sample(&StandardNormal, rng));
            Correspondence::from_image_points(a, b).unwrap()
        });
        let matches: Vec<_> = all.collect();
        let observations = Observations::new(&matches, (0..100).collect(), [[900.0; 2]; 2], 1.5);
        let found = direction_of_pairs(&observations, &UnitQuaternion::identity(), 0.5).unwrap();
        assert!(found.angle(&step).to_degrees() < 15.0, "{found} {step}");
    }
    let still: Vec<_> = (0..20).map(|k| [0.02 * f64::from(k), 0.01 * f64::from(k * k % 7)]).collect();
    let still = crate::correspondence::from_image_points(&still, &still).unwrap();
    let observations = Observations::new(&still, (0..20).collect(), [[900.0; 2]; 2], 1.5);
    assert!(direction_of_pairs(&observations, &UnitQuaternion::identity(), 0.5).is_none());
}

#[test]
fn a_direction_and_its_opposite_take_points_to_either_side() {
    let step = Vector3::new(0.1, -0.02, 0.03);
    let all = (0..20).map(|k| {
        let place = f64::from(k);
        let x1 = Vector3::new(0.5 * (2.1 * place).sin(), 0.4 * (3.7 * place).cos(), 1.0);
        // Three in four points are moved by the step, the others by its opposite.
        let seen = x1 * 4.0 + if k % 4 == 0 { -step } else { step };
        Correspondence::from_image_points([x1.x, x1.y], [seen.x / seen.z, seen.y / seen.z]).unwrap()
    });
    let matches: Vec<_> = all.collect();
    let all: Vec<u32> = (0..20).collect();
    let observations = Observations::new(&matches, all.clone(), [[900.0; 2]; 2], 1.5);
    let displacements = observations.framed(&all).displacements(&Matrix3::identity());
    let blocks: Vec<Off> = displacements.chunks(WIDTH).map(Off::new).collect();
    let sides = |direction: Vector3<f64>| {
        widest(Sides { blocks: &blocks, direction: direction.normalize().into(), sigma: 0.5 })
    };
    assert_eq!((sides(step), sides(-step)), ([15.0, 5.0], [5.0, 15.0]));
    // No point goes so far to the side of its line.
    let [plus, minus] = sides(Vector3::new(0.02, 0.1, 0.0));
    assert!(plus + minus < 10.0, "{plus} {minus}");
}
