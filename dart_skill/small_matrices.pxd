# Types of small_matrices.py, for Cython.
cimport cython
from libc cimport math

@cython.locals(n=Py_ssize_t)
cpdef solve_positive_definite(const double[:, :] matrix, const double[:] right)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, rest=double)
cpdef factor_into(const double[:, :] matrix, double[:, :] lower)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, rest=double)
cpdef solve_into(const double[:, :] lower, const double[:] right, double[:] solution)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, low=Py_ssize_t, high=Py_ssize_t)
cpdef eigen_into(double[:, ::1] matrix, double[::1] values, double[:, ::1] directions)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, length=double, along=double, scale=double, total=double)
cdef _reflect(double[:, ::1] matrix, double[:, ::1] directions, Py_ssize_t k)

cdef bint _is_coupled(double[:, ::1] matrix, double[::1] values, Py_ssize_t i) noexcept

@cython.locals(
    n=Py_ssize_t, k=Py_ssize_t, j=Py_ssize_t, beside=double, half=double, root=double, x=double, z=double, length=double, cosine=double,
    sine=double, first=double, second=double, both=double)
cdef _chase(double[:, ::1] matrix, double[::1] values, double[:, ::1] directions, Py_ssize_t low, Py_ssize_t high)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, rest=double)
cpdef invert_into(const double[:, :] lower, double[:, :] inverse)
