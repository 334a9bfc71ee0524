"""What calibrate says of set-ups that are wrong in one known way, and of right ones.

    python benchmarks/wrong_setups.py [--seeds 10] [--good 60] [--first 0] [--only WORDS] [--show]

Each case is run through the command line on corners of projected synthetic truth. ``named``:
what is said names the cause; ``noticed``: something is said, or the verdict is not good, but not
for the right cause; ``silent``: nothing. Of right set-ups all findings are false alarms; those of
the level ``note`` say nothing against the camera.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from inspect import signature
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

import numpy as np
import wrong_setups
from click.testing import CliRunner

from cubicfish_cli.terminal.main import cli


def said(setup: wrong_setups.SetUp) -> tuple[str, dict]:
    """All that calibrate says of a set-up in words, and its record ({} where it stopped)."""
    apart = {"mix_stderr": False} if "mix_stderr" in signature(CliRunner).parameters else {}
    with tempfile.TemporaryDirectory() as folder:
        arguments = [*setup.save(Path(folder)), "--json"]
        done = CliRunner(**apart).invoke(cli, arguments, prog_name="cubicfish")
    if done.exit_code not in (0, 1) or not isinstance(done.exception, SystemExit | None):
        raise RuntimeError(done.output) from done.exception
    lines = [line for line in done.stderr.splitlines() if not line.startswith("Fitting to")]
    record = json.loads(done.stdout) if done.exit_code == 0 else {}
    lines += [
        f"verdict: {reason['why']}; {reason['do']}"
        for reason in record.get("verdict", {}).get("reasons", [])
    ]
    if record.get("dropped"):
        lines.append(f"{record['dropped']} outliers")
    return "\n".join(lines), record


def outcome(case: wrong_setups.Case, seed: int) -> tuple[str, str]:
    """How a case with one seed ends, and what is said."""
    number = next(i for i, one in enumerate(wrong_setups.CASES) if one.name == case.name)
    setup = case.make(np.random.default_rng([number, seed]))
    words, record = said(setup)
    level = record.get("verdict", {}).get("level", "bad")
    about = f"{words}\n[verdict {level}, RMS {record.get('rms_px', np.nan):.3f} px]"
    expected = (*case.says, *setup.says)
    # Where nothing can be seen nothing may be found, whatever else the photos are short of.
    found = record.get("findings", words)
    if all(re.search(one, words) for one in expected) and (expected or not found):
        return "named", about
    return ("noticed" if words.strip() or level != "good" else "silent"), about


def _nth(number: int, seed: int) -> tuple[str, str]:
    return outcome(wrong_setups.CASES[number], seed)


def _good(kind: int) -> tuple[list[str], str]:
    words, record = said(wrong_setups.good(np.random.default_rng([99, kind]), kind))
    stopped = [{"cause": "stopped", "level": "bad"}]
    found = record.get("findings", stopped)
    return [f"{finding['cause']} ({finding['level']})" for finding in found], words


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--good", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="the first seed: others, other draws")
    parser.add_argument("--only", default="")
    parser.add_argument("--show", action="store_true", help="print what is said")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    kinds = range(options.first, options.first + options.good)
    with ProcessPoolExecutor(options.jobs) as pool:
        print(f"{'case':<42}{'named':>8}{'noticed':>9}{'silent':>8}")
        for number, case in enumerate(wrong_setups.CASES):
            if options.only not in case.name:
                continue
            ends = list(pool.map(partial(_nth, number), seeds))
            count = Counter(end for end, _ in ends)
            line = "".join(
                f"{count[end]:>{width}}"
                for end, width in (("named", 8), ("noticed", 9), ("silent", 8))
            )
            print(f"{case.name:<42}{line}", flush=True)
            if options.show:
                for seed, (end, words) in zip(seeds, ends, strict=True):
                    print(f"  {seed} {end}: " + words.replace("\n", "\n    "))
        alarms = list(pool.map(_good, kinds))
        if options.good:
            loud = [alarm for alarm, _ in alarms if alarm]
            warned = sum(any("note" not in one for one in alarm) for alarm in loud)
            print(f"\n{options.good} right set-ups: {len(loud)} with findings, {warned} warnings")
            for kind, (alarm, words) in zip(kinds, alarms, strict=True):
                if alarm or options.show:
                    print(f"  {kind}: {alarm}: " + words.replace("\n", "\n    "))


if __name__ == "__main__":
    main()
