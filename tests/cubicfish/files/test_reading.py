import os
import threading
import time

import pytest

from cubicfish.errors import TargetError
from cubicfish.files import reading
from cubicfish.files.reading import read_bytes, read_text

UNIX = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")


def read(path, most=1000):
    return read_bytes(path, max_bytes=most, error=TargetError)


def test_files_are_read_up_to_the_bound(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"x" * 1000)
    assert read(path) == b"x" * 1000
    with pytest.raises(TargetError, match=r"a is larger than 0\.000999 MB"):
        read(path, 999)
    path.write_bytes(b"\xef\xbb\xbf\xc3\xa9")
    assert read_text(path, max_bytes=10, error=TargetError) == "é"
    path.write_bytes("é".encode("utf-16"))
    with pytest.raises(TargetError, match="not UTF-8 text"):
        read_text(path, max_bytes=10, error=TargetError)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("absent", "does not exist: check the name"),
        (".", "cannot be read: Is a directory"),
        ("a\0b", "cannot be read: .*null"),
    ],
)
def test_what_is_no_file_is_refused(tmp_path, name, says):
    with pytest.raises(TargetError, match=says):
        read(tmp_path / name)


@UNIX
def test_devices_without_end_are_read_up_to_the_bound():
    with pytest.raises(TargetError, match="/dev/zero is larger"):
        read("/dev/zero")


@UNIX
def test_a_pipe_that_nobody_writes_to_is_not_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "PATIENCE", 0.05)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(TargetError, match="nobody writes to this pipe"):
        read(tmp_path / "pipe")


@UNIX
def test_a_pipe_with_a_writer_is_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "PATIENCE", 0.05)
    path = tmp_path / "pipe"
    os.mkfifo(path)

    def write():
        with path.open("wb") as file:
            time.sleep(0.2)
            file.write(b"slow")
            file.flush()
            time.sleep(0.1)
            file.write(b"ly")

    writer = threading.Thread(target=write)
    # Somebody has it open before: otherwise who opens first is a matter of chance.
    held = os.open(path, os.O_RDWR)
    writer.start()
    time.sleep(0.1)
    os.close(held)
    assert read(path) == b"slowly"
    writer.join()
