//! The charts of `quest-cli`: a figure of a few panels as SVG, and pages that work offline, with charts to zoom into and
//! scenes to turn.
//!
//! ```
//! use quest_plot::{Axis, Figure, Page, Panel, Series, colour};
//!
//! let error = Series::line("nister", vec![[0.0, 0.01], [1.0, 0.02]]).coloured(colour::of_solver("nister"));
//! let panel = Panel::new("Rotation", Axis::linear("noise, px"), Axis::log("error, rad")).with(error);
//! let figure = Figure::new("Errors under noise").row([panel]);
//!
//! let svg = quest_plot::to_svg(&[figure.clone()])?;
//! let html = Page::new("Errors").figure(figure).to_html()?;
//! # Ok::<(), quest_plot::PlotError>(())
//! ```
//!
//! With the feature `figures` a drawing is also PNG (`to_png`) or PDF (`to_pdf`).
//!
//! A [`Figure`] is a grid of [`Panel`]s; a panel has two [`Axis`] and some [`Series`], each with a direct label at its end.
//! A [`Space`] is a scene in three dimensions whose parts are switched on and off; it is also written as PLY. Series, and parts of a space, with the same
//! name are one entry of the page's legend.
#![forbid(unsafe_code)]

mod axis;
pub mod colour;
mod error;
mod figure;
mod html;
mod label;
mod page;
#[cfg(feature = "figures")]
mod picture;
mod ply;
mod space;
mod svg;

pub use axis::{Axis, Scale};
pub use colour::Colour;
pub use error::PlotError;
pub use figure::{Figure, Panel, Series, Style};
pub use page::Page;
#[cfg(feature = "figures")]
pub use picture::{to_pdf, to_png};
pub use space::{Part, Projection, Space};
pub use svg::to_svg;
