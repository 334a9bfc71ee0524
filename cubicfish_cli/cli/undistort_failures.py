"""What could not be undistorted, with a reason that many photos share said once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cubicfish_cli.cli.figures import count
from cubicfish_cli.errors import OutputError

if TYPE_CHECKING:
    from cubicfish_cli.undistortion.batch import FailedPhoto

_MOST_NAMES = 10


def failure_lines(failures: Sequence[FailedPhoto], kind: str) -> list[str]:
    """A line for each reason, and for which photos it holds.

    Args:
        failures: photos, and why.
        kind: what they are, in a word.

    """
    return [
        str(own[0].error) if len(own) == 1 else f"{_several(own, kind)}: {reason}"
        for reason, own in _by_reason(failures).items()
    ]


def ending(failures: Sequence[FailedPhoto], total: int, kind: str, *, told_in: str | None) -> str:
    """What a run says at its end: how many failed, where the reasons are, and what is done.

    Args:
        failures: photos, and why; one at least.
        total: how many there were.
        kind: what they are, in a word.
        told_in: where the reasons are, None where they are still to be told.

    """
    done = total - len(failures)
    if not done:
        reasons = list(_by_reason(failures))
        why = reasons[0] if told_in is None and len(reasons) == 1 else f"the reasons are {told_in}"
        return f"none of {count(total, kind)} could be undistorted: {why}"
    rest = "the other is done" if done == 1 else f"the other {done:,} are done"
    why = f"{'the reason is' if len(failures) == 1 else 'the reasons are'} {told_in}"
    return f"{len(failures):,} of {count(total, kind)} could not be undistorted: {why}, {rest}"


def share_a_reason(failures: Sequence[FailedPhoto]) -> bool:
    """Whether one sentence is true of all of them."""
    return len(_by_reason(failures)) == 1


def _by_reason(failures: Sequence[FailedPhoto]) -> dict[str, list[FailedPhoto]]:
    groups: dict[str, list[FailedPhoto]] = {}
    for failure in failures:
        groups.setdefault(_reason(failure), []).append(failure)
    return groups


def _reason(failure: FailedPhoto) -> str:
    """Why, without what is the photo's own: "each is empty: ..." for "a.png is empty: ..."."""
    error = failure.error
    if not error.about:
        return str(error)
    text = f"{error.what}: {error.do}" if error.do else error.what
    if error.apart:
        return text
    return f"{'each result' if isinstance(error, OutputError) else 'each'} {text}"


def _several(failures: Sequence[FailedPhoto], kind: str) -> str:
    names = [failure.job.name for failure in failures]
    listed = ", ".join(names[:_MOST_NAMES])
    more = f" and {len(names) - _MOST_NAMES:,} more" * (len(names) > _MOST_NAMES)
    return f"{count(len(names), kind)} ({listed}{more})"
