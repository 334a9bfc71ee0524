"""Every lens model that cameras are converted from, and to where it can be fitted."""

from __future__ import annotations

from cubicfish_cli.fitting.conversion import (
    central,
    ftheta,
    mrcal_splined,
    ocam,
    pinhole,
    thin_prism,
)
from cubicfish_cli.fitting.conversion.lens_model import LensModel

MODELS: dict[str, LensModel] = {
    model.name: model
    for model in (
        *central.MODELS,
        *thin_prism.MODELS,
        pinhole.MODEL,
        ftheta.MODEL,
        ocam.MODEL,
        mrcal_splined.MODEL,
    )
}
