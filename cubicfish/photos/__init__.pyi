"""The names that this package offers: `lazy.py` reads them too."""

from cubicfish.photos.photos import Photo as Photo
from cubicfish.photos.photos import find_photos as find_photos
