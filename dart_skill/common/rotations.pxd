# Types of rotations.py, for Cython.
cimport cython
from libc cimport math

@cython.locals(i=Py_ssize_t, k=Py_ssize_t, least=double, length=double, x=double, y=double, z=double, w=double)
cpdef double least_length(const double[:, :] quaternions, double[:, :] unit) except? -1.0

@cython.locals(n_quaternions=Py_ssize_t, n_vectors=Py_ssize_t, n=Py_ssize_t, i=Py_ssize_t, q=Py_ssize_t, v=Py_ssize_t,
               result=double[:, ::1], x=double, y=double, z=double, w=double, a=double, b=double, c=double, p=double, r=double,
               s=double)
cpdef turned(const double[:, :] quaternions, const double[:, :] vectors)

@cython.locals(i=Py_ssize_t, angles=double[:, ::1], x=double, y=double, z=double, w=double, ahead_x=double, ahead_y=double,
               ahead_z=double, side_x=double, side_y=double, side_z=double, across=double, length=double, cos_alpha=double,
               sin_alpha=double, cos_beta=double, sin_beta=double, left=double, up=double)
cpdef hand_angles(const double[:, :] quaternions)

@cython.locals(i=Py_ssize_t, half_root=double, result=double[:, ::1], sa=double, ca=double, sb=double, cb=double, sr=double,
               cr=double, a=double, b=double, c=double, d=double, x=double, y=double, z=double, w=double)
cpdef of_hand_angles(const double[:, :] angles)

@cython.locals(i=Py_ssize_t, half=double, turn=double, last=double, added=double, jump=double)
cpdef unwrap(double[:] angles, double near)

@cython.locals(i=Py_ssize_t, result=double[:, ::1])
cpdef of_matrices(const double[:, :, :] matrices)

@cython.locals(i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, trace=double, largest=double)
cdef _of_matrix(const double[:, :] matrix, double[::1] quaternion)

@cython.locals(k=Py_ssize_t, half=double, share=double)
cpdef quaternion_into(const double[:] vector, double[::1] quaternion)

@cython.locals(x=double, y=double, z=double, w=double, length=double, sign=double, share=double)
cpdef vector_into(const double[:] quaternion, double[::1] vector)

@cython.locals(a=double, b=double, c=double, d=double, x=double, y=double, z=double, w=double)
cpdef product_into(const double[:] left, const double[:] right, double[::1] result)

@cython.locals(x=double, y=double, z=double, w=double)
cpdef matrix_into(const double[:] quaternion, double[:, ::1] matrix)
