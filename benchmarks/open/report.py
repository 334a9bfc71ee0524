"""results.csv and one page of all that run.py left: ``report.py WORK WHAT``."""

import csv
import html
import json
import sys
from pathlib import Path

import numpy as np
from job import Job
from trial import known

STEP, BINS = 15, range(0, 135, 15)  # degrees from the axis
DRAWS = 1000  # of the photos, for intervals
ENOUGH = 10  # corners that make a bin
# Title, key of results.csv, digits, and whether less (1) or more (-1) is better.
COLUMNS = (
    ("held out px: median", "px_median", 3, 1), ("95 %", "px_p95", 3, 1), ("RMS", "px_rms", 3, 1),
    ("arc min: median", "min_median", 2, 1), ("95 %", "min_p95", 2, 1), ("RMS", "min_rms", 2, 1),
    ("has a pixel", "projected", 3, -1), ("board", "board", 0, 0),
    ("as drawn: median", "drawn_median", 3, 1), ("exported: median", "export_median", 3, 1),
    ("halves apart: median", "halves_median", 3, 1), ("95 %", "halves_p95", 3, 1),
    ("claims σ", "uncertainty_px", 3, 0), ("claims RMS", "rms_px", 3, 0),
    ("claims held out", "held_out_px", 3, 0), ("own corners: median", "own_median", 3, 1),
    ("recall", "recall", 3, -1), ("CPU s", "seconds", 2, 1), ("MB", "memory", 0, 1),
    ("lines", "lines", 0, 1),
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
    row = {"problem": problems[0] if problems else "", "version": about["version"]}
    row["exported_to"] = about.get("EXPORT", "")
    if "px" in full:
        row |= json.loads(str(full["claims"])) | spread(full["px"], "fitted")
        row |= {key: float(full[key]) for key in ("seconds", "memory", "lines")}
        row |= {"note": str(full["note"]), "starts_lost": str(full["lost"])}
        row["board"] = "refined" if full["refined"] else "as drawn"
    good = [one for one in folds if "px" in one]
    if len(good) < count and full and not problems:
        row["problem"] = f"{len(good)} of {count} folds are done"
    errors = {key: [one[key] for one in good if key in one] for key in ("px", "min", "export")}
    for start in ("own", "halves"):
        own = [pieces[name] for name in sorted(pieces) if name.startswith(start)]
        errors[start] = [one["px"] for one in own if "px" in one]
    if any("drawn" in one for one in good):  # in some folds the board may have been left as it is
        errors["drawn"] = [one.get("drawn", one["px"]) for one in good]
    told = [str(one["export_problem"]) for one in good if "export_problem" in one]
    lost = [str(pieces.get(one, {}).get("problem", "")) for one in ("halves", "detect")]
    if "EXPORT" in about and not told:  # without loss, where nothing else is known
        errors["export"] = errors["export"] or errors["px"]
    for name in [one for one in errors if errors[one]]:
        row |= spread(np.concatenate(errors[name]), name)
    if good:
        arrays = {k: np.concatenate([one[k] for one in good]) for k in ("px", "min", "angle")}
        row |= {"arrays": arrays, "projected": np.isfinite(arrays["px"]).mean()}
        photo = np.concatenate([one["photo"] for one in good])
        row["low"], row["high"] = interval(arrays["px"], photo)
        row["folds"] = f"{len(good)} of {count}"
    if "recalled" in found:
        row["recall"], row["recalled"] = found["recalled"].mean(), found["recalled"]
    row["remarks"] = "; ".join(dict.fromkeys(filter(None, [*lost, *told])))
    return about["tool"], row


def add_angles(rows, order):
    """Errors and recall by angle. A corner's angle is the median of what the best lenses say.

    Lenses that are more than twice as far off as the best have no say. ``order``: where each corner
    of the table is among those held out.
    """
    whole = [r for r in rows.values() if "arrays" in r and len(r["arrays"]["px"]) == len(order)]
    if not whole:
        return
    limit = 2 * min(row["px_median"] for row in whole)
    near = [row["arrays"]["angle"] for row in whole if row["px_median"] <= limit]
    angle = np.median(near, axis=0)
    for low in BINS:
        inside, name = (angle >= low) & (angle < low + STEP), f"{low}_{low + STEP}"
        if inside.sum() < ENOUGH:
            continue
        for row in whole:
            for unit in ("px", "min"):
                row |= spread(row["arrays"][unit][inside], f"{unit}_{name}")
        for row in [one for one in rows.values() if "recalled" in one]:
            row[f"recall_{name}"] = row["recalled"][order][inside].mean()


def plot(rows, key, label, log=False):
    """Lines of values by angle, as SVG: of errors by their powers of ten, three at the most."""
    lines, parts = {}, []
    for tool, row in rows.items():
        values = [(low + STEP / 2, row.get(key.format(low, low + STEP))) for low in BINS]
        lines[tool] = [(x, np.log10(v + 1e-9) if log else v) for x, v in values if v is not None]
    places = np.array([place for line in lines.values() for place in line])
    places = places[np.isfinite(places).all(axis=1)] if len(places) else places
    if not len(places):
        return ""
    low = np.floor(places[:, 1].min()) if log else 0
    high = min(np.ceil(places[:, 1].max()), low + 3) if log else 1
    right, up = 340 / (places[:, 0].max() + STEP / 2), 166 / max(high - low, 1)
    for tick in np.arange(low, high + 0.01, 1 if log else 0.25):
        y = 196 - up * (tick - low)
        parts.append(f'<path d="M44 {y:.1f}h340" stroke="#ccc"/>')
        parts.append(f'<text x="4" y="{y + 4:.1f}">{10**tick if log else tick:g}</text>')
    parts += [
        f'<text x="{38 + right * a:.0f}" y="214">{a}°</text>' for a in BINS if right * a < 340
    ]
    for k, (tool, line) in enumerate(lines.items()):
        colour, wide = f"hsl({137 * k % 360} 75% 38%)", 3 if tool == "cubicfish" else 1.3
        at = [f"{44 + right * x:.1f} {196 - up * (min(v, high) - low):.1f}" for x, v in line]
        parts.append(
            f'<path d="M{"L".join(at)}" stroke="{colour}" stroke-width="{wide}"/>' * bool(at)
        )
        parts.append(f'<text x="394" y="{30 + 15 * k}" fill="{colour}">{tool}</text>' * bool(at))
    return f'<svg viewBox="0 0 560 230"><text x="4" y="14">{label}</text>{"".join(parts)}</svg>'


def shown(value, digits=3):
    """A cell's text."""
    if value is None or value == "":
        return "–"
    if isinstance(value, str):
        return html.escape(value)
    return f"{value:.{digits if value < 1000 else 0}f}" if value < 1e6 else "∞"


def table(head, rows):
    """HTML; cells are texts, or (text, class). The last cell of a short row takes what is left."""
    lines = ["".join(f"<th>{one}</th>" for one in head)]
    for row in rows:
        pairs = [one if isinstance(one, tuple) else (one, "") for one in row]
        cells = [f'<td class="{kind}">{text}</td>' for text, kind in pairs]
        cells[-1] = f'<td colspan="{len(head) - len(row) + 1}" {cells[-1][4:]}'
        lines.append("".join(cells))
    return f"<div><table><tr>{'</tr><tr>'.join(lines)}</tr></table></div>"


def best_by_column(rows):
    """By key: the best tool of those that failed nowhere; among equals cubicfish."""
    best = {}
    for _, key, _, sense in COLUMNS:
        own = {
            t: sense * r[key] for t, r in rows.items() if sense and key in r and not r["problem"]
        }
        best[key] = min(own, key=lambda tool: (own[tool], tool != "cubicfish"), default="")
    return best


def kind_of(tool, best):
    """The class of a cell: of the best, or of cubicfish where another tool is the best."""
    behind = tool == "cubicfish" and best and not best.startswith(tool)
    return "best" if tool == best else "lost" if behind else ""


def standing(rows):
    """By tool "best" of a camera, "near" where its interval reaches into the best's, "lost" where
    that is cubicfish, "failed"; by held-out medians."""
    best = best_by_column(rows)["px_median"]
    found = {}
    for tool, row in rows.items():
        near = best and tool != best and row.get("low", np.inf) <= rows[best]["high"]
        kind = f"{kind_of(tool, best)} {'near' * bool(near)}"
        found[tool] = "failed" if row["problem"] else kind.strip()
    return found


def section(name, about, rows):
    """All that is known of one camera."""
    best, lines = best_by_column(rows), []
    for tool, row in rows.items():
        said = filter(None, (row["problem"], row.get("note"), row["remarks"]))
        cells = [
            (shown(row.get(key), digits), kind_of(tool, best[key]) if key in row else "")
            for _, key, digits, _ in COLUMNS
        ]
        lines.append([tool, *cells, (html.escape("; ".join(said)), "said")])
    where, size = about.get("repo", ""), "x".join(map(str, about["size"]))
    return "".join([
        f'<h2 id="{name}">{name}</h2><p>', f'<a href="{where}">{where}</a>. ' * bool(where),
        f"Licence: {html.escape(about['licence'])}. {size} px, {about['photos']} of ",
        f"{about['files']} photos, {about['corners']} corners by {about['corners_by']}.</p>",
        table(["tool", *(title for title, *_ in COLUMNS), "remarks"], lines),
        plot(rows, "px_{}_{}_median", "held-out median, px, by angle from the axis", log=True),
        plot(rows, "recall_{}_{}", "share of the table's corners that its detector finds"),
    ])  # fmt: skip


def page(cameras, tools, missing):
    """The whole page."""
    every = [row for _, rows in cameras.values() for row in rows.items()]
    fit = [one for one in tools if any(one == tool and "px_median" in row for tool, row in every)]
    lines, kinds = [], [standing(rows) for _, rows in cameras.values()]
    for (name, (about, rows)), kind in zip(cameras.items(), kinds, strict=True):
        lines.append([f'<a href="#{name}">{name}</a>', str(about["photos"])])
        for tool in fit:
            row, own = rows.get(tool, {}), kind.get(tool, "")
            text = shown(row.get("px_median")) + " ✗" * (own == "failed")
            if "low" in row:
                text += f"<br><small>{shown(row['low'])}–{shown(row['high'])}</small>"
            lines[-1].append((text, own))
    for kind, title in (("best", "best"), ("near", "near it"), ("failed", "failed somewhere")):
        count = [sum(kind in one.get(tool, "").split() for one in kinds) for tool in fit]
        lines.append([f"<b>{title}</b>", "", *map(str, count)])
    lines += [[name, (f"not here: {html.escape(why)}", "said")] for name, why in missing.items()]
    text = Path(__file__).with_name("page.html").read_text(encoding="utf-8")
    sections = "".join(section(name, *one) for name, one in cameras.items())
    versions = ", ".join(dict.fromkeys(row["version"] for _, row in every))
    text = text.replace("OVERVIEW", table(["camera", "photos", *fit], lines))
    return text.replace("VERSIONS", versions).replace("CAMERAS", sections)


def main():
    """Write results.csv and index.html."""
    work, (names, tools, missing) = Path(sys.argv[1]), json.loads(sys.argv[2])
    cameras, lines = {}, []
    for name in [one for one in names if one not in missing]:
        job = Job(work / "jobs" / name / "job.npz")
        of_corner, count = job.fold[job.data["image"]], job.fold.max() + 1
        rows = dict(row_of(folder, count) for folder in (work / "results" / name).iterdir())
        rows = {tool: rows[tool] for tool in tools if tool in rows}
        add_angles(rows, np.concatenate([np.flatnonzero(of_corner == k) for k in range(count)]))
        about = json.loads((work / "jobs" / name / "about.json").read_text(encoding="utf-8"))
        cameras[name] = about, rows
        for tool, row in rows.items():
            row = {"camera": name, "tool": tool} | about | row
            plain = {k: v for k, v in row.items() if k not in ("arrays", "recalled", "test")}
            lines.append({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in plain.items()})
    lines += [{"camera": name, "problem": f"not here: {why}"} for name, why in missing.items()]
    with (work / "results.csv").open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, list(dict.fromkeys(key for line in lines for key in line)))
        writer.writeheader()
        writer.writerows(lines)
    (work / "index.html").write_text(page(cameras, tools, missing), encoding="utf-8")
    print(f"{work / 'results.csv'}, {work / 'index.html'}")


if __name__ == "__main__":
    main()
