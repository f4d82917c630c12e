# Types of _transmission.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.common.small_matrices cimport factor_into, solve_into

cdef class Transmission:
    cdef const double[:] _stiffness, _damping
    cdef const double[:, :] _reflected
    cdef double[::1] _link, _momentum
    cdef double[:, ::1] _system
    cdef object _actuation, _speeds, _motor_speeds
    cdef readonly object position, velocity

    @cython.locals(
        n=Py_ssize_t, j=Py_ssize_t, h=double, theta=double[::1], acceleration=double[::1], link=double[::1], speeds=double[::1],
        motors=double[:]
    )
    cpdef advance(self, const double[:] q, const double[:] velocity, const double[:, :] inertia, const double[:] effort,
                  const double[:] outside, double step)

    @cython.locals(
        n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, system=double[:, ::1], momentum=double[::1], speeds=double[::1],
        damping=double[:], spring=double, coupling=double, of_link=double, of_motor=double
    )
    cdef _set_up(self, const double[:, :] inertia, const double[:] effort, const double[:] outside, const double[:] theta, double h)

cdef class Encoders:
    cdef const double[:] _offset
    cdef double[::1] _last, _speed
    cdef double _resolution, _step, _gain
    cdef bint _exact, _has_read

    @cython.locals(j=Py_ssize_t)
    cpdef reset(self)

    @cython.locals(j=Py_ssize_t, angles=double[::1], true=double[:], last=double[::1], speed=double[::1])
    cpdef read(self, position, velocity)
