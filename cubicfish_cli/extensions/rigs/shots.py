"""The shots of a rig, and what a run renders of each: a picture of all that its cameras see."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy.typing as npt

from cubicfish import Listener, UndistortMap
from cubicfish.photos import Photo, PictureFile
from cubicfish.rigs import Body, match_shots
from cubicfish.views import ChosenView, Interpolation
from cubicfish_cli.extensions.rigs.naming import owners_of
from cubicfish_cli.inputs.paths import named_photos
from cubicfish_cli.undistortion.batch import MAKING, Job, Size, Views

Shot = Mapping[str, Path]
"""Camera -> its photo."""


class RigViews(Views):
    """A view of all that a rig's cameras see: the same for all shots."""

    def __init__(self, body: Body, view: ChosenView, interpolation: Interpolation) -> None:
        """Prepare for the shots of a rig.

        Args:
            body: the cameras, for photos of the size that there are.
            view: what is rendered, in the frame of the rig.
            interpolation: how pixels are blended.

        """
        self._body, self.interpolation = body, interpolation
        self._view = replace(view, camera=None)  # what several see belongs to none
        self._joined: Any = None  # its panorama, once it is made

    def __getstate__(self) -> dict[str, Any]:
        """Travel without the maps, which are quicker made than sent."""
        return {**vars(self), "_joined": None}

    def chosen(self, source: Path, size: Size) -> ChosenView:
        """The view that is asked for."""
        return self._view

    def maps(self, source: Path, size: Size) -> Mapping[str, UndistortMap]:
        """For what its view and its valid pixels tell: it maps nothing."""
        return {"": self._make_panorama().whole_map}

    def __call__(
        self, job: Job, photos: Mapping[str, npt.NDArray[Any]]
    ) -> dict[str, npt.NDArray[Any]]:
        """The picture of a shot."""
        return {"": self._make_panorama().render(photos, self.interpolation)[0]}

    def _make_panorama(self) -> Any:
        """Made once, from any thread."""
        with MAKING:
            if self._joined is None:
                self._joined = self._body.panorama(self._view.first)
            return self._joined


def sizes_of(shots: Iterable[Shot]) -> dict[str, Size]:
    """The size of each camera's first photo."""
    first: dict[str, Path] = {}
    for photos in shots:
        first = {**photos, **first}
    return {name: PictureFile.read(photo).size for name, photo in first.items()}


def shots_of(
    sources: Sequence[Path], cameras: Sequence[str], listener: Listener = Listener()
) -> dict[str, Shot]:
    """The shots that the user named: name -> the photo of each camera.

    A source is a folder with a folder for each camera, a camera's own folder, or a photo; see
    :func:`owners_of`.

    Raises:
        UsageError: it is not known which camera a source is of.
        PhotoError: one holds no photo.
        FitError: a camera's photos would be of one shot twice.

    """
    photos = _photos_by_camera(sources, cameras, listener)
    if all(len(own) == 1 for own in photos.values()):
        first = next(iter(photos.values()))[0]
        return {first.stem: {name: own[0] for name, own in photos.items()}}
    if len(photos) == 1:
        ((name, own),) = photos.items()
        return {path.stem: {name: path} for path in own}
    matched = match_shots({name: list(map(str, own)) for name, own in photos.items()}, "name")
    shots: dict[str, dict[str, Path]] = {}
    for name, index_of in zip(photos, matched.photos, strict=True):
        for photo, index in index_of.items():
            shots.setdefault(matched.names[index], {})[name] = Path(photo)
    return dict(sorted(shots.items(), key=lambda item: Photo.natural_key(item[0])))


def _photos_by_camera(
    sources: Sequence[Path], cameras: Sequence[str], listener: Listener
) -> dict[str, list[Path]]:
    """The photos of each camera that has any, in the cameras' order."""
    inside = [path / name for path in sources for name in cameras if (path / name).is_dir()]
    paths = inside if inside and len(sources) == 1 else list(sources)
    photos: dict[str, list[Path]] = {name: [] for name in cameras}
    for path, owner in zip(paths, owners_of(paths, cameras), strict=True):
        photos[owner] += [photo.path for photo in named_photos([path], listener)]
    return {name: own for name, own in photos.items() if own}
