"""A second arm, in MuJoCo, with a driver, cameras and a person of its own: it knows dart_skill by
its documented topics only.
"""
