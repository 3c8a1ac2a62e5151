"""Configuration of the documentation site; `scripts/docs` builds it.

Pages of the repository are not copied. A line `<!-- include: docs/RESULTS.md -->` in a page stands for that file; with
`below` at the end its headings become one level deeper. A file that does not exist is left out.
"""

import inspect
import logging
import os
import re
import types
from pathlib import Path

import quest_pose
from docutils import nodes
from latex2mathml import converter

ROOT = Path(__file__).resolve().parents[2]

project = "quest-pose"
author = copyright = "the quest-pose contributors"
release = quest_pose.__version__
repository = "https://github.com/quest-pose/quest-pose"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["build", "**/.ipynb_checkpoints"]
# Notebooks are kept without outputs and run each time; one that fails ends the build.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
nb_code_prompt_show = "Show the code of this picture"
nb_code_prompt_hide = "Hide the code of this picture"
# nbclient names every notebook that it runs.
logging.getLogger("traitlets").setLevel(logging.WARNING)
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 4
# The docstrings are in NumPy's form.
napoleon_google_docstring = False
napoleon_use_rtype = False
# `x1, x2 : array_like` stays one entry, with one text.
napoleon_use_param = False
autodoc_typehints = "none"
autodoc_member_order = "bysource"

# Formulas are MathML, which browsers draw themselves: the site works offline.
html_math_renderer = "mathml"

html_theme = "furo"
html_title = "quest-pose"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["scroll.js"]
templates_path = ["templates"]
html_copy_source = False
html_show_sphinx = False
# Many pages include files of the repository, so a link to a page's own source would lead to next to nothing.
html_theme_options = {"top_of_page_buttons": []}
# Sphinx has lexers for `console` and `text`; Pygments has none for JSON Lines and the like, which are `text` here.
highlight_language = "text"

# Files of the repository that are pages here. Links to other files lead to the repository.
PAGES = {
    "README.md": "index",
    "CONVENTIONS.md": "guides/conventions",
    "crates/quest-core/CONVENTIONS.md": "guides/conventions",
    "crates/quest-py/README.md": "api",
    "docs/RESULTS.md": "results",
    "docs/servoing.md": "servoing-results",
    "docs/servo-recipes.md": "guides/servoing",
    "docs/switching.md": "guides/switching",
    "docs/colmap.md": "guides/colmap",
    "docs/cluster.md": "guides/batches",
    "docs/errata.md": "errata",
    "benches/README.md": "benches",
    "benches/RESULTS.md": "speed",
    "ARCHITECTURE.md": "architecture",
    "CONTRIBUTING.md": "contributing",
    "CHANGELOG.md": "changelog",
}
INCLUDE = re.compile(r"^<!-- include: (\S+)( below)? -->$", re.MULTILINE)
LINK = re.compile(r"(!?)(\[[^\]\n]*\])\(([^)\s]+)\)")


def page_link(source: Path, folder: str, match: re.Match) -> str:
    """A link of a file of the repository, as a link of this site."""
    image, text, target = match.groups()
    if target.startswith(("http", "#", "mailto:")):
        return match[0]
    name, _, anchor = target.partition("#")
    path = Path(os.path.normpath(source.parent / name))
    if not path.exists():
        raise ValueError(f"{source.relative_to(ROOT)} links to {target}, which does not exist")
    inside = path.relative_to(ROOT).as_posix()
    if image:
        return f"!{text}({os.path.relpath(path, folder)})"
    if inside in PAGES:
        return f"{text}(/{PAGES[inside]}.md{'#' + anchor if anchor else ''})"
    return f"{text}({repository}/{'tree' if path.is_dir() else 'blob'}/main/{inside})"


def included(folder: str, match: re.Match) -> str:
    """What stands for the line of an include."""
    source = ROOT / match[1]
    if not source.exists():
        return ""
    # Blocks of code are left as they are: they hold brackets that are no links, and `#` that are no headings.
    parts = re.split(r"(^```.*?^```$)", source.read_text(), flags=re.MULTILINE | re.DOTALL)
    for k in range(0, len(parts), 2):
        parts[k] = LINK.sub(lambda m: page_link(source, folder, m), parts[k])
        if match[2]:
            parts[k] = re.sub(r"^#", "##", parts[k], flags=re.MULTILINE)
    return "".join(parts)


def include_files(app, docname, content):
    folder = os.path.dirname(app.env.doc2path(docname))
    for name, _ in INCLUDE.findall(content[0]):
        app.env.note_dependency(str(ROOT / name))
    content[0] = INCLUDE.sub(lambda m: included(folder, m), content[0])


def plain_docstring(app, what, name, obj, options, lines):
    """Properties written in Rust say `name : type : text`, as their help shows it: the type comes to its own line."""
    if lines and inspect.isgetsetdescriptor(obj):
        kind, colon, text = lines[0].partition(" : ")
        if colon:
            lines[:1] = [f"*{kind}*", "", text]
    # `x1[b]_` and `**kw` are no references.
    if isinstance(obj, types.ModuleType):
        del lines[:]


def heading_levels(app, pagename, templatename, context, doctree):
    """The captions of the sidebar are headings; a screen reader has to know of which level."""
    tree = context.get("furo_navigation_tree", "")
    context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')


def mend_pages(app, exception):
    """What a screen reader needs and the writers leave out: names of the two sidebars, no headers without a word."""
    for page in Path(app.outdir).rglob("*.html"):
        text = page.read_text()
        for part, name in (("sidebar-drawer", "Site"), ("toc-drawer", "This page")):
            text = text.replace(f'<aside class="{part}', f'<aside aria-label="{name}" class="{part}')
        page.write_text(text.replace('<th class="head"><p></p></th>', "<td></td>"))


def formula(display):
    """What writes a formula into a page."""

    def visit(translator, node):
        translator.body.append(converter.convert(node.astext(), display="block" if display else "inline"))
        raise nodes.SkipNode

    return visit, None


def setup(app):
    app.add_html_math_renderer("mathml", formula(display=False), formula(display=True))
    app.connect("source-read", include_files)
    # After the theme has put the sidebar together.
    app.connect("html-page-context", heading_levels, priority=900)
    app.connect("build-finished", mend_pages)
    app.connect("autodoc-process-docstring", plain_docstring, priority=400)
