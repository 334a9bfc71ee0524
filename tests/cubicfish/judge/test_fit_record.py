"""A fit's record: the same from the fit and from its file, and nothing that a file may hold
breaks it.
"""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from cubicfish.judge.codes import Code, Severity
from cubicfish.judge.finding import Finding
from cubicfish.judge.fit_record import (
    Departure,
    DroppedCorner,
    FitRecord,
    MarkedPoints,
    PhotoRecord,
    PoseRecord,
)
from cubicfish.judge.pupil import PupilEffect
from cubicfish.judge.records import key_of

ZOOM = Finding(code=Code.TOO_DARK, severity=Severity.CARE, images=("a.png",))
POSE = PoseRecord(rotation_vector=(0.1, 0.2, 0.3), translation=(1.0, 2.0, 3.0))
FIT = FitRecord(
    rms_px=0.1,
    corners=700,
    images=2,
    refine_target="shape",
    held_out_by_level={"off": 0.3, "shape": 0.2},
    departures=(Departure(board="left", bend=(0.1, 0.2), stretch=(0.0, 0.1)),),
    pupil=PupilEffect(travel=0.1, distance=200.0, units="mm", rim_px=0.02),
    findings=(ZOOM,),
    dropped=1,
    dropped_corners=(DroppedCorner(image="a.png", board=None, column=1, row=2, error_px=9.5),),
    unfit_images={"b.png": "too few"},
    per_image=(
        PhotoRecord(image="a.png", rms_px=0.1, corners=350, camera_from_world=POSE),
        PhotoRecord(image="c.png", corners=350),
    ),
)


def test_it_comes_back_from_its_plain_data() -> None:
    record = FIT.as_record()
    assert FitRecord.of(record).as_record() == record
    assert record["held_out_rms_px"] is None
    assert record["findings"][0]["images"] == ["a.png"]
    assert [list(photo)[-1] for photo in record["per_image"]] == ["camera_from_world", "corners"]


def test_its_keys_are_the_fields_of_its_lift() -> None:
    names = [key_of(one) for one in fields(FitRecord)]
    marked = MarkedPoints(noise_px=1.5)
    ray, point = (
        list(FitRecord(rms_px=1.0, lift=lift, marked=marked, goal_px=0.1).as_record())
        for lift in ("ray", "point")
    )
    assert [name for name in names if name in ray or name in point] == names
    assert {*point} - {*ray} == {"lift", "frame", "plain_rms_px", "reweighted_rms_px"}
    assert not {"uncertainty", "findings", "companion_rms_px"} & {*point}


def test_files_have_other_names_for_the_radial_reference() -> None:
    known = FitRecord(rms_px=1.0, radial_rms_px=2.0, radial_held_out_rms_px=3.0)
    record = known.as_record()
    assert (record["companion_rms_px"], record["companion_held_out_rms_px"]) == (2, 3)
    assert not {"radial_rms_px", "radial_held_out_rms_px"} & {*record}
    assert FitRecord.of(record) == known


def test_nothing_known_is_nothing_written() -> None:
    assert FitRecord.of({}).as_record() == {}
    assert FitRecord.of({}).says_nothing
    assert not FIT.says_nothing


def test_older_files_lack_keys_and_newer_ones_have_others() -> None:
    found = FitRecord.of({"rms_px": 0.2, "corners": 9.0, "to_come": {"a": 1}})
    assert (found.rms_px, found.corners, found.images) == (0.2, 9, 0)
    assert np.isnan(found.held_out_rms_px)
    assert found.uncertainty.field is None


@pytest.mark.parametrize("odd", ["x", None, True, [], {"a": 1}, [1, "x"], 10**400, float("inf")])
def test_what_is_of_another_kind_is_not_known(odd: Any) -> None:
    for one in fields(FitRecord):
        found = FitRecord.of({"coverage": 0.5, key_of(one): odd})
        verbatim = {"frame", "unfit_images", "held_out_by_level", "flat", "renamed_images"}
        if one.name not in {"coverage", "marked", *verbatim}:
            assert found == FitRecord(coverage=0.5), one.name


def test_a_pose_is_two_vectors_of_three_numbers_each() -> None:
    assert list(FIT.poses) == ["a.png"]
    photo: dict[str, Any] = {"image": "a", "camera_from_world": {"rotation_vector": [0, 0, 1]}}
    assert FitRecord.of({"per_image": [photo]}).poses == {}
    for shift in ([1, 2], [1, 2, "x"], [1, 2, 1e300]):
        photo["camera_from_world"]["translation"] = shift
        assert FitRecord.of({"per_image": [photo]}).poses == {}
    photo["camera_from_world"]["translation"] = [1, 2, 3]
    assert [*FitRecord.of({"per_image": [photo]}).poses["a"][1]] == [1, 2, 3]


def test_it_shows_as_one_short_line() -> None:
    assert repr(FIT) == "<fit of 700 corners in 2 photos: 0.100 px RMS>"
