"""The open benchmark of calibration tools: ``python benchmarks/open/run.py --help``.

Only the standard library: each tool runs in an environment of its own, which is made here. What is
done is not done again, so a run that was stopped goes on where it was.
"""

import argparse
import ast
import fnmatch
import hashlib
import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fetch

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
# One thread each, and no chance: results and processor times are those of the tool.
QUIET = {
    f"{name}_NUM_THREADS": "1"
    for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "RAYON", "OPENCV_FOR")
} | {"PYTHONHASHSEED": "0", "MPLBACKEND": "Agg"}


def constants(adapter):
    """The adapter's constants, without importing what only its own environment has."""
    found = {}
    for node in ast.parse(adapter.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            try:
                found[node.targets[0].id] = ast.literal_eval(node.value)
            except ValueError:
                continue
    return found


def python_of(adapter, about, work):
    """The Python that has the tool, made if need be; or why there is none."""
    if "PYTHON" in about:
        module, how = about["NEEDS"]
        here = subprocess.run([about["PYTHON"], "-c", f"import {module}"], capture_output=True)
        return (about["PYTHON"], "") if here.returncode == 0 else ("", f"not installed: {how}")
    packages = [one.format(root=ROOT) for one in about["PACKAGES"]]
    name = f"{adapter.stem}-{digest(*packages)[:8]}"
    folder = work / "environments" / name
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    if not (folder / "done").exists():
        shutil.rmtree(folder, ignore_errors=True)
        if uv := shutil.which("uv"):
            make = [[uv, "venv", "-q", "--python", "3.11", str(folder)]]
            make.append([uv, "pip", "install", "-q", "--python", str(python), *packages])
        else:
            make = [[sys.executable, "-m", "venv", str(folder)]]
            make.append([str(python), "-m", "pip", "install", "-q", *packages])
        for command in make:
            told = subprocess.run(command, capture_output=True, text=True)
            if told.returncode:
                return "", "not installed: " + " ".join(told.stderr.split())[-200:]
        (folder / "done").touch()
    return str(python), ""


def digest(*parts):
    """Of strings and files' contents, hexadecimal."""
    found = hashlib.sha256()
    for part in parts:
        found.update(part.read_bytes() if isinstance(part, Path) else part.encode())
    return found.hexdigest()


def cameras_in(folders):
    """Folders with a target and photos, a film or a table, by name."""
    found = {}
    for target in sorted(
        t for f in folders for t in [*f.glob("*/target.yaml"), *f.glob("*/*/target.yaml")]
    ):
        here = target.parent
        things = [here / "images", *here.glob("film.*"), here / "corners.csv"]
        if "cases" not in target.parts and any(one.exists() for one in things):
            found[here.name] = here
    return found


def call(python, script, *arguments):
    """A script of this folder by some Python; (exit status, what it said at the end)."""
    command = [python, str(HERE / script), *map(str, arguments)]
    env = os.environ | QUIET
    env.pop("PYTHONPATH", None)
    told = subprocess.run(command, capture_output=True, text=True, env=env)
    return told.returncode, told.stderr + told.stdout


def tried(adapter, variant, python, job, folder, limit):
    """All pieces of one tool on one camera, past every crash."""
    folder.mkdir(parents=True, exist_ok=True)
    for _ in range(40):  # a crash ends one piece at most
        status, said = call(python, "trial.py", adapter, variant, job, folder, limit)
        (folder / "said.txt").write_text(said[-20000:], encoding="utf-8")
        broken = list(folder.glob("*.begun"))
        if status == 0 or not broken:
            break
        for begun in broken:
            begun.unlink()
            why = f"took more than {limit} s" if status in (-24, 152) else f"crashed ({status})"
            (folder / f"{begun.stem}.json").write_text(json.dumps({"problem": why}))
    if status:
        (folder / "full.json").write_text(
            json.dumps({"problem": said.strip().splitlines()[-1][:200]})
        )


def chosen(names, patterns):
    """Those that a pattern (a name, or with *) fits."""
    return [n for n in names if not patterns or any(fnmatch.fnmatch(n, p) for p in patterns)]


def options():
    """The command line."""
    parser = argparse.ArgumentParser(description="The open benchmark of calibration tools.")
    parser.add_argument("--data", type=Path, action="append", default=[], metavar="DIR",
                        help="folders of cameras; none is fetched then")  # fmt: skip
    parser.add_argument("--snapshots", type=Path, metavar="DIR",
                        help="clones or bare repositories called owner+name, instead of GitHub")  # fmt: skip
    parser.add_argument(
        "--cameras", nargs="*", default=[], metavar="NAME", help="only these; * fits all"
    )
    parser.add_argument(
        "--tools", nargs="*", default=[], metavar="NAME", help="only these; * fits all"
    )
    parser.add_argument("--work", type=Path, default=Path("open-benchmark"), metavar="DIR",
                        help="where all goes [open-benchmark]")  # fmt: skip
    parser.add_argument("--jobs", type=int, default=1, help="tools at a time [1]")
    parser.add_argument("--limit", type=int, default=600, metavar="S",
                        help="processor time that a piece of work may take [600]")  # fmt: skip
    parser.add_argument("--list", action="store_true", help="name cameras and tools, and end")
    return parser.parse_args()


def main():
    """Corners, tools, trials, report."""
    given = options()
    work = given.work.resolve()
    adapters = {file: constants(file) for file in sorted((HERE / "tools").glob("*.py"))}
    tools = {name: file for file, about in adapters.items() for name in about["VARIANTS"]}
    missing = {}
    if not given.data:
        known = chosen(fetch.cameras(), given.cameras)
        missing = {} if given.list else fetch.all_of(known, work / "cameras", given.snapshots)
    found = cameras_in(given.data or [work / "cameras"])
    names, wanted = chosen(found, given.cameras), chosen(tools, given.tools)
    if given.list:
        print("\n".join([*(found or fetch.cameras()), "", *tools]))
        return
    pythons = {file: python_of(file, adapters[file], work) for file in {tools[n] for n in wanted}}
    ours = HERE / "tools" / "cubicfish.py"
    python, problem = python_of(ours, adapters[ours], work)
    if problem:
        sys.exit(f"cubicfish finds the corners and writes the report, and is {problem}")
    tasks = []
    for name in names:
        job = work / "jobs" / name / "job.npz"
        if not job.exists():
            status, said = call(python, "prepare.py", found[name], job.parent)
            if status:
                missing[name] = said.strip().splitlines()[-1]
                continue
            print(f"{name}: corners", flush=True)
        for tool in wanted:
            file = tools[tool]
            folder = work / "results" / name / tool.replace(" ", "_").replace(",", "")
            stamp = digest(job, file, HERE / "trial.py", HERE / "measure.py", str(adapters[file]))
            if folder.exists() and (folder / "stamp").read_text() != stamp:
                shutil.rmtree(folder)
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "stamp").write_text(stamp)
            (folder / "about.json").write_text(
                json.dumps({"tool": tool, **adapters[file]}, default=str)
            )
            own, why = pythons[file]
            if why:
                (folder / "full.json").write_text(json.dumps({"problem": why}))
                continue
            (folder / "full.json").unlink(missing_ok=True)
            tasks.append((file, tool, own, job, folder, given.limit))
    with ThreadPoolExecutor(given.jobs) as pool:
        for task, _ in zip(tasks, pool.map(lambda one: tried(*one), tasks), strict=True):
            print(f"{task[3].parent.name}: {task[1]}", flush=True)
    (work / "missing.json").write_text(json.dumps(missing))
    status, said = call(python, "report.py", work, json.dumps([names, wanted]))
    print(said.strip())
    sys.exit(status)


if __name__ == "__main__":
    main()
