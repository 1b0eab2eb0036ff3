"""Ground you can trust."""

from trueterrain._version import __version__

__all__ = ["__version__"]
