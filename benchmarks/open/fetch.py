"""Public sets of photos, from GitHub or from a folder of clones or bare repositories.

A set comes at the commit, and with the files' hashes, that ``cameras.lock.json`` has; a set that is
not in it yet comes as it is at its newest commit, and is noted there. Only plain git is used, and
only what is needed is brought. Nothing is passed on: photos stay under their owners' licences.
"""

import hashlib
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
LOCK = HERE / "cameras.lock.json"
GITHUB = "https://github.com/{}"
NO_QUESTIONS = {"GIT_TERMINAL_PROMPT": "0"}
LICENCE = re.compile(r"^(licen[cs]e|copying)[^/]*$", re.IGNORECASE)


class Unavailable(Exception):
    """Why a set cannot be had, in one line."""


def cameras():
    """The records of cameras.json: ``repo``, ``photos`` or ``files`` or ``film``, ``target``."""
    return json.loads((HERE / "cameras.json").read_text(encoding="utf-8"))


def git(folder, *arguments):
    """What git says, as bytes; of what is gone, GitHub would ask for a password."""
    command = ["git", "-C", str(folder), "-c", "safe.directory=*", *arguments]
    told = subprocess.run(command, capture_output=True, env=os.environ | NO_QUESTIONS)
    if told.returncode:
        said = told.stderr.decode(errors="replace").strip().splitlines() or ["git failed"]
        raise Unavailable(f"git {arguments[0]}: {said[-1]}")
    return told.stdout


def repository(repo, out, snapshots, commit):
    """A repository that has the commit (the newest if None), without its files."""
    if snapshots is not None:
        name = repo.replace("/", "+")
        for here in (snapshots / name, snapshots / f"{name}.git"):
            if here.is_dir():
                return here
        raise Unavailable(f"{snapshots} has no {name}")
    here = out / ".clones" / repo.replace("/", "+")
    if not (here / "HEAD").exists():
        # Names and folders only; photos come one by one, when they are asked for.
        how = ("--bare", "--depth=1", "--filter=blob:none")
        git(out, "clone", "-q", *how, GITHUB.format(repo), str(here.resolve()))
    git(here, "fetch", "-q", "--depth=1", "origin", commit or "HEAD")
    git(here, "update-ref", "HEAD", "FETCH_HEAD")
    return here


def wanted(record, names):
    """Paths in the repository, by the names that the files get here."""
    if "files" in record:
        return dict(record["files"])
    pattern = re.compile(re.escape(record["film"]) + "$" if "film" in record else record["photos"])
    paths = [name for name in names if pattern.search(name)]
    if not paths:
        raise Unavailable(f"{record['repo']} has no file that fits {pattern.pattern}")
    if "film" in record:
        return {"film" + Path(paths[0]).suffix: paths[0]}
    short = {Path(path).name: path for path in paths}
    return short if len(short) == len(paths) else {path.replace("/", "_"): path for path in paths}


def brought(name, record, out, snapshots, known):
    """One set into OUT/<name>; what the lock is to have of it."""
    here = repository(record["repo"], out, snapshots, known.get("commit"))
    commit = known.get("commit") or git(here, "rev-parse", "HEAD").decode().strip()
    names = git(here, "ls-tree", "-r", "-z", "--name-only", commit).decode().split("\0")
    folder, hashes = out / f"{name}.part", {}
    shutil.rmtree(folder, ignore_errors=True)
    paths = wanted(record, names)
    for own, path in paths.items():
        data = git(here, "cat-file", "blob", f"{commit}:{path}")
        if data.startswith(b"version https://git-lfs"):
            raise Unavailable(f"{path} is only a pointer to a file elsewhere (Git LFS)")
        hashes[own] = hashlib.sha256(data).hexdigest()
        if known.get("sha256", hashes).get(own) != hashes[own]:
            raise Unavailable(f"{path} is not the file that cameras.lock.json has")
        part = "" if "film" in record else "corners" if own.endswith(".orpc") else "images"
        file = folder / part / own
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
    for licence in [one for one in names if LICENCE.match(one)][:1]:
        (folder / "LICENSE").write_bytes(git(here, "cat-file", "blob", f"{commit}:{licence}"))
    (folder / "target.yaml").write_text(record["target"], encoding="utf-8")
    test = [own for own, path in paths.items() if re.search(record.get("test", "$^"), path)]
    source = {"repo": GITHUB.format(record["repo"]), "commit": commit, "test": test}
    (folder / "source.json").write_text(json.dumps(source, indent=1), encoding="utf-8")
    folder.rename(out / name)
    return {"commit": commit, "sha256": hashes}


def all_of(names, out, snapshots=None, lock=LOCK):
    """Bring sets that are not there yet; why the others cannot be had, by name."""
    records, missing = cameras(), {}
    known = json.loads(lock.read_text(encoding="utf-8")) if lock.exists() else {}
    out.mkdir(parents=True, exist_ok=True)
    for name in names:
        if (out / name).exists():
            continue
        try:
            known[name] = brought(name, records[name], out, snapshots, known.get(name, {}))
            print(f"{name}: {len(known[name]['sha256'])} files", flush=True)
        except Unavailable as problem:
            missing[name] = str(problem)
            print(f"{name}: not to be had: {problem}", flush=True)
    if known:
        lock.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return missing
