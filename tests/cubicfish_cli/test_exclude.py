"""Photos that ``--exclude`` leaves out: by name, by path, by pattern; from tables too."""

from pathlib import Path

import pytest
from running import run_cli
from samples import SAMPLE

from cubicfish import PhotoError
from cubicfish_cli.inputs.paths import not_excluded

PHOTOS = [("a1.png", Path("left/a1.png")), ("a2.png", Path("left/a2.png")), ("b[1].png",) * 2]
NAMED = [(name, Path(path)) for name, path in PHOTOS]


@pytest.mark.parametrize(
    ("patterns", "kept"),
    [
        ([], [0, 1, 2]),
        (["a1.png"], [1, 2]),
        (["left/a2.png"], [0, 2]),
        (["./left/../left/a2.png"], [0, 2]),
        ([Path("left/a1.png").absolute()], [1, 2]),
        (["left/*"], [2]),
        (["a?.png", "a1.png"], [2]),
        (["b[1].png"], [0, 1]),
    ],
)
def test_names_paths_and_patterns_leave_photos_out(patterns: list[str], kept: list[int]) -> None:
    assert not_excluded(NAMED, list(map(Path, patterns))) == kept


@pytest.mark.parametrize(
    ("patterns", "said"),
    [(["a3.png"], "did you mean 'a"), (["right/*"], "none"), ([""], "none"), (["*"], "no ")],
)
def test_what_leaves_out_none_or_all_is_refused(patterns: list[str], said: str) -> None:
    with pytest.raises(PhotoError, match="--exclude") as caught:
        not_excluded(NAMED, list(map(Path, patterns)))
    assert said in str(caught.value)


def test_photos_of_a_table_are_left_out(tmp_path: Path) -> None:
    given = ("calibrate", SAMPLE / "true_corners.csv", "-t", SAMPLE / "target.yaml")
    line = (*given, "--no-hold-out", "--no-report", "-o", tmp_path / "c")
    run_cli(*line, "--exclude", "corner_01.jpg", "--exclude", "corner_0[2-6]*")
    assert "corner_07.jpg" in (tmp_path / "c" / "camera.yaml").read_text()
    written = (tmp_path / "c" / "corners.csv").read_text()
    assert not any(f"corner_0{n}" in written for n in range(1, 7))
    assert "corner_07.jpg" in written
