"""A real browser goes through a shoot: folder, film, leaving out, finishing, a target on screen."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from shooting import PHOTOS, filmed, shooting

webdriver = pytest.importorskip("selenium.webdriver")
CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="there is no Chromium"),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1280,900"):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=DRIVER)
    driver = webdriver.Chrome(options=options, service=service)
    yield driver
    driver.quit()


def wait_for(driver: Any, is_so: Callable[[Any], object]) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(driver, 90, 0.1).until(is_so)


def text(driver: Any, name: str) -> str:
    return str(driver.find_element("id", name).text)


def drawn(driver: Any, name: str) -> str:
    return str(driver.find_element("id", name).get_attribute("d") or "")


def test_a_shoot_in_a_browser(browser: Any, tmp_path: Path) -> None:
    more = ("--on-screen", "--goal", "0.02", "--jobs", "1")
    with shooting(tmp_path, *more) as running:
        browser.get(running.address)
        wait_for(browser, lambda page: "9x6 corners" in text(page, "check"))
        # The board is as large as the ruler says.
        board, bar = (browser.find_element("id", name) for name in ("board", "ruler"))
        assert bar.size["width"] / 100 == pytest.approx(board.size["width"] / 300, rel=0.01)
        browser.execute_script(
            "const one = document.getElementById('scale'); one.value = 0.5;"
            "one.dispatchEvent(new Event('input'))"
        )
        assert bar.size["width"] == pytest.approx(0.5 * 100 * 96 / 25.4, rel=0.01)
        browser.find_element("id", "full").click()
        wait_for(browser, lambda page: page.execute_script("return document.fullscreenElement"))
        assert browser.execute_script("return document.fullscreenElement.id") == "screen"
        browser.execute_script("document.exitFullscreen()")
        wait_for(browser, lambda page: not page.execute_script("return document.fullscreenElement"))
        browser.execute_script(
            "window.tones = 0; const made = AudioContext.prototype.createOscillator;"
            "AudioContext.prototype.createOscillator = function () {"
            " window.tones++; return made.call(this); }"
        )
        assert browser.execute_script("return sound") is None  # no sound before a click
        browser.find_element("id", "begin").click()
        assert not browser.find_element("id", "finish").is_enabled()
        # Another tab is told the same, and photos that come are shown with their corners.
        for number, photo in enumerate(PHOTOS[:6], start=1):
            shutil.copy(photo, tmp_path / "photos")
            wait_for(browser, lambda page, to=number: text(page, "summary").startswith(f"{to} ph"))
        wait_for(browser, lambda page: "set aside" in text(page, "summary"))
        assert browser.execute_script("return [sound.state, tones]") == ["running", 6]
        assert drawn(browser, "corners").count("M") > 50
        assert drawn(browser, "dark").count("M") > 10
        assert text(browser, "next").startswith("Hold the target")
        assert len(browser.find_elements("css selector", "#cells rect")) > 20
        shown = "return document.getElementById('photo').naturalWidth"
        assert browser.execute_script(shown) == 960
        assert "(set aside: 0." in text(browser, "photos")
        # Leaving out.
        boxes = browser.find_elements("css selector", "#photos input")
        assert len(boxes) == 6
        boxes[1].click()
        wait_for(browser, lambda page: text(page, "summary").startswith("5 ph"))
        assert len(browser.find_elements("css selector", "#photos tr.out")) == 1
        # Closed and opened again it is as before; then it is finished.
        browser.get("about:blank")
        browser.get(running.address)
        wait_for(browser, lambda page: page.find_elements("css selector", "#photos tr.out"))
        browser.find_element("id", "begin").click()
        browser.find_element("id", "finish").click()
        wait_for(browser, lambda page: page.current_url == running.address + "report")
        assert "good" in browser.title
        assert (tmp_path / "calibration" / "camera.yaml").is_file()
        assert "corner_02" not in (tmp_path / "calibration" / "corners.csv").read_text()
        assert [one for one in browser.get_log("browser") if one["level"] == "SEVERE"] == []
        browser.back()
        wait_for(browser, lambda page: page.find_elements("css selector", "#photos tr"))
        running.ask("POST", "asked", {"do": "stop"})
        assert running.process.wait(30) == 0


def test_a_film_as_camera(browser: Any, tmp_path: Path) -> None:
    film = filmed(tmp_path / "film.mkv", seconds=5)
    with shooting(tmp_path, "--camera", film) as running:
        browser.get(running.address)
        browser.find_element("id", "begin").click()
        wait_for(browser, lambda page: text(page, "summary").startswith("2 ph"))
        assert drawn(browser, "paper").count("M") > 10
        source = browser.find_element("id", "photo").get_attribute("src")
        assert source.endswith(("live", "photo?2"))
        assert {path.name for path in tmp_path.glob("photos/*")} >= {
            "shoot_0001.png", "shoot_0002.png"
        }  # fmt: skip


def test_another_sites_page_reaches_nothing(browser: Any, tmp_path: Path) -> None:
    with shooting(tmp_path) as running:
        evil = tmp_path / "evil.html"
        evil.write_text(
            f"<iframe id=f src='{running.address}'></iframe><script>var said = [];"
            f"fetch('{running.address}asked', {{method: 'POST', mode: 'no-cors', "
            "body: '{\"do\": \"stop\"}'}).then(() => said.push('sent'), () => said.push('failed'));"
            f"fetch('{running.address}').then(() => said.push('read'), () => said.push('refused'));"
            "</script>"
        )
        browser.get(evil.as_uri())
        wait_for(browser, lambda page: page.execute_script("return said.length") == 2)
        assert "refused" in browser.execute_script("return said")
        assert running.ask("GET")[0] == 200  # it was not stopped
        assert running.process.poll() is None
