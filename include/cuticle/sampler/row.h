// Densities of many directions at one number of strands. What costs most of a lobe's density is its norm, by erf at the four
// ends of its intervals; along theta_r, between two nodes of the table, it is smooth, and a polynomial tells it.
#ifndef CUTICLE_SAMPLER_ROW_H
#define CUTICLE_SAMPLER_ROW_H

#include "cuticle/sampler/lanes.h"

#if CUTICLE_NATIVE_SHUFFLE

namespace cuticle {
namespace detail {

// The polynomial through the values at the zeros of Chebyshev's T_8, in powers of u on [-1, 1].
struct NormSeries {
    static constexpr int terms = 8;
    // part[i]: of the value at at[i] in the coefficients of u^0, u^2, u^4, u^6, u, u^3, u^5, u^7.
    float at[terms] = {}, part[terms][terms] = {};

    constexpr NormSeries() {
        constexpr double zeros[terms / 2] = {.19509032201612827, .55557023301960222, .83146961230254524, .98078528040323043};
        double power[terms][terms] = {{1}, {0, 1}};  // of T_d, the coefficient of u^j
        for (int d = 2; d < terms; ++d)
            for (int j = 0; j < terms; ++j) power[d][j] = (j > 0 ? 2 * power[d - 1][j - 1] : 0) - power[d - 2][j];
        for (int i = 0; i < terms; ++i) {
            const double x = i % 2 ? zeros[i / 2] : -zeros[i / 2];
            at[i] = static_cast<float>(x);
            double sum[terms] = {}, before = x, here = 1;  // T_1 = T_-1
            for (int d = 0; d < terms; ++d) {
                for (int j = 0; j < terms; ++j) sum[j] += (d > 0 ? 2. : 1.) / terms * here * power[d][j];
                const double next = 2 * x * here - before;
                before = here;
                here = next;
            }
            for (int j = 0; j < terms; ++j) part[i][j / 2 + j % 2 * (terms / 2)] = static_cast<float>(sum[j]);
        }
    }
};
inline constexpr NormSeries norm_series;

// A vector by itself, not as one of several, which GCC would copy in smaller pieces.
template <class V> CUTICLE_INLINE V read_vector(const float *from) {
    V v;
    std::memcpy(&v, from, sizeof v);
    return v;
}

template <int K> class RowDensities {
    static constexpr int terms = NormSeries::terms, fours = (K + 3) / 4, most_cells = 48, block = 64;
    using Four = Pack<float, 4>;
    using Eight = Pack<float, 8>;  // theta's of four lobes, then phi's
    using Lanes = BatchLanes<float>;
    static constexpr int width = Lanes::width;

    // Four lobes at u between the ends of a cell, -1 and 1; where there are fewer, the others weigh nothing.
    struct Lobes4 {
        Four weight[2];           // at u = 0, and the rise with u
        Eight mean[2], sigma[2];  // sigma times √2
        Eight series[terms / 2];  // of the norm: the coefficients of u^2j, then of u^(2j+1)
        bool smooth;              // whether they tell it to 1e-6
    };
    Lobes4 lobes[most_cells][fours];
    int cells;
    bool even;

  public:
    // Where no two rows' densities are blended; making it takes as long as some three hundred directions lane by lane.
    static bool serves(const LobeTable<float, K> &table, const RowPosition<float> &rows, std::size_t count) {
        return table.theta_nodes <= most_cells + 1 && count >= 1024 && !is_blended(table, rows);
    }

    RowDensities(const LobeTable<float, K> &table, const RowPosition<float> &rows) : even(table.even) {
        const int parts = 2 * (table.theta_nodes - 1) <= most_cells ? 2 : 1;  // of the interval between two nodes
        cells = parts * (table.theta_nodes - 1);
        const float step = 1.f / static_cast<float>(parts);
        for (int c = 0; c < cells; ++c) {
            const float t = static_cast<float>(c % parts) * step;
            const Corner low(values_at(table, ThetaPosition<float>{c / parts, t}, rows)),
                high(values_at(table, ThetaPosition<float>{c / parts, t + step}, rows));
            for (int q = 0; q < fours; ++q) make(lobes[c][q], low, high, 4 * q);
        }
    }

    // In 1/sr.
    void pdf(std::size_t count, const float *theta_i, const float *theta_r, const float *phi, float *out) const {
        if (even) blocks<true>(count, theta_i, theta_r, phi, out);
        else blocks<false>(count, theta_i, theta_r, phi, out);
    }

  private:
    // Of a block of directions; and of each of their lobes the product of the sigmas, by whose square `distance` is to be
    // divided for the exponent, and by which `factor` for the height.
    struct alignas(64) Block {
        float u[block], theta[block], place[block], scale[block];
        std::int32_t cell[block];
        float area[fours * block][4], distance[fours * block][4], factor[fours * block][4];
    };

    // The lobes at an end of a cell.
    struct Corner {
        static constexpr int lobes = 4 * fours;
        float weight[lobes] = {}, mean[2][lobes], sigma[2][lobes];

        explicit Corner(const LobeValues<float, K> &x) {
            for (int k = 0; k < lobes; ++k) {
                const int from = k < K ? k : K - 1;
                if (k < K) weight[k] = x.weight[k];
                for (int i = 0; i < 2; ++i) mean[i][k] = x.mean[i * K + from], sigma[i][k] = x.sigma[i * K + from];
            }
        }
    };

    // 1 over the product of both coordinates' integrals of normals of height 2/√pi rate.
    template <class Set>
    CUTICLE_INLINE Set norm(const Set &mean_theta, const Set &sigma_theta, const Set &mean_phi, const Set &sigma_phi) const {
        const CentralNormal<Set> theta = theta_normal<false>(mean_theta, sigma_theta),
                                 phi = phi_normal<false>(mean_phi, sigma_phi, even);
        return theta.under * phi.under / (theta.mass * phi.mass);
    }
    // Of lobes; rarely asked for, so not among the lines that often are.
    __attribute__((noinline)) Four exact(const Eight &mean, const Eight &sigma) const {
        return norm(half<0>(mean), half<0>(sigma), half<1>(mean), half<1>(sigma));
    }

    void make(Lobes4 &to, const Corner &low, const Corner &high, int first) const {
        const auto four = [&](const float *x) { return load_pack<float, 4>(x + first); };
        const auto both = [&](const auto &x) { return join(four(x[0]), four(x[1])); };
        const auto line = [](auto &x, const auto &a, const auto &b) {
            using Set = std::decay_t<decltype(a)>;
            x[0] = Set(.5) * (a + b);
            x[1] = Set(.5) * (b - a);
        };
        line(to.weight, four(low.weight), four(high.weight));
        line(to.mean, both(low.mean), both(high.mean));
        line(to.sigma, both(low.sigma), both(high.sigma));
        // Four lobes at all points at once: a single one would wait for itself.
        using Points = Pack<float, terms>;
        using All = Pack<float, 4 * terms>;
        constexpr int chunks = Points::chunks;
        const Points u = load_pack<float, terms>(norm_series.at);
        const auto at = [&](const Eight(&line)[2], int from) {
            float middle[8], rise[8];
            std::memcpy(middle, &line[0].v, sizeof middle);
            std::memcpy(rise, &line[1].v, sizeof rise);
            All x;
            CUTICLE_UNROLL
            for (int k = 0; k < 4; ++k) {
                const Points y = Points(middle[from + k]) + u * Points(rise[from + k]);
                CUTICLE_UNROLL
                for (int c = 0; c < chunks; ++c) x.v[k * chunks + c] = y.v[c];
            }
            return x;
        };
        const All n = norm(at(to.mean, 0), at(to.sigma, 0), at(to.mean, 4), at(to.sigma, 4));
        for (Eight &x : to.sigma) x = Eight(2 * sqrt_half<double>) * x;
        alignas(64) float value[4][terms];
        CUTICLE_UNROLL
        for (int c = 0; c < 4 * chunks; ++c) std::memcpy(value[0] + c * Points::width, &n.v[c], sizeof n.v[0]);
        Points sum[4];
        CUTICLE_UNROLL
        for (Points &x : sum) x = Points(0);
        CUTICLE_UNROLL
        for (int i = 0; i < terms; ++i) {
            const Points part = load_pack<float, terms>(norm_series.part[i]);
            CUTICLE_UNROLL
            for (int k = 0; k < 4; ++k) sum[k] = sum[k] + Points(value[k][i]) * part;
        }
        CUTICLE_UNROLL
        for (int c = 0; c < chunks; ++c) {
            const typename Points::Chunk r[4] = {sum[0].v[c], sum[1].v[c], sum[2].v[c], sum[3].v[c]};
            typename Points::Chunk turned[4];
            turn_over<Points::width>(r, turned);
            CUTICLE_UNROLL
            for (int j = 0; j < terms / 2; ++j) to.series[j].v[c] = turned[j];
        }
        // What is left out: half the last term, in T_7, whose highest power has 64, where terms fall by a third and more
        // each; and a tenth of the one before, whose has 32, in case the last one happens to vanish.
        const Eight last = to.series[terms / 2 - 1];
        const Four rest = Four(.1 / 32) * math::abs(half<0>(last)) + Four(.5 / 64) * math::abs(half<1>(last));
        const Four told = select(rest < Four(1e-6) * half<0>(to.series[0]), Four(1), Four(0));  // what is no number is not
        to.smooth = !ArrayTraits<Four>::any(told < Four(1));
    }

    template <bool Even>
    void blocks(std::size_t count, const float *theta_i, const float *theta_r, const float *phi, float *out) const {
        Block b;
        for (std::size_t first = 0; first < count; first += block) {
            const int n = static_cast<int>(count - first < block ? count - first : block);
            for (int i = 0; i < n; i += width) locate<Even>(b, i, n - i, theta_i + first, theta_r + first, phi + first);
            for (int i = 0; i < n; i += width)
                for (int h = 0; h < width / 4; ++h)
                    for (int k = 0; k < 4; ++k) {
                        // Lanes k, k + 4, ... side by side, as turn_over has them.
                        const int j = i + 4 * h + k, to = i + k * (width / 4) + h;
                        for (int q = 0; q < fours; ++q) one<Even>(b, j, lobes[b.cell[j]][q], q * block + to);
                    }
            for (int q = 0; q < fours; ++q)
                for (int i = 0; i < n; i += width) divide(b, q * block + i);
            for (int i = 0; i < n; i += width) sum(b, i, n - i, out + first);
        }
    }

    template <bool Even>
    CUTICLE_INLINE void locate(Block &b, int i, int n, const float *theta_i, const float *theta_r, const float *phi) const {
        if (n > width) n = width;
        const ThetaPosition<Lanes> at = locate_cell(cells, read<Lanes>(theta_r + i, n));
        const Lanes theta = read<Lanes>(theta_i + i, n), place = math::nearest_turn(read<Lanes>(phi + i, n));
        const auto cell = at.node.chunk(0);
        std::memcpy(b.cell + i, &cell, sizeof cell);
        write(Lanes(at.t + at.t - Lanes(1)), b.u + i, width);
        write(theta, b.theta + i, width);
        write(Even ? math::abs(place) : place, b.place + i, width);
        write(per_steradian(Lanes(lobe_height(Even)), theta), b.scale + i, width);
    }

    template <bool Even> CUTICLE_INLINE void one(Block &b, int j, const Lobes4 &l, int to) const {
        const Eight u8(b.u[j]), squared = u8 * u8;
        const Four u4 = half<0>(u8);
        const Eight mean = l.mean[0] + u8 * l.mean[1], sigma = l.sigma[0] + u8 * l.sigma[1];
        const Four sigma_theta = half<0>(sigma), sigma_phi = half<1>(sigma), d = Four(b.place[j]) - half<1>(mean);
        const Four x = (Four(b.theta[j]) - half<0>(mean)) * sigma_phi, y = (Even ? d : short_way(d)) * sigma_theta;
        Four norm;
        if (__builtin_expect(l.smooth, true)) {
            Eight s = l.series[terms / 2 - 1];
            CUTICLE_UNROLL
            for (int i = terms / 2 - 2; i >= 0; --i) s = s * squared + l.series[i];
            norm = half<0>(s) + u4 * half<1>(s);
        } else {
            norm = exact(mean, Eight(Eight(sqrt_half<double>) * sigma));
        }
        const Four area = sigma_theta * sigma_phi, distance = -(x * x + y * y),
                   factor = (l.weight[0] + u4 * l.weight[1]) * norm;
        std::memcpy(b.area[to], &area.v, sizeof area.v);
        std::memcpy(b.distance[to], &distance.v, sizeof distance.v);
        std::memcpy(b.factor[to], &factor.v, sizeof factor.v);
    }

    CUTICLE_INLINE void divide(Block &b, int at) const {
        using Vector = typename Lanes::Chunk;
        CUTICLE_UNROLL
        for (int c = 0; c < 4; ++c) {
            float *area = b.area[at] + c * width, *distance = b.distance[at] + c * width, *factor = b.factor[at] + c * width;
            const Vector rate = 1.f / read_vector<Vector>(area);
            const Vector x = read_vector<Vector>(distance) * (rate * rate), y = read_vector<Vector>(factor) * rate;
            std::memcpy(distance, &x, sizeof x);
            std::memcpy(factor, &y, sizeof y);
        }
    }
    CUTICLE_INLINE void sum(const Block &b, int i, int n, float *out) const {
        using All = Pack<float, 4 * width, CUTICLE_VECTOR_BYTES>;
        using Vector = typename All::Chunk;
        const auto get = [](const float *from) {
            All x;
            CUTICLE_UNROLL
            for (int c = 0; c < 4; ++c) x.v[c] = read_vector<Vector>(from + c * width);
            return x;
        };
        Vector total = {};
        for (int q = 0; q < fours; ++q) {
            const int at = q * block + i;
            const All p = get(b.factor[at]) * math::decay(get(b.distance[at]));
            const Vector r[4] = {p.v[0], p.v[1], p.v[2], p.v[3]};
            Vector lobe[4];
            turn_over<width>(r, lobe);
            total += (lobe[0] + lobe[1]) + (lobe[2] + lobe[3]);
        }
        Lanes density = read<Lanes>(b.scale + i, width);
        density.v[0] *= total;
        write(density, out + i, n < width ? n : width);
    }
};

}  // namespace detail
}  // namespace cuticle

#endif

#endif  // CUTICLE_SAMPLER_ROW_H
