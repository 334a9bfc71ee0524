"""Make the tables of benchmark.md from benchmark.csv, the published results of benchmarks/open.

python docs/benchmark.py                        # after benchmark.csv was replaced by results.csv
python docs/benchmark.py --check                # ends with 1 where the page is another one
python docs/benchmark.py --against results.csv  # what your run has otherwise, by more than 1 %
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "benchmarks" / "open"))

from report import COLUMNS, best_by_column, shown, standing  # noqa: E402

PAGE, RESULTS = HERE / "benchmark.md", HERE / "benchmark.csv"
BEGIN, END = "<!-- made by docs/benchmark.py from here -->", "<!-- to here -->"
OURS = "cubicfish"
SAME = 0.01  # of a figure: what another run may differ by
COSTS = ("seconds", "memory", "lines")  # of the machine and the adapters
BESIDE = {
    "px_median": "median",
    "px_p95": "95 %",
    "px_rms": "RMS",
    "export_median": "exported, median",
    "halves_median": "halves apart, median",
    "halves_p95": "halves apart, 95 %",
    "own_median": "own corners, median",
    "recall": "recall",
    "seconds": "CPU s",
}
Row = dict[str, Any]


def number(text: str) -> float | str:
    """A cell: a number if it is one."""
    try:
        return float(text)
    except ValueError:
        return text


def read(file: Path) -> dict[str, dict[str, Row]]:
    """By camera and tool what results.csv has; a camera that could not be had has the tool ""."""
    cameras: dict[str, dict[str, Row]] = {}
    with file.open(encoding="utf-8", newline="") as stream:
        for line in csv.DictReader(stream):
            row = {key: number(value) for key, value in line.items() if value}
            cameras.setdefault(line["camera"], {})[line["tool"]] = {"problem": "", **row}
    return cameras


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown; figures stand to the right."""
    names = list(head)
    lines = [names, ["---", *["--:"] * (len(names) - 1)], *map(list, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def held_out(cameras: dict[str, dict[str, Row]], tools: list[str]) -> str:
    """Held-out medians of all tools, a row for each camera."""
    marks = {
        "best": "**{}**",
        "near": "{} ≈",
        "failed": "{} ✗",
        "lost": "{} ▼",
        "lost near": "{} ▼≈",
    }
    lines = []
    for name, rows in cameras.items():
        kinds, line = standing(rows), [name]
        for tool in tools:
            text = shown(rows.get(tool, {}).get("px_median"))
            line.append(marks.get(kinds.get(tool, ""), "{}").format(text))
        lines.append(line)
    return table(["camera", *tools], lines)


def beside(cameras: dict[str, dict[str, Row]]) -> str:
    """Of several measures cubicfish's figure and that of the best other tool."""
    senses = {key: (sense, digits) for _, key, digits, sense in COLUMNS}
    lines = []
    for name, rows in cameras.items():
        others = {tool: row for tool, row in rows.items() if not tool.startswith(OURS)}
        best, line = best_by_column(others), [name]
        for key in BESIDE:
            sense, digits = senses[key]
            own, tool = rows[OURS].get(key), best[key]
            other = others[tool][key] if tool else None
            worse = own is not None and other is not None and sense * own > sense * other
            pair = f"{shown(own, digits)} · {shown(other, digits)}"
            line.append(f"{pair} ▼ {tool}" if worse else pair)
        lines.append(line)
    return table(["camera", *BESIDE.values()], lines)


def claims(cameras: dict[str, dict[str, Row]]) -> str:
    """What each tool says of itself beside what is so: cubicfish has both, others an RMS."""
    lines = []
    for name, rows in cameras.items():
        own = rows[OURS]
        twice = 2 * own["uncertainty_px"]
        lines.append([
            name, shown(own.get("rms_px")), shown(own.get("held_out_px")), shown(own["px_rms"]),
            shown(twice), shown(own["halves_median"]), shown(own["halves_median"] / twice, 2),
        ])  # fmt: skip
    head = ["camera", "RMS, claimed", "held out, claimed", "held out, RMS", "halves apart, claimed"]
    return table([*head, "halves apart", "ratio"], lines)


def tally(cameras: dict[str, dict[str, Row]], tools: list[str]) -> str:
    """How often each tool is best, near it, failed; and what was run."""
    kinds = [standing(rows) for rows in cameras.values()]
    lines = []
    for tool in tools:
        own = [kind.get(tool, "").split() for kind in kinds]
        versions = {str(rows[tool]["version"]) for rows in cameras.values() if tool in rows}
        counts = [str(sum(word in one for one in own)) for word in ("best", "near", "failed")]
        lines.append([tool, *counts, ", ".join(sorted(versions))])
    return table(["tool", "best", "near it", "failed somewhere", "version"], lines)


def made(cameras: dict[str, dict[str, Row]]) -> str:
    """All tables, as they stand between the marks."""
    missing = {name: rows[""]["problem"] for name, rows in cameras.items() if "" in rows}
    cameras = {name: rows for name, rows in cameras.items() if name not in missing}
    every = dict.fromkeys(tool for rows in cameras.values() for tool in rows)
    tools = [
        tool
        for tool in every
        if any("px_median" in rows.get(tool, {}) for rows in cameras.values())
    ]
    photos = [row for rows in cameras.values() for row in list(rows.values())[:1]]
    counted = [
        f"{len(cameras)} cameras, {sum(row['photos'] for row in photos):.0f} photos, "
        f"{sum(row['corners'] for row in photos):.0f} corners; of cameras whose corners cubicfish "
        "did not find itself: "
        + ", ".join(
            f"{name} ({next(iter(rows.values()))['corners_by']})"
            for name, rows in cameras.items()
            if next(iter(rows.values()))["corners_by"] != "cubicfish detect"
        )
        + "."
    ]
    gone = [f"- {name}: {problem}" for name, problem in missing.items()]
    return "\n\n".join([
        *counted,
        "### Held-out error, median, px", held_out(cameras, tools),
        "### Tools", tally(cameras, tools),
        "### cubicfish · the best other tool", beside(cameras),
        "### What cubicfish claims, and what is so", claims(cameras),
        *(["### Not to be had", "\n".join(gone)] if gone else []),
    ])  # fmt: skip


def page(results: Path) -> str:
    """benchmark.md with the tables of these results."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    return f"{before}{BEGIN}\n\n{made(read(results))}\n\n{END}{rest.partition(END)[2]}"


def differences(first: Path, second: Path) -> list[str]:
    """Figures of rows that both have, which are further apart than another run may be."""
    known, lines = read(first), []
    for name, rows in read(second).items():
        for tool, row in rows.items():
            other = known.get(name, {}).get(tool, {})
            for key, value in row.items() if other else ():
                a, b = other.get(key), value
                if key in COSTS or not isinstance(b, float):
                    continue
                if not isinstance(a, float) or not math.isclose(a, b, rel_tol=SAME):
                    lines.append(f"{name}, {tool}: {key} {a} and {b}")
    return lines


def main() -> None:
    """Write the page, look whether it is up to date, or compare two runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--against", type=Path, metavar="RESULTS.CSV")
    given = parser.parse_args()
    if given.against:
        found = differences(RESULTS, given.against)
        sys.exit("\n".join(found) if found else 0)
    text = page(RESULTS)
    if given.check:
        sys.exit(text != PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
