"""undistort and map use every option that they are given, or refuse it: none is passed over.

One table says where each option is used. Everywhere else it must be wrong usage, and say which
option it is; where it is used, what is written must be another than without it.
"""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from running import Run
from samples import SAMPLE

from cubicfish.workers import cluster
from cubicfish_cli.commands import pictures
from cubicfish_cli.commands.map import command as map_command
from cubicfish_cli.commands.undistort import command as undistort_command
from cubicfish_cli.extensions.rigs.map import command as map_rig_command
from cubicfish_cli.extensions.rigs.undistort import command as undistort_rig_command
from tests.cubicfish_cli.extensions.rigs.test_export import made_rig

TARGET = SAMPLE / "target.yaml"
NAMES = [f"corner_{number:02d}.jpg" for number in (1, 2)]
NOBODY = "tcp://127.0.0.1:9"  # a port where nothing listens
COMMON = {"--help", "--verbose", "--quiet", "--debug", "--model"}
VIEWED = {"jpeg", "png", "many", "film", "rig"}
"""Modes with a view from the camera's place."""
PHOTO = {"jpeg", "png", "many", "cube", "plane"}

UNDISTORT: Mapping[str, tuple[object, set[str]]] = {
    "--view": ("stereographic", VIEWED),
    "--size": ("32x32", VIEWED | {"cube"}),
    "--hfov": ("50", VIEWED),
    "--scale": ("4", VIEWED | {"plane"}),
    "--fit": ("inner", VIEWED),
    "--rotate": ("0,12,0", VIEWED | {"cube"}),
    "--target": (TARGET, {"plane"}),
    "--distance": ("500", {"rig"}),
    "--interpolation": ("nearest", VIEWED | PHOTO),
    "--quality": ("35", {"jpeg", "many"}),
    "--crf": ("45", {"film"}),
    "--mask": ("mask.png", VIEWED | PHOTO),
    "--camera": ("camera", VIEWED | PHOTO),
    "--skip-existing": (None, VIEWED | PHOTO),
    "--overwrite": (None, VIEWED | PHOTO),
    "--json": (None, VIEWED | PHOTO),
    "--jobs": ("1", PHOTO | {"rig"}),
    "--scheduler": (NOBODY, PHOTO | {"rig"}),
}
"""Option -> a value that shows, and the modes that use it."""

MAPPED = {"npz", "png", "pgm", "exr", "back", "pair"}
MAP: Mapping[str, tuple[object, set[str]]] = {
    "--view": ("cylindrical", MAPPED),
    "--size": ("32x32", MAPPED | {"cube"}),
    "--hfov": ("50", MAPPED),
    "--scale": ("20", MAPPED),
    "--fit": ("inner", MAPPED),
    "--rotate": ("0,12,0", MAPPED | {"cube"}),
    "--photo-size": ("480x360", MAPPED | {"cube"}),
    "--redistort": (None, {"npz", "png", "pgm", "exr", "cube"}),
    "--pair": ("right,left", {"pair"}),
    "--overwrite": (None, MAPPED | {"cube"}),
    "--json": (None, MAPPED | {"cube"}),
}


@pytest.fixture(scope="module")
def sources(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A camera, small photos of it, a rig with a shot, and a film."""
    folder = tmp_path_factory.mktemp("sources")
    rig = made_rig(calibrated, folder / "rig", 2)
    for name, photo in zip(("left", "right"), NAMES, strict=True):
        picture = cv2.imread(str(SAMPLE / "photos" / photo))
        small = cv2.resize(picture, (320, 240), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / photo), small)
        (folder / "shots" / name).mkdir(parents=True)
        cv2.imwrite(str(folder / "shots" / name / "1.png"), small)
    film = folder / "film.mkv"
    av = pytest.importorskip("av")
    with av.open(str(film), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(small[..., ::-1]), format="rgb24")
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    made = {"camera": calibrated, "rig": rig, "shots": folder / "shots", "film": film}
    return {**made, **{name: folder / name for name in NAMES}}


SHOWN_OTHERWISE = {
    "--json", "--scheduler", "--jobs", "--overwrite", "--skip-existing", "--photo-size"
}  # fmt: skip


def undistort_line(mode: str, sources: Mapping[str, Path], out: Path) -> list[object]:
    """The command of a mode, which writes below ``out``."""
    flat: list[object] = ["--size", "48x36"]
    one = ["-m", sources["camera"]]
    photo, other = (sources[name] for name in NAMES)
    line: dict[str, list[object]] = {
        "jpeg": [photo, out / "a.jpg", *one, *flat],
        "png": [photo, out / "a.png", *one, *flat],
        "many": [photo, other, out / "many", *one, *flat],
        "film": [sources["film"], out / "a.mp4", *one, *flat],
        "rig": [sources["shots"], out / "rig", "-m", sources["rig"], "--size", "60x30"],
        "cube": [photo, out / "a.png", *one, "--view", "cube", "--size", "16x16"],
        "plane": [photo, out / "a.png", *one, "--view", "plane:floor"],
    }
    return [*(["rig"] if mode == "rig" else []), "undistort", *line[mode]]


def map_line(mode: str, sources: Mapping[str, Path], out: Path) -> list[object]:
    """The command of a mode, which writes below ``out``."""
    name = out / f"m.{mode if mode in ('png', 'pgm', 'exr') else 'npz'}"
    own: dict[str, list[object]] = {"cube": ["--view", "cube"], "back": ["--redistort"]}
    model = sources["rig" if mode == "pair" else "camera"]
    words = ["rig", "map"] if mode == "pair" else ["map"]
    return [*words, name, "-m", model, "--size", "24x24", *own.get(mode, [])]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all these commands run, so that what they write can be compared."""
    return tmp_path_factory.mktemp("place")


@pytest.fixture(scope="module")
def plain() -> dict[tuple[object, str], dict[str, bytes]]:
    """What the lines of modes write without any option."""
    return {}


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


Line = Callable[[str, Mapping[str, Path], Path], list[object]]


def shows(run: Run, line: list[object], out: Path, option: str, monkeypatch: Any) -> bool:
    """Whether an option that changes no pixel is seen to do what it says."""
    if option == "--json":
        return bool(json.loads(run(*line, option).stdout)["files"])
    if option == "--photo-size":  # the shares of an STMap are the same for all sizes
        return json.loads(run(*line, option, "480x360", "--json").stdout)["image_size"] == [
            480,
            360,
        ]
    if option == "--scheduler":
        monkeypatch.setattr(cluster, "_CONNECT_S", 0.2)
        return "127.0.0.1:9" in run(*line, option, NOBODY, code=1).stderr
    if option == "--jobs":
        seen: list[int] = []
        real = pictures.write_many

        def count(jobs: Any, write: Any, how: Any) -> Any:
            seen.append(how.jobs)
            return real(jobs, write, how)

        monkeypatch.setattr(pictures, "write_many", count)
        run(*line, option, 1)
        return seen == [1]
    run(*line)
    before = contents(out)
    assert "exists" in run(*line, code=1).stderr
    assert contents(out) == before
    run(*line, option)
    return contents(out) == before


QUICK = {(undistort_line, "png"), (map_line, "npz")}
CASES = [
    *((undistort_line, UNDISTORT, mode, option) for option in UNDISTORT
      for mode in sorted(VIEWED | PHOTO)),
    *((map_line, MAP, mode, option) for option in MAP for mode in sorted(MAPPED | {"cube"})),
]  # fmt: skip


@pytest.mark.parametrize(
    ("line_of", "table", "mode", "option"),
    [
        pytest.param(
            line,
            table,
            mode,
            option,
            id=f"{line.__name__.partition('_')[0]} {mode} {option}",
            marks=pytest.mark.slow
            if mode in table[option][1] and (line, mode) not in QUICK
            else (),
        )
        for line, table, mode, option in CASES
    ],
)
def test_an_option_is_used_or_refused(
    run: Run,
    sources: dict[str, Path],
    place: Path,
    plain: dict[tuple[object, str], dict[str, bytes]],
    monkeypatch: pytest.MonkeyPatch,
    line_of: Line,
    table: Mapping[str, tuple[object, set[str]]],
    mode: str,
    option: str,
) -> None:
    if mode == "exr":
        pytest.importorskip("OpenEXR")
    shutil.copy(TARGET, place / "target.yaml")  # which a plane takes unasked
    monkeypatch.chdir(place)
    value, used_in = table[option]
    out = place / "out"
    shutil.rmtree(out, ignore_errors=True)
    line = line_of(mode, sources, out)
    given = [option] if value is None else [option, value]
    if option in ("--mask", "--camera"):
        given = [option, out / str(value)]
    if option in line and (option == "--view" or value is None):
        return  # it is what makes the mode
    if mode not in used_in:
        said = run(*line, *given, code=2).stderr
        assert option in said.partition("Error:")[2]
        assert not out.exists()
        return
    if option in SHOWN_OTHERWISE:
        assert shows(run, line, out, option, monkeypatch)
        return
    if (line_of, mode) not in plain:
        run(*line)
        plain[line_of, mode] = contents(out)
        shutil.rmtree(out)
        run(*line)
        assert contents(out) == plain[line_of, mode]  # or any option would seem to be used
        shutil.rmtree(out)
    without = plain[line_of, mode]
    if option == "--target":
        (place / "target.yaml").unlink()  # the one that is named is read
        run(*line, *given)
        assert contents(out) == without != {}
        return
    run(*line, *given)
    assert contents(out) != without != {}


def test_the_tables_have_all_options() -> None:
    for both, table in (
        ((undistort_command, undistort_rig_command), UNDISTORT),
        ((map_command, map_rig_command), MAP),
    ):
        params = [one for command in both for one in command.params]
        words = {word for one in params for word in one.opts if word.startswith("--")}
        assert words - COMMON - {"--fov"} == {*table}
