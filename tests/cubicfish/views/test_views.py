import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubicfish import ViewError
from cubicfish.views import CentralView
from cubicfish.views.view import rotation_from_angles


def angle_deg(a, b):
    return math.degrees(math.acos(a @ b / np.linalg.norm(a) / np.linalg.norm(b)))


def test_the_field_is_from_edge_to_edge():
    view = CentralView.with_field("perspective", 100, (640, 480))
    # Half a pixel beyond the outer pixels' centres.
    left, right = view.rays([[-0.5, 239.5], [639.5, 239.5]])
    assert angle_deg(left, right) == pytest.approx(100)
    assert left[0] < 0 < right[0]
    assert view.hfov_deg == pytest.approx(100)
    np.testing.assert_allclose(view.rays([319.5, 239.5]), [0, 0, 1])


def test_the_pinhole_matrix_projects_the_views_rays():
    view = CentralView(kind="perspective", size=(64, 48), focal=30.0)
    pixel = np.array([[3.0, 4.0], [60.0, 44.0]])
    homogeneous = view.rays(pixel) * [7.0] @ view.camera_matrix.T
    np.testing.assert_allclose(homogeneous[:, :2] / homogeneous[:, 2:], pixel)


@pytest.mark.parametrize(
    ("angles", "forward", "right"),
    [
        ({"yaw_deg": 90}, [1, 0, 0], [0, 0, -1]),
        ({"pitch_deg": 90}, [0, -1, 0], [1, 0, 0]),
        ({"roll_deg": 90}, [0, 0, 1], [0, 1, 0]),
        ({"yaw_deg": 90, "roll_deg": 90}, [1, 0, 0], [0, 1, 0]),
        ({"yaw_deg": 90, "pitch_deg": 90}, [0, -1, 0], [0, 0, -1]),
    ],
)
def test_views_turn_right_up_and_clockwise(angles, forward, right):
    # Camera frame: x right, y down, z forward.
    turn = CentralView(
        kind="perspective", size=(3, 3), focal=1.0, rotation=rotation_from_angles(**angles)
    )
    np.testing.assert_allclose(turn.rays([1, 1]), forward, atol=1e-12)
    np.testing.assert_allclose(turn.camera_from_view[:, 0], right, atol=1e-12)


@given(
    st.tuples(st.integers(1, 32_766), st.integers(1, 32_766)),
    st.floats(1e-3, 1e9),
    st.tuples(*[st.floats(-10, 10)] * 3),
)
def test_json_has_all_of_the_view(size, focal, rotation):
    view = CentralView(kind="perspective", size=size, focal=focal, rotation=rotation)
    text = json.dumps(view.as_record())
    assert json.loads(text) == {
        "kind": "perspective",
        "size": list(size),
        "focal": focal,
        "rotation": list(rotation),
    }


@pytest.mark.parametrize("size", [(0, 3), (40_000, 3), (4, -1)])
def test_a_size_that_no_picture_has_is_refused_in_one_line(size):
    with pytest.raises(ViewError, match="size is from 1 to 32766 pixels") as caught:
        CentralView(kind="perspective", size=size, focal=2.0)
    assert "\n" not in str(caught.value)
