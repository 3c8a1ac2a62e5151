//! NumPy's arrays: one match or one point a row.
//!
//! - `.npy`: N × 4, or N × 5 with a score; for the points of one image N × 2, also N × 1 × 2 as OpenCV has them.
//! - `.npz`: such an array, alone or named `matches`; or `x1` and `x2`, N × 2 each. `scores` may stand beside them.
//!
//! A coordinate that is NaN or infinite makes its match one without a bearing.

use std::collections::BTreeMap;

use npyz::{Deserialize, NpyFile, Order};

use super::table::{Columns, Rows};
use crate::{
    error::{Fault, Place, ReadError},
    npz::{open_npy, unpack_npz},
};

const ARRAY: &[u8] = b"\x93NUMPY";
const ARCHIVE: &[u8] = b"PK\x03\x04";

/// Whether a file begins as one of NumPy's.
pub(super) fn is_one(bytes: &[u8]) -> bool {
    [ARRAY, ARCHIVE].iter().any(|start| bytes.starts_with(start))
}

/// The rows in `bytes`, of which no array unpacked has more than `most`.
pub(super) fn parse<const N: usize>(
    place: &Place,
    bytes: &[u8],
    columns: &Columns<N>,
    most: u64,
) -> Result<Rows<N>, ReadError> {
    let array = |message| Fault::Array { message, expected: columns.expected };
    if bytes.is_empty() {
        return Err(place.clone().error(Fault::Empty));
    }
    let (table, unknown) = if bytes.starts_with(ARCHIVE) {
        of_archive(bytes, most).map_err(|message| place.clone().error(array(message)))?
    } else {
        (Table::read(bytes).map_err(|message| place.clone().error(array(message)))?, Vec::new())
    };
    let other = || array(format!("found {} rows of {} numbers", table.height(), table.width));
    columns.check(table.width, other).map_err(|fault| place.clone().error(fault))?;
    let mut rows = Rows::new(table.width > N, unknown);
    rows.values.reserve_exact(table.height());
    for (index, row) in table.values.chunks_exact(table.width).enumerate() {
        let refuse = |name, x: f64| {
            place.at_key(format!("matches[{index}].{name}")).error(Fault::NotANumber(x.to_string()))
        };
        let values = std::array::from_fn(|k| if row[k].is_finite() { row[k] } else { f64::NAN });
        rows.push(values, |k| refuse(columns.names[k], row[k]));
        if let Some(scores) = &mut rows.scores {
            let score = row[N];
            scores.push(score);
            if !score.is_finite() {
                return Err(refuse("score", score));
            }
        }
    }
    Ok(rows)
}

/// Numbers, row after row.
struct Table {
    width: usize,
    values: Vec<f64>,
}

impl Table {
    /// An array of one, two or, where the middle one has the length 1, three dimensions; of one dimension as a column.
    fn read(bytes: &[u8]) -> Result<Self, String> {
        let array = open_npy(bytes)?;
        let shape = array.shape().to_vec();
        // A header may promise more than follows it.
        let promised = shape.iter().try_fold(1_u64, |product, &n| product.checked_mul(n));
        if promised.is_none_or(|count| count > bytes.len() as u64) {
            return Err(format!("found an array of shape {shape:?} in {} bytes", bytes.len()));
        }
        let (height, width) = match shape[..] {
            [height] => (height, 1),
            [height, width] | [height, 1, width] if width > 0 => (height, width),
            _ => return Err(format!("found an array of shape {shape:?}")),
        };
        let is_by_columns = array.order() == Order::Fortran;
        let values = numbers(array)?;
        // Both are counts of values that are in memory, where there are any.
        let [height, width] = [height, width].map(|n| usize::try_from(n).unwrap_or(0));
        let values = if is_by_columns {
            (0..height).flat_map(|i| values.iter().skip(i).step_by(height).copied()).collect()
        } else {
            values
        };
        Ok(Self { width, values })
    }

    fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// Both side by side.
    fn beside(&self, other: &Self, names: [&str; 2]) -> Result<Self, String> {
        let heights = [self, other].map(Self::height);
        if heights[0] != heights[1] {
            return Err(format!(
                "found {} rows of {} and {} of {}",
                heights[0], names[0], heights[1], names[1]
            ));
        }
        let rows = self.values.chunks_exact(self.width).zip(other.values.chunks_exact(other.width));
        let values = rows.flat_map(|(a, b)| [a, b].concat()).collect();
        Ok(Self { width: self.width + other.width, values })
    }
}

/// The values of an array whatever the type of its numbers.
fn numbers(array: NpyFile<&[u8]>) -> Result<Vec<f64>, String> {
    fn read<T: Deserialize>(
        array: NpyFile<&[u8]>,
        number: fn(T) -> f64,
    ) -> Result<Result<Vec<f64>, String>, NpyFile<&[u8]>> {
        let values = array.try_data::<T>()?;
        Ok(values.map(|x| x.map(number).map_err(|e| format!("found an array that is cut: {e}"))).collect())
    }
    #[expect(clippy::cast_precision_loss, reason = "pixels")]
    let found = read::<f64>(array, |x| x)
        .or_else(|array| read::<f32>(array, f64::from))
        .or_else(|array| read::<i64>(array, |x| x as f64))
        .or_else(|array| read::<i32>(array, f64::from))
        .or_else(|array| read::<i16>(array, f64::from))
        .or_else(|array| read::<u8>(array, f64::from))
        .or_else(|array| read::<u16>(array, f64::from))
        .or_else(|array| read::<u32>(array, f64::from));
    found.unwrap_or_else(|array| Err(format!("found an array of type {}", array.dtype().descr())))
}

/// The table in an archive, and the arrays that are not known.
fn of_archive(bytes: &[u8], most: u64) -> Result<(Table, Vec<String>), String> {
    let mut arrays = unpack_npz(bytes, most).map_err(|e| format!("found no archive of NumPy's: {e}"))?;
    let names: Vec<_> = arrays.keys().cloned().collect();
    let scores = take(&mut arrays, "scores")?;
    let alone = arrays.keys().next().filter(|_| arrays.len() == 1).cloned();
    let whole = take(&mut arrays, alone.as_deref().unwrap_or("matches"))?;
    let table = match whole {
        Some(table) => table,
        None => match (take(&mut arrays, "x1")?, take(&mut arrays, "x2")?) {
            (Some(x1), Some(x2)) => x1.beside(&x2, ["x1", "x2"])?,
            _ => return Err(format!("found the arrays {}, neither matches nor x1 and x2", names.join(", "))),
        },
    };
    let table = match scores {
        Some(scores) => table.beside(&scores, ["matches", "scores"])?,
        None => table,
    };
    Ok((table, arrays.into_keys().collect()))
}

fn take(arrays: &mut BTreeMap<String, Vec<u8>>, name: &str) -> Result<Option<Table>, String> {
    let table = arrays.remove(name).as_deref().map(Table::read);
    table.transpose().map_err(|message| format!("{name}: {message}"))
}
