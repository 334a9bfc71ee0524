"""Image topics of ROS 1 and ROS 2 bags and of MCAP files, read as films.

The library rosbags reads them, the extra ``ros``; neither ROS nor its messages are needed. Frames
come as PyAV has them, so that what reads films reads these too.
"""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish import OutputError, PhotoError, shown
from cubicfish.photos import PictureFile
from cubicfish_cli.inputs.paths import file_and_topic

Picture = npt.NDArray[Any]

_PLAIN, _COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
_NANOSECOND = Fraction(1, 10**9)
# Encoding -> bytes per number, numbers per pixel, and how OpenCV makes grey or BGR of it.
_ENCODINGS: dict[str, tuple[int, int, int | None]] = {
    "mono8": (1, 1, None),
    "8UC1": (1, 1, None),
    "mono16": (2, 1, None),
    "16UC1": (2, 1, None),
    "bgr8": (1, 3, None),
    "8UC3": (1, 3, None),
    "rgb8": (1, 3, cv2.COLOR_RGB2BGR),
    "bgra8": (1, 4, cv2.COLOR_BGRA2BGR),
    "rgba8": (1, 4, cv2.COLOR_RGBA2BGR),
    # OpenCV names a mosaic by its second row's second and third pixel.
    "bayer_rggb8": (1, 1, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": (1, 1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, 1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, 1, cv2.COLOR_BayerGB2BGR),
    "yuv422": (1, 2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (1, 2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (1, 2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (1, 2, cv2.COLOR_YUV2BGR_YUY2),
}


def label_of(path: Path) -> str:
    """Return what frames of a recording are called: its file, and its topic if named."""
    file, topic = file_and_topic(path)
    return file.stem + (topic or "").rstrip("/").replace("/", "_")


class Recording:
    """One image topic of a recording, as a container of PyAV with one stream.

    Raises:
        PhotoError: the file cannot be read, or has no such topic of images.
        OutputError: the extra ``ros`` is not installed.

    """

    def __init__(self, path: Path) -> None:
        """Open it."""
        self._path, topic = file_and_topic(path)
        if not self._path.exists():
            raise PhotoError.missing(self._path)
        self._reader = self._open_reader()
        try:
            self._connections = self._select_topic(topic)
            first = next(self.frames(), None)
            if first is None:
                raise PhotoError(f"{shown(path)} holds no images")
        except BaseException:
            self.close()
            raise
        self.stream = SimpleNamespace(
            width=first.width,
            height=first.height,
            frames=sum(connection.msgcount for connection in self._connections),
            start_time=first.pts,
            time_base=_NANOSECOND,
            average_rate=None,
            metadata={},
        )

    def close(self) -> None:
        """Close the file."""
        self._reader.close()

    def frames(self) -> Iterator[Any]:
        """Yield the topic's images in the order of their recording, as PyAV's frames.

        Raises:
            PhotoError: the recording is damaged, or an image is of a kind that is not known.

        """
        import av

        pts = -1
        for count, (stamp, message) in enumerate(self._read_messages(), start=1):
            # A clock that was set back would put frames on top of each other.
            pts = max(stamp, pts + 1)
            picture = self._read_picture(message, count)
            if picture.shape[0] * picture.shape[1] > PictureFile.MAX_PIXELS:
                raise PhotoError(f"{shown(self._path)}: image {count} is too large to be read")
            kind = "gray" if picture.ndim == 2 else "bgr24"
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format=kind)
            frame.pts, frame.time_base = pts, _NANOSECOND
            yield frame

    def _read_messages(self) -> Iterator[tuple[int, Any]]:
        """Time in nanoseconds and message: its header's time, or else when it was recorded."""
        count = 0
        try:
            for connection, recorded, raw in self._reader.messages(connections=self._connections):
                message = self._reader.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp
                count += 1
                yield int(stamp.sec) * 10**9 + int(stamp.nanosec) or int(recorded), message
        except Exception as problem:  # whatever rosbags makes of bytes that are not what they seem
            raise PhotoError(
                f"{shown(self._path)} is damaged after image {count} ({problem}): copy it again, "
                "or let `rosbag reindex` or `mcap recover` mend it"
            ) from problem

    def _read_picture(self, message: Any, count: int) -> Picture:
        """Grey (H, W) or BGR (H, W, 3), 8 bits."""
        where = f"{shown(self._path)}, image {count}"
        if message.__msgtype__ == _COMPRESSED:
            flags = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
            decoded = cv2.imdecode(np.asarray(message.data, np.uint8), flags)
            if decoded is None or decoded.dtype not in (np.uint8, np.uint16):
                raise PhotoError(f"{where}: {message.format or 'its data'} cannot be decoded")
            picture: Picture = decoded
        else:
            picture = _convert_raw(message, where)
        if picture.dtype == np.uint16:
            picture = (picture >> 8).astype(np.uint8)
        return picture[:, :, :3] if picture.ndim == 3 else picture

    def _open_reader(self) -> Any:
        try:
            import av  # noqa: F401  frames come as PyAV has them
            from rosbags.highlevel import AnyReader
            from rosbags.typesys import Stores, get_typestore
        except ImportError as problem:
            raise OutputError(
                "recordings need more packages: pip install 'cubicfish[ros]'"
            ) from problem
        path = self._path
        if path.suffix.lower() == ".db3":  # which its folder describes
            path = path.parent
        try:
            reader = AnyReader([path], default_typestore=get_typestore(Stores.LATEST))
            reader.open()
        except Exception as problem:  # as above
            raise PhotoError(
                f"{shown(self._path)} cannot be read as a recording ({problem}): copy it again"
            ) from problem
        return reader

    def _select_topic(self, topic: str | None) -> list[Any]:
        images = [one for one in self._reader.connections if one.msgtype in (_PLAIN, _COMPRESSED)]
        topics = sorted({one.topic for one in images})
        if not topics:
            raise PhotoError(f"{shown(self._path)} has no topic of images")
        if topic is None and len(topics) == 1:
            topic = topics[0]
        if topic not in topics:
            wrong = "has several topics of images" if topic is None else f"has no topic {topic}"
            raise PhotoError(
                f"{shown(self._path)} {wrong}: give one as {shown(self._path)}:{topics[0]}"
                + (f" ({', '.join(topics)})" if len(topics) > 1 else "")
            )
        return [one for one in images if one.topic == topic]


def _convert_raw(message: Any, where: str) -> Picture:
    known = _ENCODINGS.get(message.encoding)
    if known is None:
        raise PhotoError(
            f"{where} is of encoding {message.encoding!r}, which is not read: record one of "
            + ", ".join(_ENCODINGS)
        )
    size, numbers, conversion = known
    data = np.asarray(message.data, np.uint8)
    height, width, step = int(message.height), int(message.width), int(message.step)
    if step < width * numbers * size or len(data) < height * step or not height * width:
        raise PhotoError(f"{where} is shorter than its size says: record it again")
    rows = data[: height * step].reshape(height, step)[:, : width * numbers * size]
    if size == 2:
        order = ">u2" if message.is_bigendian else "<u2"
        return np.ascontiguousarray(rows).view(order).astype(np.uint16)
    picture = rows.reshape((height, width, numbers) if numbers > 1 else (height, width))
    picture = np.ascontiguousarray(picture)
    return picture if conversion is None else np.asarray(cv2.cvtColor(picture, conversion))
