# Types of _registration_rows.py, for Cython.
cimport cython
from dart_skill.rotations cimport matrix_into, product_into, quaternion_into, vector_into

cdef Py_ssize_t UNKNOWNS

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, delay=double, left=double[:, ::1], angles=double[:, ::1],
               moved=double[:, :, ::1], rotated=double[:, :, ::1], base=double[::1], hand=double[::1], late=double[::1],
               arm=double[::1], expected=double[::1], vector=double[::1], lever=double[::1], axes=double[:, ::1],
               base_axes=double[:, ::1])
cpdef linearised(const double[:, :] position, const double[:, :] quaternion, const double[:, :] arm_position,
                 const double[:, :] arm_quaternion, const double[:, :] arm_velocity, const double[:] unknown)

@cython.locals(j=Py_ssize_t, k=Py_ssize_t, x=double, y=double, z=double)
cdef _write_rows(double[:, ::1] axes, double[::1] lever, const double[:] velocity, double[:, ::1] moved, double[:, ::1] rotated)
