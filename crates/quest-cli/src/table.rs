//! Tables for people.

use comfy_table::{Cell, CellAlignment, LineStyle, Table, presets};

/// A table with this header and a line under it.
pub(crate) fn empty<const N: usize>(header: [&str; N]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING.header_separator(LineStyle::none().fill('─')));
    table.set_header(header);
    for (index, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, if index + 1 < N { 2 } else { 0 }));
    }
    table
}

/// A cell aligned to the right, as numbers are.
pub(crate) fn right(text: impl ToString) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

/// Three digits, with an exponent where the number is very small or large.
pub(crate) fn short(x: f64) -> String {
    match x.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e5).contains(&size) => format!("{x:.1e}"),
        size if size < 0.1 => format!("{x:.4}"),
        size if size < 10.0 => format!("{x:.3}"),
        size if size < 100.0 => format!("{x:.2}"),
        _ => format!("{x:.1}"),
    }
}

/// The number of decimals that shows four digits of a length.
pub(crate) fn decimals(length: f64) -> usize {
    if length == 0.0 {
        return 3;
    }
    (3..9).zip(3..).find(|&(n, _)| length * 10_f64.powi(n) >= 1000.0).map_or(9, |(_, n)| n)
}

/// Components with this many decimals, all of the same width.
pub(crate) fn vector(v: [f64; 3], decimals: usize) -> [String; 3] {
    let width = decimals + 3;
    v.map(|x| {
        let text = format!("{x:width$.decimals$}");
        // `-0.000` is zero.
        if text.contains(|c| ('1'..='9').contains(&c)) { text } else { text.replace('-', " ") }
    })
}

/// The angle in degrees and the unit axis of a rotation `w, x, y, z`; the identity has no axis.
pub(crate) fn angle_axis([w, x, y, z]: [f64; 4]) -> (f64, Option<[f64; 3]>) {
    let length = (x * x + y * y + z * z).sqrt();
    let angle = (2.0 * length.atan2(w)).to_degrees();
    (angle, (length > 0.0).then(|| [x, y, z].map(|v| v / length)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_three_digits() {
        let shown = [0.0, 1.234e-16, 0.012_34, 0.123_45, 1.234_5, 12.345, 123.45, 1e7].map(short);
        assert_eq!(shown, ["0", "1.2e-16", "0.0123", "0.123", "1.234", "12.35", "123.5", "1.0e7"]);
    }

    #[test]
    fn small_vectors_are_shown_with_more_decimals() {
        assert_eq!([1.0, 0.1, 0.012, 1e-5, 1e-9, 0.0].map(decimals), [3, 4, 5, 8, 9, 3]);
        assert_eq!(vector([1.0, -0.0001, 0.5], 3), [" 1.000", " 0.000", " 0.500"]);
        assert_eq!(vector([-10.0, 0.0, 0.0], 3)[0], "-10.000");
    }

    #[test]
    fn a_rotation_is_an_angle_about_an_axis() {
        let (angle, axis) = angle_axis([0.5_f64.sqrt(), 0.0, 0.5_f64.sqrt(), 0.0]);
        assert!((angle - 90.0).abs() < 1e-12);
        assert_eq!(axis, Some([0.0, 1.0, 0.0]));
        assert_eq!(angle_axis([1.0, 0.0, 0.0, 0.0]), (0.0, None));
    }
}
