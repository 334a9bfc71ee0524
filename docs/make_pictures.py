"""Make the pictures of README.md and of the pages: ``python docs/make_pictures.py``.

All of them show real runs on the sample photos. Needs the extra ``report``, a terminal of the
system's (Linux or macOS), and Chromium for the report's picture, which stays as it is without it.
"""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from rich.console import Console
from rich.terminal_theme import TerminalTheme
from rich.text import Text

Picture = npt.NDArray[np.uint8]

HERE = Path(__file__).parent
PICTURES = HERE / "pictures"
SAMPLE = HERE.parent / "sample_data"
HERO, SHOWN = "corner_03.jpg", "corner_01.jpg"
QUALITY = 84
_THEME = TerminalTheme(
    (24, 28, 34),
    (222, 226, 232),
    [(60, 66, 74), (255, 138, 76), (90, 200, 150), (240, 190, 90), (100, 180, 240), (215, 150, 200),
     (110, 205, 215), (222, 226, 232)],
    [(130, 138, 148), (255, 160, 110), (120, 220, 170), (250, 210, 120), (140, 200, 250),
     (230, 175, 215), (140, 225, 235), (255, 255, 255)],
)  # fmt: skip


def cubicfish(*args: object, folder: Path, columns: int | None = None) -> str:
    """Run the command in a folder; with ``columns``, and what it prints as on a terminal.

    Talk and progress go to stderr, and are not in it.
    """
    line = [sys.executable, "-m", "cubicfish_cli", *map(str, args)]
    environ = {**os.environ, "CUBICFISH_CACHE": str(folder / "cache"), "TERM": "xterm-256color"}
    environ["PYTHONPATH"] = str(HERE.parent)
    if columns is None:
        done = subprocess.run(
            line, cwd=folder, env=environ, check=True, capture_output=True, text=True
        )
        return done.stdout
    own, other = pty.openpty()
    fcntl.ioctl(other, termios.TIOCSWINSZ, struct.pack("HHHH", 60, columns, 0, 0))
    program = subprocess.Popen(
        line, cwd=folder, env=environ, stdout=other, stderr=subprocess.DEVNULL
    )
    os.close(other)
    shown = b""
    while True:
        try:
            part = os.read(own, 65536)
        except OSError:  # the other side is closed
            break
        if not part:
            break
        shown += part
    os.close(own)
    if program.wait():
        raise SystemExit(shown.decode())
    return shown.decode().replace("\r\n", "\n").strip("\n")


def terminal(name: str, command: str, said: str, columns: int) -> None:
    """A terminal as SVG, with nothing that is loaded from elsewhere."""
    console = Console(record=True, width=columns, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(f"\x1b[1m$ {command}\x1b[0m\n{said}"))
    text = console.export_svg(title="", theme=_THEME, font_aspect_ratio=0.61)
    text = re.sub(r"@font-face \{.*?\}\s*", "", text, flags=re.DOTALL)
    text = text.replace("Fira Code", "ui-monospace, Menlo, Consolas, DejaVu Sans Mono")
    (PICTURES / name).write_text(text, encoding="utf-8")


def jpeg(name: str, picture: Picture) -> None:
    """Write a picture, small enough for a page."""
    cv2.imwrite(str(PICTURES / name), picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def scaled(picture: Picture, width: int) -> Picture:
    """The picture with so many columns."""
    height = round(picture.shape[0] * width / picture.shape[1])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def beside(*pictures: Picture) -> Picture:
    """Pictures of one height in a row."""
    gap = np.full((pictures[0].shape[0], 8, 3), 255, np.uint8)
    parts = [part for picture in pictures for part in (gap, picture)][1:]
    return np.hstack(parts)


def hero(folder: Path) -> None:
    """A photo, and the same with straight lines."""
    photo = SAMPLE / "photos" / HERO
    cubicfish("undistort", photo, "flat.png", "--hfov", 118, "--size", "960x720", folder=folder)
    before, after = cv2.imread(str(photo)), cv2.imread(str(folder / "flat.png"))
    jpeg("hero.jpg", beside(scaled(before, 620), scaled(after, 620)))


def views() -> None:
    """All photos, in two rows."""
    photos = [scaled(cv2.imread(str(path)), 240) for path in sorted(SAMPLE.glob("photos/*.jpg"))]
    gap = np.full((8, 5 * 240 + 4 * 8, 3), 255, np.uint8)
    jpeg("views.jpg", np.vstack([beside(*photos[:5]), gap, beside(*photos[5:])]))


def detected(folder: Path) -> None:
    """What was found in a photo."""
    cubicfish(
        "detect", SAMPLE / "photos" / SHOWN, "-t", SAMPLE / "target.yaml", "-o", "one.csv",
        "--draw", "seen", folder=folder,
    )  # fmt: skip
    (drawn,) = (folder / "seen").iterdir()
    jpeg("detect.jpg", scaled(cv2.imread(str(drawn)), 800))


def advice(folder: Path) -> None:
    """What three photos leave open."""
    few = sorted(SAMPLE.glob("photos/*.jpg"))[4:6]
    cubicfish(
        "calibrate", *few, "-t", SAMPLE / "target.yaml", "-o", "few", "--no-report", folder=folder
    )
    cubicfish("advise", "few", "-o", PICTURES / "advise.svg", "--overwrite", folder=folder)


def rig(folder: Path) -> None:
    """Four rendered photos of one moment, and what a calibrated rig makes of them."""
    sys.path[:0] = [str(HERE.parent / "benchmarks"), str(HERE.parent / "tests")]
    from rigs import NOISE, SETUPS, lens_of  # type: ignore[import-not-found]
    from simulated_rig import combined, simulated_rig  # type: ignore[import-not-found]

    from cubicfish import save_corners, save_target
    from cubicfish.scene import Look, Scene

    setup, names = SETUPS["four"], ("front", "right", "rear", "left")
    lenses = [lens_of(field, number) for number, field in enumerate(setup.fields)]
    corners, truth = simulated_rig(
        lenses, setup.places, setup.target, setup.shots, distances=setup.distances,
        middle=setup.middle, errors=NOISE,
    )  # fmt: skip
    save_target(folder / "box.yaml", setup.target)
    for name, own in zip(names, corners, strict=True):
        save_corners(folder / f"{name}.csv", own)
    cubicfish(
        "rig", "calibrate", *(f"{name}.csv" for name in names), "-t", "box.yaml", folder=folder
    )
    photos = []
    for name, lens, place in zip(names, lenses, truth.camera_from_rig, strict=True):
        pose = combined(place, truth.rig_from_world[0])
        scene = Scene(target=setup.target, lens=lens, image_size=lens.image_size)
        photo = scene.photo(pose, Look(blur=0.5))
        (folder / name).mkdir()
        cv2.imwrite(str(folder / name / "shot_001.png"), photo)
        photos.append(cv2.resize(photo, (302, 302 * photo.shape[0] // photo.shape[1])))
    shot = [f"{name}/shot_001.png" for name in names]
    cubicfish("rig", "undistort", *shot, "all.png", "--distance", 800, folder=folder)
    height = min(len(photo) for photo in photos)
    row = beside(*(cv2.cvtColor(photo[:height], cv2.COLOR_GRAY2BGR) for photo in photos))
    all_round = scaled(cv2.imread(str(folder / "all.png")), row.shape[1])
    gap = np.full((8, row.shape[1], 3), 255, np.uint8)
    jpeg("rig.jpg", np.vstack([row, gap, all_round]))


def chromium(page: Path, picture: Path, width: int, height: int) -> bool:
    """A page as a picture; whether there is a Chromium."""
    program = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    if program is None:
        return False
    subprocess.run(
        [program, "--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader",
         "--hide-scrollbars", "--virtual-time-budget=20000",
         f"--window-size={width},{height}", f"--screenshot={picture}", page.as_uri()],
        check=True, capture_output=True, timeout=600,
    )  # fmt: skip
    return True


def report(folder: Path) -> None:
    """The top of the report, as far as the verdict's section goes."""
    text = (folder / "calibration" / "report.html").read_text(encoding="utf-8")
    rest = "section:not(#verdict), footer { display: none } main { padding-bottom: 24px }"
    page, picture = folder / "top.html", folder / "top.png"
    page.write_text(text.replace("</style>", f"{rest}</style>", 1), encoding="utf-8")
    if not chromium(page, picture, 1180, 2400):
        print("no Chromium: report.png stays as it is")
        return
    shown = cv2.imread(str(picture))
    last = int(np.flatnonzero((shown != shown[-1, 0]).any(axis=(1, 2)))[-1])
    cv2.imwrite(str(PICTURES / "report.png"), shown[: last + 24], [cv2.IMWRITE_PNG_COMPRESSION, 9])


def shoot(folder: Path) -> None:
    """The page of a shoot after three photos."""
    sys.path[:0] = [str(HERE.parent / "tests" / "support")]
    from selenium import webdriver
    from selenium.webdriver.support.ui import WebDriverWait
    from shooting import shooting  # type: ignore[import-not-found]

    options = webdriver.ChromeOptions()
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--window-size=1180,800"):
        options.add_argument(word)
    driver = webdriver.ChromeService(executable_path=shutil.which("chromedriver"))
    options.binary_location = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))))
    browser = webdriver.Chrome(options=options, service=driver)
    folder = folder / "shoot"  # in that of the others there is a calibration
    folder.mkdir()
    try:
        with shooting(folder, "--goal", 0.05) as running:
            for name in (SHOWN, HERO, "corner_05.jpg"):
                shutil.copy(SAMPLE / "photos" / name, folder / "photos")
            browser.get(running.address)
            browser.find_element("id", "begin").click()
            WebDriverWait(browser, 60).until(
                lambda page: page.find_element("id", "photos").text.count(" px") == 3
            )
            # The ghost board breathes: as it is at its clearest.
            browser.execute_script("document.getElementById('ghost').style.animation = 'none'")
            shown = np.frombuffer(browser.get_screenshot_as_png(), np.uint8)
            jpeg("shoot.jpg", np.asarray(cv2.imdecode(shown, cv2.IMREAD_COLOR), np.uint8))
    finally:
        browser.quit()


def main() -> None:
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "sample_data").symlink_to(SAMPLE)
        calibrate = "calibrate sample_data/photos --target sample_data/target.yaml"
        said = cubicfish(*calibrate.split(), folder=folder, columns=104)
        terminal("terminal.svg", f"cubicfish {calibrate}", said, 104)
        terminal("info.svg", "cubicfish info", cubicfish("info", folder=folder, columns=104), 104)
        hero(folder)
        views()
        detected(folder)
        advice(folder)
        rig(folder)
        report(folder)
        if shutil.which("chromedriver"):
            shoot(folder)
    total = sum(path.stat().st_size for path in PICTURES.iterdir())
    for path in sorted(PICTURES.iterdir()):
        print(f"{path.stat().st_size / 1000:7.0f} kB  {path.name}")
    print(f"{total / 1000:7.0f} kB")


if __name__ == "__main__":
    main()
