"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.rigs.compare import ComparedCamera as ComparedCamera
from cubicfish.rigs.evaluate import RigEvaluation as RigEvaluation
from cubicfish.rigs.panorama import Body as Body
from cubicfish.rigs.rig import RigCamera as RigCamera
from cubicfish.rigs.shots import match_shots as match_shots
from cubicfish.rigs.times import CornerMotion as CornerMotion
