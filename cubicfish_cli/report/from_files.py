"""A calibration's folder -> what a page says of it, with what cannot be found left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cubicfish_cli.assess.records import recorded_mappings
from cubicfish_cli.corner_files.observations_csv import load_corners, load_correspondences
from cubicfish_cli.files import sha256_of
from cubicfish_cli.formats.camera_yaml import load_any_camera
from cubicfish_cli.lenses.cubic import CubicCamera
from cubicfish_cli.lenses.point_cubic import PointCamera
from cubicfish_cli.observations import Observations
from cubicfish_cli.photos import find_photos
from cubicfish_cli.report.facts import REFINED, Facts, Lack, gather
from cubicfish_cli.report.pictures import matched
from cubicfish_cli.target import Target, load_target
from cubicfish_cli.wording import quoted

_REFINED = "target.refined.yaml"
_CORNERS = "corners.csv"
# Programs that save a calibration may put the target there; its place is not on record then.
_TARGET = "target.yaml"


def facts_of_files(
    camera_file: Path,
    *,
    target: Path | None,
    photos: Sequence[Path],
    corners: Path | None = None,
) -> Facts:
    """Read a camera and what lies beside it, or where it says that it came from.

    A file that the camera file names is read only if it still has the SHA-256 that stands there.

    Args:
        camera_file: camera.yaml; corners.csv, target.refined.yaml and, where the target's place is
            not on record, target.yaml are looked for beside it.
        target: the calibration target as drawn, where it is not at its recorded place.
        photos: files, folders or patterns of the photos, where they are not at theirs.
        corners: the corners.csv of the fit, where it is not beside the camera.

    Raises:
        CubicfishError: a file that is there cannot be used.

    """
    loaded = load_any_camera(camera_file)
    folder = camera_file.parent
    absent: list[str] = []
    refined = loaded.fit.get("refine_target") in REFINED
    drawn = target or _recorded(loaded.made_by.get("target"), folder) or _beside(folder, _TARGET)
    if refined:
        drawn = _beside(folder, _REFINED) or target
    thing = None if drawn is None else load_target(drawn)
    size = loaded.camera.image_size
    pairs = _pairs(corners or folder / _CORNERS, folder, loaded.made_by, thing, size)
    lack = _lack(folder, loaded.made_by, thing, refined=refined) if pairs is None else None
    inputs = recorded_mappings(loaded.made_by.get("inputs"))
    names = [str(record.get("image")) for record in recorded_mappings(loaded.fit.get("per_image"))]
    known = [Path(str(record.get("file"))) for record in inputs]
    digests = {Path(str(r.get("file"))): str(r.get("sha256")) for r in inputs}
    recorded = matched(names, known)
    if photos:
        found = find_photos(photos)
        files = {photo.name: photo.path for photo in found}
        files = {**matched(names, [photo.path for photo in found]), **files}
    else:
        places = {name: _place(path, folder) for name, path in recorded.items()}
        files = {name: path for name, path in places.items() if path is not None}
    lost = [name for name in names if name not in files]
    if lost and files:
        absent.append(f"{len(lost)} of {len(names)} photos are not at hand, such as {lost[0]}.")
    return gather(
        loaded.camera,
        loaded.fit,
        loaded.made_by,
        pairs=pairs,
        target=thing,
        files=files,
        digests={name: digests[path] for name, path in recorded.items()},
        lack=lack,
        absent=absent,
    )


def facts_of_fit(
    camera: CubicCamera | PointCamera,
    fit: Mapping[str, Any],
    made_by: Mapping[str, Any],
    *,
    pairs: Observations,
    target: Target | None,
    photos: Sequence[Path],
) -> Facts:
    """What a page says of a fit that is still at hand.

    Args:
        camera: the camera.
        fit: how well it fits, as camera.yaml will have it.
        made_by: how it was made, likewise.
        pairs: what was fitted to.
        target: the calibration target as fitted.
        photos: the photos' files; none for corners alone.

    """
    if target is not None:
        pairs = pairs.with_target(target)
    files = matched([record["image"] for record in fit["per_image"]], photos)
    return gather(camera, fit, made_by, pairs=pairs, target=target, files=files)


def _pairs(
    beside: Path,
    folder: Path,
    made_by: Mapping[str, Any],
    target: Target | None,
    size: tuple[int, int],
) -> Observations | None:
    if target is not None and beside.is_file():
        return load_corners(beside, target, image_size=size).by_photo()
    inputs = recorded_mappings(made_by.get("inputs"))
    table = _recorded(inputs[0], folder) if len(inputs) == 1 else None
    if table is None or table.suffix.lower() != ".csv":
        return None
    if made_by.get("target") is None:
        return load_correspondences(table, image_size=size)
    return None if target is None else load_corners(table, target, image_size=size).by_photo()


def _lack(
    folder: Path, made_by: Mapping[str, Any], target: Target | None, *, refined: bool
) -> Lack:
    """What is missing of the corners, or of what they are of."""
    on_record = made_by.get("target")
    has_table = (folder / _CORNERS).is_file() or bool(recorded_mappings(made_by.get("inputs")))
    if target is None and has_table and (on_record is not None or (folder / _CORNERS).is_file()):
        if refined:
            why = f"the target was fitted too, and {_REFINED} is not beside the camera"
        elif isinstance(on_record, Mapping):
            name = quoted(str(on_record.get("file")))
            why = f"the target is not where it was, or has changed ({name})"
        else:
            why = f"the target is not on record, and no {_TARGET} is beside the camera"
        return Lack(why=why, name_it="--target")
    why = f"there is no {_CORNERS} beside the camera, and "
    if recorded_mappings(made_by.get("inputs")):
        why += "the table that it was calibrated from is not where it was, or has changed"
    else:
        why += "what it was calibrated from is not on record"
    return Lack(why=why, name_it="--corners")


def _beside(folder: Path, name: str) -> Path | None:
    path = folder / name
    return path if path.is_file() else None


def _recorded(record: object, folder: Path) -> Path | None:
    """The file that a record names, if it is there and still the same."""
    if not isinstance(record, Mapping):
        return None
    path = _place(Path(str(record.get("file"))), folder)
    try:
        return path if path and sha256_of(path) == record.get("sha256") else None
    except OSError:
        return None


def _place(path: Path, folder: Path) -> Path | None:
    """Where a recorded path leads: from here, or from the folder that holds the calibration's."""
    for place in (path, folder.resolve().parent / path):
        try:
            if place.is_file():
                return place
        except (OSError, ValueError):  # a name that no file can have
            continue
    return None
