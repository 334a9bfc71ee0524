"""Gyroflow's lens profile: OpenCV's fisheye lens as JSON; pixel centres are at whole numbers."""

from cubicfish.models import RadialCamera
from cubicfish_cli.extensions.formats.camera_keys import Layout, Program
from cubicfish_cli.extensions.formats.lenses import matrix_rows
from cubicfish_cli.foreign.file_contents import PlacedLens, json_text


def gyroflow_text(one: PlacedLens) -> str:
    """Write a radial lens as a lens profile."""
    size = dict(zip("wh", one.lens.image_size, strict=True))
    profile = {
        "name": "cubicfish",
        "note": "; ".join(one.note),
        "calibrated_by": "",
        "camera_brand": "",
        "camera_model": "",
        "lens_model": "",
        "camera_setting": "",
        "calibrator_version": "cubicfish",
        "calib_dimension": size,
        "orig_dimension": size,
        "input_horizontal_stretch": 1.0,
        "input_vertical_stretch": 1.0,
        "num_images": 0,
        "distortion_model": "opencv_fisheye",
        "use_opencv_fisheye": True,
        "fisheye_params": {
            "camera_matrix": matrix_rows(one.lens),
            "distortion_coeffs": one.lens.k.tolist(),
        },
        "use_opencv_standard": False,
    }
    return json_text(profile)


read_gyroflow = Program(
    Layout(
        file="a Gyroflow {}lens profile",
        camera=r"(fisheye_params\.)camera_matrix",
        kind=("/distortion_model",),
        usual="opencv_fisheye",
        lenses={
            "opencv_fisheye": (
                RadialCamera,
                "camera_matrix.0[fx,,cx] camera_matrix.1[,fy,cy] distortion_coeffs[k1,k2,k3,k4]",
            )
        },
        size=("/calib_dimension.w", "/calib_dimension.h"),
    )
).read
