//! The controller alone: an estimator and a law that say what the test tells them.

use nalgebra::{Matrix6, UnitQuaternion, Vector3};

use super::*;

/// Says what it is told, and remembers what it was told itself.
#[derive(Clone, Debug)]
struct Script {
    next: Result<Estimate, HoldReason>,
    begin: Option<RelativePose>,
    motions: Vec<Motion>,
    restarts: usize,
    resets: usize,
}

impl PoseEstimator for Script {
    fn estimate(&mut self, _: &[Option<[f64; 2]>]) -> Result<Estimate, HoldReason> {
        self.next
    }

    fn moved(&mut self, motion: &Motion) {
        self.motions.push(*motion);
    }

    fn restart(&mut self) {
        self.restarts += 1;
    }

    fn reset(&mut self) {
        self.resets += 1;
    }

    fn begin(&self) -> Option<RelativePose> {
        self.begin
    }

    fn hypotheses(&self) -> usize {
        7
    }

    fn restarts(&self) -> usize {
        self.restarts
    }
}

/// Commands one twist.
#[derive(Clone, Debug)]
struct Fixed {
    twist: Twist,
    /// Whether it is to be judged by the square of the distance.
    is_judged: bool,
    hindered: Vec<bool>,
    resets: usize,
}

impl ControlLaw for Fixed {
    fn command(&mut self, _: &RelativePose) -> Twist {
        self.twist
    }

    fn potential(&self, pose: &RelativePose) -> Option<f64> {
        self.is_judged.then(|| pose.t_21.norm_squared())
    }

    fn hindered(&mut self, is_hindered: bool) {
        self.hindered.push(is_hindered);
    }

    fn reset(&mut self) {
        self.resets += 1;
    }
}

const FREE: Limits = Limits { speed: 10.0, turn_rate: 10.0 };

fn twist() -> Twist {
    Twist { linear: Vector3::new(0.1, -0.2, 0.4), angular: Vector3::new(0.2, 0.3, -0.1) }
}

#[expect(clippy::unnecessary_wraps, reason = "what an estimator says")]
fn at(t: [f64; 3], turn: [f64; 3], support: Support) -> Result<Estimate, HoldReason> {
    Ok(Estimate {
        pose: RelativePose::new(UnitQuaternion::new(Vector3::from(turn)), Vector3::from(t)),
        covariance: Some(Matrix6::zeros()),
        inliers: 5,
        residual: 0.0,
        alternatives: 1,
        support,
    })
}

fn far(support: Support) -> Result<Estimate, HoldReason> {
    at([0.3, 0.0, 0.0], [0.0, 0.4, 0.0], support)
}

fn servo(next: &Result<Estimate, HoldReason>, safety: Safety) -> Servo<Script, Fixed> {
    let script = Script { next: *next, begin: None, motions: Vec::new(), restarts: 0, resets: 0 };
    let law = Fixed { twist: twist(), is_judged: false, hindered: Vec::new(), resets: 0 };
    Servo::new(&[[0.0, 0.0]; 6], script, law, safety)
}

const IMAGE: [Option<[f64; 2]>; 6] =
    [Some([0.1, 0.1]), Some([0.0, 0.2]), None, Some([f64::NAN, 0.0]), Some([0.2, 0.0]), Some([0.3, 0.1])];

fn is_near(a: &Twist, b: &Twist) -> bool {
    (a.linear - b.linear).amax() < 1e-12 && (a.angular - b.angular).amax() < 1e-12
}

fn scaled(twist: &Twist, by: f64) -> Twist {
    Twist { linear: twist.linear * by, angular: twist.angular * by }
}

#[test]
fn what_supports_the_pose_decides_the_state_and_the_speed() {
    let cases = [
        (Support::Full, State::Tracking, "tracking", 1.0),
        (Support::Several, State::Ambiguous, "ambiguous", 0.2),
        (Support::Unconfirmed, State::Confirming, "confirming", 0.3),
    ];
    for (support, state, name, share) in cases {
        let step = servo(&far(support), Safety::new(FREE)).step(&IMAGE);
        assert_eq!((step.state, step.state.name(), step.state.has_pose()), (state, name, true));
        assert!(is_near(&step.command, &scaled(&twist(), share)), "{name}: {:?}", step.command);
        // One feature is lost and one is no number.
        let Status { images, seen, inliers, hypotheses, holding_images, restarts, .. } = step.status;
        assert_eq!((images, seen, inliers, hypotheses, holding_images, restarts), (1, 4, 5, 7, 0, 0));
        assert!((step.status.time - 0.1).abs() < 1e-15);
    }
    let step = servo(&far(Support::RotationOnly), Safety::new(FREE)).step(&IMAGE);
    assert_eq!((step.state, step.state.name()), (State::RotationOnly, "rotation_only"));
    assert!(step.state.has_pose());
    assert!(is_near(&step.command, &Twist { linear: Vector3::zeros(), ..twist() }));
}

#[test]
fn commands_change_no_faster_than_the_acceleration_allows() {
    let acceleration = Some(Acceleration { linear: 0.5, angular: 1.0 });
    let safety = Safety { acceleration, ..Safety::new(FREE) };
    let mut servo = servo(&far(Support::Full), safety);
    servo.law_mut().twist = Twist::drive(1.0, 0.15);
    // A tenth of a second each: 0.05 m/s and 0.1 rad/s, both slowed alike.
    let first = servo.step(&IMAGE).command;
    assert!(is_near(&first, &Twist::drive(0.05, 0.0075)), "{first:?}");
    let second = servo.step(&IMAGE).command;
    assert!(is_near(&second, &Twist::drive(0.1, 0.015)), "{second:?}");
    // After a gap of ten seconds half a second counts.
    let third = servo.step_at(&IMAGE, 10.2, 10.2).command;
    assert!(is_near(&third, &Twist::drive(0.35, 0.0525)), "{third:?}");
    servo.estimator_mut().next = Err(HoldReason::TooFewFeatures);
    let held = servo.step(&IMAGE);
    assert!(is_near(&held.command, &Twist::drive(0.3, 0.045)), "{held:?}");
    // Without an image it stops in the same way, once the last one is too old.
    servo.safety_mut().largest_gap = 0.5;
    let now = held.status.time;
    assert_eq!(servo.idle(now + 0.5), held.command);
    assert!(is_near(&servo.idle(now + 0.6), &Twist::drive(0.25, 0.0375)));
    assert!(is_near(&servo.idle(now + 0.7), &Twist::drive(0.2, 0.03)));
}

#[test]
fn a_turn_alone_changes_as_its_own_acceleration_allows() {
    let acceleration = Some(Acceleration { linear: 0.5, angular: 1.0 });
    let mut servo = servo(&far(Support::Full), Safety { acceleration, ..Safety::new(FREE) });
    servo.law_mut().twist = Twist::drive(0.0, 2.0);
    assert!(is_near(&servo.step(&IMAGE).command, &Twist::drive(0.0, 0.1)));
}

#[test]
fn an_image_that_is_old_out_of_order_or_without_a_time_is_stale() {
    let safety = Safety { largest_gap: 0.5, ..Safety::new(FREE) };
    let mut servo = servo(&far(Support::Full), safety);
    assert_eq!(servo.step_at(&IMAGE, 5.0, 5.5).state, State::Tracking);
    for (stamp, now) in [(5.0, 5.0), (4.9, 5.0), (f64::NAN, 5.0), (f64::INFINITY, 5.0), (5.2, 5.75)] {
        let step = servo.step_at(&IMAGE, stamp, now);
        assert_eq!(step.state, State::Holding(HoldReason::Stale), "{stamp} {now}");
        assert_eq!(step.estimate, Err(HoldReason::Stale));
        assert_eq!((step.command, step.status.inliers), (Twist::zero(), 0));
        assert!((step.status.time - 5.0).abs() < 1e-15, "a stale image has no time of its own");
    }
    let step = servo.step_at(&IMAGE, 5.3, 5.75);
    assert_eq!((step.state, step.status.images, step.status.holding_images), (State::Tracking, 7, 0));
    // The estimator was told of the images that were looked at alone.
    assert_eq!(servo.estimator().motions.len(), 2);
}

#[test]
fn an_image_without_a_pose_coasts_where_it_may() {
    use HoldReason::{Degenerate, Diverging, Inconsistent, Jump, Stale, Starting, TooFewFeatures, Uncertain};
    let safety = Safety { coasting_images: 2, ..Safety::new(FREE) };
    for reason in [TooFewFeatures, Inconsistent, Jump, Degenerate] {
        let mut servo = servo(&far(Support::Full), safety);
        servo.step(&IMAGE);
        servo.estimator_mut().next = Err(reason);
        for k in 1..=2 {
            let step = servo.step(&IMAGE);
            assert_eq!((step.state, step.state.name()), (State::Coasting, "coasting"));
            assert!(!step.state.has_pose() && is_near(&step.command, &twist()));
            assert_eq!(step.status.holding_images, k);
            assert!((step.status.holding_seconds - 0.1 * k as f64).abs() < 1e-12);
        }
        let step = servo.step(&IMAGE);
        assert_eq!((step.state, step.command), (State::Holding(reason), Twist::zero()));
        assert!(!step.state.has_pose());
        servo.estimator_mut().next = far(Support::Full);
        let step = servo.step(&IMAGE);
        assert_eq!((step.status.holding_images, step.status.holding_seconds), (0, 0.0));
        servo.estimator_mut().next = Err(reason);
        assert_eq!(servo.step(&IMAGE).state, State::Coasting);
    }
    for reason in [Starting, Uncertain, Diverging, Stale] {
        let mut servo = servo(&far(Support::Full), safety);
        servo.step(&IMAGE);
        servo.estimator_mut().next = Err(reason);
        let step = servo.step(&IMAGE);
        assert_eq!((step.state, step.command), (State::Holding(reason), Twist::zero()));
        assert_eq!(step.state.name(), reason.name());
    }
}

#[test]
fn a_pose_that_is_too_uncertain_commands_nothing() {
    let uncertain = |covariance, support| {
        let next = far(support).map(|e| Estimate { covariance, ..e });
        servo(&next, Safety::new(FREE)).step(&IMAGE).state == State::Holding(HoldReason::Uncertain)
    };
    let diagonal = |rotation: f64, translation: f64| {
        let mut c = Matrix6::zeros();
        for k in 0..3 {
            (c[(k, k)], c[(k + 3, k + 3)]) = (rotation, translation);
        }
        Some(c)
    };
    // A quarter of a radian and of the depths: a third of the square in each of three directions.
    let (within, beyond) = (0.99 * 0.0625 / 3.0, 1.01 * 0.0625 / 3.0);
    for support in [Support::Full, Support::Several, Support::Unconfirmed, Support::RotationOnly] {
        assert!(!uncertain(None, support));
        assert!(!uncertain(diagonal(within, within), support));
        assert!(uncertain(diagonal(beyond, 0.0), support));
        assert!(uncertain(diagonal(-1.0, 0.0), support));
        assert!(uncertain(diagonal(f64::NAN, 0.0), support));
        // Of a rotation alone nobody asks where the camera is.
        assert_eq!(uncertain(diagonal(0.0, beyond), support), support != Support::RotationOnly);
        assert_eq!(uncertain(diagonal(0.0, f64::NAN), support), support != Support::RotationOnly);
    }
    for covariance in [None, diagonal(0.0, 0.0)] {
        let next = far(Support::Full).map(|mut e| {
            e.pose.t_21.y = f64::INFINITY;
            Estimate { covariance, ..e }
        });
        let step = servo(&next, Safety::new(FREE)).step(&IMAGE);
        assert_eq!(step.state, State::Holding(HoldReason::Uncertain));
    }
}

#[test]
fn a_camera_has_arrived_after_a_while_at_the_goal() {
    let arrival = Arrival { distance: 0.01, angle: 0.02, seconds: 0.25 };
    let safety = Safety { arrival, ..Safety::new(FREE) };
    let run = |t: f64, turn: f64, support| {
        let mut servo = servo(&at([0.0, t, 0.0], [turn, 0.0, 0.0], support), safety);
        servo.rig_mut().unit = 2.0;
        let arrived: Vec<_> = (0..5).map(|_| servo.step(&IMAGE).status.arrived).collect();
        (arrived, servo)
    };
    // Half a centimetre of the unit is a centimetre. Three images of a tenth of a second are more than a quarter.
    let (arrived, mut there) = run(0.004_99, 0.0199, Support::Full);
    assert_eq!(arrived, [false, false, true, true, true]);
    let never = [false; 5];
    assert_eq!(run(0.005_01, 0.0, Support::Full).0, never);
    assert_eq!(run(0.0, 0.0201, Support::Full).0, never);
    for support in [Support::Several, Support::Unconfirmed, Support::RotationOnly] {
        assert_eq!(run(0.0, 0.0, support).0, never);
    }
    // An image without a pose, or away from the goal, begins the count anew.
    for next in [Err(HoldReason::Jump), far(Support::Full)] {
        let good = std::mem::replace(&mut there.estimator_mut().next, next);
        assert!(!there.step(&IMAGE).status.arrived);
        there.estimator_mut().next = good;
        let arrived: Vec<_> = (0..3).map(|_| there.step(&IMAGE).status.arrived).collect();
        assert_eq!(arrived, [false, false, true]);
    }
    let usual = Arrival { distance: 0.01, angle: 0.5_f64.to_radians(), seconds: 0.5 };
    assert_eq!(Arrival::default(), usual);
}

#[test]
fn a_loop_that_diverges_again_and_again_holds_until_it_is_reset() {
    let safety = Safety { watchdog: true, ..Safety::new(FREE) };
    let mut servo = servo(&far(Support::Full), safety);
    servo.law_mut().is_judged = true;
    let mut diverged = Vec::new();
    for k in 0..200 {
        if servo.step(&IMAGE).state == State::Holding(HoldReason::Diverging) {
            diverged.push(k);
        }
    }
    // Four times the estimator begins anew; then nothing more is tried.
    assert_eq!(servo.estimator().restarts, 4);
    assert!(diverged[..4].windows(2).all(|pair| pair[1] - pair[0] > 14), "{diverged:?}");
    assert_eq!(diverged.len(), 4 + (199 - diverged[3]));
    servo.reset();
    assert_eq!((servo.estimator().resets, servo.law().resets), (1, 1));
    let step = servo.step(&IMAGE);
    assert_eq!((step.state, step.status.images), (State::Tracking, 1));
    // A distance that falls, or a watchdog that is off, never holds.
    let mut falling = servo.clone();
    for k in 0..100 {
        falling.estimator_mut().next = at([0.9_f64.powi(k), 0.0, 0.0], [0.0; 3], Support::Full);
        assert_eq!(falling.step(&IMAGE).state, State::Tracking, "image {k}");
    }
    servo.safety_mut().watchdog = false;
    assert!((0..100).all(|_| servo.step(&IMAGE).state == State::Tracking));
}

#[test]
fn a_way_that_was_longer_from_the_beginning_is_no_divergence() {
    let safety = Safety { watchdog: true, ..Safety::new(FREE) };
    let mut servo = servo(&far(Support::Full), safety);
    servo.law_mut().is_judged = true;
    // The way left falls by a twentieth an image, and is learnt to be longer and longer.
    for k in 0..60 {
        let seen = 0.5 + 0.5 * f64::from(k) / 60.0;
        servo.estimator_mut().begin =
            Some(RelativePose::new(UnitQuaternion::identity(), Vector3::x() * seen));
        servo.estimator_mut().next = at([0.98_f64.powi(k) * seen, 0.0, 0.0], [0.0; 3], Support::Full);
        assert_eq!(servo.step(&IMAGE).state, State::Tracking, "image {k}");
    }
}

#[test]
fn without_parallax_a_loop_may_explore() {
    let limits = Limits { speed: 0.3, turn_rate: 1.0 };
    let safety = Safety { explore: 0.04, ..Safety::new(limits) };
    let mut servo = servo(&at([0.0; 3], [0.0; 3], Support::RotationOnly), safety);
    servo.rig_mut().unit = 2.0;
    let right_down_left = [Vector3::x(), Vector3::y(), -Vector3::x()];
    for (attempt, direction) in right_down_left.into_iter().enumerate() {
        // It stands still first, then goes 4 % of two metres at a third of its speed.
        for _ in 0..8 {
            let step = servo.step(&IMAGE);
            assert_eq!((step.state, step.command.linear), (State::RotationOnly, Vector3::zeros()));
        }
        assert_eq!(servo.estimator().restarts, attempt);
        let (mut way, mut images) = (Vector3::zeros(), 0);
        let after = loop {
            let step = servo.step(&IMAGE);
            if step.state != State::Exploring {
                break step;
            }
            assert_eq!((step.state.name(), step.command.angular), ("exploring", Vector3::zeros()));
            assert!(images > 7 || (step.command.linear - direction * 0.1).amax() < 1e-12, "{step:?}");
            way += step.command.linear * 0.1;
            images += 1;
        };
        assert!((way - direction * 0.08).amax() < 1e-12, "{way}");
        // Rounding may leave a last bit of the way.
        assert!((8..=9).contains(&images), "{images}");
        // What was seen on the way is judged anew.
        assert_eq!((after.state, servo.estimator().restarts), (State::RotationOnly, attempt + 1));
    }
    assert!((0..40).all(|_| servo.step(&IMAGE).state == State::RotationOnly));
    // A rotation that is not done yet comes first, and nobody who did not ask for it is moved.
    servo.reset();
    servo.estimator_mut().next = at([0.0; 3], [0.0, 0.021, 0.0], Support::RotationOnly);
    assert!((0..40).all(|_| servo.step(&IMAGE).state == State::RotationOnly));
    servo.estimator_mut().next = at([0.0; 3], [0.0, 0.019, 0.0], Support::RotationOnly);
    assert!((0..9).any(|_| servo.step(&IMAGE).state == State::Exploring));
    servo.reset();
    servo.safety_mut().explore = 0.0;
    assert!((0..40).all(|_| servo.step(&IMAGE).state == State::RotationOnly));
}

#[test]
fn the_estimator_is_told_how_the_camera_moved_in_its_own_frame_and_unit() {
    let hand =
        RelativePose::new(UnitQuaternion::new(Vector3::new(0.3, -0.8, 0.4)), Vector3::new(0.1, -0.2, 0.3));
    for mount in [Mount::Camera, Mount::Hand(hand), Mount::Base(hand)] {
        let rig =
            Rig { unit: 2.0, mount, axes: Axes([true, false, true, true, true, false]), ..Rig::default() };
        let mut servo = servo(&far(Support::Full), Safety::new(FREE)).with_rig(rig);
        let command = servo.step(&IMAGE).command;
        servo.step_at(&IMAGE, 0.4, 0.4);
        let motion = servo.estimator().motions[1];
        assert_eq!(servo.estimator().motions[0].linear, Vector3::zeros());
        let camera = mount.carried(&command);
        assert!((motion.linear - camera.linear * 0.3 / 2.0).amax() < 1e-12);
        assert!((motion.angular - camera.angular * 0.3).amax() < 1e-12);
        // A base is commanded by its law, the others along the axes of the camera that are free.
        let expected = if mount == Mount::Base(hand) { twist() } else { mount.carry(&rig.axes.of(&twist())) };
        assert!(is_near(&command, &expected), "{mount:?}: {command:?}");
    }
}

#[test]
fn a_law_is_judged_by_what_its_axes_can_mend() {
    let pose =
        RelativePose::new(UnitQuaternion::new(Vector3::new(0.1, 0.2, -0.1)), Vector3::new(0.3, 0.4, 0.5));
    assert_eq!(Axes::default().of_pose(&pose), pose);
    let some = Axes::from_names(["y", "rx"]).unwrap().of_pose(&pose);
    assert!((some.t_21 - Vector3::new(0.0, 0.4, 0.0)).amax() < 1e-15);
    assert!((some.q_21.scaled_axis() - Vector3::new(0.1, 0.0, 0.0)).amax() < 1e-12);
}

/// A camera ahead of the axle and above it that looks down sees what the base is told of it.
#[test]
fn a_camera_ahead_is_carried_by_its_base() {
    let mount = Mount::ahead(0.4, 1.2, 0.3);
    let pose = mount.pose();
    assert_eq!(pose.t_21, Vector3::new(0.0, -1.2, 0.4));
    // The optical axis points forward and down, which is y.
    let axis = pose.q_21 * Vector3::z();
    assert!((axis - Vector3::new(0.0, 0.3_f64.sin(), 0.3_f64.cos())).amax() < 1e-12, "{axis}");
    // A base that turns on the spot moves a camera ahead of it to the side.
    let camera = mount.carried(&Twist::drive(0.0, 0.5));
    assert!((camera.linear - Vector3::new(0.2, 0.0, 0.0)).amax() < 1e-12, "{camera:?}");
    assert_eq!(Mount::Camera.pose(), RelativePose::identity());
    let pose = RelativePose::new(UnitQuaternion::new(Vector3::y() * 0.2), Vector3::new(0.1, 0.0, 0.2));
    assert_eq!(Mount::Hand(mount.pose()).pose_for_law(&pose, 2.0), pose);
    // In another unit the mount has another length and the base's pose is the same in metres.
    let metres = mount.pose_for_law(&pose, 1.0);
    let halves = mount.pose_for_law(&RelativePose::new(pose.q_21, pose.t_21 / 2.0), 2.0);
    assert!((metres.t_21 - halves.t_21 * 2.0).amax() < 1e-12 && metres.rotation_error(&halves) < 1e-12);
}

const BORDER: Border = Border { left: -0.5, right: 0.4 };

/// The turn that the border makes of what is wanted, for features at these places that are in the middle at the goal.
fn turned(wanted: f64, places: &[f64]) -> f64 {
    let features: Vec<_> = places.iter().map(|u| Some([*u, 0.1])).collect();
    BORDER.turn(wanted, &features, &vec![[0.0, 0.0]; places.len()], &mut Vec::new())
}

/// How fast a feature outside is brought back: by what the turn moves it.
fn rate(u: f64) -> f64 {
    let outside = if u > 0.0 { u - BORDER.right } else { u - BORDER.left };
    3.0 * outside / (1.0 + u * u)
}

#[test]
fn a_border_keeps_a_quarter_of_the_features_and_at_least_eight() {
    let near = |a: f64, b: f64| (a - b).abs() < 1e-15;
    // Of forty, ten stay within: the turn is free. Of nine the mildest of the others decides.
    let places = |within: usize| -> Vec<f64> {
        (0..40).map(|k| if k < within { 0.1 } else { 0.41 + 0.01 * k as f64 }).collect()
    };
    assert!(near(turned(-0.2, &places(10)), -0.2));
    assert!(near(turned(-0.2, &places(9)), rate(places(9)[9])), "{}", turned(-0.2, &places(9)));
    assert!(near(turned(-0.2, &places(7)), rate(places(7)[9])));
    // Twelve features: eight are kept, not three.
    let dozen: Vec<f64> = (0..12).map(|k| if k < 6 { 0.1 } else { -0.51 - 0.01 * f64::from(k) }).collect();
    assert!(near(turned(0.3, &dozen), rate(dozen[7])));
    // Fewer than eight are all kept: the farthest decides.
    let few = [0.0, 0.45, 0.6, 0.5];
    assert!(near(turned(0.0, &few), rate(0.6)));
    // A turn that brings them back already is not changed, nor one with features at the very border.
    assert!(near(turned(0.7, &few), 0.7));
    assert!(near(turned(-0.7, &[0.4; 4]), -0.7) && near(turned(0.7, &[-0.5; 4]), 0.7));
    // Outside on both sides: no turn helps.
    assert!(near(turned(0.0, &[0.6, -0.7]), 0.0));
    assert!(near(turned(0.1, &[0.6, -0.7]), 0.0));
    // What is not seen does not count, and what is outside at the goal is at home there.
    let mut bounds = Vec::new();
    assert!(near(BORDER.turn(-0.2, &[None, Some([0.3, 0.0])], &[[0.0; 2]; 2], &mut bounds), -0.2));
    assert!(near(BORDER.turn(-0.2, &[Some([0.6, 0.0])], &[[0.7, 0.0]], &mut bounds), -0.2));
    assert!(near(BORDER.turn(0.2, &[Some([-0.6, 0.0])], &[[-0.7, 0.0]], &mut bounds), 0.2));
}

#[test]
fn a_law_hears_that_the_border_was_in_its_way() {
    let safety = Safety { border: Some(BORDER), ..Safety::new(FREE) };
    let mut servo = servo(&far(Support::Full), safety);
    servo.law_mut().twist = Twist::drive(0.2, -0.3);
    let free = servo.step(&[Some([0.1, 0.0]); 6]);
    assert!(!free.status.border_limits && is_near(&free.command, &Twist::drive(0.2, -0.3)));
    let limited = servo.step(&[Some([0.5, 0.0]); 6]);
    assert!(limited.status.border_limits);
    assert!(is_near(&limited.command, &Twist::drive(0.2, rate(0.5))));
    // A pose of which nobody knows how good it is says nothing about the way.
    servo.estimator_mut().next = far(Support::Full).map(|e| Estimate { covariance: None, ..e });
    assert!(servo.step(&[Some([0.5, 0.0]); 6]).status.border_limits);
    assert_eq!(servo.law().hindered, [false, true, false]);
    // A change of less than three tenths is none.
    servo.law_mut().twist = Twist::drive(0.2, 0.22);
    let little = servo.step(&[Some([0.5, 0.0]); 6]);
    assert!(!little.status.border_limits && is_near(&little.command, &Twist::drive(0.2, rate(0.5))));
}

#[test]
fn a_camera_s_border_is_that_of_its_image() {
    let camera = crate::Camera::new(crate::CameraModel::Pinhole, &[500.0, 500.0, 320.0, 240.0]).unwrap();
    assert_eq!(Border::of_camera(&camera, 20.0), None);
    let camera = camera.with_size(640, 480).unwrap();
    let border = Border::of_camera(&camera, 20.0).unwrap();
    assert!((border.left + 0.6).abs() < 1e-12 && (border.right - 0.598).abs() < 1e-12, "{border:?}");
    assert_eq!(on_plane(&camera, [320.0, f64::NAN]), None);
    let panorama = crate::Camera::new(crate::CameraModel::Equirectangular, &[640.0, 320.0]).unwrap();
    // The middle is ahead, the left end is behind.
    assert!(on_plane(&panorama, [320.0, 160.0]).unwrap().iter().all(|x| x.abs() < 1e-12));
    assert_eq!(on_plane(&panorama, [2.0, 160.0]), None);
}

#[test]
fn the_guards_for_a_robot_are_those_of_its_limits() {
    let safety = Safety::for_robot(Limits { speed: 0.2, turn_rate: 0.5 });
    assert_eq!(safety.acceleration, Some(Acceleration { linear: 0.4, angular: 1.0 }));
    assert_eq!((safety.coasting_images, safety.largest_gap, safety.watchdog), (1, 0.5, true));
    let plain = Safety::new(safety.limits);
    assert_eq!((plain.acceleration, plain.coasting_images, plain.watchdog), (None, 0, false));
}

#[test]
fn advice_says_what_the_loop_does_with_its_numbers() {
    let mut servo = servo(&far(Support::Full), Safety { border: Some(BORDER), ..Safety::new(FREE) });
    let said = |servo: &mut Servo<Script, Fixed>, next, image: [f64; 2]| {
        servo.estimator_mut().next = next;
        servo.step(&[Some(image); 6]).advice().to_string()
    };
    let middle = [0.1, 0.0];
    assert_eq!(said(&mut servo, far(Support::Full), middle), "The loop follows 5 of 6 features.");
    servo.law_mut().twist = Twist::drive(0.2, -0.3);
    let border = said(&mut servo, far(Support::Full), [0.5, 0.0]);
    assert!(border.contains("5 of 6 features; the border of the image limits the turn"), "{border}");
    let turning = said(&mut servo, far(Support::RotationOnly), middle);
    assert!(turning.starts_with("The 6 features show no parallax, so the loop only turns"), "{turning}");
    assert!(said(&mut servo, far(Support::Several), middle).starts_with("7 poses explain the images"));
    assert!(said(&mut servo, far(Support::Unconfirmed), middle).contains("5 of 6 features, slowly"));
    let there = at([0.0; 3], [0.0; 3], Support::Full);
    (0..6).for_each(|_| drop(said(&mut servo, there, middle)));
    assert_eq!(said(&mut servo, there, middle), "The camera has arrived (5 of 6 features agree).");
    servo.safety_mut().coasting_images = 1;
    let coasting = said(&mut servo, Err(HoldReason::Jump), middle);
    assert!(coasting.contains("(6 features seen); the last command goes on"), "{coasting}");
    let helps = [
        (HoldReason::Starting, "two seconds"),
        (HoldReason::TooFewFeatures, "into view"),
        (HoldReason::Degenerate, "on a line"),
        (HoldReason::Inconsistent, "the matches and the noise"),
        (HoldReason::Jump, "the period"),
        (HoldReason::Uncertain, "spread over the image"),
        (HoldReason::Diverging, "the sign of the commands"),
        (HoldReason::Stale, "rising stamps"),
    ];
    for (k, (reason, help)) in helps.into_iter().enumerate() {
        let holding = said(&mut servo, Err(reason), middle);
        let seconds = format!("holding for {:.1} s: {reason} (6 features seen)", 0.1 * (k + 2) as f64);
        assert!(holding.contains(&seconds) && holding.contains(help), "{holding}");
    }
    servo.safety_mut().explore = 0.1;
    let still = at([0.0; 3], [0.0; 3], Support::RotationOnly);
    (0..8).for_each(|_| drop(said(&mut servo, still, middle)));
    assert_eq!(said(&mut servo, still, middle), "The loop moves a little to the side to see parallax.");
}
