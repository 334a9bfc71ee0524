"""Every link of the site leads somewhere, also to files beside the pages."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

from .site_links import broken_links

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("link", "works"),
    [
        ("other/", True),
        ("other/#there", True),
        ("other/#nowhere", False),
        ("#here", True),
        ("#there", False),
        ("Make%20file", True),
        ("run.sh", False),
        ("https://example.org/nowhere", True),
    ],
)
def test_a_link_that_leads_nowhere_is_seen(link: str, works: bool, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "index.html").write_text('<h2 id="there">There</h2>')
    (tmp_path / "Make file").write_text("all:\n")
    (tmp_path / "index.html").write_text(f'<h2 id="here"><a href="{link}">Link</a></h2>')
    assert broken_links(tmp_path) == ([] if works else [f"index.html: {link}"])


@pytest.mark.slow
def test_every_link_of_the_site_leads_somewhere(tmp_path: Path) -> None:
    mkdocs = shutil.which("mkdocs")
    if mkdocs is None:
        pytest.skip("needs mkdocs (the extra docs)")
    done = subprocess.run(
        [mkdocs, "build", "--strict", "--quiet", "--site-dir", tmp_path],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "batch" / "Makefile").is_file()
    assert broken_links(tmp_path) == []
