"""Photos that show boards and give no corners: many of them are told before anything else."""

import json

import cv2
import numpy as np
import pytest
from seen import grid_evidence
from synthetic import checkerboard, lens_of_size, poses_around

from cubicfish.diagnosis.corner_count import many_lost
from cubicfish.find.identification.identified import CODES, Decided, PhotoReport, remark_of
from cubicfish.judge.codes import Code, Remedy, Severity
from cubicfish.scene.photos import Look
from cubicfish.scene.scene import Scene
from cubicfish.scene.truth import camera_points
from cubicfish.target.target import Target
from cubicfish_cli.words.sentences import render
from tests.cubicfish.diagnosis.test_another_target import LARGE, ONE, identified, report


def lost_of(verdicts, sizes, target):
    """What is told of photos with one grid each; those of no verdict have all corners named."""
    grids = [
        (report(size, verdict or Decided.NAMED),)
        for verdict, size in zip(verdicts, sizes, strict=True)
    ]
    lost = [
        remark_of(f"{number}.png", grid)
        for number, (grid,) in enumerate(grids)
        if grid.verdict is not Decided.NAMED
    ]
    return many_lost(grid_evidence(identified(*grids), target, lost=lost))


@pytest.mark.parametrize("verdict", list(CODES)[1:])
@pytest.mark.parametrize(("count", "reported"), [(3, False), (4, True)])
def test_more_than_a_third_of_the_photos_are_reported(verdict, count, reported):
    found = lost_of([verdict] * count + [None] * (9 - count), [(6, 4)] * 9, LARGE)
    assert len(found) == reported
    for one in found:
        assert (one.code, one.case, one.severity) == (CODES[verdict], "many", Severity.CARE)
        assert one.images == ("0.png", "1.png", "2.png", "3.png")
        assert render(one).what.startswith(
            "4 of the 9 photos in which boards were found are left out: "
        )
        assert render(one).do


def test_photos_that_are_lost_for_several_reasons_are_many_for_none():
    reasons = [Decided.SLIDE, Decided.SLIDE, Decided.AMBIGUOUS, Decided.AMBIGUOUS, None, None]
    assert lost_of(reasons, [(6, 4)] * 6, LARGE) == []


def test_one_of_two_photos_may_be_another_boards():
    assert lost_of([Decided.TOO_LARGE, None], [(12, 9), (9, 7)], ONE) == []


def test_of_a_board_that_is_larger_the_sizes_are_reported():
    sizes = [(11, 8), (8, 11), (11, 8), (14, 12), (9, 7)]
    (reported,) = lost_of([Decided.TOO_LARGE] * 4 + [None], sizes, ONE)
    assert (reported.code, reported.remedy) == (Code.TOO_LARGE, Remedy.CORRECT_TARGET)
    assert "of 11x8 (in 3) inner corners" in render(reported).what


def test_the_largest_grid_says_why_a_photo_is_lost():
    own = [report((3, 5), Decided.SLIDE), report((6, 4), Decided.AMBIGUOUS)]
    remarks = tuple(remark_of("a.png", one) for one in own)
    photo = PhotoReport(name="a.png", remarks=remarks, grids=tuple(own))
    assert photo.loss.code == Code.AMBIGUOUS
    some_named = (*own, report((6, 4), Decided.NAMED))
    assert PhotoReport(name="a.png", remarks=remarks, grids=some_named).loss is None


@pytest.mark.slow
def test_wrong_counts_are_the_first_reason_wherever_a_verdict_is(run, tmp_path, with_report):
    """A board of 8x6 that is said to be one of 7x5: half of the photos show no more than that."""
    target = Target(units="mm", boards=(checkerboard("board", 8, 6, 30.0),))
    lens = lens_of_size(0.6)
    poses = poses_around(target, 12, distance=(0.7, 0.9), off_axis_deg=35, slant_deg=40, seed=4)
    named = {f"{number:02d}": pose for number, pose in enumerate(poses)}
    pictures = Scene(target=target, lens=lens, image_size=lens.image_size).photos(named, Look())
    (tmp_path / "photos").mkdir()
    for number, ((name, picture), pose) in enumerate(zip(pictures, poses, strict=True)):
        for axis in (0, 1) if number % 2 else ():
            rim = np.array([(6.5, -2), (9, -2), (9, 9), (6.5, 9)])
            strip = (rim if axis == 0 else (rim - [2, 0])[:, ::-1]) * 30.0
            pixel = lens.project(camera_points(pose, np.pad(strip, ((0, 0), (0, 1)))))
            cv2.fillPoly(picture, [np.round(pixel * 16).astype(np.int32)], 130, cv2.LINE_AA, 4)
        cv2.imwrite(str(tmp_path / "photos" / f"{name}.png"), picture)
    folder = tmp_path / "calibration"
    options = ("--board", "7x5", "--square", "30mm", "-o", folder, "--json")
    made = json.loads(run("calibrate", tmp_path / "photos", *options).stdout)
    assert made["images"] == 6
    first = made["verdict"]["reasons"][0]
    assert (made["verdict"]["level"], first["code"]) == ("care", "too_large")
    why = "they show larger grids than every board of the target: of 8x6 (in 6)"
    assert why in first["why"]
    assert why in run("info", folder).stdout
    assert why in (folder / "report.html").read_text(encoding="utf-8")
