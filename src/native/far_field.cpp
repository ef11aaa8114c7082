// The far field with a fibre's parameters as arguments, over arrays of fibres and directions.
#include "bindings.h"

#include <stdexcept>

#include "arrays.h"
#include "cuticle/scattering/far_among.h"
#include "through_view.h"

namespace native {
namespace {

// Rows of parameters and of absorptions: as many as directions, or one for all of them.
template <class T> struct Fibres {
    const T *parameters, *sigma_a, *luminance;
    std::size_t count, step, absorption_step;
    bool chiang;

    Fibres(bool chiang_, const In<T> &parameters_, const In<T> &sigma_a_, const In<T> &luminance_)
        : parameters(parameters_.data()),
          sigma_a(sigma_a_.data()),
          luminance(luminance_.data()),
          count(parameters_.shape(1)),
          step(parameters_.shape(0) == 1 ? 0 : count),
          absorption_step(sigma_a_.shape(0) == 1 ? 0 : sigma_a_.shape(1)),
          chiang(chiang_) {
        if ((sigma_a_.shape(1) != 1 && sigma_a_.shape(1) != 3) || count != std::size_t(chiang ? 4 : 8))
            throw std::invalid_argument("fibres must have 1 or 3 channels, and the parameters of their family");
    }

    cuticle::Azimuthal form() const { return chiang ? cuticle::Azimuthal::logistic : cuticle::Azimuthal::normal; }
    const T *row(std::size_t i) const { return parameters + i * step; }
    const T *absorption(std::size_t i) const { return sigma_a + i * absorption_step; }
    bool same(std::size_t i, std::size_t j) const {
        return (step == 0 || std::equal(row(i), row(i) + count, row(j))) &&
               (absorption_step == 0 || std::equal(absorption(i), absorption(i) + absorption_step, absorption(j)));
    }
    cuticle::FarFibre<T> fibre(std::size_t i) const {
        const T *p = row(i);
        if (chiang) return cuticle::chiang_fibre(p[0], p[1], p[2], p[3]);
        return cuticle::marschner_fibre(p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7]);
    }
};

// body(i, field) for each of `count`; a field is kept while fibre and viewer stay.
template <int Channels, class T, class Body>
void each(const Fibres<T> &fibres, const Broadcast<T> &theta_r, std::size_t count, const Body &body) {
    parallel_for(count, 256, [&](std::size_t begin, std::size_t end) {
        cuticle::FarField<T, Channels> field{};
        for (std::size_t i = begin; i < end; ++i) {
            if (i == begin || theta_r[i] != theta_r[i - 1] || !fibres.same(i, i - 1))
                field = cuticle::far_field<Channels>(fibres.form(), fibres.fibre(i), theta_r[i], fibres.absorption(i),
                                                     fibres.luminance);
            body(i, field);
        }
    });
}

// f into (n, Channels) and its density into (n).
template <int Channels, class T>
void evaluate(const Fibres<T> &fibres, const In<T> &theta_i, const In<T> &theta_r, const In<T> &phi, Out<T> f, Out<T> pdf) {
    const auto ti = broadcast(theta_i), ph = broadcast(phi);
    each<Channels>(fibres, broadcast(theta_r), pdf.shape(0), [&](std::size_t i, const auto &field) {
        pdf.data()[i] = cuticle::far_eval(fibres.form(), field, ti[i], ph[i], f.data() + i * Channels);
    });
}

template <int Channels, class T>
void draw(const Fibres<T> &fibres, const In<T> &theta_r, const In<T> &u, Out<T> theta_i, Out<T> phi, Out<T> f, Out<T> pdf) {
    each<Channels>(fibres, broadcast(theta_r), pdf.shape(0), [&](std::size_t i, const auto &field) {
        const T *v = u.data() + 3 * i;
        const auto s = cuticle::far_sample(fibres.form(), field, v[0], v[1], v[2], f.data() + i * Channels);
        theta_i.data()[i] = s.theta_i;
        phi.data()[i] = s.phi;
        pdf.data()[i] = s.pdf;
    });
}

// Strands of a mean fibre, and a fibre of any kind among them; keeps the arrays it was given.
template <class T> struct Among {
    In<T> energy, along, azimuth, behind;
    cuticle::MeanStrands<T> mean{};

    // As the Python's ThroughTables.
    Among(const In<T> &energy_, const In<T> &along_, const In<T> &azimuth_, const In<T> &behind_, T limit, const In<T> &tilt,
          const In<T> &variance, T d_f, T d_b)
        : energy(energy_), along(along_), azimuth(azimuth_), behind(behind_) {
        mean.through = through_view(energy, along, azimuth, behind, limit);
        std::copy_n(tilt.data(), cuticle::lobe_count, mean.tilt);
        std::copy_n(variance.data(), cuticle::lobe_count, mean.variance);
        mean.d_f = d_f;
        mean.d_b = d_b;
    }

    // body(i, form, field) for each of `count`; a field is kept while fibre, viewer and surroundings stay.
    template <int Channels, class Body>
    void each(const Fibres<T> &fibres, const In<T> &theta_r, const In<T> &strands, const In<T> &behind_, bool random,
              std::size_t count, const Body &body) const {
        const auto tr = broadcast(theta_r), n = broadcast(strands), b = broadcast(behind_);
        parallel_for(count, 64, [&](std::size_t begin, std::size_t end) {
            cuticle::FarAmong<T, Channels> field{};
            for (std::size_t i = begin; i < end; ++i) {
                if (i == begin || tr[i] != tr[i - 1] || n[i] != n[i - 1] || b[i] != b[i - 1] || !fibres.same(i, i - 1))
                    field = cuticle::far_among<Channels>(fibres.form(), mean, fibres.fibre(i), tr[i], fibres.absorption(i),
                                                         fibres.luminance, cuticle::Surroundings<T>{n[i], b[i], random});
                body(i, fibres.form(), field);
            }
        });
    }

    template <int Channels>
    void evaluate(const Fibres<T> &fibres, const In<T> &theta_i, const In<T> &theta_r, const In<T> &phi,
                  const In<T> &strands, const In<T> &behind_, bool random, Out<T> f, Out<T> pdf) const {
        const auto ti = broadcast(theta_i), ph = broadcast(phi);
        each<Channels>(fibres, theta_r, strands, behind_, random, pdf.shape(0),
                       [&](std::size_t i, cuticle::Azimuthal form, const auto &field) {
                           pdf.data()[i] = cuticle::among_eval(form, mean, field, ti[i], ph[i], f.data() + i * Channels);
                       });
    }

    template <int Channels>
    void draw(const Fibres<T> &fibres, const In<T> &theta_r, const In<T> &u, const In<T> &strands, const In<T> &behind_,
              bool random, Out<T> theta_i, Out<T> phi, Out<T> f, Out<T> pdf) const {
        each<Channels>(fibres, theta_r, strands, behind_, random, pdf.shape(0),
                       [&](std::size_t i, cuticle::Azimuthal form, const auto &field) {
                           const T *v = u.data() + 3 * i;
                           const auto s =
                               cuticle::among_sample(form, mean, field, v[0], v[1], v[2], f.data() + i * Channels);
                           theta_i.data()[i] = s.theta_i;
                           phi.data()[i] = s.phi;
                           pdf.data()[i] = s.pdf;
                       });
    }
};

template <class T> void bind_among(nb::module_ &m, const char *name) {
    using release = nb::call_guard<nb::gil_scoped_release>;
    nb::class_<Among<T>>(m, name)
        .def(nb::init<const In<T> &, const In<T> &, const In<T> &, const In<T> &, T, const In<T> &, const In<T> &, T, T>())
        .def(
            "eval",
            [](const Among<T> &among, bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance,
               const In<T> &theta_i, const In<T> &theta_r, const In<T> &phi, const In<T> &strands, const In<T> &behind,
               bool random, Out<T> f, Out<T> pdf) {
                const Fibres<T> fibres(chiang, parameters, sigma_a, luminance);
                if (sigma_a.shape(1) == 1)
                    among.template evaluate<1>(fibres, theta_i, theta_r, phi, strands, behind, random, f, pdf);
                else among.template evaluate<3>(fibres, theta_i, theta_r, phi, strands, behind, random, f, pdf);
            },
            release())
        .def(
            "sample",
            [](const Among<T> &among, bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance,
               const In<T> &theta_r, const In<T> &u, const In<T> &strands, const In<T> &behind, bool random, Out<T> theta_i,
               Out<T> phi, Out<T> f, Out<T> pdf) {
                const Fibres<T> fibres(chiang, parameters, sigma_a, luminance);
                if (sigma_a.shape(1) == 1)
                    among.template draw<1>(fibres, theta_r, u, strands, behind, random, theta_i, phi, f, pdf);
                else among.template draw<3>(fibres, theta_r, u, strands, behind, random, theta_i, phi, f, pdf);
            },
            release());
}

template <class T> void bind(nb::module_ &m) {
    using release = nb::call_guard<nb::gil_scoped_release>;
    m.def(
        "far_eval",
        [](bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance, const In<T> &theta_i,
           const In<T> &theta_r, const In<T> &phi, Out<T> f, Out<T> pdf) {
            const Fibres<T> fibres(chiang, parameters, sigma_a, luminance);
            (sigma_a.shape(1) == 1 ? evaluate<1, T> : evaluate<3, T>)(fibres, theta_i, theta_r, phi, f, pdf);
        },
        release());
    m.def(
        "far_sample",
        [](bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance, const In<T> &theta_r,
           const In<T> &u, Out<T> theta_i, Out<T> phi, Out<T> f, Out<T> pdf) {
            const Fibres<T> fibres(chiang, parameters, sigma_a, luminance);
            (sigma_a.shape(1) == 1 ? draw<1, T> : draw<3, T>)(fibres, theta_r, u, theta_i, phi, f, pdf);
        },
        release());
}

}  // namespace

void bind_far_field(nb::module_ &m) {
    bind<double>(m);
    bind<float>(m);
    bind_among<double>(m, "AmongDouble");
    bind_among<float>(m, "AmongFloat");
    // Columns: at edges gamma and its sine; at middles sine, cosine and the cell's width in h.
    m.def("cell_geometry", [](bool dense, Out<double> out) {
        const auto g = cuticle::cell_geometry<double>(dense);
        for (int j = 0; j <= cuticle::tt_cells; ++j) {
            const int cell = std::min(j, cuticle::tt_cells - 1);
            const double row[] = {g.gamma[j], g.sine[j], g.middle_sine[cell], g.middle_cosine[cell], g.width[cell]};
            std::copy(std::begin(row), std::end(row), out.data() + 5 * j);
        }
    });
    m.attr("far_cells") = cuticle::tt_cells;  // of R and of TT
    m.def("longitudinal_deviation", [](double beta_m) { return cuticle::longitudinal_deviation(beta_m); });
    m.def("color_divisor", [](const In<double> &beta_n, Out<double> out) {
        std::transform(beta_n.data(), beta_n.data() + beta_n.size(), out.data(), cuticle::color_divisor<double>);
    });
    m.def("azimuthal_scale", [](double beta_n) { return cuticle::azimuthal_scale(beta_n); });
}

}  // namespace native
