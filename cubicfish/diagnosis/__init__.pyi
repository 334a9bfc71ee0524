"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.diagnosis.object_check import ObjectFacts as ObjectFacts
from cubicfish.diagnosis.object_check import check_object as check_object
