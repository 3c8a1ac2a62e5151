//! Where figures are drawn, and how.

use std::path::{Path, PathBuf};

use quest_io::Output;

use crate::Failure;

/// The file of a figure.
#[derive(Clone, Debug)]
pub(crate) struct Plot {
    path: PathBuf,
    form: Form,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Svg,
    Png,
    Pdf,
    /// A page that works offline.
    Html,
}

/// The file of this name, whose extension says how it is drawn.
pub(crate) fn parse_plot(text: &str) -> Result<Plot, String> {
    let path = PathBuf::from(text);
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    let form = match extension.as_deref() {
        Some("svg") => Form::Svg,
        Some("png") => Form::Png,
        Some("pdf") => Form::Pdf,
        Some("html" | "htm") => Form::Html,
        _ => return Err("expected a name that ends with .svg, .png, .pdf or .html".to_owned()),
    };
    if matches!(form, Form::Png | Form::Pdf) && !cfg!(feature = "figures") {
        let message = "this build draws .svg and .html alone; .png and .pdf: cargo install quest-cli --features figures";
        return Err(message.to_owned());
    }
    Ok(Plot { path, form })
}

impl Plot {
    /// The file, found writable.
    pub(crate) fn open(&self) -> Result<Output, Failure> {
        Ok(Output::open(Some(Path::new(&self.path)))?)
    }

    /// Whether the text of the figure is SVG; else it is a page.
    pub(crate) fn is_svg(&self) -> bool {
        self.form != Form::Html
    }

    /// Writes the figure, whose text is as [`is_svg`](Self::is_svg) says.
    pub(crate) fn write(&self, mut file: Output, text: String) -> Result<(), Failure> {
        let bytes = match self.form {
            #[cfg(feature = "figures")]
            Form::Png => quest_plot::to_png(&text)?,
            #[cfg(feature = "figures")]
            Form::Pdf => quest_plot::to_pdf(&text)?,
            _ => text.into_bytes(),
        };
        file.write(|writer| writer.write_all(&bytes))?;
        Ok(file.finish()?)
    }
}
