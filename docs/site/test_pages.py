"""The built site in Chromium, at the width of a telephone and of a desk: nothing is wider than the window, the console is silent,
and axe-core finds no violation."""

import os
import shutil
from pathlib import Path

import axe_playwright_python
import pytest
from playwright.sync_api import sync_playwright

BUILT = Path(__file__).resolve().parent / "build" / "html"
BROWSER = os.environ.get("CHROMIUM") or next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
AXE = (Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text()
# On this page every rule looks at every element; on the others the colours of code, which are the same everywhere, are left out.
WHOLE = "guides/threshold.html"
PAGES = sorted(str(page.relative_to(BUILT)) for page in BUILT.rglob("*.html"))

if not PAGES:
    pytest.skip("the site is not built: scripts/docs", allow_module_level=True)
if BROWSER is None:
    pytest.skip("Chromium is not here, so no page is opened", allow_module_level=True)


@pytest.fixture(scope="module")
def visit():
    """Opens a page at a width, and returns the tab and what its console says."""
    said = []
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        tab = browser.new_page()
        tab.on("console", lambda message: said.append(message.text) if message.type in ("error", "warning") else None)
        tab.on("pageerror", lambda error: said.append(str(error)))

        def visit(page, width):
            said.clear()
            tab.set_viewport_size({"width": width, "height": 900})
            tab.goto((BUILT / page).as_uri())
            return tab, said

        yield visit
        browser.close()


@pytest.mark.parametrize("width", [390, 1440])
@pytest.mark.parametrize("page", PAGES)
def test_a_page_fits_and_is_accessible(page, width, visit):
    tab, said = visit(page, width)
    needed = tab.evaluate("document.documentElement.scrollWidth")
    assert needed <= width, f"{page} is {needed} pixels wide in a window of {width}"
    assert not said
    if width == 1440 or page in ("index.html", WHOLE):
        tab.evaluate(AXE)
        # Style sheets are not fetched again: from a disc a page may not.
        run = "exclude => axe.run({ exclude }, { preload: false }).then(({ violations }) => violations)"
        found = tab.evaluate(run, [] if page == WHOLE else [".highlight span"])
        assert not [f"{v['id']}: " + " ".join(node["html"] for node in v["nodes"][:3]) for v in found]
