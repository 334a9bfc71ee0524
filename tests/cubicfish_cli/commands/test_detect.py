"""detect, and calibrate and evaluate from photos: what comes of good photos and of bad ones."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from running import Run
from samples import SAMPLE

from cubicfish import Finding, OutputError, Target, load_corners
from cubicfish.find import PhotoReport
from cubicfish.find.detection.grids import FoundGrids
from cubicfish.find.identification.identified import Decided, GridReport
from cubicfish.judge import Code
from cubicfish.photos import Photo
from cubicfish_cli.render.drawings import drawings
from cubicfish_cli.terminal.figures import lost_word

TARGET = SAMPLE / "target.yaml"
PHOTOS = [SAMPLE / "photos" / f"corner_{number:02d}.jpg" for number in (1, 3)]


@pytest.fixture(scope="module")
def detected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """corners.csv of two sample photos and a black one, with what was printed beside it."""
    from running import run_cli

    folder = tmp_path_factory.mktemp("detected")
    cv2.imwrite(str(folder / "black.png"), np.zeros((720, 960), np.uint8))
    args = ["detect", *PHOTOS, folder / "black.png", "-t", TARGET, "-o", folder / "corners.csv"]
    result = run_cli(*args, "--draw", folder / "seen", "--json")
    (folder / "stdout").write_text(result.stdout)
    (folder / "stderr").write_text(result.stderr)
    return folder


@pytest.mark.slow
def test_found_corners_are_where_the_lens_put_them(detected: Path) -> None:
    target = Target.load(TARGET)
    found = load_corners(detected / "corners.csv", target)
    true = load_corners(SAMPLE / "true_corners.csv", target)

    def table(corners: object) -> dict[tuple[object, ...], np.ndarray]:
        names = (corners.images[i] for i in corners.image)  # type: ignore[attr-defined]
        keys = zip(names, corners.board, corners.column, corners.row, strict=True)  # type: ignore[attr-defined]
        return dict(zip(keys, corners.pixel, strict=True))  # type: ignore[attr-defined]

    truth = table(true)
    assert found.images == ("corner_01.jpg", "corner_03.jpg")
    assert len(found.pixel) > 200
    off = [
        np.linalg.norm(pixel - truth[key]) for key, pixel in table(found).items() if key in truth
    ]
    assert len(off) > 200
    assert max(off) < 0.5


@pytest.mark.slow
def test_json_has_a_row_for_every_photo(detected: Path) -> None:
    record = json.loads((detected / "stdout").read_text())
    assert record["file"] == str(detected / "corners.csv")
    assert record["images"] == 2
    assert record["corners"] == sum(photo["corners"] for photo in record["per_image"])
    first, _, black = sorted(record["per_image"], key=lambda photo: -photo["corners"])
    assert set(first["boards"]) == {"floor", "left", "right"}
    assert first["problem"] is None
    assert (black["image"], black["corners"], black["boards"]) == ("black.png", 0, [])
    (reported,) = black["findings"]
    assert (reported["code"], reported["severity"], reported["remedy"]) == (
        "too_dark",
        "care",
        "take_again",
    )
    assert (reported["images"], reported["what"] + "; " + reported["do"]) == (
        ["black.png"],
        black["problem"],
    )
    said = (detected / "stderr").read_text()
    assert "Looking for corners in 3 photos." in said
    assert f"black.png: {black['problem']}" in said


@pytest.mark.slow
def test_every_photo_is_drawn(detected: Path) -> None:
    names = sorted(path.name for path in (detected / "seen").iterdir())
    assert names == ["black.png", "corner_01.png", "corner_03.png"]
    drawn = cv2.imread(str(detected / "seen" / "corner_01.png"))
    assert drawn.shape == (720, 960, 3)
    assert np.ptp(drawn.astype(int), axis=2).max() > 100


@pytest.mark.parametrize(
    ("names", "folder", "drawn"),
    [
        (["a.jpg", "b.x.png"], "seen", ["a.png", "b.x.png"]),
        (["a.jpg", "A.tif"], "seen", ["a.jpg.png", "A.tif.png"]),
        (["left/a.jpg", "right/a.jpg"], "seen", ["left/a.png", "right/a.png"]),
        (["a.png", "b.png"], ".", ["a.png.png", "b.png.png"]),
    ],
)
def test_drawings_have_names_of_their_own(
    tmp_path: Path, names: list[str], folder: str, drawn: list[str]
) -> None:
    photos = [Photo(name=name, path=tmp_path / name) for name in names]
    pictures = drawings(tmp_path / folder, photos)
    assert pictures == {
        name: tmp_path / folder / one for name, one in zip(names, drawn, strict=True)
    }


def test_drawings_never_replace_photos(tmp_path: Path) -> None:
    photos = [Photo(name=name, path=tmp_path / name) for name in ("a.png", "a.png.png")]
    with pytest.raises(OutputError, match="choose another folder"):
        drawings(tmp_path, photos)


def test_existing_corners_are_refused_before_the_work(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        pytest.fail("the work must not start")

    monkeypatch.setattr("cubicfish.observe.detection.first_pass", fail)
    path = tmp_path / "corners.csv"
    path.write_text("old")
    said = run("detect", *PHOTOS, "-t", TARGET, "-o", path, code=1).stderr
    assert "corners.csv exists already" in said
    assert path.read_text() == "old"
    (tmp_path / "corner_03.png").write_text("old")
    args = ["detect", *PHOTOS, "-t", TARGET, "-o", tmp_path / "new.csv", "--draw", tmp_path]
    assert "corner_03.png exists already" in run(*args, code=1).stderr


@pytest.mark.slow
def test_a_camera_is_evaluated_on_photos(run: Run, calibrated: Path) -> None:
    args = ["evaluate", PHOTOS[0], "-t", TARGET, "-m", calibrated / "camera.yaml"]
    record = json.loads(run(*args, "--json").stdout)
    assert record["images"] == 1
    assert record["corners"] > 100
    assert record["rms_px"] < 0.1


@pytest.mark.slow
def test_a_camera_is_calibrated_from_one_photo_of_several_boards(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "c"
    said = run("calibrate", PHOTOS[0], "-t", TARGET, "--no-hold-out", "-o", out).stdout
    assert "\n1 photo, " in said
    names = sorted(path.name for path in out.iterdir())
    assert names == ["camera.yaml", "corners.csv", "undistort_map.npz"]
    record = json.loads(
        run("evaluate", PHOTOS[1], "-t", TARGET, "-m", out / "camera.yaml", "--json").stdout
    )
    assert record["rms_px"] < 1


@pytest.mark.parametrize(
    ("args", "code", "message"),
    [
        (["detect", "-t", TARGET], 2, "Missing argument"),
        (["detect", *PHOTOS], 2, "name the target that the photos show with --target target.yaml"),
        (["detect", "black.png", "-t", TARGET], 1, "use a longer exposure"),
        (["detect", "text.png", "-t", TARGET], 1, "text.png"),
        (["detect", "empty", "-t", TARGET], 1, "empty"),
        (["calibrate", "black.png", "-t", TARGET], 1, "use a longer exposure"),
    ],
)
def test_photos_without_corners_say_why_and_leave_nothing(
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    args: list[object],
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("black.png", np.zeros((720, 960), np.uint8))
    Path("text.png").write_text("not a picture")
    Path("empty").mkdir()
    result = run(*args, code=code)
    assert message in result.stderr.splitlines()[-1]
    assert result.stdout == ""
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["black.png", "empty", "text.png"]


@pytest.mark.slow
def test_boards_that_look_alike_are_left_out_where_they_are_alone(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    board = "type: checkerboard, corners: [7, 5], square: 25"
    Path("twins.yaml").write_text(
        "units: mm\nboards:\n"
        f"  - {{name: one, {board}, origin: [0, 0, 0], x_axis: [1, 0, 0], y_axis: [0, 1, 0]}}\n"
        f"  - {{name: two, {board}, origin: [0, 40, 300], x_axis: [-1, 0, 0], y_axis: [0, 1, 0]}}\n"
    )
    run("simulate", "-t", "twins.yaml", "-m", SAMPLE / "true_camera.yaml", "-n", 3)
    said = run("detect", "simulated", "-t", "twins.yaml", code=1).stderr.splitlines()[-1]
    assert "3 grids of up to 7x5 inner corners in 3 photos" in said
    assert "could be any of several boards that look alike" in said
    assert said.endswith("take photos that show these boards together")


def test_a_photo_whose_grids_are_left_out_is_not_called_empty() -> None:
    grid = GridReport(verdict=Decided.TWIN, place=None, corners=35, size=(7, 5), rms_px=0.1)
    empty = FoundGrids(grids=(), refused=np.zeros((0, 2)), image_size=(64, 48))
    lost = [
        PhotoReport(name="a.png", grids=(grid,), remarks=(Finding(code=Code.TOO_LARGE),)),
        PhotoReport(name="b.png", refusal=Finding(code=Code.TOO_DARK), found=empty),
        PhotoReport(name="d.png", refusal=Finding(code=Code.CANNOT_BE_READ)),
        PhotoReport(name="c.png", refusal=Finding(code=Code.OTHER_SIZE)),
    ]
    assert all(one.lost for one in lost)
    assert [lost_word(one) for one in lost] == [
        "left out",
        "nothing found",
        "cannot be read",
        "another size",
    ]
