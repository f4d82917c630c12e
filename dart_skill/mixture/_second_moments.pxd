# Types of _second_moments.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.common.small_matrices cimport invert_into

cdef double LOG_2PI

@cython.locals(d=Py_ssize_t, p=Py_ssize_t, k=Py_ssize_t, lower=double[:, ::1])
cpdef bint write_components(
    const double[:, :, :] sums, double[:, :, ::1] means, double[:, :, :, ::1] affine, double[:, ::1] log_volumes, double[:, ::1] precisions
) except? -1

@cython.locals(d=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, m=Py_ssize_t, place=Py_ssize_t, mass=double, rest=double)
cdef bint _factor_moments(const double[:] sums, double[::1] mean, double[:, ::1] lower) except? -1

@cython.locals(i=Py_ssize_t, total=double)
cdef double _log_diagonal(double[:, ::1] lower) except? -1.0

@cython.locals(d=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, squares=double, total=double, entry=double)
cdef double _write_affine(double[::1] mean, double[:, ::1] lower, double[:, ::1] affine) except? -1.0

@cython.locals(
    d=Py_ssize_t, k=Py_ssize_t, p=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, m=Py_ssize_t, place=Py_ssize_t, total=double, log_peak=double
)
cpdef write_coefficients(
    const double[:, :, :, :] affine, const double[:, :] log_volumes, const double[:] log_volumes_of_blocks, const double[:] least_peaks,
    double[:] highest, const Py_ssize_t[:, :] columns, double[:, :] coefficients
)
