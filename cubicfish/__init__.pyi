"""The public names, for type checkers."""

from cubicfish.errors import CubicfishError as CubicfishError
from cubicfish.find.identification.identified import Detection as Detection
from cubicfish.fit.calibrate import Calibration as Calibration
from cubicfish.fit.evaluate import Evaluation as Evaluation
from cubicfish.io.camera_yaml import CameraFile as CameraFile
from cubicfish.io.camera_yaml import load_any_camera as load_any_camera
from cubicfish.io.camera_yaml import load_camera as load_camera
from cubicfish.io.corners_csv import load_corners as load_corners
from cubicfish.io.corners_csv import save_corners as save_corners
from cubicfish.judge.finding import Finding as Finding
from cubicfish.judge.verdict import Verdict as Verdict
from cubicfish.models.cubic import CubicCamera as CubicCamera
from cubicfish.target.observations import Observations as Observations
from cubicfish.target.target import Target as Target
from cubicfish.views.maps import UndistortMap as UndistortMap
from cubicfish.views.maps import build_map as build_map
from cubicfish.views.plane import build_plane as build_plane
from cubicfish.views.view import View as View

__version__: str
__all__: list[str]
