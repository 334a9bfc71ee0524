"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.rigs.evaluate import RigEvaluation as RigEvaluation
from cubicfish.rigs.rig import RigCamera as RigCamera
