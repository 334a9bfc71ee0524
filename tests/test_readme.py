"""What README.md says works: its commands parse, its Python runs, its files exist."""

import re
import shlex
import warnings
from pathlib import Path

import click
import cv2
import numpy as np
import pytest
import yaml
from conftest import SAMPLE

from cubicfish_cli.cli.main import COMMANDS, cli
from cubicfish_cli.formats.camera_yaml import load_camera
from cubicfish_cli.target import load_target
from cubicfish_cli.undistortion.maps import load_map

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.DOTALL | re.MULTILINE)


def blocks(language: str) -> list[str]:
    return [text for kind, text in BLOCKS if kind == language]


def python_block(word: str) -> str:
    return next(text for text in blocks("python") if word in text)


def command_lines() -> list[list[str]]:
    """Every use of cubicfish in the shell blocks, as its arguments."""
    lines = []
    for line in "\n".join(blocks("sh")).splitlines():
        for part in re.split(r"&&|\|", line):
            words = shlex.split(part)
            if words and Path(words[0]).name == "cubicfish":
                lines.append(words[1:])
    return lines


@pytest.mark.parametrize("args", command_lines(), ids=" ".join)
def test_a_command_of_the_readme_parses(args: list[str]) -> None:
    group = click.Context(cli, info_name="cubicfish", **cli.context_settings)
    command = cli.get_command(group, args[0])
    assert command is not None
    command.make_context(args[0], args[1:], parent=group)


def test_every_command_is_in_the_readme() -> None:
    assert {args[0] for args in command_lines()} == set(COMMANDS)


def test_the_setup_is_two_commands_on_files_that_exist() -> None:
    after = TEXT.split("<!-- setup -->\n```sh\n")[1]
    commands = after.split("```")[0].splitlines()
    assert len(commands) == 2
    named = re.findall(r"sample_data/[\w./]+", commands[0])
    assert len(named) == 2
    assert all((ROOT / name).exists() for name in named)


def test_local_links_lead_somewhere() -> None:
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", TEXT) if "://" not in link]
    assert len(links) >= 4
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_the_target_is_one_that_is_read(tmp_path: Path) -> None:
    (text,) = blocks("yaml")
    path = tmp_path / "target.yaml"
    path.write_text(text)
    target = load_target(path)
    sample = load_target(SAMPLE / "target.yaml")
    for board, other in zip(target.boards, sample.boards, strict=False):
        corners = ([0, 1, 2], [0, 2, 1])
        np.testing.assert_allclose(board.world_points(*corners), other.world_points(*corners))


def test_the_reader_of_camera_yaml_projects_as_the_library_does(
    calibrated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = python_block("def project")
    code = [line for line in text.splitlines() if line.strip()]
    assert len(code) <= 10
    monkeypatch.chdir(calibrated.parent)
    names: dict[str, object] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)  # the example leaves closing to Python
        exec(text, names)
    points = np.random.default_rng(3).normal(size=(300, 3)) * 40
    expected = load_camera(calibrated / "camera.yaml").camera.project(points)
    assert 30 < np.isnan(expected[:, 0]).sum() < 270
    np.testing.assert_allclose(names["project"](points), expected, atol=1e-9)  # type: ignore[operator]


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
        exec(python_block("cv2.remap"), names)
    flat = names["flat"]
    assert isinstance(flat, np.ndarray)
    valid = load_map(calibrated / "undistort_map.npz").valid
    assert flat.shape == photo.shape
    assert flat[valid].mean() > 30
    assert not flat[~valid].any() or valid.all()


def test_the_camera_file_is_plain_yaml(calibrated: Path) -> None:
    data = yaml.safe_load((calibrated / "camera.yaml").read_text(encoding="utf-8"))
    assert np.array(data["P"], float).shape == (3, 20)
    assert np.linalg.norm(np.array(data["P"])) == pytest.approx(1)
