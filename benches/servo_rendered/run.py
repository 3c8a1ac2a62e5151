"""Closed loops: python run.py RUNS.jsonl --scenes general --front sift --methods servo,poselib --starts 0:20"""

import argparse
import json
import time

import cv2
import numpy as np
import scenes
from methods import METHODS, PERIOD

from quest_pose.servo import GoalImage

# The detector of a front end, and whether matches are refined by the goal image: as ``GoalImage`` does it, or not.
FRONTS = {
    "sift": ("sift", True), "orb": ("orb", True), "sift-raw": ("sift", False), "orb-raw": ("orb", False),
    "klt": ("sift", True), "klt-raw": ("sift", False),
}  # fmt: skip
MOST = 250
ACCURATE = 0.02 * scenes.DEPTH, 1.0
CLOSE = 0.05 * scenes.DEPTH, 3.0


class Tracked:
    """The first image's matches that agree with one essential matrix, tracked from image to image; what is lost stays lost.

    ``refines``: each track is moved to where the goal's patch is, or followed as it is.
    """

    def __init__(self, goal, image, refines):
        self.last, self.rows = image, goal.match(image)
        self.refine = goal.refine if refines else None
        seen = np.flatnonzero(np.isfinite(self.rows[:, 0]))
        _, mask = cv2.findEssentialMat(goal.points[seen], self.rows[seen], scenes.K, cv2.USAC_MAGSAC, 0.9999, 1.0)
        self.rows[seen[mask.ravel() == 0]] = np.nan

    def match(self, image):
        seen = np.isfinite(self.rows[:, 0])
        if seen.any():
            options = {"winSize": (15, 15), "maxLevel": 3}
            before = self.rows[seen].astype(np.float32)[:, None]
            now, found, _ = cv2.calcOpticalFlowPyrLK(self.last, image, before, None, **options)
            back, found_back, _ = cv2.calcOpticalFlowPyrLK(image, self.last, now, None, **options)
            good = (found.ravel() == 1) & (found_back.ravel() == 1) & (np.linalg.norm((before - back)[:, 0], axis=1) < 0.7)
            rows = now[:, 0].astype(float)
            outside = (rows < 1).any(1) | (rows[:, 0] > scenes.WIDTH - 2) | (rows[:, 1] > scenes.HEIGHT - 2)
            rows[~good | outside] = np.nan
            self.rows[seen] = rows
            if self.refine is not None:
                self.rows = self.refine(image, self.rows)
        self.last = image
        return self.rows.copy()


def loop(scene, R, p, matcher, method):
    """The run as a record."""
    waiting = [(np.zeros(3), np.zeros(3))]  # the command of an image acts one image later
    speeds, states, used, times, path = [], [], [], [], []
    done = False
    for _ in range(MOST):
        rows = matcher.match(scene.image(R, p))
        began = time.process_time()
        linear, angular, state, count = method.step(rows)
        times.append(time.process_time() - began)
        states.append(state)
        used.append(int(count))
        path.append((float(np.linalg.norm(p)), float(np.degrees(np.linalg.norm(scenes.logarithm(R))))))
        moving = state in ("tracking", "rotation_only")
        speeds.append((np.linalg.norm(linear), np.linalg.norm(angular)) if moving else (9, 9))
        if len(speeds) > 15 and (np.mean(speeds[-15:], 0) < (0.004, 0.006)).all():
            done = True
            break
        if path[-1][0] > 2.5:
            break
        waiting.append((linear, angular))
        linear, angular = waiting.pop(0)
        p = p + R @ scenes.rotation(angular * PERIOD / 2) @ linear * PERIOD
        R = R @ scenes.rotation(angular * PERIOD)
    return {
        "outcome": outcome(path[-1], states, used, done), "cm": 100 * path[-1][0], "deg": path[-1][1], "images": len(states),
        "states": {s: states.count(s) for s in set(states)}, "ms": 1e3 * float(np.median(times)), "ms_max": 1e3 * max(times),
        "farthest": 100 * max(q[0] for q in path), "path": [(round(a, 4), round(b, 2)) for a, b in path[::5]],
    }  # fmt: skip


def outcome(end, states, used, done):
    """What became of a run, in a word or two."""
    if end[0] < ACCURATE[0] and end[1] < ACCURATE[1]:
        return "arrived"
    if done:
        return "inaccurate" if end[0] < CLOSE[0] and end[1] < CLOSE[1] else "stops elsewhere"
    if end[0] > 2:
        return "drove away"
    holds = [s for s in states if s not in ("tracking", "rotation_only", "exploring")]
    if len(holds) == len(states):
        return "never started"
    if np.median(used[-20:]) < 6:
        return "features lost"
    return "close" if end[0] < CLOSE[0] and end[1] < CLOSE[1] else "not there in time"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output")
    parser.add_argument("--scenes", default="general")
    parser.add_argument("--front", default="sift", choices=FRONTS)
    parser.add_argument("--methods", default="servo,poselib,homography,ibvs")
    parser.add_argument("--starts", default="0:4")
    given = parser.parse_args()
    first, last = (int(x) for x in given.starts.split(":"))
    for number in range(first, last):
        for kind in given.scenes.split(","):
            scene = scenes.Scene(kind, number // 4)
            R, p = scenes.start(1000 + number)
            detector, refines = FRONTS[given.front]
            image = scene.image(np.eye(3), np.zeros(3))
            goal = GoalImage(image, scenes.CAMERA, detector=detector, refine=refines)
            depths = goal.depths(scene.depth(np.eye(3), np.zeros(3)))
            begin = {"scene": kind, "front": given.front, "start": number, "cm0": 100 * float(np.linalg.norm(p))}
            begin["deg0"] = float(np.degrees(np.linalg.norm(scenes.logarithm(R))))
            for name in given.methods.split(","):
                scene.noise = np.random.default_rng(77 + number)
                matcher = Tracked(goal, scene.image(R, p), refines) if given.front.startswith("klt") else goal
                record = {**begin, "method": name, **loop(scene, R, p, matcher, METHODS[name](goal, depths))}
                with open(given.output, "a") as file:
                    file.write(json.dumps(record) + "\n")
                print(kind, number, name, record["outcome"], f"{record['cm']:.2f} cm {record['deg']:.2f} deg", record["states"], flush=True)
            scene.renderer.close()


if __name__ == "__main__":
    main()
