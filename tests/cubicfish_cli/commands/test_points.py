"""project and unproject: text in, text out, exactly."""

from pathlib import Path

import numpy as np
import pytest
from running import Run

from cubicfish import load_camera


@pytest.fixture
def model(calibrated: Path) -> Path:
    return calibrated / "camera.yaml"


def numbers(text: str) -> np.ndarray:
    return np.array([[float(cell) for cell in line.split(",")] for line in text.splitlines()])


@pytest.mark.slow
def test_points_are_projected_as_the_library_does(run: Run, model: Path, tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(0.5, 1, size=(20, 3))
    path = tmp_path / "points.csv"
    path.write_text("\n".join(",".join(map(repr, row)) for row in points.tolist()))
    said = numbers(run("project", path, "-m", model).stdout)
    np.testing.assert_array_equal(said, load_camera(model).camera.project(points))


def test_unproject_and_project_are_each_others_inverse(run: Run, model: Path) -> None:
    pixels = "480.25,350.5\n200.0,160.0\n700.0,500.125\n"
    rays = run("unproject", "-m", model, input=pixels).stdout
    np.testing.assert_allclose(np.linalg.norm(numbers(rays), axis=1), 1)
    back = run("project", "-m", model, input=rays).stdout
    np.testing.assert_allclose(numbers(back), numbers(pixels), atol=1e-6)


def test_what_is_outside_the_field_is_nan(run: Run, model: Path) -> None:
    assert run("project", "-m", model, input="0,0,-1\n1,0,inf\n").stdout == "nan,nan\nnan,nan\n"
    assert run("unproject", "-m", model, input="-5000,0\nnan,nan\n").stdout == (
        "nan,nan,nan\nnan,nan,nan\n"
    )


def test_a_header_in_gives_a_header_out(run: Run, model: Path) -> None:
    plain = run("project", "-m", model, input="0,0,1\n").stdout
    assert run("project", "-m", model, input="\ufeffX,Y,Z\r\n0,0,1\r\n").stdout == "x,y\n" + plain
    assert run("project", "-m", model, input="\ufeff0,0,1\n").stdout == plain
    assert run("unproject", "-m", model, input="x,y\n").stdout == "X,Y,Z\n"
    assert run("unproject", "-m", model, input="").stdout == ""


@pytest.mark.parametrize("text", ["0 0 1\n", "0;0;1\n", "# a comment\n\n0,\t0 ,1\n"])
def test_other_separators_are_read(run: Run, model: Path, text: str) -> None:
    assert run("project", "-m", model, input=text).stdout == (
        run("project", "-m", model, input="0,0,1\n").stdout
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0,0,1\n0,0\n", "stdin, line 2: 2 numbers where 3 belong: X, Y, Z"),
        ("0,0,1\n0,0,z\n", "stdin, line 2: '0,0,z' does not hold numbers only"),
        ("X,Y,Z\nX,Y,Z\n", "stdin, line 2: 'X,Y,Z' does not hold numbers only"),
    ],
)
def test_bad_lines_are_named(run: Run, model: Path, text: str, message: str) -> None:
    result = run("project", "-m", model, input=text, code=1)
    assert result.stderr == f"Error: {message}\n"
    assert result.stdout == ""


def test_nothing_to_read_is_said(run: Run, model: Path, tmp_path: Path) -> None:
    path = tmp_path / "empty.csv"
    for text in ("", "\n# only a comment\n"):
        path.write_text(text)
        said = run("project", path, "-m", model, code=1).stderr
        assert said == f"Error: {path} holds no points: give X,Y,Z a line\n"
        said = run("unproject", path, "-m", model, code=1).stderr
        assert said == f"Error: {path} holds no points: give x,y a line\n"
    piped = run("unproject", "-m", model, input="")
    assert (piped.stdout, piped.stderr) == (
        "",
        "note: stdin holds no points: give x,y a line\n",
    )
    path.write_text("x,y\n")  # a table of no rows is one too
    assert run("unproject", path, "-m", model).stdout == "X,Y,Z\n"


def test_unreadable_files_are_named(run: Run, model: Path, tmp_path: Path) -> None:
    said = run("project", tmp_path / "no.csv", "-m", model, code=1).stderr
    assert "no.csv does not exist: check the name" in said
    (tmp_path / "a.png").write_bytes(b"\x89PNG\xff")
    said = run("project", tmp_path / "a.png", "-m", model, code=1).stderr
    assert "a.png is not UTF-8 text" in said


def test_one_point_may_stand_on_the_command_line(run: Run, calibrated: Path) -> None:
    end = ("-m", calibrated)
    piped = run("project", *end, input="-0.2,0.1,1").stdout
    assert run("project", "-0.2,0.1,1", *end).stdout == piped
    assert run("project", *end, "-0.2,0.1,1").stdout == piped
    back = run("unproject", piped.strip(), *end).stdout
    ray = [float(number) for number in back.split(",")]
    assert ray[0] / ray[2] == pytest.approx(-0.2, abs=1e-9)
    assert "is no point: write X,Y,Z" in run("project", "0.2,0.1", *end, code=1).stderr
