"""What README.md and the pages of docs/ say works: commands parse, Python runs, files exist."""

import csv
import re
import shlex
import warnings
from dataclasses import fields
from pathlib import Path

import click
import cv2
import numpy as np
import pytest
import yaml
from running import run_cli
from samples import SAMPLE
from saved_maps import read_map

from cubicfish import Rig, Target, load_camera
from cubicfish.rigs.rig import RigFit
from cubicfish_cli.core_table import COMMANDS, commands_of
from cubicfish_cli.extension_guard import extension_commands
from cubicfish_cli.terminal.main import cli

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
# cli.md is made from the commands, and has a test of its own.
PAGES = sorted(path for path in (ROOT / "docs").rglob("*.md") if path.name != "cli.md")
ALL = {path: path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *PAGES)}


def blocks(language: str, text: str) -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [block for kind, block in found if kind == language]


def python_block(page: str, word: str) -> str:
    return next(text for text in blocks("python", ALL[ROOT / "docs" / page]) if word in text)


def command_lines(text: str) -> list[list[str]]:
    """Every use of cubicfish in the shell blocks, as its arguments."""
    lines = []
    for line in "\n".join(blocks("sh", text)).replace("\\\n", " ").splitlines():
        for part in re.split(r"&&|\|", line):
            words = shlex.split(part)
            if words and Path(words[0]).name == "cubicfish":
                lines.append(words[1:])
    return lines


@pytest.mark.parametrize("args", command_lines(TEXT), ids=" ".join)
def test_a_command_of_the_readme_parses(args: list[str]) -> None:
    group = click.Context(cli, info_name="cubicfish", **cli.context_settings)
    command = cli.get_command(group, args[0])
    assert command is not None
    command.make_context(args[0], args[1:], parent=group)


def test_the_figures_beside_other_tools_are_the_published_ones() -> None:
    """Of each tool its best model, by held-out median; what is least of a row is bold."""
    with (ROOT / "docs" / "benchmark.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    cameras = ("boofcv_chessboard", "stereopi_left", "derlunz_3d")

    def best(camera: str, *tools: str) -> list[tuple[float, float]]:
        """Of each of these the least held-out median of its models, and its seconds."""
        own = [row for row in rows if row["camera"] == camera and not row["problem"]]
        pairs = [(row["tool"], float(row["px_median"] or "inf"), row["seconds"]) for row in own]
        return [
            min((off, float(seconds)) for name, off, seconds in pairs if re.match(tool, name))
            for tool in tools
        ]

    def shown(start: str, columns: int) -> list[list[float]]:
        line = next(one for one in TEXT.splitlines() if one.startswith(f"| {start} |"))
        cells = [cell.split(" · ") for cell in line.split(" | ")[1 : 1 + columns]]
        reported = [[float(one.strip("*s ")) for one in cell] for cell in cells]
        for column, place in enumerate(zip(*cells, strict=True)):
            figures = [one[column] for one in reported]
            bold = [one.startswith("**") for one in place]
            assert bold == [one == min(figures) for one in figures]
        return np.transpose(reported).tolist()

    ours = "cubicfish$"
    for camera, start in zip(
        cameras,
        ("214° fisheye, 26 photos", "VGA fisheye, 20 photos", "GoPro in the dark, 24 photos"),
        strict=True,
    ):
        of = [off for off, _ in best(camera, ours, "OpenCV", "mrcal")]
        assert shown(start, 3)[0] == pytest.approx(of, abs=6e-4)
    of = [[off for off, _ in best(camera, "cubicfish, ", "OpenCV")] for camera in cameras]
    drawn = shown("the same, board taken as drawn", 2)
    assert np.ravel(drawn) == pytest.approx(np.ravel(of), abs=6e-4)
    seconds = [seconds for _, seconds in best(cameras[0], ours, "OpenCV", "mrcal")]
    assert shown("time of a fit of 26 photos", 3)[0] == pytest.approx(seconds, rel=0.1)


def test_every_command_is_shown_on_some_page() -> None:
    shown = {args[0] for text in ALL.values() for args in command_lines(text)}
    assert shown == {*commands_of(COMMANDS, ""), *extension_commands()}


@pytest.mark.parametrize("page", ALL, ids=lambda path: path.name)
def test_lines_to_paste_have_no_comments(page: Path) -> None:
    """zsh, the shell of macOS, takes them for arguments."""
    lines = "\n".join(blocks("sh", ALL[page])).splitlines()
    assert [line for line in lines if re.search(r"(^|\s)#", line)] == []


def test_the_readme_is_short() -> None:
    assert len(TEXT.splitlines()) <= 170


def test_every_page_is_on_the_site_and_can_be_reached() -> None:
    site = yaml.safe_load(re.sub(r"!!\S+", "", (ROOT / "mkdocs.yml").read_text(encoding="utf-8")))
    named = re.findall(r"[\w/-]+\.md", str(site["nav"]))
    assert sorted(ROOT / "docs" / name for name in named) == sorted([*PAGES, ROOT / "docs/cli.md"])


@pytest.mark.slow
def test_the_quick_start_works_as_pasted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sample_data").symlink_to(SAMPLE)
    monkeypatch.chdir(tmp_path)
    quick = TEXT.split("## Quick start")[1].split("\n## ")[0]
    commands = command_lines(quick)
    assert [args[0] for args in commands] == ["calibrate", "undistort"]
    for args in commands:
        run_cli(*args)
    flat = cv2.imread("flat.jpg")
    assert flat.shape == (720, 960, 3)
    assert 60 < flat.mean() < 200


def test_the_setup_is_two_commands_on_files_that_exist() -> None:
    after = TEXT.split("<!-- setup -->\n```sh\n")[1]
    commands = after.split("```")[0].splitlines()
    assert len(commands) == 2
    named = re.findall(r"sample_data/[\w./]+", commands[0])
    assert len(named) == 2
    assert all((ROOT / name).exists() for name in named)


@pytest.mark.parametrize("page", ALL, ids=lambda path: path.name)
def test_local_links_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", ALL[page])
    local = [link.replace("\n", " ") for link in links if "://" not in link]
    assert len(local) >= (20 if page == ROOT / "README.md" else 0)
    assert [link for link in local if not (page.parent / link).exists()] == []


def test_the_target_is_one_that_is_read(tmp_path: Path) -> None:
    path, targets = tmp_path / "target.yaml", []
    for text in blocks("yaml", ALL[ROOT / "docs" / "targets.md"]):
        path.write_text(text)
        targets.append(Target.load(path))
    target, charuco, tags = targets
    assert (charuco.boards[0].columns, tags.boards[0].columns) == (4, 12)
    sample = Target.load(SAMPLE / "target.yaml")
    for board, other in zip(target.boards, sample.boards, strict=False):
        corners = ([0, 1, 2], [0, 2, 1])
        np.testing.assert_allclose(board.world_points(*corners), other.world_points(*corners))


def test_the_reader_of_camera_yaml_projects_as_the_library_does(
    calibrated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = python_block("points.md", "def project")
    code = [line for line in text.splitlines() if line.strip()]
    assert len(code) <= 10
    monkeypatch.chdir(calibrated.parent)
    names: dict[str, object] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # the example leaves closing to Python
        exec(text, names)
    points = np.random.default_rng(3).normal(size=(300, 3)) * 40
    points[0] = [0, 0, 40]  # on the axis
    expected = load_camera(calibrated / "camera.yaml").camera.project(points)
    assert 30 < np.isnan(expected[:, 0]).sum() < 270
    np.testing.assert_allclose(names["project"](points), expected, atol=1e-9)  # type: ignore[operator]
    exec(python_block("points.md", "def near"), names)
    near = load_camera(calibrated / "camera.yaml").camera.project(points, near=True)
    moved = names["near"](points)  # type: ignore[operator]
    np.testing.assert_allclose(names["project"](moved), near, atol=1e-9)  # type: ignore[operator]
    assert np.nanmax(np.abs(near - expected)) > 1e-3


def test_the_rig_of_the_program_has_what_it_asks() -> None:
    text = re.search(r"rig = calibrate_rig.*?^save_rig", ALL[ROOT / "docs/rigs.md"], re.S | re.M)
    assert text
    options = re.findall(r"\brig\.(\w+)(?:\.(\w+))?", text[0])
    assert {one for one, _ in options} <= {one.name for one in fields(Rig)}
    assert {one for of, one in options if of == "fit"} <= {one.name for one in fields(RigFit)}


def test_the_map_is_all_that_opencv_needs(
    calibrated: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    photo = cv2.imread(str(SAMPLE / "photos" / "corner_01.jpg"))
    cv2.imwrite(str(tmp_path / "photo.png"), photo)
    (tmp_path / "calibration").symlink_to(calibrated)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        exec(python_block("undistort.md", "cv2.remap"), names)
    flat = names["flat"]
    assert isinstance(flat, np.ndarray)
    valid = read_map(calibrated / "undistort_map.npz").valid
    assert flat.shape == photo.shape
    assert flat[valid].mean() > 30
    assert not flat[~valid].any() or valid.all()


def test_the_camera_file_is_plain_yaml(calibrated: Path) -> None:
    data = yaml.safe_load((calibrated / "camera.yaml").read_text(encoding="utf-8"))
    assert np.array(data["P"], float).shape == (3, 20)
    assert np.linalg.norm(np.array(data["P"])) == pytest.approx(1)
