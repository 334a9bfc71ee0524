"""What the extension adds. A new format is a module beside this one, and a line here."""

from cubicfish_cli.app.extensions import CameraFiles, Extension

_HERE = "cubicfish_cli.extensions.formats"
_KALIBR = {
    "kalibr-pinhole-equi": "camchain.yaml",
    "kalibr-omni": "camchain.yaml; the nearest of Kalibr's",
    "kalibr-ds": "camchain.yaml",
}
_COLMAP = {
    "colmap": "cameras.txt; OPENCV_FISHEYE",
    "colmap-rad-tan-thin-prism-fisheye": "cameras.txt; the nearest of COLMAP's",
}
_ANIPOSE = {
    "anipose": "calibration.toml; FreeMoCap's",
    "anipose-pinhole": "calibration.toml; of Pose2Sim",
}
_FORMATS = (
    CameraFiles(
        place=f"{_HERE}.opencv_cameras:FORMAT",
        written={"opencv": "K and D of cv2.fisheye, YAML"},
        read="opencv",
        reads="OpenCV's FileStorage (YAML, XML, JSON)",
    ),
    CameraFiles(
        place=f"{_HERE}.ros_yaml:FORMAT",
        written={"ros": "camera_info.yaml"},
        read="ros",
        reads="ROS CameraInfo",
    ),
    CameraFiles(
        place=f"{_HERE}.kalibr_yaml:FORMAT",
        written=_KALIBR,
        read="kalibr",
        reads="Kalibr's camchain",
    ),
    CameraFiles(
        place=f"{_HERE}.ocamcalib:FORMAT",
        written={"ocamcalib": "calib_results.txt"},
        read="ocamcalib",
        reads="OCamCalib's text",
    ),
    CameraFiles(
        place=f"{_HERE}.colmap_cameras:FORMAT",
        written=_COLMAP,
        read="colmap",
        reads="COLMAP's cameras.txt and cameras.bin",
    ),
    CameraFiles(
        place=f"{_HERE}.nerfstudio_json:FORMAT",
        written={"nerfstudio": "transforms.json, with poses"},
        read="nerfstudio",
        reads="nerfstudio's transforms.json",
    ),
    CameraFiles(
        place=f"{_HERE}.gyroflow_json:FORMAT",
        written={"gyroflow": "lens_profile.json"},
        read="gyroflow",
        reads="Gyroflow's lens profile",
    ),
    CameraFiles(place=f"{_HERE}.nvidia_json:FORMAT", written={"nvidia": "rig.json; f-theta"}),
    CameraFiles(place=f"{_HERE}.anipose_toml:FORMAT", written=_ANIPOSE),
    CameraFiles(
        place=f"{_HERE}.mrcal_model:FORMAT",
        written={"mrcal": ".cameramodel; holds any lens"},
        read="mrcal",
        reads="mrcal's .cameramodel",
    ),
)

EXTENSION = Extension(
    commands={
        "corners": f"{_HERE}.corners:command",
        "import": f"{_HERE}.import_camera:command",
    },
    formats=_FORMATS,
)
