// A sampler's table over arrays, for one family of lobes.
#pragma once

#include "arrays.h"
#include "cuticle/sampler/batch.h"

#include <algorithm>
#include <string>
#include <vector>

namespace native {

enum class Coordinate { theta, phi };

// A table of K lobes: K is one of the sizes compiled below, the caller pads with lobes of weight 0.
template <class Float, int K, class Family> struct Table {
    std::vector<Float> nodes, energy, strands;
    cuticle::LobeTable<Float, K, const Float *, Family> view;

    Table(const In<double> &nodes_, const In<double> &energy_, const In<double> &strands_, bool even)
        : nodes(nodes_.data(), nodes_.data() + nodes_.size()),
          energy(energy_.data(), energy_.data() + energy_.size()),
          strands(strands_.data(), strands_.data() + strands_.size()),
          view{nodes.data(),
               energy.data(),
               strands.data(),
               static_cast<int>(nodes_.shape(0)),
               static_cast<int>(nodes_.shape(1)),
               even} {}

    // One body for all that can afford a call: it is most of what there is to compile.
    NB_NOINLINE cuticle::PreparedSampler<Float, K, Family> prepared(Float theta_r, Float n) const {
        return cuticle::prepare(view, theta_r, n);
    }

    // body(i, prepared sampler) for each i; prepared once for a run of like theta_r and strands. Inlined for doubles, whose
    // runs may be of one direction; floats come here with one viewer only.
    template <bool Inlined = !std::is_same_v<Float, float>, class Body>
    void each(std::size_t count, const In<Float> &theta_r, const In<Float> &n, const Body &body) const {
        const auto tr = broadcast(theta_r), ns = broadcast(n);
        parallel_for(count, 1024, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end;) {
                const Float t = tr[i], strands = ns[i];
                std::size_t stop = i + 1;
                while (stop < end && tr[stop] == t && ns[stop] == strands) ++stop;
                const auto run = [&](const auto &sampler) {
                    for (; i < stop; ++i) body(i, sampler);
                };
                if constexpr (Inlined) run(cuticle::prepare(view, t, strands));
                else run(prepared(t, strands));
            }
        });
    }

    // Floats go in vectors where every direction has a viewer or a count of its own.
    static constexpr bool has_lanes = std::is_same_v<Float, float>;
    static bool in_lanes(const In<Float> &theta_r, const In<Float> &n) { return theta_r.size() > 1 || n.size() > 1; }
    // body(begin, count) for blocks that fit the cache.
    static constexpr std::size_t block = 256;
    template <class Body> static void blocks(std::size_t count, const Body &body) {
        parallel_for(count, 4 * block, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; i += block) body(i, std::min(block, end - i));
        });
    }

    void pdf(const In<Float> &theta_i, const In<Float> &theta_r, const In<Float> &phi, const In<Float> &n,
             Out<Float> out) const {
        const auto ti = broadcast(theta_i), ph = broadcast(phi);
        if constexpr (has_lanes)
            if (in_lanes(theta_r, n)) {
                const auto tr = broadcast(theta_r), ns = broadcast(n);
                blocks(out.size(), [&](std::size_t begin, std::size_t count) {
                    Float x[4][block];
                    for (std::size_t i = 0; i < count; ++i) {
                        const std::size_t j = begin + i;
                        x[0][i] = ti[j], x[1][i] = tr[j], x[2][i] = ph[j], x[3][i] = ns[j];
                    }
                    cuticle::pdf_batch(view, count, x[0], x[1], x[2], x[3], n.size() > 1, out.data() + begin);
                });
                return;
            }
        each(out.size(), theta_r, n, [&](std::size_t i, const auto &s) { out.data()[i] = s.pdf(ti[i], ph[i]); });
    }

    void sample(const In<Float> &theta_r, const In<Float> &u, const In<Float> &n, Out<Float> theta_i, Out<Float> phi,
                Out<Float> p) const {
        if constexpr (has_lanes)
            if (in_lanes(theta_r, n)) {
                const auto tr = broadcast(theta_r), ns = broadcast(n);
                blocks(p.size(), [&](std::size_t begin, std::size_t count) {
                    Float x[5][block];
                    for (std::size_t i = 0; i < count; ++i) {
                        const Float *r = u.data() + 3 * (begin + i);
                        x[0][i] = tr[begin + i], x[1][i] = r[0], x[2][i] = r[1], x[3][i] = r[2], x[4][i] = ns[begin + i];
                    }
                    cuticle::sample_batch(view, count, x[0], x[1], x[2], x[3], x[4], n.size() > 1, theta_i.data() + begin,
                                          phi.data() + begin, p.data() + begin);
                });
                return;
            }
        each(p.size(), theta_r, n, [&](std::size_t i, const auto &s) {
            const Float *r = u.data() + 3 * i;
            const auto drawn = s.sample(r[0], r[1], r[2]);
            theta_i.data()[i] = drawn.theta_i;
            phi.data()[i] = drawn.phi;
            p.data()[i] = drawn.pdf;
        });
    }

    // One lobe's cdf or its inverse; `second` asks for the lobes of the other row between 0 and 1 strands.
    void lobe(int coordinate, bool inverse, int k, bool second, const In<Float> &x, const In<Float> &theta_r,
              const In<Float> &n, Out<Float> out) const {
        const auto xs = broadcast(x);
        each<false>(out.size(), theta_r, n, [&](std::size_t i, const auto &s) {
            const auto &l = second ? s.second : s.first;
            out.data()[i] = coordinate == int(Coordinate::theta) ? (inverse ? l.icdf_theta(k, xs[i]) : l.cdf_theta(k, xs[i]))
                                                                 : (inverse ? l.icdf_phi(k, xs[i]) : l.cdf_phi(k, xs[i]));
        });
    }

    // The lobes at one theta_r: out (2, lobe_parameters, K), those of `second` with weight 0 where there is no blend.
    void mixture(Float theta_r, Float n, Out<Float> out) const {
        const auto s = prepared(theta_r, n);
        const auto write = [&](const cuticle::Lobes<Float, K, Family> &l, Float share, Float *to) {
            for (int k = 0; k < K; ++k) {
                to[cuticle::lobe_weight * K + k] = share * l.weight[k];
                to[cuticle::lobe_mean_theta * K + k] = l.theta(k).mean;
                to[cuticle::lobe_sigma_theta * K + k] = Float(Family::deviation) / l.theta(k).rate;
                to[cuticle::lobe_mean_phi * K + k] = l.phi(k).mean;
                to[cuticle::lobe_sigma_phi * K + k] = Float(Family::deviation) / l.phi(k).rate;
            }
        };
        std::fill(out.data(), out.data() + out.size(), Float(0));
        write(s.first, s.share, out.data());
        if (s.rest > Float(0)) write(s.second, s.rest, out.data() + cuticle::lobe_parameters * K);
    }
};

template <class Float, int K, class Family> void bind(nb::module_ &m, const std::string &ending) {
    using T = Table<Float, K, Family>;
    using release = nb::call_guard<nb::gil_scoped_release>;
    nb::class_<T> table(m, ("Table" + std::to_string(K) + ending).c_str());
    table.def(nb::init<const In<double> &, const In<double> &, const In<double> &, bool>())
        .def("pdf", &T::pdf, release())
        .def("sample", &T::sample, release());
    if constexpr (!std::is_same_v<Float, float>)
        table.def("lobe", &T::lobe, release()).def("mixture", &T::mixture, release());
}

// Table4f, Table4d, … with an ending for a family that is not the first.
template <class Float, class Family> void bind_tables(nb::module_ &m, const std::string &ending) {
    const std::string whole = (std::is_same_v<Float, float> ? "f" : "d") + ending;
    bind<Float, 4, Family>(m, whole);
    bind<Float, 8, Family>(m, whole);
    bind<Float, 16, Family>(m, whole);
    bind<Float, 32, Family>(m, whole);
}

}  // namespace native
