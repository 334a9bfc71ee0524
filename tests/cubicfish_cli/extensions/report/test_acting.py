"""What a reader can do in a page, in a real browser, and what leaving a photo out would change."""

from __future__ import annotations

import base64
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from running import run_cli
from samples import SAMPLE

pytest.importorskip("jinja2")

from cubicfish import (
    Calibration,
    Observations,
    Target,
    aligned_difference,
    calibrate,
    load_corners,
)
from cubicfish_cli.extensions.report.acting import others_px
from cubicfish_cli.extensions.report.page import report_html
from cubicfish_cli.inputs.calibration_facts import Facts, facts_of_fit

PHOTOS = sorted((SAMPLE / "photos").iterdir())


@pytest.fixture(scope="module")
def pairs() -> Observations:
    return load_corners(SAMPLE / "true_corners.csv", Target.load(SAMPLE / "target.yaml"))


@pytest.fixture(scope="module")
def facts(fitted: Calibration, pairs: Observations) -> Facts:
    return facts_of_fit(fitted, pairs, PHOTOS)


@pytest.mark.slow
def test_what_leaving_a_photo_out_changes_is_nearly_what_a_refit_says(pairs: Observations) -> None:
    noise = np.random.default_rng(0).normal(0, 0.1, pairs.pixel.shape)
    noisy = replace(pairs, pixel=pairs.pixel + noise)
    target = Target.load(SAMPLE / "target.yaml")

    def fit(photos: list[int]) -> Calibration:
        corners = noisy.of_photos(np.array(photos))
        return calibrate(corners, target, refine_target="off", hold_out=False)

    whole, every = fit([*range(10)]), range(0, 10, 2)
    others = others_px(whole.fit.per_image)
    assert [*others] == list(pairs.images)
    pixel = np.stack(np.meshgrid(*(np.linspace(0, one - 1, 13) for one in (960, 720))), axis=-1)
    rays = whole.camera.unproject(pixel.reshape(-1, 2))
    rays = rays[np.isfinite(rays[:, 0])]
    ratios = []
    for photo in every:
        refit, name = fit([one for one in range(10) if one != photo]), pairs.images[photo]
        change, _ = aligned_difference(refit.camera, whole.camera, rays)
        rms = float(np.sqrt(np.nanmean(np.square(change).sum(axis=1))))
        ratios.append((whole.fit.per_image[photo].moves_px or 0.0) / rms)
        assert others[name] == pytest.approx(refit.fit.rms_px, rel=0.02)
    assert np.median(ratios) == pytest.approx(1, abs=0.1)
    assert all(0.6 < one < 1.6 for one in ratios)


def test_the_others_error_is_known_or_not(fitted: Calibration) -> None:
    first, second, third = (
        replace(one, image=name, corners=corners, rms_px=px)
        for one, (name, corners, px) in zip(
            fitted.fit.per_image[:3],
            [("a", 30, 1.0), ("b", 10, 2.0), ("c", 10, 1e200)],
            strict=True,
        )
    )
    assert others_px([first, second]) == {"a": pytest.approx(2), "b": pytest.approx(1)}
    assert np.isnan(others_px([first])["a"])  # there are none
    assert not np.isfinite(others_px([first, third])["a"])


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver")
    programs = [shutil.which(name) for name in ("chromium", "chromedriver")]
    if None in programs:
        pytest.skip("there is no Chromium")
    options = webdriver.ChromeOptions()
    options.binary_location = programs[0]
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    for word in ("headless=new", "no-sandbox", "enable-unsafe-swiftshader", "window-size=1200,900"):
        options.add_argument(f"--{word}")
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(programs[1]))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def opened(
    browser: Any, fitted: Calibration, facts: Facts, tmp_path_factory: pytest.TempPathFactory
) -> Any:
    """The page of a calibration in a folder, and the folder."""
    folder = tmp_path_factory.mktemp("acting")
    (folder / "camera.yaml").write_text(fitted.text())
    (folder / "page.html").write_text(report_html(facts), encoding="utf-8")
    browser.get((folder / "page.html").as_uri())
    wait_for(browser, "document.body.classList.contains('looking')")
    return browser, folder


def wait_for(browser: Any, condition: str) -> None:
    from selenium.webdriver.support.wait import WebDriverWait

    WebDriverWait(browser, 30).until(lambda one: one.execute_script(f"return {condition}"))


def find(browser: Any, selector: str) -> Any:
    return browser.find_elements("css selector", selector)


def drag(browser: Any, selector: str, x: int, y: int, *, finger: bool = False) -> None:
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.actions.action_builder import ActionBuilder
    from selenium.webdriver.common.actions.pointer_input import PointerInput

    (canvas,) = find(browser, selector)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
    if not finger:
        ActionChains(browser).drag_and_drop_by_offset(canvas, x, y).perform()
        return
    touch = ActionBuilder(browser, mouse=PointerInput("touch", "finger"))
    touch.pointer_action.move_to(canvas).pointer_down().move_by(x, y).pointer_up()
    touch.perform()


def drawn(browser: Any, selector: str) -> np.ndarray[Any, Any]:
    script = f"return document.querySelector('{selector}').toDataURL().split(',')[1]"
    data = np.frombuffer(base64.b64decode(browser.execute_script(script)), np.uint8)
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))


@pytest.mark.slow
def test_photos_sort_and_are_left_out(opened: Any, facts: Facts) -> None:
    browser, _ = opened
    names = [photo.image for photo in facts.photos]
    worst = sorted(facts.photos, key=lambda one: -one.rms_px)
    time, error = find(browser, "#sorting button")
    for button, order in ((error, [one.image for one in worst]), (time, names)):
        button.click()
        assert [row.get_attribute("data-photo") for row in find(browser, "#rows tr")] == order
    (card,) = find(browser, "#without")
    assert not card.is_displayed()
    before = drawn(browser, "#scene")
    boxes = find(browser, "#rows input")
    for box in (boxes[2], boxes[5]):
        box.click()
    moved = {photo.image: photo.moves_px for photo in facts.photos}
    said = [line.text for line in find(browser, "#without li")]
    assert len(said) == 2
    for line, name in zip(said, (names[2], names[5]), strict=True):
        assert line.startswith(f"Without {name} the camera moves by {moved[name]:.2g} px")
    (command,) = find(browser, "#without pre")
    words = shlex.split(command.text)
    assert words[-4:] == ["--exclude", names[2], "--exclude", names[5]]
    assert (drawn(browser, "#scene") != before).any()
    for box in (boxes[2], boxes[5]):
        box.click()
    assert not card.is_displayed()
    assert (drawn(browser, "#scene") == before).all()


@pytest.mark.slow
def test_boards_and_poses_turn_by_mouse_and_finger(opened: Any) -> None:
    browser, _ = opened
    seen = [drawn(browser, "#scene")]
    assert (np.ptp(seen[0].reshape(-1, 3), axis=0) > 100).all()
    for x, y, finger in ((60, 0, False), (0, 40, False), (40, 0, True), (0, 40, True)):
        drag(browser, "#scene", x, y, finger=finger)
        seen.append(drawn(browser, "#scene"))
        assert (seen[-1] != seen[-2]).any()
    assert not any(one.is_displayed() for one in find(browser, "#still img"))
    assert not [one for one in browser.get_log("browser") if one["level"] == "SEVERE"]


@pytest.mark.slow
@pytest.mark.parametrize("kind", range(5))
def test_the_photo_is_straightened_as_the_command_below_says(opened: Any, kind: int) -> None:
    browser, folder = opened
    find(browser, "#kind option")[kind].click()
    drag(browser, "#look", 40, -25 + 10 * kind)
    find(browser, "#field")[0].send_keys(*["\ue014"] * 5)  # wider, by a key
    picture = drawn(browser, "#look")
    words = shlex.split(find(browser, "#look-command")[0].text)
    assert words[:2] == ["cubicfish", "undistort"]
    words[2], words[3] = str(SAMPLE / "photos" / words[2]), str(folder / "flat.png")
    words[5] = str(folder / "camera.yaml")
    run_cli(*words[1:], "--overwrite")
    expected = cv2.imread(str(folder / "flat.png"))
    assert expected is not None
    assert expected.shape == picture.shape
    assert not words[-1].endswith("=0,0,0")
    assert words[-2] != "120"
    seen = expected > 0
    assert seen.mean() > 0.3
    away, beside = (
        np.abs(np.roll(picture, by, axis=1).astype(float) - expected)[seen] for by in (0, 1)
    )
    assert np.median(away) <= 2
    assert away.mean() < beside.mean() / 2  # a pixel beside it is another picture


@pytest.mark.slow
def test_without_webgl_the_still_picture_is_there(opened: Any) -> None:
    browser, folder = opened
    text = (folder / "page.html").read_text(encoding="utf-8")
    (folder / "still.html").write_text(text.replace('"vertex": "', '"vertex": "no shader'))
    browser.get((folder / "still.html").as_uri())
    wait_for(browser, "document.readyState === 'complete'")
    assert find(browser, "#flat")[0].is_displayed()
    assert not find(browser, "#look")[0].is_displayed()
    assert find(browser, "#scene")[0].is_displayed()
