//! A page: one HTML file that needs nothing else.

use crate::{Figure, PlotError, Space, html};

/// What is on the page, from top to bottom.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Item {
    Figure(Figure),
    Space(Space),
    /// The caption, the header and the rows. The first column is aligned to the left.
    Table(String, Vec<Vec<String>>),
}

/// A page with figures, spaces and tables.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    pub(crate) title: String,
    pub(crate) introduction: String,
    pub(crate) items: Vec<Item>,
}

impl Page {
    /// A page without figures.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// The text below the title: the command, the seed. Plain text.
    #[must_use]
    pub fn introduction(self, introduction: impl Into<String>) -> Self {
        Self { introduction: introduction.into(), ..self }
    }

    /// Adds a figure.
    #[must_use]
    pub fn figure(self, figure: Figure) -> Self {
        self.with(Item::Figure(figure))
    }

    /// Adds a space.
    #[must_use]
    pub fn space(self, space: Space) -> Self {
        self.with(Item::Space(space))
    }

    /// Adds a table: its first row is the header.
    #[must_use]
    pub fn table(self, caption: impl Into<String>, rows: Vec<Vec<String>>) -> Self {
        self.with(Item::Table(caption.into(), rows))
    }

    fn with(mut self, item: Item) -> Self {
        self.items.push(item);
        self
    }

    /// The page. It has about 5 MB, nearly all of which is plotly.js, so it works without a network.
    ///
    /// # Errors
    /// [`PlotError::Json`] where the data cannot be written.
    pub fn to_html(&self) -> Result<String, PlotError> {
        html::page(self)
    }
}
