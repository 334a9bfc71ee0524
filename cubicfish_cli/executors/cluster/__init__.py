"""The workers of a dask cluster: the same work on many photos, on many executor.

The work travels once to each process, a photo's path with each task, and what comes back is
small: photos and pictures themselves stay on a file system that all executor share.
"""
