"""Photos, films or tables of several cameras on one body -> the rig's folder, and a rig judged."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from glob import has_magic
from pathlib import Path
from typing import Any

from cubicfish_cli.assess.verdict import Verdict, rig_verdict
from cubicfish_cli.errors import CorrespondenceError, UsageError
from cubicfish_cli.files import fingerprint, refuse_existing
from cubicfish_cli.films import MOST
from cubicfish_cli.films.recordings import is_recording, label_of
from cubicfish_cli.films.scan import room_for_frames
from cubicfish_cli.fitting.climb import RefineTarget
from cubicfish_cli.fitting.rig.calibrate import RigCalibration
from cubicfish_cli.fitting.rig.evaluate import RigEvaluation
from cubicfish_cli.formats.camera_yaml import CameraFile, load_camera
from cubicfish_cli.formats.rig_yaml import load_rig
from cubicfish_cli.library.asked import (
    RUN,
    Run,
    StrPath,
    TargetSource,
    in_folder,
    made_at,
    made_by_record,
    paths_of,
)
from cubicfish_cli.library.inputs import Inputs, films_among, load_inputs
from cubicfish_cli.library.report_files import PAGE, write_rig_page
from cubicfish_cli.library.rig_films import RigFrames, rig_frames
from cubicfish_cli.library.rigs import (
    TOLERANCE,
    calibrate_rig,
    evaluate_rig,
    load_shots,
    rig_record,
    save_rig,
)
from cubicfish_cli.picture_headers import VIDEO_SUFFIXES
from cubicfish_cli.printing import extra
from cubicfish_cli.target import Target
from cubicfish_cli.wording import quoted
from cubicfish_cli.words.codes import Event


@dataclass(frozen=True, kw_only=True, eq=False)
class RigFiles:
    """What became of :func:`calibrate_rig_files`.

    Attributes:
        rig: the rig.
        record: the same as plain data, as rig.yaml has it.
        verdict: what it is worth.
        files: what was written, rig.yaml first.

    """

    rig: RigCalibration
    record: dict[str, Any]
    verdict: Verdict
    files: list[Path]

    def as_record(self) -> dict[str, Any]:
        """Plain data: what ``cubicfish rig --json`` prints."""
        return {
            **self.record,
            "model": str(self.files[0]),
            "verdict": self.verdict.as_record(),
        }


def calibrate_rig_files(
    cameras: Mapping[str, StrPath] | Sequence[StrPath],
    target: TargetSource | Target | StrPath | None = None,
    folder: StrPath = "rig",
    *,
    names: Sequence[str] | None = None,
    lenses: Mapping[str, CameraFile | StrPath] | None = None,
    shots: StrPath | None = None,
    tolerance: float | None = None,
    most: int = MOST,
    hold_lenses: bool = False,
    refine_target: RefineTarget = "auto",
    report: bool = True,
    command: str | None = None,
    run: Run = RUN,
) -> RigFiles:
    """Calibrate several cameras on one body from files into a folder, as ``cubicfish rig`` does.

    Args:
        cameras: of each camera, by name or not, a folder of photos, a film, a corners.csv, or the
            folder of its calibration, whose lens stays as it is.
        target: the calibration target, or its file.
        folder: where rig.yaml goes, and each camera's camera.yaml in a folder of its name.
        names: of cameras without; by default those of their folders or files.
        lenses: by name, cameras that are calibrated already, or their files.
        shots: a table that says which photos are of one shot, or when each was taken.
        tolerance: how far apart photos of a shot may be, seconds; by default 5 ms, and half a frame
            of films.
        most: how many moments of films are chosen at most.
        hold_lenses: leaves the lenses as each camera alone has them.
        refine_target: as in :func:`calibrate`.
        report: also writes report.html, where the extra ``report`` is installed.
        command: what is run, for the record.
        run: how the work is done.

    Raises:
        UsageError: what is asked does not go together.
        CubicfishError: an input cannot be used, a file exists and may not be replaced, or no rig
            can be fitted.

    """
    source = TargetSource.of(target)
    if isinstance(cameras, Mapping):
        names, cameras = list(cameras), list(cameras.values())
    inputs = paths_of(cameras)
    if len(inputs) < 2:
        raise UsageError("name two cameras or more: a folder of photos each, or a corners.csv")
    source.check()
    called = _names(inputs, names)
    films = films_among(inputs)
    if films and (len(films) < len(inputs) or shots is not None):
        raise UsageError(
            f"{quoted(str(films[0]))} is a film: films are matched by time, and with films alone"
            " (without --shots); of some calibrated cameras say --lens"
            if len(films) == len(inputs)
            else f"{quoted(str(films[0]))} is a film, and other cameras have none: give a film of "
            "each camera, or take its frames with 'cubicfish frames'"
        )
    made_at()  # said before the work if it cannot be
    place, listener = Path(folder), run.listener
    pages = [place / PAGE] if report and not extra.missing(extra.REPORT) else []
    own_files = [place / name / "camera.yaml" for name in called]
    refuse_existing(place / "rig.yaml", *pages, *own_files, overwrite=run.overwrite)
    known = _known(lenses or {}, called)
    frames, loaded, moving = None, {}, None
    with room_for_frames(place / "frames") as room:
        if films:
            frames = rig_frames(
                dict(zip(called, inputs, strict=True)),
                place / "frames",
                room,
                source.load(),
                run,
                most=most,
                tolerance=tolerance,
            )
        for name, path in zip(called, inputs, strict=True):
            listener.tell(Event.CAMERA, name=name, path=path)
            sources = [path] if frames is None else frames.photos[name]
            loaded[name], camera = _loaded(sources, source, run)
            if camera is not None:
                known.setdefault(name, camera)
        if frames is not None:
            moving = {
                name: frames.moving(name, own.pairs, listener) for name, own in loaded.items()
            }
    matched, by = _matching(shots, tolerance, frames)
    one = loaded[called[0]]
    rig = calibrate_rig(
        {name: own.given for name, own in loaded.items()},
        one.pairs.target,
        **matched,
        moving=moving,
        known=known,
        hold_lenses=hold_lenses,
        refine_target=refine_target,
        listener=listener,
    )
    files = [file for own in loaded.values() for file in own.files]
    asked = {"hold_lenses": hold_lenses, "refine_target": refine_target, "shots": by}
    made_by = made_by_record(command, asked, one.target_file, files)
    listener.progress("Writing")
    written = save_rig(place, rig, made_by=made_by, overwrite=run.overwrite)
    if frames is not None:
        frames.tell_clocks({one.name: one.late_s for one in rig.cameras}, listener)
    record = rig_record(rig)
    for page in pages:
        write_rig_page(written[0], page, run)
    return RigFiles(rig=rig, record=record, verdict=rig_verdict(record), files=[*written, *pages])


def evaluate_rig_files(
    rig: StrPath,
    cameras: Sequence[StrPath],
    target: TargetSource | Target | StrPath | None = None,
    *,
    run: Run = RUN,
) -> RigEvaluation:
    """Measure a rig on files of its cameras, as ``cubicfish evaluate`` does.

    Args:
        rig: its rig.yaml, or the folder of that.
        cameras: photos or a corners.csv of each camera, in the rig's order or called as they are.
        target: the calibration target, or its file.
        run: how the work is done.

    Raises:
        UsageError: it is not known which camera an input is of.
        CubicfishError: an input cannot be used, or no shot can be placed.

    """
    known, inputs = load_rig(Path(rig)), paths_of(cameras)
    names = [one.name for one in known.cameras]
    own = [named_by(one.absolute()) for one in inputs]
    if not set(own) <= set(names):
        if len(inputs) != len(names):
            raise UsageError(
                f"the rig has the cameras {', '.join(names)}: name photos of each in this order, "
                "or folders that are called as they are"
            )
        own = names
    if len(set(own)) < max(2, len(own)):
        raise UsageError(
            f"name photos or a corners.csv of two or more of the cameras {', '.join(names)}"
        )
    source = TargetSource.of(target)
    loaded = {name: _loaded([one], source, run)[0] for name, one in zip(own, inputs, strict=True)}
    run.listener.progress("Placing shots")
    pairs = {name: one.given for name, one in loaded.items()}
    return evaluate_rig(known, pairs, loaded[own[0]].pairs.target)


def _names(inputs: Sequence[Path], given: Sequence[str] | None) -> list[str]:
    """What the cameras are called."""
    if given is not None:
        names = [name.strip() for name in given]
        if len(names) != len(inputs):
            raise UsageError(f"--names has {len(names)} names for {len(inputs)} cameras")
    else:
        names = []
        for path in inputs:
            own = path.absolute()
            own = own.parent if own.name in ("corners.csv", "camera.yaml") else own
            names.append(named_by(own))
    if len(set(names)) < len(names) or not all(names):
        raise UsageError(
            f"the cameras would be called {', '.join(names)}: give each a name of its own with "
            "--names"
        )
    return names


def _known(
    lenses: Mapping[str, CameraFile | StrPath], called: Sequence[str]
) -> dict[str, CameraFile]:
    """Cameras that are calibrated already, by name."""
    known = {}
    for name, one in lenses.items():
        if name not in called:
            given = quoted(f"{name}={one}" if isinstance(one, Path) else name)
            raise UsageError(
                f"--lens {given} names no camera: write NAME=FILE with one of {', '.join(called)}"
            )
        known[name] = one if isinstance(one, CameraFile) else load_camera(in_folder(Path(one)))
    return known


def named_by(path: Path) -> str:
    """What a camera is called by where its photos are."""
    if is_recording(path):
        return label_of(path)
    if has_magic(path.name) and not path.exists():  # left*.png, or left/*.png
        begin = re.split(r"[*?[]", path.name)[0].rstrip("_-. ")
        return begin or path.parent.name
    suffix = path.suffix.lower()
    return path.stem if suffix == ".csv" or suffix in VIDEO_SUFFIXES else path.name


def _loaded(
    sources: Sequence[Path], target: TargetSource, run: Run
) -> tuple[Inputs, CameraFile | None]:
    """One camera's pairs, and its lens where it is calibrated already."""
    camera, path = None, sources[0] if sources else Path()
    model = path / "camera.yaml" if path.is_dir() else path
    if model.name.endswith((".yaml", ".yml")) and model.is_file():
        camera = load_camera(model)
        sources = [model.parent / "corners.csv"]
        if not sources[0].is_file():
            raise CorrespondenceError(
                f"{model.parent} has a camera.yaml and no corners.csv: calibrate it again, or name "
                "the camera's photos or its corners.csv"
            )
    loaded = load_inputs(sources, target, run)
    run.listener.found(loaded.photo_findings)
    if camera is not None:
        loaded = replace(loaded, files=(*loaded.files, fingerprint(model)))
    return loaded, camera


def _matching(
    shots: StrPath | None, tolerance: float | None, frames: RigFrames | None
) -> tuple[dict[str, Any], str]:
    """How photos are matched to shots: as ``calibrate_rig`` takes it, and in a word."""
    wanted: dict[str, Any] = {"tolerance": TOLERANCE if tolerance is None else tolerance}
    if frames is not None:
        return {**wanted, "shots": frames.shots}, "films"
    if shots is None:
        by = "name" if tolerance is None else "time"
        return {**wanted, "shots": by}, by
    rows, times = load_shots(Path(shots))
    if rows is not None and tolerance is not None:
        raise UsageError(f"{shots} says which photos are a shot: leave --tolerance out")
    return {**wanted, "shots": "time" if rows is None else rows, "times": times}, str(shots)
