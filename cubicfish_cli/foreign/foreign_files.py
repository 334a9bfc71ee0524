"""Other tools' camera files: recognise the format, and read the lens."""

import re
from pathlib import Path
from typing import Any

from cubicfish import CameraFileError, UsageError
from cubicfish.files import read_bytes, read_text
from cubicfish.models import Lens
from cubicfish_cli.extension_guard import Place, read_formats

OWN_FIELD = "the camera is trusted to"
"""What stands in our own files before the half-angle of the field, degrees."""

_SNIFFED_BYTES = 64_000_000
_LARGEST_DEG = 175.0  # no camera is trusted farther


def read_foreign(
    path: Path,
    *,
    name: str | None = None,
    camera: str | None = None,
    image_size: tuple[int, int] | None = None,
    lens: str | None = None,
) -> tuple[Lens, str]:
    """Read the lens of another tool's file.

    Args:
        path: the file.
        name: its format, one of :func:`read_formats`; by default the content decides.
        camera: which one, of formats that hold several.
        image_size: of the photos, for formats that do not say.
        lens: ``fisheye`` or ``pinhole``, for formats that do not say.

    Returns:
        The lens and the format's name.

    Raises:
        CameraFileError: the file is of no known format, or is damaged; one line.
        UsageError: a camera is named though the file holds one only, or a lens though it says so.

    """
    name = name or sniffed(path)
    made = read_formats()[name]
    given: dict[str, Any] = {"image_size": image_size} if made.sizeless else {}
    if made.holds_several:
        given["camera"] = camera
    elif camera is not None:
        raise UsageError(f"{path} holds one camera: leave out --camera")
    if lens is not None and not made.lensless:
        raise UsageError(f"{path} says which lens it holds: leave out --lens")
    if lens is not None:
        given["lens"] = lens
    found: Lens = Place(made.extension, made.read).load()(path, **given)
    if image_size is not None and image_size != found.image_size:
        raise CameraFileError(
            "{} is for photos of {}x{} pixels, not of --size {}x{}: leave out --size".format(
                path, *found.image_size, *image_size
            )
        )
    return found, name


def own_field_deg(path: Path) -> float | None:
    """Return the trusted half-angle of a lens that cubicfish exported, degrees; else None.

    Raises:
        CameraFileError: the file cannot be read.

    """
    data = read_bytes(path, max_bytes=_SNIFFED_BYTES, error=CameraFileError)
    found = re.search(rb"%s ([0-9.]{1,9}) degrees" % OWN_FIELD.encode(), data)
    degrees = float(found[1]) if found and found[1].count(b".") < 2 else 0.0
    return degrees if 0 < degrees <= _LARGEST_DEG else None


def sniffed(path: Path) -> str:
    """Return the format of a file, recognised by its content.

    Raises:
        CameraFileError: the file is of no known format, or cannot be read.

    """
    data = read_bytes(path, max_bytes=_SNIFFED_BYTES, error=CameraFileError)
    known = read_formats().values()
    for one in known:
        if one.binary_looks_like and Place(one.extension, one.binary_looks_like).attempt(data):
            return one.name
    text = read_text(path, max_bytes=_SNIFFED_BYTES, error=CameraFileError)
    for one in sorted(known, key=lambda one: one.vague):
        if any(all(mark in text for mark in marks) for marks in one.marks):
            return one.name
    for one in known:
        if one.looks_like and Place(one.extension, one.looks_like).attempt(text):
            return one.name
    if not text.strip():
        raise CameraFileError(f"{path} is empty: name the file that the other tool wrote")
    if re.search(r"^cubicfish:", text, re.MULTILINE):
        raise CameraFileError(f"{path} is a camera.yaml of cubicfish already: use it as it is")
    raise CameraFileError(
        f"{path} is of no format that is known by its looks: name it with --from, one of "
        + ", ".join(read_formats())
    )
