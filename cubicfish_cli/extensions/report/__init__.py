"""One self-contained HTML page about a calibration.

`judge/verdict.py` judges a fit by its record in camera.yaml; `calibrate` prints the verdict.
`inputs/calibration_facts.py` recomputes every corner's error from that record, the corners and the
target, unless they are not those of the fit. `figures.py` and `scene.py` draw plots;
names that a user chose never enter a figure. `pictures.py` makes small copies of photos, `page.py`
fills the template, which escapes everything. `acting.py` works out what a reader may try: photos
left out, the next ones, and a photo straightened by the camera's shader; `report.js`, the page's
only script, lets them try. `calibrate` and `cubicfish report` make the same page to the byte.
"""
