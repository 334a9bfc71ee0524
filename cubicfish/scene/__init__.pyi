"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.scene.faces import board_face as board_face
from cubicfish.scene.photos import Look as Look
from cubicfish.scene.scene import Scene as Scene
from cubicfish.scene.views import Distances as Distances
from cubicfish.scene.views import Viewpoint as Viewpoint
