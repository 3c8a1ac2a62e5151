//! Colours: one for each solver, the same in every chart, told apart by people with red-green blindness too.

/// Red, green and blue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub u8, pub u8, pub u8);

impl Colour {
    /// `#rrggbb`.
    #[must_use]
    pub fn hex(self) -> String {
        format!("#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

/// Text and axes.
pub const INK: Colour = Colour(0x1f, 0x29, 0x37);
/// Text of less weight.
pub const MUTED: Colour = Colour(0x6b, 0x72, 0x80);
/// Lines of the grid.
pub const GRID: Colour = Colour(0xe5, 0xe7, 0xeb);

/// Colours for everything that has no colour of its own: Paul Tol's "muted" scheme.
const PALETTE: [Colour; 9] = [
    Colour(0x33, 0x22, 0x88),
    Colour(0xcc, 0x66, 0x77),
    Colour(0x11, 0x77, 0x33),
    Colour(0xbf, 0x9b, 0x2f),
    Colour(0x55, 0xa7, 0xd1),
    Colour(0xaa, 0x44, 0x99),
    Colour(0x44, 0xaa, 0x99),
    Colour(0x88, 0x22, 0x55),
    Colour(0x99, 0x99, 0x33),
];

/// The colours of the solvers by name.
const SOLVERS: [(&str, Colour); 10] = [
    ("quest", Colour(0xd6, 0x1f, 0x3a)),
    ("quest-eigen", Colour(0xf0, 0x8a, 0x24)),
    ("relinearization", Colour(0x7b, 0x4f, 0xc9)),
    ("nister", Colour(0x1f, 0x6f, 0xb4)),
    ("stewenius", Colour(0x1b, 0x8a, 0x5a)),
    ("li-hartley", Colour(0x5c, 0xb8, 0xe6)),
    ("kukelova", Colour(0x8c, 0x64, 0x3c)),
    ("kneip", Colour(0xd9, 0x6a, 0xb8)),
    ("homography", Colour(0x11, 0x18, 0x27)),
    ("eight-point", Colour(0x9c, 0xa3, 0xaf)),
];

/// The colour of a solver; a name that is not known gets one that depends on the name alone.
#[must_use]
pub fn of_solver(name: &str) -> Colour {
    let known = SOLVERS.iter().find(|(known, _)| *known == name);
    known.map_or_else(|| nth(name.bytes().map(usize::from).sum()), |(_, colour)| *colour)
}

/// The colour number `index` of a palette that repeats after nine.
#[must_use]
pub fn nth(index: usize) -> Colour {
    PALETTE[index % PALETTE.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_solvers_share_a_colour() {
        for (index, (name, colour)) in SOLVERS.iter().enumerate() {
            assert_eq!(of_solver(name), *colour);
            assert!(SOLVERS[..index].iter().all(|(_, other)| other != colour));
        }
        assert_eq!(of_solver("another"), of_solver("another"));
        assert_eq!(Colour(1, 0xab, 255).hex(), "#01abff");
    }
}
