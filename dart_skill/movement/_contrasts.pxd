# Types of _contrasts.py, for Cython.
cimport cython
from libc cimport math

cdef Py_ssize_t NEIGHBOURS

@cython.locals(n=Py_ssize_t, n_dims=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, dim=Py_ssize_t, total=double, result=double[:, ::1],
               weight=double[::1])
cpdef contrasts(const double[:] time, const double[:, :] samples)

@cython.locals(k=Py_ssize_t, j=Py_ssize_t, unit=double, total=double, norm=double, product=double)
cdef _weigh(const double[:] time, Py_ssize_t first, double[::1] weight)
