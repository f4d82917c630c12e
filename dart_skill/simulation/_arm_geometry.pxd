# Types of _arm_geometry.py, for Cython.
cimport cython
from libc cimport math

cdef class ArmGeometry:
    cdef const double[:, :] _steps
    cdef const double[:, :, :] _local, _turns
    cdef double[:, ::1] _turned
    cdef const Py_ssize_t[:] _frame_of
    cdef double[:, :, ::1] _axes
    cdef double[:, ::1] _origin
    cdef object _radii

    @cython.locals(
        n=Py_ssize_t, k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, axes=double[:, :, ::1], cosine=double, sine=double
    )
    cdef _place_frames(self, const double[:] angles, double base_turn)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, m=Py_ssize_t, total=double)
    cdef _turn_at(self, Py_ssize_t k)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t)
    cdef _step_to(self, Py_ssize_t k)

    @cython.locals(
        n_capsules=Py_ssize_t, c=Py_ssize_t, k=Py_ssize_t, end=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, ends=double[:, :, ::1]
    )
    cdef _ends(self)

    cpdef capsules(self, position, double base_turn=*)

    @cython.locals(
        n=Py_ssize_t, k=Py_ssize_t, axes=double[:, :, ::1], origin=double[:, ::1], torque=double[::1], x=double, y=double, z=double
    )
    cpdef in_joints(self, const double[:] position, const double[:] wrench)

@cython.locals(i=Py_ssize_t)
cpdef bint is_zero(const double[:] values)
