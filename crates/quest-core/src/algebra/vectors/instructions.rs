//! Which vector instructions are used, and how a task is run with them.

use std::ffi::OsStr;
use std::sync::OnceLock;

#[cfg(target_arch = "x86_64")]
use pulp::{
    Simd, WithSimd,
    x86::{V1, V3, V4},
};

use crate::algebra::vectors::lane::{Lanes, WordLanes};
use crate::algebra::vectors::portable::Portable;
#[cfg(target_arch = "x86_64")]
use crate::algebra::vectors::sse2::Sse2;
#[cfg(target_arch = "x86_64")]
use crate::algebra::vectors::vector::{Align32, Align64, Vector};

/// Vector instructions, from the slowest to the fastest.
///
/// Results agree to rounding, not to the last bit: the faster ones round a product and a sum once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Instructions {
    /// What every processor of the target has, as the compiler uses it.
    Portable,
    /// x86: SSE2, two lanes of `f64`. Every x86-64 has it.
    Sse2,
    /// x86: AVX2 with FMA, four lanes of `f64`.
    Avx2,
    /// x86: AVX-512, eight lanes of `f64`.
    Avx512,
}

impl Instructions {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Portable, Self::Sse2, Self::Avx2, Self::Avx512];

    /// The environment variable that names the instructions to be used instead of the fastest, so that the answers of another
    /// processor can be had on this one. It is read once.
    pub const VARIABLE: &'static str = "QUEST_INSTRUCTIONS";

    /// Its name in [`VARIABLE`](Self::VARIABLE).
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Sse2 => "sse2",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// Those that [`VARIABLE`](Self::VARIABLE) names; the fastest where it is not set.
    ///
    /// # Errors
    /// [`UnknownInstructions`] where it names none that this processor has. What cannot tell of errors uses the fastest then.
    pub fn chosen() -> Result<Self, UnknownInstructions> {
        static CHOSEN: OnceLock<Result<Instructions, UnknownInstructions>> = OnceLock::new();
        CHOSEN
            .get_or_init(|| {
                std::env::var_os(Self::VARIABLE).map_or_else(|| Ok(Self::best()), |found| named(&found))
            })
            .clone()
    }

    /// The fastest that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().rfind(|i| i.is_available()).unwrap_or(Self::Portable)
    }

    /// Whether this processor has them.
    #[must_use]
    pub fn is_available(self) -> bool {
        Token::new(self).is_some()
    }
}

impl Default for Instructions {
    /// Those that were [chosen](Self::chosen), or the fastest.
    fn default() -> Self {
        Self::chosen().unwrap_or_else(|_| Self::best())
    }
}

/// [`Instructions::VARIABLE`] names no instructions that this processor has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} is {found:?}, expected one of {}", Instructions::VARIABLE, available())]
pub struct UnknownInstructions {
    /// What it is.
    pub found: String,
}

fn named(found: &OsStr) -> Result<Instructions, UnknownInstructions> {
    let named = Instructions::ALL.into_iter().find(|i| i.is_available() && found == i.name());
    named.ok_or_else(|| UnknownInstructions { found: found.to_string_lossy().into_owned() })
}

fn available() -> String {
    let names = Instructions::ALL.into_iter().filter(|i| i.is_available()).map(Instructions::name);
    names.collect::<Vec<_>>().join(", ")
}

/// Work that can be done with any lanes. What it calls has to be inlined: a function of its own would be compiled
/// for the instructions that every processor has.
pub(crate) trait Task {
    /// What comes out.
    type Output;

    /// Does it.
    fn run<L: WordLanes + Lanes<f32>>(self, lanes: L) -> Self::Output;
}

/// Instructions that the processor is known to have.
#[derive(Clone, Copy, Debug)]
pub enum Token {
    /// None in particular.
    Portable,
    #[cfg(target_arch = "x86_64")]
    Sse2(V1),
    #[cfg(target_arch = "x86_64")]
    Avx2(V3),
    #[cfg(target_arch = "x86_64")]
    Avx512(V4),
}

impl Token {
    /// The proof that the processor has these instructions, if it does.
    pub(crate) fn new(instructions: Instructions) -> Option<Self> {
        match instructions {
            Instructions::Portable => Some(Self::Portable),
            #[cfg(target_arch = "x86_64")]
            Instructions::Sse2 => V1::try_new().map(Self::Sse2),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => V3::try_new().map(Self::Avx2),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => V4::try_new().map(Self::Avx512),
            #[cfg(not(target_arch = "x86_64"))]
            _ => None,
        }
    }

    /// That of the instructions that were chosen, or of the fastest.
    pub(crate) fn chosen() -> Self {
        Self::new(Instructions::default()).unwrap_or(Self::Portable)
    }

    /// Runs a task.
    #[inline]
    pub(crate) fn run<K: Task>(self, task: K) -> K::Output {
        match self {
            Self::Portable => in_own_frame(task, Portable),
            #[cfg(target_arch = "x86_64")]
            Self::Sse2(simd) => in_own_frame(task, Sse2(simd)),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(simd) => Simd::vectorize(simd, Adapter::<_, Align32>(task, [])),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(simd) => Simd::vectorize(simd, Adapter::<_, Align64>(task, [])),
        }
    }

    /// What it is the proof of.
    pub(crate) fn instructions(self) -> Instructions {
        match self {
            Self::Portable => Instructions::Portable,
            #[cfg(target_arch = "x86_64")]
            Self::Sse2(_) => Instructions::Sse2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(_) => Instructions::Avx2,
            #[cfg(target_arch = "x86_64")]
            Self::Avx512(_) => Instructions::Avx512,
        }
    }
}

/// Runs a task where its variables lie on the stack only while it runs. Without optimisation all of them have a place of their own, in the
/// solver of samples a megabyte for each kind of lanes, and a thread has two.
#[inline(never)]
fn in_own_frame<K: Task, L: WordLanes + Lanes<f32>>(task: K, lanes: L) -> K::Output {
    task.run(lanes)
}

/// A task in the form that pulp runs.
#[cfg(target_arch = "x86_64")]
struct Adapter<K, A>(K, [A; 0]);

#[cfg(target_arch = "x86_64")]
impl<K: Task, A: Copy> WithSimd for Adapter<K, A> {
    type Output = K::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> K::Output {
        self.0.run(Vector::<S, A>::new(simd))
    }
}
