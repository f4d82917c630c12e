"""What all rooms use: checks of arguments, rotations, files, configuration, the world, and a ball
in the air.
"""
