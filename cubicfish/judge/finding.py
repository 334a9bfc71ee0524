"""Finding: the record of what detection, identification, fit, verdict or advice reports.

It has facts alone: a code and figures. Whoever shows it to people writes the sentences, and may
attach them, so that files and JSON have them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeVar

from cubicfish.judge.codes import Code, Remedy, Severity, remedy_of

VerdictLevel = Literal["good", "care", "bad"]


_ABOUT = ("images", "boards", "cameras", "shots")
_MOST_NAMED = 3


class FindingText(NamedTuple):
    """The sentences of a finding.

    Attributes:
        what: what is wrong, with figures.
        evidence: the figures that show it; empty where ``what`` has them.
        do: what to do about it; empty where there is nothing to do.

    """

    what: str
    evidence: str = ""
    do: str = ""

    @property
    def why(self) -> str:
        """What is wrong, and the evidence."""
        return f"{self.what} ({self.evidence})" if self.evidence else self.what

    @property
    def line(self) -> str:
        """The whole finding in one line."""
        return f"{self.why}; {self.do}" if self.do else self.why


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One thing that is reported about a set-up, a fit, a photo or a grid.

    Attributes:
        code: the kind of finding: one of :class:`Code`, or one of an extension's own.
        severity: ``bad`` where it makes the camera wrong, ``care`` where it may, ``note`` where it
            does not.
        images: names of the photos that it is about; empty for all.
        boards: names of the boards that it is about; empty for all.
        cameras: names of the cameras of a rig that it is about.
        shots: names of the shots that it is about, or of photos that do not belong to their shot.
        case: the form of the finding, where it has several.
        because: the kind of evidence, where there are several.
        figures: the numbers and names behind it: plain data, or other findings.
        help: what helps, where that is not what helps against findings of its code.
        text: its sentences, where somebody has written them or they were read from a file.

    """

    code: str
    severity: Severity = Severity.NOTE
    images: tuple[str, ...] = ()
    boards: tuple[str, ...] = ()
    cameras: tuple[str, ...] = ()
    shots: tuple[str, ...] = ()
    case: str = ""
    because: str = ""
    figures: Mapping[str, Any] = field(default_factory=dict)
    help: Remedy | None = None
    text: FindingText | None = None

    @property
    def remedy(self) -> Remedy:
        """The kind of remedy, for programs."""
        return self.help or remedy_of(self.code, self.case)

    @property
    def asks_for_photos(self) -> bool:
        """Whether the remedy is to take photos, more or others."""
        return self.remedy in (Remedy.TAKE_PHOTOS, Remedy.TAKE_AGAIN)

    def __str__(self) -> str:
        """Its sentences in one line; without any, its code and figures."""
        return self._facts() if self.text is None else self.text.line

    def as_record(self) -> dict[str, Any]:
        """Plain data for JSON and YAML; ``cause`` and ``level`` are older names."""
        text = self.text or FindingText(self._facts())
        record: dict[str, Any] = {
            "cause": str(self.code),
            "code": str(self.code),
            "case": self.case,
            "level": self.severity.value,
            "severity": self.severity.value,
            "remedy": self.remedy.value,
            **text._asdict(),
            "images": list(self.images),
            "boards": list(self.boards),
            "figures": {
                name: value.as_record() if isinstance(value, Finding) else value
                for name, value in self.figures.items()
            },
        }
        if self.cameras:
            shots = {"shots": list(self.shots), "line": text.line}
            record |= {"cameras": list(self.cameras), **shots}
        return record

    def _facts(self) -> str:
        about = ((name, _shorten(getattr(self, name))) for name in _ABOUT if getattr(self, name))
        figures = ((name, _shorten(value)) for name, value in self.figures.items())
        told = ", ".join(f"{name} {value}" for name, value in (*about, *figures))
        kind = f"{self.code} ({self.case})" if self.case else str(self.code)
        return f"{kind}: {told}" if told else kind


def _shorten(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, tuple | list):
        more = f" and {len(value) - _MOST_NAMED} more" * (len(value) > _MOST_NAMED)
        return "+".join(map(_shorten, value[:_MOST_NAMED])) + more
    return str(value)


def of_record(record: Mapping[str, Any]) -> Finding | None:
    """Read a finding from a file, with the sentences of that time; None where it is none."""
    severity = _read_word(Severity, record.get("severity", record.get("level")))
    if severity is None:
        return None
    what, evidence, do, case = (str(record.get(key, "")) for key in (*FindingText._fields, "case"))
    about: dict[str, Any] = {key: _read_names(record.get(key)) for key in _ABOUT}
    figures = record.get("figures")
    return Finding(
        code=str(record.get("code", record.get("cause", Code.UNKNOWN))),
        severity=severity,
        **about,
        case=case,
        figures=figures if isinstance(figures, Mapping) else {},
        help=_read_word(Remedy, record.get("remedy")) or Remedy.CHECK,
        text=FindingText(what, evidence, do),
    )


def of_line(line: str) -> Finding:
    """A finding of which a file has the sentence alone."""
    return Finding(code=Code.UNKNOWN, text=FindingText(line))


def _read_names(value: object) -> tuple[str, ...]:
    return tuple(map(str, value)) if isinstance(value, list) else ()


_Word = TypeVar("_Word", Severity, Remedy)


def _read_word(kind: type[_Word], word: object) -> _Word | None:
    return next((one for one in kind if one.value == word), None)


def level_of(findings: Iterable[Finding]) -> VerdictLevel:
    """The largest severity; ``good`` where nothing is worse than a note."""
    found = {finding.severity for finding in findings}
    return "bad" if Severity.BAD in found else "care" if Severity.CARE in found else "good"
