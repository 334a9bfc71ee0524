"""What the object that ``--json`` prints holds, command by command: key -> meaning.

Help lists the keys and docs/cli.md has the meanings; ``tests/cli/test_json.py`` holds both to what
is printed. Lengths in keys that end in ``_px`` are pixels, angles in those that end in ``_deg``
degrees; what is not known or not finite is null.
"""

from __future__ import annotations

_ERRORS = {
    "rms_px": "sqrt(mean(dx² + dy²)) over all corners used",
    "median_px": "the median of the corners' errors",
    "p95_px": "95 % of the errors are below this",
    "max_px": "the largest error",
    "corners": "how many corners were used",
    "images": "how many photos were used",
}
_FINDINGS = (
    "what looks wrong with the set-up, a record each: code (and case) of what it is, severity "
    "(note, care or bad), remedy (what helps, in a word for programs), what, evidence and do in "
    "words, images, boards and figures that it is about; cause and level are older names of code "
    "and severity"
)
_VERDICT = (
    "level (good, care or bad), words, figures, reasons (a record each, with the keys of findings "
    "and why: what and evidence in one)"
)
_PHOTO_PROBLEMS = {
    "photo_problems": "photos that gave nothing and grids that were left out, a line each; null "
    "where no photos were searched",
    "remarks": "what else is told, a record each, with the keys of findings: photos and grids that "
    "were left out and, of a fit, its notes and doubts",
}

TARGET_CHECK = {
    "units": "of all lengths",
    "boards": "a record a board: name, type, columns, rows, print, square, origin, axes, markers",
    "corners": "how many corners the target has",
    "planes": "on how many planes they are",
    "rank": "of the 20 monomials over the corners, for 'cubicfish calibrate --lift point'",
    "flat": "whether all corners are on one plane",
    "named_by": "what names corners in photos: markers, geometry or table",
    "ambiguous": "whether boards, or the whole target, can be mistaken for something else",
    "symmetries": "turns that take the target onto itself",
    "near_symmetries": "turns that nearly do",
    "look_alikes": "turns under which single boards look the same; null where nobody looked",
    "boards_needed": "so many boards in a photo can always be told apart; null where not known",
    "boards_at_once": "the most boards that face one camera",
    "never_together": "pairs of boards that no camera sees at once",
    "turned_away": "pairs of boards: the first shows the second its back",
    "crossing": "pairs of boards that cut through each other",
    "advice": "what to do, a record each: about, text",
    "drawing": "the file of --draw, where it was asked for",
}
TARGET_PRINT = {
    "boards": "the file of the pages",
    "assembly": "the file that says how to join them, where there are several sheets",
    "target": "target.yaml, where a target was made",
    "paper": "the paper's name",
    "pages": "a record a page: board, size_mm, tile, corner_0_0_mm",
}
CALIBRATE = {
    **_ERRORS,
    "held_out_rms_px": "the RMS on photos that took no part in the fit",
    "held_out_folds": "how many fits that took",
    "companion_rms_px": "the RMS of the radial reference",
    "companion_held_out_rms_px": "its RMS on photos left out",
    "refine_target": "how far the target was fitted too: off, shape or points",
    "held_out_by_level": "the held-out RMS at each level that was tried",
    "departures": "how each board departs from its drawing",
    "rank": "of the 20 monomials over the corners",
    "covered_deg": "how far from the axis corners reach",
    "reach": "of the field's rim: all_around_deg (how far corners reach in nearly all directions), "
    "rim_coverage (share of the directions in which they reach the rim), extrapolated_deg (how far "
    "beyond them the field goes), edge_uncertainty_px, rim_rms_px of the outermost corners (beyond "
    "rim_from_deg), middle_rms_px",
    "flat": "whether all corners lie in one plane, or nearly",
    "coverage": "share of the field that corners cover: of where the camera may be trusted",
    "prior_weight": "how firmly P was held to the radial reference",
    "prior_spread": "how much asymmetry that reference was allowed; 0 for none",
    "uncertainty": "one standard deviation of a distant point's pixel: median_px over the field, "
    "p95_px (95 % of it is within this), max_px, noise_px of the corners, a grid over the photo "
    "(x, y, sigma_px)",
    "dropped": "how many corners were dropped as outliers",
    "dropped_corners": "a record each: image, board, column, row, error_px",
    "unfit_images": "photos that were left out of the fit, and why",
    **_PHOTO_PROBLEMS,
    "findings": _FINDINGS,
    "notes": "remarks, a line each",
    "per_image": "a record a photo: image, its errors, corners, camera_from_world",
    "models": "with --compare, a record for each other lens model",
    "lift": "point; this and the next three only with --lift point",
    "frame": "of the points that the camera takes",
    "plain_rms_px": "of the linear solution",
    "reweighted_rms_px": "of the reweighted linear solution",
    "verdict": _VERDICT,
    "advice": "whether more photos are needed, and of what, in a line; not with --lift point",
    "summary": "the camera in one line",
    "report": "the page; null where none was written",
    "model": "the camera's file",
    "files": "every file that was written, by its kind",
}
INFO = {
    "rig": "of a rig.yaml, and then nothing else but model: units, cameras, pairs, fit, made_by",
    "title": "what its owner called it with 'cubicfish calibrate --title'",
    "summary": "the camera in one line",
    "image_size": "[width, height]",
    "focal_px": "[x, y] pixels a radian on the axis",
    "focal_sigma_px": "one standard deviation of each",
    "principal_point": "[x, y] the axis's pixel",
    "principal_point_sigma_px": "one standard deviation of each",
    "horizontal_deg": "field of view that a photo shows, along the axis's row",
    "vertical_deg": "along its column",
    "diagonal_deg": "from corner to corner",
    "max_angle_deg": "how far from the axis the camera may be trusted",
    "covered_deg": "how far from it corners reach",
    "rms_px": "reprojection error of the fit",
    "held_out_rms_px": "on photos that took no part in it",
    "images": "photos that it was made from",
    "corners": "corners that were used",
    "verdict": _VERDICT,
    "date": "when it was made",
    "version": "of cubicfish, then",
    "command": "that made it",
    "target": "the target's file",
    "model": "the camera's file",
}
DETECT = {
    "file": "the table of corners",
    "image_size": "[width, height]",
    "images": "how many photos have corners",
    "corners": "how many corners were found",
    "findings": _FINDINGS,
    "per_image": "a record a photo: image, boards, corners, added (by the second look), exact "
    "(whether names are certain), problem, notes, findings",
    "drawings": "the pictures that --draw wrote",
}
FRAMES = {
    "photos": "the pictures of the frames chosen",
    "file": "the table of all frames",
    "sheet": "the page that shows those chosen",
    "frames": "how many frames the films have",
    "looked_at": "in how many of them corners were looked for",
    "films": "a record a film: film, frames, image_size, seconds, turned_deg (what players are "
    "told), interlaced, problem",
}
CORNERS = {
    "file": "the table of corners",
    "image_size": "[width, height]",
    "images": "how many photos have corners",
    "corners": "how many corners were taken over",
    "left_out": "how many the files say were not found",
    "empty_images": "photos without corners",
}
RIG = {
    "units": "of lengths: the target's; null for pairs that came without one",
    "cameras": "a record a camera: name, camera (its file), camera_from_rig, position, covariance, "
    "turn_sigma_deg, shift_sigma, fit (its errors in pixels)",
    "pairs": "a record for every two cameras: cameras, shots (in common), rms_px",
    "fit": "of all: errors in pixels, held_out_rms_px, shots, refine_target, held_lenses, "
    "findings (with the keys of everything that is told, cameras, shots and line), per_shot",
    "model": "the rig's file",
    "verdict": _VERDICT,
}
EVALUATE = {
    **_ERRORS,
    "outside_field": "corners that were not counted, beyond where the camera may be trusted",
    "unplaced": "photos with too few corners to place them",
    **_PHOTO_PROBLEMS,
    "uncertainty": "of the camera itself at these corners: median_px, p95_px, max_px; null where "
    "its file does not say",
    "per_image": "a record a photo: image, its errors, corners, camera_from_world",
    "model": "the rig's file; of a rig only, as the keys that follow",
    "alone_rms_px": "of the same corners with each photo's own pose, pixels",
    "cameras": "a record a camera: name, images, its errors, alone_rms_px, outside_field, unplaced",
    "pairs": "a record for every two cameras: cameras, shots (in common), rms_px",
    "per_shot": "a record a shot: shot, rms_px, corners, cameras",
}
COMPARE = {
    "rms_px": "sqrt(mean(dx² + dy²)) over pixels of the common field",
    "median_px": "the median difference",
    "p95_px": "95 % of the differences are below this",
    "max_px": "the largest difference",
    "pixels": "at how many pixels this was measured",
    "common_share": "share of what A sees that B sees too",
    "rotation_deg": "the rotation that was taken out",
    "scale": "A's pixels for one of B's",
    "by_angle": "a record a ring about the axis: from_deg, to_deg, rms_px, max_px, pixels",
    "picture": "the file of --picture, where it was asked for",
    "units": "of lengths, of two rigs only",
    "cameras": "of two rigs only, a record a camera: name, shift and turn_deg beside the first "
    "camera, shift_sigma, turn_sigma_deg, sigmas (all of it over its standard deviations) and lens "
    "(with the keys for two cameras)",
}
REPORT = {
    "report": "the page",
    "model": "the camera's file",
    "verdict": _VERDICT,
    "absent": "what the page lacks and why, a line each",
}
ADVISE = {
    "enough": "whether more photos are not needed",
    "reasons": "why not, a line each",
    "findings": "the same, a record each, with the keys of findings of calibrate",
    "photos": "how many there are",
    "photos_needed": "about how many more it takes; null where too many, or it cannot be said",
    "goal_px": "the uncertainty wanted over 95 % of the field",
    "noise_px": "of the corners",
    "now": "the uncertainty: median_px over the field, p95_px (95 % of it is within this)",
    "coverage": "share of the field that corners cover: of where the camera may be trusted",
    "empty": "parts of the picture without corners",
    "tilts": "tilts that are missing",
    "distances": "distances that are missing",
    "proposals": "photos to take next, a record each",
    "proposed_distances": "[nearest, farthest] that they may be: half the nearest and twice the "
    "farthest of the photos so far; null where that is not known",
    "notes": "remarks, a line each",
    "remarks": "the same, a record each",
    "model": "the camera's file",
    "picture": "the file of --output; null where it was not asked for",
    "poses": "the file of --poses; null where it was not asked for",
}
_VIEW = (
    "what is shown: kind, size, words, parts (the six of a cube), hfov_deg and vfov_deg where it "
    "has them, cut (whether the camera sees more than this kind can show), and what else the kind "
    "has"
)
UNDISTORT = {
    "model": "the camera's file",
    "dry_run": "whether nothing was written, and the rest says what would be",
    "images": "how many photos (or videos) were rendered",
    "files": "the pictures (or videos)",
    "skipped": "photos whose result existed (with --skip-existing)",
    "failed": "photos that could not be rendered, a record each: image, problem",
    "view": f"of the first photo, {_VIEW}; null where nothing was rendered",
    "extra_files": "the mask and the virtual camera, where they were asked for",
    "groups": "with --dry-run, a record for photos of one size: images, image_size, view, "
    "kept_share (of what the camera sees), empty_share (of the pixels), problem",
}
MAP = {
    "model": "the camera's file",
    "files": "the map's files",
    "extra_files": "the virtual camera, and the mask where it was asked for",
    "image_size": "[width, height] of the photos that the map is for",
    "view": _VIEW,
    "stereo": "with --pair, what OUT.stereo.yaml holds: cameras, units, baseline, focal, depth and "
    "what else it takes to measure",
    "ffmpeg": "for .pgm, a command a part that applies the map",
}
EXPORT = {
    "file": "what was written",
    "files": "of a rig, all that was written",
    "cameras": "of a rig, a record a camera: its name, and the keys from lens on",
    "format": "its format",
    "lens": "the format's lens model (this and the rest not for --to maps)",
    "rms_px": "the RMS of the conversion",
    "max_px": "its largest error",
    "max_angle_deg": "the angle up to which these hold: how far corners reached",
    "by_angle": "a record a ring about the axis: from_deg, to_deg, rms_px, max_px",
    "also": "the errors in other ways of reading the file, where there are any",
    "beyond": "from_deg, to_deg, rms_px and max_px of the field where no corner was, if any",
    "turned_deg": "how far the frame was turned",
    "lens_from_camera": "that turn, a 3x3 matrix",
}
IMPORT = {
    "model": "the camera's file",
    "format": "what wrote the file that was read",
    "lens": "its lens model",
    "image_size": "[width, height]",
    "rms_px": "the RMS of the conversion",
    "max_px": "its largest error",
    "max_angle_deg": "the angle from the axis up to which these hold",
    "by_angle": "a record a ring about the axis: from_deg, to_deg, rms_px, max_px",
    "trusted_deg": "how far from the axis the camera is trusted",
    "field_ended_by": "why no farther: photo, region, fold, angle or fit",
    "fold_deg": "where the lens folds, if that is why",
}
SIMULATE = {
    "photos": "the photos' files, or that of the film",
    "corners": "how many corners can be seen in them",
    "image_size": "[width, height]",
    "seed": "the seed",
    "true_corners": "the file with the corners' true places",
    "true_poses": "the file with the true poses",
    "true_camera": "the file with the true camera",
}
