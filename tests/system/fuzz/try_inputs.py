"""Give every reader damaged files by the hundred thousand, and print what came of it.

    python tests/system/fuzz/try_inputs.py --runs 100000
    python tests/system/fuzz/try_inputs.py --only camera.yaml --engine atheris --runs 100000

``--engine atheris`` (from PyPI) follows which lines of the reader each input reaches; half of its
inputs are damaged by this project's own mutations. Every reader runs in a process of its own.
Exit code 1 when an input brought an exception that is not the reader's own, took too long or too
much memory; the input is kept in the folder that is named.
"""

import argparse
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

SECONDS = 5.0
# Beyond what the process needs before the first input; pictures may claim 200 megapixels.
MEGABYTES = {"photos": 2500.0}
MEGABYTES_ELSE = 300.0
_KEPT = 20


class Trial:
    """Inputs given to one reader, and the worst that they did."""

    def __init__(self, name: str, folder: Path, keep: Path) -> None:
        from fuzz_readers import READERS

        self.reader = READERS[name]
        self.name, self.keep = name, keep
        self.path = folder / f"input{self.reader.suffix}"
        self.seeds = list(self.reader.seeds())
        for seed in self.seeds:
            self.path.write_bytes(seed)
            self.reader.read(self.path)
        self.before = _peak_mb()
        self.tried = self.wrong = 0
        self.slowest = 0.0

    def give(self, data: bytes) -> None:
        """One input."""
        from fuzz_readers import problem_with

        self.path.write_bytes(data)
        begin = time.process_time()
        try:
            problem = problem_with(self.reader, self.path)
        except Exception:
            problem = traceback.format_exc(limit=-6)
        seconds = time.process_time() - begin
        self.tried += 1
        self.slowest = max(self.slowest, seconds)
        if problem is None and seconds > SECONDS:
            problem = f"it took {seconds:.1f} s"
        if problem is not None:
            self.wrong += 1
            if self.wrong <= _KEPT:
                kept = self.keep / f"{self.name}.{self.wrong}{self.reader.suffix}"
                kept.write_bytes(data)
                print(f"{kept}: {problem}", flush=True)

    def summary(self) -> bool:
        """Print a line; whether all went well."""
        more = _peak_mb() - self.before
        limit = MEGABYTES.get(self.name, MEGABYTES_ELSE)
        print(
            f"{self.name:<22} {self.tried:>8} inputs  {self.wrong:>4} wrong  "
            f"slowest {self.slowest:5.2f} s  memory +{more:6.0f} MB",
            flush=True,
        )
        return self.wrong == 0 and more <= limit


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def run_plain(trial: Trial, runs: int, seed: int) -> None:
    from fuzz_mutations import mutated

    rng = random.Random(f"{seed} {trial.name}")
    for _ in range(runs):
        trial.give(mutated(trial.seeds, trial.reader.words, rng))


def run_atheris(trial: Trial, runs: int, seed: int) -> None:
    import atheris
    from fuzz_mutations import mutated

    def own_or_libfuzzers(data: bytes, longest: int, number: int) -> bytes:
        rng = random.Random(number)
        if rng.random() < 0.5:
            return mutated([*trial.seeds, data], trial.reader.words, rng)[:longest]
        return atheris.Mutate(data, longest)

    def one(data: bytes) -> None:
        trial.give(data)
        if trial.tried >= runs:
            good = trial.summary()
            os._exit(0 if good else 1)

    with tempfile.TemporaryDirectory() as corpus:
        for index, data in enumerate(trial.seeds):
            (Path(corpus) / str(index)).write_bytes(data)
        atheris.Setup(
            [sys.argv[0], f"-seed={seed + 1}", "-max_len=60000", "-rss_limit_mb=0", "-verbosity=0",
             "-timeout=60", corpus],
            one,
            custom_mutator=own_or_libfuzzers,
        )  # fmt: skip
        atheris.Fuzz()


def one_reader(args: argparse.Namespace) -> int:
    name = args.only[0]
    if args.engine == "atheris":
        import atheris

        with atheris.instrument_imports(include=["cubicfish", "cubicfish_cli"]):
            import fuzz_readers  # noqa: F401
    with tempfile.TemporaryDirectory(prefix="cubicfish-fuzz-") as folder:
        args.keep.mkdir(parents=True, exist_ok=True)
        trial = Trial(name, Path(folder), args.keep)
        (run_atheris if args.engine == "atheris" else run_plain)(trial, args.runs, args.seed)
        return 0 if trial.summary() else 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=100_000, help="inputs a reader")
    parser.add_argument("--only", nargs="*", metavar="READER")
    parser.add_argument("--engine", choices=["plain", "atheris"], default="plain")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="readers at a time")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "fuzz-findings")
    args = parser.parse_args()
    if args.only and len(args.only) == 1:
        return one_reader(args)
    from concurrent.futures import ThreadPoolExecutor

    from fuzz_readers import READERS

    def run(name: str) -> int:
        return subprocess.run(
            [sys.executable, __file__, "--only", name, "--runs", str(args.runs), "--engine",
             args.engine, "--seed", str(args.seed), "--keep", str(args.keep)],
        ).returncode  # fmt: skip

    with ThreadPoolExecutor(args.jobs) as pool:
        codes = list(pool.map(run, args.only or list(READERS)))
    return int(any(codes))


if __name__ == "__main__":
    sys.exit(main())
