"""Numbers that are the same everywhere."""

N_JOINTS = 7
"""Joints of the WAM."""
GRAVITY = 9.81
"""Of the earth [m/s^2]."""
AIR_DENSITY = 1.204
"""Of dry air at 20 degrees Celsius and sea level [kg/m^3]."""
