# Types of _plan_rows.py, for Cython.
cimport cython

cdef class PlanRows:
    cdef const double[:] _time
    cdef const double[:, :] _linear
    cdef const double[:, :, :, :] _rotation, _first, _second

    @cython.locals(k=Py_ssize_t)
    cpdef place(self, double time)

    @cython.locals(
        k=Py_ssize_t, m=Py_ssize_t, i=Py_ssize_t, j=Py_ssize_t, share=double, row=double[::1], turns=double[:, :, ::1])
    cpdef at(self, double time)

    @cython.locals(low=Py_ssize_t, high=Py_ssize_t, middle=Py_ssize_t)
    cdef Py_ssize_t _before(self, double time) except -1
