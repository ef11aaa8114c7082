// The far field with a fibre's parameters as arguments, over arrays of fibres and directions.
#include "bindings.h"

#include <stdexcept>
#include <type_traits>

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

// Strands of a mean fibre; keeps the arrays it was given.
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
};

// Fibres that stand alone, each with its viewer.
template <class T> struct EachAlone {
    static constexpr std::size_t least = 256;
    Fibres<T> fibres;
    Broadcast<T> theta_r;

    bool same(std::size_t i, std::size_t j) const { return theta_r[i] == theta_r[j] && fibres.same(i, j); }
    template <int Channels> cuticle::FarField<T, Channels> field(std::size_t i) const {
        return cuticle::far_field<Channels>(fibres.form(), fibres.fibre(i), theta_r[i], fibres.absorption(i),
                                            fibres.luminance);
    }
    template <class Field> T eval(const Field &field, T theta_i, T phi, T *f) const {
        return cuticle::far_eval(fibres.form(), field, theta_i, phi, f);
    }
    template <class Field> cuticle::Sample<T> sample(const Field &field, const T *u, T *f) const {
        return cuticle::far_sample(fibres.form(), field, u[0], u[1], u[2], f);
    }
};

// Fibres among others, each with its viewer and surroundings.
template <class T> struct EachAmong {
    static constexpr std::size_t least = 64;
    const cuticle::MeanStrands<T> &mean;
    Fibres<T> fibres;
    Broadcast<T> theta_r, strands, behind;
    bool random;

    bool same(std::size_t i, std::size_t j) const {
        return theta_r[i] == theta_r[j] && strands[i] == strands[j] && behind[i] == behind[j] && fibres.same(i, j);
    }
    template <int Channels> cuticle::FarAmong<T, Channels> field(std::size_t i) const {
        return cuticle::far_among<Channels>(fibres.form(), mean, fibres.fibre(i), theta_r[i], fibres.absorption(i),
                                            fibres.luminance, cuticle::Surroundings<T>{strands[i], behind[i], random});
    }
    template <class Field> T eval(const Field &field, T theta_i, T phi, T *f) const {
        return cuticle::among_eval(fibres.form(), mean, field, theta_i, phi, f);
    }
    template <class Field> cuticle::Sample<T> sample(const Field &field, const T *u, T *f) const {
        return cuticle::among_sample(fibres.form(), mean, field, u[0], u[1], u[2], f);
    }
};

// body(i, field, where its f goes) for each row of f, (n, 1 or 3 channels).
template <class Each, class T, class Body> void for_each_field(const Each &each, Out<T> &f, const Body &body) {
    const auto with_channels = [&](auto kind) {
        constexpr int channels = decltype(kind)::value;
        for_each_prepared(
            f.shape(0), Each::least, [&](std::size_t i, std::size_t j) { return each.same(i, j); },
            [&](std::size_t i) { return each.template field<channels>(i); },
            [&](std::size_t i, const auto &field) { body(i, field, f.data() + i * channels); });
    };
    if (f.shape(1) == 1) with_channels(std::integral_constant<int, 1>());
    else with_channels(std::integral_constant<int, 3>());
}

// f into (n, channels) and its density into (n).
template <class Each, class T>
void evaluate(const Each &each, const In<T> &theta_i, const In<T> &phi, Out<T> &f, Out<T> &pdf) {
    const auto ti = broadcast(theta_i), ph = broadcast(phi);
    for_each_field(each, f,
                   [&](std::size_t i, const auto &field, T *to) { pdf.data()[i] = each.eval(field, ti[i], ph[i], to); });
}

template <class Each, class T>
void draw(const Each &each, const In<T> &u, Out<T> &theta_i, Out<T> &phi, Out<T> &f, Out<T> &pdf) {
    for_each_field(each, f, [&](std::size_t i, const auto &field, T *to) {
        const auto s = each.sample(field, u.data() + 3 * i, to);
        theta_i.data()[i] = s.theta_i;
        phi.data()[i] = s.phi;
        pdf.data()[i] = s.pdf;
    });
}

template <class T> void bind(nb::module_ &m, const char *among) {
    using release = nb::call_guard<nb::gil_scoped_release>;
    m.def(
        "far_eval",
        [](bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance, const In<T> &theta_i,
           const In<T> &theta_r, const In<T> &phi, Out<T> f, Out<T> pdf) {
            evaluate(EachAlone<T>{{chiang, parameters, sigma_a, luminance}, broadcast(theta_r)}, theta_i, phi, f, pdf);
        },
        release());
    m.def(
        "far_sample",
        [](bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance, const In<T> &theta_r,
           const In<T> &u, Out<T> theta_i, Out<T> phi, Out<T> f, Out<T> pdf) {
            draw(EachAlone<T>{{chiang, parameters, sigma_a, luminance}, broadcast(theta_r)}, u, theta_i, phi, f, pdf);
        },
        release());
    nb::class_<Among<T>>(m, among)
        .def(nb::init<const In<T> &, const In<T> &, const In<T> &, const In<T> &, T, const In<T> &, const In<T> &, T, T>())
        .def(
            "eval",
            [](const Among<T> &among, bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance,
               const In<T> &theta_i, const In<T> &theta_r, const In<T> &phi, const In<T> &strands, const In<T> &behind,
               bool random, Out<T> f, Out<T> pdf) {
                const EachAmong<T> each{among.mean,         {chiang, parameters, sigma_a, luminance},
                                        broadcast(theta_r), broadcast(strands),
                                        broadcast(behind),  random};
                evaluate(each, theta_i, phi, f, pdf);
            },
            release())
        .def(
            "sample",
            [](const Among<T> &among, bool chiang, const In<T> &parameters, const In<T> &sigma_a, const In<T> &luminance,
               const In<T> &theta_r, const In<T> &u, const In<T> &strands, const In<T> &behind, bool random, Out<T> theta_i,
               Out<T> phi, Out<T> f, Out<T> pdf) {
                const EachAmong<T> each{among.mean,         {chiang, parameters, sigma_a, luminance},
                                        broadcast(theta_r), broadcast(strands),
                                        broadcast(behind),  random};
                draw(each, u, theta_i, phi, f, pdf);
            },
            release());
}

}  // namespace

void bind_far_field(nb::module_ &m) {
    bind<double>(m, "AmongDouble");
    bind<float>(m, "AmongFloat");
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
