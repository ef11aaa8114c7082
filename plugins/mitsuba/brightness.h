// By how much paths are brighter than dual scattering, smooth in space.
#pragma once

#include "drjit_traits.h"

#include <drjit/texture.h>
#include <mitsuba/core/bbox.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

namespace cuticle_mitsuba {

namespace dr = drjit;

// The ratio of a path's light to dual scattering's over points of a box, in each channel. It is found level by level: one
// part, then halves of the box along each axis, halves of these, and so on. A level multiplies what the one before it,
// interpolated between its parts' centres, says by Σ path / Σ (ratio dual) of each of its parts, as far as that is more than
// noise: by the share t² / (t² + v) of its difference from one, where v is its variance and t² what the parts of a level
// differ by beyond v (empirical Bayes, as James and Stein's estimator). Of the whole box, which is one part, that would be a
// guess: t is what grooms differ by. v comes from the noise of all samples: a part's own would be large where a bright path
// fell, and such parts would be held down. A path's variance is taken to grow with dual scattering's light squared, plus its
// mean squared: light on crooked ways reaches what dual scattering hardly lights, too, and tells nothing of the ratio there.
template <class Float, size_t Channels> class BrightnessRatio {
  public:
    using Colour = std::array<float, Channels>;
    struct Sample {
        std::array<float, 3> at;
        Colour path, dual;
    };
    using Point = mitsuba::Point<Float, 3>;
    using Box = mitsuba::BoundingBox<mitsuba::Point<dr::scalar_t<Float>, 3>>;

    bool known() const { return m_known; }
    void forget() { m_known = false; }

    // Adds what rays have found, where `used`: light in each channel. What is not finite is left out.
    static void collect(const dr::mask_t<Float> &used, const Point &p, const std::array<Float, Channels> &path,
                        const std::array<Float, Channels> &dual, std::vector<Sample> &found) {
        const auto host = [](const auto &x) {
            if constexpr (dr::is_jit_v<Float>) {
                auto y = dr::migrate(x, JitBackend::None);
                dr::sync_thread();
                return y;
            } else {
                return std::array<std::decay_t<decltype(x)>, 1>{x};
            }
        };
        const auto on = host(used);
        const auto x = host(p.x()), y = host(p.y()), z = host(p.z());
        std::array<std::decay_t<decltype(x)>, Channels> paths, duals;
        for (size_t c = 0; c < Channels; ++c) {
            paths[c] = host(path[c]);
            duals[c] = host(dual[c]);
        }
        for (size_t k = 0; k < on.size(); ++k) {
            if (!on[k]) continue;
            Sample s{{float(x[k]), float(y[k]), float(z[k])}, {}, {}};
            bool finite = true;
            for (size_t c = 0; c < Channels; ++c) {
                s.path[c] = float(paths[c][k]);
                s.dual[c] = float(duals[c][k]);
                finite &= std::isfinite(s.path[c]) && std::isfinite(s.dual[c]);
            }
            if (finite) found.push_back(s);
        }
    }

    // The standard error of Σ path / Σ dual, relative; NaN where nothing was met.
    static double error(const std::vector<Sample> &samples) {
        double path = 0, dual = 0, squares = 0;
        for (const Sample &s : samples) {
            path += sum(s.path);
            dual += sum(s.dual);
        }
        for (const Sample &s : samples) {
            const double off = sum(s.path) - path / dual * sum(s.dual);
            squares += off * off;
        }
        return std::sqrt(squares) / path;
    }

    // Of too few samples nothing is known.
    void measure(std::vector<Sample> samples, const Box &box) {
        m_known = samples.size() >= enough;
        if (!m_known) return;
        m_box = box;
        for (Sample &s : samples)
            for (size_t a = 0; a < 3; ++a) s.at[a] = (s.at[a] - float(box.min[a])) / float(box.max[a] - box.min[a]);
        std::vector<float> ratios = divided(samples, texture<float>(1, std::vector<float>(Channels, 1.f)), 1);
        const std::vector<float> whole_box = ratios;
        size_t side = 1;
        while (side < finest && samples.size() >= enough * 4 * side * side) {
            const auto whole = texture<float>(side, ratios);
            side *= 2;
            ratios = divided(samples, whole, side);
        }
        // Interpolation moves light between parts: their sum is the whole's again.
        const auto light = [&](size_t parts, const std::vector<float> &r) {
            return summed(samples, texture<float>(parts, r), 1).sums[0].dual;
        };
        const Sum want = light(1, whole_box), got = light(side, ratios);
        for (size_t k = 0; k < ratios.size(); ++k)
            if (got[k % Channels] > 0) ratios[k] *= float(want[k % Channels] / got[k % Channels]);
        m_ratios = texture<Float>(side, ratios);
    }

    auto at(const Point &p, const dr::mask_t<Float> &active) const {
        return m_ratios.template eval<dr::Array<Float, Channels>>(Point((p - m_box.min) / (m_box.max - m_box.min)), active);
    }

  private:
    static constexpr size_t finest = 8;   // parts along an axis
    static constexpr size_t enough = 64;  // samples of a part, where hair fills as many as a surface does
    static constexpr double usual = .15;  // what the ratio of a whole groom differs from one by
    static constexpr float most = 32;     // a ratio is held within 1/most and most

    using Sum = std::array<double, Channels>;
    struct Sums {
        Sum path{}, dual{}, squares{};  // `squares`: of the samples' dual and of its mean
        size_t count = 0;
    };
    struct Parts {
        std::vector<Sums> sums;
        double noise;  // variance of a sample's path over its `squares`
    };

    template <class F> static dr::Texture<F, 3> texture(size_t side, const std::vector<float> &ratios) {
        const std::vector<dr::scalar_t<F>> values(ratios.begin(), ratios.end());
        const size_t shape[] = {side, side, side, Channels};
        return {dr::Tensor<mitsuba::DynamicBuffer<F>>(values.data(), 4, shape), false, false};
    }
    static Colour at(const dr::Texture<float, 3> &ratios, const std::array<float, 3> &p) {
        const auto r = ratios.eval<dr::Array<float, Channels>>(dr::Array<float, 3>(p[0], p[1], p[2]));
        Colour colour;
        for (size_t c = 0; c < Channels; ++c) colour[c] = r[c];
        return colour;
    }
    static float sum(const Colour &c) { return std::accumulate(c.begin(), c.end(), 0.f); }

    // Over `side` parts along each axis, with dual scattering's light times `ratios`.
    static Parts summed(const std::vector<Sample> &samples, const dr::Texture<float, 3> &ratios, size_t side) {
        Parts parts{std::vector<Sums>(side * side * side), 0};
        Sum mean{};
        double off = 0, squares = 0;
        for (const Sample &s : samples) {
            size_t k = 0;
            for (size_t a = 3; a-- > 0;) k = k * side + size_t(std::clamp(s.at[a] * float(side), 0.f, float(side) - .5f));
            Sums &part = parts.sums[k];
            const Colour here = at(ratios, s.at);
            for (size_t c = 0; c < Channels; ++c) {
                const double path = s.path[c], dual = double(here[c]) * s.dual[c];
                part.path[c] += path;
                part.dual[c] += dual;
                part.squares[c] += dual * dual;
                mean[c] += dual / double(samples.size());
                off += (path - dual) * (path - dual);
            }
            ++part.count;
        }
        for (Sums &part : parts.sums)
            for (size_t c = 0; c < Channels; ++c) {
                part.squares[c] += double(part.count) * mean[c] * mean[c];
                squares += part.squares[c];
            }
        if (squares > 0) parts.noise = off / squares;
        return parts;
    }

    static std::vector<float> divided(const std::vector<Sample> &samples, const dr::Texture<float, 3> &whole, size_t side) {
        const Parts parts = summed(samples, whole, side);
        double excess = 0, weight = 0;
        for (const Sums &part : parts.sums)
            for (size_t c = 0; c < Channels; ++c) {
                const double off = part.path[c] - part.dual[c];
                excess += off * off - parts.noise * part.squares[c];
                weight += part.dual[c] * part.dual[c];
            }
        const double between = side == 1 ? usual * usual : weight > 0 ? std::max(excess / weight, 0.) : 0.;
        std::vector<float> ratios;
        for (size_t k = 0; k < parts.sums.size(); ++k) {
            const auto middle = [&](size_t index) { return (float(index % side) + .5f) / float(side); };
            const Colour here = at(whole, {middle(k), middle(k / side), middle(k / side / side)});
            const Sums &part = parts.sums[k];
            for (size_t c = 0; c < Channels; ++c) {
                const double path = part.path[c], dual = part.dual[c];
                const double certain = between * dual * dual, uncertain = parts.noise * part.squares[c];
                // The share of certain in both times path / dual - 1, without a quotient by next to nothing.
                const double off = certain > 0 ? between * dual * (path - dual) / (certain + uncertain) : 0.;
                ratios.push_back(std::clamp(here[c] * float(1 + off), 1 / most, most));
            }
        }
        return ratios;
    }

    Box m_box;
    dr::Texture<Float, 3> m_ratios;
    bool m_known = false;
};

}  // namespace cuticle_mitsuba
