//! A run as `quest_pose.servo.Recorder` writes it: an archive of NumPy's with one row an image in every column.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use npyz::{DType, Deserialize, Order};
use serde::Deserialize as FromJson;

use crate::Failure;

/// The version of the format that is read.
const VERSION: u32 = 1;

/// Bytes of an array at most: an hour at 30 Hz with 500 features, 16 bytes each, has 0.9 GB.
const LARGEST: u64 = 2 << 30;

/// What one image showed and what came of it.
#[derive(Clone, Debug)]
pub(super) struct Image {
    /// When it was taken, in seconds since the first image.
    pub(super) time: f64,
    /// Where the goal's features are; NaN where they are not seen.
    pub(super) points: Vec<[f64; 2]>,
    /// Which of them the pose rests on, if the run says so.
    pub(super) used: Option<Vec<bool>>,
    pub(super) state: String,
    pub(super) advice: String,
    /// In m/s and rad/s, in the camera's frame.
    pub(super) linear: [f64; 3],
    pub(super) angular: [f64; 3],
    /// R and t of X2 = R X1 + t, rows of R one after the other.
    pub(super) pose: Option<([f64; 9], [f64; 3])>,
    /// How many features the pose rests on.
    pub(super) inliers: Option<f64>,
    pub(super) residual: Option<f64>,
}

impl Image {
    /// How many features are seen.
    pub(super) fn seen(&self) -> usize {
        self.points.iter().filter(|p| p.iter().all(|x| x.is_finite())).count()
    }
}

/// A whole run.
#[derive(Clone, Debug)]
pub(super) struct Recorded {
    /// Width and height of the image; none where features are points on the plane z = 1.
    pub(super) size: Option<[f64; 2]>,
    pub(super) goal: Vec<[f64; 2]>,
    pub(super) images: Vec<Image>,
}

/// The words of a run, which an archive has no columns for.
#[derive(Debug, Default, FromJson)]
struct About {
    version: u32,
    size: Option<[f64; 2]>,
    #[serde(default)]
    state: Vec<String>,
    #[serde(default)]
    advice: Vec<String>,
}

/// Reads a run.
///
/// # Errors
/// What is wrong with the file: the column, what was found and what was expected.
pub(super) fn read(path: &Path) -> Result<Recorded, Failure> {
    let fail = |fault: String| Failure::Arguments(format!("{}: {fault}", path.display()));
    if path.extension().is_some_and(|e| e == "parquet") {
        return Err(fail(
            "found Parquet, expected .npz: write both with Recorder.save(\"run.npz\")".to_owned(),
        ));
    }
    let bytes = fs::read(path).map_err(|e| fail(format!("cannot be read: {e}")))?;
    Columns::read(&bytes).and_then(|columns| columns.run()).map_err(fail)
}

/// An array: its shape and its numbers, row after row.
type Array<T> = (Vec<u64>, Vec<T>);

/// The arrays of an archive by name.
struct Columns(BTreeMap<String, Vec<u8>>);

impl Columns {
    fn read(bytes: &[u8]) -> Result<Self, String> {
        let arrays = quest_io::unpack_npz(bytes, LARGEST)
            .map_err(|e| format!("{e}, expected an archive that quest_pose.servo.Recorder wrote"))?;
        Ok(Self(arrays))
    }

    /// A column and its shape; none where the run has no such column.
    fn optional<T: Deserialize>(&self, name: &str) -> Result<Option<Array<T>>, String> {
        let Some(bytes) = self.0.get(name) else { return Ok(None) };
        let array = quest_io::open_npy(bytes).map_err(|e| format!("{name}: {e}"))?;
        let (shape, dtype) = (array.shape().to_vec(), array.dtype());
        // A header may promise more than follows it.
        if array.order() != Order::C || array.len() > bytes.len() as u64 {
            return Err(format!("{name} has the shape {shape:?} in {} bytes, expected rows", bytes.len()));
        }
        let values = array.into_vec().map_err(|_| format!("{name}: found {}", named(&dtype)))?;
        Ok(Some((shape, values)))
    }

    fn required<T: Deserialize>(&self, name: &str) -> Result<Array<T>, String> {
        self.optional(name)?.ok_or_else(|| format!("has no column {name}, expected what Recorder writes"))
    }

    /// A column of `images` rows of `N` numbers; `None` for rows with NaN.
    fn rows<const N: usize>(
        &self,
        name: &str,
        images: usize,
    ) -> Result<Option<Vec<Option<[f64; N]>>>, String> {
        let Some((shape, values)) = self.optional::<f64>(name)? else { return Ok(None) };
        let (rows, rest) = values.as_chunks::<N>();
        if rows.len() != images || !rest.is_empty() {
            return Err(format!("{name} has the shape {shape:?}, expected {images} rows of {N} numbers"));
        }
        Ok(Some(rows.iter().map(|r| r.iter().all(|x| x.is_finite()).then_some(*r)).collect()))
    }

    fn run(&self) -> Result<Recorded, String> {
        let (_, text) = self.required::<u8>("about")?;
        let about: About = serde_json::from_slice(&text).map_err(|e| format!("about: {e}"))?;
        if about.version != VERSION {
            return Err(format!("found version {}, expected {VERSION}", about.version));
        }
        let goal = self.required::<f64>("goal")?.1.as_chunks::<2>().0.to_vec();
        let (_, stamps) = self.required::<f64>("stamp")?;
        let count = stamps.len();
        let points = self.points(count, goal.len())?;
        let used = self.used(count, goal.len())?;
        let state = self.words("state", &about.state, count)?;
        let advice = self.words("advice", &about.advice, count)?;
        let (linear, angular) = (self.rows::<3>("linear", count)?, self.rows::<3>("angular", count)?);
        let (r, t) = (self.rows::<9>("R", count)?, self.rows::<3>("t", count)?);
        let (inliers, residual) = (self.rows::<1>("inliers", count)?, self.rows::<1>("residual", count)?);
        let first = stamps.first().copied().unwrap_or(0.0);
        let images = points.into_iter().enumerate().map(|(k, points)| Image {
            time: stamps[k] - first,
            points,
            used: used.as_ref().map(|u| u[k].clone()),
            state: state[k].clone(),
            advice: advice[k].clone(),
            linear: of(linear.as_ref(), k).unwrap_or_default(),
            angular: of(angular.as_ref(), k).unwrap_or_default(),
            pose: of(r.as_ref(), k).zip(of(t.as_ref(), k)),
            inliers: of(inliers.as_ref(), k).map(|[n]| n),
            residual: of(residual.as_ref(), k).map(|[r]| r),
        });
        Ok(Recorded { size: about.size, goal, images: images.collect() })
    }

    fn points(&self, images: usize, features: usize) -> Result<Vec<Vec<[f64; 2]>>, String> {
        let (shape, values) = self.required::<f64>("points")?;
        if shape != [images as u64, features as u64, 2] {
            return Err(format!("points has the shape {shape:?}, expected ({images}, {features}, 2)"));
        }
        let pairs = values.as_chunks::<2>().0;
        Ok((0..images).map(|k| pairs[k * features..(k + 1) * features].to_vec()).collect())
    }

    fn used(&self, images: usize, features: usize) -> Result<Option<Vec<Vec<bool>>>, String> {
        let Some((shape, values)) = self.optional::<bool>("inlier_mask")? else { return Ok(None) };
        if shape != [images as u64, features as u64] {
            return Err(format!("inlier_mask has the shape {shape:?}, expected ({images}, {features})"));
        }
        Ok(Some((0..images).map(|k| values[k * features..(k + 1) * features].to_vec()).collect()))
    }

    /// A word for each image, by its number in the list of `about`.
    fn words(&self, name: &str, list: &[String], images: usize) -> Result<Vec<String>, String> {
        let Some((_, numbers)) = self.optional::<i32>(name)? else { return Ok(vec![String::new(); images]) };
        let word = |n: &i32| usize::try_from(*n).ok().and_then(|n| list.get(n)).cloned();
        let words: Option<Vec<String>> = numbers.iter().map(word).collect();
        words
            .filter(|w| w.len() == images)
            .ok_or_else(|| format!("{name} has words that about does not list, or not {images} of them"))
    }
}

/// Row `k` of a column that may be absent.
fn of<T: Copy>(column: Option<&Vec<Option<T>>>, k: usize) -> Option<T> {
    column.and_then(|c| c[k])
}

fn named(dtype: &DType) -> String {
    format!("an array of {}", dtype.descr())
}
