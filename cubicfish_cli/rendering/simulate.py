"""Photos of known truth: a target through any lens, from poses that are given or chosen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from cubicfish_cli.errors import TargetError
from cubicfish_cli.rendering.near import WanderingPupil
from cubicfish_cli.rendering.pose import Pose, rotation_matrix
from cubicfish_cli.rendering.render import Unproject, render
from cubicfish_cli.rendering.views import WholeLens, choose_views, sample_views
from cubicfish_cli.target import Target
from cubicfish_cli.types import FloatArray

# Rays to 1e-7: a thousandth of a pixel of a lens with 10,000 pixels per radian, in half the memory.
FloatArray32 = npt.NDArray[np.float32]

_PIXELS_PER_BLOCK = 200_000
FORMATS = ("jpg", "png")
_QUALITY = 95
_SUPERSAMPLE = 4
# Of each photo there are so many views to choose from, and at least so many in all.
_VIEWS_PER_PHOTO, _FEWEST_VIEWS, _MOST_VIEWS = 15, 120, 1500
# Towards the lamp, camera frame: over the photographer's left shoulder.
LAMP = np.array([-0.35, -0.5, -0.79])


@dataclass(frozen=True, eq=False)
class RayGrid:
    """A lens as a table: the ray of each pixel's middle and its slopes along x and y.

    Within a pixel the ray is taken as linear, which is off by some thousandths of a pixel at most.

    Attributes:
        ray: (height, width, 3), NaN outside the lens's field.
        by_x, by_y: (height, width, 3) change a pixel.

    """

    ray: FloatArray32
    by_x: FloatArray32
    by_y: FloatArray32

    @classmethod
    def of(cls, unproject: Unproject, image_size: tuple[int, int]) -> RayGrid:
        """Tabulate ``unproject`` for photos of ``image_size`` (width, height)."""
        width, height = image_size
        # One pixel more on each side, so that every slope has two neighbours.
        framed = np.empty((height + 2, width + 2, 3), np.float32)
        x = np.arange(-1.0, width + 1)
        rows_per_block = max(1, _PIXELS_PER_BLOCK // len(x))
        for top in range(0, height + 2, rows_per_block):
            y = np.arange(top, min(height + 2, top + rows_per_block)) - 1.0
            pixel = np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1)
            rays = unproject(pixel.reshape(-1, 2))
            framed[top : top + len(y)] = rays.reshape(len(y), width + 2, 3)
        return cls(
            ray=framed[1:-1, 1:-1],
            by_x=_slope(framed[1:-1, :-2], framed[1:-1, 1:-1], framed[1:-1, 2:]),
            by_y=_slope(framed[:-2, 1:-1], framed[1:-1, 1:-1], framed[2:, 1:-1]),
        )

    def __call__(self, pixel: FloatArray) -> FloatArray:
        """Pixels (N, 2) of the photo -> rays (N, 3), as a renderer wants them."""
        height, width = self.ray.shape[:2]
        place = np.clip(np.rint(pixel).astype(np.intp), 0, (width - 1, height - 1))
        flat = place[:, 1] * width + place[:, 0]
        off = pixel - place
        rays = self.ray.reshape(-1, 3)[flat].astype(float)
        rays += off[:, :1] * self.by_x.reshape(-1, 3)[flat]
        rays += off[:, 1:] * self.by_y.reshape(-1, 3)[flat]
        return rays


def _slope(before: FloatArray32, here: FloatArray32, after: FloatArray32) -> FloatArray32:
    """Change a step; from one side where the other is outside the field, else none."""
    both = (after - before) / 2
    one = np.where(np.isnan(before), after - here, here - before)
    slope = np.where(np.isnan(both), one, both)
    return np.nan_to_num(slope, nan=0.0)


@dataclass(frozen=True, kw_only=True)
class Look:
    """How a photo looks beside what is in it; see :func:`cubicfish_cli.rendering.render.render`.

    Attributes:
        noise: standard deviation of the sensor's noise, grey levels.
        blur: standard deviation of the lens's blur, pixels.
        vignetting: share of the light that is lost at 90° from the axis.
        exposure: 1 is a well-lit photo, 0.2 a dark one; overexposed ones bleed.

    """

    noise: float = 2.0
    blur: float = 0.7
    vignetting: float = 0.4
    exposure: float = 1.0


def chosen_poses(
    target: Target, lens: WholeLens, image_size: tuple[int, int], count: int, *, seed: int = 0
) -> list[Pose]:
    """Poses of ``count`` photos that fill the field from varied sides and distances.

    Raises:
        TargetError: the target cannot be drawn, or cannot be seen so often.

    """
    wanted = min(max(_FEWEST_VIEWS, _VIEWS_PER_PHOTO * count), max(_MOST_VIEWS, count))
    views = sample_views(target, lens, image_size, wanted, seed=seed)
    if len(views) < count:
        raise TargetError(
            f"only {len(views)} poses were found from which this camera sees a whole board with "
            f"squares large enough to be found, and {count} are wanted: use boards with fewer and "
            "larger squares, a camera with more pixels or a wider field, or name poses with --poses"
        )
    return [view.pose for view in choose_views(views, lens, image_size, count)]


def simulated_photos(
    target: Target,
    lens: WholeLens,
    image_size: tuple[int, int],
    poses: Mapping[str, Pose],
    look: Look,
    *,
    seed: int = 0,
) -> Iterator[tuple[str, npt.NDArray[np.uint8]]]:
    """Render the photos one by one: name and (height, width) grey levels.

    The lens's rays are worked out once for all photos. Boards are rendered flat.

    Raises:
        TargetError: a board of a kind that cannot be drawn.

    """
    rays = RayGrid.of(lens.unproject, image_size)
    flat = target.with_flat_boards()
    for number, (name, pose) in enumerate(poses.items()):
        yield (
            name,
            render(
                flat,
                rays,
                pose,
                image_size,
                supersample=_SUPERSAMPLE,
                noise=look.noise,
                blur=look.blur,
                vignetting=look.vignetting,
                exposure=look.exposure,
                light_from=rotation_matrix(pose[0]).T @ LAMP,
                edges_only=True,
                seed=(seed, number),
                ray_starts=lens.ray_starts if isinstance(lens, WanderingPupil) else None,
            ),
        )


def photo_bytes(photo: npt.NDArray[np.uint8], form: str) -> bytes:
    """A photo as a JPEG file of quality 95 (``jpg``) or a PNG file (``png``)."""
    options = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY] if form == "jpg" else []
    _, data = cv2.imencode(f".{form}", photo, options)
    return data.tobytes()
