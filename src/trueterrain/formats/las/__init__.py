"""Point clouds: LAS, LAZ and COPC, through laspy.

Reading gives absolute coordinates in float64 and refuses what is not metres; writing gives LAS 1.4
with point format 6, steps of 0.1 mm and an offset near the data, since the defaults of most tools
round to 1 cm. Files of any size are read and written block by block.

Sources: ASPRS LAS 1.4 R15; COPC 1.0.
"""

from trueterrain.formats.las._describe import describe
from trueterrain.formats.las._read import blocks, read
from trueterrain.formats.las._write import write

__all__ = ["blocks", "describe", "read", "write"]
