"""Compiled loops: arrays in, arrays changed. Nothing here imports the package."""

from .build.cache_files import seal_numba

seal_numba()
