"""Disturb every command in every way, and print what was tried and what went wrong.

    python tests/faults/try_faults.py --moments 200 --jobs 2
    python tests/faults/try_faults.py --only "undistort folder" --moments 20

Exit code 1 when anything went wrong.
"""

import argparse
import random
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fault_kills import SIGNALS, kill_once, run_undisturbed
from fault_places import PROBLEMS
from fault_scenarios import SCENARIOS, Scenario, prepare


def try_scenario(
    scenario: Scenario, moments: int, seed: int, tell: Callable[[str], None]
) -> tuple[int, list[str]]:
    """Every fault on one scenario: how many were tried, and what went wrong."""
    random_ = random.Random(f"{seed} {scenario.name}")
    wrong: list[str] = []
    tried = 0
    with tempfile.TemporaryDirectory(prefix="cubicfish-faults-") as name:
        folder = Path(name)
        prepare(scenario, folder)
        usual = run_undisturbed(scenario, folder)
        if run_undisturbed(scenario, folder).files != usual.files:
            wrong.append("two undisturbed runs differ")
        for index in range(moments):
            number = SIGNALS[index % len(SIGNALS)]
            found = kill_once(scenario, folder, usual, number, random_)
            wrong += [f"{number.name} {index}: {line}" for line in found]
            tried += 1
        killed = tried
        for what, problem in PROBLEMS.items():
            found_or_none = problem(scenario, folder, usual)
            if found_or_none is not None:
                tried += 1
                wrong += [f"{what}: {line}" for line in found_or_none]
    tell(
        f"{scenario.name:<20} {usual.seconds:>6.1f} s  {killed:>4} kills  "
        f"{tried - killed:>2} other faults  {len(wrong):>3} wrong"
    )
    for line in wrong:
        tell(f"    {line}")
    return tried, wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--moments", type=int, default=200, help="kills a scenario")
    parser.add_argument("--only", nargs="*", default=list(SCENARIOS), choices=list(SCENARIOS))
    parser.add_argument("--jobs", type=int, default=1, help="scenarios at a time")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()

    def tell(line: str) -> None:
        print(line, flush=True)

    with ThreadPoolExecutor(args.jobs) as pool:
        results = list(
            pool.map(
                lambda name: try_scenario(SCENARIOS[name], args.moments, args.seed, tell),
                args.only,
            )
        )
    tried, wrong = sum(tried for tried, _ in results), sum(len(lines) for _, lines in results)
    print(f"{tried} faults tried, {wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
