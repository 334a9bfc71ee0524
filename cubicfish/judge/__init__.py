"""A fit's record -> the verdict on it, the camera's uncertainty, and its key figures.

`FitRecord` (`fit_record.py`) is the one record, from the fit to camera.yaml and back; `records.py`
makes plain data of it. `verdict.py` judges by it, and `camera_facts.py` has the key figures. All
that is told, here and elsewhere, is a `Finding` (`finding.py`), by a code of `codes.py`.
`uncertainty.py` has the uncertainty at pixels and over the field, `pupil.py` what a moving pupil
does to near points.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
