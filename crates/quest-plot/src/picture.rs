//! A drawing as a picture of pixels, or as a page of PDF.

use std::sync::Arc;

use resvg::{
    tiny_skia::{Pixmap, Transform},
    usvg::{Options, Tree, fontdb},
};
use svg2pdf::{ConversionOptions, PageOptions};

use crate::PlotError;

/// Pixels for each unit of a drawing, for screens and for print.
const SCALE: f32 = 2.0;

/// Families whose letters are about as wide as those of the drawings, best first.
const FAMILIES: [&str; 7] =
    ["Helvetica", "Arial", "Liberation Sans", "Nimbus Sans", "DejaVu Sans", "Noto Sans", "Roboto"];

/// The drawing as PNG, two pixels for each of its units. Words have a font of the system.
///
/// # Errors
/// A text that is no SVG, and a system without a font.
pub fn to_png(svg: &str) -> Result<Vec<u8>, PlotError> {
    let tree = tree(svg)?;
    let size = tree.size().to_int_size().scale_by(SCALE);
    let pixels = size.and_then(|size| Pixmap::new(size.width(), size.height()));
    let mut pixels = pixels.ok_or_else(|| failed(&"found a drawing without a size"))?;
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| failed(&error))
}

/// The drawing as a page of PDF. Words stay words, in a font of the system.
///
/// # Errors
/// As [`to_png`].
pub fn to_pdf(svg: &str) -> Result<Vec<u8>, PlotError> {
    svg2pdf::to_pdf(&tree(svg)?, ConversionOptions::default(), PageOptions::default())
        .map_err(|error| failed(&error))
}

fn tree(svg: &str) -> Result<Tree, PlotError> {
    let mut fonts = fontdb::Database::new();
    fonts.load_system_fonts();
    let has = |family: &&str| {
        let families = [fontdb::Family::Name(family)];
        fonts.query(&fontdb::Query { families: &families, ..fontdb::Query::default() }).is_some()
    };
    let of_any = || Some(fonts.faces().next()?.families.first()?.0.clone());
    let family = FAMILIES.into_iter().find(has).map(str::to_owned).or_else(of_any);
    let family = family.ok_or_else(|| {
        failed(&"found no font on this system, expected one such as DejaVu Sans for the words of the drawing")
    })?;
    fonts.set_sans_serif_family(family);
    let options = Options { fontdb: Arc::new(fonts), ..Options::default() };
    Tree::from_str(svg, &options).map_err(|error| failed(&error))
}

fn failed(error: &dyn ToString) -> PlotError {
    PlotError::Drawing(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAWING: &str = r##"<svg width="60" height="40" viewBox="0 0 60 40" xmlns="http://www.w3.org/2000/svg">
<rect x="0" y="0" width="60" height="40" fill="#FFFFFF"/><rect x="30" y="0" width="30" height="40" fill="#FF0000"/>
WORD</svg>"##;

    fn drawing(word: &str) -> String {
        let text = format!(
            r#"<text x="2" y="30" font-family="Helvetica, Arial, sans-serif" font-size="20">{word}</text>"#
        );
        DRAWING.replace("WORD", &text)
    }

    #[test]
    fn pixels_have_the_colours_of_the_drawing_and_its_words() {
        let pixels = |word: &str| Pixmap::decode_png(&to_png(&drawing(word)).unwrap()).unwrap();
        let (empty, word) = (pixels(""), pixels("mm"));
        assert_eq!((empty.width(), empty.height()), (120, 80));
        let colour = |x: u32| empty.pixel(x, 40).map(|p| (p.red(), p.green(), p.blue()));
        assert_eq!((colour(10), colour(110)), (Some((255, 255, 255)), Some((255, 0, 0))));
        assert!(empty.data() != word.data());
    }

    #[test]
    fn a_page_of_pdf_has_the_size_of_the_drawing() {
        let pdf = to_pdf(&drawing("mm")).unwrap();
        assert!(pdf.starts_with(b"%PDF-"));
        let text = String::from_utf8_lossy(&pdf);
        // 72 units an inch there, 72 here.
        assert!(text.contains("/MediaBox [0 0 60 40]"), "{text}");
        assert!(text.contains("/Font"));
    }

    #[test]
    fn what_is_no_drawing_is_an_error() {
        assert!(to_png("<p>").is_err() && to_pdf("").is_err());
    }
}
