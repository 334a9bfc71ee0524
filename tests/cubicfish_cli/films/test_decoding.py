"""Frames of films: that their times grow, and what is said where some are missing."""

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("av")

import av
from filming import RATE, write_film

from cubicfish import PhotoError, read_picture
from cubicfish_cli.films import scan as scanning
from cubicfish_cli.films.scan import Measured, copy_as_png, scan
from cubicfish_cli.films.source import decode, frames, open_films, opened, time_after

SIZE = (128, 96)
COUNT, GROUP = 40, 20  # frames, and every how many of them one stands by itself
# Grey levels, in the mean: more than a codec loses, less than a frame differs from its neighbour.
CODEC_LOSES = 4.0


def pictures(size: tuple[int, int] = SIZE) -> list[np.ndarray]:
    """A texture that moves across the picture."""
    random = np.random.default_rng(5)
    wide = random.integers(0, 256, (size[1], size[0] + 8 * COUNT)).astype(np.uint8)
    wide = cv2.normalize(cv2.GaussianBlur(wide, (0, 0), 3), None, 0, 255, cv2.NORM_MINMAX)
    return [np.ascontiguousarray(wide[:, 8 * n : 8 * n + size[0]]) for n in range(COUNT)]


def film_of(path: Path, codec: str = "libx264", size: tuple[int, int] = SIZE, **options) -> Path:
    pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    options = {name: str(value) for name, value in options.items()}
    if codec != "mjpeg":
        options = {"g": str(GROUP), "sc_threshold": "0", **options}
    return write_film(path, pictures(size), codec=codec, pix_fmt=pix_fmt, options=options)


def packet_of(path: Path, number: int) -> tuple[int, int]:
    """Where a packet lies in the file, and its length."""
    with av.open(str(path)) as container:
        packets = [packet for packet in container.demux(video=0) if packet.size]
        return packets[number].pos, packets[number].size


def spoil(path: Path, packet: int) -> None:
    """Write zeros over the last two thirds of a packet."""
    at, length = packet_of(path, packet)
    data = bytearray(path.read_bytes())
    data[at + length // 3 : at + length] = bytes(length - length // 3)
    path.write_bytes(data)


def decoded(path: Path) -> list[av.VideoFrame]:
    with opened(path) as (container, stream):
        return list(frames(path, container, stream))


def seconds(path: Path, found: list[av.VideoFrame]) -> list[float]:
    with opened(path) as (_, stream):
        begin = int(stream.start_time or 0)
        return [float((one.pts - begin) * stream.time_base) for one in found]


@pytest.mark.parametrize(
    ("name", "codec", "options"),
    [
        ("plain.mp4", "libx264", {"bf": 0}),
        ("between.mkv", "libx264", {"bf": 2}),
        ("stream.ts", "libx264", {"bf": 2}),
        ("single.avi", "mjpeg", {"b": 4_000_000}),
        ("old.avi", "mpeg4", {"bf": 2, "b": 4_000_000}),
    ],
)
def test_a_whole_film_lacks_nothing(tmp_path, name, codec, options):
    measured = measured_of(film_of(tmp_path / name, codec, **options), tmp_path / "kept")
    assert (len(measured), measured.missing, measured.problem) == (COUNT, 0, None)


def test_frames_that_cannot_be_decoded_are_left_out_and_counted(tmp_path):
    path = film_of(tmp_path / "film.avi", "mjpeg", b=4_000_000)
    for number in (3, 4, 30):
        spoil(path, number)
    measured = measured_of(path, tmp_path / "kept")
    assert (len(measured), measured.missing, measured.problem) == (COUNT - 3, 3, None)
    # The others are the pictures of their times.
    numbers = [number for number in range(COUNT) if number not in (3, 4, 30)]
    assert measured.time.tolist() == pytest.approx([number / RATE for number in numbers])
    for number, frame in zip(numbers, decoded(path), strict=True):
        off = frame.to_ndarray(format="gray").astype(int) - pictures()[number]
        assert np.abs(off).mean() < CODEC_LOSES


def test_a_film_that_lacks_announced_frames_says_how_many(tmp_path):
    """Of a packet in the middle; what follows stands on it, so that decoders pass it over."""
    path = film_of(tmp_path / "film.mp4", bf=0)
    at, length = packet_of(path, GROUP)
    data = bytearray(path.read_bytes())
    data[at : at + length] = bytes(length)
    path.write_bytes(data)
    measured = measured_of(path, tmp_path / "kept")
    assert measured.missing > 0
    assert len(measured) >= GROUP


def test_a_film_of_which_nothing_can_be_decoded_is_refused(tmp_path):
    path = film_of(tmp_path / "film.mp4", bf=0)
    with av.open(str(path)) as container:
        places = [(packet.pos, packet.size) for packet in container.demux(video=0) if packet.size]
    data = bytearray(path.read_bytes())
    for at, length in places:
        data[at : at + length] = bytes(length)
    path.write_bytes(data)
    with pytest.raises(PhotoError, match="holds no frame that can be decoded"):
        measured_of(path, tmp_path / "kept")


@pytest.mark.parametrize("codec", ["libx264", "mpeg4"])
def test_frames_of_an_avi_file_are_in_the_order_of_their_times(tmp_path, codec):
    """It holds no times; frames between others come in another order than they are shown."""
    path = film_of(tmp_path / "film.avi", codec, bf=2)
    found = decoded(path)
    assert seconds(path, found) == pytest.approx(np.arange(COUNT) / RATE)


@pytest.mark.parametrize(("suffix", "codec"), [("ts", "libx264"), ("mpg", "mpeg2video")])
def test_the_times_of_joined_streams_go_on(tmp_path, suffix, codec):
    path = film_of(tmp_path / f"film.{suffix}", codec, bf=2)
    path.write_bytes(2 * path.read_bytes())
    found = decoded(path)
    assert seconds(path, found) == pytest.approx(np.arange(2 * COUNT) / RATE)
    with opened(path) as (container, stream):
        every = [frame.pts for frame in decode(path, container, stream)]
    assert [one.pts for one in found] == every


def given(*times: int | None) -> list[int | None]:
    """What becomes of times of a stream of 10 frames a second in milliseconds."""
    made: list[int | None] = [None]
    for time in times:
        made.append(time_after(made[-1], time, 100, 3_600_000))
    return made[1:]


def test_times_grow_whatever_a_stream_says() -> None:
    assert given(0, 100, 250) == [0, 100, 250]
    assert given(None, None, None) == [0, 100, 200]
    # Joined, and by a clock that jumped ahead by a day.
    assert given(5000, 5100, 0, 100, 200) == [5000, 5100, 5200, 5300, 5400]
    assert given(0, 100, 86_400_100, 86_400_200) == [0, 100, 200, 300]
    # One wrong time does not move all that come after.
    assert given(5000, 5100, 0, 5300) == [5000, 5100, 5200, 5300]
    every = given(9, 9, 3, 9, None, 2, 70_000, 0, 9)
    assert all(one < other for one, other in pairwise(every))


@pytest.mark.parametrize("read", [frames, decode])
def test_a_film_that_changes_its_size_is_refused_there(tmp_path, read):
    path = film_of(tmp_path / "film.ts")
    path.write_bytes(path.read_bytes() + film_of(tmp_path / "b.ts", size=(160, 96)).read_bytes())
    made = []
    with (
        opened(path) as (container, stream),
        pytest.raises(PhotoError, match=r"film\.ts has frames of 160x96 pixels after frame 40"),
    ):
        made.extend(read(path, container, stream))
    film = open_films([path])[0]
    measured = scan(film)
    assert len(measured) == COUNT
    assert measured.problem is not None


def measured_of(path: Path, folder: Path, every: int = 5) -> Measured:
    (film,) = open_films([path])
    return scan(film, folder=folder, every=every)


def test_frames_are_kept_of_every_while_of_a_film_whose_rate_varies(tmp_path):
    """A file that has no count of its frames says how many there are by its usual rate."""
    times = [1000 * (n // 4) * 20 + 100 * (n % 4) for n in range(COUNT)]
    path = write_film(tmp_path / "slow.mkv", pictures(), times_ms=times)
    (film,) = open_films([path])
    assert film.frames > 10 * COUNT
    kept = sorted(scan(film, folder=tmp_path / "slow", every=20).kept)
    assert [index // 4 for index in kept] == list(range(COUNT // 4))
    steady = film_of(tmp_path / "steady.mkv")
    assert len(measured_of(steady, tmp_path / "steady", 20).kept) == COUNT // 20


def test_kept_frames_are_the_same_in_memory_and_in_files_of_either_kind(tmp_path, monkeypatch):
    """Memory has room for three of eight frames, and files that are not compressed for two more."""
    path, size = film_of(tmp_path / "film.mkv"), 3 * SIZE[0] * SIZE[1]
    held = list(measured_of(path, tmp_path / "held").kept.values())
    assert all(one.picture is not None for one in held)
    assert not (tmp_path / "held").exists()
    monkeypatch.setattr(scanning, "_MOST_HELD", 3 * size)
    monkeypatch.setattr(scanning, "_MOST_PLAIN", 2 * size)
    kept = list(measured_of(path, tmp_path / "kept").kept.values())
    assert [one.picture is not None for one in kept] == [True] * 3 + [False] * 5
    assert (
        sorted(one.suffix for one in (tmp_path / "kept").iterdir()) == [".bmp"] * 2 + [".png"] * 3
    )
    assert len({one.read().tobytes() for one in held}) == len(held) == 8
    for number, (one, same) in enumerate(zip(kept, held, strict=True)):
        np.testing.assert_array_equal(one.read(), same.read())
        copy_as_png(one, tmp_path / f"{number}.png")
        np.testing.assert_array_equal(read_picture(tmp_path / f"{number}.png"), same.read())
