"""Point clouds: LAS, LAZ and COPC, through laspy.

Reading gives absolute coordinates in float64, in metres also where the file is in feet, and every
attribute of the returns; writing gives LAS 1.4 with point format 6 to 8, steps of 0.1 mm or those
that the coordinates came with, and an offset near the data, since the defaults of most tools round
to 1 cm. Files of any size are read and written block by block.

Sources: ASPRS LAS 1.4 R15; COPC 1.0.
"""

from trueterrain.formats.las._describe import describe
from trueterrain.formats.las._read import blocks, header_of, point_variables, read
from trueterrain.formats.las._write import write

__all__ = ["blocks", "describe", "header_of", "point_variables", "read", "write"]
