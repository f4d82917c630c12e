# Types of _joint_checks.py, for Cython.
cimport cython
from libc cimport math
from dart_skill.arm._arm_terms cimport ArmTerms

@cython.locals(i=Py_ssize_t, most=double)
cpdef double largest(const double[:] values) except? -1.0

@cython.locals(i=Py_ssize_t, most=double)
cpdef double farthest(const double[:] values, const double[:] others) except? -1.0

@cython.locals(x=double, y=double, z=double)
cpdef double distance(const double[:] point, const double[:] other) except? -1.0

cdef class JointRange:
    cdef const double[:] _lower, _upper

    @cython.locals(j=Py_ssize_t)
    cpdef bint holds(self, const double[:] position, double margin) except? True

cdef class Levels:
    cdef const double[:] _strongest, _lower, _upper, _low, _high

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t)
    cpdef bint are_far(
        self, ArmTerms terms, const double[:] torque, double fastest_elbow, double fastest_hand, double share) except? True

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, least=double, asked=double, room=double)
    cpdef double share(self, ArmTerms terms, const double[:] wrench, const double[:] torque) except? -1.0
