"""The public names, for type checkers: each is loaded when it is first used."""

from cubicfish_cli.assess.verdict import Verdict as Verdict
from cubicfish_cli.corner_files.observations_csv import load_corners as load_corners
from cubicfish_cli.corner_files.observations_csv import save_corners as save_corners
from cubicfish_cli.errors import CubicfishError as CubicfishError
from cubicfish_cli.fitting.calibrate import Calibration as Calibration
from cubicfish_cli.fitting.comparison import Comparison as Comparison
from cubicfish_cli.fitting.comparison import compare as compare
from cubicfish_cli.fitting.evaluate import Evaluation as Evaluation
from cubicfish_cli.fitting.rig.calibrate import RigCalibration as RigCalibration
from cubicfish_cli.formats.camera_yaml import CameraFile as CameraFile
from cubicfish_cli.formats.camera_yaml import load_camera as load_camera
from cubicfish_cli.formats.rig_yaml import RigFile as RigFile
from cubicfish_cli.formats.rig_yaml import load_rig as load_rig
from cubicfish_cli.identification.identified import Detection as Detection
from cubicfish_cli.lenses.cubic import CubicCamera as CubicCamera
from cubicfish_cli.library.calibration import calibrate as calibrate
from cubicfish_cli.library.calibration import evaluate as evaluate
from cubicfish_cli.library.calibration import judge as judge
from cubicfish_cli.library.calibration import uncertainty as uncertainty
from cubicfish_cli.library.cameras import save_camera as save_camera
from cubicfish_cli.library.cameras import save_target as save_target
from cubicfish_cli.library.detection import detect as detect
from cubicfish_cli.library.exporting import export_camera as export_camera
from cubicfish_cli.library.frames import ChosenFrames as ChosenFrames
from cubicfish_cli.library.frames import choose_frames as choose_frames
from cubicfish_cli.library.importing import import_camera as import_camera
from cubicfish_cli.library.pictures import undistort as undistort
from cubicfish_cli.library.planes import build_plane as build_plane
from cubicfish_cli.library.rig_pictures import rectify as rectify
from cubicfish_cli.library.rig_pictures import stitch as stitch
from cubicfish_cli.library.rigs import calibrate_rig as calibrate_rig
from cubicfish_cli.library.rigs import compare_rigs as compare_rigs
from cubicfish_cli.library.rigs import evaluate_rig as evaluate_rig
from cubicfish_cli.library.rigs import save_rig as save_rig
from cubicfish_cli.library.simulation import simulate_film as simulate_film
from cubicfish_cli.library.simulation import simulate_photos as simulate_photos
from cubicfish_cli.library.target_check import check_target as check_target
from cubicfish_cli.library.undistorting import undistort_files as undistort_files
from cubicfish_cli.observations import Corners as Corners
from cubicfish_cli.observations import Correspondences as Correspondences
from cubicfish_cli.observations import Observations as Observations
from cubicfish_cli.photos import read_picture as read_picture
from cubicfish_cli.target import Target as Target
from cubicfish_cli.undistortion.choose import build_view as build_view
from cubicfish_cli.undistortion.maps import UndistortMap as UndistortMap
from cubicfish_cli.undistortion.maps import build_map as build_map
from cubicfish_cli.undistortion.maps import load_map as load_map
from cubicfish_cli.undistortion.maps import save_map as save_map
from cubicfish_cli.undistortion.stereo import RectifiedPair as RectifiedPair
from cubicfish_cli.undistortion.view import View as View

__version__: str
__all__: list[str]
