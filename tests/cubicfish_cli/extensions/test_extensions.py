"""Extensions: what the table names is there, what is not there is not missed."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import NamedTuple

import pytest
from running import Run
from samples import ROOT, SAMPLE

import cubicfish_cli
from cubicfish_cli.extension_table import TABLE, Extension


def copied_without(name: str, folder: Path) -> None:
    """Put the package into a folder, but for an extension and its line of the table."""
    package = shutil.copytree(
        Path(cubicfish_cli.__file__).parent,
        folder / "cubicfish_cli",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    shutil.rmtree(package / "extensions" / name)
    table = package / "extension_table.py"
    text = table.read_text(encoding="utf-8")
    line = f'    "{name}": "cubicfish_cli.extensions.{name}.extension:EXTENSION",\n'
    assert text.count(line) == 1
    table.write_text(text.replace(line, ""), encoding="utf-8")


RUN_ALL = """
import json, sys
import cubicfish_cli
from running import invoke_cli
done = [invoke_cli(*line) for line in json.load(sys.stdin)]
said = [(one.exit_code, one.stdout, one.stderr, repr(one.exception)) for one in done]
json.dump([cubicfish_cli.__file__, said], sys.stdout)
"""


class Done(NamedTuple):
    """What came of a command."""

    code: int
    stdout: str
    stderr: str
    exception: str


def run_without(folder: Path, lines: Sequence[Sequence[object]]) -> list[Done]:
    """Run command lines, one after the other, by the package that stands in a folder."""
    places = os.pathsep.join([str(folder), str(ROOT / "tests" / "support")])
    done = subprocess.run(
        [sys.executable, "-c", RUN_ALL],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": places, "PYTHONSAFEPATH": ""},
        input=json.dumps([[str(word) for word in line] for line in lines]),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    package, said = json.loads(done.stdout)
    assert Path(package).is_relative_to(folder)
    return [Done(*one) for one in said]


def without(name: str) -> list[Extension]:
    """An extension, and those that say that they need it."""
    gone, table = [name], {one: resolve_name(place) for one, place in TABLE.items()}
    for one in gone:
        gone += [other for other, own in table.items() if one in own.needs and other not in gone]
    return [table[one] for one in gone]


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(TABLE))
def test_nothing_else_needs_an_extension(
    name: str, calibrated: Path, run: Run, tmp_path: Path
) -> None:
    copied_without(name, tmp_path)
    gone = [one.rpartition(" ")[::2] for own in without(name) for one in own.commands]
    corners, target = SAMPLE / "true_corners.csv", SAMPLE / "target.yaml"
    photo, flat = SAMPLE / "photos" / "corner_01.jpg", tmp_path / "flat.jpg"
    lines: dict[str, list[object]] = {
        "calibrate": [corners, "-t", target, "-o", tmp_path / "c",
                      "--no-hold-out", "--refine-target", "off"],
        "evaluate": [corners, "-t", target, "-m", calibrated, "--json"],
        "compare": [calibrated, SAMPLE / "true_camera.yaml", "--json"],
        "info": [calibrated, "--json"],
        "report": [calibrated, "-o", tmp_path / "r.html", "--json"],
        "undistort": [photo, flat, "-m", calibrated, "--json"],
        "map": [tmp_path / "m.npz", "-m", calibrated, "--json"],
        "export": [calibrated, "--to", "maps", "-o", tmp_path / "e.npz", "--json"],
        "advise": [calibrated, "--json"],
        "target check": [target, "--json"],
        "target print": [target, "--paper", "A3", "-o", tmp_path / "pages", "--json"],
    }  # fmt: skip
    left = [line for line in lines if line.rpartition(" ")[::2] not in gone]
    helps = [[*group.split(), "--help"] for group, _ in gone]
    missed = [[*group.split(), command, "-h"] for group, command in gone]
    works = [[*line.split(), *lines[line]] for line in left]
    said = run_without(tmp_path, [*helps, *missed, *works])
    count = len(gone)
    for (_, command), line, done in zip(gone, helps, said[:count], strict=True):
        assert done.code == 0, done
        assert f"\n  {command} " not in done.stdout
        assert f"\n  {command} " in run(*line).stdout
    for (_, command), done in zip(gone, said[count : -len(works)], strict=True):
        assert f"No such command '{command}'" in done.stderr
    for line, done in zip(left, said[-len(works) :], strict=True):
        assert done.code == 0, f"{line}: {done}"
        assert "--json" not in lines[line] or json.loads(done.stdout)
    assert flat.is_file()


def test_a_rig_is_no_camera_and_the_command_says_what_is(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    for text in ("cubicfish_rig: 1\n", "units: mm\ncameras: []\ncubicfish_rig: 1\n"):
        path.write_text(text)
        for given in (tmp_path, path):
            for line in (["info", given], ["export", given, "--to", "opencv"]):
                said = run(*line, code=1).stderr
                assert "camera" in said
                assert said.count("\n") == 1
                assert ("is the folder of a rig" in said) == (given == tmp_path)
        assert "rig.yaml is of a rig" in said
