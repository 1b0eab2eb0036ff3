"""The virtual accelerometers: specific force along the z axis of the body, and what is wrong in it.

An accelerometer does not feel gravity, but what holds it against gravity: standing upright it reads
+g. In general it reads the component along its own axis n of

    R' (p'' - g) + w' x r + w x (w x r),

with the acceleration p'' of the origin of the body and the gravity g on the ground, the rotation R
of the body, its angular velocity w and acceleration w' in body axes, and the sensor's position r in
the body. Tilt of the road (g cos(roll) cos(pitch)) and centripetal terms are contained.
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
