// The samplers' tables of every family, and what is done to arrays of samples.
#include "arrays.h"
#include "bindings.h"

#include "cuticle/sampler/families.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

namespace native {

template <class Float, class Family> void bind_tables(nb::module_ &m, const std::string &ending);  // tables.h

namespace {

// The first value outside [lo, hi] (a NaN is), or -1. Half-open on the right if asked.
template <class Float> std::int64_t first_outside(const In<Float> &x, double lo, double hi, bool open) {
    const std::size_t n = x.size();
    const Float *data = x.data();
    const Float a = Float(lo), b = Float(hi);
    std::size_t found = n;
    std::mutex lock;
    parallel_for(n, 65536, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; i += 4096) {
            const std::size_t stop = std::min(i + 4096, end);
            int bad = 0;
            if (open)
                for (std::size_t j = i; j < stop; ++j) bad |= !(data[j] >= a && data[j] < b);
            else
                for (std::size_t j = i; j < stop; ++j) bad |= !(data[j] >= a && data[j] <= b);
            if (!bad) continue;
            for (std::size_t j = i; j < stop; ++j)
                if (!(data[j] >= a && (open ? data[j] < b : data[j] <= b))) {
                    const std::lock_guard<std::mutex> guard(lock);
                    found = std::min(found, j);
                    break;
                }
            return;
        }
    });
    return found == n ? -1 : static_cast<std::int64_t>(found);
}

// Counts of (theta, phi) samples in the cells between increasing edges, added to counts (theta cells, phi cells).
// A sample outside the edges is counted in the return value.
template <class Float>
std::int64_t histogram(const In<Float> &theta, const In<Float> &phi, const In<double> &theta_edges,
                       const In<double> &phi_edges, Out<std::int64_t> counts) {
    const double *te = theta_edges.data(), *pe = phi_edges.data();
    const std::size_t rows = theta_edges.size() - 1, columns = phi_edges.size() - 1;
    std::mutex lock;
    std::int64_t outside = 0;
    parallel_for(theta.size(), 65536, [&](std::size_t begin, std::size_t end) {
        std::vector<std::int64_t> local(rows * columns);
        std::int64_t missed = 0;
        // How many edges lie at or below x, by halves; without a branch, which random directions would mispredict.
        const auto cell = [](const double *edges, std::size_t cells, double x) {
            const double *from = edges;
            for (std::size_t left = cells + 1; left > 1; left -= left / 2) from += (from[left / 2 - 1] <= x) * (left / 2);
            const auto i = static_cast<std::size_t>(from - edges) + (*from <= x);
            return x == edges[cells] ? cells : i;  // the last edge belongs to the last cell
        };
        for (std::size_t i = begin; i < end; ++i) {
            const std::size_t a = cell(te, rows, theta.data()[i]), b = cell(pe, columns, phi.data()[i]);
            if (a == 0 || b == 0 || a > rows || b > columns) ++missed;
            else ++local[(a - 1) * columns + b - 1];
        }
        const std::lock_guard<std::mutex> guard(lock);
        outside += missed;
        for (std::size_t i = 0; i < local.size(); ++i) counts.data()[i] += local[i];
    });
    return outside;
}

}  // namespace

void bind_sampler(nb::module_ &m) {
    nb::list names;
    cuticle::each_family([&](const char *name, auto family) {
        const std::string ending = nb::len(names) ? std::string("_") + name : std::string();  // Table4f_logistic
        bind_tables<float, decltype(family)>(m, ending);
        bind_tables<double, decltype(family)>(m, ending);
        names.append(name);
    });
    m.attr("lobe_families") = nb::tuple(names);
    m.def("histogram", &histogram<float>, nb::arg().noconvert(), nb::arg().noconvert(), nb::arg(), nb::arg(), nb::arg(),
          nb::call_guard<nb::gil_scoped_release>());
    m.def("histogram", &histogram<double>, nb::arg().noconvert(), nb::arg().noconvert(), nb::arg(), nb::arg(), nb::arg(),
          nb::call_guard<nb::gil_scoped_release>());
    // Without noconvert a double array would pass for a float one.
    m.def("first_outside", &first_outside<float>, nb::arg().noconvert(), nb::arg(), nb::arg(), nb::arg(),
          nb::call_guard<nb::gil_scoped_release>());
    m.def("first_outside", &first_outside<double>, nb::arg().noconvert(), nb::arg(), nb::arg(), nb::arg(),
          nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace native
