# Types of _joint_dynamics.py, for Cython.
cimport cython
from dart_skill.simulation._transmission cimport Transmission

@cython.locals(i=Py_ssize_t, joint=tuple, angles=double[::1], speeds=double[::1])
cpdef read_joints(tuple joints)

cdef class JointDynamics:
    cdef object _actuation, _reflected, _with_rotors, _net
    cdef Transmission _transmission
    cdef double _gravity, _step

    @cython.locals(j=Py_ssize_t, torque=double[::1])
    cpdef asked(self, const double[:] joint_torque, const double[:] pull, const double[:] gravity)

    @cython.locals(
        i=Py_ssize_t, j=Py_ssize_t, n=Py_ssize_t, masses=double[:, :], held=double[:], with_rotors=double[:, ::1],
        reflected=double[:, ::1], net=double[::1], push=double[:], given=double[:], acceleration=double[:], torque=double
    )
    cpdef torque(self, inertia, bias, effort, outside, position, velocity)
