"""Who may open the page of a shoot: nobody without its token, from elsewhere, by another name."""

import http.client
import json
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from cubicfish_cli.extensions.shoot.server import Page

FORBIDDEN = 403


@pytest.fixture(scope="module")
def page() -> Page:
    return Page("127.0.0.1", None)


def ask(
    page: Page, method: str, what: str, body: str | None = None, **headers: str
) -> tuple[int, http.client.HTTPMessage, bytes]:
    place = urlsplit(page.address)
    asked = http.client.HTTPConnection(place.netloc, timeout=20)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    asked.request(method, what, body, {"Host": place.netloc, **given})
    answer = asked.getresponse()
    return answer.status, answer.headers, b"" if what.endswith("events") else answer.read()


def test_the_page_is_this_machines_alone_and_loads_nothing(page: Page) -> None:
    place = urlsplit(page.address)
    assert place.hostname == "127.0.0.1"
    assert len(page.token) >= 32
    status, headers, text = ask(page, "GET", place.path)
    assert status == 200
    policy = headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy
    assert (headers["Referrer-Policy"], headers["Cache-Control"]) == ("no-referrer", "no-store")
    assert b"http" not in text.replace(b"http://www.w3.org/2000/svg", b"")
    assert b"{{" not in text
    other = Page("127.0.0.1", None)
    assert other.token != page.token


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "localhost:{port}"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec_Fetch_Site": "cross-site"},
        {"Sec_Fetch_Site": "same-site"},
    ],
)
def test_others_are_refused(page: Page, headers: dict[str, str]) -> None:
    place = urlsplit(page.address)
    own = {name: value.format(port=place.port) for name, value in headers.items()}
    for what in ("", "photo", "events", "report", "live"):
        assert ask(page, "GET", place.path + what, **own)[0] == FORBIDDEN
    good = {"Origin": f"http://{place.netloc}", **own}
    assert ask(page, "POST", f"{place.path}asked", '{"do": "stop"}', **good)[0] == FORBIDDEN
    assert page.asked.empty()


@pytest.mark.parametrize("path", ["/", "/photo", "/{token}x/", "/{short}/", "/../{token}/"])
def test_a_wrong_token_is_refused(page: Page, path: str) -> None:
    path = path.format(token=page.token, short=page.token[:-1])
    assert ask(page, "GET", path)[0] == FORBIDDEN
    place = urlsplit(page.address)
    origin = f"http://{place.netloc}"
    assert ask(page, "POST", path, '{"do": "stop"}', Origin=origin)[0] == FORBIDDEN
    assert page.asked.empty()


def test_the_page_itself_is_heard(page: Page, tmp_path: Path) -> None:
    place = urlsplit(page.address)
    origin, asked = {"Origin": f"http://{place.netloc}"}, f"{place.path}asked"
    assert ask(page, "POST", asked, '{"do": "stop"}')[0] == FORBIDDEN  # no page asks without one
    assert ask(page, "POST", asked, '{"do": "stop"}', **origin)[0] == 200
    assert page.asked.get_nowait() == {"do": "stop"}
    for wrong in ("", "stop", "[1]", json.dumps({"do": "x" * 10_000})):
        assert ask(page, "POST", asked, wrong, **origin)[0] == 400
    assert page.asked.empty()
    for what in ("photo", "report", "live", "nothing", "../page.html"):
        assert ask(page, "GET", place.path + what)[0] == 404
    page.picture, page.report = b"jpeg", tmp_path / "report.html"
    page.report.write_text("a report")
    assert ask(page, "GET", f"{place.path}photo?3")[2] == b"jpeg"
    status, headers, text = ask(page, "GET", f"{place.path}report")
    assert (status, text) == (200, b"a report")
    assert "Content-Security-Policy" not in headers  # it brings its own


def test_all_that_look_are_told(page: Page) -> None:
    page.tell({"n": 1})
    number, said = page.told(0, 1)
    assert json.loads(said) == {"n": 1}
    assert page.told(number, 0.01)[0] == number
    place = urlsplit(page.address)
    asked = http.client.HTTPConnection(place.netloc, timeout=20)
    asked.request("GET", f"{place.path}events")
    answer = asked.getresponse()
    assert answer.readline() == b'data: {"n": 1}\n'
    page.tell({"n": 2})
    answer.readline()
    assert answer.readline() == b'data: {"n": 2}\n'
