# just --list; https://just.systems

# Quick tests, on all processors
test *args:
    python -m pytest -q -n auto -m "not slow" {{ args }}

# Everything that must hold, in a clean checkout
slow:
    .ci/run

lint:
    ruff check
    ruff format --check

types:
    mypy

# The site, into site/
docs:
    python docs/cli.py
    mkdocs build --strict
    python tests/system/site_links.py site

# Figures of fit, finder and undistortion
bench:
    python benchmarks/fit.py
    python benchmarks/detection.py
    python benchmarks/undistort.py

# Install, calibrate and print in environments of their own
packages:
    python tests/system/packaging/try_packages.py --quick
