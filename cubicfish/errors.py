"""Errors that a user can cause, one class per stage.

Every error that a user can cause is a :class:`CubicfishError` whose text is one line that
says what, where and what to do next. The command line turns it into ``Error: ...`` and
exit code 1; a library caller can also catch the built-in class it derives from.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from types import MappingProxyType
from typing import Any, Self

from cubicfish.wording import shown


class CubicfishError(Exception):
    """Base of all errors that this package raises on purpose.

    Attributes:
        what: what is wrong; the whole text where nothing more is known.
        do: what to do about it; empty where ``what`` says so. In both, names in braces stand for
            ``arguments``.
        about: the file that it is about, which the text begins with; empty where ``what`` names it.
        apart: whether ``what`` is a sentence of its own, after a colon.
        arguments: name -> an argument that helps, as a program writes it.
        findings: Findings that are the cause; the first is told, after ``what`` if there is any.

    """

    def __init__(
        self,
        what: str = "",
        *,
        do: str = "",
        about: str = "",
        apart: bool = False,
        arguments: Mapping[str, str] = MappingProxyType({}),
        findings: Sequence[Any] = (),
    ) -> None:
        self.what, self.do, self.about, self.apart = what, do, about, apart
        self.arguments, self.findings = dict(arguments), tuple(findings)
        self._before = self._after = ""
        super().__init__(self.text(self.arguments))

    @classmethod
    def missing(cls, path: str | os.PathLike[str], *, do: str = "") -> Self:
        """The error about a file that is not there; ``do`` is what else may be done about it."""
        check = "check the name and the current folder"
        return cls(f"{shown(path)} does not exist", do=f"{check}, or {do}" if do else check)

    def text(
        self,
        arguments: Mapping[str, str],
        tell: Callable[[Any], tuple[str, str]] = lambda finding: (str(finding), ""),
    ) -> str:
        """The text in other words.

        Args:
            arguments: the words for arguments, such as options of a command line.
            tell: why and what to do, of a finding.

        """
        what, do = self.what, self.do
        if self.findings:
            why, remedy = tell(self.findings[0])
            line = f"{why}; {remedy}" if remedy else why
            what, do = (what, f"{do}; {line}" if do else line) if what else (why, remedy)
        text = f"{what}: {do}" if do else what
        for name, own in self.arguments.items():
            text = text.replace(f"{{{name}}}", arguments.get(name, own))
        text = f"{self.about}{':' * self.apart} {text}" if self.about else text
        return f"{self._before}{text}{self._after}"

    def amid(self, before: str = "", after: str = "") -> Self:
        """The same error with more text around its own."""
        again = copy(self)
        again._before, again._after = before + self._before, self._after + after
        again.args = (again.text(self.arguments),)
        return again


class TargetError(CubicfishError, ValueError):
    """A target, in a file or built in code, is not usable."""


class PhotoError(CubicfishError, OSError):
    """A photo is missing, unreadable, empty or of the wrong size."""


class DetectionError(CubicfishError, ValueError):
    """No usable corners could be found or named in the photos."""


class CorrespondenceError(CubicfishError, ValueError):
    """A corners or correspondences file is malformed or does not fit the target."""


class FitError(CubicfishError, ValueError):
    """The pairs cannot determine a camera, or the fit is not a sound camera."""


class CameraFileError(CubicfishError, ValueError):
    """A camera file is malformed or of an unknown version."""


class ViewError(CubicfishError, ValueError):
    """An output view cannot be made from this camera, or a map does not fit a picture."""


class ClusterError(CubicfishError, OSError):
    """A cluster cannot be reached, has no workers, or its workers cannot do this work."""


class OutputError(CubicfishError, OSError):
    """An output exists already, or cannot be written."""


class UsageError(CubicfishError, ValueError):
    """Options or arguments do not go together."""
