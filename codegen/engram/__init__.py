"""Engram, offline: robots, data, learning and table generation. Online control lives in controller/ (C++17)."""

__version__ = "0.1.0"
