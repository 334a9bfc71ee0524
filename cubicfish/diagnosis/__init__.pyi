"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.diagnosis.diagnose import find_faults as find_faults
from cubicfish.diagnosis.object_check import ObjectFacts as ObjectFacts
from cubicfish.diagnosis.object_check import Turn as Turn
from cubicfish.diagnosis.object_check import check_object as check_object
