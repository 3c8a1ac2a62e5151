//! Why a system was not solved.

/// Why no list of solutions was returned: it would not have been the whole one.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// Fewer equations than unknowns leave a curve or more of solutions.
    #[error(
        "the system is not overdetermined enough: {equations} equations for {unknowns} unknowns{}, \
         expected at least as many; add equations",
        if *.homogeneous { " up to scale" } else { "" }
    )]
    NotOverdetermined {
        /// How many equations there are.
        equations: usize,
        /// How many numbers they have to determine: one less than there are unknowns in a homogeneous system.
        unknowns: usize,
        /// Whether every equation is homogeneous.
        homogeneous: bool,
    },
    /// The solutions, at infinity or not, are not isolated points: there are more of them at every degree.
    #[error(
        "the solutions are not isolated points (the system is not zero-dimensional, perhaps at infinity only): \
         {nullities:?} independent functionals vanish on it at degrees {degrees:?}; add equations that single out points"
    )]
    NotZeroDimensional {
        /// The degrees that were looked at.
        degrees: Vec<usize>,
        /// The nullity at each of them.
        nullities: Vec<usize>,
    },
    /// There are more solutions than the rounds of relinearisation that were allowed can tell apart.
    #[error(
        "there are more solutions than {} of relinearisation can tell apart: {found} are left at degree {degree}, \
         {told_apart} of them told apart; allow more rounds or more monomials, or add equations",
        rounds_in_words(*.rounds)
    )]
    TooManySolutions {
        /// How many rounds there were.
        rounds: usize,
        /// The degree of the last one.
        degree: usize,
        /// The nullity at that degree.
        found: usize,
        /// How many solutions were told apart: the rank of `W_0`, or the number of eigenvectors that solve the system.
        told_apart: usize,
    },
    /// The first round needs more monomials than are allowed.
    #[error(
        "the relinearised system has {monomials} monomials, more than the {limit} that are allowed; \
         raise max_monomials, or eliminate unknowns"
    )]
    TooLarge {
        /// How many monomials it has.
        monomials: usize,
        /// How many are allowed.
        limit: usize,
    },
    /// A decomposition of faer's did not converge: never seen for finite matrices.
    #[error("a matrix decomposition did not converge; scale the unknowns so that their values are near 1")]
    NoConvergence,
}

fn rounds_in_words(rounds: usize) -> String {
    if rounds == 1 { "one round".to_owned() } else { format!("{rounds} rounds") }
}
