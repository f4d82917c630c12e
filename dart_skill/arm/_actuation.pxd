# Types of _actuation.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.common.small_matrices cimport factor_into, solve_into

cdef class Actuation:
    cdef Py_ssize_t _n
    cdef const double[:, :] _to_motor, _from_joint_torque
    cdef const double[:] _stall, _slope, _peak, _dry, _wet
    cdef double[::1] _motor, _momentum
    cdef double[:, ::1] _system
    cdef double _stiction
    cdef readonly object coulomb, viscous

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, asked=double, back_emf=double)
    cpdef deliverable(self, const double[:] torque, const double[:] velocity)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, speed=double)
    cpdef braking(self, const double[:] velocity)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, total=double, torque=double[::1])
    cdef _at_joints(self)

    @cython.locals(j=Py_ssize_t, damping=double[::1])
    cpdef damping(self, const double[:] velocity)

    @cython.locals(speed=double, dry=double)
    cdef double _damping(self, Py_ssize_t joint, double velocity) except? -1.0

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, total=double, reached=double[::1], system=double[:, ::1], momentum=double[::1])
    cpdef acceleration(self, const double[:, :] inertia, const double[:] torque, const double[:] velocity, double step)
