"""results.csv and one page of all that run.py left: ``report.py WORK NAMES``."""

import csv
import html
import json
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
from trial import FOLDS, known

BINS = np.arange(0, 136, 15)  # degrees from the axis
DRAWS = 1000  # of the photos, for intervals
COLUMNS = (
    ("held out px: median", "px_median", 3), ("95 %", "px_p95", 3), ("RMS", "px_rms", 3),
    ("arc min: median", "min_median", 2), ("95 %", "min_p95", 2), ("RMS", "min_rms", 2),
    ("has a pixel", "projected", 3), ("board", "board", 0),
    ("as drawn: median", "drawn_median", 3), ("halves apart: median", "halves_median", 3),
    ("95 %", "halves_p95", 3), ("claims RMS", "rms_px", 3), ("claims held out", "held_out_px", 3),
    ("claims σ", "uncertainty_px", 3), ("own corners: median", "own_median", 3),
    ("recall", "recall", 3), ("exported: median", "export_median", 3), ("CPU s", "seconds", 2),
    ("MB", "memory", 0), ("lines", "lines", 0),
)  # fmt: skip


def interval(error, photo):
    """95 % interval of the median, photos drawn with replacement."""
    photos = [error[photo == one] for one in np.unique(photo)]
    draws = np.random.default_rng(0).integers(len(photos), size=(DRAWS, len(photos)))
    found = [np.median(np.concatenate([photos[k] for k in draw])) for draw in draws]
    return np.quantile(found, (0.025, 0.975), method="nearest")


def spread(error, name):
    """Median, 95 % and, of what the lens has a pixel for, RMS."""
    seen = error[np.isfinite(error)]
    high = np.quantile(error, 0.95, method="nearest")
    rms = np.sqrt(np.mean(seen**2)) if len(seen) else np.inf
    return {f"{name}_median": np.median(error), f"{name}_p95": high, f"{name}_rms": rms}


def row_of(folder, count):
    """All figures of one tool on one camera, of so many folds, and its arrays for the plots."""
    about = json.loads((folder / "about.json").read_text(encoding="utf-8"))
    pieces = {file.stem: known(folder, file.stem) for file in folder.glob("[!a]*.[nj]*")}
    full, found = pieces.get("full", {}), pieces.get("detect", {})
    folds = [pieces[name] for name in sorted(pieces) if name.startswith("fold")]
    problems = [str(one["problem"]) for one in [full, *folds] if "problem" in one]
    row = {"problem": problems[0] if problems else "", "exported_to": about.get("EXPORT", "")}
    if "px" in full:
        row |= json.loads(str(full["claims"])) | spread(full["px"], "fitted")
        row |= {key: float(full[key]) for key in ("seconds", "memory", "lines")}
        row |= {"note": str(full["note"]), "starts_lost": str(full["lost"])}
        row["board"] = "refined" if full["refined"] else "as drawn"
    for prefix, name, key in (
        ("fold", "px", "px"), ("fold", "min", "min"), ("fold", "drawn", "drawn"),
        ("fold", "export", "export"), ("own", "own", "px"), ("halves", "halves", "px"),
    ):  # fmt: skip
        own = [pieces[one] for one in sorted(pieces) if one.startswith(prefix)]
        if any(key in one for one in own):
            # A fold in which the tool left the board as drawn has one error, not two.
            other = "px" if key == "drawn" else key
            parts = [one.get(key, one.get(other)) for one in own if key in one or other in one]
            row |= spread(np.concatenate(parts), name)
    good = [one for one in folds if "px" in one]
    if len(good) < count and full and not problems:
        row["problem"] = f"{len(good)} of {count} folds are done"
    if good:
        row["arrays"] = {key: np.concatenate([one[key] for one in good]) for key in ("px", "angle")}
        photo = np.concatenate([one["photo"] for one in good])
        row["projected"] = np.isfinite(row["arrays"]["px"]).mean()
        row["low"], row["high"] = interval(row["arrays"]["px"], photo)
        row["folds"] = f"{len(good)} of {count}"
    if "recalled" in found:
        row["recall"], row["recalled"] = found["recalled"].mean(), found["recalled"]
    told = [found.get("problem", ""), *(one.get("export_problem", "") for one in folds)]
    row["remarks"] = "; ".join(dict.fromkeys(str(one) for one in told if str(one)))
    return about["tool"], row


def add_angles(rows, order):
    """Errors and recall by angle. A corner's angle is the median of what all lenses say.

    ``order``: where each corner of the table is among those held out.
    """
    arrays = [
        r["arrays"] for r in rows.values() if "arrays" in r and len(r["arrays"]["px"]) == len(order)
    ]
    if not arrays:
        return
    angle = np.median([one["angle"] for one in arrays], axis=0)
    for row in rows.values():
        values = {"error": row.get("arrays", {}).get("px")}
        if "recalled" in row:
            values["recall"] = row["recalled"][order]
        for name, value in values.items():
            for low, high in pairwise(BINS):
                inside = (angle >= low) & (angle < high)
                if value is not None and len(value) == len(angle) and inside.sum() >= 10:
                    measure = np.median if name == "error" else np.mean
                    row[f"{name}_{low}_{high}"] = measure(value[inside])


def plot(rows, name, label):
    """Lines of values by angle, as SVG."""
    lines = {}
    for tool, row in rows.items():
        keys = [(low + 7.5, f"{name}_{low}_{high}") for low, high in pairwise(BINS)]
        lines[tool] = [(x, row[key]) for x, key in keys if np.isfinite(row.get(key, np.nan))]
    values = sorted(value for line in lines.values() for _, value in line)
    if not values:
        return ""
    top = min(values[-1], 6 * values[len(values) // 2]) * 1.05 or 1.0
    wide = max(x for line in lines.values() for x, _ in line) + 7.5
    parts = [f'<svg viewBox="0 0 560 240" width="560"><text x="4" y="12">{label}</text>']
    for tick in np.linspace(0, top, 5):
        y = 190 - 165 * tick / top
        parts.append(f'<path d="M40 {y:.1f}H400" stroke="#ddd"/>')
        parts.append(f'<text x="2" y="{y + 4:.1f}">{tick:.2g}</text>')
    parts += [f'<text x="{40 + 360 * a / wide:.0f}" y="206">{a}°</text>' for a in BINS if a <= wide]
    for k, (tool, line) in enumerate(lines.items()):
        if line:
            colour, right = f"hsl({137 * k % 360} 75% 38%)", 360 / wide
            places = [f"{40 + right * x:.1f} {190 - 165 * min(v, top) / top:.1f}" for x, v in line]
            parts.append(f'<path d="M{"L".join(places)}" fill="none" stroke="{colour}"/>')
            parts.append(f'<text x="406" y="{24 + 15 * k}" fill="{colour}">{tool}</text>')
    return "".join(parts) + "</svg>"


def shown(value, digits=3):
    """A cell's text."""
    if value is None or value == "":
        return "–"
    if isinstance(value, str):
        return html.escape(value)
    return f"{value:.{digits}f}" if value < 1000 else f"{value:.0f}".replace("inf", "∞")


def table(head, rows):
    """HTML; cells are texts, or (text, class)."""
    lines = ["".join(f"<th>{one}</th>" for one in head)]
    for row in rows:
        pairs = [one if isinstance(one, tuple) else (one, "") for one in row]
        lines.append("".join(f'<td class="{kind}">{text}</td>' for text, kind in pairs))
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def best_of(rows):
    """The best by held-out median of those that did all folds, and those hardly told from it."""
    whole = {tool: row for tool, row in rows.items() if "low" in row and not row["problem"]}
    if not whole:
        return None, set()
    best = min(whole, key=lambda tool: whole[tool]["px_median"])
    return best, {tool for tool, row in whole.items() if row["low"] <= rows[best]["high"]}


def overview(rows, tools):
    """Cells of one camera."""
    (best, near), cells = best_of(rows), []
    for tool in tools:
        row = rows.get(tool, {})
        kind = "best" if tool == best else "near" if tool in near else ""
        if tool == "cubicfish" and best and not best.startswith("cubicfish"):
            kind = "lost"
        text = shown(row.get("px_median"))
        if "low" in row:
            text += f"<br><small>{shown(row['low'])}–{shown(row['high'])}</small>"
        if row.get("problem"):
            text, kind = f'<span title="{html.escape(row["problem"])}">{text} ✗</span>', ""
        cells.append((text, kind))
    return cells


def page(cameras, tools, missing):
    """The whole page."""
    lines, parts = [], []
    for name, (about, rows) in cameras.items():
        counted = f"{about['photos']} of {about['files']}"
        lines.append([f'<a href="#{name}">{name}</a>', counted, *overview(rows, tools)])
        source, size = about.get("repo", ""), "x".join(map(str, about["size"]))
        told = (
            f'<a href="{source}">{source}</a>, licence: {about.get("licence")}. ' if source else ""
        )
        parts.append(f'<h2 id="{name}">{name}</h2><p>{told}{size} px, {counted} photos, ')
        parts.append(f"{about['corners']} corners by {about['corners_by']}.</p>")
        full = []
        for tool, row in rows.items():
            said = "; ".join(filter(None, (row["problem"], row.get("note"), row["remarks"])))
            cells = [shown(row.get(key), digits) for _, key, digits in COLUMNS]
            full.append([tool, *cells, (html.escape(said), "bad")])
        parts.append(table(["tool", *(title for title, _, _ in COLUMNS), "remarks"], full))
        parts.append(plot(rows, "error", "held-out median, px, by angle from the axis"))
        parts.append(plot(rows, "recall", "share of the table's corners that its detector finds"))
    lines += [[name, "not here", (html.escape(why), "bad")] for name, why in missing.items()]
    text = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    first = table(["camera", "photos", *tools], lines)
    return text.replace("OVERVIEW", first).replace("CAMERAS", "".join(parts))


def main():
    """Write results.csv and index.html."""
    work, (names, tools) = Path(sys.argv[1]), json.loads(sys.argv[2])
    missing = json.loads((work / "missing.json").read_text(encoding="utf-8"))
    cameras, lines = {}, []
    for name in [one for one in names if one not in missing]:
        job = np.load(work / "jobs" / name / "job.npz")
        fold = np.arange(len(job["names"])) % min(FOLDS, len(job["names"]))
        fold = np.where(job["test"], 0, -1) if job["test"].any() else fold
        of_corner, count = fold[job["image"]], fold.max() + 1
        rows = dict(row_of(folder, count) for folder in (work / "results" / name).iterdir())
        rows = {tool: rows[tool] for tool in tools if tool in rows}
        add_angles(rows, np.concatenate([np.flatnonzero(of_corner == k) for k in range(count)]))
        about = json.loads((work / "jobs" / name / "about.json").read_text(encoding="utf-8"))
        cameras[name] = about, rows
        for tool, row in rows.items():
            plain = {key: value for key, value in row.items() if key not in ("arrays", "recalled")}
            numbers = {k: f"{v:.6g}" for k, v in plain.items() if isinstance(v, float)}
            lines.append({"camera": name, "tool": tool} | plain | numbers)
        best, _ = best_of(rows)
        print(f"{name}: {best}, {shown(rows[best]['px_median'])} px" if best else f"{name}: nobody")
    lines += [{"camera": name, "problem": f"not here: {why}"} for name, why in missing.items()]
    with (work / "results.csv").open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(dict.fromkeys(key for line in lines for key in line)))
        writer.writeheader()
        writer.writerows(lines)
    (work / "index.html").write_text(page(cameras, tools, missing), encoding="utf-8")
    print(f"{work / 'results.csv'}, {work / 'index.html'}")


if __name__ == "__main__":
    main()
