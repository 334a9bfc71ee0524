"""The public names, for type checkers: those of cubicfish_cli."""

from cubicfish_cli import Calibration as Calibration
from cubicfish_cli import CameraFile as CameraFile
from cubicfish_cli import ChosenFrames as ChosenFrames
from cubicfish_cli import Comparison as Comparison
from cubicfish_cli import Corners as Corners
from cubicfish_cli import Correspondences as Correspondences
from cubicfish_cli import CubicCamera as CubicCamera
from cubicfish_cli import CubicfishError as CubicfishError
from cubicfish_cli import Detection as Detection
from cubicfish_cli import Evaluation as Evaluation
from cubicfish_cli import Observations as Observations
from cubicfish_cli import RectifiedPair as RectifiedPair
from cubicfish_cli import RigCalibration as RigCalibration
from cubicfish_cli import RigFile as RigFile
from cubicfish_cli import Target as Target
from cubicfish_cli import UndistortMap as UndistortMap
from cubicfish_cli import Verdict as Verdict
from cubicfish_cli import View as View
from cubicfish_cli import build_map as build_map
from cubicfish_cli import build_plane as build_plane
from cubicfish_cli import build_view as build_view
from cubicfish_cli import calibrate as calibrate
from cubicfish_cli import calibrate_rig as calibrate_rig
from cubicfish_cli import check_target as check_target
from cubicfish_cli import choose_frames as choose_frames
from cubicfish_cli import compare as compare
from cubicfish_cli import compare_rigs as compare_rigs
from cubicfish_cli import detect as detect
from cubicfish_cli import evaluate as evaluate
from cubicfish_cli import evaluate_rig as evaluate_rig
from cubicfish_cli import export_camera as export_camera
from cubicfish_cli import import_camera as import_camera
from cubicfish_cli import judge as judge
from cubicfish_cli import load_camera as load_camera
from cubicfish_cli import load_corners as load_corners
from cubicfish_cli import load_map as load_map
from cubicfish_cli import load_rig as load_rig
from cubicfish_cli import read_picture as read_picture
from cubicfish_cli import rectify as rectify
from cubicfish_cli import save_camera as save_camera
from cubicfish_cli import save_corners as save_corners
from cubicfish_cli import save_map as save_map
from cubicfish_cli import save_rig as save_rig
from cubicfish_cli import save_target as save_target
from cubicfish_cli import simulate_film as simulate_film
from cubicfish_cli import simulate_photos as simulate_photos
from cubicfish_cli import stitch as stitch
from cubicfish_cli import uncertainty as uncertainty
from cubicfish_cli import undistort as undistort
from cubicfish_cli import undistort_files as undistort_files

__version__: str
__all__: list[str]
