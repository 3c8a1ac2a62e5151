//! A control law of one's own: it turns towards the goal's orientation first, and moves once it nearly has it.
#![expect(clippy::print_stdout, reason = "an example shows what it finds")]

use quest_core::RelativePose;
use quest_core::servo::{ControlLaw, DepthFilter, Limits, Safety, Servo, Twist, scenario};
use quest_core::solver::SolverName;

struct TurnThenMove {
    /// The share of the way that is made in a second.
    rate: f64,
    /// Metres in a unit of `t_21`.
    unit: f64,
}

impl ControlLaw for TurnThenMove {
    fn command(&mut self, pose: &RelativePose) -> Twist {
        // `t_21` points from the camera to the goal, in the camera's frame; the logarithm is the turn that is left.
        let turn = pose.q_21.scaled_axis();
        let share = (1.0 - turn.norm() / 0.2).clamp(0.0, 1.0);
        Twist { linear: pose.t_21 * (self.rate * self.unit * share), angular: turn * self.rate }
    }
}

fn main() {
    let (world, mut camera) = scenario::paper();
    let mut rng = scenario::generator(1, 0);
    let goal = world.on_plane(&world.goal_pixels(&mut rng));
    let limits = Limits { speed: 0.3, turn_rate: 0.5 };
    let filter = DepthFilter::new(&goal, SolverName::Quest, world.filter_options(&limits, 2.0));
    let law = TurnThenMove { rate: 1.0, unit: 2.0 };
    let mut servo = Servo::new(&goal, filter, law, Safety::new(limits));

    world.run(&mut camera, &mut servo, 300, &mut rng, |record| {
        if record.time.fract() < world.period / 2.0 {
            let distance = record.truth.t_21.norm();
            println!("{:4.0} s: {distance:.3} m from the goal", record.time);
        }
        true
    });
}
