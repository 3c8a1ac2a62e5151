/** A camera in COLMAP's terms. The size is needed by nothing here but is checked where it is given. */
export interface Camera {
  model:
    | "SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" | "OPENCV_FISHEYE" | "FULL_OPENCV"
    | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE"
    | "FOV" | "THIN_PRISM_FISHEYE" | "RAD_TAN_THIN_PRISM_FISHEYE" | "SIMPLE_DIVISION" | "DIVISION"
    | "SIMPLE_FISHEYE" | "FISHEYE" | "EUCM" | "EQUIRECTANGULAR";
  params: number[];
  width?: number;
  height?: number;
}

/** A name from `solvers()`. */
export type SolverName =
  | "quest" | "quest-eigen" | "relinearization" | "nister" | "stewenius" | "li-hartley" | "kukelova" | "kneip"
  | "homography" | "eight-point";

export interface EstimateOptions {
  /** The camera of view 1. Without it the matches are points on the planes z = 1. */
  camera1?: Camera;
  /** The camera of view 2: `camera1` where absent. */
  camera2?: Camera;
  /** Matches with a Sampson error below this are inliers. In pixels, 1 by default; without cameras in units of the plane z = 1. */
  threshold?: number;
  /** How sure the search is to be that it has seen a good sample: 0.9999. */
  confidence?: number;
  /** At least so many samples: 300. */
  minIterations?: number;
  /** At most so many samples: 100,000. */
  maxIterations?: number;
  /** The best pose is returned if at most so many as good as it are expected of false matches: 0.03. */
  maxFalseAlarms?: number;
  /** The same seed gives the same answer: 0. */
  seed?: number;
  /** The solver of the samples. */
  solver?: SolverName;
  /** What a match counts in the search, by how far it is off. */
  loss?: "marginalised" | "truncated";
  /** One a match, higher is better: the best matches are tried first. */
  scores?: number[];
}

/** A pose, X2 = R X1 + t. */
export interface Pose {
  /** The unit quaternion w, x, y, z with w >= 0. */
  quaternion: [number, number, number, number];
  /** The rows of the rotation matrix. */
  R: [[number, number, number], [number, number, number], [number, number, number]];
  /** The translation. The mean absolute depth over both views is 1. */
  t: [number, number, number];
  /** The length of t. */
  parallax: number;
}

export interface RunnerUp extends Pose {
  score: number;
  inlierCount: number;
}

export interface Estimate extends Pose {
  /** Points in space, a plane, or no translation that stands clear of the noise. */
  model: "general" | "planar" | "pure_rotation";
  /** Rows of the covariance of the rotation vector (radians, in the frame of camera 2) and of t. */
  covariance: number[][];
  /** Which matches agree with the pose, in the order of the matches. */
  inliers: boolean[];
  inlierCount: number;
  /** How well the pose explains all matches, from 0 to 1. */
  score: number;
  /** Samples drawn. */
  iterations: number;
  /** The second pose that the matches may mean. */
  runnerUp: RunnerUp | null;
  /** The median residual in pixels under each model; null where it could not be fitted. */
  evidence: { rotationPx: number | null; planarPx: number | null; generalPx: number | null };
  /** The standard deviation of the inliers' Sampson errors in pixels. */
  noisePx: number;
  /** The normal of the plane in view 1 over its distance, in the scale of the pose; null where the model is no plane. */
  normal: [number, number, number] | null;
  /** The share of false matches that the threshold accepts. Above some tenths the threshold is far too wide. */
  falseShare: number;
  /** Matches that were set aside because they did not move while the others did: an overlay, dirt on the lens. */
  unmoved: number;
}

export interface SolveOptions {
  camera1?: Camera;
  camera2?: Camera;
  solver?: SolverName;
  /** Every candidate, real solutions alone, or every candidate and the motions of a plane. */
  kinds?: "all" | "exact" | "planar";
}

export interface Candidate extends Pose {
  kind: "exact" | "from_complex" | "rotation_only" | "planar";
  /** The depths in both views, a pair for each match; null where undetermined. */
  depths: ([number, number] | null)[];
  /** In radians. */
  residual: number;
  /** How many matches are in front of both cameras. */
  inFront: number;
  /** Whether all are. */
  feasible: boolean;
}

export interface SolverInfo {
  name: SolverName;
  minMatches: number;
  maxCandidates: number;
  reference: string;
}

export interface ServoOptions {
  /** The camera. Without it the features are points on the plane z = 1. */
  camera?: Camera;
  /** In m/s. */
  maxSpeed: number;
  /** In rad/s. */
  maxTurnRate: number;
  /** How fast the speed may change, in m/s²: twice `maxSpeed` where absent, `Infinity` for at once. */
  maxAcceleration?: number;
  /** How fast the turn rate may change, in rad/s²: twice `maxTurnRate` where absent. */
  maxTurnAcceleration?: number;
  /** The standard deviation of a feature's coordinates, in pixels where there is a camera. */
  noise: number;
  /** How many images the goal's features are the mean of: 1. */
  goalImages?: number;
  /** Seconds from one call of `step` to the next: 0.1. */
  period?: number;
  /** About how far the features are from the goal in metres: 1. */
  unit?: number;
  /** How fast the errors decay in 1/s: 0.5. */
  rate?: number;
  /** How far the camera may move to the side where the images show no parallax, as a share of the depth: 0. */
  explore?: number;
  /** Within so many metres (with `unit`) of the goal the camera has arrived: 0.01. */
  tolerance?: number;
  /** Within so many degrees of the goal it has arrived: 0.5. */
  angleTolerance?: number;
  solver?: SolverName;
}

export interface Command {
  /** The velocity in m/s in the camera's frame: x to the right, y down, z forward. */
  linear: [number, number, number];
  /** The angular velocity in rad/s in the camera's frame. */
  angular: [number, number, number];
  /** What the loop does: "tracking", "rotation_only", "exploring", "confirming", "ambiguous", "coasting", or the reason why it holds. */
  state: string;
  /** What it does and why, with numbers, and what helps. */
  advice: string;
  /** Whether the camera is at the goal, within the tolerances, for half a second. */
  arrived: boolean;
  /** The current camera (2) relative to the goal (1), t in the unit of the run; null while the loop holds. */
  pose: Pose | null;
  /** How many features the pose rests on. */
  inliers: number;
  /** How many features the image shows. */
  seen: number;
}
