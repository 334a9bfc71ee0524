"""2D-3D pairs -> camera and poses.

`fit/calibrate.py` reads as the recipe, and `model_selection.py` as that of the target's
levels. The direction of a pixel from the image's centre does not depend on the radial profile,
which gives linear start poses without any guess (`radial_pose.py`, `start.py`). A Kannala–Brandt
lens and all poses follow (`radial_reference.py`). The cubic starts from the one nearest to the
radial reference on a cone (`nearest_cubic.py`: Eq. 8–9, then least squares in pixels) and is fitted
jointly with all poses (`cubic_fit.py`; `adjustment.py` has the residuals, their derivatives and the
steps, Eq. 10), under a weak prior (`prior.py`): the nearest lens of the radial reference's kind,
decentred and tilted (`decentred.py`, and `Tie` in `lenses.py`). The prior fixes the gauge and
keeps poles out where there are no corners. Photos that are left out choose, to first order, how
symmetric its lens is and how firmly it ties P (`leave_one_out.py`). `models/cubic.py` checks for
poles and folds over the whole trusted cone. Outliers are dropped and listed, and at the end also
corners that depart from their neighbours (`rejection.py`). Each photo is weighted by its own noise
(`statistics.py`), and `held_out.py` measures the camera's error on photos that it never saw.

A prior of a lens or of the target (`pulls()`) is a Gram matrix of pseudo-observations, like the
contribution of the corners (`NormalEquations`): they add up, and the contribution of a photo is
subtracted again where the photo is left out. `Adjustment` is generic in its lens, a `FitLens`
(`fit_lens.py`); its method `again` continues it. `RadialReference` and `CameraFit` are adjustments
with more attributes. Only rigs know lenses that carry several cameras (`rigs/rig_lens.py`).

The target may be fitted in the same adjustment (`deformable_target.py`; the nominal target is one
without free parameters): boards' shapes and places are shared unknowns like the lens, and corners'
own offsets are a second family of small blocks beside the poses; `normal_equations.py` eliminates
the larger family. `refinement.py` fits each level, and `model_selection.py` takes the richest by
which held-out photos gain. Before corners are fitted one by one, `orientation.py` finds which way
round photos show a target that looks the same after a turn (`target/placement.py`), and
`rigs/names.py` makes a rig's cameras agree. `uncertainty.py` propagates the corners'
noise through the normal equations to pixels, `photo_spread.py` adds the effect of errors that the
corners of a photo share, `coverage.py` says where corners are, and `departures` how far a
fitted target departs from the nominal one.

The fit knows nothing of diagnosis. It hands its evidence (`FitEvidence`, or `FailedFit` where there
is no fit; `calibration.py`) to a function that its caller gives it, and takes findings back:
`find_faults` of `diagnosis/diagnose.py`.

Beside it stand `rough_fit.py` (a camera to look for corners by), `alignment.py` (the turn between
the frames of two cameras), `evaluate.py` (a known camera on other photos), `exported_lens.py` (the
lens of another model nearest to a camera) and `imported_lens.py` (the camera nearest to a lens), by
`nearest_lens` of `fit_lens.py` (any lens through given pixels). The fit of the paper's own lift is
`point_fit.py`.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
