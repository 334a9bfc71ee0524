"""The view that options describe for a camera's photos, and what it leaves out of them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

from cubicfish.errors import UsageError
from cubicfish.models.cubic import CubicCamera
from cubicfish.views.fields import (
    Fit,
    axis_focal,
    cropped,
    fit_view,
    lost_shares,
    seen_field_deg,
    trimmed,
)
from cubicfish.views.maps import UndistortMap, WholePhoto, build_map
from cubicfish.views.options import KINDS, OUTER, WHOLE, Kind, ViewOptions
from cubicfish.views.view import (
    Camera,
    CentralView,
    PointProjector,
    View,
    face_views,
    rotation_from_angles,
)

MAX_DEFAULT_FIELD_DEG = 120.0
"""A flat picture of a wider field spends nearly all its pixels on the rim."""


def build_view(
    camera: Camera,
    kind: Kind = "perspective",
    *,
    size: Sequence[int] | None = None,
    hfov_deg: float | None = None,
    vfov_deg: float | None = None,
    focal: float | None = None,
    fit: Fit | None = None,
    rotate_deg: Sequence[float] = (0.0, 0.0, 0.0),
) -> CentralView:
    """Build a picture to render from the camera's photos: the ray along which each pixel looks.

    Its field comes from one of ``hfov_deg``, ``vfov_deg``, ``focal`` and ``fit``. Without any, a
    perspective view keeps the photo's scale on its axis, up to 120° along the longer side, and the
    others show all that the camera sees; an ``equirectangular`` view without a given size is then
    just as large as that at the photo's scale, and along the axis of a lens beyond 180° as large as
    its middle row shows; a ``cylindrical`` one has no columns and rows in which nothing is seen.

    Args:
        camera: the camera whose photos are rendered.
        kind: in a ``perspective`` view straight lines are straight, in a ``cylindrical`` one
            verticals are; ``equirectangular`` and ``equidistant`` views show angles evenly, and
            ``stereographic`` ones keep shapes.
        size: (width, height), pixels; by default the photo's.
        hfov_deg: field across the width, degrees; with ``vfov_deg`` it sets the height.
        vfov_deg: field down the height, degrees.
        focal: scale in the middle, pixels per radian.
        fit: ``inner`` for the widest field without an empty pixel, ``outer`` for the narrowest
            that loses nothing, or a share from 0 (inner) to 1 (outer).
        rotate_deg: (yaw, pitch, roll): look right, then up, then turn clockwise, degrees.

    Raises:
        UsageError: an option is given twice, or is not one of this kind of view.
        ViewError: the camera shows no such view.

    """
    if kind == "cube":
        raise UsageError("a cube is several views: ask for it by ViewOptions(kind='cube')")
    if fit == WHOLE:
        raise UsageError("fit 'whole' is what files are asked for: ViewOptions(fit='whole')")
    numbers: dict[str, Any] = {"size": size, "rotate_deg": rotate_deg}  # of any kind
    options = ViewOptions(
        kind=kind, hfov_deg=hfov_deg, vfov_deg=vfov_deg, focal=focal, fit=fit, **numbers
    )
    view = choose_view(camera, options).first
    assert isinstance(view, CentralView)
    return view


@dataclass(frozen=True, kw_only=True)
class ChosenView:
    """The views that are rendered, and what they are of.

    Attributes:
        views: name of the part -> view; the name of a single part is "", a cube has six.
        camera: the camera whose photos are rendered; None for several cameras.
        at_limit: whether the camera sees more than the fitted view can show.
        unit: unit of length, for the picture of a plane.
        given_field: whether the caller gave its field.

    """

    views: Mapping[str, View]
    camera: PointProjector | None = None
    at_limit: bool = False
    unit: str = "unit"
    given_field: bool = True

    @property
    def first(self) -> View:
        """The view, or the front face of a cube."""
        return next(iter(self.views.values()))

    @cached_property
    def maps(self) -> dict[str, UndistortMap]:
        """Part of the view -> its map for the camera's photos."""
        assert self.camera is not None
        return {part: build_map(self.camera, one) for part, one in self.views.items()}

    def describe(self) -> str:
        """Describe the view in a few words."""
        width, height = self.first.size
        if len(self.views) > 1:
            return f"the six faces of a cube, {width}x{height} pixels each"
        return f"{width}x{height} pixels, {self.first.describe(self.unit)}"

    @property
    def seen_field_deg(self) -> tuple[float, float] | None:
        """How much of the view's field the camera sees, across its middle and down, degrees.

        None where that is not known: of a cube, of a plane, and of several cameras.
        """
        view = self.first
        if self.camera is None or len(self.views) > 1 or not isinstance(view, CentralView):
            return None
        return seen_field_deg(self.camera, view)

    @property
    def extrapolates(self) -> bool:
        """Whether it shows what photos show where the camera is not calibrated."""
        return isinstance(self.camera, WholePhoto)

    @property
    def lost_shares(self) -> tuple[float, float] | None:
        """How much of what photos show it leaves out, from 0 to 1; None where it is not known.

        The first is the share where the camera is not calibrated, the second lies beyond the view's
        edges.
        """
        camera = self.camera.camera if isinstance(self.camera, WholePhoto) else self.camera
        view = self.first
        if not isinstance(camera, CubicCamera) or not isinstance(view, CentralView):
            return None
        return lost_shares(camera, view) if len(self.views) == 1 else None

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON: of a cube, the first face and the names of all."""
        first = self.first
        record = {**first.as_record(), "words": self.describe(), "cut": self.at_limit}
        if len(self.views) > 1:
            return {**record, "parts": list(self.views)}
        if isinstance(first, CentralView):
            return {**record, "hfov_deg": first.hfov_deg, "vfov_deg": first.vfov_deg}
        return record


def choose_view(camera: Camera, wanted: View | ViewOptions | None) -> ChosenView:
    """Choose the view of a camera's photos: as it is given, or as its options describe it.

    Raises:
        UsageError: the fit is ``whole``, and the photos are of several cameras.
        ViewError: the view is not one that can be rendered.

    """
    if isinstance(wanted, View):
        return ChosenView(views={"": wanted}, camera=camera)
    options = wanted or ViewOptions()
    if options.kind == "cube":
        return ChosenView(views=_cube_faces(camera, options), camera=camera)
    if options.fit == WHOLE:
        camera = _shown_whole(camera)
    view, at_limit = _make_view(options, options.size or camera.image_size), False
    if not options.gives_field:
        view, at_limit = _choose_field(camera, view, options)
    given_field = options.gives_field or any(options.rotate_deg)
    return ChosenView(views={"": view}, camera=camera, at_limit=at_limit, given_field=given_field)


def _cube_faces(camera: Camera, options: ViewOptions) -> Mapping[str, View]:
    """Make the faces, by default as large as keeps the photo's scale on the axis."""
    side = options.size[0] if options.size else max(1, round(2 * axis_focal(camera)))
    return face_views(side, rotation_from_angles(*options.rotate_deg))


def _shown_whole(camera: Camera) -> WholePhoto:
    if not isinstance(camera, CubicCamera):
        raise UsageError(
            "{fit} whole is for photos of one camera",
            do="take {fit} outer",
            arguments={"fit": "fit"},
        )
    return WholePhoto(camera=camera)


def _choose_field(
    camera: Camera, view: CentralView, options: ViewOptions
) -> tuple[CentralView, bool]:
    """Choose the field where only its fit is given, or nothing.

    Returns:
        The view with it, and whether the camera sees more than such a view can show.

    """
    scale = view.size[0] / camera.image_size[0]
    if options.leaves_field_open and view.kind.endswith("equirectangular"):
        return cropped(camera, replace(view, focal=axis_focal(camera))), False
    if options.fit is None and view.kind == "perspective":
        widest = min(MAX_DEFAULT_FIELD_DEG, 2 * camera.max_angle_deg)
        least = max(camera.image_size) / 2 / math.tan(math.radians(widest) / 2)
        return replace(view, focal=max(axis_focal(camera), least) * scale), False
    share = OUTER if options.fit in (None, WHOLE) else float(options.fit)
    view, at_limit = fit_view(camera, view, share)
    if options.fit is None and view.kind.endswith("cylindrical") and at_limit:
        # Nobody wants a view all round only because the camera sees something nearly overhead.
        view, at_limit = replace(view, focal=max(view.focal, axis_focal(camera) * scale)), False
    if options.leaves_field_open and view.kind.endswith("cylindrical"):
        view = trimmed(camera, view)
    return view, at_limit


def _make_view(options: ViewOptions, size: tuple[int, int]) -> CentralView:
    """Make the view of a size, with its field if the options give one."""
    view = CentralView(
        kind=options.kind or KINDS[0],
        size=size,
        focal=options.focal or 1.0,
        rotation=rotation_from_angles(*options.rotate_deg),
    )
    field = partial(CentralView.with_field, view.kind, rotation=view.rotation)
    if options.hfov_deg is None:
        return view if options.vfov_deg is None else field(options.vfov_deg, size, vertical=True)
    view = field(options.hfov_deg, size)
    if options.vfov_deg is None:
        return view
    one = field(options.vfov_deg, (1, 1), vertical=True)  # its focal is 1 / height
    return replace(view, size=(size[0], max(1, round(view.focal / one.focal))))
