//! Pages, drawn by plotly.js in the reader's browser.

mod chart;
mod space;

use std::collections::BTreeSet;
use std::fmt::Write;

use plotly::Plot;

use crate::page::Item;
use crate::{Colour, Figure, Page, PlotError, Space, Style};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The page as one file: style, plotly.js, data, and a script of a few lines that connects the legends.
pub(crate) fn page(page: &Page) -> Result<String, PlotError> {
    let mut body = String::new();
    for item in &page.items {
        body.push_str(&match item {
            Item::Figure(figure) => figure_section(figure)?,
            Item::Space(space) => space_section(space)?,
            Item::Table(caption, rows) => table_section(caption, rows),
        });
    }
    let (title, introduction) = (escaped(&page.title), escaped(&page.introduction));
    Ok(format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n{}\n</head>\n<body>\n\
         <h1>{title}</h1>\n<p>{introduction}</p>\n{body}<script>\n{SCRIPT}</script>\n</body>\n</html>\n",
        plotly_js()
    ))
}

/// plotly.js without the typesetting of formulas, which plotly's crate puts behind it.
fn plotly_js() -> String {
    const END: &str = "</script>";
    let mut scripts = Plot::offline_js_sources();
    if let Some(end) = scripts.find(END) {
        scripts.truncate(end + END.len());
    }
    scripts
}

fn figure_section(figure: &Figure) -> Result<String, PlotError> {
    let series = figure.rows.iter().flatten().flat_map(|panel| &panel.series);
    let legend = legend(series.map(|s| (s.name.as_str(), s.colour, true)));
    let mut rows = key(&figure.key);
    for row in &figure.rows {
        rows.push_str("<div class=\"row\">\n");
        for panel in row {
            let subtitle = if panel.is_bare { panel.y.label.as_str() } else { "" };
            rows.push_str(&plot("panel", &panel.title, subtitle, &chart::plot(panel))?);
        }
        rows.push_str("</div>\n");
    }
    Ok(section(&figure.title, &figure.caption, &format!("{legend}{rows}")))
}

fn space_section(space: &Space) -> Result<String, PlotError> {
    let legend = legend(space.parts.iter().map(|p| (p.name.as_str(), p.colour, p.is_shown)));
    let plot = plot("space", "", "", &space::plot(space))?;
    Ok(section(&space.title, &space.caption, &format!("{legend}{plot}")))
}

fn section(title: &str, caption: &str, content: &str) -> String {
    let (title, caption) = (escaped(title), escaped(caption));
    format!("<section>\n<h2>{title}</h2>\n<p>{caption}</p>\n{content}</section>\n")
}

/// One button a name, in the order of their appearance.
fn legend<'a>(entries: impl Iterator<Item = (&'a str, Colour, bool)>) -> String {
    let mut seen = BTreeSet::new();
    let mut buttons = String::new();
    for (name, colour, is_shown) in entries.filter(|(name, ..)| seen.insert(*name)) {
        let (name, colour) = (escaped(name), colour.hex());
        let _ = writeln!(
            buttons,
            "<button type=\"button\" aria-pressed=\"{is_shown}\" data-name=\"{name}\">\
             <i style=\"background:{colour}\"></i>{name}</button>"
        );
    }
    format!("<div class=\"legend\">\n{buttons}</div>\n")
}

/// A piece of line of each style, with what it means.
fn key(key: &[(Style, String)]) -> String {
    let mut out = String::new();
    for (style, words) in key {
        let (width, dashes) = match style {
            Style::Thick => (3.0, ""),
            Style::Dashed => (1.6, " stroke-dasharray=\"6 4\""),
            Style::Faint => (1.0, " opacity=\"0.35\""),
            _ => (1.6, ""),
        };
        let words = escaped(words);
        let _ = writeln!(
            out,
            "<span><svg width=\"34\" height=\"8\"><path d=\"M0 4h34\" stroke=\"currentColor\" \
             stroke-width=\"{width}\"{dashes}/></svg>{words}</span>"
        );
    }
    if out.is_empty() { out } else { format!("<div class=\"key\">\n{out}</div>\n") }
}

/// A place for a plot, with its data beside it.
fn plot(class: &str, title: &str, subtitle: &str, plot: &Plot) -> Result<String, PlotError> {
    // Within a script element only `<` could end it.
    let data = serde_json::to_string(plot)?.replace('<', "\\u003c");
    let (title, subtitle) = (escaped(title), escaped(subtitle));
    let subtitle = if subtitle.is_empty() { subtitle } else { format!("<small>{subtitle}</small>") };
    Ok(format!(
        "<figure class=\"{class}\"><figcaption>{title}{subtitle}</figcaption>\
         <div class=\"plot\"></div><script type=\"application/json\">{data}</script></figure>\n"
    ))
}

/// A cell with more characters holds a sentence, which may be broken into lines.
const LONG: usize = 40;

fn table_section(caption: &str, rows: &[Vec<String>]) -> String {
    let row = |cells: &Vec<String>, tag: &str| {
        let cell = |text: &String| {
            let class = if text.chars().count() > LONG { " class=\"words\"" } else { "" };
            format!("<{tag}{class}>{}</{tag}>", escaped(text))
        };
        format!("<tr>{}</tr>\n", cells.iter().map(cell).collect::<String>())
    };
    let header = rows.first().map(|r| row(r, "th")).unwrap_or_default();
    let body: String = rows.iter().skip(1).map(|r| row(r, "td")).collect();
    let table =
        format!("<div class=\"table\"><table>\n<thead>{header}</thead>\n<tbody>{body}</tbody></table></div>");
    section(caption, "", &table)
}

/// Text as it stands in HTML.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            _ => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use crate::{Axis, Colour, Figure, Page, Panel, Part, Series, Space};

    #[test]
    fn a_page_holds_its_data_and_nothing_from_elsewhere() {
        let line = Series::line("</script><b>", vec![[0.0, 1.0], [1.0, f64::NAN], [2.0, 3.0]]);
        let panel = Panel::new("p", Axis::linear("x"), Axis::log("y")).with(line);
        let part = Part {
            points: vec![([1.0, 2.0, 3.0], "a point".to_owned())],
            ..Part::new("part", Colour(1, 2, 3))
        };
        let html = Page::new("A & B")
            .introduction("i")
            .figure(Figure::new("f").row([panel]))
            .space(Space::new("s").with(part))
            .table("t", vec![vec!["a".to_owned()], vec!["<1>".to_owned()]])
            .to_html()
            .unwrap();
        // What is ours begins behind plotly.js.
        let ours = &html[html.find("<h1>").unwrap()..];
        assert!(ours.contains("<h1>A &amp; B</h1>") && ours.contains("<td>&lt;1&gt;</td>"));
        assert!(!ours.contains("</script><b>") && ours.contains("\\u003c/script>"));
        assert!(ours.contains("a point") && ours.contains("scatter3d"));
        assert_eq!(ours.matches("<script").count(), ours.matches("</script>").count());
        assert!(!html.contains("MathJax ="));
        for source in ["src=\"http", "href=\"http", "<link rel=\"stylesheet"] {
            assert!(!ours.contains(source));
        }
    }
}
