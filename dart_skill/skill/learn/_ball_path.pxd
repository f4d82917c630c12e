# Types of _ball_path.py, for Cython.
cimport cython
from libc cimport math

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, place=double[:, ::1], speed=double[:, ::1], cos=double, sin=double, ahead=double,
               left=double, up=double, ca=double, sa=double, cb=double, sb=double, far=double, x=double, y=double, z=double,
               wx=double, wy=double, wz=double, vx=double, vy=double, vz=double)
cpdef ball_states(const double[:, :] position, const double[:, :] velocity, double azimuth, double roll, const double[:] centre)
