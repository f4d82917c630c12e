# Types of _joints.py, for Cython.
cimport cython
from dart_skill.simulation._arm_geometry cimport ArmDynamics
from dart_skill.simulation._joint_dynamics cimport JointDynamics, read_joints
from dart_skill.simulation._transmission cimport Encoders, Transmission

cdef class Joints:
    cdef readonly list angles, speeds, seen_angles, seen_speeds
    cdef readonly object position, velocity, seen_position, seen_velocity, effort
    cdef JointDynamics _dynamics
    cdef ArmDynamics _nominal
    cdef Encoders _encoders
    cdef Transmission _transmission
    cdef object _actuation, _safety, _arm, _read, _set, _mode, _all, _no_torque

    cpdef begin(self, world, arm, start, ArmDynamics carried)

    cpdef read(self)

    cpdef drive(self, command, push, bint brakes, ArmDynamics arm)

    cdef bint _is_stopped(self, torque, speed) except -1

    cdef _from_outside(self, push)

    cpdef braking(self)
