# Types of _regression_terms.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.common.small_matrices cimport factor_into, invert_into

@cython.locals(
    n_inputs=Py_ssize_t, n_outputs=Py_ssize_t, k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, a=Py_ssize_t, b=Py_ssize_t,
    lower=double[:, ::1], half=double[:, ::1]
)
cpdef write_conditionals(
    const double[:, :] means, const double[:, :, :] covariances, const Py_ssize_t[:] into, const Py_ssize_t[:] out,
    double[:, :, ::1] whiteners, double[::1] log_volumes, double[:, :, ::1] lines, double[:, :, ::1] within
)

@cython.locals(i=Py_ssize_t, j=Py_ssize_t, log_volume=double)
cdef double _whiten_inputs(
    const double[:, :] covariance, const Py_ssize_t[:] into, double[:, ::1] lower, double[:, ::1] whitener
) except? -1.0

@cython.locals(
    n_inputs=Py_ssize_t, n=Py_ssize_t, k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, lowest=double, highest=double, square=double,
    white=double, value=double
)
cpdef write_logs(
    const double[:, :] inputs, const double[:, ::1] input_means, const double[:, :, ::1] whiteners, const double[::1] constants,
    double[:, ::1] logs, double[::1] top
)

@cython.locals(n=Py_ssize_t, k=Py_ssize_t, total=double, scale=double)
cpdef normalise(double[:, ::1] shares)

@cython.locals(n=Py_ssize_t, place=Py_ssize_t, k=Py_ssize_t, i=Py_ssize_t, share=double)
cpdef write_lines(const double[:, :] inputs, const double[:, ::1] shares, const double[:, ::1] input_means, double[:, ::1] terms)

@cython.locals(
    n_components=Py_ssize_t, n_outputs=Py_ssize_t, n=Py_ssize_t, k=Py_ssize_t, a=Py_ssize_t, b=Py_ssize_t, i=Py_ssize_t, place=Py_ssize_t,
    first=Py_ssize_t, offset=double, its=double, share=double, weighted=double, apart=double[:, ::1], mean=double[::1], spread=double[::1]
)
cpdef write_spread(
    const double[:, :] inputs, const double[:, ::1] shares, const double[:, ::1] input_means, const double[:, :, ::1] lines,
    double[:, ::1] terms
)
