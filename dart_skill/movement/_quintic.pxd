# Types of _quintic.py, for Cython.
cimport cython
from libc cimport math

cdef Py_ssize_t WIDTH

@cython.locals(p=Py_ssize_t, k=Py_ssize_t, span=Py_ssize_t, degree=Py_ssize_t, result=double[:, ::1], lower=double[::1],
               higher=double[::1])
cpdef values(const double[:] knots, const Py_ssize_t[:] first, const double[:] points, Py_ssize_t order)

@cython.locals(p=Py_ssize_t, k=Py_ssize_t, below=Py_ssize_t, bands=double[:, ::1])
cpdef sum_of_squares(const Py_ssize_t[:] first, const double[:, :] rows, Py_ssize_t n)

@cython.locals(p=Py_ssize_t, k=Py_ssize_t, dim=Py_ssize_t, result=double[:, ::1])
cpdef sums(const Py_ssize_t[:] first, const double[:, :] rows, const double[:, :] samples, Py_ssize_t n)

@cython.locals(p=Py_ssize_t, k=Py_ssize_t, dim=Py_ssize_t, result=double[:, ::1])
cpdef combined(const Py_ssize_t[:] first, const double[:, :] rows, const double[:, :] coefficients)

cpdef solve(const double[:, :] bands, const double[:, :] right)

@cython.locals(n=Py_ssize_t, n_dims=Py_ssize_t, dim=Py_ssize_t, end=Py_ssize_t, column=Py_ssize_t, below=Py_ssize_t, i=Py_ssize_t,
               solution=double[:, ::1], total=double[:, ::1], alike=double[:, ::1])
cpdef solve_penalised(const double[:, :] bands, const double[:, :] roughness, const double[:] penalties, const double[:, :] right)

@cython.locals(n=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, below=Py_ssize_t, rest=double, lower=double[:, ::1])
cpdef factor(const double[:, :] bands)

@cython.locals(n=Py_ssize_t, n_dims=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, dim=Py_ssize_t, solution=double[:, ::1])
cpdef forward(const double[:, :] lower, const double[:, :] right)

@cython.locals(n=Py_ssize_t, n_dims=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, dim=Py_ssize_t, solution=double[:, ::1])
cpdef backward(const double[:, :] lower, const double[:, :] right)

@cython.locals(q=Py_ssize_t, r=Py_ssize_t, saved=double, before=double, after=double, share=double)
cdef _of_degree(const double[:] knots, Py_ssize_t span, double point, Py_ssize_t degree, double[::1] found)

@cython.locals(r=Py_ssize_t, i=Py_ssize_t)
cdef _differentiate(const double[:] knots, Py_ssize_t span, Py_ssize_t degree, double[::1] lower, double[::1] higher)
