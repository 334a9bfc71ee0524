"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.judge.camera_facts import CameraFacts as CameraFacts
from cubicfish.judge.codes import Code as Code
from cubicfish.judge.codes import Severity as Severity
from cubicfish.judge.finding import FindingText as FindingText
from cubicfish.judge.fit_record import ErrorStatistics as ErrorStatistics
from cubicfish.judge.fit_record import FitRecord as FitRecord
from cubicfish.judge.fit_record import PhotoRecord as PhotoRecord
from cubicfish.judge.uncertainty import FieldUncertainty as FieldUncertainty
