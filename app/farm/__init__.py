"""One job, many processes: parts of a picture, frames, points of a sweep and scenes of a bench, done by workers.

Dask (the extra `farm`) carries the work; what is tried again, what is copied and what is kept is decided here, by the
process that was started. Workers keep no files: all that is done is kept by that process.
"""
