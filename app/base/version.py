"""The version of this program; `pyproject.toml` reads it, without importing anything else."""

__version__ = "0.1.0"
