"""Whether photos are enough for a camera, where they are lacking, and what one more adds.

`enough.py` names what is missing as a photographer would, goes by the verdict on whether photos are
enough, and gives one line of it (`summary`). `worth.py` tells what each of many photos adds before
a camera is fitted.
"""
