"""Point clouds: LAS, LAZ and COPC, through laspy.

Reading gives absolute coordinates in float64, in metres even if the file is in feet, and all
attributes of the returns. Writing gives LAS 1.4 with point format 6 to 8, a scale of 0.1 mm or that
of the file that was read, and an offset near the data: the defaults of most tools round coordinates
to 1 cm. Files of any size are read and written block by block.

Sources: ASPRS LAS 1.4 R15; COPC 1.0.
"""

from trueterrain.formats.las._describe import describe
from trueterrain.formats.las._read import blocks, header_of, point_variables, read
from trueterrain.formats.las._write import write

__all__ = ["blocks", "describe", "header_of", "point_variables", "read", "write"]
