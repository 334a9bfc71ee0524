"""A shoot as a process of its own, and what it is asked on its page."""

import http.client
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import cv2
from samples import SAMPLE

PHOTOS = sorted((SAMPLE / "photos").glob("*.jpg"))
TARGET = SAMPLE / "target.yaml"


class Running:
    """A shoot that runs, and the address of its page, if it has one."""

    def __init__(self, folder: Path, *words: object, page: bool = True) -> None:
        line = [sys.executable, "-m", "cubicfish_cli", "shoot", "photos", "-t", TARGET, *words]
        self.process = subprocess.Popen(
            [*map(str, line), *([] if page else ["--no-page"])],
            cwd=folder,
            env={**os.environ, "CUBICFISH_CACHE": str(folder / "cache"), "PYTHONUNBUFFERED": "1"},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.address = ""
        if page:
            assert self.process.stdout is not None
            said = self.process.stdout.readline()
            found = re.search(r"http://\S+/", said)
            assert found is not None, said + self.process.stdout.read()
            self.address = found[0]

    def ask(
        self, method: str, what: str = "", body: object = None, **headers: str
    ) -> tuple[int, dict[str, str], bytes]:
        """Status, headers and body of an answer; ``what`` from / on is in the token's place."""
        place = urlsplit(self.address)
        assert place.netloc
        given = {"Host": place.netloc, **({"Origin": f"http://{place.netloc}"} if body else {})}
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        asked = http.client.HTTPConnection(place.netloc, timeout=30)
        asked.request(
            method,
            what if what.startswith("/") else place.path + what,
            None if body is None else json.dumps(body),
            given,
        )
        answer = asked.getresponse()
        return answer.status, dict(answer.headers), answer.read()

    def told(self) -> Iterator[dict[str, Any]]:
        """What the page is told, as it is told."""
        place = urlsplit(self.address)
        asked = http.client.HTTPConnection(place.netloc, timeout=60)
        asked.request("GET", f"{place.path}events")
        answer = asked.getresponse()
        for line in iter(answer.readline, b""):
            if line.startswith(b"data: "):
                yield json.loads(line[6:])

    def wait_for(self, is_so: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """What the page is told once something is so."""
        begun, said = time.monotonic(), None
        for said in self.told():
            if is_so(said):
                return said
            assert time.monotonic() - begun < 120, said
        raise AssertionError(said)


@contextmanager
def shooting(folder: Path, *words: object, page: bool = True) -> Iterator[Running]:
    """A shoot in a folder, which is ended after all."""
    (folder / "photos").mkdir(exist_ok=True)
    running = Running(folder, *words, page=page)
    try:
        yield running
    finally:
        running.process.kill()
        running.process.communicate()


def filmed(path: Path, *, seconds: float = 4.0, rate: int = 5) -> Path:
    """A film that shows one sample photo after the other, each for so long."""
    import av  # the extra video

    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": "8"})
        stream.pix_fmt = "yuv420p"
        pictures = [cv2.imread(str(photo)) for photo in PHOTOS]
        stream.height, stream.width = pictures[0].shape[:2]
        for picture in pictures:
            for _ in range(round(seconds * rate)):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")))
        container.mux(stream.encode(None))
    return path
