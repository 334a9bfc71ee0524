"""Several cameras on one body.

`Rig` (`rig.py`) is the one record, from the fit to rig.yaml and back, to the verdict, the page and
what is done with a rig; each of its cameras is a calibrated camera that has a name and a place.

A rig is not a second fit: `adjustment.py` knows one pose per shot and looks at the photos camera by
camera: `RigLens` (`rig_lens.py`) is to it what carries them, with the lenses and camera_from_rig of
each; `normal_equations.py` sums each photo's Gram matrix over the columns that it touches, so that
the work grows with photos and not with cameras. `rigs/calibrate.py` is the recipe: each camera
alone (`alone.py`), places from the shots that two share (`start.py`), places and shots with the
lenses held, then all at once (`joint_fit.py`). `fitted_rig.py` makes the record of it; `spread.py`
judges a place and its lens's own turn together, by noise and by shots that are left out; `start.py`
refuses exchanged cameras, `faults.py` says what else is wrong; `times.py` fits by the flow of
corners when each photo was taken, where cameras run free. `stereo.py` turns two cameras so that
rows agree, `panorama.py` asks all cameras as one and blends them.
"""

from cubicfish.lazy import lazy_names

__getattr__, __dir__ = lazy_names(__name__)
