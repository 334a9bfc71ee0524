"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.calibration import calibrate as calibrate
from cubicfish.calibration import evaluate as evaluate
from cubicfish.calibration import save_camera as save_camera
from cubicfish.calibration import save_target as save_target
from cubicfish.comparison import Comparison as Comparison
from cubicfish.comparison import aligned_difference as aligned_difference
from cubicfish.comparison import compare as compare
from cubicfish.errors import CameraFileError as CameraFileError
from cubicfish.errors import ClusterError as ClusterError
from cubicfish.errors import CorrespondenceError as CorrespondenceError
from cubicfish.errors import CubicfishError as CubicfishError
from cubicfish.errors import DetectionError as DetectionError
from cubicfish.errors import FitError as FitError
from cubicfish.errors import OutputError as OutputError
from cubicfish.errors import PhotoError as PhotoError
from cubicfish.errors import TargetError as TargetError
from cubicfish.errors import UsageError as UsageError
from cubicfish.errors import ViewError as ViewError
from cubicfish.find.identification.identified import Detection as Detection
from cubicfish.fit.calibration import Calibration as Calibration
from cubicfish.fit.evaluate import Evaluation as Evaluation
from cubicfish.io.camera_yaml import CameraFile as CameraFile
from cubicfish.io.camera_yaml import load_any_camera as load_any_camera
from cubicfish.io.camera_yaml import load_camera as load_camera
from cubicfish.io.corners_csv import load_corners as load_corners
from cubicfish.io.corners_csv import save_corners as save_corners
from cubicfish.judge.finding import Finding as Finding
from cubicfish.judge.verdict import Verdict as Verdict
from cubicfish.lazy import lazy_names as lazy_names
from cubicfish.listener import Event as Event
from cubicfish.listener import Listener as Listener
from cubicfish.models.cubic import CubicCamera as CubicCamera
from cubicfish.observe.detection import detect as detect
from cubicfish.photos.photos import read_picture as read_picture
from cubicfish.rigs.calibrate import calibrate_rig as calibrate_rig
from cubicfish.rigs.compare import compare_rigs as compare_rigs
from cubicfish.rigs.evaluate import evaluate_rig as evaluate_rig
from cubicfish.rigs.rig import Rig as Rig
from cubicfish.rigs.rig import load_rig as load_rig
from cubicfish.rigs.rig import save_rig as save_rig
from cubicfish.rigs.stereo import RectifiedPair as RectifiedPair
from cubicfish.rigs.stereo import rectify as rectify
from cubicfish.run import Run as Run
from cubicfish.target.observations import Observations as Observations
from cubicfish.target.target import Target as Target
from cubicfish.types import BoolArray as BoolArray
from cubicfish.types import FloatArray as FloatArray
from cubicfish.types import IntArray as IntArray
from cubicfish.views.maps import UndistortMap as UndistortMap
from cubicfish.views.maps import build_map as build_map
from cubicfish.views.plane import build_plane as build_plane
from cubicfish.views.view import View as View

__version__: str
__all__: list[str]
