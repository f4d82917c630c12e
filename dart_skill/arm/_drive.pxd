# Types of _drive.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.arm._arm_terms cimport ArmTerms
from dart_skill.common.small_matrices cimport factor_into, solve_into

cpdef turn(const double[:, :] target, const double[:, :] rotation)

@cython.locals(x=double, y=double, z=double, trace=double, sine=double, cosine=double, scale=double)
cdef _turn(const double[:, :] target, const double[:, :] rotation, double[:] result, Py_ssize_t k)

@cython.locals(axis=Py_ssize_t, i=Py_ssize_t, length=double)
cdef _half_turn(const double[:, :] target, const double[:, :] rotation, double[:] result, Py_ssize_t k)

cdef double _product(const double[:, :] target, Py_ssize_t i, const double[:, :] rotation, Py_ssize_t j) noexcept

cdef class Drive:
    cdef const double[:] _lengths, _coulomb, _viscous, _weak
    cdef double _slow, _null_stiffness, _null_damping, _least_mobility
    cdef double[:, ::1] _lower, _halved, _directions
    cdef object _mobility
    cdef double[::1] _mobile, _wanted, _disturbing, _wrench, _free, _null, _total

    @cython.locals(i=Py_ssize_t, error=double[::1])
    cpdef add_pull(
        self, ArmTerms terms, const double[:] position, const double[:, :] rotation, const double[:] velocity,
        const double[:] stiffness, const double[:] damping, double[:] acceleration)

    cpdef act(self, ArmTerms terms, const double[:] acceleration, const double[:] posture)

    cpdef moved(self, ArmTerms terms, const double[:] acceleration, const double[:] posture)

    @cython.locals(j=Py_ssize_t, torque=double[::1], friction=double)
    cdef _torque(self, ArmTerms terms, double driven)

    @cython.locals(j=Py_ssize_t, torque=double[::1])
    cpdef friction(self, const double[:] qd, const double[:] drive)

    cdef double _friction(self, Py_ssize_t joint, double speed, double drive) noexcept

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, n=Py_ssize_t, jacobian=double[:, ::1], inertia=double[:, ::1])
    cdef _shape(self, ArmTerms terms, const double[:] acceleration, const double[:] posture)

    @cython.locals(
        i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, n=Py_ssize_t, rest=double, total=double, lower=double[:, ::1], halved=double[:, ::1],
        mobility=double[:, ::1])
    cdef _find_directions(self, double[:, ::1] jacobian, double[:, ::1] inertia)

    @cython.locals(
        i=Py_ssize_t, k=Py_ssize_t, along=double, mobile=double, least=double, directions=double[:, ::1], wrench=double[::1])
    cdef _as_wrench(self, double[::1] acceleration)

cdef class JointSpring:
    cdef const double[:] _stiffness, _damping, _limit

    @cython.locals(j=Py_ssize_t, torque=double[::1])
    cpdef torque(self, const double[:] q, const double[:] qd, const double[:] q_wanted, const double[:] qd_wanted)

    @cython.locals(j=Py_ssize_t, torque=double[::1])
    cpdef damp(self, const double[:] qd)

    @cython.locals(most=double)
    cdef double _at(self, Py_ssize_t joint, double way, double faster) noexcept

@cython.locals(j=Py_ssize_t, later=double[::1], faster=double[::1])
cpdef coasted(const double[:] q, const double[:] qd, const double[:] qdd, double step)

@cython.locals(i=Py_ssize_t, force=double, moment=double, shortened=double[::1])
cpdef cut(const double[:] wrench, double most_force, double most_moment)
