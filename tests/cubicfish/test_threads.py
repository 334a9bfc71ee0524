"""One thread of linear algebra for small matrices, and what was before afterwards."""

from typing import Any

import numpy as np
import pytest
from synthetic import IMAGE_SIZE, TRUE_LENS, corner_of_three, synthetic_correspondences
from threadpoolctl import ThreadpoolController, threadpool_limits

from cubicfish import calibrate, evaluate
from cubicfish.scene.photos import chosen_poses
from cubicfish.threads import Shared, one_blas_thread

LIBRARIES = ThreadpoolController().select(user_api="blas")


def blas_threads() -> set[int]:
    """How many each library takes, but for those that were built for one alone."""
    return {one["num_threads"] for one in LIBRARIES.info() if one["threading_layer"] != "disabled"}


def test_threads_are_as_before_when_the_last_one_leaves() -> None:
    with threadpool_limits(2, user_api="blas"):
        with one_blas_thread():
            assert blas_threads() == {1}
            with one_blas_thread():
                assert blas_threads() == {1}
            assert blas_threads() == {1}
        assert blas_threads() == {2}


def test_threads_are_as_before_after_an_error() -> None:
    with threadpool_limits(2, user_api="blas"):
        with pytest.raises(KeyError), one_blas_thread():
            raise KeyError
        assert blas_threads() == {2}


def test_a_state_is_made_once_and_ended_once() -> None:
    seen: list[Any] = []
    state = Shared(lambda: seen.append("begun") or len(seen), seen.append)

    @state()
    def doubled(number: int) -> int:
        with state():
            seen.append(number)
        return 2 * number

    assert [doubled(3), doubled(4)] == [6, 8]
    assert seen == ["begun", 3, 1, "begun", 4, 4]


@pytest.mark.slow
def test_fits_take_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    target, seen = corner_of_three(), []
    solve, svd = np.linalg.solve, np.linalg.svd
    monkeypatch.setattr(np.linalg, "solve", lambda *a: seen.append(blas_threads()) or solve(*a))
    monkeypatch.setattr(
        np.linalg, "svd", lambda *a, **b: seen.append(blas_threads()) or svd(*a, **b)
    )
    poses = chosen_poses(target, TRUE_LENS, IMAGE_SIZE, 3)
    pairs = synthetic_correspondences(target, poses, noise=0.05)
    with threadpool_limits(2, user_api="blas"):
        fit = calibrate(pairs, hold_out=False)
        evaluate(fit.camera, pairs)
        assert blas_threads() == {2}
    assert len(seen) > 50
    assert all(threads == {1} for threads in seen)
