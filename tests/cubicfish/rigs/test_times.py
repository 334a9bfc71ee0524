"""How a target moves about its shots, and rigs whose photos are not of one moment."""

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hand_held import RATE, Hand, hand_held
from scipy.interpolate import make_smoothing_spline

from cubicfish.rigs import fitted_rig
from cubicfish.rigs.calibrate import calibrate_rig
from cubicfish.rigs.motion import paths_between, smooth_track
from cubicfish.rigs.rig import Rig
from cubicfish.rigs.rig_lens import RigLens
from cubicfish.rigs.times import Timing
from cubicfish.solve.adjustment import Adjustment, adjust
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import Poses, rotation_from_vector
from cubicfish.solve.subset import select_photos
from cubicfish.types import FloatArray


def test_a_smooth_track_is_the_spline_of_cross_validation() -> None:
    rng = np.random.default_rng(0)
    time = np.cumsum(rng.uniform(0.5, 1.5, 40))
    waves = np.column_stack([np.sin(time / 3), np.cos(time / 5)])
    waves += 0.05 * rng.standard_normal(waves.shape)
    between = np.linspace(time[0], time[-1], 99)
    for own, values in zip(smooth_track(time, waves)(between).T, waves.T, strict=True):
        assert np.allclose(own, make_smoothing_spline(time, values)(between), atol=0.01)


@pytest.mark.parametrize("count", [2, 3, 5])
def test_what_stands_still_has_a_track_too(count: int) -> None:
    time = np.arange(float(count))
    values = np.column_stack([np.ones(count), 2 * time])
    assert np.allclose(smooth_track(time, values)(time + 0.3), np.column_stack(
        [np.ones(count), 2 * time + 0.6]
    ))  # fmt: skip


def test_shots_beside_tell_where_a_hand_was() -> None:
    """Better than a cubic through five of them does, a tenth of a second on."""
    off = []
    for seed in range(8):
        rng = np.random.default_rng((seed, 3))
        hand = Hand.moving(rng, 12)
        moment = np.arange(40) / RATE + 1
        place = np.array([hand.at(time) for time in moment])
        poses = Poses(rotation=rotation_from_vector(place[:, :3]), translation=place[:, 3:])
        late = rng.choice([-0.1, 0.1], 40)
        path = paths_between(poses, moment, 2.5 / RATE, np.arange(40), late)
        moved = np.einsum("vp,vpk->vk", late[:, None] ** np.arange(1, 4), path)
        truth = np.array([hand.at(time) for time in moment + late])
        turned = poses.rotation @ rotation_from_vector(moved[:, :3])
        assert np.abs(turned - rotation_from_vector(truth[:, :3])).max() < 0.1
        off.append((place + moved - truth)[2:-2, 3:])
    assert np.sqrt(np.mean(np.square(off))) < 0.15  # cm; 0.27 with that cubic


@functools.cache
def free_running() -> tuple[Rig, Adjustment[RigLens], Timing]:
    """A rig whose cameras run free before a board in a hand, its fit, and its photos' times."""
    fits: list[tuple[Adjustment[RigLens], Timing]] = []
    stated = fitted_rig.place_covariances

    def kept(fit: Adjustment[RigLens], *others: Any) -> FloatArray:
        fits.append((fit, others[-1]))
        return stated(fit, *others)

    made = hand_held(2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fitted_rig, "place_covariances", kept)
        rig = calibrate_rig(
            dict(zip("abc", made.corners, strict=True)), made.target, refine_target="off"
        )
    return rig, *fits[-1]


@pytest.mark.slow
def test_no_shot_that_is_left_out_is_far_off_where_cameras_run_free() -> None:
    rig, _, _ = free_running()
    assert rig.fit.rms_px < 0.13  # 0.07 of it noise
    assert rig.fit.rms_px < rig.fit.held_out_rms_px < 1.2 * rig.fit.rms_px


@pytest.mark.slow
def test_a_rig_without_some_time_is_near_one_that_never_saw_it() -> None:
    """Nearer than the step to first order, for which the target goes on moving as it did."""
    _, fit, timing = free_running()
    offs = []
    for shots in timing.blocks(8)[2:4]:
        lens, times = fit.lens, fit.lens.times
        assert times is not None
        views = np.flatnonzero(~np.isin(lens.shot, shots))
        remain, own = np.unique(lens.shot[views], return_inverse=True)
        rows = np.flatnonzero(np.isin(fit.pairs.image, views))
        of_views = {
            name: getattr(times, name)[views] for name in ("late", "stated", "prior_weight", "path")
        }
        rest = replace(lens, camera=lens.camera[views], shot=own, times=replace(times, **of_views))
        pairs, world = select_photos(fit.pairs, views), fit.world.select(rows)
        anew = adjust(rest, fit.poses[remain], pairs, fit.huber_px, world=world)
        left = replace(timing, shots=tuple(np.array(timing.shots)[remain]))
        for _ in range(4):
            anew = left.again(anew).again(relative_decrease=1e-7)
        ((shared, _, _),) = LeaveOneOut(fit, [shots]).steps()
        step = lens.with_parameters(lens.parameters + shared[: len(lens.parameters)])
        found, first, wanted = (
            one.places.translation[1:] - lens.places.translation[1:]
            for one in (timing.without(fit, shots), step, anew.lens)
        )
        off, off_first = (np.linalg.norm(one - wanted) for one in (found, first))

        assert off < 0.6 * np.linalg.norm(wanted)
        offs.append((off, off_first))
    off, off_first = np.sum(offs, axis=0)
    assert off < off_first
