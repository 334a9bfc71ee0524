"""Objects with markers, end to end: rendered photos to named corners to a camera."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
import synthetic

from cubicfish.errors import DetectionError
from cubicfish.find.identification.second_pass import predicted_corners
from cubicfish.fit.calibrate import calibrate
from cubicfish.observe.detection import first_pass, second_pass
from cubicfish.photos.photos import find_photos
from cubicfish.scene.photos import render
from cubicfish.scene.truth import project_corners
from cubicfish.target.boards.markers import Markers
from cubicfish.workers.pool import Work

LENS = synthetic.lens_of_size(0.75)


def mixed_object():
    """The corner of three: one board with ChArUco markers, one AprilGrid, one plain."""
    target = synthetic.corner_of_three()
    floor, left, right = target.boards
    charuco = synthetic.as_type(
        floor,
        "charuco",
        markers=Markers(dictionary="DICT_4X4_50", side=18.0, first=0, count=35),
    )
    tags = synthetic.as_type(
        left,
        "aprilgrid",
        columns=8,
        rows=6,
        square=36.0,
        spacing=0.3,
        markers=Markers(dictionary="DICT_APRILTAG_36h11", side=36.0, first=0, count=12),
    )
    return replace(target, boards=(charuco, tags, right))


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("marked")
    target = mixed_object()
    poses = synthetic.poses_around(target, 4, seed=12, off_axis_deg=35, distance=(0.35, 0.5))
    truth = {}
    for number, pose in enumerate(poses):
        name = f"{number}.png"
        picture = render(target, LENS.unproject, pose, LENS.image_size, supersample=3, seed=number)
        cv2.imwrite(str(folder / name), picture)
        seen = project_corners(target, LENS, pose, LENS.image_size, neighbourhood=0.5)
        truth |= {
            (name, int(b), int(c), int(r)): pixel
            for b, c, r, pixel in zip(seen.board, seen.column, seen.row, seen.pixel, strict=True)
        }
    return target, find_photos([folder]), truth


def distances(corners, truth):
    return [
        np.hypot(*(pixel - truth[corners.images[image], board, column, row]))
        for image, board, column, row, pixel in zip(
            corners.image, corners.board, corners.column, corners.row, corners.pixel, strict=True
        )
    ]


@pytest.mark.slow
def test_every_kind_of_board_is_named_and_calibrates(photos):
    target, files, truth = photos
    first = first_pass(files, [target], Work(jobs=1))
    assert set(np.unique(first.corners.board)) == {0, 1}
    assert all(report.problem is None for report in first.photos)
    assert sum(report.corners for report in first.photos) == len(first.corners.pixel)
    # The plain board follows once the marked ones have told the lens and the poses.
    expected = predicted_corners(first, target)
    corners = second_pass(files, first, expected, Work(jobs=1)).corners
    assert set(np.unique(corners.board)) == {0, 1, 2}
    assert (corners.board == 2).sum() > 4 * 20
    miss = distances(corners, truth)
    assert np.max(miss) < 1.0
    assert np.sqrt(np.mean(np.square(miss))) < 0.1
    result = calibrate(
        corners.with_target(target), target=target, refine_target="off", hold_out=False
    )
    assert result.errors.rms_px < 0.1
    assert not result.fit.dropped_corners


@pytest.mark.slow
def test_the_wrong_family_is_said(photos):
    target, files, _ = photos
    charuco = target.boards[0]
    other = replace(charuco.markers, dictionary="DICT_7X7_50")
    wrong = replace(target, boards=(replace(charuco, markers=other),))
    with pytest.raises(DetectionError, match=r"no_markers .*DICT_7X7_50, seen DICT_4X4_50"):
        first_pass(files[:2], [wrong], Work(jobs=1))


@pytest.mark.slow
def test_only_marked_boards(photos):
    target, files, _ = photos
    alone = replace(target, boards=target.boards[:1])
    found = first_pass(files, [alone], Work(jobs=1))
    assert set(np.unique(found.corners.board)) == {0}
    whole = first_pass(files, [target], Work(jobs=1)).corners
    ours = {tuple(pixel) for pixel in found.corners.pixel.round(2)}
    theirs = {tuple(pixel) for pixel in whole.pixel[whole.board == 0].round(2)}
    assert len(ours & theirs) > 0.95 * len(theirs)
