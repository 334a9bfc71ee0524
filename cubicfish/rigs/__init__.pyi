"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.rigs.compare import ComparedCamera as ComparedCamera
from cubicfish.rigs.evaluate import RigEvaluation as RigEvaluation
from cubicfish.rigs.rig import RigCamera as RigCamera
from cubicfish.rigs.rig import refuse_name as refuse_name
from cubicfish.rigs.shots import load_shots as load_shots
from cubicfish.rigs.shots import load_times as load_times
from cubicfish.rigs.shots import match_shots as match_shots
from cubicfish.rigs.times import CornerMotion as CornerMotion
