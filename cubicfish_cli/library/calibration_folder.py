"""The folder of a calibration: what is in it, written together or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cubicfish_cli.errors import OutputError
from cubicfish_cli.files import Content, refuse_existing, write_files

NAMES = {
    "camera": "camera.yaml",
    "map": "undistort_map.npz",
    "target": "target.refined.yaml",
    "report": "report.html",
    "corners": "corners.csv",
    "drawn": "target.yaml",
}
"""Of its files by what they hold; the camera is the first to go and the last to be there."""

# Made by a calibration only, and true of its camera only. A corners.csv may be the user's own.
_ITS_OWN = ("map", "target", "report")


@dataclass(frozen=True, kw_only=True)
class CalibrationFolder:
    """A folder that a calibration is to be written into.

    Attributes:
        path: the folder.
        inputs: what the calibration is made from, which stays as it is.

    """

    path: Path
    inputs: Sequence[Path]

    def refuse(self, *kinds: str, overwrite: bool) -> None:
        """Refuse at once what cannot be written at the end, by its name in :data:`NAMES`.

        Raises:
            OutputError: a file exists and ``overwrite`` is false, or cannot be written.

        """
        refuse_existing(*(self.path / NAMES[kind] for kind in kinds), overwrite=overwrite)

    def refuse_input(self, kind: str) -> None:
        """Refuse to replace a file, also with ``overwrite``, that the calibration is made from.

        Raises:
            OutputError: it is one.

        """
        if self.has_input(kind):
            raise OutputError(
                f"{self.path / NAMES[kind]} would be replaced, and is what this calibration is "
                "made from: choose another folder with -o"
            )

    def has_input(self, kind: str) -> bool:
        """Whether one of its files is what the calibration is made from."""
        return self._is_input(self.path / NAMES[kind])

    def write(
        self, contents: Mapping[str, Content | None], *, overwrite: bool
    ) -> tuple[dict[str, Path], list[Path]]:
        """Write its files, all or none; of an earlier calibration nothing is left.

        Args:
            contents: by their names in :data:`NAMES`; None for what is not there.
            overwrite: whether files may be replaced.

        Returns:
            Where each is, and what went of an earlier calibration.

        Raises:
            OutputError: one exists and ``overwrite`` is false, or cannot be written.

        """
        paths = {kind: self.path / NAMES[kind] for kind in NAMES if contents.get(kind) is not None}
        others = [self.path / NAMES[kind] for kind in _ITS_OWN if kind not in paths]
        obsolete = [path for path in others if path.is_file() and not self._is_input(path)]
        files = {path: contents[kind] or "" for kind, path in paths.items()}
        write_files(files, overwrite=overwrite, obsolete=obsolete if overwrite else ())
        return paths, [path for path in obsolete if not path.exists()]

    def _is_input(self, path: Path) -> bool:
        return any(one.exists() and path.exists() and path.samefile(one) for one in self.inputs)
