"""What ``import cubicfish_cli`` offers beyond the parts themselves: arrays in, arrays out.

`cubicfish_cli/__init__.py` names what programs may rely on and loads each name when it is first
used. Where a part's own function has the right shape it is named as it is; `library/` holds those
that join parts and check what they are given: in memory (`detect` for pictures, `calibrate` for
corners of any kind, `undistort`), and from files to files (`undistort_files`,
`calibrate_rig_files`), each with a record of everything that its command prints; those of
`commands/` (`calibrate_files`, `detect_files`) are their commands' own. What a call is asked
stands in records where it is much (`asked.py`: `Run`; `undistortion/options.py`: views;
`asked_pictures.py`: pictures, maps, planes; `rendering/options.py`: looks); they load nothing, so
that commands make their options of them. `docs/library.md` shows every function at work, and
`tests/library/test_guide.py` runs it.

A fit (`Calibration`) and what its file gives back (`CameraFile`) are both a `Calibrated`
(`formats/calibrated.py`): camera and record, and from these the verdict, the uncertainty of a
pixel, the key figures and the file's text. The record is a `FitRecord` (`assess/fit_record.py`):
its fields are the keys of `fit` in camera.yaml, and `assess/records.py` reads and writes them by
their types. What holds of the lift `point` too is its `CameraRecord`. `Observations` carry their
`target`. `cubicfish` is `cubicfish_cli` by its short name, for programs.
"""
