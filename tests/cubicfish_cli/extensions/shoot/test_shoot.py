"""Photos taken with guidance: what is said of each, what is next, and that none is lost."""

import json
import shutil
import subprocess
from contextlib import suppress
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest
from running import invoke_cli, run_cli
from samples import SAMPLE
from shooting import PHOTOS, TARGET, filmed, shooting

from cubicfish import (
    CubicfishError,
    Finding,
    Observations,
    Target,
    evaluate,
    load_corners,
    read_picture,
)
from cubicfish import Run as HowDone
from cubicfish.judge import Code, Severity
from cubicfish_cli.extensions.shoot import guidance
from cubicfish_cli.extensions.shoot import shoot as module
from cubicfish_cli.extensions.shoot.camera import frames_of
from cubicfish_cli.extensions.shoot.command import ShootOptions, shoot_files
from cubicfish_cli.extensions.shoot.guidance import Guide, held_out_px, same_place
from cubicfish_cli.extensions.shoot.server import Page
from cubicfish_cli.extensions.shoot.shoot import LEFT_OUT, Shoot, Taken
from cubicfish_cli.extensions.shoot.words import Flaw

OBJECT = Target.load(TARGET)


@pytest.fixture(scope="module")
def corners() -> Observations:
    return load_corners(SAMPLE / "true_corners.csv", OBJECT)


def shoot_in(folder: Path, **more: Any) -> Shoot:
    given: dict[str, Any] = {
        "folder": folder,
        "targets": [OBJECT],
        "run": HowDone(jobs=1),
        "goal_px": None,
        "camera": None,
        "page": None,
        "asked": Queue(),
        "say": lambda line: None,
        "calibrate": lambda photos: ("done", folder / "report.html"),
        "first": {"lines": [], "screen": None},
    }
    return Shoot(**{**given, **more})


def taken(folder: Path, corners: Observations, count: int) -> dict[str, Taken]:
    return {
        name: Taken(path=folder / name, stamp=None, corners=corners.of(name).only_seen()[0])
        for name in corners.images[:count]
    }


def test_the_first_views_are_spread_over_the_picture() -> None:
    guide, counts = Guide(OBJECT, (960, 720)), set()
    guidance = guide.after(None)
    assert guidance.view is not None
    assert guidance.fitted is None
    for view in guide._first_views:
        counts.add(tuple((view.pixel.mean(axis=0) > (480, 360)).tolist()))
    assert len(counts) > 1
    ghost = guide.ghost(guidance)
    assert ghost is not None
    assert ghost["dark"].count("M") > 20
    assert guidance.words.startswith("Hold the target")


def test_photos_lead_to_other_views_until_they_are_enough(corners: Observations) -> None:
    guide = Guide(OBJECT, corners.image_size, 0.01)
    some = guide.after(corners.of_photos(np.arange(4)))
    assert some.advice is not None
    assert some.view is not None
    cells = some.cells()
    assert cells is not None
    assert {hit for _, _, hit, _ in cells["squares"]} == {0, 1}
    # Once a photo shows the target there, another view is asked for.
    seen = some.view.seen
    rows = seen.visible
    again = Observations.from_corners(
        [np.column_stack([seen.board, seen.column, seen.row])[rows]],
        [seen.pixel[rows]],
        corners.image_size,
        boards=OBJECT.board_names,
        images=["there"],
    ).with_target(OBJECT)
    names = np.column_stack([again.board, again.column, again.row])
    assert same_place(names, again.pixel, again) == "there"
    assert same_place(names, again.pixel + 60, again) is None
    assert same_place(names[:0], again.pixel[:0], again) is None
    enough = Guide(OBJECT, corners.image_size, 5.0).after(corners)
    assert enough.advice is not None
    assert enough.advice.enough
    assert (enough.view, enough.words, guide.ghost(enough)) == (None, "", None)


def test_the_photos_that_say_most_speak_for_many(
    corners: Observations, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(guidance, "MOST_FITTED", 6)
    guide, every = Guide(OBJECT, corners.image_size, 0.01), np.arange(len(corners.images))
    first = guide.after(corners.of_photos(every[:-1]))
    assert first.pairs is not None
    assert first.fitted is not None
    assert len(first.pairs.images) == 6
    assert first.errors.keys() == set(corners.images[:-1])
    # The next is chosen of those that spoke and the new one; each has an error that is its own.
    spoke, new = set(first.pairs.images), corners.images[-1]
    more = guide.after(corners)
    assert more.pairs is not None
    assert len(more.pairs.images) == 6
    assert set(more.pairs.images) <= spoke | {new}
    other = next(name for name in corners.images if name not in spoke | {new})
    camera = first.fitted.camera
    (alone,) = evaluate(camera, corners.of(other)).photos
    assert more.errors[other] == pytest.approx(alone.rms_px, rel=1e-6)
    # Without one of those all others are weighed again.
    left = [name for name in corners.images if name != more.pairs.images[0]]
    rest = guide.after(corners.of_photos(np.flatnonzero(np.isin(corners.images, left))))
    assert rest.pairs is not None
    assert len(rest.pairs.images) == 6
    assert set(rest.pairs.images) <= set(left)


def test_photos_set_aside_are_measured_by_a_camera_of_the_others(corners: Observations) -> None:
    found = held_out_px(corners, np.array([4, 9]))
    assert found is not None
    rms, each = found
    assert 0 < rms < 0.2
    assert each.keys() == {corners.images[4], corners.images[9]}
    assert held_out_px(corners, np.array([], int)) is None
    assert held_out_px(corners.of_photos(np.array([0])), np.array([0])) is None


def test_the_pose_is_said_before_the_error_is_measured(
    corners: Observations, tmp_path: Path
) -> None:
    said = list[str]()
    shoot = shoot_in(tmp_path, say=said.append, taken=taken(tmp_path, corners, 5))
    shoot._begin(corners.image_size)
    shoot._follow()
    assert len(said) == 1
    assert said[0].startswith(("Hold the target", "Enough"))
    assert "set aside" not in shoot._summary()
    shoot._use_pause()
    assert "set aside" in said[1]
    assert shoot._photo_records()[4]["held"] > 0


def test_what_is_wrong_with_a_photo_is_seen(corners: Observations, tmp_path: Path) -> None:
    shoot = shoot_in(tmp_path)
    shoot.taken = {
        name: replace(one, sharpness=0.5) for name, one in taken(tmp_path, corners, 5).items()
    }
    new = Taken(path=tmp_path / "new", stamp=None, corners=corners.of(corners.images[7]))
    assert shoot._find_flaws(replace(new, sharpness=0.5)) == ()
    assert shoot._find_flaws(replace(new, sharpness=0.2)) == (Flaw.BLURRED,)
    old = corners.of(corners.images[1]).only_seen()[0]
    assert Flaw.SAME in shoot._find_flaws(replace(new, corners=old))
    middle = old.pixel.mean(axis=0)
    far = replace(old, pixel=middle + (old.pixel - middle) / 6)
    assert Flaw.FAR in shoot._find_flaws(replace(new, corners=far))
    part = old.select((old.board == 0) & (old.column < 4))
    part = replace(part, pixel=part.pixel - part.pixel.min(axis=0) + 3)
    assert Flaw.CUT in shoot._find_flaws(replace(new, corners=part))
    inside = replace(part, pixel=part.pixel + 200)
    assert Flaw.CUT not in shoot._find_flaws(replace(new, corners=inside))


def test_what_is_left_out_lasts(corners: Observations, tmp_path: Path) -> None:
    shoot = shoot_in(tmp_path)
    shoot.taken = taken(tmp_path, corners, 4)
    for name in corners.images[:4]:
        shutil.copy(SAMPLE / "photos" / name, tmp_path)
    first, second = corners.images[:2]
    assert shoot.used() == [tmp_path]
    for name in (first, second, second, "nobody"):
        assert shoot.do({"do": "leave_out", "photo": name})
    assert (tmp_path / LEFT_OUT).read_text() == f"{first}\n"
    again = shoot_in(tmp_path)
    again.taken = taken(tmp_path, corners, 4)
    assert again.used() == [tmp_path / name for name in corners.images[1:4]]
    assert [*again._usable()] == [*corners.images[1:4]]


def test_the_user_ends_it(tmp_path: Path) -> None:
    said: list[str] = []
    shoot = shoot_in(tmp_path, say=said.append)
    assert shoot.do({"do": "nonsense"})
    assert not shoot.do({"do": "stop"})
    assert not shoot.do({"do": "finish"})  # without a page there is nobody to go on with
    assert said == ["done"]

    def fail(photos: object) -> tuple[str, Path]:
        raise CubicfishError("too few")

    with pytest.raises(CubicfishError, match="too few"):
        shoot_in(tmp_path, calibrate=fail).do({"do": "finish"})
    page = Page("127.0.0.1", None)
    assert shoot_in(tmp_path, calibrate=fail, page=page).do({"do": "finish"})
    assert json.loads(page.told(0, 1)[1])["ended"] == {"said": "too few", "report": False}


@pytest.mark.slow
def test_a_photo_is_taken_when_it_is_whole(tmp_path: Path) -> None:
    shoot, path, data = shoot_in(tmp_path), tmp_path / "a.jpg", PHOTOS[0].read_bytes()

    def look() -> list[str]:
        shoot._next_look = 0.0
        new = shoot._find_new()
        if new:
            shoot._look(new)
        return [photo.name for photo in new]

    path.write_bytes(data[:9000])
    assert look() == []
    assert look() == ["a.jpg"]  # it did not grow
    assert shoot.taken == {}
    path.write_bytes(data[:20000])
    assert look() == []
    path.write_bytes(data)
    assert look() == []
    assert look() == ["a.jpg"]
    corners = shoot.taken["a.jpg"].corners
    assert corners is not None
    assert len(corners.pixel) > 100
    assert look() == []
    path.unlink()
    assert (look(), shoot.taken) == ([], {})


@pytest.mark.slow
def test_what_may_be_wrong_with_the_target_is_tried_while_nobody_waits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = Finding(code=Code.NO_MARKERS, severity=Severity.BAD)
    monkeypatch.setattr("cubicfish.observe.detection.find_faults", lambda evidence: [wrong])
    shoot, said = shoot_in(tmp_path), list[str]()
    shoot.say = said.append
    for number in range(5):
        shutil.copy(PHOTOS[number], tmp_path)
    shoot._find_new()
    shoot._next_look = 0.0
    shoot._look(shoot._find_new())
    assert all(one.corners is not None for one in shoot.taken.values())
    for _ in range(5):
        shoot._check()
    refused = [one.path.name for one in shoot.taken.values() if one.corners is None]
    assert refused == [path.name for path in PHOTOS[:3]]  # so many tell
    assert all(shoot.taken[name].remarks in "".join(said) for name in refused)
    assert all(shoot.taken[name].remarks for name in refused)


@pytest.mark.slow
def test_a_photo_without_corners_says_why(tmp_path: Path) -> None:
    shoot, said = shoot_in(tmp_path), list[str]()
    shoot.say = said.append
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((480, 640), 128, np.uint8))
    soft = cv2.GaussianBlur(read_picture(PHOTOS[0]), (0, 0), 14)
    cv2.imwrite(str(tmp_path / "soft.png"), soft)
    for _ in range(2):
        new = shoot._find_new()
        shoot._next_look = 0.0
    for photo in new:
        shoot._look([photo])
    assert [one.corners for one in shoot.taken.values()] == [None, None]
    assert all(one.remarks for one in shoot.taken.values())
    assert "blurred" in said[1]


@pytest.mark.slow
def test_finishing_is_calibrating(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    monkeypatch.chdir(tmp_path)
    shutil.copytree(SAMPLE / "photos", "photos")
    shutil.copy(TARGET, "target.yaml")
    Path("photos", LEFT_OUT).write_text("corner_02.jpg\n")
    line = ["shoot", "photos", "--no-page", "--goal", "0.1", "--jobs", "1"]
    said = run_cli(*line, "-o", "one", input="\n").stdout
    assert "Written to one" in said
    photos = [str(path) for path in sorted(Path("photos").glob("*.jpg"))]
    photos.remove("photos/corner_02.jpg")
    run_cli("calibrate", *photos, "-o", "two")
    for name in ("camera.yaml", "corners.csv"):
        assert Path("one", name).read_bytes() == Path("two", name).read_bytes()
    assert "exists already" in invoke_cli(*line, "-o", "one").stderr
    Path("photos", LEFT_OUT).unlink()
    shoot_of = ["shoot", "photos", "--no-page", "--board", "9x6", "--square", "1in", "-o", "three"]
    assert invoke_cli(*shoot_of, "--no-cache", input="\n").exit_code in (0, 1)
    assert run_cli(*line, "-o", "one", "--overwrite", "-t", "target.yaml", input="\n").stdout
    run_cli("calibrate", "photos", "-t", "target.yaml", "-o", "two", "--overwrite")
    assert Path("one/camera.yaml").read_bytes() == Path("two/camera.yaml").read_bytes()


def test_mistakes_are_told_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    for words, code, said in (
        (["photos"], 2, "name the target"),
        (["photos", "-t", TARGET, "--no-page", "--on-screen"], 2, "--no-page"),
        (["photos", "-t", TARGET, "--no-page", "--listen", "192.0.2.1"], 2, "--no-page"),
        (["photos", "-t", TARGET, "--listen", "0.0.0.0"], 2, "one address"),
        (["photos", "-t", TARGET, "--listen", "192.0.2.1"], 1, "is it this machine's"),
        (["photos", "-t", TARGET, "--camera", "nothing.mp4"], 1, "nothing.mp4"),
        (["photos", "-t", TARGET, "--camera", "97"], 1, "plugged in"),
        (["photos", "-t", TARGET, "--camera", "http://127.0.0.1:9/"], 1, "address right"),
        (["file", "-t", TARGET], 2, "is a file"),
    ):
        found = invoke_cli("shoot", *words)
        assert (found.exit_code, said in found.stderr) == (code, True), (words, found.stderr)
    assert [path.name for path in Path().iterdir()] == ["file"]


def test_a_program_shoots_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Shoot, "go_on", lambda self: None)
    given = ShootOptions(photos=tmp_path, target=TARGET, folder=tmp_path / "c", on_screen=True)
    assert shoot_files(given).photos == (tmp_path,)


def test_a_thousand_photos_are_told_in_little(corners: Observations, tmp_path: Path) -> None:
    page = Page("127.0.0.1", None)
    shoot = shoot_in(tmp_path, page=page)
    one = taken(tmp_path, corners, 1)[corners.images[0]]
    shoot.taken = {f"photo_{n:04d}.jpg": replace(one, flaws=(*Flaw,)) for n in range(1000)}
    shoot._tell()
    assert len(page.told(0, 1)[1]) + len(page.html) < 2_000_000


class _Stream(BaseHTTPRequestHandler):
    """Sends one photo after the other as cameras in a network do, each ten times."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
        self.end_headers()
        with suppress(OSError):
            for photo in PHOTOS:
                data = photo.read_bytes()
                head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n"
                self.wfile.write(10 * (head.encode() + data + b"\r\n"))

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""


def test_a_stream_is_a_camera() -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), _Stream) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        frames = [*frames_of(f"http://127.0.0.1:{server.server_port}/stream")]
        server.shutdown()
    assert len(frames) >= 9 * len(PHOTOS)  # the end of a stream may be cut
    for number in (0, 5):
        away = frames[10 * number + 2].astype(float) - read_picture(PHOTOS[number])
        assert np.abs(away).mean() < 2


@pytest.mark.slow
def test_it_is_served_at_the_address_that_is_named(tmp_path: Path) -> None:
    with shooting(tmp_path, "--listen", "127.0.0.2") as running:
        assert running.address.startswith("http://127.0.0.2:")
        assert running.process.stdout is not None
        assert running.process.stdout.readline().startswith("note: everybody in this network")
        port = urlsplit(running.address).port
        assert running.ask("GET")[0] == 200
        assert running.ask("GET", Host=f"127.0.0.1:{port}")[0] == 403
        assert running.ask("GET", "/")[0] == 403


@pytest.mark.slow
def test_what_was_taken_survives_being_killed(tmp_path: Path) -> None:
    film = filmed(tmp_path / "film.mkv")
    kept: dict[str, bytes] = {}
    for wait in (1, 2, 3):  # those of before are told of again
        with shooting(tmp_path, "--camera", film, page=False) as running:
            assert running.process.stdout is not None
            lines = filter(lambda line: line.startswith("shoot_"), running.process.stdout)
            for _ in range(wait):
                next(lines)
            running.process.kill()
        photos = {path.name: path.read_bytes() for path in tmp_path.glob("photos/*.png")}
        assert kept.items() <= photos.items()
        assert len(photos) >= wait
        for path in tmp_path.glob("photos/*.png"):
            read_picture(path)
        kept = photos
    assert len(kept) > 2
    assert module._FRAME.format(1) in kept
    with shooting(tmp_path, page=False) as running:
        with pytest.raises(subprocess.TimeoutExpired):
            running.process.wait(2)
        running.process.terminate()
        running.process.wait(60)
    assert {path.name for path in tmp_path.glob("photos/*")} == {*kept}
