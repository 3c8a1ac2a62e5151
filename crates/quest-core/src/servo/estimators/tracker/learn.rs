//! The map learns: key images, steps of the adjustment, planes.

use crate::servo::estimators::source::PoseSource;
use crate::servo::estimators::tracker::adjust::Survey;
use crate::servo::estimators::tracker::map::PLANE_RELIEF;
use crate::servo::estimators::tracker::resection::{INLIER, KNEE, Task, bounded, residuals};
use crate::servo::estimators::tracker::{Phase, Tracker};

/// A key image is this far from all others and from the goal, in the unit of the depths. Near the goal there are none, so that the
/// map cannot drift there.
const KEY_DISTANCE: f64 = 0.04;
/// With more features than this an image gives time to one map alone, for a step or a judgement. With a thousand features each of
/// these takes about a millisecond.
const MANY: usize = 100;
/// A depth known so well counts in the question whether the scene is a plane.
const WELL_KNOWN: f64 = 0.01;
/// Evidence for a plane that is acted on: odds of 1 to 20,000.
const EVIDENCE: f64 = 20.0;
/// Features off the map but on their epipolar lines.
const OFF: f64 = 12.0;
const ON_LINE: f64 = 6.0;

impl<S: PoseSource> Tracker<S> {
    /// What an accepted image teaches.
    pub(super) fn learn(&mut self) {
        if self.phase != Phase::Mapped {
            return;
        }
        self.watch_for_relief();
        self.add_key_image();
        self.doubt();
        let task = self.task();
        for k in 0..self.count {
            let map = &self.hypotheses[k].map;
            if map.steps_left > 0 || map.is_to_be_judged {
                self.adjust(k, &task);
                // Many features: one map an image.
                if self.goal.len() > MANY {
                    break;
                }
            }
        }
    }

    /// One step of a map, or its judgement. With few features the last step and the judgement share an image.
    fn adjust(&mut self, k: usize, task: &Task) {
        let noise = self.start.noise_share();
        let survey = Self::survey(&self.goal, &self.known, &self.keys[..self.key_count], task);
        let map = &mut self.hypotheses[k].map;
        if map.steps_left > 0 {
            let is_settled = self.workspace.settle(map, &survey);
            map.steps_left -= 1;
            if is_settled {
                map.steps_left = 0;
            }
            map.is_to_be_judged = map.steps_left == 0;
            // Before that the old answer stands, unless there is none.
            let is_known = map.adequacy.is_finite();
            if (!map.is_to_be_judged || self.goal.len() > MANY) && is_known {
                return;
            }
        }
        self.workspace.judge(map, &Survey { noise, ..survey });
        if std::mem::take(&mut map.is_to_be_judged) {
            self.reconsider_plane(k);
        }
    }

    /// Takes the image as a key image if it is from somewhere new.
    fn add_key_image(&mut self) {
        let first = &self.hypotheses[0];
        let Some(covariance) = first.fit.and_then(|fit| fit.covariance()) else { return };
        let deviation = (3..6).map(|k| covariance[(k, k)]).sum::<f64>().sqrt();
        if first.pose.t_21.norm() < KEY_DISTANCE + 3.0 * deviation || first.map.keys.len() != self.key_count {
            return;
        }
        let centre = first.pose.inverse().t_21;
        let centres = |k: usize| first.map.keys[k].inverse().t_21;
        if (0..self.key_count).any(|k| (centres(k) - centre).norm() < KEY_DISTANCE) {
            return;
        }
        let slot = if self.key_count < self.keys.len() {
            self.key_count
        } else {
            // That which is nearest to another one, and to the goal; never the mean of the first images.
            let crowded = |k: usize| {
                let others =
                    (0..self.key_count).filter(|j| *j != k).map(|j| (centres(j) - centres(k)).norm());
                others.fold(f64::INFINITY, f64::min) + 0.3 * centres(k).norm()
            };
            let least = (1..self.key_count).min_by(|a, b| crowded(*a).total_cmp(&crowded(*b)));
            let Some(slot) = least else { return };
            slot
        };
        self.keys[slot].frame.copy_from_slice(&self.frame);
        self.keys[slot].variance = self.options.noise.powi(2);
        self.key_count = self.key_count.max(slot + 1);
        self.doubt.begin();
        for h in &mut self.hypotheses[..self.count] {
            if slot == h.map.keys.len() {
                h.map.keys.push(h.pose);
            } else {
                h.map.keys[slot] = h.pose;
            }
            h.map.unsettle(1e-4);
        }
    }

    /// Whether a settled map's depths are those of a plane, or a plane's map does not fit its images.
    fn reconsider_plane(&mut self, k: usize) {
        let relief = self.options.spread;
        let Self { hypotheses, workspace, goal, known, .. } = self;
        let h = &mut hypotheses[k];
        if h.map.is_planar() {
            let pairs = self.keys[..self.key_count]
                .iter()
                .map(|key| key.frame.iter().flatten().count())
                .sum::<usize>();
            let freedom = (2 * pairs).saturating_sub(6 * self.key_count).max(1) as f64;
            if h.map.cost > 2.0 * freedom {
                give_relief(h, relief);
            }
            return;
        }
        let (mut evidence, mut chi, mut well, mut all) = (0.0, 0.0, 0usize, 0usize);
        for (i, point) in h.map.points.iter().enumerate() {
            if !workspace.features[i].is_used || known[i].is_some() {
                continue;
            }
            all += 1;
            // Given the poses; at most what it was before.
            let p = workspace.features[i].inverse[5];
            if p >= WELL_KNOWN {
                continue;
            }
            well += 1;
            let off = (point.rho - h.map.on_plane(goal[i])).powi(2);
            let on_plane = bounded(off / (p + PLANE_RELIEF.powi(2)), KNEE);
            let wide = p + relief * relief;
            evidence += (wide / (p + PLANE_RELIEF.powi(2))).ln() - on_plane + off / wide;
            chi += on_plane;
        }
        let enough = well >= 7 && 10 * well >= 6 * all && evidence > EVIDENCE && chi < 2.0 * well as f64;
        if enough && !h.is_relief {
            h.map.relief = PLANE_RELIEF;
            h.map.unsettle(1e-3);
        }
    }

    /// Features that are off a plane's map but on their epipolar lines say that the scene is no plane.
    fn watch_for_relief(&mut self) {
        let task = Task { depth_variance: Some(self.options.spread.powi(2)), ..self.task() };
        for h in &mut self.hypotheses[..self.count] {
            let Some(fit) = h.fit.filter(|_| h.map.is_planar()) else { continue };
            let off = h.squares.iter().filter(|s| **s > OFF).count();
            let enough = 2.max(8 * fit.seen / 100);
            let mut is_off = false;
            if off > enough {
                residuals(&h.map.points, &self.frame, &h.pose, &task, &mut self.squares);
                let both =
                    h.squares.iter().zip(&self.squares).filter(|(s, line)| **s > OFF && **line < ON_LINE);
                is_off = both.count() > enough;
            }
            h.off_map += 0.2 * (f64::from(u8::from(is_off)) - h.off_map);
            if h.off_map > 0.5 {
                give_relief(h, self.options.spread);
            }
        }
    }
}

/// A plane becomes a scene with relief, for good.
fn give_relief(h: &mut super::Hypothesis, relief: f64) {
    h.map.relief = relief;
    (h.is_relief, h.off_map) = (true, 0.0);
    h.map.points.iter_mut().for_each(|p| p.variance = relief * relief);
    h.map.unsettle(1e-3);
    debug_assert!(relief > PLANE_RELIEF && INLIER > OFF);
}
