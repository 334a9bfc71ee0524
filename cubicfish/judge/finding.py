"""Finding: the record of what detection, identification, fit, verdict or advice reports."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple, TypeVar

from cubicfish.judge.codes import Code, Remedy, Severity, words

Level = Literal["good", "care", "bad"]


_ABOUT = ("images", "boards", "cameras", "shots")


class FindingText(NamedTuple):
    """The sentences of a finding, and the kind of remedy."""

    what: str
    evidence: str
    do: str
    remedy: Remedy


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing that is reported about a set-up, a fit, a photo or a grid.

    Attributes:
        code: the kind of finding.
        severity: ``bad`` where it makes the camera wrong, ``care`` where it may, ``note`` where it
            does not.
        images: names of the photos that it is about; empty for all.
        boards: names of the boards that it is about; empty for all.
        cameras: names of the cameras of a rig that it is about.
        shots: names of the shots that it is about, or of photos that do not belong to their shot.
        case: the form of the finding, where it has several; a key of the catalogue.
        because: the kind of evidence, where there are several; a key of the catalogue.
        figures: the numbers and names that its sentences need, plain data.
        recorded: its sentences as an earlier run made them, if it was read from a file.

    """

    code: Code
    severity: Severity = Severity.NOTE
    images: tuple[str, ...] = ()
    boards: tuple[str, ...] = ()
    cameras: tuple[str, ...] = ()
    shots: tuple[str, ...] = ()
    case: str = ""
    because: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)
    recorded: FindingText | None = None

    @property
    def what(self) -> str:
        """What is wrong, with figures."""
        return self._sentences.what

    @property
    def evidence(self) -> str:
        """The figures that show it; empty where ``what`` has them."""
        return self._sentences.evidence

    @property
    def do(self) -> str:
        """What to do about it; empty where there is nothing to do."""
        return self._sentences.do

    @property
    def remedy(self) -> Remedy:
        """The kind of remedy, for programs."""
        return self._sentences.remedy

    @property
    def asks_for_photos(self) -> bool:
        """Whether the remedy is to take photos, more or others."""
        return self.remedy in (Remedy.TAKE_PHOTOS, Remedy.TAKE_AGAIN)

    @property
    def why(self) -> str:
        """What is wrong, and the evidence."""
        return f"{self.what} ({self.evidence})" if self.evidence else self.what

    @property
    def line(self) -> str:
        """The whole finding in one line."""
        return f"{self.why}; {self.do}" if self.do else self.why

    @property
    def short(self) -> str:
        """The finding in fewer words, where there is little room."""
        known = words().has(self.code, "short")
        return replace(self, case="short").what if known else self.line

    def __str__(self) -> str:
        return self.line

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML; ``cause`` and ``level`` are older names."""
        record: dict[str, Any] = {
            "cause": self.code.value,
            "code": self.code.value,
            "case": self.case,
            "level": self.severity.value,
            "severity": self.severity.value,
            "remedy": self.remedy.value,
            "what": self.what,
            "evidence": self.evidence,
            "do": self.do,
            "images": list(self.images),
            "boards": list(self.boards),
            "figures": dict(self.figures),
        }
        if self.cameras:
            shots = {"shots": list(self.shots), "line": self.line}
            record |= {"cameras": list(self.cameras), **shots}
        return record

    @cached_property
    def _sentences(self) -> FindingText:
        if self.recorded is not None:
            return self.recorded
        about: dict[str, Any] = {"images": self.images, "boards": self.boards}
        if self.cameras:
            about |= {"cameras": self.cameras, "of_shots": self.shots}
        return words().write_text(self.code, self.case, self.because, {**self.figures, **about})


def of_record(record: Mapping[str, Any]) -> Finding | None:
    """Read a finding from a file, with the sentences of that time; None where it is none."""
    severity = _read_word(Severity, record.get("severity", record.get("level")))
    if severity is None:
        return None
    what, evidence, do, case = (
        str(record.get(key, "")) for key in (*FindingText._fields[:3], "case")
    )
    about: dict[str, Any] = {key: _read_names(record.get(key)) for key in _ABOUT}
    figures = record.get("figures")
    remedy = _read_word(Remedy, record.get("remedy")) or Remedy.CHECK
    return Finding(
        code=_read_word(Code, record.get("code", record.get("cause"))) or Code.UNKNOWN,
        severity=severity,
        **about,
        case=case,
        figures=figures if isinstance(figures, Mapping) else {},
        recorded=FindingText(what, evidence, do, remedy),
    )


def _read_names(value: object) -> tuple[str, ...]:
    return tuple(map(str, value)) if isinstance(value, list) else ()


_Word = TypeVar("_Word", Code, Severity, Remedy)


def _read_word(kind: type[_Word], word: object) -> _Word | None:
    return next((one for one in kind if one.value == word), None)


def level_of(findings: Iterable[Finding]) -> Level:
    """The largest severity; ``good`` where nothing is worse than a note."""
    found = {finding.severity for finding in findings}
    return "bad" if Severity.BAD in found else "care" if Severity.CARE in found else "good"
