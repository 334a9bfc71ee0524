"""Executor on a dask cluster.

The work travels once to each process, a photo's path with each task, and what comes back is
small: photos and pictures themselves stay on a file system that all executor share.
"""
