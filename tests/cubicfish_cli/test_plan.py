"""No command replaces what it reads, or writes two results under one name."""

import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from pathlib import Path

import click
import pytest
import yaml
from command_tree import commands
from running import Run as RunCommand
from running import invoke_cli
from samples import SAMPLE

from cubicfish import OutputError, Run
from cubicfish.photos import Photo
from cubicfish_cli.plan import Plan

READ = "read here, and would be replaced"
NO_CAMERA = "is a photo, not a camera"
TWICE = "would be written twice"


@dataclass(frozen=True, kw_only=True)
class Case:
    """A command: what it reads and writes, by the names of its parameters.

    Attributes:
        reads: input -> the sample that it is.
        writes: output -> what it is given and what it writes then, in the folder of results; where
            both are one, it may have any name.
        needs: what else the command needs, files by their samples' names.
        needs_more: input -> what the command needs to read it.
        shapes: input -> how its file is written on the command line.
        spares: inputs that are spared by another name of the output, with the output.

    """

    reads: Mapping[str, str] = field(default_factory=dict)
    writes: Mapping[str, Sequence[tuple[str, str]]] = field(default_factory=dict)
    needs: Mapping[str, object] = field(default_factory=dict)
    needs_more: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    shapes: Mapping[str, str] = field(default_factory=dict)
    spares: frozenset[tuple[str, str]] = frozenset()


def within(*names: str) -> list[tuple[str, str]]:
    return [(".", name) for name in names]


def alone(name: str) -> list[tuple[str, str]]:
    return [(name, name)]


CAMERA = {"calibration": "camera.yaml", "model": "camera.yaml"}
PICTURES = {
    "output": [*alone("flat.jpg"), *within("photo.jpg")],
    "mask": alone("mask.png"),
    "virtual_camera": [("flat.jpg", "flat.view.yaml")],
}
PAGE = "report.html"

CASES = {
    "calibrate": [
        Case(
            reads={"inputs": "photo.jpg", "target": "target.yaml", "correspondences": "pairs.csv"},
            writes={
                "folder": within("camera.yaml", "undistort_map.npz", "target.refined.yaml", PAGE)
            },
            needs={"inputs": "photo.jpg", "target": "target.yaml"},
        ),
        Case(
            reads={"inputs": "photo.jpg"},
            writes={"folder": within("target.yaml")},
            needs={"board": "9x6", "square": "25mm"},
        ),
    ],
    "detect": [
        Case(
            reads={"photos": "photo.jpg", "target": "target.yaml"},
            writes={"table": alone("corners.csv"), "draw": within("photo.png")},
            needs={"photos": "photo.jpg", "target": "target.yaml"},
            spares=frozenset({("photos", "draw")}),
        )
    ],
    "evaluate": [
        Case(reads={"inputs": "photo.jpg", "target": "target.yaml", "model": "camera.yaml"})
    ],
    "compare": [
        Case(
            reads={"first": "camera.yaml", "second": "camera.yaml"},
            writes={"picture": alone("difference.png")},
            needs={"first": "camera.yaml", "second": "camera.yaml"},
        )
    ],
    "export": [
        Case(
            reads=CAMERA,
            writes={"output": alone("lens.cameramodel")},
            needs={"to": "mrcal", "model": "camera.yaml"},
        )
    ],
    "info": [Case(reads=CAMERA)],
    "project": [Case(reads={"points": "pairs.csv", "model": "camera.yaml"})],
    "unproject": [Case(reads={"pixels": "pairs.csv", "model": "camera.yaml"})],
    "map": [
        Case(
            reads={"model": "camera.yaml"},
            writes={
                "output": [
                    *alone("map.npz"),
                    ("map.npz", "map.view.yaml"),
                    ("map.png", "map_x.png"),
                    ("map.pgm", "map_y.pgm"),
                ]
            },
            needs={"model": "camera.yaml"},
        )
    ],
    "undistort": [
        Case(
            reads={"photos": "photo.jpg", "model": "camera.yaml", "target": "target.yaml"},
            writes=PICTURES,
            needs={"photos": "photo.jpg", "model": "camera.yaml", "output": "flat.jpg"},
            needs_more={"target": {"kind": "plane:floor"}},
        )
    ],
    "transform": [
        Case(
            reads=CAMERA,
            writes={"output": alone("binned.yaml")},
            needs={"scale": "0.5", "model": "camera.yaml"},
        )
    ],
    "target check": [
        Case(
            reads={"target": "target.yaml"},
            writes={"drawing": alone("object.svg")},
        )
    ],
    "target print": [
        Case(
            reads={"target": "target.yaml"},
            writes={"folder": within("boards.pdf")},
            needs={"paper": "A2"},
        )
    ],
    "simulate": [
        Case(
            reads={"target": "target.yaml", "model": "camera.yaml", "poses": "poses.csv"},
            writes={
                "folder": within(
                    "true_corners.csv", "true_poses.csv", "true_camera.yaml", "photo_1.jpg"
                )
            },
            needs={"target": "target.yaml", "model": "camera.yaml", "poses": "poses.csv"},
        )
    ],
    "frames": [
        Case(
            reads={"films": "film.mp4", "target": "target.yaml"},
            writes={"folder": within("contact_sheet.html")},
            needs={"films": "film.mp4"},
        )
    ],
    "report": [
        Case(
            reads={**CAMERA, "target": "target.yaml", "photos": "photo.jpg"},
            writes={"page": alone("lens.html")},
            needs={"model": "camera.yaml"},
        )
    ],
    "advise": [
        Case(
            reads={**CAMERA, "target": "target.yaml", "corners": "pairs.csv"},
            writes={"picture": alone("advice.svg")},
            needs={"model": "camera.yaml"},
        )
    ],
    "shoot": [
        Case(
            reads={"photos": "photo.jpg", "target": "target.yaml"},
            writes={"folder": within("camera.yaml")},
            needs={"photos": "photo.jpg", "target": "target.yaml"},
        )
    ],
    "import": [Case(reads={"path": "lens.yaml"}, writes={"output": alone("camera.yaml")})],
    "corners": [
        Case(
            reads={"files": "found.vnl", "target": "target.yaml"},
            writes={"table": alone("corners.csv")},
            needs={"files": "found.vnl", "target": "target.yaml", "image_size": "640x480"},
        )
    ],
    "rig calibrate": [
        Case(
            reads={
                "cameras": "pairs.csv",
                "target": "target.yaml",
                "lenses": "camera.yaml",
                "shots": "pairs.csv",
                "times": "pairs.csv",
            },
            writes={
                "folder": within(
                    "rig.yaml", "left/camera.yaml", "left/corners.csv", "target.refined.yaml", PAGE
                )
            },
            needs={
                "cameras": ["left.csv", "right.csv"],
                "target": "target.yaml",
                "names": "left,right",
            },
            shapes={"lenses": "left={}"},
        )
    ],
    "rig evaluate": [
        Case(
            reads={
                "cameras": "pairs.csv",
                "rig": "rig.yaml",
                "target": "target.yaml",
                "times": "pairs.csv",
            }
        )
    ],
    "rig compare": [Case(reads={"first": "rig.yaml", "second": "rig.yaml"})],
    "rig info": [Case(reads={"rig": "rig.yaml"})],
    "rig report": [Case(reads={"rig": "rig.yaml"}, writes={"page": alone("body.html")}, needs={})],
    "rig undistort": [
        Case(
            reads={"photos": "photo.jpg", "rig": "rig.yaml"},
            writes=PICTURES,
            needs={"photos": ["photo.jpg", "other.jpg"], "output": "flat.jpg", "rig": "rig.yaml"},
        )
    ],
    "rig map": [
        Case(
            reads={"rig": "rig.yaml"},
            writes={
                "output": [
                    ("map.npz", "map_left.npz"),
                    ("map.npz", "map_right.view.yaml"),
                    ("map.npz", "map.stereo.yaml"),
                ]
            },
        )
    ],
    "rig export": [
        Case(
            reads={"rig": "rig.yaml"},
            writes={"output": alone("camchain.yaml")},
            needs={"to": "kalibr-omni", "max_error": "9"},
        )
    ],
}

LEAVES = {
    " ".join(words[1:]): command
    for words, command in commands()
    if not isinstance(command, click.Group)
}
# What the command line may not name beside these inputs.
NAMES_ALONE = {"exclude"}  # of files among the inputs
INSTEAD = {"calibration": {"model"}, "correspondences": {"inputs", "target"}}


def test_every_command_is_here_with_every_file_that_it_takes() -> None:
    named = {
        name: {
            str(one.name)
            for one in command.params
            if isinstance(one.type, click.Path) and one.name not in NAMES_ALONE
        }
        for name, command in LEAVES.items()
    }
    assert {name: params for name, params in named.items() if params} == {
        name: {key for case in cases for key in (*case.reads, *case.writes)}
        for name, cases in CASES.items()
    }


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one input of each kind; those that nobody reads are words."""
    folder = tmp_path_factory.mktemp("samples")
    for name in (
        "pairs.csv", "left.csv", "right.csv", "corners.csv", "film.mp4", "found.vnl", "lens.yaml"
    ):  # fmt: skip
        (folder / name).write_text("words\n")
    shutil.copy(SAMPLE / "target.yaml", folder)
    shutil.copy(SAMPLE / "true_camera.yaml", folder / "camera.yaml")
    photo = min((SAMPLE / "photos").iterdir(), key=lambda path: Photo.natural_key(path.name))
    for name in ("photo.jpg", "other.jpg"):
        shutil.copy(photo, folder / name)
    facing = "photo_1.jpg,-2.1,0.87,0.36,0,0,600"  # from outside into the corner of the boards
    (folder / "poses.csv").write_text(f"image,rx,ry,rz,tx,ty,tz\n{facing}\n")
    cameras = []
    for name in ("left", "right"):
        (folder / name).mkdir()
        shutil.copy(folder / "camera.yaml", folder / name)
        place = {"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": [9.0, 0.0, 0.0]}
        path = f"{name}/camera.yaml"
        cameras.append({"name": name, "camera": path, "camera_from_rig": place})
    rig = {"cubicfish_rig": 1, "units": "mm", "cameras": cameras}
    (folder / "rig.yaml").write_text(yaml.safe_dump(rig))
    return folder


def words_of(name: str, values: Mapping[str, Sequence[object]]) -> list[object]:
    """The command line of a command with these values of its parameters."""
    arguments: list[object] = []
    options: list[object] = []
    for one in LEAVES[name].params:
        value = values.get(str(one.name), ())
        if isinstance(one, click.Argument):
            arguments += value
        else:
            options += [word for own in value for word in (one.opts[-1], own)]
    return [*name.split(), *arguments, *options, "--overwrite"]


def values_of(case: Case, samples: Path, **more: object) -> dict[str, list[object]]:
    """What a command needs, and more; an input may take the place of others."""
    gone = {one for name in more for one in INSTEAD.get(name, ())}
    files = {*case.reads, *case.writes}
    values = {name: [one] for name, one in more.items()}
    for name, one in case.needs.items():
        several = one if isinstance(one, list) else [one]
        there = [samples / str(file) if name in files else file for file in several]
        if name in more:
            there[0] = more[name]
        if name not in gone:
            values[name] = there
    return values


def lines_onto_inputs() -> Iterator[object]:
    for name, cases in CASES.items():
        for case in cases:
            for output, results in case.writes.items():
                for read in case.reads:
                    for given, written in results:
                        if (read, output) not in case.spares:
                            title = f"{name}: {read} {output} {written}"
                            yield pytest.param(name, case, read, output, given, written, id=title)


def lines_onto_outputs() -> Iterator[object]:
    for name, cases in CASES.items():
        for case in cases:
            for first, second in permutations(case.writes, 2):
                for given, written in case.writes[second]:
                    if any(one == other for one, other in case.writes[first]):
                        title = f"{name}: {first} {second} {written}"
                        yield pytest.param(name, case, first, second, given, written, id=title)


def files_in(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.usefixtures("with_report")
@pytest.mark.parametrize(
    ("name", "case", "read", "output", "given", "written"), [*lines_onto_inputs()]
)
def test_an_output_that_is_an_input_is_refused(
    name: str,
    case: Case,
    read: str,
    output: str,
    given: str,
    written: str,
    samples: Path,
    tmp_path: Path,
) -> None:
    folder, sample = tmp_path / "results", samples / case.reads[read]
    if sample.name == "rig.yaml":
        shutil.copytree(samples, folder)
    mine = folder / written
    mine.parent.mkdir(exist_ok=True, parents=True)
    shutil.copy(sample, mine)
    if read == "cameras":  # the file of a camera has corners beside it
        (mine.parent / "corners.csv").touch()
    there = files_in(folder)
    value = case.shapes.get(read, "{}").format(mine)
    more = {output: folder / given, **case.needs_more.get(read, {}), read: value}
    said = invoke_cli(*words_of(name, values_of(case, samples, **more)))
    # What is called like a photo is refused as a camera earlier.
    refused = READ in said.stderr or (
        read in ("model", "first", "second") and NO_CAMERA in said.stderr
    )
    assert (said.exit_code, refused) == (1, True), said.stderr
    assert len(said.stderr.splitlines()) == 1
    assert files_in(folder) == there


@pytest.mark.usefixtures("with_report")
@pytest.mark.parametrize(
    ("name", "case", "first", "second", "given", "written"), [*lines_onto_outputs()]
)
def test_two_outputs_of_one_name_are_refused(
    name: str,
    case: Case,
    first: str,
    second: str,
    given: str,
    written: str,
    samples: Path,
    tmp_path: Path,
) -> None:
    more = {first: tmp_path / written, second: tmp_path / given}
    said = invoke_cli(*words_of(name, values_of(case, samples, **more)))
    assert (said.exit_code, TWICE in said.stderr) == (1, True), said.stderr
    assert not files_in(tmp_path)


@pytest.fixture
def plan() -> Plan:
    return Plan(Run(overwrite=True))


def test_a_folder_and_a_pattern_stand_for_their_photos(plan: Plan, tmp_path: Path) -> None:
    for name in ("01.jpg", "corners.csv", "film.mp4"):
        (tmp_path / name).touch()
    plan.reads([tmp_path])
    plan.writes(tmp_path / "corners.csv")
    for name in ("01.jpg", "film.mp4"):
        with pytest.raises(OutputError, match=READ):
            plan.writes(tmp_path / name)
    of_pattern = Plan(Run(overwrite=True)).reads(str(tmp_path / "*"))
    of_pattern.writes(tmp_path / "corners.csv")
    with pytest.raises(OutputError, match=READ):
        of_pattern.writes(tmp_path / "01.jpg")


@pytest.mark.parametrize("link", [os.link, os.symlink])
def test_a_file_of_two_names_is_one_input(
    link: Callable[[Path, Path], None], plan: Plan, tmp_path: Path
) -> None:
    mine, other = tmp_path / "mine.png", tmp_path / "other.png"
    mine.touch()
    link(mine, other)
    with pytest.raises(OutputError, match=f"is the same file as {mine}, which is {READ}"):
        plan.reads(mine).writes(other)


def test_an_input_that_is_known_late_may_be_no_output(plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    plan.writes(tmp_path / "a.png")
    with pytest.raises(OutputError, match=READ):
        plan.reads(tmp_path / "a.png")


def test_a_topic_belongs_to_its_recording(plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "run.bag").touch()
    with pytest.raises(OutputError, match=READ):
        plan.reads(f"{tmp_path / 'run.bag'}:/cam0/image").writes(tmp_path / "run.bag")


def test_large_and_small_letters_count_where_the_folder_tells_them_apart(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    alike = (tmp_path / "A.png", tmp_path / "a.png")
    (tmp_path / "b").touch()
    if not (tmp_path / "B").exists():
        plan.writes(*alike)
        assert [path.name for path in tmp_path.iterdir()] == ["b"]
    monkeypatch.setattr(
        Path,
        "exists",
        lambda path: any(
            one.name.casefold() == path.name.casefold() for one in path.parent.iterdir()
        ),
    )
    with pytest.raises(OutputError, match=f"{alike[1]} {TWICE}"):
        Plan(Run()).writes(*alike)


def test_a_folder_has_one_name(plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    (tmp_path / "here").symlink_to(tmp_path / "there")
    with pytest.raises(OutputError, match=TWICE):
        plan.writes(tmp_path / "there" / "a.png", tmp_path / "here" / "a.png")


def test_outputs_that_exist_are_left_out_where_that_is_asked_for(tmp_path: Path) -> None:
    old, new = tmp_path / "old.png", tmp_path / "new.png"
    old.touch()
    assert Plan(Run(), skip_existing=True).writes(old, new) == [new]
    with pytest.raises(OutputError, match=r"exists already.*skip_existing=True"):
        Plan(Run(), skip_existing=False).writes(old, new)
    with pytest.raises(OutputError, match=r"exists already.*overwrite=True$"):
        Plan(Run()).writes(old, new)


def test_what_was_planned_is_written_and_nothing_else(plan: Plan, tmp_path: Path) -> None:
    new, none, other, left, mine = (
        tmp_path / name for name in ("new.txt", "none.txt", "other.txt", "left.txt", "mine.txt")
    )
    for old in (left, mine):
        old.touch()
    plan.reads(mine).writes(new, none)
    plan.leaves(left, mine, none)
    assert plan.write({new: "words", none: None}) == [new]
    assert plan.removed == [left]
    assert sorted(tmp_path.iterdir()) == sorted([new, mine])
    with pytest.raises(AssertionError, match="not planned"):
        plan.write({other: "words"})
    assert not other.exists()


def test_what_an_earlier_run_left_stays_where_nothing_may_be_replaced(tmp_path: Path) -> None:
    (tmp_path / "left.txt").touch()
    plan = Plan(Run())
    plan.writes(tmp_path / "new.txt")
    plan.leaves(tmp_path / "left.txt")
    plan.write({tmp_path / "new.txt": "words"})
    assert plan.removed == []
    assert (tmp_path / "left.txt").exists()


def test_an_output_leads_out_of_no_folder(plan: Plan, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is outside of"):
        plan.writes(tmp_path / "results" / ".." / "a.png", within=tmp_path / "results")


@pytest.mark.usefixtures("with_report", "quick_fit")
def test_what_a_calibration_came_from_is_an_input_of_what_tells_of_it(
    run: RunCommand, tmp_path: Path
) -> None:
    """Files beside the camera, and those that its record names."""
    folder, target, table = (tmp_path / name for name in ("lens", "boards.svg", "found.csv"))
    shutil.copy(SAMPLE / "target.yaml", target)
    shutil.copy(SAMPLE / "true_corners.csv", table)
    run("calibrate", table, "-t", target, "-o", folder, "--no-report")
    shutil.copy(target, folder / "target.yaml")
    there = files_in(tmp_path)
    beside = [folder / name for name in ("camera.yaml", "corners.csv", "target.yaml")]
    for command in ("report", "advise"):
        for file in [*beside, target] if command == "report" else [target]:
            assert READ in run(command, folder, "-o", file, "--overwrite", code=1).stderr
    (folder / "corners.csv").unlink()
    assert READ in run("report", folder, "-o", table, "--overwrite", code=1).stderr
    assert files_in(tmp_path) == {path: there[path] for path in there if path.exists()}
