# Types of flight_steps.py, for Cython.
cimport cython
from libc cimport math

cdef double MAX_STEP, MAX_LOSS, PROBE, CLOSE, CROSSED
cdef Py_ssize_t MOST_CORRECTIONS, MOST_REPETITIONS

@cython.locals(n_flights=Py_ssize_t, n_times=Py_ssize_t)
cpdef fly(const double[:, :] position, const double[:, :] velocity, const double[:, :] time, double drag, double gravity)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, never=double, place=double[:, ::1], speed=double[:, ::1],
               instant=double[::1], begin=double[:, ::1], step=double[::1])
cpdef cross(const double[:, :] position, const double[:, :] velocity, const double[:] time, const double[:] normal,
            const double[:] offset, double drag, double gravity)

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, k=Py_ssize_t, longest=double, largest=double, state=double[:, ::1], change=double[::1],
               away=double[::1], points=double[:, ::1],
               directions=double[:, ::1], triangle=double[:, ::1], left=double[::1])
cpdef fit(const double[:] time, const double[:, :] position, const double[:, :] first, double drag, double gravity, double accuracy)

@cython.locals(n_flights=Py_ssize_t, n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, state=double[:, :, ::1],
               lifted=double[:, ::1])
cpdef lines(const double[:, :] time, const double[:, :, :] position, double gravity)

@cython.locals(n_flights=Py_ssize_t, n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, may=cython.uchar[::1], last=double, squares=double,
               x=double, y=double, z=double, across=double, rise=double, fall=double, fastest=double, bound=double)
cpdef may_fly(const double[:, :] time, const double[:, :, :] position, const double[:, :, :] states, double drag, double gravity,
              double tolerance)

@cython.locals(n_flights=Py_ssize_t, n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, longest=double, largest=double,
               state=double[:, :, ::1], away=double[:, ::1], change=double[:, ::1], left=double[:, ::1], speeds=double[:, ::1],
               step=double[::1])
cpdef fit_together(const double[:, :] time, const double[:, :, :] position, const double[:, :, :] first, double drag,
                   double gravity, double accuracy)

@cython.locals(n=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, middle=double, spread=double, mean=double, slope=double)
cdef _line(const double[:] time, double[:, ::1] samples, double[:, ::1] line)

cdef double _length(double[:, ::1] vectors, Py_ssize_t i) except? -1.0

@cython.locals(i=Py_ssize_t, j=Py_ssize_t, longest=double)
cdef Py_ssize_t _needed(const double[:, :] velocity, const double[:, :] time, double drag) except? -1

@cython.locals(i=Py_ssize_t, fastest=double)
cdef double _longest_step(const double[:, :] velocity, double drag) except? -1.0

@cython.locals(n_flights=Py_ssize_t, n=Py_ssize_t, first=Py_ssize_t, way=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t,
               n_steps=Py_ssize_t, place=double[:, ::1], speed=double[:, ::1], step=double[::1], longest_step=double, now=double)
cdef _follow(const double[:, :] position, const double[:, :] velocity, const double[:] time, double drag, double gravity,
             double[:, ::1] points)

@cython.locals(i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, row=Py_ssize_t, n_steps=Py_ssize_t)
cdef _predict(const double[:, :] position, const double[:, :] velocity, const double[:, :] time, double drag, double gravity,
              double[:, ::1] points, double[:, ::1] speeds, double[::1] step)

@cython.locals(i=Py_ssize_t, h=double, half=double, sixth=double, braked=double, x=double, y=double, z=double, u=double, v=double,
               w=double, x1=double, y1=double, z1=double, x2=double, y2=double, z2=double, x3=double, y3=double, z3=double,
               x4=double, y4=double, z4=double)
cdef _advance(double[:, ::1] points, double[:, ::1] speeds, double[::1] step, Py_ssize_t n_steps, double drag, double gravity)

cdef double _braked(double x, double y, double z, double drag) except? -1.0

@cython.locals(height=double, rate=double, step=double[::1])
cdef bint _crosses(double[:, ::1] place, double[:, ::1] speed, double[::1] instant, const double[:] normal, double offset,
                   double drag, double gravity) except? -1

cdef double _along(const double[:] normal, double[:, ::1] vector) except? -1.0

@cython.locals(n=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, k=Py_ssize_t, axis=Py_ssize_t, starts=double[:, ::1],
               velocities=double[:, ::1], probed=double[:, ::1])
cdef _sensitivity(double[:, ::1] state, const double[:] time, double drag, double gravity, double[:, ::1] points,
                  double[:, ::1] directions)

@cython.locals(m=Py_ssize_t, n=Py_ssize_t, k=Py_ssize_t, i=Py_ssize_t, other=Py_ssize_t, total=double, length=double)
cdef _orthonormalise(double[:, ::1] directions, double[:, ::1] triangle)

@cython.locals(m=Py_ssize_t, k=Py_ssize_t, other=Py_ssize_t)
cdef _solve(double[:, ::1] directions, double[:, ::1] triangle, double[::1] left, double[::1] change)

@cython.locals(i=Py_ssize_t, share=double)
cdef double _taken(double[:, ::1] directions, Py_ssize_t k, double[::1] vector) except? -1.0
