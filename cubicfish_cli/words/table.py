"""A table of functions that write sentences, which each module of words fills."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from cubicfish.judge.finding import FindingText

_Finding = TypeVar("_Finding", bound=Callable[..., FindingText])
_Text = TypeVar("_Text", bound=Callable[..., str])


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

        def put(function: _Finding) -> _Finding:
            self.findings.update(((code, case), function) for case in cases or ("",))
            return function

        return put

    def because(self, kind: str) -> Callable[[_Text], _Text]:
        """Make a function the one of a kind of evidence."""

        def put(function: _Text) -> _Text:
            self.evidence[kind] = function
            return function

        return put

    def event(self, event: str) -> Callable[[_Text], _Text]:
        """Make a function the one of an event."""

        def put(function: _Text) -> _Text:
            self.events[event] = function
            return function

        return put
