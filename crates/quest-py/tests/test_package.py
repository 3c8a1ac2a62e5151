"""What the package says of itself."""

import doctest
import inspect
import re
import subprocess
import sys
from importlib.metadata import requires, version
from pathlib import Path

import pytest
import quest_pose as qp


def test_version() -> None:
    assert qp.__version__ == version("quest-pose")


def test_numpy_is_all_it_needs() -> None:
    needed = [r for r in requires("quest-pose") or [] if "extra ==" not in r]
    assert [r.split(">")[0] for r in needed] == ["numpy"]


@pytest.mark.parametrize("name", ["arrow", "colmap", "compat", "dask", "paper", "servo"])
def test_modules_need_no_import_of_their_own(name: str) -> None:
    names = f"import quest_pose; assert quest_pose.{name}.__name__ == 'quest_pose.{name}'"
    subprocess.run([sys.executable, "-c", names], check=True)
    with pytest.raises(AttributeError, match="no attribute 'colmpa'"):
        getattr(qp, "colmpa")  # noqa: B009  a type checker would find the attribute missing


def test_examples() -> None:
    for module in qp, sys.modules["quest_pose._polynomials"]:
        result = doctest.testmod(module)
        assert result.attempted > 0
        assert result.failed == 0


def test_readme(capsys: pytest.CaptureFixture[str]) -> None:
    readme = Path(__file__).parents[1] / "README.md"
    (example,) = re.findall("```python\n(.*?)```", readme.read_text(), re.DOTALL)
    exec(example, {})
    # The pixels were made with a rotation by (0.02, -0.1, 0.03) rad.
    assert capsys.readouterr().out.startswith("exact True [ 0.9985")


def test_root_readme(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).parents[3]
    readme = (root / "README.md").read_text(encoding="utf-8")
    ((example, output),) = re.findall("```python\n(.*?)```\n\n```text\n(.*?)```", readme, re.DOTALL)
    monkeypatch.chdir(root)
    exec(example, {})
    assert capsys.readouterr().out == output


@pytest.mark.parametrize("name", [n for n in qp.__all__ if n != "__version__"])
def test_everything_is_documented(name: str) -> None:
    public = getattr(qp, name)
    assert inspect.getdoc(public)
    if inspect.isclass(public) and public.__module__ == "quest_pose" and not issubclass(public, Exception):
        for member in (n for n in vars(public) if not n.startswith("_")):
            assert inspect.getdoc(getattr(public, member)), member


def test_signature() -> None:
    signature = (
        '(x1, x2, camera1=None, camera2=None, *, solver=None, kinds="all", feasibility="positive-depth")'
    )
    assert str(inspect.signature(qp.solve)).replace("'", '"') == signature
