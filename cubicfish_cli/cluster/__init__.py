"""The workers of a dask cluster: the same work on many photos, on many machines.

The work travels once to each process, a photo's path with each task, and what comes back is
small: photos and pictures themselves stay on a file system that all machines share.
"""
