"""A table of functions that write sentences, which each module of words fills."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from cubicfish.judge import FindingText

_Finding = TypeVar("_Finding", bound=Callable[..., FindingText])
_Text = TypeVar("_Text", bound=Callable[..., str])
_Any = TypeVar("_Any")


@dataclass(frozen=True, kw_only=True)
class Words:
    """Functions that write sentences; their parameters are the figures that the sentences need.

    Those of findings and of evidence may also ask for what a finding is about: ``images``,
    ``boards`` and the first of them, ``board``, ``cameras``, ``of_shots``, ``code`` and ``case``.

    Attributes:
        findings: by code and case; a text, where it needs no figures.
        evidence: of what is evident in several ways, by its kind.
        events: of what happens while work is done, by event.

    """

    findings: dict[tuple[str, str], Callable[..., FindingText] | FindingText] = field(
        default_factory=dict
    )
    evidence: dict[str, Callable[..., str]] = field(default_factory=dict)
    events: dict[str, Callable[..., str]] = field(default_factory=dict)

    def finding(self, code: str, *cases: str) -> Callable[[_Finding], _Finding]:
        """Make a function the one of a code, of these cases or of the plain one."""
        return _registrar(self.findings, *((code, case) for case in cases or ("",)))

    def because(self, kind: str) -> Callable[[_Text], _Text]:
        """Make a function the one of a kind of evidence."""
        return _registrar(self.evidence, kind)

    def event(self, event: str) -> Callable[[_Text], _Text]:
        """Make a function the one of an event."""
        return _registrar(self.events, event)


def _registrar(table: dict[Any, Any], *keys: Any) -> Callable[[_Any], _Any]:
    def put(function: _Any) -> _Any:
        table.update(dict.fromkeys(keys, function))
        return function

    return put
