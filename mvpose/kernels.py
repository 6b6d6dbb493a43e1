"""Compiler of the kernels: all modules of both packages take ``njit`` from here."""

from __future__ import annotations

from numba import njit

__all__ = ["njit"]
