"""Images out of bags of ROS 1 and 2 and of MCAP files."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("av")
pytest.importorskip("rosbags")

from filming import TARGET, photos
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore
from running import run_cli

from cubicfish import CubicfishError, PhotoError, Run
from cubicfish_cli.films.recordings import Recording
from cubicfish_cli.inputs.paths import check_inputs, file_and_topic, is_recording
from cubicfish_cli.inputs.target_source import TargetSource

RGB = np.random.default_rng(0).integers(0, 256, (24, 32, 3), np.uint8)
GREY = RGB[:, :, 1]
KINDS = ("ros1", "sqlite3", "mcap")


class Bag:
    """Writes one recording of any kind."""

    def __init__(self, folder: Path, kind: str) -> None:
        self.first = kind == "ros1"
        self.types = get_typestore(Stores.ROS1_NOETIC if self.first else Stores.ROS2_HUMBLE)
        self.path = folder / ("run.bag" if self.first else "run")
        if self.first:
            self.writer = Writer1(self.path)
        else:
            storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
            self.writer = Writer2(self.path, version=9, storage_plugin=storage)

    def __enter__(self):
        self.writer.open()
        self.connections = {}
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def add(self, topic: str, name: str, at: int, **fields: object) -> None:
        kind = f"sensor_msgs/msg/{name}"
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.types)
        kinds = self.types.types
        stamp = kinds["builtin_interfaces/msg/Time"](sec=at // 10**9, nanosec=at % 10**9)
        extra = {"seq": 0} if self.first else {}
        header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="cam", **extra)
        message = kinds[kind](header=header, **fields)
        serialise = self.types.serialize_ros1 if self.first else self.types.serialize_cdr
        self.writer.write(self.connections[topic], at, serialise(message, kind))

    def raw(self, topic: str, at: int, picture: np.ndarray, encoding: str, **fields: object):
        height, width = picture.shape[:2]
        data = np.ascontiguousarray(picture).view(np.uint8).reshape(-1)
        fields = {"is_bigendian": 0, "step": len(data) // height} | fields
        self.add(
            topic, "Image", at, height=height, width=width, encoding=encoding, data=data, **fields
        )

    def compressed(self, topic: str, at: int, picture: np.ndarray, suffix: str = "png") -> None:
        data = cv2.imencode(f".{suffix}", picture)[1].reshape(-1)
        self.add(topic, "CompressedImage", at, format=suffix, data=data)


def read(path: Path) -> list[tuple[int, np.ndarray]]:
    recording = Recording(path)
    try:
        frames = list(recording.frames())
    finally:
        recording.close()
    kinds = {"gray": "gray", "bgr24": "bgr24"}
    return [(frame.pts, frame.to_ndarray(format=kinds[frame.format.name])) for frame in frames]


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_recording_gives_its_images_and_times(kind: str, tmp_path: Path) -> None:
    with Bag(tmp_path, kind) as bag:
        for count in range(5):
            bag.raw("/cam", 10**9 + count * 10**8, np.roll(GREY, count, 1), "mono8")
    read_back = read(bag.path)
    assert [pts for pts, _ in read_back] == [10**9 + count * 10**8 for count in range(5)]
    for count, (_, picture) in enumerate(read_back):
        np.testing.assert_array_equal(picture, np.roll(GREY, count, 1))


def mosaic(pattern: str) -> np.ndarray:
    """A flat picture of one colour behind a colour filter."""
    colour = {"r": 200, "g": 100, "b": 50}
    tile = np.array([[colour[c] for c in pattern[:2]], [colour[c] for c in pattern[2:]]], np.uint8)
    return np.tile(tile, (12, 16))


RAW = {
    "bgr8": (RGB[:, :, ::-1], RGB[:, :, ::-1]),
    "rgb8": (RGB, RGB[:, :, ::-1]),
    "bgra8": (np.dstack([RGB, GREY]), RGB),
    "rgba8": (np.dstack([RGB, GREY]), RGB[:, :, ::-1]),
    "mono16": (GREY.astype(np.uint16) * 256 + 17, GREY),
}


@pytest.mark.parametrize("encoding", RAW)
def test_encodings_are_what_they_say(encoding: str, tmp_path: Path) -> None:
    stored, wanted = RAW[encoding]
    with Bag(tmp_path, "mcap") as bag:
        bag.raw("/cam", 1, stored, encoding)
    np.testing.assert_array_equal(read(bag.path)[0][1], wanted)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_mosaics_have_the_right_colours(pattern: str, tmp_path: Path) -> None:
    with Bag(tmp_path, "sqlite3") as bag:
        bag.raw("/cam", 1, mosaic(pattern), f"bayer_{pattern}8")
    inner = read(bag.path)[0][1][4:-4, 4:-4].reshape(-1, 3)
    np.testing.assert_array_equal(inner, np.tile([50, 100, 200], (len(inner), 1)))


def test_rows_may_be_longer_than_their_pixels(tmp_path: Path) -> None:
    padded = np.hstack([GREY, np.zeros((24, 8), np.uint8)])
    with Bag(tmp_path, "ros1") as bag:
        data = padded.reshape(-1)
        bag.add(
            "/cam", "Image", 1, height=24, width=32, encoding="mono8", is_bigendian=0, step=40,
            data=data,
        )  # fmt: skip
    np.testing.assert_array_equal(read(bag.path)[0][1], GREY)


def test_compressed_images_and_a_topic_of_several(tmp_path: Path) -> None:
    with Bag(tmp_path, "ros1") as bag:
        bag.compressed("/left", 1, GREY)
        bag.compressed("/right", 2, RGB)
    np.testing.assert_array_equal(read(Path(f"{bag.path}:/left"))[0][1], GREY)
    np.testing.assert_array_equal(read(Path(f"{bag.path}:/right"))[0][1], RGB)
    with pytest.raises(PhotoError, match=r"run\.bag:/left \(/left, /right\)"):
        Recording(bag.path)
    with pytest.raises(PhotoError, match="no topic /up"):
        Recording(Path(f"{bag.path}:/up"))


def test_a_clock_that_is_set_back_keeps_the_order(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for at in (5, 6, 2, 7):
            bag.raw("/cam", at, GREY, "mono8")
    times = [pts for pts, _ in read(bag.path)]
    assert times == sorted(set(times))


@pytest.mark.parametrize(
    ("fields", "word"),
    [({"encoding": "32FC1"}, "32FC1"), ({"step": 3}, "shorter"), ({"height": 400}, "shorter")],
)
def test_an_image_that_cannot_be_read_is_named(fields: dict, word: str, tmp_path: Path) -> None:
    said = {"height": 24, "width": 32, "encoding": "mono8", "is_bigendian": 0, "step": 32} | fields
    with Bag(tmp_path, "mcap") as bag:
        bag.add("/cam", "Image", 1, data=GREY.reshape(-1), **said)
    with pytest.raises(PhotoError, match=word):
        Recording(bag.path)


@pytest.mark.parametrize("suffix", [".bag", ".mcap"])
@pytest.mark.parametrize("content", [b"", b"not a recording at all" * 9])
def test_what_is_no_recording_is_refused_in_one_line(
    suffix: str, content: bytes, tmp_path: Path
) -> None:
    path = tmp_path / f"x{suffix}"
    path.write_bytes(content)
    with pytest.raises(PhotoError) as refused:
        Recording(path)
    assert "\n" not in str(refused.value)
    assert path.name in str(refused.value)


# rosbags 0.10 leaves such a file open, which Python says when the file is forgotten.
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("length", [2**40, 2**63 - 1, 2**64 - 1])
def test_a_record_of_any_length_is_refused_in_one_line(length: int, tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        bag.raw("/cam", 1, GREY, "mono8")
    path = next(bag.path.glob("*.mcap"))
    data = bytearray(path.read_bytes())
    data[9:17] = length.to_bytes(8, "little")  # behind the magic bytes and the first kind
    path.write_bytes(data)
    with pytest.raises(PhotoError, match="copy it again"):
        Recording(path)


def with_checksum(path: Path) -> bytearray:
    """A recording with the checksum of its chunk, which rosbags leaves out."""
    data = bytearray(path.read_bytes())
    chunk = 17 + struct.unpack_from("<Q", data, 9)[0]
    assert data[chunk] == 0x06
    length, begins = struct.unpack_from("<Q", data, chunk + 25)[0], chunk + 49
    struct.pack_into("<I", data, chunk + 33, zlib.crc32(data[begins : begins + length]))
    return data


def test_flipped_bytes_of_an_mcap_file_are_told_by_its_checksum(
    tmp_path: Path,
) -> None:
    with Bag(tmp_path, "mcap") as bag:
        bag.raw("/cam", 1, GREY, "mono8")
    path = next(bag.path.glob("*.mcap"))
    data = with_checksum(path)
    path.write_bytes(data)
    np.testing.assert_array_equal(read(path)[0][1], GREY)
    data[data.index(GREY.tobytes()) + 99] ^= 4
    path.write_bytes(data)
    with pytest.raises(PhotoError, match=r"checksum.*copy it again"):
        read(path)


def test_a_name_says_what_is_a_recording(tmp_path: Path) -> None:
    assert is_recording(Path("a/run.bag:/cam0/image_raw"))
    assert file_and_topic(Path("a/run.mcap:/cam0")) == (Path("a/run.mcap"), "/cam0")
    assert not is_recording(Path("film.mp4"))
    assert not is_recording(tmp_path)


def test_a_recording_is_there_where_its_file_is(tmp_path: Path) -> None:
    (tmp_path / "target.yaml").write_text(TARGET)
    target = TargetSource.of(tmp_path / "target.yaml")
    (tmp_path / "run.bag").touch()
    check_inputs("photos", [tmp_path / "run.bag:/cam0/image_raw"], target, Run())
    with pytest.raises(CubicfishError, match=r"other\.bag does not exist"):
        check_inputs("photos", [tmp_path / "other.bag:/cam0/image_raw"], target, Run())


@pytest.mark.slow
def test_frames_are_chosen_from_a_topic_and_calibrated(tmp_path: Path) -> None:
    with Bag(tmp_path, "mcap") as bag:
        for count, photo in enumerate(np.repeat(photos()[:5], 3, axis=0)):
            bag.compressed("/cam0/image_raw/compressed", 10**9 + count * 10**8, photo)
    (tmp_path / "target.yaml").write_text(TARGET)
    source = f"{bag.path}:/cam0/image_raw/compressed"
    output, target = tmp_path / "photos", ("--target", tmp_path / "target.yaml")
    run_cli("frames", source, "-o", output, *target)
    pictures = sorted(path.name for path in output.glob("*.png"))
    assert 3 <= len(pictures) <= 5
    assert all(name.startswith("run_cam0_image_raw_compressed_0") for name in pictures)
    folder = tmp_path / "calibration"
    run_cli("calibrate", source, "-o", folder, *target, "--no-hold-out", "--no-report")
    assert sorted(path.name for path in (folder / "frames").glob("*.png")) == pictures
