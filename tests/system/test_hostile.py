"""Files and names that mean harm, through the commands themselves."""

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

import cubicfish_cli
from cubicfish.files import reading
from cubicfish_cli.undistortion.images import write_picture

SAMPLE = Path(__file__).parents[2] / "sample_data"
TARGET, CORNERS = SAMPLE / "target.yaml", SAMPLE / "true_corners.csv"
ESCAPE = "\x1b]0;owned\x07\x1b[31mred"
UNIX = pytest.mark.skipif(sys.platform == "win32", reason="such names and files are of Unix")
pytestmark = UNIX


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder to work in, and what stands beside it must stay as it is."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    yield folder
    assert [path.name for path in tmp_path.iterdir()] == ["here"]


@pytest.fixture
def photo(calibrated, here):
    """A grey photo of half the camera's size."""
    lines = (calibrated / "camera.yaml").read_text().splitlines()
    size = next(json.loads(line.split(":")[1]) for line in lines if line.startswith("image_size"))
    path = here / "photo.png"
    write_picture(path, np.full((size[1] // 2, size[0] // 2), 128, np.uint8), overwrite=False)
    return path


def made(kind, path):
    path.parent.mkdir(exist_ok=True)
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "endless":
        path.symlink_to("/dev/zero")
    elif kind == "folder":
        path.mkdir()
    elif kind == "loop":
        path.symlink_to(path.name)
    else:
        path.symlink_to("nowhere")
    return path


CAMERA = "known/camera.yaml"
COMMANDS = {
    "target": ("target", "check", "F.yaml"),
    "calibrate-target": ("calibrate", CORNERS, "--target", "F.yaml"),
    "calibrate-corners": ("calibrate", "F.csv", "--target", TARGET),
    "calibrate-pairs": ("calibrate", "--correspondences", "F.csv"),
    "calibrate-photo": ("calibrate", "F.png", "--target", TARGET),
    "detect": ("detect", "F.png", "--target", TARGET),
    "corners-vnl": (
        *("corners", "F.vnl", "--target", TARGET, "--size", "960x720", "--board", "floor"),
    ),
    "evaluate": ("evaluate", CORNERS, "--target", TARGET, "-m", "F.yaml"),
    "compare": ("compare", "F.yaml", CAMERA),
    "advise": ("advise", "F.yaml"),
    "undistort-photo": ("undistort", "F.png", "out.png", "-m", CAMERA),
    "undistort-camera": ("undistort", "F.png", "out.png", "-m", "F.yaml"),
    "map": ("map", "out.npz", "-m", "F.yaml"),
    "project": ("project", "-m", CAMERA, "F.csv"),
    "export": ("export", "--to", "opencv", "-m", "F.yaml"),
    "import": ("import", "F.yaml"),
    "frames": ("frames", "F.mp4", "-o", "photos"),
    "import-mrcal": ("import", "F.yaml", "--from", "mrcal"),
    "simulate": ("simulate", "--target", TARGET, "-m", "F.yaml"),
    "simulate-poses": ("simulate", "--target", TARGET, "-m", CAMERA, "--poses", "F.csv"),
}


KINDS = ("pipe", "endless", "folder", "loop", "dangling")
WAYS = ("target", "calibrate-corners", "detect", "corners-vnl", "frames")
"""One command for each way to read; that each command reads in such a way is seen by pipes."""


@pytest.mark.parametrize(
    ("command", "kind"),
    [
        pytest.param(
            command,
            kind,
            marks=() if kind == "pipe" or command in WAYS else pytest.mark.slow,
            id=f"{command}-{kind}",
        )
        for command in COMMANDS
        for kind in KINDS
    ],
)
def test_what_is_no_file_is_refused_at_once(
    run, calibrated, here, monkeypatch, in_time, kind, command
):
    monkeypatch.setattr(reading, "PATIENCE", 0.01)
    (here / "known").symlink_to(calibrated)
    arguments = []
    for word in map(str, COMMANDS[command]):
        if word.startswith("F."):
            word = made(kind, here / "given" / word)
        arguments.append(word)
    before = sorted(here.rglob("*"))
    said = run(*arguments, code=1).stderr
    assert said.splitlines()[-1].startswith("Error: ")
    assert "given/F." in said.splitlines()[-1]
    assert sorted(here.rglob("*")) == before


@pytest.mark.parametrize(
    "name", ["a b.png", "-j.png", "--help.png", "*.png", "a;b&c.png", "ü.png", "x" * 251 + ".png"]
)
def test_photos_may_be_called_as_they_like(run, calibrated, photo, here, name):
    photo.rename(here / name)
    small = ("-m", calibrated / "camera.yaml", "--size", "24x18")
    run("undistort", *small, "--", name, here / "out" / name)
    assert [path.name for path in (here / "out").glob("[!.]*")] == [name]
    run("undistort", *small, here, here / "all")
    assert [path.name for path in (here / "all").glob("[!.]*")] == [name]


@pytest.mark.parametrize("name", [b"caf\xe9.png", b"a\nb.png", b"a\x1b[2Jb.png", b"\xc2\x9bm.png"])
def test_names_that_no_table_can_hold_are_refused(run, calibrated, photo, here, name):
    os.rename(photo, os.fsencode(here) + b"/" + name)
    said = run("undistort", here, here / "out", "-m", calibrated / "camera.yaml", code=1).stderr
    assert "a photo's name must be plain text: rename the file" in said
    assert said.count("\n") == 1
    assert "\x1b" not in said
    assert "\x9b" not in said
    assert not (here / "out").exists()


def test_a_list_of_photos_may_have_the_line_ends_of_any_system(run, calibrated, photo, here):
    shutil.copy(photo, here / "a b.png")
    names = "photo.png\r\na b.png\r\n"
    run("undistort", "-", here / "out", "-m", calibrated / "camera.yaml", input=names)
    assert {path.name for path in (here / "out").glob("[!.]*")} == {"photo.png", "a b.png"}


def test_a_list_of_photos_writes_nothing_beside_its_folder(run, calibrated, photo, here):
    (here / "deep").mkdir()
    photo.rename(here / "deep" / "photo.png")
    shutil.copy(here / "deep" / "photo.png", here / "photo.png")
    names = "deep/../photo.png\ndeep/../deep/photo.png\n"
    run("undistort", "-", here / "out", "-m", calibrated / "camera.yaml", input=names)
    written = [path for path in here.rglob("*") if path.is_file()]
    assert {path.relative_to(here).parts[0] for path in written} == {"deep", "photo.png", "out"}
    assert len(written) == 5  # the folder says whose pictures it holds


def test_names_that_collide_once_their_kind_changes_do_not_replace_each_other(
    run, calibrated, photo, here
):
    for name in ("photo.bmp", "photo.tif"):
        write_picture(here / name, np.zeros((4, 4), np.uint8), overwrite=False)
    arguments = ("detect", here, "--target", TARGET, "--draw", here / "seen", "--no-cache")
    run(*arguments, code=1)
    from cubicfish.photos import find_photos
    from cubicfish_cli.render.drawings import drawings

    places = drawings(here / "seen", find_photos([here]))
    assert len(set(places.values())) == 3
    assert {path.parent for path in places.values()} == {here / "seen"}


def test_a_link_is_replaced_and_what_it_leads_to_stays(run, calibrated, photo, here):
    model = ("-m", calibrated / "camera.yaml")
    (here / "precious.txt").write_text("precious")
    (here / "out.png").symlink_to("precious.txt")
    assert "exists already" in run("undistort", photo, "out.png", *model, code=1).stderr
    run("undistort", photo, "out.png", "--overwrite", *model)
    assert (here / "precious.txt").read_text() == "precious"
    assert not (here / "out.png").is_symlink()
    (here / "dangling.png").symlink_to("made.txt")
    assert "exists already" in run("undistort", photo, "dangling.png", *model, code=1).stderr
    assert not (here / "made.txt").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ["undistort", "loop", "flat.png", "-m", "camera"],
        ["undistort", "loop/photo.png", "flat.png", "-m", "camera"],
        ["undistort", "photo.png", "loop/flat.png", "-m", "camera"],
        ["undistort", "photo.png", "loop", "-m", "camera"],
        ["map", "loop/map.npz", "-m", "camera"],
        ["calibrate", "loop", "--target", TARGET, "-o", "out"],
        ["calibrate", CORNERS, "--target", "loop", "-o", "out"],
        ["calibrate", CORNERS, "--target", TARGET, "-o", "loop"],
        ["detect", "loop", "--target", TARGET],
        ["evaluate", CORNERS, "--target", TARGET, "-m", "loop"],
        ["info", "loop/camera.yaml"],
        ["export", "--to", "opencv", "-m", "loop"],
        ["compare", "loop", "camera"],
        ["target", "check", "loop"],
        ["rig", "info", "loop"],
    ],
)
def test_a_link_that_leads_to_itself_ends_in_one_line(run, calibrated, photo, here, arguments):
    Path("loop").symlink_to("loop")
    Path("camera").symlink_to(calibrated)
    ended = run(*arguments, code=1)
    assert [line[:6] for line in ended.stderr.splitlines() if line[:6] == "Error:"] == ["Error:"]
    assert "loop" in ended.stderr


def test_a_folder_that_is_a_link_is_written_into(run, calibrated, photo, here):
    (here / "real").mkdir()
    (here / "link").symlink_to("real")
    run("undistort", photo, "link/out.png", "-m", calibrated / "camera.yaml")
    assert (here / "real" / "out.png").is_file()
    (here / "loop").symlink_to("loop")
    said = run("undistort", photo, "loop/out.png", "-m", calibrated / "camera.yaml", code=1).stderr
    assert "loop/out.png cannot be written" in said


@pytest.mark.slow
def test_names_of_photos_in_tables_lead_nowhere(run, here, with_report, quick_fit):
    text = CORNERS.read_text()
    for number, name in enumerate(("../../escaped", "/tmp/escaped", "..", "a/../../../escaped")):
        text = text.replace(f"corner_{number + 1:02}.jpg", name)
    (here / "corners.csv").write_text(text)
    run("calibrate", "corners.csv", "--target", TARGET, "-o", "made")
    run("report", "made", "--photos", SAMPLE / "photos", "-o", "again.html")
    written = {path.relative_to(here).parts[0] for path in here.rglob("*") if path.is_file()}
    assert written == {"corners.csv", "made", "again.html"}
    assert not Path("/tmp/escaped").exists()


ELSEWHERE = ("../escaped", "/tmp/escaped", "a/../../escaped", "..", "two\nlines")


def hostile_rig(calibrated, folder, name):
    """A rig whose second camera is called so, its keys in another order than they are written."""
    cameras = []
    for number, called in enumerate(("left", name)):
        (folder / f"camera{number}").mkdir(parents=True)
        shutil.copy(calibrated / "camera.yaml", folder / f"camera{number}")
        place = {"translation": [-100 * number, 0, 0], "rotation": np.eye(3).tolist()}
        own = f"camera{number}/camera.yaml"
        cameras.append({"camera_from_rig": place, "camera": own, "name": called})
    record = {"units": "mm", "cameras": cameras, "cubicfish_rig": 1}
    (folder / "rig.yaml").write_text(yaml.safe_dump(record, sort_keys=False))


WRITERS = {
    "rig export": ["rig", "export", "rig", "--to", "mrcal", "-o", "out"],
    "rig export ros": ["rig", "export", "rig", "--to", "ros", "-o", "out"],
    "rig map": ["rig", "map", "out/m.npz", "-m", "rig"],
    "rig undistort": ["rig", "undistort", "photos", "out", "-m", "rig"],
    "rig calibrate": ["rig", "calibrate", CORNERS, CORNERS, "-t", TARGET, "-o", "out", "--names"],
    "simulate": ["simulate", "--target", TARGET, "--poses", "poses.csv", "-o", "out"],
}
"""What writes several files into a folder, called after names that stand in files."""


@pytest.mark.parametrize("name", ELSEWHERE)
@pytest.mark.parametrize("writer", WRITERS)
def test_nothing_is_written_outside_of_the_folder(run, calibrated, photo, here, writer, name):
    hostile_rig(calibrated, here / "rig", name)
    (here / "photos" / "left").mkdir(parents=True)
    shutil.copy(photo, here / "photos" / "left")
    poses = f'image,rx,ry,rz,tx,ty,tz\n"{name}",0,0,0,0,0,500\n'
    (here / "poses.csv").write_text(poses)
    line = [*WRITERS[writer], *([f"left,{name}"] if writer == "rig calibrate" else [])]
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    done = run(*line, code=2 if writer == "rig calibrate" else 1)
    assert done.stderr.splitlines()[-1].startswith("Error: ")
    assert "Traceback" not in done.stderr
    after = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    assert {path: text for path, text in after.items() if here / "out" not in path.parents} == {
        path: text for path, text in before.items() if here / "out" not in path.parents
    }
    assert not Path("/tmp/escaped").exists()


@pytest.mark.slow
def test_what_writes_into_folders_says_which():
    """Each module that writes several files says which folder they must be in."""
    by_users = {"calibrate.py", "map.py", "map_files.py"}  # no name is out of a file
    by_plan = {"batch.py"}  # writes what undistort has planned, and refused where it leads out
    for path in Path(cubicfish_cli.__file__).parents[1].glob("cubicfish*/**/*.py"):
        if path.name in {"whole_files.py", *by_users, *by_plan} or path.parent.name == "advice":
            continue
        text = path.read_text(encoding="utf-8")
        calls = [one for one in ast.walk(ast.parse(text)) if isinstance(one, ast.Call)]
        named = {getattr(one.func, "id", ""): {word.arg for word in one.keywords} for one in calls}
        if "folder" in named.get("refuse_existing", ()):
            continue  # before the work
        for call in calls:
            if getattr(call.func, "id", "") in ("write_files", "whole_files"):
                several = not isinstance(call.args[0], ast.Dict) or len(call.args[0].keys) > 1
                assert not several or "folder" in {word.arg for word in call.keywords}, path


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace(b".", b",", 40), b"values where 6 belong"),
        (lambda text: text.replace(b".", b"\xd9\xab"), b"finite number"),
        (lambda text: text.decode().encode("utf-16"), b"not UTF-8 text"),
        (lambda text: text[:300] + b"\0" + text[300:], b"line"),
        (lambda text: text + text.splitlines()[-1] + b"\n", b"is there twice in this photo"),
        (lambda text: text.replace(b"corner_01.jpg", ESCAPE.encode()), b"must be a name"),
        (lambda text: text.replace(b",floor,", b",\xc2\x9b31m,"), rb"\x9b31m"),
        (lambda text: text.replace(b"sh corners", b"sh " + 9000 * b"x", 1), b"not 'cubicfish xx"),
    ],
)
def test_tables_of_other_habits_are_refused_by_their_line(run, here, change, says):
    (here / "corners.csv").write_bytes(change(CORNERS.read_bytes()))
    said = run("calibrate", "corners.csv", "--target", TARGET, "-o", "made", code=1).stderr
    assert "corners.csv" in said
    assert says.decode() in said
    assert len(said) < 1000
    assert not {"\x1b", "\x9b", "\x07"} & set(said)
    assert [path.name for path in here.iterdir()] == ["corners.csv"]


@pytest.mark.parametrize(
    "change",
    [
        lambda text: b"\xef\xbb\xbf" + text,
        lambda text: text.replace(b"\n", b"\r\n"),
        lambda text: text.replace(b"\n", b"\r"),
    ],
)
def test_tables_of_other_systems_are_read(run, here, quick_fit, change):
    (here / "corners.csv").write_bytes(change(CORNERS.read_bytes().replace(b"\r", b"")))
    run("calibrate", "corners.csv", "--target", TARGET, "-o", "made")


@pytest.mark.parametrize(
    "command",
    [("target", "check", "F"), ("map", "m.npz", "-m", "F"), ("import", "F", "--from", "opencv"),
     ("import", "F", "--from", "kalibr"), ("import", "F", "--from", "ros")],
)  # fmt: skip
@pytest.mark.parametrize(
    "text",
    [
        '!!python/object/apply:os.system ["touch owned"]',
        "a: !!python/object/new:os.system [touch owned]",
        "a: &a [x, x]\nb: &b [*a, *a]\nc: &c [*b, *b]\n",
        "[" * 5000,
        '"\\e[31m": 1',
    ],
)
def test_yaml_that_is_more_than_data_does_nothing(run, here, in_time, command, text):
    (here / "F").write_text(text)
    said = run(*command, code=1).stderr
    assert said.count("\n") == 1
    assert "\x1b" not in said
    assert [path.name for path in here.iterdir()] == ["F"]


def on_a_terminal(*arguments, folder):
    """What a terminal gets from a command, and its exit code."""
    ours, theirs = os.openpty()
    command = [sys.executable, "-m", "cubicfish_cli", *arguments]
    environment = {**os.environ, "NO_COLOR": "1", "TERM": "xterm", "COLUMNS": "200"}
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs, cwd=folder,
        env=environment,
    ) as process:  # fmt: skip
        os.close(theirs)
        shown = b""
        try:
            while part := os.read(ours, 65536):
                shown += part
        except OSError:  # the other end was closed
            pass
    os.close(ours)
    return shown, process.returncode


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("detect", f"--{ESCAPE}"), 2),
        (("project", "a", ESCAPE), 2),
        ((ESCAPE,), 2),
        (("target", "check", f"absent {ESCAPE}.yaml"), 1),
        (("target", "check", os.fsdecode(b"absent \xff\xc2\x9b31m.yaml")), 1),
    ],
)
def test_names_do_not_steer_the_terminal(here, arguments, code):
    shown, ended = on_a_terminal(*arguments, folder=here)
    assert ended == code
    assert shown
    assert not {b"\x1b", b"\x07", b"\xc2\x9b"} & {shown[i : i + n] for n in (1, 2)
                                                  for i in range(len(shown))}  # fmt: skip


def test_a_message_is_one_line_whatever_a_file_is_called(run, here):
    said = run("target", "check", "a\nError: all is well\r.yaml", code=1).stderr
    assert said.count("\n") == 1
    assert "\r" not in said


def test_json_holds_no_character_that_steers_a_terminal(run, calibrated, photo, here):
    folder = here / "a\x9b31m\u202eb"
    folder.mkdir()
    model = ("-m", calibrated / "camera.yaml")
    said = run("undistort", photo, folder / "out.png", "--json", *model).stdout
    assert said.isascii()
    assert str(folder) in json.dumps(json.loads(said), ensure_ascii=False)
