# Types of _recursion.py, for Cython.
cimport cython

@cython.locals(n=Py_ssize_t, n_dims=Py_ssize_t, k=Py_ssize_t, dim=Py_ssize_t, state=double[:, :, ::1], x=double, v=double)
cpdef recur(const double[:, :] transition, const double[:, :, :] forcing)

@cython.locals(n=Py_ssize_t, n_dims=Py_ssize_t, k=Py_ssize_t, dim=Py_ssize_t, state=double[:, :, ::1], x=double, v=double,
               before=double, here=double)
cpdef respond(const double[:, :] transition, const double[:] now, const double[:] later, const double[:, :] attractor,
              const double[:, :] start)

@cython.locals(n_dims=Py_ssize_t, dim=Py_ssize_t, place=double[:, ::1], rate=double[:, ::1], curvature=double[:, ::1], x=double, v=double,
               y=double, w=double, first=double, middle=double, last=double)
cpdef one_step(const double[:, :] transition, const double[:, :] kicks, double stiffness, double damping, const double[:] position,
               const double[:] slope, const double[:] start, const double[:, :] drive)
