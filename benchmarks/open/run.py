"""The open benchmark of calibration tools: ``python benchmarks/open/run.py --help``.

Only the standard library: each tool runs in an environment of its own, which is made here. What is
done is not done again, so a run that was stopped goes on where it was.
"""

import argparse
import ast
import contextlib
import fnmatch
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fetch

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
# One thread each, and no chance: results and processor times are those of the tool.
QUIET = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA", "RAYON")}
STOPPED = (signal.SIGINT, signal.SIGTERM)  # by the user, who will start it again
ENDED = {signal.SIGXCPU: "took more than {} s", signal.SIGKILL: "was killed: too much memory?"}


def constants(adapter):
    """The adapter's constants, without importing what only its own environment has."""
    found = {}
    for node in ast.parse(adapter.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            with contextlib.suppress(ValueError):
                found[node.targets[0].id] = ast.literal_eval(node.value)
    return found


def python_of(adapter, about, work):
    """The Python that has the tool, made if need be; or why there is none."""
    if "PYTHON" in about:
        module, how = about["NEEDS"]
        here = subprocess.run([about["PYTHON"], "-c", f"import {module}"], capture_output=True)
        return (about["PYTHON"], "") if here.returncode == 0 else ("", f"not installed: {how}")
    packages = [one.format(root=ROOT) for one in about["PACKAGES"]]
    folder = work / "environments" / f"{adapter.stem}-{digest(*packages)[:8]}"
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    if not (folder / "done").exists():
        shutil.rmtree(folder, ignore_errors=True)
        if uv := shutil.which("uv"):
            make, add = [uv, "venv", "-p", "3.11"], [uv, "pip", "install", "-p", python]
        else:
            make, add = [sys.executable, "-m", "venv"], [python, "-m", "pip", "install"]
        for command in ([*make, folder], [*add, *packages]):
            told = subprocess.run(command, capture_output=True, text=True)
            if told.returncode:
                return "", "not installed: " + " ".join(told.stderr.split())[-200:]
        (folder / "done").touch()
    return str(python), ""


def digest(*parts):
    """Of strings and files' contents, hexadecimal."""
    data = [part.read_bytes() if isinstance(part, Path) else part.encode() for part in parts]
    return hashlib.sha256(b"".join(data)).hexdigest()


def cameras_in(folders):
    """Folders with a target and photos, a film or a table, by name."""
    depths = [
        found for one in folders for depth in ("*", "*/*") for found in sorted(one.glob(depth))
    ]
    things = ("images", "corners.csv", "film.*")
    return {
        here.name: here
        for here in depths
        if (here / "target.yaml").exists()
        and any(any(here.glob(one)) for one in things)
        and "cases" not in here.parts
    }


def call(python, script, *arguments):
    """A script of this folder by some Python; (exit status, what it said at the end)."""
    command = [python, str(HERE / script), *map(str, arguments)]
    told = subprocess.run(command, capture_output=True, text=True, env=os.environ | QUIET)
    return told.returncode, told.stderr + told.stdout


def tried(python, problem, limit, adapter, tool, job, folder):
    """All pieces of one tool on one camera, past every crash."""
    alone = folder / "full.json"
    if problem:
        alone.write_text(json.dumps({"problem": problem}))
        return
    for _ in range(40):  # a crash ends one piece
        status, said = call(python, "trial.py", adapter, tool, job, folder, limit)
        (folder / "said.txt").write_text(said[-20000:], encoding="utf-8")
        broken = list(folder.glob("*.begun"))
        if status == 0 or -status in STOPPED:
            return
        for begun in broken:
            begun.unlink()
            why = ENDED.get(-status, f"crashed ({status})").format(limit)
            begun.with_suffix(".json").write_text(json.dumps({"problem": why}))
        if not broken:
            break
    alone.write_text(json.dumps({"problem": said.strip().splitlines()[-1][:200]}))


def chosen(names, patterns):
    """Those that a pattern (a name, or with *) fits."""
    return [n for n in names if not patterns or any(fnmatch.fnmatch(n, p) for p in patterns)]


def options():
    """The command line."""
    parser = argparse.ArgumentParser(description="The open benchmark of calibration tools.")
    add = parser.add_argument
    add("--data", type=Path, nargs="+", metavar="DIR", help="folders of cameras; none is fetched")
    add("--snapshots", type=Path, metavar="DIR", help="clones or bare repositories, owner+name")
    add("--cameras", nargs="+", metavar="NAME", help="only these; * fits all")
    add("--tools", nargs="+", metavar="NAME", help="only these; * fits all")
    add("--work", type=Path, default=Path("open-benchmark"), metavar="DIR", help="where all goes")
    add("--jobs", type=int, default=1, metavar="N", help="tools at a time [1]")
    add("--limit", type=int, default=200, metavar="S", help="processor time for a piece [200]")
    add("--list", action="store_true", help="name cameras and tools, and end")
    return parser.parse_args()


def prepared(names, found, work, python, missing):
    """Of these cameras those whose corners are known, the tables made if need be."""
    for name in names:
        job = work / "jobs" / name
        if not (job / "job.npz").exists():
            status, said = call(python, "prepare.py", found[name], job)
            if status:
                missing[name] = said.strip().splitlines()[-1]
                continue
            print(f"{name}: corners", flush=True)
        yield name


def version_of(about):
    """What is measured: what the adapter's command says, or the package of PyPI."""
    if "VERSION" not in about:
        return about["PACKAGES"][0]
    said = subprocess.run(about["VERSION"], cwd=ROOT, capture_output=True, text=True)
    return " ".join(said.stdout.split())


def task_of(name, tool, adapter, about, work, problem):
    """The last arguments of ``tried``; what other code or corners left is removed."""
    job = work / "jobs" / name / "job.npz"
    folder = work / "results" / name / tool.replace(" ", "_").replace(",", "")
    own = [HERE / f"{script}.py" for script in ("job", "trial", "measure")]
    stamp = digest(job, adapter, *own, str(about), problem)
    if folder.exists() and (folder / "stamp").read_text() != stamp:
        shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "stamp").write_text(stamp)
    about = {"tool": tool, "version": version_of(about), **about}
    (folder / "about.json").write_text(json.dumps(about))
    return adapter, tool, job, folder


def main():
    """Corners, tools, trials, report."""
    given, missing = options(), {}
    work = given.work.resolve()
    adapters = {file: constants(file) for file in sorted((HERE / "tools").glob("*.py"))}
    tools = {name: file for file, about in adapters.items() for name in about["VARIANTS"]}
    if given.list:
        print("\n".join([*fetch.cameras(), "", *tools]))
        return
    if not given.data:
        names = chosen(fetch.cameras(), given.cameras)
        missing = fetch.all_of(names, work / "cameras", given.snapshots)
    found = cameras_in(given.data or [work / "cameras"])
    names, wanted = chosen(found, given.cameras), chosen(tools, given.tools)
    if not wanted or not (names or missing):
        sys.exit("no camera or no tool is called so: --list names all")
    ours = HERE / "tools" / "cubicfish.py"
    pythons = {
        file: python_of(file, adapters[file], work) for file in {ours, *map(tools.get, wanted)}
    }
    python, problem = pythons[ours]
    if problem:
        sys.exit(f"cubicfish finds the corners and writes the report, and is {problem}")
    tasks = []
    for name in prepared(names, found, work, python, missing):
        for file, tool in [(tools[tool], tool) for tool in wanted]:
            task = task_of(name, tool, file, adapters[file], work, pythons[file][1])
            tasks.append((*pythons[file], given.limit, *task))
    with ThreadPoolExecutor(given.jobs) as pool:
        try:
            for task, _ in zip(tasks, pool.map(lambda one: tried(*one), tasks), strict=True):
                print(f"{task[-1].parent.name}: {task[4]}", flush=True)
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            sys.exit("stopped; the same command goes on from here")
    status, said = call(python, "report.py", work, json.dumps([names, wanted, missing]))
    print(said.strip())
    sys.exit(status)


if __name__ == "__main__":
    main()
