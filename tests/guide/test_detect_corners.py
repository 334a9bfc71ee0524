import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from synthetic import checkerboard
from told import raises_told

from cubicfish import DetectionError, Target, detect, load_corners
from cubicfish.find.identification.identified import Decided
from cubicfish.judge import Code
from cubicfish.observe import detection as passes
from cubicfish.observe.detection import first_pass
from cubicfish.photos import find_photos
from cubicfish.workers.pool import Work
from cubicfish_cli.words.remarks import remark_lines
from cubicfish_cli.words.sentences import render

SAMPLE = Path(__file__).parents[2] / "sample_data"


@pytest.fixture(scope="module")
def target():
    return Target.load(SAMPLE / "target.yaml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three good photos, and one of each kind that cannot be used."""
    folder = tmp_path_factory.mktemp("photos")
    for path in sorted((SAMPLE / "photos").iterdir())[:3]:
        shutil.copy(path, folder / path.name)
    (folder / "zz_broken.png").write_bytes(path.read_bytes()[:40])
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    cv2.imwrite(str(folder / "zz_small.png"), picture[:-20])
    cv2.imwrite(str(folder / "zz_black.png"), np.zeros_like(picture))
    return folder


@pytest.fixture(scope="module")
def detection(folder, target):
    return first_pass(find_photos([folder]), [target], Work(jobs=1))


@pytest.mark.slow
def test_corners_have_their_true_names(detection, target):
    true = load_corners(SAMPLE / "true_corners.csv", target)
    where = {
        (true.images[i], b, c, r): pixel
        for i, b, c, r, pixel in zip(
            true.image, true.board, true.column, true.row, true.pixel, strict=True
        )
    }
    found = detection.corners
    miss = [
        np.hypot(*(pixel - where[found.images[i], b, c, r]))
        for i, b, c, r, pixel in zip(
            found.image, found.board, found.column, found.row, found.pixel, strict=True
        )
        if (found.images[i], b, c, r) in where
    ]
    visible = sum(key[0] in found.images for key in where)
    assert len(found.images) == 3
    assert len(miss) > 0.9 * visible
    assert max(miss) < 1
    assert np.median(miss) < 0.1


@pytest.mark.slow
def test_every_photo_is_accounted_for(detection, folder):
    reports = {report.name: report for report in detection.photos}
    assert list(reports) == [photo.name for photo in find_photos([folder])]
    codes = {name: report.refusal.code for name, report in reports.items() if report.refusal}
    assert codes == {
        "zz_broken.png": Code.CANNOT_BE_READ,
        "zz_small.png": Code.OTHER_SIZE,
        "zz_black.png": Code.TOO_DARK,
    }
    good = [report for report in reports.values() if report.problem is None]
    assert [report.name for report in good] == list(detection.corners.images)
    for number, report in enumerate(good):
        assert report.corners == (detection.corners.image == number).sum()
        assert report.exact
        assert len(report.grids) == len(report.found.grids)
        named = sum(grid.verdict is Decided.NAMED for grid in report.grids)
        assert len(report.boards) <= named
        assert len(report.remarks) == len(report.grids) - named


@pytest.mark.slow
def test_photos_that_are_turned_are_told_from_photos_of_another_size(folder, target, tmp_path):
    for path in sorted(folder.glob("*.jpg")):
        shutil.copy(path, tmp_path / path.name)
    picture = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    for name in ("y.png", "z.png"):
        cv2.imwrite(str(tmp_path / name), cv2.rotate(picture, cv2.ROTATE_90_CLOCKWISE))
    cv2.imwrite(str(tmp_path / "x.png"), picture[::2, ::2])
    photos = first_pass(find_photos([tmp_path]), [target], Work(jobs=1)).photos
    height, width = picture.shape
    refused = [one for photo in photos for one in photo.findings]
    assert [(one.code, one.case) for one in refused] == [
        (Code.OTHER_SIZE, ""), (Code.OTHER_SIZE, "turned"), (Code.OTHER_SIZE, "turned")
    ]  # fmt: skip
    assert remark_lines(refused) == [
        f"x.png: {width // 2}x{height // 2} pixels, while most photos are {width}x{height}: "
        "calibrate each size separately",
        f"2 photos (y.png and z.png): {height}x{width} pixels, while most photos are "
        f"{width}x{height}: the same size turned by 90° (portrait and landscape); EXIF "
        "rotation is ignored: save the photos unrotated, or calibrate these separately",
    ]


def with_another_size(target, tmp_path, photos, change):
    """What is detected in so many photos, of which the last is changed."""
    for path in sorted((SAMPLE / "photos").glob("*.jpg"))[:photos]:
        shutil.copy(path, tmp_path / path.name)
    path = tmp_path / path.name
    cv2.imwrite(str(path), change(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)))
    return detect(tmp_path, target)


def places(corners, photo):
    """Where a photo shows each corner."""
    own = corners.image == corners.images.index(photo)
    rows = zip(corners.board[own], corners.column[own], corners.row[own], strict=True)
    return dict(zip(rows, corners.pixel[own], strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "kind"), [((640, 480), "a reduced photo"), ((1440, 1080), "an enlarged photo")]
)
def test_a_photo_of_another_size_is_read_as_the_copy_that_it_is(target, tmp_path, size, kind):
    found = with_another_size(
        target, tmp_path, 3, lambda photo: cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    )
    name = found.photos[2].name
    assert found.photos[2].refusal is None
    assert found.corners.image_size == (960, 720)
    own = places(found.corners, name)
    true = places(load_corners(SAMPLE / "true_corners.csv", target), name)
    error = [np.hypot(*(pixel - true[corner])) for corner, pixel in own.items() if corner in true]
    assert len(error) > 0.9 * len(true)
    assert np.median(error) < 0.1
    assert max(error) < 1
    (told,) = found.findings
    assert (told.code, told.case, told.images) == (Code.OTHER_SIZE, "copy", (name,))
    width, height = size
    assert render(told).line == (
        f"{name} has {width}x{height} pixels, while most photos have 960x720: taken as {kind} of "
        "the same camera; --exclude it if the camera was set to another mode, crop or zoom"
    )


@pytest.mark.slow
def test_a_cropped_photo_of_the_same_shape_is_left_out(target, tmp_path):
    found = with_another_size(target, tmp_path, 10, lambda photo: photo[90:630, 120:840])
    assert [photo.name for photo in found.photos if photo.lost] == [found.photos[-1].name]


@pytest.mark.slow
def test_jobs_change_nothing_but_the_time(detection, folder, target):
    calls = []
    again = first_pass(
        find_photos([folder]), [target], Work(jobs=2, progress=lambda *at: calls.append(at))
    )
    np.testing.assert_array_equal(again.corners.pixel, detection.corners.pixel)
    np.testing.assert_array_equal(again.corners.column, detection.corners.column)
    assert [report.problem for report in again.photos] == [
        report.problem for report in detection.photos
    ]
    assert calls == [(number, 6) for number in range(1, 7)]


def flat(columns: int, rows: int) -> Target:
    return Target(units="mm", boards=(checkerboard("b", columns, rows, 30.0),))


@pytest.fixture(scope="module")
def flat_photo(tmp_path_factory):
    """A whole flat board of 8x5 inner corners, seen straight on."""
    side = 60
    squares = (np.add(*np.indices((6, 9))) % 2 * 200 + 30).astype(np.uint8)
    board = np.kron(squares, np.ones((side, side), np.uint8))
    picture = np.full((720, 960), 230, np.uint8)
    picture[180:540, 210:750] = board
    picture = cv2.GaussianBlur(picture, (0, 0), 0.7)
    folder = tmp_path_factory.mktemp("flat")
    for number in range(2):
        cv2.imwrite(str(folder / f"{number}.png"), picture)
    return folder


def test_a_flat_board_seen_straight_on_is_named(flat_photo):
    found = first_pass(find_photos([flat_photo]), [flat(8, 5)], Work()).corners
    assert len(found.pixel) == 80
    first = (found.image == 0) & (found.column == 0) & (found.row == 0)
    np.testing.assert_allclose(found.pixel[first][0], [269.5, 239.5], atol=0.1)


def test_photos_are_searched_once_for_boards_of_either_colour(flat_photo, monkeypatch):
    searched, search = [], passes.detect_in_photo

    def counted(photo, **how):
        searched.append(photo.name)
        return search(photo, **how)

    monkeypatch.setattr(passes, "detect_in_photo", counted)
    target = flat(8, 5)
    other = target.with_boards({0: target.boards[0].with_other_colours()})
    found = first_pass(find_photos([flat_photo]), [target, other], Work(jobs=1))
    assert found.corners.target is target
    assert len(searched) == 2


def test_counted_squares_are_refused_with_both_counts(flat_photo):
    with raises_told(DetectionError, r"found 8x5 .* target says 9x6: were squares counted"):
        first_pass(find_photos([flat_photo]), [flat(9, 6)], Work())


def test_a_board_larger_than_the_targets_says_so(flat_photo):
    said = (
        r"^2 photos show grids of 8x5 inner corners, but the target has one board of "
        r"another size \(b 6x4\): give the target that the photos show"
    )
    with raises_told(DetectionError, said):
        first_pass(find_photos([flat_photo]), [flat(6, 4)], Work())


def test_photos_without_a_board_say_what_to_check(tmp_path, target):
    rng = np.random.default_rng(0)
    for number in range(2):
        smooth = cv2.GaussianBlur(rng.uniform(0, 255, (240, 320)), (0, 0), 8)
        cv2.imwrite(str(tmp_path / f"{number}.png"), 20 * (smooth - smooth.mean()) + 128)
    with raises_told(
        DetectionError, r"^2 photos, no checkerboard: too blurred .*; focus"
    ) as caught:
        first_pass(find_photos([tmp_path]), [target], Work())
    assert "\n" not in str(caught.value)


def test_unreadable_photos_say_why(tmp_path, target):
    (tmp_path / "a.png").write_bytes(b"")
    (tmp_path / "b.png").write_bytes(b"")
    with raises_told(DetectionError, r"no photo can be used: .*a\.png is empty.* 1 more"):
        first_pass(find_photos([tmp_path]), [target], Work())
    with raises_told(DetectionError, "no photo was given"):
        first_pass([], [target], Work())
