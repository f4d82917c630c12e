# Types of _speeds.py, for Cython.
cimport cython
from libc cimport math

@cython.locals(i=Py_ssize_t, k=Py_ssize_t, same=bint)
cpdef bint repeats(const double[:, :] samples) except? -1

cpdef usual_speeds(const double[:] time, const double[:, :] position)

@cython.locals(i=Py_ssize_t, x=double, y=double, z=double)
cdef _speeds(const double[:] time, const double[:, :] position, double[::1] speed)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, place=Py_ssize_t, value=double, ordered=double[::1])
cdef _medians_of_five(const double[:] values, double[::1] middle)
