"""The page about a calibration: whole, safe, the same to the byte, and of bounded size."""

import hashlib
import re
import shlex
import shutil
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from plain_data import PLAIN
from running import run_cli
from samples import SAMPLE

pytest.importorskip("jinja2")

from cubicfish import Calibration, CameraFile, Observations, Target, load_corners
from cubicfish.judge import FitRecord
from cubicfish.solve.statistics import rms_px
from cubicfish_cli.extensions.report.page import report_html
from cubicfish_cli.inputs.calibration_facts import Facts, gather, matched
from cubicfish_cli.render.pages.figures import upright
from cubicfish_cli.words.sentences import render

TARGET = Target.load(SAMPLE / "target.yaml")
PHOTOS = sorted((SAMPLE / "photos").iterdir())
VOID = {"meta", "link", "img", "br", "input"}
MADE_BY = {
    "version": "1.2.3",
    "date": "2026-01-02T03:04:05+00:00",
    "command": "cubicfish calibrate photos --target target.yaml",
    "options": {"hold_out": False, "refine_target": "auto"},
    "target": {"file": "target.yaml", "sha256": "ab" * 32},
    "inputs": [{"file": f"photos/{path.name}", "sha256": "cd" * 32} for path in PHOTOS],
}


class Page(HTMLParser):
    """What tests ask of a page; an element that is closed wrongly fails."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


@pytest.fixture(scope="module")
def pairs() -> Observations:
    return load_corners(SAMPLE / "true_corners.csv", TARGET)


def facts_of(
    fitted: Calibration,
    pairs: Observations | None,
    *,
    fit: dict[str, Any] | None = None,
    made_by: dict[str, Any] | None = None,
    target: Target | None = TARGET,
    files: dict[str, Path] | None = None,
    **more: Any,
) -> Facts:
    return gather(
        CameraFile(
            camera=fitted.camera,
            fit=FitRecord.of({**fitted.as_record(), **(fit or {})}),
            made_by=made_by or MADE_BY,
        ),
        pairs=pairs,
        target=target,
        files={} if files is None else files,
        **more,
    )


@pytest.fixture(scope="module")
def html(fitted: Calibration, pairs: Observations) -> str:
    return report_html(facts_of(fitted, pairs, files={path.name: path for path in PHOTOS}))


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


def test_the_errors_are_those_of_the_fit(fitted: Calibration, pairs: Observations) -> None:
    errors = facts_of(fitted, pairs).errors
    assert errors is not None
    np.testing.assert_allclose(errors.residual, fitted.residual, atol=1e-6)
    assert errors.angle_deg is not None
    assert errors.angle_deg.max() == pytest.approx(fitted.fit.covered_deg, abs=0.5)


@pytest.mark.slow
def test_dropped_corners_and_unfit_photos_take_no_part(
    fitted: Calibration, pairs: Observations
) -> None:
    record = fitted.as_record()
    first = {"image": pairs.images[0], "board": pairs.boards[pairs.board[0]], "error_px": 9.0}
    first |= {"column": int(pairs.column[0]), "row": int(pairs.row[0])}
    per_image = [photo for photo in record["per_image"] if photo["image"] != pairs.images[4]]
    changed = {"per_image": per_image, "dropped_corners": [first], "dropped": 1}
    facts = facts_of(fitted, pairs, fit=changed)
    assert facts.errors is not None
    assert len(facts.errors.pairs.pixel) == len(pairs.pixel) - 1 - (pairs.image == 4).sum()
    ((name, place),) = facts.dropped_pixels
    assert (name, place.tolist()) == (pairs.images[0], pairs.pixel[0].tolist())
    said = Page(report_html(facts)).text
    assert "1 corner left out as an outlier" in said
    assert "1 photo gave no corners that took part: corner_05.jpg" in said


def test_corners_that_had_places_of_their_own_do_not_hide_the_others_errors(
    fitted: Calibration, pairs: Observations
) -> None:
    own = pairs.image == 0
    other = replace(pairs, certain=~own, pixel=pairs.pixel + own[:, None])
    of_others = {"refine_target": "points", "rms_px": rms_px(fitted.residual[~own])}
    errors = facts_of(fitted, other, fit=of_others).errors
    assert errors is not None
    np.testing.assert_allclose(errors.residual, fitted.residual[~own], atol=1e-6)
    moved = replace(other, pixel=pairs.pixel + 1.0)
    assert facts_of(fitted, moved, fit=of_others).errors is None
    assert facts_of(fitted, other).errors is None


@pytest.mark.slow
def test_everything_is_there(page: Page) -> None:
    for words in (
        "Usable with care", "What to do:", "Where the corners are", "How certain the camera is",
        "Errors as arrows", "Errors over the picture", "Errors by angle from the axis",
        "The lens: radius by angle", "Before and after: corner_09.jpg",
        "Where the photos were taken from", "floor 54, left 56, right 35", "stereographic",
        "Nothing: every photo", "calibrate photos --target target.yaml", "cubicfish 1.2.3",
        "ab" * 32, "cd" * 32, "sqrt(mean(dx² + dy²)) over all corners used",
    ):  # fmt: skip
        assert words in page.text, words


@pytest.mark.slow
def test_nothing_comes_from_elsewhere_and_only_the_pages_script_runs(page: Page, html: str) -> None:
    assert page.all("script") == [{"type": "application/json", "id": "acts"}, {}]
    script = html.partition("<script>")[2].partition("</script>")[0]
    assert "fetch" not in script
    (policy,) = [meta["content"] for meta in page.all("meta") if "http-equiv" in meta]
    digest = b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert policy == (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'"
    )
    for tag, attributes in page.elements:
        for name, value in attributes.items():
            assert not name.startswith("on"), (tag, name)
            if name in ("href", "src", "xlink:href", "data", "action", "srcset", "poster"):
                assert value is not None
                assert value.startswith(("#", "data:")), (tag, name, value[:80])
    assert "@import" not in html
    assert "url(" not in html
    assert "http:" not in html
    assert "https:" not in html


@pytest.mark.slow
def test_what_is_wrong_comes_first_and_corners_of_another_fit_are_not_drawn(
    fitted: Calibration, pairs: Observations
) -> None:
    note = {"level": "note", "what": "a note", "evidence": "12 px", "do": "sleep on it"}
    fit = {"findings": [{**note, "level": "bad", "what": "a fault"}, note]}
    facts = facts_of(fitted, replace(pairs, pixel=pairs.pixel + 1.0), fit=fit)
    assert facts.errors is None
    assert "they are not those of the fit" in facts.absent[0]
    text = Page(report_html(facts)).text
    assert "they are not those of the fit" in text
    assert "Errors as arrows" not in text
    assert "The lens: radius by angle" in text
    assert len(facts.known.verdict.reasons) > 1
    reported = [
        "Not to be trusted",
        "a fault (12 px)",
        *(render(reason).why for reason in facts.known.verdict.reasons),
    ]
    reported += [
        "a note (12 px); sleep on it",
        facts.known.verdict.figures[1:],
        "RMS error",
    ]
    places = [text.index(words) for words in reported]
    assert places == sorted(places)
    assert text.count("a note (12 px)") == 1
    # What to do is told in the words of the terminal, which has reasons in this order too.
    assert all(render(reason).do in text for reason in facts.known.verdict.reasons)


def test_before_and_after_stand_beside_the_verdict(page: Page, html: str) -> None:
    start = html.index('<section id="verdict"')
    top = html[start : html.index("</section>", start)]
    assert top.count("<img src=") == 2
    assert html.count("Before and after:") == 1
    known = re.findall(r"<dt>([^<]*)</dt><dd>([^<]*)</dd>", top)
    assert [name for name, _ in known] == [
        "Focal length", "Principal point", "Field of view",
    ]  # fmt: skip
    assert re.fullmatch(
        r"x 253\.\d\d ± \d\.\d\d, y 253\.\d\d ± \d\.\d\d px per radian", known[0][1]
    )
    header = html[html.index("<header>") : html.index("</header>")]
    assert len(re.findall("960", header)) == 1


@pytest.mark.slow
def test_a_bad_photo_stands_out(fitted: Calibration, pairs: Observations) -> None:
    per_image = [dict(photo) for photo in fitted.as_record()["per_image"]]
    per_image[4]["rms_px"] *= 9
    facts = facts_of(fitted, None, fit={"per_image": per_image})
    odd = {photo: words for photo, words in facts.verdict_words.items() if words != "good"}
    assert list(odd) == [per_image[4]["image"]]
    assert odd[per_image[4]["image"]] in Page(report_html(facts)).text


@pytest.mark.slow
def test_what_the_page_says_to_use_it_works(
    page: Page, html: str, calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    box = html[html.index('<section id="use"') :].partition("</section>")[0]
    *commands, program = [
        unescape(text) for text in re.findall(r"<pre>(.*?)</pre>", box, re.DOTALL)
    ]
    monkeypatch.chdir(tmp_path)
    shutil.copy(PHOTOS[0], "photo.jpg")
    shutil.copy(calibrated / "camera.yaml", "camera.yaml")
    assert len(commands) == 5
    for command in commands:
        name, *args = shlex.split(command)
        assert name == "cubicfish"
        # The sample's lens is half a pixel off OpenCV's at the rim: then the box says what to do.
        run_cli(*args, *(["--max-angle", 80] if args[0] == "export" else []))
    assert "--max-angle 80 leaves out the rim" in page.text
    assert len(program.splitlines()) == 3
    names: dict[str, Any] = {}
    exec(program, names)
    assert names["flat"].shape == (720, 960, 3)
    assert names["flat"].std() > 20


@pytest.mark.slow
def test_a_camera_not_to_be_trusted_is_not_offered_at_once(fitted: Calibration) -> None:
    bad = {"findings": [{"level": "bad", "what": "a fault", "evidence": "12 px", "do": "x"}]}
    text = Page(report_html(facts_of(fitted, None, fit=bad))).text
    assert "first do what the verdict says" in text
    assert "first do what the verdict says" not in Page(report_html(facts_of(fitted, None))).text


@pytest.mark.slow
def test_tables_become_blocks_on_small_pages(page: Page, html: str) -> None:
    css = html[: html.index("</style>")]
    assert ".stack tr {" in css[css.index("@media screen and (max-width: 800px)") :]
    tables = re.findall(r'<table class="stack">.*?</table>', html, re.DOTALL)
    assert tables
    for table in tables:
        cells = re.findall(r"<td([^>]*)>", table)
        figures_of = [cell for cell in cells if 'class="number"' in cell]
        assert figures_of
        assert all("data-label=" in cell for cell in figures_of)
        assert all(("picture" in cell) or ("boards" in cell) or ("words" in cell)
                   for cell in cells if cell not in figures_of)  # fmt: skip
    assert any("few" in (box.get("class") or "") for box in page.all("div"))


@pytest.mark.slow
def test_a_page_is_of_reasonable_size(html: str) -> None:
    assert len(html) < 1_400_000  # ten photos large and small, and nine figures


def test_it_can_be_read_without_eyes_and_without_a_mouse(page: Page) -> None:
    assert page.all("html") == [{"lang": "en"}]
    assert all(image.get("alt") for image in page.all("img"))
    drawings = [image for image in page.all("img") if "svg+xml" in str(image["src"])]
    assert len(drawings) >= 8
    assert all(head.get("scope") in ("row", "col") for head in page.all("th"))
    boxes = [box for box in page.all("div") if "scroll" in (box.get("class") or "")]
    assert boxes
    assert all(box["tabindex"] == "0" and box["aria-label"] for box in boxes)
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    targets = [link["href"] for link in page.all("a")]
    assert len(targets) > 15
    assert {str(target)[1:] for target in targets} <= {str(name) for name in ids}


@pytest.mark.slow
def test_the_same_page_to_the_byte_whatever_the_surroundings(
    html: str, fitted: Calibration, pairs: Observations, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    again = report_html(facts_of(fitted, pairs, files={path.name: path for path in PHOTOS}))
    assert again == html


HOSTILE = [
    "<script>alert(1)</script>", "\"><img src=x onerror=alert(1)>", "a\nb.png", "caf\udce9.png",
    "'onload='alert(1)", "{{ 7*7 }}", "&amp;", "]]>", "</style>", "\u202egnp.exe", "#0a0b01",
    "x" * 5000,
]  # fmt: skip


@pytest.mark.slow
def test_names_are_text_and_nothing_else(fitted: Calibration, pairs: Observations) -> None:
    names = tuple(HOSTILE[: len(pairs.images)])
    record = fitted.as_record()
    per_image = [
        {**photo, "image": name} for photo, name in zip(record["per_image"], names, strict=False)
    ]
    boards = tuple(replace(board, name=HOSTILE[i]) for i, board in enumerate(TARGET.boards))
    fit = {
        "per_image": per_image,
        "findings": [{"level": "care", "what": name, "boards": [name]} for name in HOSTILE],
        "unfit_images": {name: name for name in HOSTILE},
        "departures": [{"board": name} for name in HOSTILE],
        "dropped_corners": [{"image": name, "board": name} for name in HOSTILE],
        "dropped": 12,
    }
    made_by = {
        **dict.fromkeys(("version", "date", "command"), HOSTILE[0]),
        "options": {name: name for name in HOSTILE},
        "target": {"file": HOSTILE[1], "sha256": HOSTILE[1]},
        "inputs": [{"file": name, "sha256": name} for name in HOSTILE],
    }
    files = dict(zip(names, PHOTOS, strict=False))
    facts = facts_of(
        fitted,
        replace(pairs, images=names, boards=tuple(board.name for board in boards)),
        fit=fit,
        made_by=made_by,
        target=Target(units=HOSTILE[0], boards=boards),
        files=files,
    )
    facts = replace(facts, absent=HOSTILE)
    assert facts.errors is not None
    text = report_html(facts)
    text.encode("utf-8")
    page = Page(text)
    assert page.all("script") == [{"type": "application/json", "id": "acts"}, {}]
    assert not [attributes for _, attributes in page.elements if "onerror" in attributes]
    assert not [attributes for _, attributes in page.elements if "onload" in attributes]
    assert len(page.all("style")) == 1
    assert HOSTILE[0] in page.text
    assert r"a\nb.png" in page.text
    assert r"caf\udce9.png" in page.text
    assert r"\u202egnp.exe" in page.text
    assert "{{ 7*7 }}" in page.text
    assert "#0a0b01" in page.text
    assert "x" * 1001 not in text


@pytest.mark.slow
def test_a_thousand_photos_and_a_hundred_thousand_corners(
    fitted: Calibration, pairs: Observations
) -> None:
    many = 1000
    record = fitted.as_record()
    per_image = [
        {**record["per_image"][index % 10], "image": f"{index:04}.jpg"} for index in range(many)
    ]
    rows = np.concatenate([np.flatnonzero(pairs.image == index % 10) for index in range(many)])
    image = np.repeat(np.arange(many), [(pairs.image == i % 10).sum() for i in range(many)])
    huge = replace(
        pairs,
        images=tuple(photo["image"] for photo in per_image),
        image=image,
        **{
            name: getattr(pairs, name)[rows]
            for name in ("world", "pixel", "weight", "board", "column", "row")
        },
    )
    assert len(huge.pixel) > 100_000
    files = {photo["image"]: PHOTOS[index % 10] for index, photo in enumerate(per_image)}
    text = report_html(facts_of(fitted, huge, fit={"per_image": per_image}, files=files))
    assert len(text) < 4_000_000
    page = Page(text)
    assert len(page.all("tr")) >= many
    assert len(page.all("img")) <= 48 + 12 + 2 + 9
    assert f"4,000 of {len(huge.pixel):,} corners are drawn" in page.text
    assert "Pictures are of the 48 photos with the largest errors" in page.text


@pytest.mark.slow
def test_photos_that_changed_or_are_broken_are_left_out_and_reported(
    fitted: Calibration, pairs: Observations, tmp_path: Path
) -> None:
    (tmp_path / "cut.jpg").write_bytes(PHOTOS[0].read_bytes()[:5000])
    files = {PHOTOS[0].name: tmp_path / "cut.jpg", PHOTOS[1].name: PHOTOS[1]}
    digests = {PHOTOS[1].name: "00" * 32}
    facts = facts_of(fitted, pairs, files=files, digests=digests)
    page = Page(report_html(facts))
    assert not [image for image in page.all("img") if "jpeg" in str(image["src"])]
    assert "is cut short or damaged" in page.text
    assert "no longer the photo that was calibrated with" in page.text


def test_files_by_names() -> None:
    paths = [Path("/a/left/1.png"), Path("/a/right/1.png"), Path("/a/2.png")]
    assert matched(["left/1.png", "1.png", "2.png", "3.png"], paths) == {
        "left/1.png": paths[0],
        "2.png": paths[2],
    }


@pytest.mark.slow
@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_record_breaks_it(data: st.DataObject, fitted: Calibration) -> None:
    record = fitted.as_record()
    keys = st.sampled_from(sorted(record))
    fit = data.draw(st.dictionaries(keys, PLAIN, min_size=1, max_size=4))
    for key in ("uncertainty", "per_image"):
        if data.draw(st.booleans()):
            whole = record[key][0] if key == "per_image" else record[key]
            changed = {**whole, **data.draw(st.dictionaries(st.sampled_from(list(whole)), PLAIN))}
            fit[key] = [changed] if key == "per_image" else changed
    made_by = data.draw(st.dictionaries(st.sampled_from(list(MADE_BY)), PLAIN))
    Page(report_html(facts_of(fitted, None, fit=fit, made_by=made_by)))


def test_up_is_up_and_ahead_is_ahead() -> None:
    right, ahead, up = upright(np.array([0, 0, 2.0]), np.array([0, -1, 0.2]))
    np.testing.assert_allclose(right, [1, 0, 0], atol=1e-12)
    assert ahead @ [0, 0, 1] > 0.9
    assert up @ [0, -1, 0] > 0.9
    # Cameras that look straight up, or say nothing of it, have some upright frame all the same.
    for way in (np.array([0, -1.0, 0]), np.zeros(3)):
        frame = upright(way, np.array([0, -1.0, 0]))
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(frame) == pytest.approx(1)
