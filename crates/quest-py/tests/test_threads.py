"""The interpreter's lock is released while computing."""

import sys
import threading
from collections.abc import Callable

import numpy as np
import pytest
import quest_pose as qp
from scenes import make_scene

# Arrays as the library takes them without a copy: NumPy releases the lock for its own arithmetic.
LARGE = make_scene(seed=4, n=100_000)
X1, X2 = LARGE.x1, LARGE.x2
CAMERA = qp.Camera("FULL_OPENCV", [500, 500, 320, 240, -0.1, 0.01, 1e-3, 1e-3, 0, 0, 0, 0])
PIXELS = np.random.default_rng(5).uniform(0, 480, (300_000, 2))


def overtaken(call: Callable[[], object]) -> bool:
    """Whether this thread runs while another is inside of `call`."""
    order: list[str] = []
    about_to_call = threading.Lock()
    about_to_call.acquire()

    def other() -> None:
        about_to_call.release()
        call()
        order.append("other")

    thread = threading.Thread(target=other)
    thread.start()
    about_to_call.acquire()
    order.append("this")
    thread.join()
    return order[0] == "this"


@pytest.mark.parametrize("call", [lambda: qp.solve(X1, X2), lambda: CAMERA.bearing(PIXELS)])
def test_the_lock_is_released(call: Callable[[], object]) -> None:
    # No thread is made to hand over the lock for a minute: this one gets it only if `call` lets go of it. The
    # operating system may still be slow to wake this thread, but not ten times.
    interval = sys.getswitchinterval()
    sys.setswitchinterval(60)
    try:
        assert any(overtaken(call) for _ in range(10))
    finally:
        sys.setswitchinterval(interval)


def test_the_lock_is_kept_otherwise() -> None:
    # The test above would see it.
    interval = sys.getswitchinterval()
    sys.setswitchinterval(60)
    try:
        assert not any(overtaken(lambda: sum(range(300_000))) for _ in range(10))
    finally:
        sys.setswitchinterval(interval)


def test_threads_share_nothing() -> None:
    scene = make_scene(seed=1)
    expected = qp.solve(scene.x1, scene.x2)
    results: list[list[qp.Candidate]] = []
    threads = [
        threading.Thread(target=lambda: results.append(qp.solve(scene.x1, scene.x2))) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [expected] * 8
