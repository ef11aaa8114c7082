// The scattering functions over arrays, and the tables they read.
#include "bindings.h"

#include <stdexcept>
#include <string>
#include <vector>

#include "arrays.h"
#include "cuticle/cuticle.h"
#include "through_view.h"

namespace native {
namespace {

using cuticle::lobe_count;

// Of an azimuthal table's row. At the pole itself the normal plane's picture has no meaning: stop a hair short of it.
double row_inclination(std::size_t i, std::size_t rows) {
    return std::min(cuticle::half_pi<double> * double(i) / double(rows - 1), 1.5690);
}

// direct, spread: (rows, columns, lobe_count, channels); halves: (rows, lobe_count, channels, 2).
void azimuthal_tables(double eta, const In<double> &sigma_a, bool logistic, double beta_n, bool closed, int offsets,
                      Out<double> direct, Out<double> spread, Out<double> halves) {
    const auto form = logistic ? cuticle::Azimuthal::logistic : cuticle::Azimuthal::normal;
    const auto rows = direct.shape(0), columns = direct.shape(1), channels = sigma_a.size();
    const int n = static_cast<int>(columns) - 1;
    std::vector<double> kernel(2 * columns);
    const int reach = cuticle::smoothing_kernel(form, beta_n, n, kernel.data());
    parallel_for(rows, 1, [&](std::size_t begin, std::size_t end) {
        std::vector<double> circle(4 * columns), row(columns), wide(columns);
        std::vector<cuticle::OffsetCell<double>> cells(offsets);
        for (std::size_t i = begin; i < end; ++i) {
            cuticle::offset_cells(row_inclination(i, rows), eta, offsets, cells.data());
            for (int p = 0; p < lobe_count; ++p)
                for (std::size_t c = 0; c < channels; ++c) {
                    if (p > 0 || c == 0) {  // R does not see the absorption
                        cuticle::azimuthal_row(p, cells.data(), offsets, sigma_a.data()[c], closed, n, kernel.data(), reach,
                                               circle.data(), row.data());
                        cuticle::spread_row(row.data(), n, wide.data());
                    }
                    for (std::size_t j = 0; j < columns; ++j) {
                        const std::size_t at = ((i * columns + j) * lobe_count + std::size_t(p)) * channels + c;
                        direct.data()[at] = row[j];
                        spread.data()[at] = wide[j];
                    }
                    const auto h = cuticle::half_energies(row.data(), n);
                    double *out = halves.data() + ((i * lobe_count + std::size_t(p)) * channels + c) * 2;
                    out[0] = h.forward;
                    out[1] = h.backward;
                }
        }
    });
}

// Energy of all orders past TRT, averaged over h; out: (rows, channels).
void rest_energies(double eta, const In<double> &sigma_a, int offsets, Out<double> out) {
    const auto rows = out.shape(0), channels = out.shape(1);
    parallel_for(rows, 8, [&](std::size_t begin, std::size_t end) {
        std::vector<cuticle::OffsetCell<double>> cells(offsets);
        for (std::size_t i = begin; i < end; ++i) {
            cuticle::offset_cells(row_inclination(i, rows), eta, offsets, cells.data());
            for (std::size_t c = 0; c < channels; ++c) {
                double sum = 0;
                for (const auto &cell : cells)
                    sum += cell.width * cuticle::attenuation(3, cell.middle, sigma_a.data()[c], false);
                out.data()[i * channels + c] = sum;
            }
        }
    });
}

cuticle::FibreLobes<double> fibre_lobes(const In<double> &alpha, const In<double> &beta, bool energy_conserving) {
    cuticle::FibreLobes<double> f{};
    for (int p = 0; p < lobe_count; ++p) {
        f.alpha[p] = alpha.data()[p];
        f.beta[p] = beta.data()[p];
    }
    f.form = energy_conserving ? cuticle::Longitudinal::energy_conserving : cuticle::Longitudinal::gaussian;
    return f;
}

// out: (rows, average_columns, channels), a row for each inclination.
void averages(const In<double> &alpha, const In<double> &beta, bool exact, double d_b, const In<double> &inclinations,
              int quadrature, const In<double> &halves, Out<double> out) {
    const auto fibre = fibre_lobes(alpha, beta, exact);
    const auto formulation = exact ? cuticle::Formulation::exact : cuticle::Formulation::zinke2008;
    const auto rows = out.shape(0), channels = out.shape(2), half_rows = halves.shape(0);
    parallel_for(rows, 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            for (std::size_t c = 0; c < channels; ++c) {
                const auto lookup = [&](double theta, int p) {
                    const double x = std::abs(theta) / cuticle::half_pi<double> * double(half_rows - 1);
                    const auto j = std::min(static_cast<std::size_t>(x), half_rows - 2);
                    const double t = x - double(j);
                    const double *q = halves.data() + ((j * lobe_count + std::size_t(p)) * channels + c) * 2;
                    const double *r = q + lobe_count * channels * 2;
                    return cuticle::Halves<double>{q[0] + t * (r[0] - q[0]), q[1] + t * (r[1] - q[1])};
                };
                auto a = cuticle::half_sphere_averages(fibre, formulation, inclinations.data()[i], lookup, quadrature);
                if (exact) cuticle::backscatter_exact(a);
                else cuticle::backscatter_zinke2008(a, d_b);
                const double values[] = {a.a_f,    a.a_b,         a.alpha_f,    a.alpha_b,       a.beta_f,
                                         a.beta_b, a.back_energy, a.back_shift, a.back_deviation};
                for (std::size_t j = 0; j < cuticle::average_columns; ++j)
                    out.data()[(i * cuticle::average_columns + j) * channels + c] = values[j];
            }
    });
}

// Energy, shift and deviation (A_b, Δ_b, σ_b) of what a half space of strands sends back, from averages given outright.
nb::tuple backscatter(double a_f, double a_b, double alpha_f, double alpha_b, double beta_f, double beta_b, bool exact,
                      double d_b) {
    cuticle::Averages<double> a{a_f, a_b, alpha_f, alpha_b, beta_f, beta_b, 0, 0, 0};
    if (exact) cuticle::backscatter_exact(a);
    else cuticle::backscatter_zinke2008(a, d_b);
    return nb::make_tuple(a.back_energy, a.back_shift, a.back_deviation);
}

// A model ready to evaluate; it keeps the arrays it was given.
struct Model {
    In<double> direct, spread, averages, energies, through_energy, along, azimuth, behind;
    cuticle::DualScatteringModel<double> model{};
    cuticle::ChiangRest<double> rest{};
    bool dual;

    Model(const In<double> &alpha, const In<double> &beta, bool energy_conserving, const In<double> &direct_)
        : direct(direct_), dual(false) {
        model.fibre = fibre_lobes(alpha, beta, energy_conserving);
        model.direct = view(direct);
    }
    // Dual scattering as printed, with N^G.
    Model(const In<double> &alpha, const In<double> &beta, const In<double> &direct_, const In<double> &spread_,
          const In<double> &averages_, double d_f, double d_b)
        : Model(alpha, beta, false, direct_) {
        spread = spread_;
        model.spread = view(spread);
        averages = averages_;
        model.averages = {averages.data(), static_cast<int>(averages.shape(0)), model.direct.channels};
        surround(cuticle::Formulation::zinke2008, d_f, d_b);
    }
    // The exact form, as the Python's ThroughTables.
    Model(const In<double> &alpha, const In<double> &beta, const In<double> &direct_, const In<double> &energy_,
          const In<double> &along_, const In<double> &azimuth_, const In<double> &behind_, double limit, double d_f,
          double d_b)
        : Model(alpha, beta, true, direct_) {
        through_energy = energy_;
        along = along_;
        azimuth = azimuth_;
        behind = behind_;
        model.through = through_view(through_energy, along, azimuth, behind, limit);
        surround(cuticle::Formulation::exact, d_f, d_b);
    }

    // Chiang 2016's far field: the orders past TRT, energies (rows, channels), in a lobe of their own.
    Model(const In<double> &alpha, const In<double> &beta, const In<double> &direct_, const In<double> &energies_,
          double variance)
        : Model(alpha, beta, true, direct_) {
        energies = energies_;
        rest = {energies.data(), static_cast<int>(energies.shape(0)), static_cast<int>(energies.shape(1)), variance};
    }

    static cuticle::AzimuthalTable<const double *> view(const In<double> &a) {
        return {a.data(), static_cast<int>(a.shape(0)), static_cast<int>(a.shape(1)), static_cast<int>(a.shape(3))};
    }

    // Through strands that were counted, with no end of them behind.
    void eval(const In<double> &theta_i, const In<double> &theta_r, const In<double> &phi, const In<double> &strands,
              int lobes, Out<double> out) const {
        static constexpr double no_end = cuticle::half_space<double>;
        over(theta_i, theta_r, phi, broadcast(strands), {&no_end, 0}, false, lobes, out);
    }
    // The mean where both numbers are expectations.
    void expected(const In<double> &theta_i, const In<double> &theta_r, const In<double> &phi, const In<double> &strands,
                  const In<double> &behind, int lobes, Out<double> out) const {
        if (dual && model.formulation == cuticle::Formulation::exact && through_energy.shape(0) < 2)
            throw std::invalid_argument("the model has tables of sheets alone");
        over(theta_i, theta_r, phi, broadcast(strands), broadcast(behind), true, lobes, out);
    }

  private:
    void surround(cuticle::Formulation formulation, double d_f, double d_b) {
        dual = true;
        model.formulation = formulation;
        model.d_f = d_f;
        model.d_b = d_b;
    }

    // Azimuths in vectors, and what was looked up for them: the same for many theta_i where N is that of theta_r.
    static constexpr std::size_t wide = 8, few = 3;
    using Lanes = cuticle::Pack<double, wide>;
    struct Row {
        double inclination, theta_r;
        cuticle::Surroundings<double> around;
        std::vector<double> phi;
        std::vector<cuticle::AzimuthalValues<Lanes>> values;  // [vector][channel]
    };

    void look_up(Row &row) const {
        const auto vectors = (row.phi.size() + wide - 1) / wide, channels = std::size_t(model.direct.channels);
        const cuticle::Surroundings<Lanes> around{Lanes(row.around.strands), Lanes(row.around.behind), row.around.random};
        row.phi.resize(vectors * wide, row.phi.back());
        row.values.resize(vectors * channels);
        for (std::size_t v = 0; v < vectors; ++v) {
            const Lanes phi = cuticle::load_pack<double, wide>(&row.phi[v * wide]);
            const auto at = cuticle::locate(model.direct, Lanes(row.inclination), phi);
            for (std::size_t c = 0; c < channels; ++c) {
                auto &values = row.values[v * channels + c];
                if (dual) values = cuticle::azimuths_around(model, at, Lanes(row.theta_r), phi, int(c), around);
                else
                    cuticle::look_up(model.direct, cuticle::direct_rows, at, int(c), values = cuticle::no_azimuths<Lanes>());
            }
        }
    }

    void over(const In<double> &theta_i, const In<double> &theta_r, const In<double> &phi, const Broadcast<double> &strands,
              const Broadcast<double> &behind, bool random, int lobes, Out<double> &out) const {
        const auto ti = broadcast(theta_i), tr = broadcast(theta_r), ph = broadcast(phi);
        const auto channels = static_cast<std::size_t>(model.direct.channels);
        parallel_for(out.shape(0), 2048, [&](std::size_t begin, std::size_t end) {
            std::vector<cuticle::AzimuthalTerms<double>> terms(channels);
            Row row{};
            for (std::size_t i = begin, stop; i < end; i = stop) {
                const double t = ti[i], r = tr[i];
                const cuticle::Surroundings<double> around{strands[i], behind[i], random};
                for (stop = i + 1; stop < end && ti[stop] == t && tr[stop] == r && strands[stop] == around.strands &&
                                   behind[stop] == around.behind;)
                    ++stop;
                if (dual) cuticle::dual_scattering_terms(model, t, r, around, lobes, terms.data());
                else if (rest.rows) cuticle::chiang_far_terms(model.fibre, rest, t, r, lobes, terms.data());
                else cuticle::marschner_terms(model.fibre, t, r, lobes, int(channels), terms.data());
                double *f = out.data() + i * channels;
                if (stop - i <= few) {
                    for (std::size_t j = i; j < stop; ++j, f += channels)
                        if (dual) cuticle::dual_scattering_around(model, terms.data(), t, r, ph[j], around, f);
                        else cuticle::marschner_around(model.fibre, model.direct, terms.data(), t, r, ph[j], f);
                    continue;
                }
                const double inclination = cuticle::azimuthal_inclination(model.fibre.form, t, r);
                bool known = stop - i <= row.phi.size() && row.inclination == inclination && row.theta_r == r &&
                             row.around.strands == around.strands && row.around.behind == around.behind;
                for (std::size_t j = i; known && j < stop; ++j) known = row.phi[j - i] == ph[j];
                if (!known) {
                    row.inclination = inclination;
                    row.theta_r = r;
                    row.around = around;
                    row.phi.clear();
                    for (std::size_t j = i; j < stop; ++j) row.phi.push_back(ph[j]);
                    look_up(row);
                }
                for (std::size_t c = 0; c < channels; ++c) {
                    const auto all = cuticle::azimuthal_terms<Lanes>(terms[c]);
                    for (std::size_t j = 0; j < stop - i; j += wide) {
                        const Lanes sum = cuticle::azimuthal_sum(all, row.values[j / wide * channels + c]);
                        for (std::size_t k = j; k < std::min(j + wide, stop - i); ++k)
                            f[k * channels + c] = sum[static_cast<int>(k - j)];
                    }
                }
            }
        });
    }
};

// A table that is evaluated as exports are.
struct Table {
    In<double> shape, log_energy, strands;
    cuticle::TabulatedModel<double> table{};

    Table(const In<double> &shape_, const In<double> &log_energy_, const In<double> &strands_, double reach, bool even)
        : shape(shape_), log_energy(log_energy_), strands(strands_) {
        const auto size = [&](std::size_t axis) { return static_cast<int>(shape.shape(axis)); };
        table = {shape.data(), log_energy.data(), size(0), size(1), static_cast<int>(log_energy.shape(1)),
                 size(2),      size(3),           size(4), reach,   std::sinh(reach) / cuticle::pi<double>,
                 even};
    }

    void eval(const In<double> &theta_i, const In<double> &theta_r, const In<double> &phi, const In<double> &count,
              Out<double> out) const {
        const auto ti = broadcast(theta_i), tr = broadcast(theta_r), ph = broadcast(phi), n = broadcast(count);
        parallel_for(out.shape(0), 512, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                cuticle::tabulated_eval(table, strands.data(), ti[i], tr[i], ph[i], n[i],
                                        out.data() + i * std::size_t(table.channels));
        });
    }
};

// Chiang 2016 with h known: one of each argument, or as many as `count`.
struct ChiangNear {
    cuticle::ChiangFibre<double> fibre{};
    std::vector<double> sigma_a, luminance;

    ChiangNear(double eta, double scale, const In<double> &variance, const In<double> &tilt, const In<double> &sigma_a_,
               const In<double> &luminance_)
        : sigma_a(sigma_a_.data(), sigma_a_.data() + sigma_a_.size()),
          luminance(luminance_.data(), luminance_.data() + luminance_.size()) {
        fibre.eta = eta;
        fibre.scale = scale;
        for (int p = 0; p < cuticle::chiang_lobes; ++p) {
            fibre.variance[p] = variance.data()[p];
            fibre.tilt[p] = tilt.data()[p];
        }
    }

    int channels() const { return static_cast<int>(sigma_a.size()); }

    cuticle::ChiangState<double> state(double theta_r, double h) const {
        return cuticle::chiang_state(fibre, theta_r, h, sigma_a.data(), luminance.empty() ? nullptr : luminance.data(),
                                     channels());
    }

    // body(i, state) for each of `count`; a state is kept while theta_r and h stay.
    template <class Body>
    void each(std::size_t count, const In<double> &theta_r, const In<double> &h, const Body &body) const {
        const auto tr = broadcast(theta_r), offset = broadcast(h);
        for_each_prepared(
            count, 512, [&](std::size_t i, std::size_t j) { return tr[i] == tr[j] && offset[i] == offset[j]; },
            [&](std::size_t i) { return state(tr[i], offset[i]); }, body);
    }

    void eval(const In<double> &theta_i, const In<double> &theta_r, const In<double> &phi, const In<double> &h, int lobes,
              Out<double> out) const {
        const auto ti = broadcast(theta_i), ph = broadcast(phi);
        each(out.shape(0), theta_r, h, [&](std::size_t i, const auto &prepared) {
            cuticle::chiang_eval(fibre, prepared, sigma_a.data(), channels(), lobes, ti[i], ph[i],
                                 out.data() + i * sigma_a.size());
        });
    }

    void pdf(const In<double> &theta_i, const In<double> &theta_r, const In<double> &phi, const In<double> &h,
             Out<double> out) const {
        const auto ti = broadcast(theta_i), ph = broadcast(phi);
        each(out.shape(0), theta_r, h, [&](std::size_t i, const auto &prepared) {
            out.data()[i] = cuticle::chiang_pdf(fibre, prepared, ti[i], ph[i]);
        });
    }

    void sample(const In<double> &theta_r, const In<double> &u, const In<double> &h, Out<double> theta_i, Out<double> phi,
                Out<double> density) const {
        each(theta_i.shape(0), theta_r, h, [&](std::size_t i, const auto &prepared) {
            const double *v = u.data() + 3 * i;
            const auto s = cuticle::chiang_sample(fibre, prepared, v[0], v[1], v[2]);
            theta_i.data()[i] = s.theta_i;
            phi.data()[i] = s.phi;
            density.data()[i] = s.pdf;
        });
    }
};

}  // namespace

void bind_models(nb::module_ &m) {
    using release = nb::call_guard<nb::gil_scoped_release>;
    m.def("azimuthal_tables", &azimuthal_tables, release());
    m.def("averages", &averages, release());
    m.def("backscatter", &backscatter);
    m.attr("average_columns") = cuticle::average_columns;
    nb::class_<Model>(m, "Model")
        .def(nb::init<const In<double> &, const In<double> &, bool, const In<double> &>())
        .def(nb::init<const In<double> &, const In<double> &, const In<double> &, const In<double> &, const In<double> &,
                      double, double>())
        .def(nb::init<const In<double> &, const In<double> &, const In<double> &, const In<double> &, const In<double> &,
                      const In<double> &, const In<double> &, double, double, double>())
        .def(nb::init<const In<double> &, const In<double> &, const In<double> &, const In<double> &, double>())
        .def("eval", &Model::eval, release())
        .def("expected", &Model::expected, release());
    nb::class_<Table>(m, "Table")
        .def(nb::init<const In<double> &, const In<double> &, const In<double> &, double, bool>())
        .def("eval", &Table::eval, release());
    m.def("rest_energies", &rest_energies, release());
    nb::class_<ChiangNear>(m, "ChiangNear")
        .def(nb::init<double, double, const In<double> &, const In<double> &, const In<double> &, const In<double> &>())
        .def("eval", &ChiangNear::eval, release())
        .def("pdf", &ChiangNear::pdf, release())
        .def("sample", &ChiangNear::sample, release());
    m.def("fresnel", [](double cos_i, double eta) { return cuticle::fresnel(cos_i, eta); });
    m.def("i0_scaled", [](double x) { return cuticle::i0_scaled(x); });
}

}  // namespace native
