"""One self-contained HTML page about a calibration.

`core/assess/verdict.py` judges a fit by the record that camera.yaml keeps; `calibrate` prints it.
`app/calibration_facts.py` works every corner's error out again from that record, the corners and
the target, and draws nothing if they are not those of the fit. `figures.py` and `scene.py` draw
with matplotlib; names that a user chose never enter a figure. `pictures.py` makes small copies of
photos, `page.py` fills the template, which escapes everything. `calibrate` and `cubicfish report`
make the same page to the byte.
"""
