# Types of _joint_checks.py, for Cython.
cimport cython
from dart_skill.arm._arm_terms cimport ArmTerms

cdef class Levels:
    cdef const double[:] _strongest, _lower, _upper, _low, _high

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t)
    cpdef bint are_far(
        self, ArmTerms terms, const double[:] torque, double fastest_elbow, double fastest_hand, double share) except? True

    @cython.locals(i=Py_ssize_t, j=Py_ssize_t, least=double, asked=double, room=double)
    cpdef double share(self, ArmTerms terms, const double[:] wrench, const double[:] torque) except? -1.0
