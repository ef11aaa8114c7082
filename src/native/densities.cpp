// The one-dimensional densities over arrays.
#include "arrays.h"
#include "bindings.h"
#include "cuticle/sampler/normal.h"

namespace native {
namespace {

enum class Function { pdf, cdf, icdf };

template <class Density, class Float>
void evaluate(int function, const In<Float> &x, const In<Float> &mean, const In<Float> &sigma, Out<Float> out) {
    const auto xs = broadcast(x), means = broadcast(mean), sigmas = broadcast(sigma);
    parallel_for(out.size(), 512, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const Density d(means[i], sigmas[i]);
            out.data()[i] = function == int(Function::pdf)   ? d.pdf(xs[i])
                            : function == int(Function::cdf) ? d.cdf(xs[i])
                                                             : d.icdf(xs[i]);
        }
    });
}

// TruncatedNormal on [-pi/2, pi/2] as a type, like the azimuthal two.
template <class Float> struct LongitudinalNormal : cuticle::TruncatedNormal<Float> {
    LongitudinalNormal(Float mean, Float sigma)
        : cuticle::TruncatedNormal<Float>(cuticle::longitudinal_normal(mean, sigma)) {}
};

template <class Float> void bind(nb::module_ &m) {
    using release = nb::call_guard<nb::gil_scoped_release>;
    m.def("longitudinal_normal", &evaluate<LongitudinalNormal<Float>, Float>, release());
    m.def("periodic_normal", &evaluate<cuticle::PeriodicNormal<Float>, Float>, release());
    m.def("even_normal", &evaluate<cuticle::EvenNormal<Float>, Float>, release());
}

}  // namespace

void bind_densities(nb::module_ &m) {
    bind<float>(m);
    bind<double>(m);
}

}  // namespace native
