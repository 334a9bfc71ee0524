"""Any observations of a small target, and whether two are the same."""

from dataclasses import fields

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cubicfish import Observations, Target
from cubicfish.target import Board
from cubicfish.target.boards.types import Checkerboard

SIZE = (1280, 800)


def grid(name: str, origin: list[float], columns: int = 5, rows: int = 4) -> Board:
    return Checkerboard(
        name=name,
        columns=columns,
        rows=rows,
        square=10.0,
        origin=np.array(origin),
        x_axis=np.array([1.0, 0, 0]),
        y_axis=np.array([0, 1.0, 0]),
    )


TARGET = Target(units="mm", boards=(grid("floor", [0, 0, 0]), grid("wall, left", [0, 0, 50], 7, 3)))


names = st.text(
    st.characters(exclude_categories=["Cs", "Cc", "Cf", "Co", "Cn", "Zl", "Zp", "Zs"]), min_size=1
)


@st.composite
def any_corners(draw: st.DrawFn) -> Observations:
    """Any corners that lie on the boards, each once, in any order."""
    images = draw(st.lists(names, min_size=1, max_size=4, unique=True))
    everywhere = [
        (image, board, column, row)
        for image in range(len(images))
        for board, one in enumerate(TARGET.boards)
        for column in range(one.columns)
        for row in range(one.rows)
    ]
    some = draw(st.lists(st.sampled_from(everywhere), min_size=1, max_size=30, unique=True))
    # The file names a photo only by its corners: number photos by first appearance.
    seen = list(dict.fromkeys(image for image, *_ in some))
    keys = np.array([(seen.index(i), *rest) for i, *rest in some], np.intp)
    count = len(keys)
    x = draw(hnp.arrays(float, count, elements=st.floats(-1, 1280)))
    y = draw(hnp.arrays(float, count, elements=st.floats(-1, 800)))
    weight = draw(hnp.arrays(float, count, elements=st.floats(1e-6, 1e6)))
    certain = draw(hnp.arrays(bool, count))
    return Observations(
        image_size=SIZE,
        images=tuple(images[i] for i in seen),
        boards=TARGET.board_names,
        image=keys[:, 0].copy(),
        board=keys[:, 1].copy(),
        column=keys[:, 2].copy(),
        row=keys[:, 3].copy(),
        pixel=np.stack([x, y], axis=-1),
        weight=weight,
        certain=certain,
    )


def assert_same(one: object, other: object) -> None:
    assert type(one) is type(other)
    for field in fields(one):  # type: ignore[arg-type]
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            np.testing.assert_array_equal(a, b, strict=True)
        else:
            assert a == b, field.name
