"""Videos: every frame remapped, at its time, with its sound; whole or not at all."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
import pytest
from lenses import cubic_camera
from listening import Heard

from cubicfish import Event, Listener, OutputError, PhotoError, ViewError, build_map, undistort
from cubicfish.listener import Count
from cubicfish.photos import PictureFile
from cubicfish.views import CentralView
from cubicfish.views.view import rotation_from_angles
from cubicfish_cli.undistortion.batch import Job
from cubicfish_cli.undistortion.video import VideoViews, _make_chroma_maps, video_size

av = pytest.importorskip("av")

SIZE = (192, 144)
CAMERA = cubic_camera(100.0).for_photos(SIZE)
VIEW = CentralView.with_field("perspective", 140, (128, 96), rotation_from_angles(yaw_deg=45))
MAP = build_map(CAMERA, VIEW)
TIMES = [0, 40, 80, 133, 160, 300, 301, 420]  # milliseconds: not at a constant rate


def scene(number: int) -> np.ndarray:
    """A smooth picture in colour, another one for each number."""
    x, y = np.meshgrid(np.arange(SIZE[0]) / SIZE[0], np.arange(SIZE[1]) / SIZE[1])
    parts = [np.sin(3 * x + number), np.cos(4 * y - number), np.sin(2 * x + 3 * y + 2 * number)]
    return np.round(127.5 + 100 * np.stack(parts, axis=-1)).astype(np.uint8)


def write_video(
    path: Path, *, pix_fmt: str = "yuv420p", codec: str = "libx264", audio=True, options=None
):
    with av.open(str(path), "w") as container:
        lossless = {"crf": "0", "qp": "0"} if codec == "libx264" else {}
        lossless |= options or {}
        stream = container.add_stream(codec, rate=25, options=lossless)
        stream.width, stream.height, stream.pix_fmt = *SIZE, pix_fmt
        stream.codec_context.time_base = Fraction(1, 1000)
        sound = container.add_stream("aac", rate=16_000) if audio else None
        if sound is not None:
            sound.metadata["language"] = "deu"
        for number, time in enumerate(TIMES):
            frame = av.VideoFrame.from_ndarray(scene(number), format="rgb24")
            frame = frame.reformat(format=pix_fmt)
            frame.pts, frame.time_base = time, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        if sound is not None:
            tone = np.sin(np.arange(8000) / 9).astype(np.float32)[None]
            samples = av.AudioFrame.from_ndarray(tone, format="fltp", layout="mono")
            samples.rate, samples.pts = 16_000, 0
            container.mux(sound.encode(samples))
            container.mux(sound.encode(None))


def frames_of(path: Path, pix_fmt: str) -> list[tuple[float, np.ndarray]]:
    with av.open(str(path)) as container:
        # Older versions of PyAV take no notice of a frame's own range.
        return [
            (
                round(float(frame.pts * frame.time_base) * 1000),
                frame.to_ndarray(format=pix_fmt, src_color_range=frame.color_range or None),
            )
            for frame in container.decode(video=0)
        ]


def brightness_of(path: Path) -> list[tuple[float, np.ndarray]]:
    with av.open(str(path)) as container:
        made = []
        for frame in container.decode(video=0):
            plane = frame.planes[0]
            kind = np.uint8 if frame.format.components[0].bits == 8 else np.uint16
            rows = np.frombuffer(plane, kind).reshape(plane.height, -1)[:, : plane.width]
            made.append((round(float(frame.pts * frame.time_base) * 1000), rows.copy()))
        return made


def audio_packets(path: Path) -> list[tuple[int, bytes]]:
    with av.open(str(path)) as container:
        stream = container.streams.audio[0]
        return [
            (round(1000 * packet.pts * packet.time_base), bytes(packet))
            for packet in container.demux(stream)
            if packet.dts is not None
        ]


class Counting(Listener):
    """Calls a function with the counts of frames."""

    def __init__(self, call: Callable[[float, float], object]) -> None:
        self.call = call

    def counting(self, step: str) -> Count:
        return self.call


def run(source: Path, out: Path, interpolation="linear", view=VIEW, crf=0, listener=Listener()):
    views = VideoViews(CAMERA, view, interpolation, crf, listener)
    job = Job(name=source.name, photos={"": source}, outputs={"": out})
    problem = views.write(job, overwrite=False)
    if problem is not None:
        raise problem


@pytest.mark.parametrize(
    ("pix_fmt", "top"),
    [("yuv420p", 255), ("yuv422p", 255), ("yuv444p", 255), ("yuv420p10le", 1023)],
)
def test_every_frame_is_remapped_at_its_time(tmp_path, pix_fmt, top):
    source, out = tmp_path / "in.mkv", tmp_path / "out.mkv"
    write_video(source, pix_fmt=pix_fmt, audio=False)
    seen = []
    run(source, out, listener=Counting(lambda *counts: seen.append(counts)))
    assert seen[-1][0] == len(TIMES)
    made = brightness_of(out)
    assert [time for time, _ in made] == TIMES
    with av.open(str(out)) as container:
        assert container.streams.video[0].codec_context.pix_fmt == pix_fmt
    for (_, got), (_, whole) in zip(made, brightness_of(source), strict=True):
        expected = cv2.remap(whole, MAP.map_x, MAP.map_y, cv2.INTER_LINEAR)
        assert np.abs(got.astype(int) - expected)[MAP.valid].max() <= top / 80


@pytest.mark.parametrize(
    ("suffix", "interpolation"), [(".mkv", "linear"), (".mp4", "cubic"), (".webm", "linear")]
)
def test_colours_without_loss_are_those_of_the_photos(tmp_path, suffix, interpolation):
    source, out = tmp_path / "in.mkv", tmp_path / f"out{suffix}"
    write_video(source, pix_fmt="bgr0", codec="ffv1", audio=False)
    run(source, out, interpolation, crf=0)
    given, made = frames_of(source, "bgr24"), frames_of(out, "bgr24")
    assert len(made) == len(TIMES)
    for (_, photo), (_, got) in zip(given, made, strict=True):
        np.testing.assert_array_equal(got, undistort(photo, MAP, interpolation=interpolation))


@pytest.mark.parametrize("pix_fmt", ["yuv420p", "yuv422p", "yuv444p"])
def test_colours_lie_where_the_brightness_lies(tmp_path, pix_fmt):
    source, out = tmp_path / "in.mkv", tmp_path / "out.mkv"
    write_video(source, pix_fmt=pix_fmt, audio=False)
    run(source, out)
    inner = cv2.erode(MAP.valid.astype(np.uint8), np.ones((9, 9)), borderValue=0).astype(bool)
    inner &= (MAP.map_x > 4) & (MAP.map_x < SIZE[0] - 5)
    inner &= (MAP.map_y > 4) & (MAP.map_y < SIZE[1] - 5)
    differences = [
        flat.astype(int)[inner] - cv2.remap(whole, MAP.map_x, MAP.map_y, cv2.INTER_LINEAR)[inner]
        for (_, flat), (_, whole) in zip(
            frames_of(out, "rgb24"), frames_of(source, "rgb24"), strict=True
        )
    ]
    # The slopes of the scene turn shifts into brightness: a quarter of a pixel gives 0.05.
    assert np.abs(np.mean(differences, axis=(0, 1))).max() < 0.04
    assert np.abs(differences).mean() < 1


@pytest.mark.parametrize("centred", [False, True])
def test_colour_samples_lie_where_their_codec_has_them(centred):
    # A view that shows the photo shifted: every pixel (x, y) comes from (x + 10.5, y + 3).
    x, y = np.meshgrid(np.arange(64, dtype=np.float32), np.arange(32, dtype=np.float32))
    made = replace(MAP, map_x=x + 10.5, map_y=y + 3, valid=np.ones((32, 64), bool))
    chroma = _make_chroma_maps(made, 2, 2, centred=centred)
    map_x, map_y = chroma.map_x, chroma.map_y
    columns, rows = np.meshgrid(np.arange(32), np.arange(16))
    place = 2 * columns + 10.5  # in pixels of brightness
    np.testing.assert_allclose(map_x, (place - centred / 2) / 2, atol=1e-4)
    np.testing.assert_allclose(map_y, (2 * rows + 0.5 + 3 - 0.5) / 2, atol=1e-4)


def test_sound_is_copied_bit_by_bit(tmp_path):
    source, out = tmp_path / "in.mp4", tmp_path / "out.mp4"
    write_video(source)
    run(source, out)
    assert len(audio_packets(source)) > 5
    assert audio_packets(out) == audio_packets(source)
    with av.open(str(out)) as container:
        assert container.streams.audio[0].metadata["language"] == "deu"
    assert [time for time, _ in frames_of(out, "gray")] == TIMES


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_what_the_camera_does_not_see_is_black(tmp_path, interpolation):
    source, out = tmp_path / "in.mkv", tmp_path / "out.mkv"
    write_video(source, audio=False)
    run(source, out, interpolation)
    outside = cv2.erode((~MAP.valid).astype(np.uint8), np.ones((7, 7)), borderValue=1).astype(bool)
    assert outside.any()
    _, flat = frames_of(out, "rgb24")[0]
    assert flat[outside].max() <= 6


@pytest.mark.parametrize(("pix_fmt", "codec"), [("bgr0", "ffv1"), ("gray16le", "ffv1")])
def test_numbers_are_said_to_be_what_is_written(tmp_path, pix_fmt, codec):
    source, out, heard = tmp_path / "in.mkv", tmp_path / "out.mkv", Heard()
    write_video(source, pix_fmt=pix_fmt, codec=codec, audio=False)
    run(source, out, crf=1, listener=heard)
    outside = cv2.erode((~MAP.valid).astype(np.uint8), np.ones((7, 7)), borderValue=1).astype(bool)
    _, flat = frames_of(out, "rgb24")[0]
    assert flat[outside].max() <= 6
    plain = frames_of(source, "rgb24")[0][1]
    expected = undistort(plain, MAP).astype(int)
    inner = cv2.erode(MAP.valid.astype(np.uint8), np.ones((9, 9)), borderValue=0).astype(bool)
    assert np.abs(flat.astype(int) - expected)[inner].mean() < 2
    with av.open(str(out)) as container:
        context = container.streams.video[0].codec_context
        tags = (int(context.color_range), int(context.colorspace))
    assert tags == ((2, 2) if pix_fmt == "gray16le" else (1, 5))
    (told,) = [figures for event, figures in heard.events if event is Event.VIDEO_REDUCED]
    assert told["given"] == pix_fmt


def test_an_interlaced_video_is_said_to_be(tmp_path):
    source, out, heard = tmp_path / "in.mp4", tmp_path / "out.mp4", Heard()
    write_video(source, audio=False, options={"x264-params": "tff=1"})
    run(source, out, listener=heard)
    assert [event for event, _ in heard.events] == [Event.VIDEO_INTERLACED]


def test_a_film_that_counts_no_frames_is_seen_to_be_cut(tmp_path):
    whole, cut = tmp_path / "whole.ts", tmp_path / "cut.ts"
    write_video(whole, audio=False)
    run(whole, tmp_path / "whole.mp4")
    data = whole.read_bytes()
    cut.write_bytes(data[: int(0.6 * len(data)) // 188 * 188])  # after a whole packet
    with pytest.raises(PhotoError, match="cut short"):
        run(cut, tmp_path / "cut.mp4")


@pytest.mark.parametrize(("name", "length"), [("ts", 188), ("m2ts", 192)])
@pytest.mark.parametrize("begun", [0, 50])  # a recording may begin within a packet
def test_a_film_that_ends_within_a_packet_is_seen_to_be_cut(tmp_path, name, length, begun):
    """Its last frame was whole, and nothing else says that others are missing."""
    film, cut = tmp_path / f"film.{name}", tmp_path / f"cut.{name}"
    write_video(film, audio=False)
    data = film.read_bytes()
    assert len(data) % length == 0
    film.write_bytes(data[-begun:][:begun] + data)
    run(film, tmp_path / "whole.mp4")
    cut.write_bytes(film.read_bytes()[:-60])
    with pytest.raises(PhotoError, match="cut short"):
        run(cut, tmp_path / "cut.mp4")


def test_the_quality_is_the_one_asked_for(tmp_path):
    source = tmp_path / "in.mp4"
    write_video(source)
    sizes = []
    for crf in (5, 40):
        run(source, tmp_path / f"{crf}.mp4", crf=crf)
        sizes.append((tmp_path / f"{crf}.mp4").stat().st_size)
    assert sizes[0] > 1.5 * sizes[1]


@pytest.mark.parametrize(("name", "codec"), [("o.mkv", "h264"), ("o.webm", "vp9")])
def test_the_codec_is_what_such_a_file_takes(tmp_path, name, codec):
    source = tmp_path / "in.mp4"
    write_video(source, audio=False)
    run(source, tmp_path / name, crf=30)
    with av.open(str(tmp_path / name)) as container:
        assert container.streams.video[0].codec_context.name == codec


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("o.webm", "name a .mkv, which takes all"),  # AAC is not for WebM
        ("o.xyz", "cannot be written"),
    ],
)
def test_what_a_file_cannot_hold_is_said_and_leaves_nothing(tmp_path, name, says):
    source = tmp_path / "in.mp4"
    write_video(source)
    with pytest.raises(OutputError, match=says) as caught:
        run(source, tmp_path / name)
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["in.mp4"]


def test_a_disk_without_room_is_not_blamed_on_the_codec(tmp_path):
    resource = pytest.importorskip("resource")
    write_video(tmp_path / "in.mp4")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, before[1]))
    try:
        with pytest.raises(OutputError) as refused:
            run(tmp_path / "in.mp4", tmp_path / "out.mp4")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    said = str(refused.value)
    assert said.startswith(f"{tmp_path / 'out.mp4'} cannot be written (File too large)")
    assert "codec" not in said


def test_odd_sides_are_refused_with_even_ones(tmp_path):
    source = tmp_path / "in.mp4"
    write_video(source)
    odd = CentralView.with_field("perspective", 90, (127, 95))
    with pytest.raises(ViewError, match="--size 128x96"):
        run(source, tmp_path / "out.mp4", view=odd)
    assert not (tmp_path / "out.mp4").exists()


def test_what_is_no_video_is_named(tmp_path):
    bad, empty = tmp_path / "bad.mp4", tmp_path / "none.mp4"
    bad.write_bytes(b"not a video" * 100)
    for path, says in ((bad, "cannot be read as a video"), (empty, "does not exist")):
        with pytest.raises(PhotoError, match=says):
            run(path, tmp_path / "out.mp4")
        with pytest.raises(PhotoError, match=says):
            video_size(path)
    assert [path.name for path in tmp_path.iterdir()] == ["bad.mp4"]


def test_a_list_of_other_files_is_no_video(tmp_path):
    write_video(tmp_path / "other.mp4")
    listed = tmp_path / "list.mp4"
    listed.write_text("ffconcat version 1.0\nfile other.mp4\n")
    with pytest.raises(PhotoError, match=r"list\.mp4 cannot be read as a video"):
        run(listed, tmp_path / "out.mp4")
    (tmp_path / "concat:other.mp4").write_bytes(b"a name that FFmpeg would take for an order")
    with pytest.raises(PhotoError, match="cannot be read as a video"):
        video_size(tmp_path / "concat:other.mp4")


def test_frames_larger_than_any_photo_are_refused(tmp_path, monkeypatch):
    source = tmp_path / "in.mp4"
    write_video(source)
    monkeypatch.setattr(PictureFile, "MAX_PIXELS", 1000)
    with pytest.raises(PhotoError, match=r"in\.mp4"):
        run(source, tmp_path / "out.mp4")
    assert not (tmp_path / "out.mp4").exists()


def test_a_video_cut_short_leaves_no_file(tmp_path):
    source = tmp_path / "in.mp4"
    write_video(source)
    data = source.read_bytes()
    source.write_bytes(data[: len(data) // 3])
    with pytest.raises(PhotoError, match=r"in\.mp4"):
        run(source, tmp_path / "out.mp4")
    assert not (tmp_path / "out.mp4").exists()


def test_an_interrupt_leaves_no_file_and_no_thread(tmp_path):
    import threading

    source = tmp_path / "in.mp4"
    write_video(source)
    before = threading.active_count()

    def stop(done: float, total: float) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(source, tmp_path / "out.mp4", listener=Counting(stop))
    assert [path.name for path in tmp_path.iterdir()] == ["in.mp4"]
    assert threading.active_count() == before


def test_ffmpegs_threads_never_wait_for_python(tmp_path):
    import av

    write_video(tmp_path / "in.mp4")
    av.logging.set_level(av.logging.PANIC)
    video_size(tmp_path / "in.mp4")
    # PyAV takes Python's lock for a message at any other level; an encoder that is freed, by who
    # holds the lock, waits for its threads, and for ever where one has something to say.
    assert av.logging.get_level() is None


def test_without_pyav_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    with pytest.raises(OutputError, match=r"pip install 'cubicfish\[video\]'"):
        run(tmp_path / "in.mp4", tmp_path / "out.mp4")
