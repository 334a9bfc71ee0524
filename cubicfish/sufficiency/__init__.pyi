"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.sufficiency.information_gain import InformationGain as InformationGain
from cubicfish.sufficiency.knowledge import Knowledge as Knowledge
from cubicfish.sufficiency.sufficiency import CoverageGaps as CoverageGaps
from cubicfish.sufficiency.sufficiency import Goal as Goal
