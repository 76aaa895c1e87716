"""One command, many processes: parts, frames, scenes of the bench and points of a sweep are handed out to workers.

Dask (the extra `farm`) carries the work; what is tried again, what is copied, what is kept and what is told of it are
decided here, by the process that was started. Workers keep no files: all that is done lies with that process.
"""
