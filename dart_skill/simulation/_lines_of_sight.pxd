# Types of _lines_of_sight.py, for Cython.
cimport cython
from libc cimport math

cdef double TINY

cdef class LinesOfSight:
    cdef const double[:, :] _positions, _radii
    cdef double[:, :] _walls
    cdef double[:, :, ::1] _sides
    cdef const double[:, :, :] _points
    cdef const double[:, :, :, :] _ends
    cdef const double[:] _ranges
    cdef double[::1] _start, _ray
    cdef double _clearance

    @cython.locals(
        n_frames=Py_ssize_t, n_points=Py_ssize_t, n_cameras=Py_ssize_t, f=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t,
        counts=Py_ssize_t[:, ::1]
    )
    cpdef count(self, const double[:, :, :] points, const double[:, :, :, :] ends, const double[:, :] radii, double[:, :] walls,
                Py_ssize_t enough)

    @cython.locals(axis=Py_ssize_t, c=Py_ssize_t, start=double[::1], ray=double[::1], squared=double, distance=double, shorten=double)
    cdef bint _sees(self, Py_ssize_t k, Py_ssize_t f, Py_ssize_t i) except -1

    @cython.locals(side=Py_ssize_t, sides=double[:, :, ::1], ray=double[::1])
    cdef bint _is_in_view(self, Py_ssize_t k) except -1

    @cython.locals(
        i=Py_ssize_t, ray=double, end=double, axis=double, offset=double, length=double, thick=double, along=double, behind=double,
        across=double, apart=double, det=double, s=double, t=double
    )
    cdef double _squared_gap(self, Py_ssize_t f, Py_ssize_t c) except? -1.0

    @cython.locals(
        start=double[::1], ray=double[::1], wall=double[:, :], x=double, y=double, radius=double, a=double, b=double,
        discriminant=double, root=double
    )
    cdef bint _is_behind_wall(self, Py_ssize_t f) except -1

    @cython.locals(rim=double, height=double)
    cdef bint _meets_wall(self, Py_ssize_t f, double share) except -1

cdef double unit_interval(double value) except? -1.0
