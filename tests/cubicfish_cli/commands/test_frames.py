"""frames, and calibrate from films: what is chosen of good films and said of bad ones."""

import json
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("av")

import av
from filming import RATE, SIZE, TARGET, photos, spoilt_film, write_film, write_sound
from reference import keys_of
from running import Run

from cubicfish import Target, load_camera, load_corners
from cubicfish.files import FrameName
from cubicfish.observe import glances
from cubicfish_cli.films import scan

pytestmark = pytest.mark.slow


@pytest.fixture
def target(tmp_path: Path) -> Path:
    path = tmp_path / "object.yaml"
    path.write_text(TARGET)
    return path


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight photos of a board, with spoilt frames between."""
    return write_film(tmp_path_factory.mktemp("film") / "lens a.mp4", spoilt_film()[0])


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three photos, each held for four frames."""
    frames = [photo for photo in photos()[:3] for _ in range(4)]
    return write_film(tmp_path_factory.mktemp("film") / "short.mp4", frames)


def times(folder: Path) -> list[float]:
    """Seconds of the frames that were chosen."""
    named = [FrameName.read(path.name) for path in sorted(folder.glob("*.png"))]
    return [one[1] for one in named if one is not None]


@pytest.mark.parametrize("known", [True, False])
def test_none_of_the_spoilt_frames_is_chosen(
    run: Run, film: Path, target: Path, tmp_path: Path, known: bool
) -> None:
    out = tmp_path / "photos"
    run("frames", film, "-o", out, "-j", 1, *(["--target", target] if known else []))
    kinds = spoilt_film()[1]
    chosen = [round(RATE * seconds) for seconds in times(out)]
    assert {kinds[number] for number in chosen} == {"photo"}
    taken = [number // 7 for number in chosen]
    assert len(set(taken)) == len(taken)  # no copies
    assert len(taken) >= 7
    names = [f"lens a_{number / RATE:010.3f}s.png" for number in chosen]
    for number, name in zip(chosen, names, strict=True):
        picture = cv2.imread(str(out / name), cv2.IMREAD_UNCHANGED)
        assert picture.shape == (SIZE[1], SIZE[0], 3)
        off = picture[..., 0].astype(int) - spoilt_film()[0][number]
        assert np.abs(off - off.mean()).mean() < 2
    assert (out / "contact_sheet.html").read_text().count("<img") == len(chosen)
    assert {path.name for path in out.iterdir()} == {*names, "contact_sheet.html"}


def test_no_more_frames_are_chosen_than_asked_for(
    run: Run, film: Path, target: Path, tmp_path: Path
) -> None:
    out = tmp_path / "photos"
    said = run("frames", film, "-o", out, "--most", 4, "--target", target, "-j", 1)
    assert "\n4 frames: as many as were asked for\n" in said.stdout
    assert len(times(out)) == 4


@pytest.fixture(scope="module")
def two_boards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight photos of a board and three of a smaller one, each held for three frames."""
    frames = [photo for photo in (*photos(), *photos(3, 5, 3)) for _ in range(3)]
    return write_film(tmp_path_factory.mktemp("film") / "film.mp4", frames)


@pytest.mark.parametrize(
    ("command", "board", "says"),
    [
        ("frames", "7x4", "photos show grids of 7x5 (in 24) and 5x3 (in 9) inner corners, but"),
        ("calibrate", "8x6", "found 7x5 inner corners in "),
        (
            "frames",
            "5x3",
            "photos show grids of 7x5 (in 24) inner corners, but the target has one board of",
        ),
    ],
)
def test_a_board_of_another_count_is_reported_before_anything_is_chosen(
    run: Run, two_boards: Path, tmp_path: Path, command: str, board: str, says: str
) -> None:
    """Also where a few frames show so little of the board that they fit it."""
    film = two_boards
    said = run(
        command, film, "--board", board, "--square", "40mm", "-o", tmp_path / "p", "-j", 1, code=1
    )  # fmt: skip
    error = said.stderr.splitlines()[-1]
    assert error.startswith("Error: no frame can be chosen of film.mp4: ")
    assert says in error
    assert not list(tmp_path.rglob("*.png"))


def test_json_has_its_keys(run: Run, short: Path, tmp_path: Path) -> None:
    said = run("frames", short, "-o", tmp_path / "p", "--json", "-j", 1).stdout
    record = json.loads(said)
    assert set(record) == set(keys_of("frames"))
    assert record["frames"] == 12
    assert record["ended"] == "all 3 usable frames"
    assert [Path(one).exists() for one in record["photos"]] == [True] * 3
    (one,) = record["films"]
    assert (one["frames"], one["image_size"], one["problem"]) == (12, list(SIZE), None)
    assert one["seconds"] == pytest.approx(1.1)


def test_frames_are_not_replaced_unasked(run: Run, short: Path, tmp_path: Path) -> None:
    out = tmp_path / "p"
    run("frames", short, "-o", out, "-j", 1)
    before = sorted(path.name for path in out.iterdir())
    assert "exists already" in run("frames", short, "-o", out, "-j", 1, code=1).stderr
    own = out / "mine.png"
    own.write_bytes(b"mine")
    run("frames", short, "-o", out, "--most", 1, "--overwrite", "-j", 1)
    left = sorted(path.name for path in out.glob("*.png"))
    assert len(left) == 2  # the earlier choice went, what the user put there did not
    assert "mine.png" in left
    assert set(left) - {"mine.png"} < set(before)


def test_of_a_run_that_was_interrupted_nothing_is_left(
    run: Run, short: Path, tmp_path: Path, monkeypatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        assert list((tmp_path / "p" / ".unfinished" / "short").glob("*.*"))
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(glances, "_quick_detect", stop)
        patch.setattr(scan, "_MOST_HELD", 0)  # frames are in files
        run("frames", short, "-o", tmp_path / "p", "-j", 1, code=130)
    assert not (tmp_path / "p").exists()
    killed = tmp_path / "p" / ".unfinished" / "short" / "7.png"
    killed.parent.mkdir(parents=True)
    killed.write_bytes(b"of a run that was killed")
    run("frames", short, "-o", tmp_path / "p", "-j", 1)
    assert not killed.parent.parent.exists()
    assert len(list((tmp_path / "p").glob("*.png"))) == 3


def test_times_are_those_of_the_film(run: Run, tmp_path: Path) -> None:
    frames = [photo for photo in photos()[:3] for _ in range(2)]
    stamps = [1000, 1040, 2500, 2501, 9000, 9001]  # not at a constant rate, and not from zero
    film = write_film(tmp_path / "varying.mkv", frames, times_ms=stamps)
    run("frames", film, "-o", tmp_path / "p", "-j", 1)
    got = [round(1000 * seconds) for seconds in times(tmp_path / "p")]
    assert set(got) <= {time - stamps[0] for time in stamps}
    assert len(got) == 3


def test_full_and_limited_range_give_the_same_picture(run: Run, tmp_path: Path) -> None:
    frames = [photo for photo in photos()[:2] for _ in range(2)]
    for name, pix_fmt, codec in (("l", "yuv420p", "libx264"), ("f", "yuvj420p", "mjpeg")):
        film = write_film(tmp_path / f"{name}.mkv", frames, pix_fmt=pix_fmt, codec=codec)
        run("frames", film, "-o", tmp_path / name, "-j", 1)
        for path in (tmp_path / name).glob("*.png"):
            number = round(float(path.stem.split("_")[1][:-1]) * RATE)
            got = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            slope, offset = np.polyfit(frames[number].ravel(), got.ravel(), 1)
            assert slope == pytest.approx(1, abs=0.03)  # 1.16 or 0.86 with the other range
            assert abs(offset) < 6


@pytest.mark.parametrize("turn", [90, 180])
def test_a_note_to_turn_the_film_is_reported_and_not_followed(
    run: Run, tmp_path: Path, turn: int
) -> None:
    """The note is the matrix in the track's header of an MP4 file."""
    film = write_film(tmp_path / "phone.mp4", [photo for photo in photos()[:2] for _ in range(2)])
    data = film.read_bytes()
    at = data.index(b"tkhd") + 44
    one = 1 << 16
    a, b = {90: (0, one), 180: (-one, 0)}[turn]
    matrix = struct.pack(">9i", a, b, 0, -b, a, 0, 0, 0, 1 << 30)
    film.write_bytes(data[:at] + matrix + data[at + 36 :])
    said = run("frames", film, "-o", tmp_path / "p", "-j", 1, "--json")
    (record,) = json.loads(said.stdout)["films"]
    assert abs(record["turned_deg"]) == turn
    assert "phone.mp4 has a rotation flag of" in said.stderr
    for path in (tmp_path / "p").glob("*.png"):
        assert cv2.imread(str(path)).shape == (SIZE[1], SIZE[0], 3)


def test_a_broken_end_is_reported_and_the_rest_used(run: Run, short: Path, tmp_path: Path) -> None:
    frames = [photo for photo in photos()[:4] for _ in range(4)]
    film = write_film(tmp_path / "cut.avi", frames, codec="mjpeg", pix_fmt="yuvj420p")
    data = film.read_bytes()
    film.write_bytes(data[: len(data) * 6 // 10])
    said = run("frames", film, "-o", tmp_path / "p", "-j", 1, "--json", code=1)
    (line,) = [line for line in said.stderr.splitlines() if line.startswith("warning:")]
    assert "cut.avi" in line
    assert 4 <= json.loads(said.stdout)["frames"] < 16


@pytest.mark.parametrize("name", ["whole.mkv", "cut.mkv"])
def test_a_film_that_ends_before_its_announced_end_is_reported(
    run: Run, calibrated: Path, tmp_path: Path, name: str
) -> None:
    film, code = tmp_path / name, int(name == "cut.mkv")
    sharp = [cv2.resize(photo, (960, 720)) for photo in photos()[:4] for _ in range(4)]
    write_film(film, sharp, codec="mjpeg", pix_fmt="yuvj420p")
    data = film.read_bytes()
    film.write_bytes(data[: len(data) * 6 // 10] if code else data)
    said = run("frames", film, "-o", tmp_path / "p", "-j", 1, code=code).stderr
    assert times(tmp_path / "p")
    assert ("of the 16 frames of" in said) == bool(code)
    flat = tmp_path / "flat.mkv"
    said = run("undistort", film, flat, "-m", calibrated, code=code).stderr
    assert ("it announces 16 frames and has" in said) == bool(code)
    with av.open(str(flat)) as container:
        written = sum(1 for _ in container.decode(video=0))
    assert (6 <= written <= 11) if code else written == 16


def test_a_film_in_pieces_that_is_cut_short_is_reported(run: Run, tmp_path: Path) -> None:
    """It announces no number of frames: only its last packet tells."""
    film = tmp_path / "cut.mp4"
    pieces = {"movflags": "frag_keyframe+empty_moov"}
    write_film(film, [photo for photo in photos()[:4] for _ in range(8)], of_file=pieces)
    data = film.read_bytes()
    film.write_bytes(data[: len(data) * 6 // 10])
    said = run("frames", film, "-o", tmp_path / "p", "-j", 1, code=1).stderr.splitlines()
    assert said[-1].startswith("Error: ")
    assert "cut.mp4 is cut short after frame" in said[-1]
    assert times(tmp_path / "p")


def test_frames_that_cannot_be_decoded_are_reported_and_passed_over(
    run: Run, target: Path, tmp_path: Path
) -> None:
    frames = [photo for photo in photos()[:4] for _ in range(5)]
    film = write_film(tmp_path / "bad.avi", frames, codec="mjpeg", pix_fmt="yuvj420p")
    with av.open(str(film)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
    data = bytearray(film.read_bytes())
    for packet in packets[5:10]:
        begin, end = packet.pos + packet.size // 2, packet.pos + packet.size
        data[begin:end] = bytes(end - begin)
    film.write_bytes(data)
    said = run("frames", film, "-o", tmp_path / "p", "-t", target, "-j", 1, "--json", code=1)
    (record,) = json.loads(said.stdout)["films"]
    assert record["missing"] == 5
    assert said.stderr.count("bad.avi is damaged or cut short: 15 of its 20 frames") == 1
    chosen = {round(RATE * seconds) for seconds in times(tmp_path / "p")}
    assert record["frames"] == 15
    assert chosen <= {*range(5), *range(10, 20)}


def test_what_cannot_be_used_is_one_line(
    run: Run, short: Path, target: Path, tmp_path: Path
) -> None:
    empty = write_film(tmp_path / "empty.mp4", [np.full((360, 480), 90, np.uint8)] * 5)
    small = write_film(tmp_path / "small.mp4", [photos()[0][:240, :320]] * 3)
    sound = write_sound(tmp_path / "song.mp4")
    text = tmp_path / "text.mp4"
    text.write_text("no film")
    for films, says in (
        ([sound], "song.mp4 holds no video"),
        ([text], "cannot be read as a video"),
        ([tmp_path / "none.mp4"], "does not exist"),
        ([tmp_path / "none*.mp4"], "matches no film"),
        ([short, small], "small.mp4 has 320x240 pixels and "),
        ([empty], "no frame can be chosen of empty.mp4: no board was found in 5 frames "),
        (["-t", target, empty], "no frame can be chosen of empty.mp4: 5 photos, no checkerboard"),
    ):
        error = run("frames", *films, "-o", tmp_path / "p", "-j", 1, code=1).stderr
        assert says in error
        assert error.splitlines()[-1].startswith("Error: ")
        assert not (tmp_path / "p" / "contact_sheet.html").exists()


def test_films_of_one_name_are_told_apart(run: Run, tmp_path: Path) -> None:
    films = []
    for number, folder in enumerate(("a", "b")):
        (tmp_path / folder).mkdir()
        frames = [photos()[number], photos()[number]]
        films.append(write_film(tmp_path / folder / "film.mp4", frames))
    run("frames", *films, films[0], "-o", tmp_path / "p", "-j", 1)
    names = sorted(path.name for path in (tmp_path / "p").glob("*.png"))
    assert names == ["film-2_000000.000s.png", "film_000000.000s.png"]


def test_calibrate_takes_a_film_and_keeps_its_frames(
    run: Run, film: Path, target: Path, tmp_path: Path
) -> None:
    out = tmp_path / "calibration"
    args = ("calibrate", film, "-t", target, "-o", out, "--no-hold-out", "-j", 1)
    record = json.loads(run(*args, "--json").stdout)
    names = {path.name for path in (out / "frames").glob("*.png")}
    assert len(names) >= 7
    assert {row["image"] for row in record["per_image"]} <= names
    assert record["rms_px"] < 0.3
    assert record["chosen"] == f"all {len(names)} usable frames"
    assert load_camera(out / "camera.yaml").made_by["chosen"] == record["chosen"]
    # The pictures that were searched are those of the files.
    again = tmp_path / "again.csv"
    run("detect", out / "frames", "-t", target, "-o", again, "--no-cache", "-j", 1)
    known = Target.load(target)
    found, searched = (load_corners(one, known) for one in (out / "corners.csv", again))
    assert found.images == searched.images
    np.testing.assert_array_equal(found.pixel, searched.pixel)
    other = run("calibrate", film, "-t", target, "-o", out, "--most", 5, "-j", 1, code=1).stderr
    assert "exists already" in other


def test_the_best_of_many_photos_are_taken(
    run: Run, target: Path, tmp_path: Path, quick_fit: None
) -> None:
    folder = tmp_path / "photos"
    folder.mkdir()
    frames, kinds = spoilt_film()
    for number, (frame, kind) in enumerate(zip(frames, kinds, strict=True)):
        if kind != "shifted":
            cv2.imwrite(str(folder / f"{kind}_{number}.png"), frame)
    out = tmp_path / "calibration"
    args = ("calibrate", folder, "-t", target, "-o", out, "--most", 6, "-j", 1)
    said = run(*args).stderr
    assert "Chose the 6 most useful of 32 photos" in said
    assert "6 photos: as many as were asked for" in said
    assert load_camera(out / "camera.yaml").made_by["chosen"].startswith("6 photos: ")
    from cubicfish import Target, load_corners

    images = load_corners(out / "corners.csv", Target.load(target)).images
    assert len(images) == 6
    assert {name.split("_")[0] for name in images} == {"photo"}


def test_best_is_offered_where_photos_are_many(
    run: Run, target: Path, tmp_path: Path, monkeypatch, quick_fit: None
) -> None:
    from cubicfish_cli import observe as inputs

    for number, photo in enumerate(photos()[:4]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), photo)
    assert inputs._MANY == 200
    monkeypatch.setattr(inputs, "_MANY", 3)
    args = ("calibrate", tmp_path, "-t", target, "-o", tmp_path / "c", "-j", 1)
    assert "--most 60" in run(*args).stderr
