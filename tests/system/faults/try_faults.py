"""Disturb every command in every way, and print what was tried and what went wrong.

    python tests/system/faults/try_faults.py --moments 200 --jobs 2
    python tests/system/faults/try_faults.py --only "undistort folder" --moments 20
    python tests/system/faults/try_faults.py --moments 50 --no-places --seed 1   # 50 other moments
    python tests/system/faults/try_faults.py --moments 50 --no-places --signals INT

Moments are counted a command: its scenarios share them. Exit code 1 when anything went wrong.
"""

import argparse
import random
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from fault_kills import SIGNALS, Tally, kill_once, run_undisturbed
from fault_places import PROBLEMS
from fault_scenarios import SCENARIOS, Scenario, prepared

_HEAD = (
    f"{'scenario':<20}{'run':>8}{'kills':>7}{'KILL':>6}{'TERM':>6}{'INT':>6}{'late':>6}{'early':>6}"
    f"{'partly':>8}{'reruns':>8}{'close':>7}{'other':>7}{'wrong':>7}"
)


@dataclass(kw_only=True)
class Outcome:
    """What was tried on one scenario, and what went wrong."""

    seconds: float = 0.0
    moments: int = 0
    tally: Tally = field(default_factory=Tally)
    others: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    def line(self, name: str) -> str:
        """One line of the table."""
        ended = (self.tally.ended[number.name] for number in SIGNALS)
        return (
            f"{name:<20}{self.seconds:>6.1f} s{self.moments:>7}"
            + "".join(f"{count:>6}" for count in ended)
            + f"{self.tally.late:>6}{self.tally.early:>6}"
            + f"{self.tally.between:>8}{self.tally.reruns:>8}"
            + f"{self.tally.close:>7}{len(self.others):>7}{len(self.wrong):>7}"
        )


def try_scenario(
    scenario: Scenario,
    moments: int,
    seed: int,
    places: bool,
    tell: Callable[[str], None],
    signals: Sequence[signal.Signals] = SIGNALS,
) -> Outcome:
    """Kills, and every other fault, on one scenario."""
    random_ = random.Random(f"{seed} {scenario.name}")
    outcome = Outcome(moments=moments)
    with (
        tempfile.TemporaryDirectory(prefix="cubicfish-faults-") as name,
        prepared(scenario, Path(name)) as folder,
    ):
        first = run_undisturbed(scenario, folder)  # fills what libraries keep, such as fonts
        usual = run_undisturbed(scenario, folder)
        outcome.seconds = usual.seconds
        if not scenario.close and (usual.files, usual.printed) != (first.files, first.printed):
            outcome.wrong.append("two undisturbed runs differ")
        for index in range(moments):
            number = signals[index % len(signals)]
            found = kill_once(scenario, folder, usual, number, random_, outcome.tally)
            outcome.wrong += [f"{number.name} {index}: {line}" for line in found]
        for what, problem in PROBLEMS.items() if places else ():
            found_or_none = problem(scenario, folder, usual)
            if found_or_none is not None:
                outcome.others.append(what)
                outcome.wrong += [f"{what}: {line}" for line in found_or_none]
    lines = (outcome.line(scenario.name), *(f"    {line}" for line in outcome.wrong))
    tell("\n".join(lines))
    return outcome


def _signal(name: str) -> signal.Signals:
    return signal.Signals[f"SIG{name}"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=200, help="kills a command")
    parser.add_argument("--only", nargs="*", default=list(SCENARIOS), choices=list(SCENARIOS))
    parser.add_argument(
        "--signals",
        nargs="*",
        default=list(SIGNALS),
        type=lambda name: signal.Signals[f"SIG{name}"],
    )
    parser.add_argument("--jobs", type=int, default=1, help="scenarios at a time")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-places", dest="places", action="store_false", help="kills only")
    args = parser.parse_args()

    def tell(line: str) -> None:
        print(line, flush=True)

    chosen = [SCENARIOS[name] for name in args.only if SCENARIOS[name].possible]
    for name in args.only:
        if not SCENARIOS[name].possible:
            tell(f"{name}: left out, needs {' and '.join(SCENARIOS[name].needs)}")
    ways = Counter(scenario.command for scenario in chosen)
    tell(_HEAD)
    with ThreadPoolExecutor(args.jobs) as pool:
        outcomes = list(
            pool.map(
                lambda one: try_scenario(
                    one,
                    -(-args.moments // ways[one.command]),
                    args.seed,
                    args.places,
                    tell,
                    args.signals,
                ),
                chosen,
            )
        )
    kills = sum(outcome.moments for outcome in outcomes)
    others = Counter(what for outcome in outcomes for what in outcome.others)
    wrong = sum(len(outcome.wrong) for outcome in outcomes)
    tell(f"{len(chosen)} scenarios of {len(ways)} commands: {kills} kills, {wrong} wrong")
    tell("other faults, in scenarios: " + ", ".join(f"{n} {what}" for what, n in others.items()))
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
