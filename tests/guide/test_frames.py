"""Choosing frames and photos in a program: what is looked at, and when that ends."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("av")

from filming import RATE, SIZE, TARGET, photos, spoilt_film, write_film
from listening import Heard
from told import raises_told

from cubicfish import DetectionError, Finding, Observations, PhotoError, Run, Target, read_picture
from cubicfish.find.detection.grids import FoundGrids, Grid
from cubicfish.judge import Code, Severity
from cubicfish.observe import glances
from cubicfish.photos import Photo
from cubicfish_cli.extensions.films.command import FramesOptions, choose_frames
from cubicfish_cli.films import frame_search
from cubicfish_cli.films.choose import Choice, Patch, Seen
from cubicfish_cli.films.frame_search import Found, Search


def search(monkeypatch, adds: list[bool], most: int = 60) -> Search:
    """A search, in rounds of two, of pictures some of which add something."""

    def choose(seen, size, most, still, gains) -> Choice:
        shown = [at for at, one in enumerate(seen) if one.corners]
        order = [at for at in shown if adds[at]][:most]
        ended = "asked" if len(order) == most else "enough" if len(order) < len(shown) else "all"
        return Choice(order=tuple(order), gain=(0.0,) * len(order), ended=ended)

    monkeypatch.setattr(frame_search, "choose", choose)
    photos = [Photo(name=str(at), path=Path(str(at))) for at in range(len(adds))]
    return Search(
        glances=glances.Glances(photos=photos, size=SIZE),
        seen=[Seen(sharpness=1.0)] * len(adds),
        most=most,
        targets=None,
        run=Run(),
        what="frames",
        at_once=2,
        quick_jobs=1,
    )


def search_by(looking: Search, quick, full, good, others) -> None:
    """Search by detections that are made up."""
    looking.detect_quickly, looking.detect = quick, full
    looking.search(good, others)


def shows(what: list[bool], findings=()):
    """A detection in pictures of which some show the object."""
    patch = Patch(board=0, cells=np.zeros((1, 2), int), pixel=np.zeros((1, 2)))

    def found(numbers) -> Found:
        seen = [str(at) for at in numbers if what[at]]
        return Found(patches=dict.fromkeys(seen, (patch,)), findings=findings)

    return found


def shows_nothing(numbers) -> Found:
    raise DetectionError("nothing there")


def test_what_is_uncertain_of_names_goes_along() -> None:
    """Near copies are told by it."""
    places = [[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]]
    pixel = np.arange(8.0).reshape(4, 2)
    corners = Observations.from_corners(
        [places, places], [pixel, pixel], (64, 48), images=["a", "b"], boards=["board"]
    )
    corners = replace(corners, certain=corners.image == 0)
    patches = frame_search.patches_of_corners(corners)
    assert {name: [one.certain for one in own] for name, own in patches.items()} == {
        "a": [True],
        "b": [False],
    }


def test_pictures_are_searched_until_hardly_any_is_chosen(monkeypatch) -> None:
    all_ten, way = list(range(10)), shows([True] * 10)
    # One that adds nothing, in the first round or in the second, says nothing of the others.
    for useless in (5, 6):
        looking = search(monkeypatch, [at != useless for at in range(10)])
        search_by(looking, way, way, all_ten, [])
        assert looking.searched == set(range(10))
    # Rounds are 0 and 5, 1 and 6, ...
    looking = search(monkeypatch, [at in (0, 5) for at in range(10)])
    search_by(looking, way, way, all_ten, [])
    assert looking.searched == {0, 5, 1, 6}
    looking = search(monkeypatch, [True] * 10, most=4)
    search_by(looking, way, way, all_ten, [])
    assert looking.searched == {0, 5, 1, 6}


def test_pictures_that_show_nothing_do_not_end_the_search(monkeypatch) -> None:
    looking = search(monkeypatch, [True] * 10)
    way = shows([at in (4, 9) for at in range(10)])
    search_by(looking, way, way, range(10), [])
    assert looking.choice.order == (4, 9)
    with pytest.raises(DetectionError, match="nothing there"):
        search_by(search(monkeypatch, [True] * 4), shows([False] * 4), shows_nothing, range(4), [])


def test_worse_pictures_are_searched_where_good_ones_show_little(monkeypatch) -> None:
    good, others = [0, 1, 2, 3], [4, 5, 7]
    looking = search(monkeypatch, [True] * 8)
    search_by(looking, shows([True] * 8), shows_nothing, good, others)
    assert looking.searched == set(good)
    looking = search(monkeypatch, [True] * 8)
    way = shows([False] * 3 + [True] * 5)
    search_by(looking, way, way, good, others)
    assert looking.searched == {*good, *others}
    assert looking.choice.order == (3, 4, 5, 7)


def test_what_quick_detection_misses_is_detected_fully(monkeypatch) -> None:
    quick, full = shows([at == 0 for at in range(8)]), shows([at > 0 for at in range(8)])
    looking = search(monkeypatch, [True] * 8)
    search_by(looking, quick, full, range(8), [])
    assert looking.choice.order == tuple(range(1, 8))  # what quick detection found is forgotten
    looking = search(monkeypatch, [True] * 8)
    search_by(looking, shows([True] * 8), shows_nothing, range(8), [])


@pytest.mark.parametrize(("hidden", "chosen"), [(3, 11), (10, 13)])
def test_full_detection_follows_where_the_quick_one_finds_fewer_than_the_verdict_asks_for(
    monkeypatch, hidden: int, chosen: int
) -> None:
    seen = shows([at >= hidden for at in range(26)])
    looking = search(monkeypatch, [at % 2 == 0 for at in range(26)])
    looking.at_once = 26
    search_by(looking, seen, shows([True] * 26), range(26), [])
    assert len(looking.choice.order) == chosen


def asked_of(what: list[bool], asked: list[list[int]]):
    """A detection as :func:`shows`, that notes what it is asked for, and refuses empty pictures."""
    way = shows(what)

    def found(numbers) -> Found:
        asked.append(list(numbers))
        return way(numbers) if any(what[at] for at in numbers) else shows_nothing(numbers)

    return found


@pytest.mark.parametrize("hidden", [0, 20])
def test_of_pictures_that_seem_empty_some_tell_of_all(monkeypatch, hidden: int) -> None:
    looking, asked = search(monkeypatch, [True] * 60), []
    quick = shows([at < 20 for at in range(60)])
    full = asked_of([at < 20 or 60 - at <= hidden for at in range(60)], asked)
    search_by(looking, quick, full, range(50), range(50, 60))
    assert set(asked[0]) < set(range(20, 60))
    assert 6 <= len(asked[0]) <= 12
    assert (len(asked) > 1) == (hidden > 0)
    assert len(looking.choice.order) == 20 + max(0, hidden - (len(asked) == 2) * 10)


@pytest.mark.parametrize("is_film", [True, False])
def test_a_film_without_boards_is_given_up_after_some(monkeypatch, is_film: bool) -> None:
    looking, asked = search(monkeypatch, [True] * 60), []
    looking.glances.is_film, looking.at_once = is_film, 24
    with pytest.raises(DetectionError, match="nothing there"):
        search_by(looking, shows([False] * 60), asked_of([False] * 60, asked), range(60), [])
    assert max(map(len, asked)) == (20 if is_film else 60)


def test_a_board_that_is_lost_in_a_picture_is_looked_for_beside_it(monkeypatch) -> None:
    """From picture to picture, whichever of them was searched first."""
    cells = np.stack(np.meshgrid(np.arange(4), np.arange(4)), axis=-1).reshape(-1, 2)
    grid = Grid(cells=cells, pixel=9.0 * cells, parity=1, step=9.0, contrast=np.ones(16))
    clear, dim = {6}, {2, 3, 4, 5, 8}

    def quick(one, *, target):
        number = int(one.name)
        shown = number in clear or (number in dim and any(near.grids for near in one.near))
        grids = (grid,) if shown else ()
        return FoundGrids(grids=grids, refused=np.zeros((0, 2)), image_size=SIZE)

    monkeypatch.setattr(glances, "_quick_detect", quick)
    looking = search(monkeypatch, [True] * 10)
    looking.glances.is_film, looking.detect = True, shows([False] * 10)
    looking.search(range(10), [])
    # The picture next to the last one shows nothing.
    assert set(looking.choice.order) == {2, 3, 4, 5, 6}


def test_counts_of_corners_that_few_pictures_show_end_the_search(monkeypatch) -> None:
    """Those few that can be named are of the wrong names, or show a part of the board."""
    counts = Finding(
        code=Code.CORNER_COUNT,
        case="all_squares",
        severity=Severity.BAD,
        figures={"columns": 1, "rows": 2, "drawn_columns": 3, "drawn_rows": 4, "photos": 9},
    )
    few = shows([at < 2 for at in range(10)], (counts,))
    with raises_told(DetectionError, "found 1x2 inner corners in 9 photos"):
        search_by(search(monkeypatch, [True] * 10), shows([False] * 10), few, range(10), [])
    # Found quickly it is a reason to detect fully, which reports it or not.
    looking = search(monkeypatch, [True] * 10)
    search_by(looking, shows([True] * 10, (counts,)), shows([True] * 10), range(10), [])
    assert len(looking.choice.order) == 10


@pytest.fixture
def target(tmp_path: Path) -> Target:
    (tmp_path / "target.yaml").write_text(TARGET)
    return Target.load(tmp_path / "target.yaml")


@pytest.mark.slow
def test_a_program_chooses_frames(tmp_path: Path, target: Target) -> None:
    film = write_film(tmp_path / "film.mp4", spoilt_film()[0])
    heard = Heard()
    chosen = choose_frames(
        FramesOptions(films=film, folder=tmp_path / "photos", target=target, most=5),
        run=Run(listener=heard),
    )
    assert len(chosen.photos) == 5
    assert read_picture(chosen.photos[0]).shape[:2] == SIZE[::-1]
    assert chosen.frames == len(spoilt_film()[0])
    reading = heard.of("Reading film.mp4")
    assert reading == sorted(reading)
    assert "Glancing at frames" in {step[0] for step in heard.steps}
    assert chosen.ended == "5 frames: as many as were asked for"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("codec", "pix_fmt"), [("libx265", "yuv420p10le"), ("ffv1", "yuv422p10le"), ("ffv1", "gray")]
)
def test_films_of_other_codecs_and_depths_are_read(
    codec: str, pix_fmt: str, tmp_path: Path, target: Target
) -> None:
    frames = [photo for photo in photos()[:3] for _ in range(3)]
    quiet = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    film = write_film(tmp_path / "film.mkv", frames, codec=codec, pix_fmt=pix_fmt, options=quiet)
    chosen = choose_frames(FramesOptions(films=film, folder=tmp_path / "photos", target=target))
    assert len(chosen.photos) == 3
    for path in chosen.photos:
        picture = read_picture(path)
        assert picture.dtype == np.uint8
        assert picture.ndim == (2 if pix_fmt == "gray" else 3)
        number = round(float(path.stem.split("_")[1][:-1]) * RATE)
        grey = picture if picture.ndim == 2 else picture[..., 1]
        assert np.abs(grey.astype(int) - frames[number]).mean() < 4


def test_what_is_no_film_is_refused(tmp_path: Path) -> None:
    for films, says in (([], "no film was given"), (tmp_path / "*.mp4", "matches no film")):
        with pytest.raises(PhotoError, match=says):
            choose_frames(FramesOptions(films=films, folder=tmp_path / "photos"))
