"""Frames of films: which are damaged, and that their times grow."""

from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

pytest.importorskip("av")

import av
from filming import RATE, write_film

from cubicfish_cli.errors import PhotoError
from cubicfish_cli.films.candidates import candidates
from cubicfish_cli.films.decoding import Decoded, Times, decode, frames
from cubicfish_cli.films.scan import Measured, scan
from cubicfish_cli.films.shots import moments
from cubicfish_cli.films.source import open_films, opened

SIZE = (128, 96)
COUNT, GROUP = 40, 20  # frames, and every how many of them one stands by itself
# Grey levels, in the mean: more than a codec loses, less than a frame differs from its neighbour.
CODEC_LOSES = 4.0
HEVC = f"keyint={GROUP}:min-keyint={GROUP}:scenecut=0:bframes=0:log-level=none"


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


def spoil(path: Path, packet: int, share: float = 1.0) -> Path:
    """Write zeros over the last two thirds of a packet, or a share of them."""
    at, length = packet_of(path, packet)
    data = bytearray(path.read_bytes())
    begin, end = at + length // 3, at + length // 3 + round(share * (length - length // 3))
    data[begin:end] = bytes(end - begin)
    path.write_bytes(data)
    return path


def decoded(path: Path) -> list[Decoded]:
    with opened(path) as (container, stream):
        return list(frames(path, container, stream))


def seconds(path: Path, found: list[Decoded]) -> list[float]:
    with opened(path) as (_, stream):
        begin = int(stream.start_time or 0)
        return [float((one.frame.pts - begin) * stream.time_base) for one in found]


def off(found: list[Decoded]) -> np.ndarray:
    """How far each frame is from the picture of its time, grey levels."""
    whole = [one.frame.to_ndarray(format="gray").astype(int) for one in found]
    return np.array(
        [
            min(np.abs(grey - picture).mean() for picture in pictures()[max(0, n - 2) : n + 3])
            for n, grey in enumerate(whole)
        ]
    )


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
def test_damaged_frames_are_told_from_whole_ones(tmp_path, name, codec, options):
    whole = film_of(tmp_path / name, codec, **options)
    assert not any(one.damaged or one.lost for one in decoded(whole))
    found = decoded(spoil(whole, GROUP))
    damaged = np.array([one.damaged for one in found])
    wrong = off(found) > CODEC_LOSES
    assert len(found) + sum(one.lost for one in found) == COUNT
    assert wrong.any()
    assert damaged[wrong].all()
    assert not damaged[: GROUP - 3].any()  # those between may be drawn upon it
    if codec == "mjpeg":
        assert damaged.sum() == 1


def test_frames_drawn_upon_a_later_damaged_one_are_damaged(tmp_path):
    found = decoded(spoil(film_of(tmp_path / "old.avi", "mpeg4", bf=2, b=4_000_000), 4))
    wrong = np.flatnonzero(off(found) > CODEC_LOSES)
    assert {4, 5, 6} <= set(wrong.tolist())  # the packet is that of frame 6
    damaged = np.array([one.damaged for one in found])
    assert damaged[wrong].all()
    assert not damaged[:4].any()


def test_after_damage_frames_are_whole_again_from_the_next_whole_picture(tmp_path):
    path = film_of(tmp_path / "film.mp4", bf=0)
    found = decoded(spoil(path, 5))
    damaged = [one.damaged for one in found]
    assert not any(damaged[:5])
    assert any(damaged)
    assert all(one or n >= GROUP for n, one in enumerate(damaged[6:GROUP], 6))
    assert not any(damaged[GROUP:])


def test_zeros_that_a_decoder_takes_for_a_picture_are_damage(tmp_path):
    """HEVC's decoder says nothing of them."""
    try:
        path = film_of(tmp_path / "film.mp4", "libx265", **{"x265-params": HEVC})
    except av.FFmpegError:
        pytest.skip("no encoder for HEVC")
    found = decoded(spoil(path, GROUP, 0.5))
    wrong = off(found) > CODEC_LOSES
    assert wrong.any()
    assert np.array([one.damaged for one in found])[wrong].all()


def test_a_film_of_which_nothing_can_be_decoded_is_refused(tmp_path):
    path = film_of(tmp_path / "film.mp4", bf=0)
    with av.open(str(path)) as container:
        places = [(packet.pos, packet.size) for packet in container.demux(video=0) if packet.size]
    data = bytearray(path.read_bytes())
    for at, length in places:
        data[at : at + length] = bytes(length)
    path.write_bytes(data)
    with pytest.raises(PhotoError, match="is damaged from its first frame on"):
        decoded(path)


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
    assert not any(one.damaged or one.lost for one in found)
    with opened(path) as (container, stream):
        every = [frame.pts for frame in decode(path, container, stream)]
    assert [one.frame.pts for one in found] == every


def given(*times: int | None) -> list[int]:
    """What becomes of times of a stream of 10 frames a second in milliseconds."""
    container = SimpleNamespace(format=SimpleNamespace(name="mpegts"))
    stream = SimpleNamespace(time_base=Fraction(1, 1000), average_rate=Fraction(10))
    clock, made = Times(container, stream), []
    for time in times:
        frame = SimpleNamespace(pts=time)
        clock.set(frame)
        made.append(frame.pts)
    return made


def test_times_grow_whatever_a_stream_says() -> None:
    assert given(0, 100, 250) == [0, 100, 250]
    assert given(None, None, None) == [0, 100, 200]
    # Joined: twice, and by a clock that jumped ahead by a day.
    assert given(5000, 7000, 0, 2000, 0, 2000) == [5000, 7000, 7100, 9100, 9200, 11200]
    assert given(0, 100, 86_400_100, 86_400_200) == [0, 100, 200, 300]
    # One wrong time, or two of them, do not move all that come after.
    assert given(5000, 5100, 0, 5300) == [5000, 5100, 5200, 5300]
    assert given(5000, 5200, 5100, 5300) == [5000, 5200, 5201, 5300]
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


def test_damaged_frames_are_kept_only_where_no_neighbour_is_whole(tmp_path):
    path = film_of(tmp_path / "film.avi", "mjpeg", b=4_000_000)
    for number in (3, 4, 30, 31, 32, 33, 34):
        spoil(path, number)
    measured = measured_of(path, tmp_path / "kept")
    assert np.flatnonzero(measured.damaged).tolist() == [3, 4, 30, 31, 32, 33, 34]
    assert (measured.spoilt, len(measured)) == (7, COUNT)
    kept = {one.index: one.seen.damaged for one in candidates([measured])}
    assert [index // 5 for index in kept] == list(range(8))
    assert [index // 5 for index, damaged in kept.items() if damaged] == [6]
    found = moments([measured, measured], [0.0, 0.0], 8, None)
    assert sum(measured.damaged[index] for index in found.frame[:, 0]) == 1


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
