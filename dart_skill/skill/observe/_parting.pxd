# Types of _parting.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.small_matrices cimport factor_into, solve_into

cdef double CALIBRATION, CLOSE
cdef Py_ssize_t MOST_STEPS

@cython.locals(n=Py_ssize_t, m=Py_ssize_t, i=Py_ssize_t, best=double, factor=double[:, ::1], curve=double[:, ::1],
               squared=double[::1], rate=double[::1], roots=double[::1])
cpdef parting(const double[:] time, const double[:, :] difference, Py_ssize_t degree)

@cython.locals(m=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, row=Py_ssize_t, column=Py_ssize_t, power=double, product=double,
               sums=double[:, ::1])
cdef _fit(const double[:] time, const double[:, :] difference, double[:, ::1] factor, double[:, ::1] curve)

@cython.locals(i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t)
cdef _square_speed(double[:, ::1] curve, double[::1] squared)

@cython.locals(degree=Py_ssize_t, count=Py_ssize_t, order=Py_ssize_t, n=Py_ssize_t, i=Py_ssize_t, factor=Py_ssize_t,
               pieces=Py_ssize_t, derivative=double[::1], edges=double[::1], bound=double)
cdef Py_ssize_t _real_roots(double[::1] coefficients, double[::1] roots) except? -1

@cython.locals(i=Py_ssize_t, rises=bint, place=double, value=double, slope=double, after=double)
cdef double _root_between(double[:] coefficients, double low, double high) except? -1.0

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, best=double, least=double, nearest=double, place=double, speed=double)
cdef double _slowest(double[:, ::1] curve, double[::1] squared, double[:] extremes, double first, double last) except? -1.0

@cython.locals(i=Py_ssize_t, total=double, power=double)
cdef double _value(double[:] coefficients, double place) except? -1.0

@cython.locals(x=double, y=double, z=double)
cdef double _square_distance(double[:, ::1] curve, double place) except? -1.0

@cython.locals(n=Py_ssize_t, m=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, row=Py_ssize_t, rate=double[::1], spread=double[::1],
               power=double, left=double, slope=double, variance=double, misfit=double, bend=double)
cdef double _deviation(const double[:] time, const double[:, :] difference, double[:, ::1] factor, double[:, ::1] curve,
                       double place) except? -1.0
