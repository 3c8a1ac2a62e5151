"""The built site: every link inside it leads somewhere, and readers find what they search for."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

BUILT = Path(__file__).resolve().parent / "build" / "html"

if not (BUILT / "index.html").exists():
    pytest.skip("the site is not built: scripts/docs", allow_module_level=True)


class Links(HTMLParser):
    """The links of a page, and the names that links to it can have."""

    def __init__(self, text):
        super().__init__()
        self.targets, self.names = [], {""}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        for key, value in attrs:
            if key in ("href", "src") and value:
                self.targets.append(value)
            if key in ("id", "name") and value:
                self.names.add(value)


PAGES = {page: Links(page.read_text()) for page in sorted(BUILT.rglob("*.html"))}


def test_every_link_inside_leads_somewhere():
    dead, followed = [], 0
    for page, links in PAGES.items():
        for target in links.targets:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            followed += 1
            path = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            if not path.exists():
                dead.append((page.name, target))
            elif path in PAGES and unquote(parts.fragment) not in PAGES[path].names:
                dead.append((page.name, target))
    assert not dead
    assert followed > 500


def test_images_have_a_description():
    for page in PAGES:
        for image in re.findall(r"<img[^>]*>", page.read_text()):
            assert re.search(r'alt="[^"]+"', image), f"{page.name}: {image}"


@pytest.mark.parametrize(
    "words, page",
    [
        ("threshold", "guides/threshold"),
        ("second pose", "guides/planes"),
        ("COLMAP", "guides/colmap"),
        ("quaternion order", "guides/conventions"),
        ("BibTeX", "index"),
        ("resume", "guides/batches"),
        ("ambiguous", "guides/planes"),
    ],
)
def test_a_reader_finds(words, page):
    """The page that explains it is among those that the index has for all of the words."""
    index = json.loads(re.search(r"setIndex\((.*)\)", (BUILT / "searchindex.js").read_text(), re.DOTALL)[1])
    found = set(range(len(index["docnames"])))
    for word in words.lower().split():
        stem = max((w for w in index["terms"] if word.startswith(w)), key=len)
        hits = []
        for table in (index["terms"], index["titleterms"]):
            pages = table.get(stem, [])
            hits += pages if isinstance(pages, list) else [pages]
        found &= set(hits)
    assert page in {index["docnames"][k] for k in found}
