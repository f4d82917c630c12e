# Types of _frame_products.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.common.small_matrices cimport invert_into

cdef double LEAST_PIVOT

@cython.locals(n=Py_ssize_t, s=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, total=double, offset=double[::1])
cpdef write_seen(
    const double[:, :] world, const double[:, :, :] inverses, const double[:, :] b, const Py_ssize_t[:] place, double[:, ::1] columns
)

cdef class FrameProducts:
    cdef const double[:, :, :] _means
    cdef const double[:, :, :, :] _whiteners
    cdef Py_ssize_t _n_shared
    cdef double[::1] _about
    cdef double[:, ::1] _inverse, _equations

    @cython.locals(m=Py_ssize_t, undetermined=Py_ssize_t, n=Py_ssize_t, k=Py_ssize_t, feature=Py_ssize_t)
    cpdef Py_ssize_t write(
        self, const double[:, :, :, :] A, const double[:, :, :, :] inverses, const double[:, :, :] b, const unsigned char[:, :] seen,
        double[:, :, ::1] mean, double[:, :, :, ::1] covariance
    ) except -1

    @cython.locals(n_seen=Py_ssize_t, p=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, total=double)
    cdef int _find_middle(self, const double[:, :, :] A, const double[:, :] b, const unsigned char[:] seen, Py_ssize_t k) except -1

    @cython.locals(
        m=Py_ssize_t, n_shared=Py_ssize_t, n_rows=Py_ssize_t, first_frame=Py_ssize_t, n_others=Py_ssize_t, p=Py_ssize_t, i=Py_ssize_t,
        j=Py_ssize_t
    )
    cdef Py_ssize_t _make_triangle(
        self, const double[:, :, :] inverses, const double[:, :] b, const unsigned char[:] seen, Py_ssize_t k
    ) except -1

    @cython.locals(m=Py_ssize_t, j=Py_ssize_t, c=Py_ssize_t, right=double, total=double)
    cdef int _put_equation(
        self, const double[:, :, :] inverses, const double[:, :] b, Py_ssize_t p, Py_ssize_t k, Py_ssize_t i, Py_ssize_t row
    ) except -1

    @cython.locals(
        m=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, c=Py_ssize_t, feature=Py_ssize_t, other=Py_ssize_t, total=double, right=double[::1]
    )
    cdef int _solve(self, double[::1] mean, double[:, ::1] covariance) except -1

@cython.locals(j=Py_ssize_t, i=Py_ssize_t, c=Py_ssize_t, square=double, length=double, scale=double, total=double)
cdef int _reflect(double[:, ::1] columns, Py_ssize_t first, Py_ssize_t stop, Py_ssize_t n_rows) except -1

@cython.locals(i=Py_ssize_t, total=double)
cdef bint _is_determined(double[:, ::1] columns, Py_ssize_t j) except? -1
