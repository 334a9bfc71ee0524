"""results.csv and one page, of all that run.py left: ``report.py WORK NAMES``, by cubicfish's Python."""

import csv
import html
import json
import sys
from pathlib import Path

import numpy as np
from trial import known

BINS = np.arange(0, 136, 15)  # degrees from the axis
DRAWS = 1000  # of the photos, for intervals
COLOURS = ("#0a6", "#7b3", "#06c", "#39f", "#c60", "#fa3", "#a0c", "#d5c", "#888", "#444", "#b22", "#e88")


def joined(folder, prefix, key):
    """An array over all folds; None where a fold has none."""
    parts = [known(folder, file.stem) for file in sorted(folder.glob(f"{prefix}fold*.*"))]
    good = [part for part in parts if key in part]
    return (np.concatenate([part[key] for part in good]) if good else None), len(good), len(parts)


def interval(error, photo):
    """95 % interval of the median, photos drawn with replacement."""
    photos = [error[photo == one] for one in np.unique(photo)]
    rng = np.random.default_rng(0)
    draws = rng.integers(len(photos), size=(DRAWS, len(photos)))
    found = [np.median(np.concatenate([photos[k] for k in draw])) for draw in draws]
    return np.quantile(found, 0.025, method="nearest"), np.quantile(found, 0.975, method="nearest")


def spread(error, name):
    """Median, 95 % and RMS by name; RMS of what the lens has a pixel for, and how much that is."""
    finite = np.isfinite(error)
    rms = np.sqrt(np.mean(error[finite] ** 2)) if finite.any() else np.inf
    p95 = np.quantile(error, 0.95, method="nearest")
    return {f"{name}_median": np.median(error), f"{name}_p95": p95, f"{name}_rms": rms}


def row_of(folder, about):
    """All figures of one tool on one camera, and its arrays for the plots."""
    row = {"problem": ""}
    full = known(folder, "full")
    row["problem"] = str(full.get("problem", ""))
    if "px" in full:
        claims = json.loads(str(full["claims"]))
        row |= {"claimed_rms_px": claims.get("rms_px"), "claimed_held_out_px": claims.get("held_out_px"),
                "claimed_uncertainty_px": claims.get("uncertainty_px"), "cpu_s": float(full["seconds"]),
                "memory_mb": float(full["memory"]), "lines": int(full["lines"]), "note": str(full["note"]),
                "board": "refined" if full["refined"] else "as drawn", "starts_lost": str(full["lost"]),
                **spread(full["px"], "fitted_px")}  # fmt: skip
    error, good, folds = joined(folder, "", "px")
    row["folds"] = f"{good} of {folds}" if folds else ""
    if error is not None:
        photo = joined(folder, "", "photo")[0]
        row |= spread(error, "px") | spread(joined(folder, "", "min")[0], "arcmin")
        row |= {"projected": np.isfinite(error).mean(), "angle": joined(folder, "", "angle")[0]}
        row["low"], row["high"] = interval(error, photo)
        row |= {"error": error, "photo": photo}
        if good < folds:
            problems = [known(folder, f.stem).get("problem") for f in folder.glob("fold*.*")]
            row["problem"] = "a fold: " + str(next(one for one in problems if one is not None))
    for name, prefix, key in (("drawn", "", "drawn_px"), ("export", "", "export_px"), ("own", "own_", "px")):
        error = joined(folder, prefix, key)[0]
        if error is not None:
            row |= spread(error, f"{name}_px")
    halves, found = known(folder, "halves"), known(folder, "detect")
    if "px" in halves:
        row |= spread(halves["px"], "halves_px")
    if "recalled" in found:
        row |= {"recalled": found["recalled"], "recall": found["recalled"].mean()}
    row["detector"] = str(found.get("problem", "")) or ("" if found else "none here")
    row["export"] = about.get("EXPORT", "none here")
    return row


def by_angle(rows):
    """Add to each row its median error and recall by angle: each corner's angle is all tools' median."""
    angles = [row["angle"] for row in rows.values() if "angle" in row and row["folds"][0] == row["folds"][-1]]
    angles = [one for one in angles if len(one) == max(map(len, angles))]
    if not angles:
        return
    middle = np.nanmedian(angles, axis=0)
    for row in rows.values():
        for name, values in (("by_angle", row.get("error")), ("recall_by_angle", row.get("recalled"))):
            if values is None or len(values) != len(middle):
                continue
            for low, high in zip(BINS[:-1], BINS[1:], strict=True):
                inside = (middle >= low) & (middle < high)
                if inside.sum() >= 10:
                    value = np.median(values[inside]) if name == "by_angle" else values[inside].mean()
                    row[f"{name}_{low}_{high}"] = value


def plot(rows, name, label):
    """Lines of values by angle, as SVG."""
    lines = []
    for tool, row in rows.items():
        keys = [(low, f"{name}_{low}_{low + 15}") for low in BINS[:-1]]
        line = [(low + 7.5, row[key]) for low, key in keys if np.isfinite(row.get(key, np.nan))]
        if line:
            lines.append((tool, line))
    if not lines:
        return ""
    values = sorted(value for _, line in lines for _, value in line)
    top = min(values[-1], 8 * values[len(values) // 2]) * 1.05 or 1.0
    right = max(x for _, line in lines for x, _ in line) + 7.5
    parts = [f'<svg viewBox="0 0 560 {220 + 0}" width="560"><text x="4" y="12">{label}</text>']
    for tick in np.linspace(0, top, 5):
        y = 190 - 165 * tick / top
        parts.append(f'<path d="M40 {y:.1f}H400" stroke="#ddd"/><text x="2" y="{y + 4:.1f}">{tick:.2g}</text>')
    parts += [f'<text x="{40 + 360 * a / right:.0f}" y="206">{a}°</text>' for a in BINS if a <= right]
    for k, (tool, line) in enumerate(lines):
        colour = COLOURS[list(rows).index(tool) % len(COLOURS)]
        d = "L".join(f"{40 + 360 * x / right:.1f} {190 - 165 * min(v, top) / top:.1f}" for x, v in line)
        parts.append(f'<path d="M{d}" fill="none" stroke="{colour}" stroke-width="2"/>')
        parts.append(f'<text x="406" y="{24 + 15 * k}" fill="{colour}">{html.escape(tool)}</text>')
    return "".join(parts) + "</svg>"


def shown(value, digits=3):
    """A cell's text."""
    if value is None or value == "":
        return "–"
    if isinstance(value, str):
        return html.escape(value)
    return f"{value:.{digits}f}" if value < 1000 else ("∞" if not np.isfinite(value) else f"{value:.0f}")


def table(head, rows):
    """HTML; cells are texts, or (text, class)."""
    cells = [[one if isinstance(one, tuple) else (one, "") for one in row] for row in rows]
    body = "".join("<tr>" + "".join(f'<td class="{c}">{t}</td>' for t, c in row) + "</tr>" for row in cells)
    return "<table><tr>" + "".join(f"<th>{one}</th>" for one in head) + f"</tr>{body}</table>"


def best_of(rows):
    """Names of the best by held-out median, and of those whose intervals reach it."""
    whole = {t: r for t, r in rows.items() if "px_median" in r and not r["problem"]}
    if not whole:
        return None, set()
    best = min(whole, key=lambda tool: whole[tool]["px_median"])
    return best, {tool for tool, row in whole.items() if row["low"] <= rows[best]["high"]}


COLUMNS = (
    ("held out px: median", "px_median", 3), ("95 %", "px_p95", 3), ("RMS", "px_rms", 3),
    ("arc min: median", "arcmin_median", 2), ("95 %", "arcmin_p95", 2), ("RMS", "arcmin_rms", 2),
    ("has a pixel", "projected", 3), ("board", "board", 0), ("board as drawn: median", "drawn_px_median", 3),
    ("halves apart: median", "halves_px_median", 3), ("95 %", "halves_px_p95", 3),
    ("claims RMS", "claimed_rms_px", 3), ("claims held out", "claimed_held_out_px", 3),
    ("claims σ", "claimed_uncertainty_px", 3), ("own corners: median", "own_px_median", 3),
    ("recall", "recall", 3), ("exported: median", "export_px_median", 3), ("CPU s", "cpu_s", 2),
    ("MB", "memory_mb", 0), ("lines", "lines", 0),
)  # fmt: skip
STYLE = """body{font:14px sans-serif;margin:2em auto;max-width:1500px}table{border-collapse:collapse}
td,th{border:1px solid #ccc;padding:2px 6px;text-align:right;vertical-align:top}th{background:#eee}
td:first-child,.left{text-align:left}.best{background:#bfd;font-weight:bold}.near{background:#e6fbe6}
.lost{background:#fdc}.bad{color:#a00;text-align:left;max-width:30em}svg text{font-size:11px}"""


def page(cameras, tools, missing):
    """The whole page."""
    head, overview, parts = ["camera", "photos", *map(html.escape, tools)], [], []
    for name, (about, rows) in cameras.items():
        best, near = best_of(rows)
        link = f'<a href="#{name}">{name}</a>'
        line = [link, f"{about['photos']} of {about['files']}"]
        for tool in tools:
            row = rows.get(tool, {})
            kind = "best" if tool == best else "near" if tool in near else ""
            if tool == "cubicfish" and best and tool not in near:
                kind = "lost"
            text = shown(row.get("px_median"))
            if "low" in row:
                text += f"<br><small>{shown(row['low'])}–{shown(row['high'])}</small>"
            if row.get("problem"):
                text, kind = f'<span title="{html.escape(row["problem"])}">{text} ✗</span>', ""
            line.append((text, kind))
        overview.append(line)
        source = about.get("repo", "")
        told = f'<a href="{source}">{source}</a>, licence: {about.get("licence")}. ' if source else ""
        parts.append(f'<h2 id="{name}">{name}</h2><p>{told}{about["size"][0]}x{about["size"][1]} px, '
                     f"{about['photos']} photos, {about['corners']} corners by {about['corners_by']}.</p>")  # fmt: skip
        full = [[html.escape(tool), *(shown(row.get(key), n) for _, key, n in COLUMNS),
                 (html.escape("; ".join(filter(None, (row["problem"], row.get("note"))))), "bad")]
                for tool, row in rows.items()]  # fmt: skip
        parts.append(table(["tool", *(title for title, _, _ in COLUMNS), "remarks"], full))
        parts.append(plot(rows, "by_angle", "held-out median, px, by angle from the axis"))
        parts.append(plot(rows, "recall_by_angle", "share of the table's corners that its detector finds"))
    overview += [[name, "not here", (html.escape(why), "bad")] for name, why in missing.items()]
    return (
        f'<!doctype html><meta charset="utf-8"><title>Open benchmark</title><style>{STYLE}</style>'
        "<h1>Calibration tools on real cameras</h1><p>Held-out error, median over all corners, pixels, with "
        "its 95 % interval over photos. Green: the best, and those whose interval reaches it. Red: rows "
        "that cubicfish loses. ✗: something failed (hold the mouse there). README.md says how all is "
        f"measured.</p>{table(head, overview)}{''.join(parts)}"
    )


def main():
    """Write results.csv and index.html."""
    work, (names, tools) = Path(sys.argv[1]), json.loads(sys.argv[2])
    missing = json.loads((work / "missing.json").read_text(encoding="utf-8"))
    cameras = {}
    for name in names:
        if not (work / "jobs" / name / "about.json").exists():
            continue
        rows = {}
        for folder in (work / "results" / name).iterdir():
            about = json.loads((folder / "about.json").read_text(encoding="utf-8"))
            if about["tool"] in tools:
                rows[about["tool"]] = row_of(folder, about)
        rows = {tool: rows[tool] for tool in tools if tool in rows}
        by_angle(rows)
        cameras[name] = json.loads((work / "jobs" / name / "about.json").read_text("utf-8")), rows
    lines = [
        {"camera": name, "tool": tool, **row} for name, (_, rows) in cameras.items() for tool, row in rows.items()
    ] + [{"camera": name, "problem": f"not here: {why}"} for name, why in missing.items()]  # fmt: skip
    lines = [{k: v for k, v in line.items() if not isinstance(v, np.ndarray)} for line in lines]
    with (work / "results.csv").open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(dict.fromkeys(key for line in lines for key in line)))
        writer.writeheader()
        for line in lines:
            numbers = {k: f"{v:.6g}" for k, v in line.items() if isinstance(v, float)}
            writer.writerow(line | numbers)
    (work / "index.html").write_text(page(cameras, tools, missing), encoding="utf-8")
    for name, (_, rows) in cameras.items():
        best, _ = best_of(rows)
        print(f"{name}: {best}, {shown(rows[best]['px_median'])} px" if best else f"{name}: nobody")
    print(f"{work / 'results.csv'}, {work / 'index.html'}")


if __name__ == "__main__":
    main()
