# Types of _hold.py, for Cython.
cimport cython
from libc cimport math

cdef class Hold:
    cdef double _k, _d, _kr, _dr

    @cython.locals(i=Py_ssize_t, wrench=double[::1])
    cpdef pull(self, const double[:] wanted, const double[:] wanted_velocity, const double[:] stray, const double[:] position,
               const double[:] velocity, const double[:] error)

cdef class Quintic:
    cdef double[:, ::1] _rows
    cdef double _duration, _two

    @cython.locals(i=Py_ssize_t, n=Py_ssize_t, s=double, square=double, position=double[::1], velocity=double[::1], v0=double,
                   c3=double, c4=double, c5=double)
    cpdef at(self, double time)
