#include "bindings.h"

namespace nb = nanobind;

namespace {

// function(argument); what it raises for its caller to read comes out without a traceback, as one line. Hosts that print a
// Python exception whole would show where in this package a user's mistake was noticed.
nb::object in_one_line(const nb::callable &function, const nb::object &argument) {
    try {
        return function(argument);
    } catch (nb::python_error &error) {
        for (PyObject *kind : {PyExc_ValueError, PyExc_TypeError, PyExc_RuntimeError})
            if (error.matches(kind)) {
                PyErr_SetString(kind, nb::str(error.value()).c_str());
                nb::raise_python_error();
            }
        throw;
    }
}

}  // namespace

NB_MODULE(CUTICLE_MODULE, m) {
    nb::set_leak_warnings(false);  // a table that lives until the program ends is no leak
    m.doc() = "The compiled core of cuticle. Its callers validate and shape the arrays; use the package instead.";
    m.def("in_one_line", &in_one_line);
    native::bind_densities(m);
    native::bind_far_field(m);
    native::bind_fit(m);
    native::bind_groom(m);
    native::bind_longitudinal(m);
    native::bind_models(m);
    native::bind_sampler(m);
}
