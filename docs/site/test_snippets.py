"""Executes every Python snippet of the documentation, page by page, in a folder with the files that the pages name.

The blocks of a page run one after the other in one namespace. A page that needs a library which is not installed is skipped,
with its name. Blocks of another language than `python` are not run here; commands are, where there is a `quest-cli`.
"""

import os
import re
import shlex
import shutil
import sqlite3
import subprocess
from pathlib import Path

import numpy as np
import pytest
import quest_pose as qp

ROOT = Path(__file__).resolve().parents[2]
SITE = Path(__file__).resolve().parent
PAGES = sorted([*SITE.glob("*.md"), *SITE.glob("guides/*.md"), *(ROOT / "docs").glob("*.md")])
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMANDS = re.compile(r"^```console\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# A page may do without these; everything else has to be there.
OPTIONAL = {"cv2", "matplotlib", "poselib", "pycolmap", "scipy", "torch"}


def with_blocks(pattern):
    return [pytest.param(page, id=str(page.relative_to(ROOT))) for page in PAGES if pattern.search(page.read_text())]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The files that the pages name: photographs, a COLMAP database, matches, the repository's examples."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    points, noise = matched_pixels()
    rows = np.hstack([points[0] + noise[0], points[1] + noise[1]])
    np.savetxt("matches.csv", rows, delimiter=",", header="u1,v1,u2,v2", comments="")
    example = (ROOT / "examples/tumfr3_98072_98172.json").read_text().replace("\n", " ")
    Path("pairs.jsonl").write_text(example + "\n" + example + "\n")
    write_database(rows)
    write_photographs()
    return tmp_path


def matched_pixels():
    """A hundred points from two places, and the noise of half a pixel."""
    rng = np.random.default_rng(26)
    camera = qp.Camera("PINHOLE", [600, 600, 320, 240])
    points = rng.uniform([-1.2, -0.9, 2.0], [1.2, 0.9, 6.0], (100, 3))
    return (camera.project(points), camera.project(points + [0.4, 0.1, 0.0])), rng.normal(scale=0.5, size=(2, 100, 2))


def write_database(rows):
    """A database as COLMAP writes it: two images whose keypoints are matched one to one."""
    with sqlite3.connect("database.db") as db:
        db.execute("CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB)")
        db.execute("CREATE TABLE matches (pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB)")
        for image, points in ((1, rows[:, :2]), (2, rows[:, 2:])):
            blob = points.astype(np.float32).tobytes()
            db.execute("INSERT INTO keypoints VALUES (?, ?, 2, ?)", (image, len(points), blob))
        pairs = np.repeat(np.arange(len(rows), dtype=np.uint32)[:, None], 2, axis=1)
        db.execute("INSERT INTO matches VALUES (?, ?, 2, ?)", (2147483647 + 2, len(rows), pairs.tobytes()))


def write_photographs():
    """Textured boards at several depths, seen from two places."""
    try:
        import cv2
    except ModuleNotFoundError:
        return
    rng = np.random.default_rng(0)
    K = np.array([[580.0, 0, 319.5], [0, 580.0, 239.5], [0, 0, 1]])
    boards = [(0, 0, 5, 8, 6), (-0.9, 0.3, 3.5, 1.4, 1.2), (0.8, -0.4, 3, 1.1, 1), (0.2, 0.7, 2.5, 0.8, 0.7)]
    textures = []
    for *_, width, height in boards:
        small = rng.uniform(20, 235, (int(24 * height), int(24 * width))).astype(np.uint8)
        textures.append(cv2.resize(small, None, fx=8, fy=8, interpolation=cv2.INTER_CUBIC))
    for name, t in (("left.png", np.zeros(3)), ("right.png", np.array([-0.4, 0.05, 0.1]))):
        image = np.zeros((480, 640), np.uint8)
        for (x, y, z, width, height), texture in zip(boards, textures, strict=True):
            to_board = np.array([[1 / 192, 0, x - width / 2], [0, 1 / 192, y - height / 2], [0, 0, 1]])
            to_camera = np.diag([1, 1, z]) + np.outer(t, [0, 0, 1])
            H = K @ to_camera @ to_board
            seen = cv2.warpPerspective(texture, H, (640, 480), flags=cv2.INTER_AREA)
            covers = cv2.warpPerspective(np.full_like(texture, 255), H, (640, 480)) > 254
            image[covers] = seen[covers]
        cv2.imwrite(name, image)


@pytest.mark.parametrize("page", with_blocks(BLOCK))
def test_python(page, folder):
    names = {"__name__": "snippet"}
    text = page.read_text()
    for block in BLOCK.finditer(text):
        # Blank lines in front make the line numbers of a traceback those of the page.
        code = "\n" * (text[: block.start(1)].count("\n")) + block[1]
        try:
            exec(compile(code, str(page), "exec"), names)
        except ModuleNotFoundError as missing:
            if missing.name not in OPTIONAL:
                raise
            pytest.skip(f"{page.name} needs {missing.name}, which is not installed")


def quest_cli():
    built = [ROOT / "target" / kind / "quest-cli" for kind in ("release", "debug")]
    candidates = [os.environ.get("QUEST_CLI"), *map(str, filter(Path.exists, built)), shutil.which("quest-cli")]
    return next(filter(None, candidates), None)


@pytest.mark.parametrize("page", with_blocks(COMMANDS))
def test_commands(page, folder):
    """Every `$ quest-cli ...` of a page of this site ends with status 0. README's commands are tested by the tool's own tests."""
    lines = re.findall(r"^\$ (quest-cli .*)$", "\n".join(COMMANDS.findall(page.read_text())), re.MULTILINE)
    if not lines:
        pytest.skip(f"{page.name} has no command of quest-cli")
    tool = quest_cli()
    if tool is None:
        pytest.skip("quest-cli is not built: cargo build --release -p quest-cli, or QUEST_CLI=path")
    for line in lines:
        done = subprocess.run([tool, *shlex.split(line)[1:]], capture_output=True, text=True)
        assert done.returncode == 0, f"{line}\n{done.stderr}"


def test_there_are_snippets():
    assert len(with_blocks(BLOCK)) >= 8
