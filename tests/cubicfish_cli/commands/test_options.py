"""Commands use every option that they are given, or refuse it: none is passed over.

A table says of each command which option is used in which of its modes. Everywhere else it must be
wrong usage, and say which option it is; where it is used, what comes out must be another than
without it.
"""

import json
import pickle
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
import pytest
import yaml
from command_tree import commands
from pairs_csv import write_pairs
from running import invoke_cli, run_cli
from samples import SAMPLE

import cubicfish
from cubicfish import Target, load_corners, save_corners
from cubicfish.find.identification.second_pass import Prediction
from cubicfish.fit import calibrate as fit
from cubicfish.observe import detection, glances
from cubicfish.rigs import alone
from cubicfish.scene import photos as simulate
from cubicfish.workers import cluster, pool
from cubicfish_cli import CubicfishError, load_camera, save_camera
from cubicfish_cli.commands import exporting
from cubicfish_cli.extensions.advice import advise
from tests.cubicfish_cli.extensions.rigs.test_export import made_rig

TARGET, ALL_CORNERS = SAMPLE / "target.yaml", SAMPLE / "true_corners.csv"
PHOTOS = sorted((SAMPLE / "photos").glob("*.jpg"))
NOBODY = "tcp://127.0.0.1:9"  # a port where nothing listens
MRCAL = (
    "{ 'lensmodel': 'LENSMODEL_OPENCV8', 'extrinsics': [0, 0, 0, 0, 0, 0],\n"
    "'intrinsics': [130, 130, 240, 180, 0.01, 0.001, 0, 0, 0, 0, 0, 0],\n"
    "'imagersize': [480, 360] }\n"
)
COMMON = {"--help", "--verbose", "--quiet", "--debug", "--report", "--tags"}
FITS = {"photos", "film", "corners", "pairs", "point", "board"}
SEARCHED = {"photos", "film", "board"}
RIGS = {"tables", "timed", "lens", "held", "photos", "films"}
PICTURES = {"undistort", "map", "rig undistort", "rig map"}
"""Commands of which ``test_used_or_refused.py`` has the table."""
UNENDING = {"shoot"}
"""Commands that go on until somebody ends them, of which their own tests use every option."""
QUICK = {"corners", "project", "unproject", "info", "rig info", "rig compare"}


@dataclass(frozen=True)
class Case:
    """A command: the lines of its modes, and option -> a value that shows, and where it is used.

    In a line and in a value, names in braces are those of the sources, and ``out`` is a folder.
    """

    lines: Mapping[str, str]
    used: Mapping[str, tuple[str | None, set[str]]]


CASES = {
    "calibrate": Case(
        lines={
            "photos": "{photos} -t {target} -o {out}/c --no-hold-out",
            "film": "{film} -t {target} -o {out}/c --no-hold-out",
            "corners": "{corners} -t {target} -o {out}/c --no-hold-out",
            "pairs": "--correspondences {pairs} -o {out}/c --no-hold-out",
            "point": "{corners} -t {target} --lift point -o {out}/c --no-hold-out",
            "board": "{photos} --board 9x6 --square 25mm -o {out}/c --no-hold-out",
        },
        used={
            "--target": ("{other}", {"photos", "film", "corners", "point"}),
            "--board": ("8x5", {"board"}),
            "--square": ("2in", {"board"}),
            "--correspondences": ("{pairs}", {"pairs"}),
            "--size": ("640x480", {"corners", "pairs", "point"}),
            "--noise": ("1.5", {"pairs"}),
            "--output": ("{out}/d", FITS),
            "--title": ("left", FITS),
            "--refine-target": ("shape", FITS - {"pairs", "point"}),
            "--goal": ("0.0001", FITS - {"point"}),
            "--hold-out": (None, FITS),
            "--lift": ("point", FITS),
            "--most": ("2", SEARCHED),
            "--exclude": ("*2*", FITS),
            "--no-report": (None, FITS),
            "--max-rms": ("0.0001", FITS),
            "--overwrite": (None, FITS),
            "--json": (None, FITS),
            "--jobs": ("1", SEARCHED),
            "--no-cache": (None, SEARCHED),
        },
    ),
    "evaluate": Case(
        lines={
            "photos": "{photos} -t {target} -m {camera}",
            "corners": "{corners} -t {target} -m {camera}",
            "pairs": "{pairs} -m {camera}",
        },
        used={
            "--target": ("{other}", {"photos", "corners"}),
            "--board": ("8x5", set()),
            "--square": ("3cm", set()),
            "--model": ("{true}", {"photos", "corners", "pairs"}),
            "--size": ("640x480", {"corners", "pairs"}),
            "--exclude": ("*2*", {"photos", "corners", "pairs"}),
            "--max-rms": ("0.0001", {"photos", "corners", "pairs"}),
            "--json": (None, {"photos", "corners", "pairs"}),
            "--jobs": ("1", {"photos"}),
            "--no-cache": (None, {"photos"}),
        },
    ),
    "detect": Case(
        lines={"file": "{photos} -t {target} -o {out}/c.csv"},
        used={
            "--target": ("{flat}", {"file"}),
            "--board": ("8x5", set()),
            "--square": ("3cm", set()),
            "--output": ("{out}/d.csv", {"file"}),
            "--exclude": ("*2*", {"file"}),
            "--draw": ("{out}/seen", {"file"}),
            "--overwrite": (None, {"file"}),
            "--json": (None, {"file"}),
            "--jobs": ("1", {"file"}),
            "--scheduler": (NOBODY, {"file"}),
            "--no-cache": (None, {"file"}),
        },
    ),
    "transform": Case(
        lines={"camera": "{camera} -o {out}/t.yaml"},
        used={
            "--model": ("{true}", set()),
            "--output": ("{out}/u.yaml", {"camera"}),
            "--crop": ("10,20,640x480", {"camera"}),
            "--scale": ("0.5", {"camera"}),
            "--overwrite": (None, {"camera"}),
            "--json": (None, {"camera"}),
        },
    ),
    "frames": Case(
        lines={"film": "{film} -t {target} -o {out}/f", "blind": "{film} -o {out}/f"},
        used={
            "--target": ("{other}", {"film", "blind"}),
            "--board": ("8x5", set()),
            "--square": ("3cm", set()),
            "--output": ("{out}/g", {"film", "blind"}),
            "--most": ("2", {"film", "blind"}),
            "--overwrite": (None, {"film", "blind"}),
            "--json": (None, {"film", "blind"}),
            "--jobs": ("1", {"film", "blind"}),
            "--no-cache": (None, {"film", "blind"}),
        },
    ),
    "simulate": Case(
        lines={
            "camera": "-t {flat} -m {small} -n 1 -o {out}/s",
            "poses": "-t {flat} -m {small} --poses {poses} -o {out}/s",
        },
        used={
            "--target": ("{wider}", {"camera", "poses"}),
            "--model": ("{true}", {"camera", "poses"}),
            "--number": ("2", {"camera"}),
            "--output": ("{out}/t", {"camera", "poses"}),
            "--poses": ("{poses}", {"poses"}),
            **{
                option: (value, {"camera", "poses"})
                for option, value in {
                    "--noise": "9",
                    "--blur": "3",
                    "--vignetting": "0",
                    "--exposure": "2",
                    "--seed": "5",
                    "--format": "png",
                    "--overwrite": None,
                    "--json": None,
                }.items()
            },
        },
    ),
    "advise": Case(
        lines={
            "folder": "{camera} --goal 0.0005",
            "model": "-m {camera} --goal 0.0005",
            "drawn": "{camera} --goal 0.0005 -o {out}/a.svg",
        },
        used={
            "--model": ("{true}", {"model"}),
            "--target": ("{flat}", {"folder", "model", "drawn"}),
            "--corners": ("{few}", {"folder", "model", "drawn"}),
            "--output": ("{out}/b.svg", {"folder", "model", "drawn"}),
            "--goal": ("0.2", {"folder", "model", "drawn"}),
            "--overwrite": (None, {"drawn"}),
            "--json": (None, {"folder", "model", "drawn"}),
        },
    ),
    "target check": Case(
        lines={"alone": "{target}", "drawn": "{target} --draw {out}/a.svg"},
        used={
            "--draw": ("{out}/b.svg", {"alone", "drawn"}),
            "--overwrite": (None, {"drawn"}),
            "--json": (None, {"alone", "drawn"}),
        },
    ),
    "target print": Case(
        lines={
            "old": "{target} --paper A3 -o {out}/p",
            "new": "--object board -o {out}/p",
            "charuco": "--object board --type charuco -o {out}/p",
        },
        used={
            "--object": ("corner", {"new", "charuco"}),
            "--paper": ("A2", {"old", "new", "charuco"}),
            "--type": ("aprilgrid", {"new", "charuco"}),
            "--square": ("11mm", {"new", "charuco"}),
            "--corners": ("3x4", {"new", "charuco"}),
            "--dictionary": ("DICT_5X5_1000", {"charuco"}),
            "--margin": ("15mm", {"old", "new", "charuco"}),
            "--output": ("{out}/q", {"old", "new", "charuco"}),
            "--overwrite": (None, {"old", "new", "charuco"}),
            "--json": (None, {"old", "new", "charuco"}),
        },
    ),
    "corners": Case(
        lines={"vnl": "{vnl} -t {flat} --size 960x720 -o {out}/c.csv"},
        used={
            "--target": ("{wider}", {"vnl"}),
            "--output": ("{out}/d.csv", {"vnl"}),
            "--size": ("1000x720", {"vnl"}),
            "--board": ("none", {"vnl"}),
            "--only": ("b*", {"vnl"}),
            "--overwrite": (None, {"vnl"}),
            "--json": (None, {"vnl"}),
        },
    ),
    "import": Case(
        lines={"one": "{lens} -o {out}/c.yaml", "several": "{chain} -o {out}/c.yaml"},
        used={
            "--from": ("opencv", {"one", "several"}),
            "--camera": ("cam7", {"several"}),
            "--size": ("640x480", {"one", "several"}),
            "--lens": ("fisheye", set()),  # only of four coefficients: test_camera_keys.py
            "--max-angle": ("50", {"one", "several"}),
            "--output": ("{out}/d.yaml", {"one", "several"}),
            "--overwrite": (None, {"one", "several"}),
            "--json": (None, {"one", "several"}),
        },
    ),
    "export": Case(
        lines={
            "lens": "{camera} --to opencv -o {out}/c.yaml",
            "maps": "{camera} --to maps -o {out}/m.npz",
            "source": "{camera} --to c -o {out}/c.h",
            "table": "{camera} --compare",
        },
        used={
            "--model": ("{small}", set()),
            "--to": ("ros", {"lens", "maps", "source"}),
            "--compare": (None, set()),
            "--distance": ("far", {"lens", "table"}),
            "--name": ("left", {"source"}),
            "--output": ("{out}/d.npz", {"lens", "maps", "source"}),
            "--max-error": ("1e-9", {"lens"}),
            "--max-angle": ("40", {"lens", "table"}),
            "--overwrite": (None, {"lens", "maps", "source"}),
            "--json": (None, {"lens", "maps", "source", "table"}),
        },
    ),
    "compare": Case(
        lines={"alone": "{camera} {true}", "drawn": "{camera} {true} --picture {out}/d.png"},
        used={
            "--picture": ("{out}/e.png", {"alone", "drawn"}),
            "--max-rms": ("1e-9", {"alone", "drawn"}),
            "--overwrite": (None, {"drawn"}),
            "--json": (None, {"alone", "drawn"}),
        },
    ),
    "info": Case(
        lines={"folder": "{camera}"},
        used={"--model": ("{small}", set()), "--json": (None, {"folder"})},
    ),
    "project": Case(
        lines={"rays": "0.4,0.1,5 -m {near}", "point": "100,60,0 -m {point}"},
        used={"--model": ("{true}", {"rays", "point"}), "--near": (None, {"rays"})},
    ),
    "unproject": Case(
        lines={"rays": "500,300 -m {camera}"}, used={"--model": ("{true}", {"rays"})}
    ),
    "report": Case(
        lines={"drawn": "{camera} -o {out}/p.html"},
        used={
            "--model": ("{small}", set()),
            "--target": ("{other}", {"drawn"}),
            "--photos": ("{nothing}", {"drawn"}),
            "--output": ("{out}/q.html", {"drawn"}),
            "--overwrite": (None, {"drawn"}),
            "--json": (None, {"drawn"}),
        },
    ),
    "rig calibrate": Case(
        lines={
            "tables": "{left} {right} -t {target} -o {out}/r --no-report",
            "timed": "{left} {right} -t {target} -o {out}/r --times {times} --no-report",
            "lens": "{left} {right} -t {target} -o {out}/r --lens left={camera} --no-report",
            "held": "{left} {camera} -t {target} -o {out}/r --lens left={camera} --no-report",
            "photos": "{cameras}/left {cameras}/right -t {target} -o {out}/r --no-report",
            "films": "{cameras}/left.avi {cameras}/right.avi -t {target} -o {out}/r --no-report",
        },
        used={
            "--target": ("{other}", RIGS),
            "--board": ("8x5", set()),
            "--square": ("3cm", set()),
            "--output": ("{out}/q", RIGS),
            "--names": ("left,other", RIGS),
            "--lens": ("left={true}", RIGS),
            "--shots": ("{shots}", RIGS - {"films"}),
            "--times": ("{pairs}", RIGS - {"films"}),
            "--tolerance": ("5ms", RIGS),
            "--most": ("1", {"films"}),
            "--hold-lenses": (None, RIGS - {"held"}),
            "--refine-target": ("shape", RIGS - {"held"}),
            "--report": (None, RIGS),
            "--max-rms": ("0.0001", RIGS),
            "--overwrite": (None, RIGS),
            "--json": (None, RIGS),
            "--jobs": ("1", {"photos", "films"}),
            "--no-cache": (None, {"photos", "films"}),
        },
    ),
    "rig evaluate": Case(
        lines={
            "tables": "{rig} {left} {right} -t {target}",
            "photos": "{rig} {cameras}/left {cameras}/right -t {target}",
        },
        used={
            "--target": ("{other}", {"tables", "photos"}),
            "--board": ("8x5", set()),
            "--square": ("3cm", set()),
            "--times": ("{pairs}", {"tables", "photos"}),
            "--max-rms": ("0.0001", {"tables", "photos"}),
            "--json": (None, {"tables", "photos"}),
            "--jobs": ("1", {"photos"}),
            "--no-cache": (None, {"photos"}),
        },
    ),
    "rig report": Case(
        lines={"drawn": "{rig} -o {out}/p.html"},
        used={
            "--output": ("{out}/q.html", {"drawn"}),
            "--overwrite": (None, {"drawn"}),
            "--json": (None, {"drawn"}),
        },
    ),
    "rig info": Case(lines={"rig": "{rig}"}, used={"--json": (None, {"rig"})}),
    "rig compare": Case(lines={"rigs": "{rig} {rig}"}, used={"--json": (None, {"rigs"})}),
    "rig export": Case(
        lines={"rig": "{rig} --to kalibr-omni --max-error 9 -o {out}/x.yaml"},
        used={
            "--to": ("anipose", {"rig"}),
            "--output": ("{out}/y.yaml", {"rig"}),
            "--max-error": ("1e-9", {"rig"}),
            "--max-angle": ("40", {"rig"}),
            "--pair": ("right,left", {"rig"}),
            "--overwrite": (None, {"rig"}),
            "--json": (None, {"rig"}),
        },
    ),
}


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, which works out once what it is asked again and again."""
    known: dict[bytes, tuple[Any, Exception | None]] = {}

    def call(*given: Any, **options: Any) -> Any:
        heard = {"diagnose", "progress", "listener"}
        options = {name: value for name, value in options.items() if name not in heard}
        key = pickle.dumps((given, options))
        if key not in known:
            try:
                known[key] = function(*given, **options), None
            except CubicfishError as error:
                known[key] = None, error
        answer, error = known[key]
        if error is not None:
            raise error
        return answer

    return call


@pytest.fixture(scope="module", autouse=True)
def worked_out_once() -> Iterator[None]:
    """What most options do not change is worked out once: corners, their names, fits, poses."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "calibrate", once(fit.calibrate))
        patch.setattr(alone, "calibrate", once(alone.calibrate))
        patch.setattr(cubicfish, "calibrate_rig", once(cubicfish.calibrate_rig))
        patch.setattr(cubicfish, "evaluate_rig", once(cubicfish.evaluate_rig))
        patch.setattr(exporting, "to_lens", once(exporting.to_lens))
        patch.setattr(cubicfish.fit, "calibrate_points", once(cubicfish.fit.calibrate_points))
        patch.setattr(simulate, "chosen_poses", once(simulate.chosen_poses))
        patch.setattr(detection, "name_grids", once(detection.name_grids))
        patch.setattr(detection, "predicted_corners", once(detection.predicted_corners))
        patch.setattr(Prediction, "seen_in", once(Prediction.seen_in))
        patch.setattr(glances, "quick_detect", once(glances.quick_detect))
        patch.setattr(glances, "quick_detect_near", once(glances.quick_detect_near))
        patch.setattr(glances, "name_grids", once(glances.name_grids))
        yield


@pytest.fixture(scope="module")
def sources(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What the names in braces are."""
    folder = tmp_path_factory.mktemp("sources")
    made = {"target": TARGET, "corners": folder / "corners.csv", "camera": calibrated}
    made |= {"true": SAMPLE / "true_camera.yaml", "photos": folder / "photos"}
    made["photos"].mkdir()
    lines = ALL_CORNERS.read_text().splitlines(keepends=True)
    own = [line for line in lines[2:] if line < "corner_06"]  # of the first five photos
    made["corners"].write_text("".join([*lines[:2], *own]))
    for photo in PHOTOS[:3]:  # more would be shared out to other processes
        shutil.copy(photo, made["photos"])
    write_film(folder / "f.avi", 10)
    texts = {
        "other": ("other.yaml", TARGET.read_text().replace("units: mm", "units: cm")),
        "few": ("few.csv", "".join(lines[:200])),
        "flat": ("flat.yaml", _board(9)),
        "wider": ("wider.yaml", _board(10)),
        "vnl": (
            "c.vnl",
            "# filename x y\n"
            + "".join(
                f"{photo}.png {50 * (n % 9) + 9} {40 * (n // 9) + 8}\n"
                for photo in "ab"
                for n in range(54)
            ),
        ),
    }
    for name, (file, text) in texts.items():
        (folder / file).write_text(text)
        made[name] = folder / file
    made["pairs"] = folder / "pairs.csv"
    write_pairs(made["pairs"], load_corners(made["corners"], Target.load(TARGET)).by_photo())
    camera = load_camera(calibrated / "camera.yaml").camera
    made["near"] = folder / "near.yaml"
    save_camera(made["near"], replace(camera, pupil_travel=0.05))
    made["small"] = folder / "small.yaml"
    save_camera(made["small"], camera.for_photos((480, 360)))
    made["chain"] = folder / "k.yaml"
    run_cli("export", made["small"], "--to", "kalibr-omni", "-o", made["chain"])
    made["lens"] = folder / "c.cameramodel"
    made["lens"].write_text(MRCAL)
    made["poses"] = folder / "poses.csv"
    made["poses"].write_text("image,rx,ry,rz,tx,ty,tz\na.jpg,0,0,0,-100,-60,250\n")
    line = ("calibrate", made["corners"], "-t", TARGET, "--lift", "point", "--no-hold-out")
    run_cli(*line, "-o", folder / "point")
    made |= rig_sources(made, calibrated, folder / "rigs")
    return {**made, "film": folder / "f.avi", "point": folder / "point"}


def write_film(path: Path, rate: int, aside: int = 0) -> None:
    """Nine frames, so many a second."""
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), rate, (960, 720))
    for photo in PHOTOS[:3]:
        for _ in range(3):
            film.write(np.roll(cv2.imread(str(photo)), aside, axis=1))
    film.release()


def rig_sources(made: dict[str, Path], calibrated: Path, folder: Path) -> dict[str, Path]:
    """Two cameras that see the same, a little aside, and what says of their shots.

    They are there as tables, photos and films.
    """
    found = {name: folder / name for name in ("cameras", "nothing")}
    for name, aside in (("left", 2), ("right", 4)):
        (folder / "cameras" / name).mkdir(parents=True)
        for photo in made["photos"].iterdir():
            picture = np.roll(cv2.imread(str(photo)), aside, axis=1)
            cv2.imwrite(str(folder / "cameras" / name / photo.name), picture)
        found[name] = folder / f"{name}.csv"
        corners = load_corners(made["corners"], Target.load(TARGET))
        save_corners(found[name], replace(corners, pixel=corners.pixel + np.array([aside, 0])))
    write_film(folder / "cameras" / "left.avi", 10, aside=2)
    write_film(folder / "cameras" / "right.avi", 9, aside=4)
    photos = sorted({line.split(",")[0] for line in made["corners"].read_text().splitlines()[2:]})
    both = [(photo, camera) for photo in photos for camera in ("left", "right")]
    found["shots"], found["times"] = folder / "shots.csv", folder / "times.csv"
    rows = [f"{photo},{camera},{photo}" for photo, camera in both[:-2]]
    found["shots"].write_text("\n".join(["shot,camera,image", *rows]))
    rows = [f"{camera},{photo},{photos.index(photo)}" for photo, camera in both]
    found["times"].write_text("\n".join(["camera,image,seconds", *rows]))
    return {**found, "rig": made_rig(calibrated, folder / "rig", 2)}


def _board(columns: int) -> str:
    return (
        "units: mm\nboards:\n"
        f"  - {{name: one, type: checkerboard, corners: [{columns}, 6], square: 25}}\n"
    )


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all these commands run, so that what comes of them can be compared."""
    return tmp_path_factory.mktemp("place")


@pytest.fixture(scope="module")
def without() -> dict[str, Any]:
    """What comes of the lines of modes, which every option of a mode is held against."""
    return {}


def outcome(line: list[str], out: Path) -> Any:
    """All that comes of a command but what files say of the command line."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    done = invoke_cli(*line)
    assert done.exit_code in (0, 1, 3), done.output
    files = {}
    for path in sorted(one for one in out.rglob("*") if one.is_file()):
        files[path] = path.read_bytes()
        if path.name.endswith((".yaml", ".csv")) and b"made_by" in files[path]:
            record = yaml.safe_load(files[path])
            for key in ("command", "options", "date"):
                record["made_by"].pop(key, None)
            files[path] = json.dumps(record).encode()
    return done.exit_code, done.output, done.stderr, files


def is_seen(line: list[str], option: str, out: Path, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether an option that changes no result is seen to do what it says."""
    if option == "--json":
        return bool(json.loads(run_cli(*line, option).stdout))
    if option == "--scheduler":
        monkeypatch.setattr(cluster, "_CONNECT_S", 0.2)
        return "127.0.0.1:9" in run_cli(*line, option, NOBODY, code=1).stderr
    if option == "--overwrite":
        run_cli(*line)
        assert "exists already" in run_cli(*line, code=1).stderr.replace("\n", " ")
        run_cli(*line, option)
        return True
    cache = out / "cache"
    monkeypatch.setenv("CUBICFISH_CACHE", str(cache))
    if option == "--no-cache":
        run_cli(*line, option)
        return not cache.exists()
    jobs: list[int | None] = []
    real = pool.Work

    def work(**how: Any) -> pool.Work:
        jobs.append(how["jobs"])
        return real(**how)

    monkeypatch.setattr(pool, "Work", work)
    run_cli(*line, option, 1)
    return set(jobs) == {1}


CELLS = [
    pytest.param(
        name,
        mode,
        option,
        id=f"{name} {mode} {option}",
        marks=pytest.mark.slow if mode in used[1] and name not in QUICK else (),
    )
    for name, case in CASES.items()
    for mode in case.lines
    for option, used in case.used.items()
]


@pytest.mark.parametrize(("name", "mode", "option"), CELLS)
def test_an_option_is_used_or_refused(
    request: pytest.FixtureRequest,
    sources: dict[str, Path],
    place: Path,
    without: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    mode: str,
    option: str,
) -> None:
    if mode in ("film", "films", "blind"):
        pytest.importorskip("av")
    if name == "target print" or mode == "drawn":
        pytest.importorskip("matplotlib")
    if "report" in name or option == "--report":
        request.getfixturevalue("with_report")
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    monkeypatch.setattr(advise, "_VIEWS", 20)
    monkeypatch.chdir(place)
    out = place / "out"
    shutil.rmtree(out, ignore_errors=True)
    value, modes = CASES[name].used[option]
    line = f"{name} {CASES[name].lines[mode]}".format(out=out, **sources).split()
    more = [option, *([] if value is None else [value.format(out=out, **sources)])]
    if option in line and (value is None or option in ("--lift", "--correspondences", "--poses")):
        return  # it is what makes the mode
    if mode not in modes:
        said = run_cli(*line, *more, code=2).stderr
        assert option in said.partition("Error:")[2]
        assert not out.exists()
    elif option in ("--json", "--scheduler", "--overwrite", "--no-cache", "--jobs"):
        assert is_seen(line, option, out, monkeypatch)
    else:
        plain = " ".join(line)
        if plain not in without:
            without[plain] = outcome(line, out)
            assert without[plain] == outcome(line, out)  # or any option would seem to be used
        assert without[plain] != outcome([*line, *more], out)


def test_the_tables_have_all_options() -> None:
    every = {" ".join(words[1:]): command for words, command in commands()}
    known = {name: one for name, one in every.items() if not isinstance(one, click.Group)}
    assert known.keys() == CASES.keys() | PICTURES | UNENDING
    for name, case in CASES.items():
        options = (one for one in known[name].params if isinstance(one, click.Option))
        words = {word for one in options for word in one.opts if word.startswith("--")}
        table = {"--report" if word == "--no-report" else word for word in case.used}
        assert words - COMMON == table - COMMON


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{corners} -t {target} --no-hold-out --refine-target auto", "--no-hold-out"),
        ("{pairs} --board 9x6 --square 25mm", "--board"),
        ("{pairs} -t {target}", "--target"),
    ],
)
def test_what_does_not_go_together_is_refused(
    sources: dict[str, Path], tmp_path: Path, line: str, said: str
) -> None:
    words = line.format(**sources).split()
    assert said in run_cli("calibrate", *words, "-o", tmp_path / "c", code=2).stderr
    assert not (tmp_path / "c").exists()


def test_a_length_without_a_unit_is_said_to_be_in_millimetres(
    sources: dict[str, Path], tmp_path: Path
) -> None:
    line = ("calibrate", sources["corners"], "--board", "9x6", "-o", tmp_path / "c", "--square")
    assert "24.23 has no unit" in run_cli(*line, "24.23", code=1).stderr
    assert "has no unit" not in run_cli(*line, "24.23mm", code=1).stderr


@pytest.mark.slow
def test_quiet_prints_results_alone(sources: dict[str, Path], tmp_path: Path) -> None:
    line = ("simulate", "-t", TARGET, "-m", sources["camera"], "-n", 1, "-o", tmp_path / "s", "-q")
    said = run_cli(*line)
    assert said.stderr == ""
    assert "Next" not in said.stdout
