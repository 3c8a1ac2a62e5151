//! What can go wrong with a chart.

/// Why there is no chart.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// The drawing library gave up.
    #[error("drawing: {0}")]
    Drawing(String),
    /// The data of a page could not be written as JSON.
    #[error("page: {0}")]
    Json(#[from] serde_json::Error),
}
