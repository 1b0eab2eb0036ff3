"""Virtual accelerometers: specific force along the z axis of the body, with instrument errors.

An accelerometer measures specific force, acceleration less gravity: upright and at rest it reads
+g. It reads the component along its axis n of

    f_b = R_gb^T (p'' - g) + w' x r + w x (w x r),

with the acceleration p'' of the origin of the body and the gravity g in the ground frame, the
rotation R_gb from body to ground, the angular velocity w and acceleration w' of the body in body
axes, and the position r of the sensor in the body. So the tilt of the road, g cos(roll) cos(pitch),
and centripetal terms are included.
"""

from trueterrain.simulate.accelerometers._parameters import Accelerometers, sensor_triangle
from trueterrain.simulate.accelerometers._stream import (
    AccelerometerBlock,
    AccelerometerStream,
    specific_force,
)

__all__ = [
    "AccelerometerBlock",
    "AccelerometerStream",
    "Accelerometers",
    "sensor_triangle",
    "specific_force",
]
