"""``cubicfish report``, and the page that ``cubicfish calibrate`` writes."""

import html
import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml
from pairs_csv import write_pairs
from running import Run
from samples import SAMPLE

from cubicfish import Target, load_corners

TARGET = SAMPLE / "target.yaml"
CORNERS = SAMPLE / "true_corners.csv"
ROOT = Path(__file__).parents[3]
QUICK = ("--no-hold-out", "--refine-target", "off")


def facts(folder: Path, target: Path | None = None) -> Any:
    """What a page says of a folder, without making one."""
    from cubicfish_cli.inputs.calibration_facts import facts_of_files

    return facts_of_files(folder / "camera.yaml", target=target, photos=[])


@pytest.fixture
def own(calibrated: Path, tmp_path: Path) -> Path:
    """A copy of the calibration to write into."""
    return Path(shutil.copytree(calibrated, tmp_path / "calibration"))


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_calibrate_writes_the_page_that_report_writes(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "c"
    said = run("calibrate", CORNERS, "-t", TARGET, "-o", folder, *QUICK, "-v")
    assert f"wrote {folder / 'report.html'}" in said.stdout
    assert "verdict: usable with care: no error was measured" in said.stdout
    page = (folder / "report.html").read_bytes()
    assert b"<!DOCTYPE html>" in page
    said = run("report", folder, "-o", tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == page
    assert said.stdout.startswith("verdict: usable with care: ")
    assert "left out: Pictures of the photos" in said.stderr
    assert "exists already" in run("report", folder, code=1).stderr


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_a_camera_from_elsewhere_is_not_accused(run: Run, calibrated: Path, tmp_path: Path) -> None:
    other, camera, page = (tmp_path / name for name in ("chain.yaml", "camera.yaml", "page.html"))
    run("export", calibrated, "--to", "kalibr-pinhole-equi", "--max-error", "5", "-o", other)
    run("import", other, "-o", camera)
    said = run("report", camera, "-o", page)
    assert "verdict: usable with care: accuracy is not known" in said.stdout
    text = page.read_text(encoding="utf-8")
    assert "not to be trusted" not in text.lower()
    assert "written 2" in text


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_a_page_of_the_point_lift_is_the_same_from_its_files(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "c"
    run("calibrate", CORNERS, "-t", TARGET, "-o", folder, "--lift", "point", "--no-hold-out")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "3 boards and" in page
    run("report", folder, "-t", TARGET, "--overwrite")
    assert (folder / "report.html").read_text(encoding="utf-8") == page


@pytest.mark.slow
@pytest.mark.usefixtures("with_report", "quick_fit")
def test_the_verdict_is_in_the_same_words_wherever_it_is_reported(run: Run, tmp_path: Path) -> None:
    args = ["calibrate", CORNERS, "-t", TARGET]
    said = run(*args, "-o", tmp_path / "c").stdout
    again = run("report", tmp_path / "c", "--overwrite").stdout
    lines = [line for line in said.splitlines() if line.startswith(("verdict: ", "  also: "))]
    assert lines
    assert again.splitlines()[: len(lines)] == lines
    record = json.loads(run("report", tmp_path / "c", "--overwrite", "--json").stdout)["verdict"]
    page = (tmp_path / "c" / "report.html").read_text(encoding="utf-8")
    assert f"</span>{record['words'].capitalize()}</h2>" in page
    for reason in record["reasons"]:
        assert any(reason["why"] in line and reason["do"] in line for line in lines)
        assert html.escape(reason["why"], quote=False) in page
        assert html.escape(reason["do"]).replace("&#x27;", "&#39;") in page


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_it_takes_a_refusal_to_replace_before_the_work(run: Run, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("mine")
    said = run("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path, code=1).stderr
    assert "report.html exists already" in said
    said = run("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path, *QUICK, "--no-report").stderr
    assert "report.html is of an earlier calibration" in said
    assert "cubicfish[report]" not in said
    assert (tmp_path / "report.html").read_text() == "mine"


@pytest.mark.slow
def test_without_the_extra_one_line_says_how_to_get_it(run: Run, tmp_path: Path) -> None:
    said = run("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path, *QUICK).stderr
    (line,) = [line for line in said.splitlines() if "report" in line]
    assert "pip install 'cubicfish[report]'" in line
    assert not (tmp_path / "report.html").exists()
    said = run("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path / "b", *QUICK, "--no-report")
    assert "report" not in said.stderr
    said = run("report", tmp_path, code=1).stderr
    assert said == "Error: a report needs jinja2: pip install 'cubicfish[report]'\n"


def test_what_is_missing_is_found_without_loading_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    from running import MISSING

    assert MISSING(("json", "no_such_library")) == ["no_such_library"]


@pytest.mark.usefixtures("with_report", "quick_fit")
def test_a_camera_is_not_lost_with_its_page(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cubicfish_cli.extensions.report import page

    def broken(facts: object) -> str:
        raise RuntimeError("no fonts\nat all")

    monkeypatch.setattr(page, "report_html", broken)
    said = run("calibrate", CORNERS, "-t", TARGET, "-o", tmp_path)
    assert "page_of_fit fails (RuntimeError: no fonts)" in said.stderr
    assert "report.html" not in said.stdout
    assert {path.name for path in tmp_path.iterdir()} == {
        "camera.yaml", "corners.csv", "undistort_map.npz",
    }  # fmt: skip


@pytest.mark.slow
@pytest.mark.usefixtures("with_report", "quick_fit")
def test_json_has_the_verdict_and_the_page(run: Run, tmp_path: Path) -> None:
    args = ["calibrate", CORNERS, "-t", TARGET, "--json", "-o"]
    record = json.loads(run(*args, tmp_path / "a").stdout)
    assert record["report"] == str(tmp_path / "a" / "report.html")
    assert record["verdict"]["level"] == "care"
    assert record["verdict"]["reasons"][0]["do"]
    assert json.loads(run(*args, tmp_path / "b", "--no-report").stdout)["report"] is None


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_photos_that_are_given_are_shown(run: Run, own: Path) -> None:
    page = own / "report.html"
    run("report", own, "--photos", SAMPLE / "photos")
    text = page.read_text(encoding="utf-8")
    assert text.count("data:image/jpeg") == 10 + 10 + 2
    assert "What this page lacks" not in text
    few = SAMPLE / "photos" / "corner_0[1-3].jpg"
    said = run("report", own, "--photos", few, "--overwrite").stderr
    assert "7 of 10 photos are not at hand, such as corner_04.jpg" in said
    assert page.read_text(encoding="utf-8").count("data:image/jpeg") == 3 + 3 + 2


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_files_that_went_or_changed_are_left_out(run: Run, own: Path, tmp_path: Path) -> None:
    camera = own / "camera.yaml"
    record = yaml.safe_load(camera.read_text())
    moved = shutil.copy(TARGET, tmp_path / "moved.yaml")
    record["made_by"]["target"]["file"] = str(moved)
    camera.write_text(yaml.safe_dump(record))
    assert facts(own).errors is not None
    moved.write_text(moved.read_text() + "# changed\n")
    said = run("report", own).stderr
    assert "left out: Corners and errors: the target is not where it was, or has changed" in said
    assert "Errors as arrows" not in (own / "report.html").read_text(encoding="utf-8")
    assert facts(own, TARGET).errors is not None
    (own / "corners.csv").unlink()  # then there is the table that it came from
    assert facts(own, TARGET).errors is not None
    record["made_by"]["inputs"][0]["sha256"] = "00"
    camera.write_text(yaml.safe_dump(record))
    found = facts(own, TARGET)
    assert found.errors is None
    assert "there is no corners.csv beside the camera" in found.absent[0]


@pytest.mark.usefixtures("with_report")
def test_the_camera_is_named_in_every_usual_way(
    run: Run, own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cubicfish_cli.extensions.report import page

    monkeypatch.setattr(page, "report_html", lambda facts: "a page")
    monkeypatch.chdir(own.parent)
    run("report")
    assert (own / "report.html").read_text() == "a page"
    out = own.parent / "x.html"
    for args in (["-m", own / "camera.yaml"], [own / "camera.yaml"], [own]):
        run("report", *args, "-o", out)
        out.unlink()
    assert "elsewhere/camera.yaml" in run("report", "elsewhere/camera.yaml", code=1).stderr


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
@pytest.mark.parametrize("photos", [1, 10])
def test_point_lift(run: Run, tmp_path: Path, photos: int) -> None:
    lines = CORNERS.read_text().splitlines()
    names = [f"corner_{number:02}" for number in range(1, photos + 1)]
    table = tmp_path / "some.csv"
    kept = [line for line in lines[2:] if line.startswith(tuple(names))]
    table.write_text("\n".join([*lines[:2], *kept]))
    args = ["calibrate", table, "-t", TARGET, "--lift", "point", "--no-hold-out", "-o"]
    said = run(*args, tmp_path / "c").stdout
    assert f"wrote {tmp_path / 'c' / 'report.html'}" in said
    assert "verdict: usable with care" in said
    page = (tmp_path / "c" / "report.html").read_text(encoding="utf-8")
    assert "A point-lift camera has no rays" in page
    assert "Errors as arrows" in page
    assert "The lens: radius by angle" not in page
    assert ("Where the photos were taken from" in page) == (photos > 1)
    run("report", tmp_path / "c", "-o", tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == page


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_pairs_without_a_target(run: Run, tmp_path: Path) -> None:
    target = Target.load(TARGET)
    table = tmp_path / "pairs.csv"
    write_pairs(table, load_corners(CORNERS, target))
    folder = tmp_path / "c"
    run("calibrate", "--correspondences", table, "--no-hold-out", "-o", folder)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Errors as arrows" in page
    assert "Where the photos were taken from" in page
    assert 'scope="col">Boards' not in page
    run("report", folder, "-o", tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == page
    table.write_text("changed")
    (said, _) = facts(folder).absent
    assert "the table that it was calibrated from is not where it was, or has changed" in said


@pytest.mark.slow
@pytest.mark.usefixtures("with_report")
def test_a_refined_object_is_reported(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / "c"
    args = ["--no-hold-out", "--refine-target", "shape"]
    run("calibrate", CORNERS, "-t", TARGET, "-o", folder, *args)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "The target as fitted beside target.yaml" in page
    assert "normal for a printed board" in page
    run("report", folder, "-o", tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text(encoding="utf-8") == page
    (folder / "target.refined.yaml").unlink()
    assert "target.refined.yaml is not beside the camera" in facts(folder).absent[0]


@pytest.mark.usefixtures("quick_fit")
def test_the_command_is_on_record(run: Run, tmp_path: Path) -> None:
    table = shutil.copy(CORNERS, tmp_path / "my corners.csv")
    args = ["--no-hold-out", "--refine-target", "off", "--overwrite", "--json"]
    run("calibrate", table, "-t", TARGET, "-o", tmp_path, *args)
    record = yaml.safe_load((tmp_path / "camera.yaml").read_text())
    assert record["made_by"]["command"] == (
        f"cubicfish calibrate '{table}' --target {TARGET} --refine-target off --no-hold-out"
    )


@pytest.mark.slow
def test_matplotlib_keeps_its_worries_to_itself(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    (tmp_path / "matplotlibrc").write_text("lines.linewidth: bogus\n")
    drawing = tmp_path / "target.svg"
    done = subprocess.run(
        [sys.executable, "-m", "cubicfish_cli", "target", "check", TARGET, "--draw", drawing, "-q"],
        env={**os.environ, "MPLCONFIGDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert "wrote" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "darwin", reason="names are UTF-8 there")
@pytest.mark.usefixtures("with_report", "quick_fit")
def test_names_that_are_no_utf8_and_hold_line_ends(run: Run, tmp_path: Path) -> None:
    folder = tmp_path / os.fsdecode(b"caf\xe9\n<b>")
    folder.mkdir()
    table = shutil.copy(CORNERS, folder / "corners.csv")
    run("calibrate", table, "-t", TARGET, "-o", tmp_path / "c")
    page = (tmp_path / "c" / "report.html").read_text(encoding="utf-8")
    assert r"caf\udce9\n&lt;b&gt;/corners.csv" in page
    run("report", tmp_path / "c", "--overwrite")


def test_the_templates_go_along_with_the_package() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        data = tomllib.load(file)["tool"]["setuptools"]["package-data"]["cubicfish_cli"]
    package = ROOT / "cubicfish_cli"
    covered = {path for pattern in data for path in package.glob(pattern)}
    templates = {
        path
        for folder in (package / "render" / "pages", package / "extensions")
        for path in folder.rglob("*.*")
        if path.suffix in (".html", ".css", ".js")
    }
    assert len(templates) == 6
    assert templates <= covered


@pytest.mark.slow
@pytest.mark.usefixtures("with_report", "quick_fit")
def test_the_page_begins_with_the_title_and_the_camera_in_a_line(run: Run, tmp_path: Path) -> None:
    line = ("calibrate", CORNERS, "-t", TARGET, "--no-hold-out", "-o", tmp_path / "c")
    headline, lens, *_ = run(*line, "--title", "front <left>").stdout.splitlines()
    page = (tmp_path / "c" / "report.html").read_text()
    assert "<h1>front &lt;left&gt;</h1>" in page
    assert f'<p class="sub">{headline.rpartition(": ")[0]}</p>' in page
    assert f'<p class="sub">{lens.removeprefix("front <left>: ")}</p>' in page
