"""Recordings of other laboratories: what their topics, files, axes and units mean, and what is wrong with their poses."""
