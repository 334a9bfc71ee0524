"""Tables that say which photos of a rig's cameras are of one shot, and when each was taken."""

from collections.abc import Sequence
from pathlib import Path

from cubicfish import CorrespondenceError, quoted
from cubicfish.files import Table


def load_shots(path: Path) -> list[tuple[str, str, str]]:
    """Which photos are of one shot, by a table: rows for :func:`calibrate_rig`.

    Args:
        path: a CSV file with the columns ``shot,camera,image``.

    Raises:
        CorrespondenceError: it is none.

    """
    names = ("shot", "camera", "image")
    columns = Table.read(path, required=names, optional=(), error=CorrespondenceError).columns
    return list(zip(*(columns[name] for name in names), strict=True))


def load_times(path: Path, cameras: Sequence[str]) -> dict[str, dict[str, float]]:
    """When photos were taken, by a table with the columns ``camera,image,seconds``.

    Raises:
        CorrespondenceError: it is none, or names none of the cameras.

    """
    names = ("camera", "image", "seconds")
    table = Table.read(path, required=names, optional=(), error=CorrespondenceError)
    rows = zip(table.columns["camera"], table.columns["image"], strict=True)
    times: dict[str, dict[str, float]] = {}
    for (camera, image), time in zip(rows, table.floats("seconds").tolist(), strict=True):
        times.setdefault(camera, {})[image] = time
    if not set(times) & set(cameras):
        raise CorrespondenceError(
            f"{path} has times of {', '.join(map(quoted, sorted(times)[:5]))} and of none of the "
            f"cameras {', '.join(cameras)}: write their names into its column camera"
        )
    return times
