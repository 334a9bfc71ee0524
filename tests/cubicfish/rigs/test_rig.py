"""Rigs: several cameras on one body, from corners that each camera found."""

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulated import CornerErrors
from simulated_rig import RigTruth, corner_target, simulated_rig
from synthetic_lenses import SineProfile, synthetic_lens

from cubicfish.errors import FitError
from cubicfish.fit.folds import dealt_out
from cubicfish.judge.codes import Code
from cubicfish.models.radial import RadialCamera
from cubicfish.rigs import fitted_rig, joint_fit
from cubicfish.rigs.calibrate import calibrate_rig
from cubicfish.rigs.evaluate import evaluate_rig
from cubicfish.rigs.rig import Rig
from cubicfish.rigs.rig_lens import PhotoTimes, RigLens
from cubicfish.rigs.shots import (
    Shots,
    shots_by_name,
    shots_by_time,
    shots_of_table,
)
from cubicfish.rigs.start import median_pose
from cubicfish.rigs.times import CornerMotion
from cubicfish.scene.truth import Pose, pose_of_matrix, rotation_matrix
from cubicfish.solve.adjustment import Adjustment, State, adjust, linearise
from cubicfish.solve.deformable_target import DeformableTarget
from cubicfish.solve.fit_lens import FreeLens
from cubicfish.solve.leave_one_out import LeaveOneOut
from cubicfish.solve.poses import Poses, rotation_from_vector
from cubicfish.solve.subset import select, select_photos
from cubicfish.target.observations import Observations
from cubicfish.target.placement import renamed, symmetries
from cubicfish.target.target import Target
from cubicfish.types import FloatArray

NAMES = ("left", "right")
T = TypeVar("T")
APART = (np.array([0.01, 0.9, -0.02]), np.array([-120.0, 10.0, 5.0]))


@functools.cache
def simulated(
    seed: int = 0, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[tuple[Observations, ...], RigTruth]:
    lenses = [synthetic_lens("equisolid", (800, 600)), synthetic_lens("equisolid", (640, 640))]
    nothing = (np.zeros(3), np.zeros(3))
    corners, truth = simulated_rig(
        lenses,
        [nothing, (APART[0], APART[1] + shift)],
        corner_target(),
        10,
        distances=(50, 300),
        middle=(330, 330, 300),
        seed=seed,
        errors=CornerErrors(noise=0.1, shared=0, spread=0),
    )
    return tuple(one.with_target(corner_target()) for one in corners), truth


def of_cameras(*parts: T) -> dict[str, T]:
    return dict(zip(NAMES, parts, strict=True))


def matched(pairs: Sequence[Observations]) -> Shots:
    return shots_by_name(of_cameras(*(one.images for one in pairs)))


def fitted(
    pairs: Sequence[Observations], shots: Shots | None = None, *, hold_lenses: bool = False
) -> Rig:
    return calibrate_rig(
        dict(zip(NAMES, pairs, strict=True)),
        corner_target(),
        shots=shots or matched(pairs),
        refine_target="off",
        hold_lenses=hold_lenses,
    )


def with_copies(pairs: Observations, copies: Sequence[int], noise: float) -> Observations:
    """The same photos, and some of them once more a moment later."""
    rng, parts = np.random.default_rng(5), [pairs]
    for number, copy in enumerate(copies):
        again = select_photos(pairs, np.array([copy]))
        pixel = again.pixel + rng.normal(0, noise, again.pixel.shape)
        names = (f"{again.images[0]}_{number}",)
        parts.append(replace(again, pixel=pixel, images=names))
    return Observations.joined(parts)


@pytest.mark.parametrize(("copies", "severity"), [(range(10), "care"), (range(2), "note")])
def test_shots_that_follow_each_other_closely_are_named_once(
    copies: Sequence[int], severity: str
) -> None:
    plain, _ = simulated()
    rig = fitted([with_copies(one, copies, 0.1) for one in plain])
    (found,) = rig.fit.findings
    assert (found.code, found.case, found.severity) == (Code.REPEATS, "shots", severity)
    figures = found.figures
    assert (figures["shots"], figures["distinct"]) == (10 + len(copies), 10)
    assert len(found.shots) == 2 * len(copies)
    # Copies add no certainty of where cameras stand, beyond that of their corners' noise.
    before, after = (one.cameras[1].shift_sigma for one in (fitted(plain), rig))
    assert after > 0.85 * before


def test_shots_all_from_one_place_are_named() -> None:
    plain, _ = simulated()
    still = [with_copies(select_photos(one, np.array([3])), [0, 0, 0], 0.1) for one in plain]
    told = [(one.code, one.case) for one in fitted(still).fit.findings]
    assert (Code.ONE_PLACE, "shots") in told
    assert (Code.ONE_PLACE, "") not in told


def test_one_camera_given_twice_is_refused():
    one, other = simulated()[0]
    again = replace(one, images=other.images)
    with pytest.raises(FitError, match="cameras left and right have the same photos"):
        fitted([one, again])


@functools.cache
def plain() -> Rig:
    return fitted(simulated()[0])


@pytest.mark.slow
def test_cameras_stand_where_they_do_and_it_is_known_how_surely() -> None:
    rig, (vector, shift) = plain(), APART
    right = rig.cameras[1]
    # The axes of these lenses are turned against their formula's: 0.5° of freedom for the turn.
    off = right.rotation @ rotation_matrix(vector).T
    assert np.degrees(np.arccos((np.trace(off) - 1) / 2)) < 0.5
    assert np.linalg.norm(right.position - -rotation_matrix(vector).T @ shift) < 2.0
    length = np.linalg.norm(right.translation) - np.linalg.norm(shift)
    assert abs(length) < 4 * right.shift_sigma < 1.2
    assert 0 < right.turn_sigma_deg < 0.05
    assert rig.fit.rms_px == pytest.approx(0.1 * np.sqrt(2), rel=0.1)
    assert rig.fit.held_out_rms_px == pytest.approx(rig.fit.rms_px, rel=0.15)
    assert rig.fit.held_out_rms_px > rig.fit.rms_px
    assert [finding.code for finding in rig.fit.findings] == []
    first = rig.cameras[0]
    assert (first.rotation == np.eye(3)).all()
    assert not first.translation.any()
    assert not first.covariance.any()


def without_shots(fit: Adjustment[RigLens], shots: np.ndarray) -> RigLens:
    """The rig of a fit that never saw some shots, followed to its end."""
    lens = fit.lens
    views = np.flatnonzero(~np.isin(lens.shot, shots))
    kept, own = np.unique(lens.shot[views], return_inverse=True)
    rest = replace(lens, camera=lens.camera[views], shot=own)
    rows = np.flatnonzero(np.isin(fit.pairs.image, views))
    pairs, world = select_photos(fit.pairs, views), fit.world.select(rows)
    return adjust(rest, fit.poses[kept], pairs, fit.huber_px, world=world).lens


@pytest.mark.slow
def test_a_rig_without_some_shots_is_nearly_one_step_away(monkeypatch: pytest.MonkeyPatch) -> None:
    fits: list[Adjustment[RigLens]] = []
    stated = fitted_rig.place_covariances

    def kept(fit: Adjustment[RigLens], *others: Any) -> FloatArray:
        fits.append(fit)
        return stated(fit, *others)

    monkeypatch.setattr(fitted_rig, "place_covariances", kept)
    fitted(simulated()[0])
    (fit,) = fits
    right, groups = fit.lens.place_columns(1), [np.array([1, 4]), np.array([6]), np.array([0, 9])]
    unit = np.sqrt(np.diagonal(np.linalg.inv(fit.normal.reduced_shared())))[right]
    for shots, (step, _, _) in zip(groups, LeaveOneOut(fit, groups).steps(), strict=True):
        anew = without_shots(fit, shots)
        turn = anew.places.rotation[1] @ fit.lens.places.rotation[1].T
        shift = anew.places.translation[1] - fit.lens.places.translation[1]
        wanted = np.concatenate([Rotation.from_matrix(turn).as_rotvec(), shift]) / unit
        found = step[right] / unit
        assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


@pytest.mark.slow
def test_lenses_can_be_held() -> None:
    free, held = plain(), fitted(simulated()[0], hold_lenses=True)
    assert held.fit.held_lenses
    assert not free.fit.held_lenses
    assert free.fit.rms_px < held.fit.rms_px < 1.05 * free.fit.rms_px


@pytest.mark.slow
def test_a_photo_of_another_shot_is_named_and_harms_nothing() -> None:
    pairs, _ = simulated()
    names = list(pairs[1].images)
    names[2], names[5] = names[5], names[2]
    order = np.argsort(names)
    place = np.argsort(order)
    wrong = replace(pairs[1], images=tuple(names))
    rows = np.argsort(place[wrong.image], kind="stable")
    wrong = replace(
        wrong,
        images=tuple(sorted(names)),
        **{
            name: getattr(wrong, name)[rows]
            for name in ("world", "pixel", "weight", "board", "column", "row", "certain")
        },
        image=np.sort(place[wrong.image]),
    )
    rig = fitted((pairs[0], wrong))
    assert {one.code for one in rig.fit.findings} == {"shot_mismatched"}
    named = {shot for one in rig.fit.findings for shot in one.shots}
    assert named == {pairs[1].images[2], pairs[1].images[5]}
    assert np.allclose(rig.cameras[1].translation, plain().cameras[1].translation, atol=0.5)
    assert rig.fit.rms_px < 1.1 * plain().fit.rms_px


def joined(first: Observations, second: Observations, half: str) -> Observations:
    """The photos of the first up to ``half``, and those of the second after it."""
    one, _ = select(first, np.array([name <= half for name in first.images])[first.image])
    two, _ = select(second, np.array([name > half for name in second.images])[second.image])
    return Observations.joined([one, two])


@pytest.mark.slow
def test_a_camera_that_moved_half_way_is_found() -> None:
    before, after = simulated()[0], simulated(0, (2.0, 0.0, 0.0))[0]
    rig = fitted([joined(a, b, "shot_005") for a, b in zip(before, after, strict=True)])
    (found,) = rig.fit.findings
    assert found.code == "camera_moved"
    assert set(found.cameras) == set(NAMES)
    assert found.shots == ("shot_006",)
    assert found.figures["shift"] == pytest.approx(2.0, rel=0.3)
    # It stands where it stood in most shots, and the others, which no longer pull, fit.
    assert found.figures["part"] == "before"
    right, truth = rig.cameras[1], plain().cameras[1]
    moved = np.array([2.0, 0.0, 0.0])
    assert np.allclose(right.translation, truth.translation + moved, atol=0.6)
    assert rig.fit.rms_px < 1.1 * plain().fit.rms_px


def in_motion(
    seed: int = 1, late: tuple[float, float] = (0.0, 0.0)
) -> tuple[list[Observations], list[CornerMotion]]:
    """The same shots with rig and target in motion, cameras late by some seconds."""
    pairs, truth = simulated()
    rng = np.random.default_rng(seed)
    count = 20
    turns, shifts = 0.3 * rng.standard_normal((count, 3)), 80 * rng.standard_normal((count, 3))
    found, moving = [], []
    for one, true, place, own in zip(
        pairs, truth.cameras, truth.camera_from_rig, late, strict=True
    ):
        turn = rotation_matrix(place[0])

        def pixel(time: float, one=one, true=true, place=place, turn=turn) -> np.ndarray:
            seen = np.empty_like(one.pixel)
            for number, (name, pose) in enumerate(zip(one.images, true.poses, strict=True)):
                rows, shot = one.image == number, int(name[-3:])
                points = one.world[rows] @ rotation_matrix(pose[0]).T + pose[1]
                in_rig = (points - place[1]) @ turn
                # The target as the rig sees it, some time later.
                in_rig = in_rig @ rotation_matrix(time * turns[shot]).T + time * shifts[shot]
                seen[rows] = true.lens.project(in_rig @ turn.T + place[1])
            return seen

        now, before, after = (pixel(time) for time in (0.0, -0.05, 0.05))
        step = pixel(own) - now if own else 0.0
        found.append(replace(one, pixel=one.pixel + step))
        noise = 0.1 * rng.standard_normal((2, *now.shape))
        moves = (before - now + noise[0], after - now + noise[1])
        moving.append(CornerMotion.between(*moves, (-0.05, 0.05)))
    return found, moving


@pytest.mark.slow
def test_a_clock_that_is_late_is_found_and_taken_out() -> None:
    pairs, moving = in_motion(late=(0.0, 0.03))
    rig = calibrate_rig(
        dict(zip(NAMES, pairs, strict=True)),
        corner_target(),
        moving=dict(zip(NAMES, moving, strict=True)),
        refine_target="off",
    )
    (found,) = rig.fit.findings
    assert (found.code, found.cameras) == ("clocks_differ", ("right", "left"))
    right = rig.cameras[1]
    assert right.in_rig.late_ms == pytest.approx(30, abs=5 * right.in_rig.late_sigma_ms)
    assert 0 < right.in_rig.late_sigma_ms < 1
    assert rig.fit.rms_px < 1.1 * plain().fit.rms_px
    assert np.allclose(right.translation, plain().cameras[1].translation, atol=0.5)


@pytest.mark.slow
def test_photos_whose_lateness_is_known_are_taken_as_of_their_moment() -> None:
    pairs, moving = in_motion(late=(0.0, 0.03))
    late = [
        replace(own, late=np.full(len(own.late), ms))
        for own, ms in zip(moving, (0, 0.03), strict=True)
    ]
    rig = calibrate_rig(
        dict(zip(NAMES, pairs, strict=True)),
        corner_target(),
        moving=dict(zip(NAMES, late, strict=True)),
        refine_target="off",
    )
    assert rig.fit.findings == ()
    assert rig.cameras[1].in_rig.late_ms == 0
    assert rig.fit.rms_px < 1.1 * plain().fit.rms_px


SCATTER_S = 0.01


@functools.cache
def free_running() -> tuple[tuple[Observations, ...], dict[str, dict[str, float]]]:
    """Six photos a second of a target that a hand moves, each late by its own 10 ms; and when."""
    pairs, truth = simulated()
    rng = np.random.default_rng(3)
    sees = [min((one.image == shot).sum() for one in pairs) for shot in range(len(pairs[0].images))]
    shot = int(np.argmax(sees))
    turn, shift = truth.rig_from_world[shot]
    middle = np.array([330.0, 330.0, 300.0])
    rate, phase = rng.uniform(0.2, 0.9, (2, 6, 3)), rng.uniform(0, 6, (2, 6, 3))[0]

    def moved(time: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation and translation of the target before the rig: sums of slow swings."""
        swing = np.sin(2 * np.pi * rate[0] * time + phase).sum(axis=0)
        sway = np.sin(2 * np.pi * rate[1] * time + phase[::-1]).sum(axis=0)
        rotation = rotation_matrix(0.04 * swing) @ rotation_matrix(turn)
        return rotation, rotation_matrix(turn) @ middle + shift + 20 * sway - rotation @ middle

    found, times = [], {}
    for name, one, true, place in zip(
        NAMES, pairs, truth.cameras, truth.camera_from_rig, strict=True
    ):
        own = select(one, one.image == shot)[0]
        worlds, pixels, kept = [], [], []
        times[name] = {}
        for number in range(1, 41):
            when = number / 6 + SCATTER_S * rng.standard_normal()
            rotation, at = moved(when)
            points = (own.world @ rotation.T + at) @ rotation_matrix(place[0]).T + place[1]
            pixel = true.lens.project(points) + 0.1 * rng.standard_normal(own.pixel.shape)
            rows = ((pixel >= 0) & (pixel <= np.array(own.image_size) - 1)).all(axis=1)
            worlds.append(own.world[rows])
            pixels.append(pixel[rows])
            kept.append(rows)
            times[name][f"moment_{number:03d}"] = when
        made = Observations.from_points(worlds, pixels, own.image_size, images=list(times[name]))
        rows = np.concatenate([np.flatnonzero(rows) for rows in kept])
        found.append(
            replace(
                made,
                board=own.board[rows],
                column=own.column[rows],
                row=own.row[rows],
                boards=own.boards,
            ).with_target(corner_target())
        )
    return tuple(found), times


@pytest.mark.slow
@pytest.mark.parametrize("reported", [False, True])
def test_cameras_that_run_free_before_a_moving_target_get_times(reported: bool) -> None:
    pairs, times = free_running()
    rig = calibrate_rig(
        dict(zip(NAMES, pairs, strict=True)),
        corner_target(),
        times=times if reported else None,
        known={name: plain().camera(name) for name in NAMES},
        refine_target="off",
    )
    assert rig.fit.rms_px < 0.25  # 0.14 of it noise; and some 2 px without times
    assert np.linalg.norm(rig.cameras[1].translation - plain().cameras[1].translation) < 1.5
    assert not [one for one in rig.fit.findings if one.code == "clocks_differ"]
    assert rig.verdict.level != "bad"
    if not reported:
        first = rig.verdict.reasons[0]
        assert (first.code, first.case) == ("not_at_once", "fitted")


@pytest.mark.slow
def test_cameras_that_are_not_triggered_at_once_are_named() -> None:
    pairs, _ = in_motion(late=(0.0, 0.03))
    (found,) = fitted(pairs).fit.findings
    assert (found.code, set(found.cameras)) == ("not_at_once", set(NAMES))
    assert found.figures["off_px"] > 1


@pytest.mark.slow
def test_one_shot_in_which_something_moved_is_named() -> None:
    pairs, _ = simulated()
    moved, _ = in_motion(late=(0.0, 0.03))
    own = pairs[1].image == 4
    wrong = replace(pairs[1], pixel=np.where(own[:, None], moved[1].pixel, pairs[1].pixel))
    (found,) = fitted((pairs[0], wrong)).fit.findings
    assert (found.code, found.shots) == ("shot_apart", (pairs[1].images[4],))


@pytest.mark.slow
def test_shots_that_are_not_quite_at_once_count_for_less(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs, _ = simulated()
    moved, _ = in_motion(late=(0.0, 0.01))
    own = np.isin(pairs[1].image, (2, 5, 7))
    shaken = replace(pairs[1], pixel=np.where(own[:, None], moved[1].pixel, pairs[1].pixel))

    def off() -> float:
        place, clean = fitted((pairs[0], shaken)).cameras[1], plain().cameras[1]
        return float(np.linalg.norm(place.position - clean.position))

    weighed = off()
    monkeypatch.setattr(joint_fit, "weighed", lambda pairs, residual: pairs)
    assert weighed < 0.75 * off()


@pytest.mark.slow
def test_a_mirrored_camera_is_named() -> None:
    pairs, _ = simulated()
    mirrored = pairs[1].pixel * [-1, 1] + [pairs[1].image_size[0] - 1, 0]
    with pytest.raises(FitError, match=r"camera right.*mirrored"):
        fitted((pairs[0], replace(pairs[1], pixel=mirrored)))


def test_folds_of_films_are_blocks_of_time() -> None:
    shots = [f"shot_{time:010.3f}s" for time in range(6)]
    parts = [one.tolist() for one in dealt_out(np.arange(6), shots, 3)]
    assert parts == [[0, 1], [2, 3], [4, 5]]
    parts = [one.tolist() for one in dealt_out(np.arange(6), list("abcdef"), 3)]
    assert parts == [[0, 3], [1, 4], [2, 5]]


@pytest.mark.slow
def test_a_lens_that_is_known_stays_as_it_is() -> None:
    pairs, _ = simulated()
    known = plain().cameras[1]
    cameras = dict(zip(NAMES, pairs, strict=True))
    rig = calibrate_rig(cameras, corner_target(), known={"right": known}, refine_target="off")
    assert (rig.cameras[1].camera.P == known.camera.P).all()
    assert np.allclose(rig.cameras[1].translation, known.translation, atol=0.3)
    assert not rig.fit.held_lenses


@pytest.mark.slow
def test_each_camera_has_the_pupil_that_its_lens_has() -> None:
    """Fitted along in the common scale, and of a camera that is known, in the target's units."""
    plain_lens = synthetic_lens("equisolid", (800, 600))
    travels = (5.0, 2.0)
    corners, _ = simulated_rig(
        [
            replace(plain_lens, profile=SineProfile(share=0.31, pupil_mm=travel))
            for travel in travels
        ],
        [(np.zeros(3), np.zeros(3)), APART],
        corner_target(),
        12,
        distances=(50, 300),
        middle=(330, 330, 300),
        errors=CornerErrors(noise=0.05, shared=0, spread=0),
    )
    pairs = [one.with_target(corner_target()) for one in corners]
    rig = fitted(pairs)
    found = [one.camera.pupil_travel for one in rig.cameras]
    np.testing.assert_allclose(found, travels, atol=0.6)
    assert {one.camera.units for one in rig.cameras} == {"mm"}
    assert rig.fit.rms_px == pytest.approx(0.05 * np.sqrt(2), rel=0.15)
    one = rig.cameras[1]
    held = calibrate_rig(
        dict(zip(NAMES, pairs, strict=True)),
        corner_target(),
        known={"right": one},
        refine_target="off",
    )
    assert held.cameras[1].camera.pupil_travel == pytest.approx(one.camera.pupil_travel)
    assert held.fit.rms_px == pytest.approx(rig.fit.rms_px, rel=0.02)
    reported = evaluate_rig(rig, dict(zip(NAMES, pairs, strict=True)))
    assert reported.rms_px == pytest.approx(rig.fit.rms_px, rel=0.02)


@pytest.mark.slow
def test_cameras_without_a_common_shot_are_refused() -> None:
    pairs, _ = simulated()
    apart = Shots(
        names=tuple(f"{number}" for number in range(40)),
        photos=(
            {name: number for number, name in enumerate(pairs[0].images)},
            {name: 20 + number for number, name in enumerate(pairs[1].images)},
        ),
    )
    with pytest.raises(FitError, match="no shot shows the target to right and to left at once"):
        fitted(pairs, apart)


@pytest.mark.slow
def test_few_common_shots_are_reported_once_for_two_cameras() -> None:
    pairs, _ = simulated()
    shots = matched(pairs)
    few = {name: shot + 20 * (shot > 3) for name, shot in shots.photos[1].items()}
    names = tuple(f"{number:02d}" for number in range(40))
    rig = fitted(pairs, Shots(names=names, photos=(shots.photos[0], few)))
    (found,) = rig.fit.findings
    assert (found.code, set(found.cameras)) == ("few_common_shots", set(NAMES))
    assert found.figures["shots"] == rig.pairs[0].shots < 5


@pytest.mark.slow
def test_shots_that_fit_no_rig_are_refused() -> None:
    pairs, _ = simulated()
    names = pairs[1].images
    shuffled = dict(zip(names, np.roll(np.arange(len(names)), 3).tolist(), strict=True))
    shots = matched(pairs)
    wrong = Shots(names=shots.names, photos=(shots.photos[0], shuffled))
    with pytest.raises(FitError, match="do not fit one rig") as refused:
        fitted(pairs, wrong)
    assert refused.value.what.count("shot_") == 3


def free_radial(values: np.ndarray) -> FreeLens[RadialCamera]:
    return FreeLens.of(RadialCamera.from_parameters(values, (640, 480)))


def small_rig() -> tuple[RigLens, Poses, Observations]:
    """Two radial lenses and three shots, one of which only the second camera sees."""
    rng = np.random.default_rng(1)
    camera, shot = np.array([0, 0, 1, 1, 1]), np.array([0, 2, 0, 1, 2])
    values = np.array([200.0, 205, 320, 240, 0.01, 0.002, 0, 0])
    others = values + 3.0 * (np.arange(8) < 4)
    turns = rotation_from_vector([[0, 0, 0], [0.1, 0.5, -0.2]])
    lens = RigLens(
        lenses=(free_radial(values), free_radial(others)),
        places=Poses(rotation=turns, translation=np.array([[0, 0, 0], [0.3, -0.1, 0.2]])),
        camera=camera,
        shot=shot,
    )
    poses = Poses(
        rotation=rotation_from_vector(0.3 * rng.standard_normal((3, 3))),
        translation=np.array([0, 0, 3.0]) + 0.3 * rng.standard_normal((3, 3)),
    )
    image = np.repeat(np.arange(5), 12)
    world = rng.uniform(-1, 1, (60, 3))
    pairs = Observations.from_points(
        [world[image == view] for view in range(5)],
        [rng.uniform(0, 400, (12, 2)) for _ in range(5)],
        (640, 480),
    )
    return lens, poses, pairs


@pytest.mark.parametrize("timed", [False, True])
def test_derivatives_of_a_rig_are_those_of_differences(timed: bool) -> None:
    lens, poses, pairs = small_rig()
    if timed:
        rng = np.random.default_rng(2)
        times = PhotoTimes(
            late=0.1 * rng.standard_normal(5),
            stated=np.zeros(5),
            usual=np.array([0.0, 0.02]),
            prior_weight=np.ones(5),
            path=0.2 * rng.standard_normal((5, 3, 6)),
        )
        lens = replace(lens, times=times)
    world = DeformableTarget(nominal=pairs.world)
    (_, _), (run, terms) = linearise(State(lens, poses, world), pairs, 1e9)
    assert run == slice(24, 60)  # of the second camera
    step = 1e-6

    def pixel(lens: RigLens, poses: Poses) -> np.ndarray:
        views = lens.views(poses)
        points = views.apply(pairs.image[run], pairs.world[run])
        return lens.lenses[1].project(points)

    for column in np.unique(terms.columns):
        moved = np.zeros(len(lens.parameters))
        moved[column] = step
        there, back = (lens.with_parameters(lens.parameters + s * moved) for s in (1, -1))
        found = (pixel(there, poses) - pixel(back, poses)) / (2 * step)
        own = terms.by_shared(moved[:, None] / step)[:, :, 0]
        # A turn along the path is followed to second order.
        near = 1e-3 * np.abs(found).max() if timed else 1e-4
        assert np.allclose(own, found, atol=max(near, 1e-4)), column
    for column in range(6):
        for shot in range(3):
            moved = np.zeros((3, 6))
            moved[shot, column] = step
            found = (pixel(lens, poses.moved(moved)) - pixel(lens, poses.moved(-moved))) / 2 / step
            own = np.where((terms.pose == shot)[:, None], terms.by_pose[:, :, column], 0)
            assert np.allclose(own, found, atol=1e-4), (column, shot)


@pytest.mark.slow
def test_one_camera_is_a_rig_of_one() -> None:
    pairs, truth = simulated()
    one = pairs[0]
    size = np.array(one.image_size)
    values = np.array([200.0, 200, *((size - 1) / 2), 0, 0, 0, 0])
    poses = Poses(
        rotation=np.stack([rotation_matrix(pose[0]) for pose in truth.cameras[0].poses]),
        translation=np.stack([pose[1] for pose in truth.cameras[0].poses]),
    )
    count = np.arange(len(poses))
    alone = free_radial(values)
    rig = RigLens(
        lenses=(alone,),
        places=Poses(rotation=np.eye(3)[None], translation=np.zeros((1, 3))),
        camera=np.zeros(len(poses), np.intp),
        shot=count,
    )
    plainly = adjust(alone, poses, one, huber_px=5.0)
    as_rig = adjust(rig, poses, one, huber_px=5.0)
    assert as_rig.iterations == plainly.iterations
    assert as_rig.cost == pytest.approx(plainly.cost, rel=1e-12)
    assert np.allclose(as_rig.lens.parameters, plainly.lens.parameters, rtol=1e-9)


def test_the_median_of_poses_forgets_a_few_that_are_wrong() -> None:
    rng = np.random.default_rng(0)
    vectors = np.array([0.2, -0.4, 1.0]) + 1e-3 * rng.standard_normal((20, 3))
    shifts = np.array([5.0, 0, -2]) + 1e-2 * rng.standard_normal((20, 3))
    vectors[:6], shifts[:6] = rng.standard_normal((6, 3)), 50 * rng.standard_normal((6, 3))
    found = median_pose(Poses(rotation=rotation_from_vector(vectors), translation=shifts))
    assert np.allclose(found.rotation_vector[0], [0.2, -0.4, 1.0], atol=2e-3)
    assert np.allclose(found.translation[0], [5, 0, -2], atol=2e-2)


@pytest.mark.parametrize(
    ("left", "right"),
    [
        (["a/01.png", "a/02.png"], ["b/02.jpg", "b/01.jpg"]),
        (["left01.png", "left02.png"], ["right02.png", "right01.png"]),
        (["01_l.png", "02_l.png"], ["02_right.png", "01_right.png"]),
    ],
)
def test_photos_of_one_name_are_one_shot(left: list[str], right: list[str]) -> None:
    shots = shots_by_name(of_cameras(left, right))
    assert shots.photos == ({left[0]: 0, left[1]: 1}, {right[0]: 1, right[1]: 0})


def test_names_that_tell_no_shot_are_refused() -> None:
    with pytest.raises(FitError, match="no photo of left is called as one of another camera"):
        shots_by_name(of_cameras(["x1.png", "x2.png"], ["y3.png", "y4.png"]))
    with pytest.raises(FitError, match="would be of one shot"):
        shots_by_name(of_cameras(["a/1.png", "b/1.png"], ["1.png", "2.png"]))


def test_photos_of_one_time_are_one_shot() -> None:
    photos = of_cameras(["a.png", "b.png", "c.png"], ["x.png", "y.png"])
    times = [{"a.png": 1.0, "b.png": 2.0, "c.png": 3.0}, {"x.png": 2.004, "y.png": 3.006}]
    shots = shots_by_time(photos, of_cameras(*times), 5e-3)
    assert shots.photos == (
        {"a.png": 0, "b.png": 1, "c.png": 2},
        {"x.png": 1, "y.png": 3},
    )
    with pytest.raises(FitError, match="no two cameras have photos within 1 ms"):
        shots_by_time(photos, of_cameras(*times), 1e-3)
    with pytest.raises(FitError, match=r"'y.png' has no time in its name"):
        shots_by_time(photos, of_cameras(times[0], {"x.png": 1.0}), 5e-3)


def test_a_table_says_which_photos_are_of_one_shot() -> None:
    photos = of_cameras(["p.png", "q.png"], ["x.png", "y.png"])
    rows = [("one", "left", "q.png"), ("one", "right", "x.png"), ("two", "left", "p.png")]
    shots = shots_of_table(photos, rows)
    assert shots.names == ("one", "two")
    assert shots.photos == ({"p.png": 1, "q.png": 0}, {"x.png": 0})
    with pytest.raises(FitError, match="there is no camera 'rear'"):
        shots_of_table(photos, [("one", "rear", "x.png")])


def test_poses_of_matrices_are_what_the_tests_think() -> None:
    turn = rotation_matrix(APART[0])
    pose: Pose = pose_of_matrix(turn, -turn.T @ APART[1])
    assert np.allclose(pose[0], APART[0])
    assert np.allclose(pose[1], APART[1])


@functools.cache
def symmetric_shots() -> tuple[Target, tuple[Observations, ...], RigTruth]:
    """Shots of one board that looks the same after half a turn, by its true names."""
    board = {"name": "board", "type": "checkerboard", "corners": [8, 6], "square": 40.0}
    of = Target.from_data({"units": "mm", "boards": [board]})
    lenses = [synthetic_lens("equisolid", (800, 600)), synthetic_lens("equisolid", (640, 640))]
    near = (np.array([0.02, 0.3, -0.02]), np.array([-120.0, 10.0, 5.0]))
    corners, truth = simulated_rig(
        lenses,
        [(np.zeros(3), np.zeros(3)), near],
        of,
        14,
        distances=(150, 400),
        seed=1,
        errors=CornerErrors(noise=0.1, shared=0, spread=0),
    )
    return of, tuple(one.with_target(of) for one in corners), truth


@pytest.mark.slow
@pytest.mark.parametrize("named", ["by chance", "upside down"])
def test_cameras_that_name_a_symmetric_board_otherwise_are_one_rig(named: str) -> None:
    of, shown, truth = symmetric_shots()
    (half,) = symmetries(of)
    given = []
    for number, pairs in enumerate(shown):
        chance = np.random.default_rng(number).random(len(pairs.images)) < 0.5
        turned = chance if named == "by chance" else np.full(len(chance), number == 1)
        photos = [pairs.images[photo] for photo in np.flatnonzero(turned)]
        given.append(renamed(pairs, of, dict.fromkeys(photos, half)))
    rig, by_truth = (
        calibrate_rig(dict(zip(NAMES, pairs, strict=True)), of, refine_target="off")
        for pairs in (given, shown)
    )
    assert rig.fit.findings == ()
    assert rig.fit.shots == 14
    right = truth.camera_from_rig[1]
    np.testing.assert_allclose(rig.cameras[1].translation, right[1], atol=3)
    np.testing.assert_allclose(
        rig.cameras[1].translation, by_truth.cameras[1].translation, atol=1e-3
    )
    # And a rig that is known explains shots with such names as well as with true ones.
    reported, true = (
        evaluate_rig(rig, dict(zip(NAMES, pairs, strict=True))) for pairs in (given, shown)
    )
    assert reported.rms_px == pytest.approx(true.rms_px, rel=1e-3)
    # One shot alone is told by where the cameras stand.
    turned = renamed(shown[1], of, dict.fromkeys(shown[1].images, half))
    shot = set(shown[0].images) & set(shown[1].images)
    name = sorted(shot)[0]
    one = [pairs.select(pairs.image == pairs.images.index(name)).only_seen()[0]
           for pairs in (shown[0], turned)]  # fmt: skip
    assert evaluate_rig(rig, dict(zip(NAMES, one, strict=True))).rms_px < 0.5


@pytest.mark.slow
def test_corners_bring_their_target() -> None:
    pairs, _ = simulated()
    known = {name: plain().camera(name) for name in NAMES}
    cameras = dict(zip(NAMES, pairs, strict=True))
    given = calibrate_rig(cameras, corner_target(), known=known)
    brought = calibrate_rig(cameras, known=known)
    assert brought.units == given.units == "mm"
    assert (brought.cameras[1].translation == given.cameras[1].translation).all()
    inches = replace(corner_target(), units="in")
    with pytest.raises(FitError, match="the rig's lengths are in mm and the target's in in"):
        evaluate_rig(given, {name: own.with_target(inches) for name, own in cameras.items()})
