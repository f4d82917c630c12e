# Types of _arm_terms.py, for Cython.
cimport cython
from libc cimport math

cdef class ArmTerms:
    cdef object _kinematics, _weight, _inertia, _bias, _of_elbow, _data, _angles, _speeds
    cdef double[::1, :] _twists, _turned  # column by column, as Eigen has them
    cdef double[:, :] _upper
    cdef double[::1] _biased, _weighed, _wrist, _elbow
    cdef double[::1] _hand, _twist, _rate, _column
    cdef double[:, ::1] _hand_turned, _reflected
    cdef Py_ssize_t _up_to_elbow
    cdef bint _has_speeds, _has_gravity, _has_inertia, _has_coriolis
    cdef readonly double[::1] q, qd, position, velocity, drift, coriolis, gravity
    cdef readonly double[:, ::1] rotation, jacobian, inertia
    cdef readonly double hand_speed, elbow_speed
    cdef readonly bint are_finite

    cpdef take(self, const double[:] q, const double[:] qd)

    cpdef find_gravity(self)

    @cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t)
    cpdef find_inertia(self)

    cpdef find_coriolis(self)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, at=double[::1], turned=double[:, ::1])
    cpdef hand(self)

    @cython.locals(at=double[::1])
    cpdef elbow(self)

    cpdef elbow_jacobian(self)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, torque=double[::1])
    cpdef inertial_torque(self, const double[:] acceleration)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, position=double[::1], column=double[::1])
    cdef _place_hand(self)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, twist=double[::1], velocity=double[::1], total=double)
    cdef _move(self)

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, twist=double[::1], rate=double[::1], column=double[::1], drift=double[::1])
    cdef _change(self)

@cython.locals(i=Py_ssize_t)
cdef bint _differ(double[::1] kept, const double[:] values) except? True

@cython.locals(i=Py_ssize_t)
cdef _copy(const double[:] values, double[::1] kept)

@cython.locals(x=double, y=double, z=double, a=double, b=double, c=double)
cdef _add_cross(double[::1] left, Py_ssize_t i, double[::1] right, Py_ssize_t j, double[::1] result, Py_ssize_t k)

cdef double _length(double[::1] vector) noexcept
