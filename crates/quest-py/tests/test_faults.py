"""Signals, processes, threads and memory: a call ends when it is told to, and nothing is left broken.

Each fault is tried in a process of its own.
"""

import multiprocessing
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import quest_pose as qp
from answers import answers
from scenes import make_scene

posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of another kind")
linux = pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")

# A process that makes a call and is told to end meanwhile; it prints how long the call took to obey.
CTRL_C = """
import os, signal, sys, threading, time
import numpy as np
import quest_pose as qp
from quest_pose import paper

# A program that was begun in the background ignores the signal, and so do its children.
signal.signal(signal.SIGINT, signal.default_int_handler)
rng = np.random.default_rng(1)
{setup}
def call():
    {call}

told = []
def tell():
    time.sleep(0.4)
    told.append(time.perf_counter())
    os.kill(os.getpid(), signal.SIGINT)

thread = threading.Thread(target=tell)
thread.start()
try:
    while True:
        # A call that is over before the signal comes is made again.
        call()
except KeyboardInterrupt:
    print(time.perf_counter() - told[0])
thread.join()
# Work that goes on alone ends with the process.
sys.stdout.flush()
os._exit(0)
"""

POINTS = "x = rng.uniform(-0.5, 0.5, ({n}, 2)); y = rng.uniform(-0.5, 0.5, ({n}, 2))"
QUADRICS = (
    "import itertools\n"
    "monomials = [e for e in itertools.product(range(3), repeat=4) if sum(e) <= 2]\n"
    "equations = [dict(zip(monomials, rng.normal(size=len(monomials)))) for _ in range(4)]"
)
CALLS = {
    "estimate": (POINTS.format(n=3000), "qp.estimate(x, y, threshold=1e-9, max_iterations=10**9, max_false_alarms=np.inf, confidence=0.9999999)"),
    "estimate_batch": (POINTS.format(n=30_000), "qp.estimate_batch(x, y, np.arange(0, 30_001, 100), threshold=1e-4)"),
    "third_view": (POINTS.format(n=3000), "qp.third_view(x, y, y, threshold=1e-9, max_iterations=10**6)"),
    "solve": (POINTS.format(n=3_000_000), "qp.solve(x, y)"),
    "solve_batch": ("x = rng.uniform(-1, 1, (400_000, 5, 2)); y = rng.uniform(-1, 1, (400_000, 5, 2))", "qp.solve_batch(x, y)"),
    "constraint_matrix": (POINTS.format(n=300), "qp.constraint_matrix(x, y)"),
    "bearing": ("c = qp.Camera('OPENCV', [500, 500, 320, 240, -0.1, 0.01, 1e-3, 1e-3]); p = rng.uniform(0, 480, (4_000_000, 2))", "c.bearing(p)"),
    "has_ray": ("c = qp.Camera('OPENCV', [500, 500, 320, 240, -0.1, 0.01, 1e-3, 1e-3]); p = rng.uniform(0, 480, (4_000_000, 2))", "c.has_ray(p)"),
    "polynomials": (QUADRICS, "qp.solve_polynomials(equations)"),
    "scene": ("", "paper.scene(points=2_000_000)"),
}


@posix
@pytest.mark.parametrize("name", CALLS)
def test_a_call_that_takes_long_ends_by_ctrl_c(name: str) -> None:
    setup, call = CALLS[name]
    done = subprocess.run(
        [sys.executable, "-c", CTRL_C.format(setup=setup, call=call)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    # A call asks 20 times a second. The rest is for a machine that is busy, and for arrays that come back: a call that is deaf takes
    # ten seconds or more.
    assert float(done.stdout) < 5.0


@posix
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_processes_give_the_same_answers(method: str) -> None:
    # The pools of threads exist when the process is forked.
    expected = answers(0)
    context = multiprocessing.get_context(method)
    with context.Pool(2) as pool:
        assert pool.map_async(answers, range(3)).get(timeout=120) == [expected] * 3


def test_threads_give_the_same_answers() -> None:
    expected = answers(0)
    found: list[list[Any]] = []
    threads = [threading.Thread(target=lambda: found.append(answers(0))) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [expected] * 6


ALONE = """
import resource, sys
sys.path.insert(0, {tests!r})
from answers import answers
import os, threading
# What is imported later is imported as a user who may not read it.
expected = answers(0)
if os.getuid() == 0:
    os.setgid(65534)
    os.setuid(65534)
resource.setrlimit(resource.RLIMIT_NPROC, (1, 1))
try:
    threading.Thread(target=print).start()
except RuntimeError:
    print("refused")
print(answers(0) == expected)
"""


@linux
def test_threads_that_are_refused_change_no_answer() -> None:
    code = ALONE.format(tests=os.path.dirname(__file__))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["refused", "True"]


X = make_scene(seed=1).x1
NOT_WHOLE: list[tuple[Callable[[], object], type[Exception], str]] = [
    (lambda: qp.estimate(X, X, threshold=1, seed=-1), qp.QuestError, "seed"),
    (lambda: qp.estimate(X, X, threshold=1, max_iterations=-1), qp.QuestError, "max_iterations"),
    (lambda: qp.estimate(X, X, threshold=1, seed=0.5), TypeError, "seed"),  # type: ignore[arg-type]
    (lambda: qp.estimate_batch(X, X, [0, 5], threshold=1, first_index=-1), qp.QuestError, "first_index is -1"),
    (lambda: qp.estimate_batch(X, X, [0, 5], threshold=1, first_index=2**64), qp.QuestError, "first_index"),
    (lambda: qp.estimate_batch(X, X, [0, 5], threshold=1, num_threads=-1), qp.QuestError, "num_threads is -1"),
    (lambda: qp.estimate_batch(X, X, [0, 5], threshold=1, num_threads=1.0), TypeError, "num_threads"),  # type: ignore[arg-type]
    (lambda: qp.solve_polynomials([{(1,): 1.0, (0,): 1.0}], seed=-1), qp.QuestError, "seed is -1"),
    (lambda: qp.solve_polynomials([{(1,): 1.0, (0,): 1.0}], max_rounds=-1), qp.QuestError, "max_rounds is -1"),
    (lambda: qp.Camera("PINHOLE", [1, 1, 0, 0], width=-1, height=4), qp.QuestError, "width is -1"),
    (lambda: qp.Camera("PINHOLE", [1, 1, 0, 0], width=4, height=2**40), qp.QuestError, "height is 1099511627776"),
    (lambda: qp.solve(X > 0, X), TypeError, "x1 has the dtype bool"),
]


@pytest.mark.parametrize(("call", "error", "words"), NOT_WHOLE)
def test_numbers_that_are_none(call: Callable[[], object], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words.replace("**", r"\*\*")) as caught:
        call()
    assert type(caught.value) is error


def test_bad_options_are_refused_without_pairs() -> None:
    none = np.zeros((0, 2))
    assert len(qp.estimate_batch(none, none, [0], threshold=1)) == 0
    for bad in ({"threshold": -1.0}, {"threshold": 1.0, "confidence": 2.0}, {"threshold": 1.0, "max_iterations": 0}):
        with pytest.raises(qp.QuestError):
            qp.estimate_batch(none, none, [0], **bad)  # type: ignore[arg-type]
