# Types of _parting.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.small_matrices cimport factor_into, solve_into

cdef double CALIBRATION

@cython.locals(n=Py_ssize_t, m=Py_ssize_t, best=double)
cpdef parting(const double[:] time, const double[:, :] difference, Py_ssize_t degree)

@cython.locals(m=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, row=Py_ssize_t, column=Py_ssize_t, power=double, product=double,
               sums=double[:, ::1])
cdef _fit(const double[:] time, const double[:, :] difference, double[:, ::1] factor, double[:, ::1] curve)

@cython.locals(i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t)
cdef _square_speed(double[:, ::1] curve, double[::1] squared)

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
