"""Build the distributions, install them where nothing else is, and run every command there.

    python tests/system/packaging/try_packages.py  # content, and a bare environment
    python tests/system/packaging/try_packages.py --quick --with .venv/bin/python
    python tests/system/packaging/try_packages.py --python python3.13 --extras newest oldest

Commands run one per process, with every warning an error, without a network, and in a home, a
folder for temporary files and a working folder in which nothing but what was asked for may appear.
``--with`` takes an environment that has the libraries already, and runs the wheel in it without
installing anything there. The build and the other environments need pip's index.

Exit code 1 when anything was wrong.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import venv
import zipfile
from collections.abc import Sequence
from pathlib import Path

from packaging_content import (
    PROJECT,
    load_project,
    lower_bounds,
    project_files,
    sdist_problems,
    wheel_problems,
)
from packaging_programs import SAMPLE, Program, try_steps, without_network
from packaging_runs import HELP, MORE, QUICK, Sandbox, prepare


def tell(line: str) -> None:
    """Print a line at once."""
    print(line, flush=True)


def pip(python: Path, *args: object) -> list[str]:
    """Run pip; what it complains of, where it fails."""
    done = subprocess.run(
        [python, "-m", "pip", "--disable-pip-version-check", *map(str, args)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        return [f"pip {args[0]}: {line}" for line in (done.stdout + done.stderr).splitlines()[-8:]]
    return []


def new_environment(folder: Path, python: str) -> Path:
    """An environment with nothing in it; its Python."""
    subprocess.run([python, "-m", "venv", folder], check=True)
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def build(folder: Path) -> tuple[Path, Path]:
    """The source distribution of this checkout, and the wheel of that."""
    source = folder / "source"
    for name in project_files(PROJECT):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(PROJECT / name, source / name)
    builder = folder / "builder"
    venv.create(builder, with_pip=True)
    python = builder / "bin" / "python"
    problems = pip(python, "install", "-q", "build")
    if not problems:
        done = subprocess.run(
            [python, "-W", "error::SyntaxWarning", "-m", "build", "-o", folder / "dist", source],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        problems = done.stderr.splitlines()[-20:] if done.returncode else []
        complaints = [line for line in done.stderr.splitlines() if "Warning" in line]
        problems += complaints
    if problems:
        raise SystemExit("\n".join(["the distributions cannot be built:", *problems]))
    (sdist,), (wheel,) = (folder / "dist").glob("*.tar.gz"), (folder / "dist").glob("*.whl")
    return sdist, wheel


def try_environment(
    name: str, program: Program, folder: Path, *, quick: bool, versions: bool = True
) -> list[str]:
    """Run every command that can work there."""
    sandbox = Sandbox(base=folder).make()
    steps = HELP[:2] + QUICK if quick else HELP + QUICK + MORE
    if not quick:
        prepare(sandbox.work, program.python, SAMPLE)
    able = [step for step in steps if step.extra is None or program.has(step.extra)]
    tell(f"\n{name}: {len(able)} commands")
    if versions:
        tell("  " + program.versions())
    wrong = [] if program.is_here(sandbox) else ["another cubicfish is in the way"]
    return [f"{name}: {line}" for line in wrong + try_steps(program, able, sandbox, tell=tell)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", nargs="*", default=[sys.executable], help="for environments")
    parser.add_argument(
        "--extras", nargs="*", default=[], choices=("newest", "oldest"),
        help="environments with all extras, and with the newest or the oldest libraries",
    )  # fmt: skip
    parser.add_argument("--with", nargs="*", default=[], dest="there", metavar="PYTHON")
    parser.add_argument("--dist", type=Path, help="a folder to leave the distributions in")
    parser.add_argument("--quick", action="store_true", help="a chain of the main commands only")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="cubicfish-packages-") as name:
        wrong = try_all(
            Path(name), args.python, args.extras, args.there, quick=args.quick, dist=args.dist
        )
    tell(f"\n{len(wrong)} wrong")
    for line in wrong:
        tell(f"  {line}")
    return int(bool(wrong))


def try_all(
    folder: Path,
    pythons: Sequence[str],
    extras: Sequence[str],
    there: Sequence[str],
    *,
    quick: bool,
    dist: Path | None = None,
) -> list[str]:
    """Everything that the arguments name; what was wrong, a line each."""
    sdist, wheel = build(folder)
    if dist is not None:
        dist.mkdir(exist_ok=True)
        shutil.copy2(sdist, dist)
        shutil.copy2(wheel, dist)
    tell(f"built {sdist.name} ({sdist.stat().st_size / 1e6:.1f} MB) and {wheel.name} "
         f"({wheel.stat().st_size / 1e6:.1f} MB)")  # fmt: skip
    if not without_network():
        tell("the kernel gives no place without a network: only Python's own sockets are watched")
    wrong = sdist_problems(sdist, PROJECT) + wheel_problems(wheel, PROJECT)
    unpacked = folder / "unpacked"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(unpacked)
    for number, python in enumerate(there):
        program = Program(python=Path(python).absolute(), path=(unpacked,))
        wrong += try_environment(python, program, folder / f"with{number}", quick=quick)
    pins = folder / "oldest.txt"
    pins.write_text("\n".join(lower_bounds(load_project(PROJECT))))
    kinds = {"bare": [wheel], "newest": [f"{wheel}[all]"], "oldest": [f"{wheel}[all]", "-r", pins]}
    for number, python in enumerate(pythons):
        for kind in ("bare", *extras):
            name = f"{kind}, {python}"
            inside = new_environment(folder / f"environment{number}-{kind}", python)
            problems = pip(inside, "install", "-q", *kinds[kind]) or pip(inside, "check")
            if not problems:
                problems = try_environment(
                    name, Program(python=inside), folder / f"{kind}{number}", quick=quick
                )
            wrong += problems
    return wrong


if __name__ == "__main__":
    sys.exit(main())
