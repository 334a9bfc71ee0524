"""Photos on disk: which files are meant, and what is in them.

OpenCV itself holds a limit of pixels before it makes room for a picture, in all formats
(``OPENCV_IO_MAX_IMAGE_PIXELS``, see ``terminal/start.py``); what is not for it, and JPEG files
that are cut short, are refused before. Pictures are read as the sensor saw them: an orientation
noted in the file (EXIF) is not applied, since the lens does not turn with the note.
"""

from __future__ import annotations

import glob
import os
import re
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish.errors import CubicfishError, OutputError, PhotoError
from cubicfish.files.whole_files import on_host
from cubicfish.photos import phones
from cubicfish.photos.demosaic import evened
from cubicfish.threads import Shared
from cubicfish.wording import listed, quoted, shown

Picture = npt.NDArray[np.integer[Any] | np.floating[Any]]

_VIDEO_NAMES = ".mp4 .m4v .mov .mkv .webm .avi .mts .m2ts .ts .mpg .mpeg .wmv .insv .360"
_RAW_NAMES = (
    ".3fr .arw .cr2 .cr3 .crw .dcr .dng .erf .iiq .kdc .mef .mos .mrw .nef .nrw .orf .pef .raf "
    ".raw .rw2 .rwl .sr2 .srf .srw .x3f"
)
_OTHER_NAMES = ".avif .exr .gif .jp2 .jxl .pdf .psd"
_READS_PHONES = phones.can_be_read()
VIDEO_SUFFIXES = frozenset(_VIDEO_NAMES.split())
RAW_SUFFIXES = frozenset(_RAW_NAMES.split())
OTHER_SUFFIXES = frozenset((*_OTHER_NAMES.split(), *(() if _READS_PHONES else phones.SUFFIXES)))
"""Of other files that hold a photo, and are not read."""

_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"
_TIFFS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PNMS = tuple(b"P%d" % kind for kind in range(1, 7))
_RAW = (
    "is a camera's raw file: develop it and save it as PNG or JPEG, in full size and without lens "
    "correction"
)
_VIDEO = "is a video: save frames of it as PNG or JPEG ('cubicfish frames')"
_AVIF = "is an AVIF picture: save it as PNG or JPEG, in full size (avifdec a.avif a.png)"
_PHONE = (
    "is a HEIC picture: pip install 'cubicfish[heif]' reads it, or save it as PNG or JPEG, in full "
    "size (heif-convert a.heic a.png)"
)
_AVIFS = re.compile(rb"avi[fs]")

_NAMES = ".png .jpg .jpeg .jpe .tif .tiff .bmp .dib .webp .pgm .ppm .pnm"
SUFFIXES = frozenset((*_NAMES.split(), *(phones.SUFFIXES if _READS_PHONES else ())))
_MISSED_SUFFIXES = VIDEO_SUFFIXES | OTHER_SUFFIXES | RAW_SUFFIXES

MAX_PIXELS = 200_000_000
"""More than any camera has; a small file that claims more is refused before it fills memory."""
MAX_FILE_BYTES = 2_000_000_000

_SCAN = 0xDA  # the marker after which a JPEG file has pixels

_READABLE = "PNG, JPEG, TIFF, BMP, WebP or PNM"
_DAMAGED = "is cut short or damaged: copy it again or leave it out"


@dataclass(frozen=True, kw_only=True)
class Photo:
    """A photo on disk, or in memory.

    Attributes:
        name: what files and reports call it: the file's name, or its path below the photos'
            common folder where two photos have the same file name.
        path: where it is, or would be.
        picture: what it shows, so that no file is read; None reads the file.
        has_file: whether it is in a file.
        size: (width, height) that its picture is brought to when it is read; None leaves it.

    """

    name: str
    path: Path
    picture: Picture | None = field(default=None, compare=False, repr=False)
    has_file: bool = True
    size: tuple[int, int] | None = None

    @staticmethod
    def natural_key(text: str) -> tuple[tuple[int, int | str], ...]:
        """Sort key under which ``img2`` comes before ``img10``."""
        parts = re.split(r"([0-9]+)", text)
        return tuple((0, int(part)) if part.isdecimal() else (1, part) for part in parts if part)

    def sized(self, picture: Picture) -> Picture:
        """A picture that was read of it, brought to its size."""
        if self.size in (None, picture.shape[1::-1]):
            return picture
        smaller = self.size < picture.shape[1::-1]
        return cv2.resize(
            picture, self.size, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_CUBIC
        )

    def absolute(self) -> Photo:
        """The same photo, by a path that holds in any current folder."""
        return replace(self, path=Path(os.path.abspath(self.path)))

    def read(self) -> Picture:
        """What it shows, as :func:`read_picture` gives it.

        Raises:
            PhotoError: as :func:`read_picture`.

        """
        return self.sized(read_picture(self.path) if self.picture is None else self.picture)

    def read_grey(self) -> Picture:
        """Its brightness (H, W), uint8 or uint16.

        Raises:
            PhotoError: as :func:`read_picture`.

        """
        return self.sized(read_grey(self.path) if self.picture is None else grey(self.picture))

    def grey_if_readable(self) -> Picture | None:
        """Its brightness; None where it cannot be read."""
        try:
            return self.read_grey()
        except PhotoError:
            return None


# By how much a JPEG file is decoded smaller, which takes a fraction of the time.
_REDUCED = {
    2: cv2.IMREAD_REDUCED_COLOR_2,
    4: cv2.IMREAD_REDUCED_COLOR_4,
    8: cv2.IMREAD_REDUCED_COLOR_8,
}


@dataclass(frozen=True, kw_only=True)
class PictureFile:
    """A picture file's bytes, and what is in them.

    Attributes:
        SUFFIXES: of the names of files that are read (of the class).
        VIDEO_SUFFIXES: of the names of videos (of the class).
        MAX_PIXELS: how many a picture may have (of the class).
        path: where the bytes came from, or go; for messages.
        data: the bytes.

    """

    SUFFIXES: ClassVar[frozenset[str]] = SUFFIXES
    VIDEO_SUFFIXES: ClassVar[frozenset[str]] = VIDEO_SUFFIXES
    MAX_PIXELS: ClassVar[int] = MAX_PIXELS

    path: Path
    data: bytes

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a picture file.

        Raises:
            PhotoError: the file is missing, unreadable, empty or too large.

        """
        try:
            if path.exists() and not path.is_file():
                raise PhotoError(
                    "is not a file: give photos, or the folder they are in", about=shown(path)
                )
            size = path.stat().st_size
            if size > MAX_FILE_BYTES:
                raise PhotoError(f"has {size / 1e9:.1f} GB: is it a photo?", about=shown(path))
            data = path.read_bytes()
        except PhotoError:
            raise
        except (OSError, ValueError) as problem:
            what = getattr(problem, "strerror", None) or problem
            raise PhotoError(f"cannot be read{on_host()}: {what}", about=shown(path)) from problem
        if not data:
            raise PhotoError("is empty: copy it again or leave it out", about=shown(path))
        return cls(path=path, data=data)

    @classmethod
    def of(cls, path: Path, picture: Picture, options: Sequence[int] = ()) -> Self:
        """Encode a picture (H, W[, 3 or 4]), BGR order, as its name's suffix says.

        Args:
            path: where it will be.
            picture: of a depth and channels that such a file can hold.
            options: those of ``cv2.imencode``.

        Raises:
            OutputError: it cannot be encoded.

        """
        try:
            with quiet_stderr():
                done, data = cv2.imencode(path.suffix.lower(), picture, [*options])
        except cv2.error:
            done, data = False, np.empty(0, np.uint8)
        if not done:
            raise OutputError(f"{shown(path)}: this picture cannot be encoded: write .png or .tif")
        return cls(path=path, data=data.tobytes())

    def picture(self, *, floats: bool = False, least: int | None = None) -> Picture:
        """Decode it, as :func:`read_picture` does.

        Args:
            floats: whether 32-bit floating point numbers may come back too.
            least: pixels along the longer side that are enough: a JPEG file then comes 2, 4 or 8
                times smaller, in colours, which takes a fraction of the time; others come whole.

        Raises:
            PhotoError: as :func:`read_picture`.

        """
        path, data, reduced = self.path, self.data, 1
        if least is not None and data.startswith(_JPEG):
            size = read_size(data)
            reduced = max((n for n in _REDUCED if size and max(size) // n >= least), default=1)
        flags = cv2.IMREAD_UNCHANGED
        if reduced > 1:
            flags = _REDUCED[reduced] | cv2.IMREAD_IGNORE_ORIENTATION
        _check(path, data)
        if not is_whole(data):
            raise PhotoError(_DAMAGED, about=shown(path))
        picture = _decode(path, data, flags)
        if picture.dtype not in (np.uint8, np.uint16) and not (
            floats and picture.dtype == np.float32
        ):
            raise PhotoError(
                f"holds {picture.dtype} numbers: save it with 8 or 16 bits", about=shown(path)
            )
        return _with_full_range(picture, data)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), by its header where that has it.

        Raises:
            PhotoError: as :func:`read_picture`; a damaged picture with a good header passes.

        """
        _check(self.path, self.data)
        size = read_size(self.data)
        if size is None:
            height, width = self.picture(floats=True).shape[:2]
            size = width, height
        return size

    def is_copy_of(self, size: tuple[int, int]) -> bool:
        """Whether it has a size (width, height) but for a factor, as a reduced copy has.

        Raises:
            PhotoError: as :attr:`size`.

        """
        return self.size == size or is_reduced(self.size, size)

    def segments(self) -> Iterator[tuple[int, bytes]]:
        """(marker, body) of a JPEG file's segments before its first scan; none of other files.

        Raises:
            struct.error: the file ends within one.

        """
        for marker, at in jpeg_segments(self.data) if self.data.startswith(_JPEG) else ():
            if marker != _SCAN:
                length = int(struct.unpack_from(">H", self.data, at)[0])
                yield marker, self.data[at + 2 : at + length]


def is_reduced(size: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether pictures of two sizes (width, height) differ as a picture and its reduced copy do.

    The sides' ratio is the same but for the rounding of the smaller one's.
    """
    small, large = sorted((size, other))
    times = large[0] / small[0]
    return times > 1 and abs(large[1] - times * small[1]) <= times


def is_photo_name(path: Path) -> bool:
    """Whether a file's name is that of a photo: a known suffix, and not hidden."""
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".")


def find_photos(
    arguments: Iterable[str | os.PathLike[str]], remarks: list[str] | None = None
) -> list[Photo]:
    """The photos that the arguments mean, in natural order, each once.

    An argument is a folder (its photos, not those in folders below), a file, or a glob
    pattern (``**`` goes down folders). In folders and patterns, hidden files and files that
    are no photos are passed over; a file given by name is taken whatever its suffix.

    Args:
        arguments: folders, files and patterns.
        remarks: a line is added about what was passed over and may be missed: raw files, videos,
            photos whose names cannot be used.

    Raises:
        PhotoError: an argument does not exist or holds no photo, or the name of a photo that was
            given by name cannot be used in a table.

    """
    paths: dict[str, Path] = {}
    missed: list[Path] = []
    for argument in [os.fspath(one) for one in arguments]:
        for path in _expand(argument, missed):
            if not _is_plain(path.name):
                if str(path) == argument:
                    raise _explain_not_plain(path.name, "file")
                missed.append(path)
                continue
            paths.setdefault(os.path.realpath(path), path)
    if not paths and not missed:
        raise PhotoError("no photos are named: name files, folders or patterns")
    if not paths:
        raise _explain_not_plain(missed[0].name, "file")
    if remarks is not None and missed:
        remarks.append(_describe_missed(missed))
    ordered = sorted(paths.values(), key=lambda path: Photo.natural_key(path.as_posix()))
    names = _make_names(ordered)
    for name in names:
        if not _is_plain(name):  # a folder's name is part of it
            raise _explain_not_plain(name, "folder")
    return [Photo(name=name, path=path) for name, path in zip(names, ordered, strict=True)]


def _is_plain(name: str) -> bool:
    return name.isprintable() and name == name.strip()


def _explain_not_plain(name: str, what: str) -> PhotoError:
    return PhotoError(f"{quoted(name)}: a photo's name must be plain text: rename the {what}")


def _describe_missed(paths: Sequence[Path]) -> str:
    """A line about the files that were passed over."""
    names = [shown(path.name) for path in dict.fromkeys(paths)]
    files = f"{len(names)} file{'s' * (len(names) > 1)}"
    return (
        f"{files} left out ({listed(names, 'files')}): photos are {_READABLE} files with plain "
        "names; convert the others at full size; for films use 'cubicfish frames'"
    )


def expand_pattern(name: str | os.PathLike[str]) -> list[Path]:
    """What a name stands for: itself, or where it is a pattern and no file, what that matches."""
    name = os.fspath(name)
    if os.path.lexists(name) or not glob.has_magic(name):
        return [Path(name)]
    return [Path(match) for match in sorted(glob.glob(name, recursive=True))]


def _expand(argument: str, missed: list[Path]) -> list[Path]:
    path = Path(argument)
    if not argument:
        raise PhotoError("a photo's name is empty: give a folder, files or a pattern")
    try:
        if path.is_dir():
            return _find_in_folder(path, missed)
        matches = expand_pattern(argument)
    except PhotoError:  # an OSError too
        raise
    except (OSError, ValueError) as problem:  # no permission; a name that no file can have
        what = getattr(problem, "strerror", None) or problem
        raise PhotoError(f"{shown(argument)} cannot be read: {what}") from problem
    if matches == [path]:
        if not os.path.lexists(path):
            raise PhotoError.missing(argument)
        return matches
    photos = [match for match in matches if is_photo_name(match) and not match.is_dir()]
    if not photos:
        raise PhotoError(f"{shown(argument)} matches no photo: photos are {_READABLE} files")
    missed += [match for match in matches if _may_be_missed(match)]
    return photos


def _may_be_missed(path: Path) -> bool:
    """Whether a file that is no photo here may be one for its owner."""
    return path.suffix.lower() in _MISSED_SUFFIXES and not path.name.startswith(".")


def _find_in_folder(folder: Path, missed: list[Path]) -> list[Path]:
    entries = sorted(folder.iterdir(), key=lambda path: Photo.natural_key(path.name))
    files = [path for path in entries if not path.is_dir()]
    photos = [path for path in files if is_photo_name(path)]
    if not photos:
        there = _describe_others(files, [path for path in entries if path.is_dir()])
        raise PhotoError(f"{shown(folder)} holds no photos{there}: photos are {_READABLE} files")
    missed += [path for path in files if _may_be_missed(path)]
    return photos


def _describe_others(files: Sequence[Path], folders: Sequence[Path]) -> str:
    """What a folder without photos holds."""
    others = sorted({path.suffix.lower() for path in files if path.suffix})
    below = [shown(path) for path in folders if path.name[:1] != "."]
    if others:
        return f", only {', '.join(others[:5])}"
    return f", only folders ({listed(below, 'folders')})" if below else ""


def _make_names(paths: Sequence[Path]) -> list[str]:
    names = [path.name for path in paths]
    if len(set(names)) == len(names):
        return names
    absolute = [os.path.abspath(path) for path in paths]
    try:
        common = os.path.commonpath([os.path.dirname(path) for path in absolute])
    except ValueError as problem:  # on different drives
        raise PhotoError(
            f"{shown(paths[0])}: another photo has the same name: rename one of them"
        ) from problem
    return [Path(os.path.relpath(path, common)).as_posix() for path in absolute]


def read_picture(path: Path | str) -> Picture:
    """Read a picture as it is stored: (H, W) or (H, W, 3 or 4), 8 or 16 bit, BGR order.

    Raises:
        PhotoError: the file is missing, unreadable, empty, cut short, no picture, has more
            than :data:`MAX_PIXELS`, or holds numbers other than 8 or 16 bit unsigned.

    """
    return PictureFile.read(Path(path)).picture()


def read_grey(path: Path) -> Picture:
    """Read a picture in grey: (H, W), uint8 or uint16 as stored; transparency is ignored.

    Raises:
        PhotoError: as :func:`read_picture`.

    """
    return grey(read_picture(path))


def grey(picture: Picture) -> Picture:
    """A picture in BGR order, (H, W) or (H, W, 1 to 4) -> its brightness (H, W)."""
    if picture.ndim == 2:
        return evened(picture)
    if picture.shape[2] < 3:  # grey, with or without transparency
        return evened(np.ascontiguousarray(picture[..., 0]))
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))


def refuse_no_picture(
    value: object, name: str, error: type[CubicfishError], *, kinds: Sequence[type]
) -> None:
    """Refuse what a caller hands over and is no picture.

    Args:
        value: an array (H, W) or (H, W, 1 to 4) is one.
        name: what it is called.
        error: what is raised.
        kinds: what its numbers may be.

    """
    if not isinstance(value, np.ndarray):
        raise error(f"{name} is no array but {type(value).__name__}: read it first")
    if value.ndim not in (2, 3) or (value.ndim == 3 and not 1 <= value.shape[2] <= 4):
        raise error(f"{name} has the shape {value.shape}, not (H, W) or (H, W, 1 to 4)")
    if value.dtype not in kinds:
        names = listed([kind.__name__ for kind in kinds], word="or")
        raise error(f"{name} holds {value.dtype} numbers, not {names}")
    if not 0 < value.shape[0] * value.shape[1] <= PictureFile.MAX_PIXELS:
        raise error(
            f"{name} has {value.shape[1]}x{value.shape[0]} pixels: 1 to {MAX_PIXELS / 1e6:g} "
            "million are allowed"
        )


def _check(path: Path, data: bytes) -> None:
    """Refuse what is not for a decoder, which makes room for whatever a small file claims."""
    other = other_kind(data, path.suffix)
    if other is not None:
        raise PhotoError(other, about=shown(path))
    if not is_picture(data):
        raise PhotoError(
            f"is not a picture that can be read: save it as {_READABLE}", about=shown(path)
        )
    if _is_animated(data):
        raise PhotoError("is an animation: save its pictures one by one", about=shown(path))
    if _has_pages(data):
        raise PhotoError("holds several pictures: save them one by one", about=shown(path))
    width, height = read_size(data) or (0, 0)
    if width * height > PictureFile.MAX_PIXELS:
        raise _explain_too_large(path)


def _is_animated(data: bytes) -> bool:
    """Whether a WebP or PNG file says that it has several pictures: decoders give the first."""
    if data.startswith(_PNG):
        control = data.find(b"acTL", 0, data.find(b"IDAT"))
        return control > 0 and data[control + 4 : control + 8] > b"\0\0\0\1"
    webp = data.startswith(b"RIFF") and data[8:16] == b"WEBPVP8X"
    return webp and len(data) > 20 and bool(data[20] & 2)


def _has_pages(data: bytes) -> bool:
    """Whether a TIFF file has a second picture as large as its first, which alone is decoded.

    Smaller ones are its thumbnails, or the same at smaller scales.
    """
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(data[:4])
    if order is None:
        return False
    sizes: list[tuple[int | None, ...]] = []
    try:
        (start,) = struct.unpack_from(order + "I", data, 4)
        while start and len(sizes) < 2:
            (count,) = struct.unpack_from(order + "H", data, start)
            tags: dict[int, int] = {}
            for entry in range(start + 2, start + 2 + 12 * count, 12):
                tag, kind, _, value = struct.unpack_from(order + "HHII", data, entry)
                is_short = kind == 3
                tags[tag] = (
                    struct.unpack_from(order + "H", data, entry + 8)[0] if is_short else value
                )
            # Of reduced pictures and masks the lowest and the third bit of tag 254 are set.
            sizes.append((tags.get(256), tags.get(257), tags.get(254, 0) & 5))
            (start,) = struct.unpack_from(order + "I", data, start + 2 + 12 * count)
    except struct.error:  # damaged here, but its pixels may be whole
        return False
    return len(sizes) == 2 and sizes[0] == sizes[1]


def _decode(path: Path, data: bytes, flags: int) -> Picture:
    with quiet_stderr():
        try:
            if phones.is_heic(data):
                picture = phones.decoded(data)
            else:
                picture = cv2.imdecode(np.frombuffer(as_stored(data), np.uint8), flags)
        except cv2.error as problem:
            if "CV_IO_MAX_IMAGE" in str(problem):
                raise _explain_too_large(path) from problem
            picture = None
    if picture is None or picture.size == 0:
        raise PhotoError(_DAMAGED, about=shown(path))
    return picture


def _explain_too_large(path: Path) -> PhotoError:
    return PhotoError(
        f"claims more than the {MAX_PIXELS / 1e6:g} million pixels allowed: is it a photo?",
        about=shown(path),
    )


def _limit_to_one_thread() -> int:
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    return before


one_opencv_thread = Shared(_limit_to_one_thread, cv2.setNumThreads)
"""``with one_opencv_thread():`` several pictures are at work: none takes several threads."""


def _silence_stderr() -> int | None:
    try:
        kept = os.dup(2)
    except OSError:  # there is no stderr
        return None
    with open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), 2)
    return kept


def _restore_stderr(kept: int | None) -> None:
    if kept is not None:
        os.dup2(kept, 2)
        os.close(kept)


quiet_stderr = Shared(_silence_stderr, _restore_stderr)
"""``with quiet_stderr():`` what C libraries write to stderr goes nowhere, as decoders do."""


def is_picture(data: bytes) -> bool:
    """Whether a file begins as one of the kinds that are read: no decoder gets any other."""
    webp = data.startswith(b"RIFF") and data[8:12] == b"WEBP"
    heic = _READS_PHONES and phones.is_heic(data)
    return webp or heic or data.startswith((_PNG, _JPEG, b"BM", *_TIFFS, *_PNMS))


def other_kind(data: bytes, suffix: str) -> str | None:
    """What a file is that is known and not read here, and what to do about it; None otherwise.

    Args:
        data: the file's bytes, the first hundred at least.
        suffix: of its name. Raw files of many cameras begin as TIFF files do, and hold a small
            copy of the photo where those have the photo.

    """
    suffix = suffix.lower()
    if data[4:8] == b"ftyp":  # a family of formats
        brands = phones.brands_of(data)
        if b"crx " in brands:
            return _RAW
        if _AVIFS.search(brands):
            return _AVIF
        if not phones.is_heic(data):
            return _VIDEO
        return None if _READS_PHONES else _PHONE
    if suffix in RAW_SUFFIXES and (data.startswith(_TIFFS) or not is_picture(data)):
        return _RAW
    return _VIDEO if suffix in VIDEO_SUFFIXES and not is_picture(data) else None


def read_size(data: bytes) -> tuple[int, int] | None:
    """(width, height) that a PNG, JPEG or HEIC file's header claims; None where it has none."""
    if phones.is_heic(data):
        return phones.size_of(data)
    try:
        if data.startswith(_PNG):
            width, height = struct.unpack_from(">II", data, 16)
            return width, height
        for marker, position in jpeg_segments(data) if data.startswith(_JPEG) else ():
            if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
                height, width = struct.unpack_from(">HH", data, position + 3)
                return width, height
    except struct.error:
        pass
    return None


def is_whole(data: bytes) -> bool:
    """Whether a JPEG file has its end, which some decoders fill up with grey unasked.

    Inside a scan 0xFF is always escaped, so its first unescaped 0xD9 is the picture's end. Of other
    kinds the decoder says it.
    """
    if not data.startswith(_JPEG):
        return True
    try:
        scan = next((position for marker, position in jpeg_segments(data) if marker == 0xDA), None)
    except struct.error:
        return False
    return scan is not None and b"\xff\xd9" in data[scan:]


def jpeg_segments(data: bytes) -> Iterator[tuple[int, int]]:
    """(marker, position after it) of a JPEG file's segments, up to the first scan."""
    position = 2
    while position + 4 <= len(data):
        if data[position] != 0xFF:
            return
        marker = data[position + 1]
        if marker == 0xFF:  # fill bytes may stand before a marker
            position += 1
            continue
        yield marker, position + 2
        if marker == 0xDA:
            return
        position += 2 + int(struct.unpack_from(">H", data, position + 2)[0])


# What a PNM file says before its pixels: after its kind three numbers, and comments among them.
_PNM_HEADER = re.compile(rb"P([2356])" + 3 * rb"(?:\s|#[^\n]*\n)+(\d+)")
_PNM_HEADER_BYTES = 4096


def _with_full_range(picture: Picture, data: bytes) -> Picture:
    """A picture whose white is that of its numbers: PNM files say which number is white.

    Sensors of 10, 12 or 14 bits write theirs, and a decoder keeps the numbers as they are.
    """
    header = _PNM_HEADER.match(data[:_PNM_HEADER_BYTES])
    if header is None or picture.dtype not in (np.uint8, np.uint16):
        return picture
    white, full = int(header[4]), 255 if picture.dtype == np.uint8 else 65_535
    written_out = header[1] in b"23"
    if not 0 < white < full or (written_out and full == 255):  # of those OpenCV does it
        return picture
    scaled = np.rint(np.minimum(picture, white) * np.float32(full / white))
    return np.asarray(np.minimum(scaled, full), picture.dtype)


# Tag 338, one short number: alpha that the colours are not multiplied by, which OpenCV does then.
_STRAIGHT_ALPHA = (
    (b"II", re.compile(rb"(\x52\x01\x03\0\x01\0\0\0)\x02", re.DOTALL)),
    (b"MM", re.compile(rb"(\x01\x52\0\x03\0\0\0\x01\0)\x02", re.DOTALL)),
)
# Tag 274, of any type of whole number, one value, which is not 1: little and big endian.
_TURNED = (
    (b"II", re.compile(rb"(\x12\x01.\0\x01\0{3,7})[\x02-\x08]", re.DOTALL)),
    (b"MM", re.compile(rb"(\x01\x12\0.\0{3,7}\x01\0{0,7})[\x02-\x08]", re.DOTALL)),
)


def as_stored(data: bytes) -> bytes:
    """A picture file whose decoder leaves the pixels as they are stored.

    OpenCV turns a TIFF file by its note of orientation, whatever it is told, and darkens colours by
    alpha: in a copy the notes are made to say that nothing is turned, and colours are dark already.
    """
    if data.startswith(_TIFFS):
        for order, note in (*_TURNED, *_STRAIGHT_ALPHA):
            if data.startswith(order) and note.search(data):
                data = note.sub(b"\\g<1>\x01", data)
    return data
