# Types of _arm_geometry.py, for Cython.
cimport cython
from libc cimport math

cdef class ArmGeometry:
    cdef const double[:, :] _steps, _roll
    cdef const double[:, :, :] _local
    cdef const Py_ssize_t[:] _frame_of
    cdef double[:, :, ::1] _axes
    cdef double[:, ::1] _origin
    cdef object _radii

    @cython.locals(
        n=Py_ssize_t, k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, axes=double[:, :, ::1], cosine=double, sine=double, level=double,
        tilted=double, rolled=double
    )
    cdef _place_frames(self, const double[:] angles, double base_turn)

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

cdef class ArmDynamics(ArmGeometry):
    cdef const double[:] _masses
    cdef const double[:, :] _centres
    cdef const double[:, :, :] _inertias
    cdef object _mass_matrix, _bias, _still
    cdef double[:, :, ::1] _turned
    cdef double[:, ::1] _arms, _spin, _spin_rate, _acceleration, _force, _moment, _inertia
    cdef double[::1] _offset, _moved, _momentum, _centre

    cpdef gravity_torque(self, position)

    cpdef terms(self, position, velocity)

    @cython.locals(k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t)
    cdef _place_bodies(self, position)

    @cython.locals(
        axes=double[:, :, ::1], turned=double[:, :, ::1], half=double[:, ::1], k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, m=Py_ssize_t
    )
    cdef _turn_inertias(self)

    @cython.locals(
        axes=double[:, :, ::1], origin=double[:, ::1], spin=double[:, ::1], rate=double[:, ::1], bias=double[::1], n=Py_ssize_t,
        k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, m=Py_ssize_t
    )
    cdef _newton_euler(self, const double[:] speeds)

    @cython.locals(
        spin=double[:, ::1], rate=double[:, ::1], offset=double[::1], along=double, squared=double, i=Py_ssize_t, j=Py_ssize_t, m=Py_ssize_t
    )
    cdef _accelerate(self, Py_ssize_t k)

    @cython.locals(
        spin=double[:, ::1], rate=double[:, ::1], force=double[:, ::1], moment=double[:, ::1], momentum=double[::1], i=Py_ssize_t,
        j=Py_ssize_t, m=Py_ssize_t
    )
    cdef _balance(self, Py_ssize_t k)

    @cython.locals(
        axes=double[:, :, ::1], origin=double[:, ::1], matrix=double[:, ::1], centre=double[::1], force=double[::1], moment=double[::1],
        mass=double, total=double, lever=double, n=Py_ssize_t, k=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, m=Py_ssize_t, c=Py_ssize_t,
        joint=Py_ssize_t
    )
    cdef _add_up_bodies(self)

    @cython.locals(apart=double[::1], squared=double, whole=double, reduced=double, i=Py_ssize_t, j=Py_ssize_t)
    cdef _take_in(self, Py_ssize_t k, double mass)
