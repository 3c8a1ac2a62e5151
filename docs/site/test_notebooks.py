"""The notebooks as they are kept: without outputs, with what every reader has. The build of the site runs them."""

import ast
import json
import sys
from pathlib import Path

import pytest

SITE = Path(__file__).resolve().parent
NOTEBOOKS = sorted(SITE.glob("notebooks/*.ipynb"))
# What a reader of a notebook has installed.
LIBRARIES = {"matplotlib", "numpy", "quest_pose"}


def test_there_are_five():
    assert len(NOTEBOOKS) == 5


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(path):
    cells = json.loads(path.read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert not [cell["id"] for cell in code if cell["outputs"] or cell["execution_count"] is not None]
    tree = ast.parse("\n".join("".join(cell["source"]) for cell in code))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert {name.split(".")[0] for name in names} <= LIBRARIES | sys.stdlib_module_names
    pictures = [cell for cell in code if "plt.subplots" in "".join(cell["source"]) or "plt.figure" in "".join(cell["source"])]
    assert pictures and all(cell["metadata"]["mystnb"]["image"]["alt"] for cell in pictures)
