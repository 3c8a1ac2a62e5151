//! Which vector instructions are used.

/// Vector instructions, from the slowest to the fastest.
///
/// Results agree to rounding, not to the last bit: the faster ones round a product and a sum once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Instructions {
    /// What every processor of the target has, as the compiler uses it.
    Portable,
    /// x86: AVX2 with FMA, four lanes of `f64`.
    Avx2,
    /// x86: AVX-512, eight lanes of `f64`.
    Avx512,
}

impl Instructions {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// The fastest that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().rfind(|i| i.is_available()).unwrap_or(Self::Portable)
    }

    /// Whether this processor has them.
    #[must_use]
    pub fn is_available(self) -> bool {
        self == Self::Portable
    }
}

impl Default for Instructions {
    fn default() -> Self {
        Self::best()
    }
}
