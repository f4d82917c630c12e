# Types of small_matrices.py, for Cython.
cimport cython
from libc cimport math

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, rest=double)
cpdef factor_into(const double[:, :] matrix, double[:, :] lower)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, rest=double)
cpdef solve_into(const double[:, :] lower, const double[:] right, double[:] solution)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, rest=double)
cpdef invert_into(const double[:, :] lower, double[:, :] inverse)
