"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.judge.codes import Severity as Severity
from cubicfish.judge.fit_record import FitRecord as FitRecord
from cubicfish.judge.fit_record import PhotoRecord as PhotoRecord
