//! Tables of Parquet, where the tool was built with the feature `parquet`.

use quest_io::WriteError;

#[cfg(feature = "parquet")]
pub(crate) use quest_io::{MatchesTable, PosesTable};

#[cfg(not(feature = "parquet"))]
pub(crate) use self::absent::{MatchesTable, PosesTable};

/// A table that was made, or why there is none, for the target with this name.
pub(crate) fn made<T>(table: std::io::Result<T>, target: &std::path::Path) -> Result<T, WriteError> {
    table.map_err(|source| WriteError { target: target.display().to_string(), source })
}

/// What stands in their place in a tool without the feature: tables of which there are none.
#[cfg(not(feature = "parquet"))]
mod absent {
    use std::io::{self, Write};

    use quest_core::Camera;
    use quest_io::{EstimateRecord, Fault};

    pub(crate) enum MatchesTable {}

    pub(crate) enum PosesTable {}

    impl MatchesTable {
        pub(crate) fn new() -> io::Result<Self> {
            Err(io::Error::other(Fault::NoParquet))
        }

        pub(crate) fn write(
            &mut self,
            _: u64,
            _: &str,
            _: [&Camera; 2],
            _: &[[f32; 4]],
            _: &mut dyn Write,
        ) -> io::Result<()> {
            match *self {}
        }

        pub(crate) fn finish(self, _: &mut dyn Write) -> io::Result<()> {
            match self {}
        }
    }

    impl PosesTable {
        pub(crate) fn new() -> io::Result<Self> {
            Err(io::Error::other(Fault::NoParquet))
        }

        pub(crate) fn write(&mut self, _: &EstimateRecord, _: &mut dyn Write) -> io::Result<()> {
            match *self {}
        }

        pub(crate) fn finish(self, _: &mut dyn Write) -> io::Result<()> {
            match self {}
        }
    }
}
