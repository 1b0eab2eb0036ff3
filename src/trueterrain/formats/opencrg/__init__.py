"""OpenCRG: road surfaces on a grid along a curved reference line.

Files are read as they are stored: modifiers in the file are not applied, so coordinates stay
absolute. Reading is strict, since the reference implementations silently accept damage that makes
heights meaningless. Writing follows the stricter of the two, and every file is read back before it
appears.

Source: ASAM OpenCRG 2.0.1, and the consistency checks of its MATLAB library.
"""

from trueterrain.formats.opencrg._holes import fill_interior
from trueterrain.formats.opencrg._read import describe, read
from trueterrain.formats.opencrg._write import write

__all__ = ["describe", "fill_interior", "read", "write"]
