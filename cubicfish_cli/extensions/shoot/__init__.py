"""Photos taken with guidance: what is wrong with each, and where to hold the target next.

`shoot.py` is the loop: photos that appear in a folder, or that a camera takes (`camera.py`), are
searched one by one, a quick camera is fitted to all of them, and `guidance.py` says by `advice` how
sure it is and what to photograph next, as a ghost board over the picture. `server.py` shows that on
a page (`page.html`) of this machine. The photos in the folder are all that there is: whatever ends
a shoot, it goes on from them.
"""
