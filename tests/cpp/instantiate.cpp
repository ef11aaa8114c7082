// One header by itself, its templates instantiated for numbers, for packs and, with DRJIT, for Dr.Jit's arrays: compiled
// once for each, -DHEADER="cuticle/math/erf.h" -DUSE_math_erf, and once with all of them. What an array type brings comes
// after the header: argument-dependent lookup has to find it.
#include HEADER

#include "cuticle/simd/lanes.h"

#ifdef DRJIT
#include "drjit_traits.h"
#endif

#include <cstddef>

namespace {

using namespace cuticle;

// F: the type; S: of one lane; M: what its tables lie in.
template <class F, class S, class M> struct Use {
    const F x, y, z;
    const M memory;
    const S *const numbers;
    S *const out;

#ifdef USE_math_functions
    F functions() const {
        const F c[] = {x, y, z};
        const F all = math::sqrt(x) + math::log(x) + math::sin(x) + math::cos(x) + math::asin(x) + math::abs(x) +
                      math::floor(x) + math::atan2(x, y) + math::copysign(x, y) + math::clamp(x, y, z) + math::sqr(x) +
                      math::polynomial(x, y, z) + math::estrin(x, c) + math::exp(x) + math::decay(x) +
                      math::one_less_decay(x, y) + math::wrap_angle(x) + math::cos_theta(x);
        if constexpr (std::is_same_v<S, float> && !std::is_class_v<M>)
            return all + math::decay_single(x) + math::log_single(x);
        else return all;
    }
#endif
#ifdef USE_math_erf
    F erf() const { return math::erf(x) + math::erfinv(x) + math::erfcx(x) + math::erfc_single(x); }
#endif
#ifdef USE_math_angles
    F angles() const {
        const Direction<F> d = to_direction(theta_half(x, y), theta_difference(x, y));
        return theta_of(d) + phi_of(d) + half_angle_to_theta(x);
    }
#endif
#ifdef USE_math_logistic
    F logistic() const { return trimmed_logistic(x, y) + trimmed_logistic_inverse(x, y); }
#endif
#ifdef USE_math_table_values
    F table_values() const {
        using Index = typename ArrayTraits<F>::Index;
        const ChannelBetween<F> channel{Index(0), z};
        return between_rows<F>(memory, Index(0), Place<F>{Index(0), x}, 3, 1, channel) +
               bilinear_value<F>(memory, Index(0), 6, 2, x, y, 1);
    }
#endif
#ifdef USE_simd_pack_math
    F packs() const {  // of lobes
        const Pack<F, 4> a(x), b(y);
        const auto joined = join(a * b, a / b);
        return sum(half<0>(joined) + math::max(half<1>(joined), -a)) + sum(select(a < b, math::exp(a), math::decay(b)));
    }
#endif
#ifdef USE_simd_abreast
    F abreast_of() const {
        F all[8] = {x, y, z, x, y, z, x, y};
        const S known[8] = {};
        store_abreast<F>(load_abreast(all, 0) + constants_abreast<F>(known, 0), all, 0);
        return sum_abreast<F>(load_abreast(all, 0));
    }
#endif
#ifdef USE_simd_several
    F several() const { return sum(Several<F, 3>(x) * Several<F, 3>(y)); }
#endif
#ifdef USE_sampler_sample
    F steradian() const { return per_steradian(x, y) + sample_per_steradian(x, y); }
#endif
#ifdef USE_sampler_circle
    F circle() const {
        const auto same = [](const F &u) { return u; };
        return periodic_cdf(same, x, y) + periodic_icdf(same, same, x, y) + even_cdf(same, x) + even_icdf(same, x) +
               short_way(x);
    }
#endif
#ifdef USE_sampler_normal
    F normal() const {
        const auto t = longitudinal_normal(x, y);
        const PeriodicNormal<F> p(x, y);
        const EvenNormal<F> e(x, y);
        return t.pdf(z) + t.cdf(z) + t.icdf(z) + p.pdf(z) + p.cdf(z) + p.icdf(z) + e.pdf(z) + e.cdf(z) + e.icdf(z);
    }
#endif
#ifdef FAMILY  // one of families.h
    F family() const {
        const auto d = FAMILY::make(x, y, z, x);
        return FAMILY::cdf(d, x) + FAMILY::icdf(d, x, y, z) + FAMILY::fall(x) +
               FAMILY::together(FAMILY::along(x), FAMILY::along(y));
    }
#endif
#ifdef USE_sampler_families
    void families() const {
        each_family([](const char *, auto) {});
    }
#endif
#ifdef USE_sampler_lobes
    F lobes() const {
        Lobes<F, 2> l;
        l.set(Pack<F, 2>(x), Pack<F, 4>(y), Pack<F, 4>(z), true);
        return l.pdf(x, y) + l.sample(x, y, z).pdf + l.cdf_theta(0, x) + l.icdf_theta(0, x) + l.cdf_phi(1, x) +
               l.icdf_phi(1, x);
    }
#endif
#ifdef USE_sampler_strand_counts
    F counts() const { return locate_count(numbers, 3, x).low; }
#endif
#if defined(USE_sampler_lobe_table) || defined(USE_sampler_sampler)
    LobeTable<S, 2, M> table() const { return {memory, memory, numbers, 3, 5, false}; }
#endif
#ifdef USE_sampler_lobe_table
    F position() const {
        return locate_theta(table(), x).t + values_at(table(), locate_theta(table(), x), locate_row(table(), y)).weight[1];
    }
#endif
#ifdef USE_sampler_sampler
    F sampler() const {
        return prepare(table(), x, y).pdf(x, z) + pdf(table(), x, y, z, x) + sample(table(), x, x, y, z, y).pdf;
    }
#endif
#ifdef USE_sampler_batch
    void batch() const {
        if constexpr (std::is_arithmetic_v<F>) {
            const LobeTable<S, 2> table{numbers, numbers, numbers, 3, 5, false};
            pdf_batch(table, 9, numbers, numbers, numbers, numbers, true, out);
            sample_batch(table, 9, numbers, numbers, numbers, numbers, numbers, false, out, out, out);
            pdf_batch(prepare(table, x, y), 9, numbers, numbers, out);
            sample_batch(prepare(table, x, y), 9, numbers, numbers, numbers, out, out, out);
        }
    }
#endif
#ifdef USE_scattering_optics
    F optics() const {
        const auto ray = cross_section(x, y, z, x);
        return attenuation(2, ray, x, true) + exit_azimuth(1, ray);
    }
#endif
#ifdef USE_scattering_longitudinal
    F m() const { return longitudinal(Longitudinal::gaussian, x, y, z, x) + gaussian(x, y); }
#endif
#ifdef USE_scattering_azimuthal
    F n() const {
        const AzimuthalTable<M> table{memory, 5, 9, 3};
        const auto at = locate(table, x, y);
        const AbsorptionRange<S> range{S(.1), S(1.2), 0, 9};
        if constexpr (std::is_arithmetic_v<F>) {
            OffsetCell<F> cells[9];
            offset_cells(x, y, 9, cells);
            azimuthal_row(1, cells, 9, z, false, 8, out, smoothing_kernel(Azimuthal::normal, x, 8, out), out, out);
            spread_row(out, 8, out);
            out[0] = half_energies(out, 8).forward;
        }
        return azimuthal_value<F>(table, at, 1, 2) + azimuthal_value<F>(table, at, 1, locate(range, x));
    }
#endif
#ifdef USE_scattering_marschner
    void marschner(F *f) const {
        const FibreLobes<S> fibre{{}, {}, Longitudinal::energy_conserving};
        const AzimuthalTable<M> table{memory, 5, 9, 3};
        AzimuthalTerms<F> terms[3];
        marschner_terms(fibre, x, y, mask_all, 3, terms);
        marschner_around(fibre, table, terms, x, y, z, f);
    }
#endif
#ifdef USE_scattering_multiple_scattering
    F multiple() const {
        Averages<F> a{x, y, z, x, y, z, x, y, z};
        if constexpr (std::is_arithmetic_v<F>) {
            const FibreLobes<F> fibre{{}, {}, longitudinal_of(Formulation::exact)};
            const auto halves = [](const F &h, int) { return Halves<F>{h, h}; };
            a = half_sphere_averages(fibre, Formulation::zinke2008, x, halves, 8);
            backscatter_exact(a);
            backscatter_zinke2008(a, x);
        }
        return a.back_energy;
    }
#endif
#ifdef USE_scattering_part_draw
    struct Even {
        F level;
        friend int node_count(const Even &) { return 9; }
        friend F node_density(const Even &of, int) { return of.level; }
    };
    F part() const {
        const ChosenPart<F> chosen = pass_part(none_chosen(F(0)), x, y, 0, 0, z, y);
        return draw_part(chosen, Even{x}, left_of(chosen, x), y, z).theta_i;
    }
#endif
#ifdef USE_scattering_through_table
    F through_table() const {
        const ThroughTable<S, M> table{};
        const auto place = locate(table, x, y, false, true);
        const ThroughPart<F> part = own_part(through_part<F>(table, place, 1, 2), OwnPart<F>{x, y, z, x});
        return part_m(part, x) + part_m(through_part<F>(table, place, 4, 0), y) +
               behind_at<F>(memory, place.row, 3, 1).alone + through_turn<F>(table, place, place.row, 1, 2);
    }
#endif
#ifdef USE_scattering_through_strands
    F through() const {
        const ThroughTable<S, M> table{};
        const auto place = locate(table, x, y, true, true);
        const ChannelBetween<F> between = locate(AbsorptionRange<S>{S(.1), S(1.2), 0, 9}, x);
        F lobes[through_parts + 1];
        through_lobes(through_moments(table, place, between), x, lobes);
        const OwnParts<F> own{{{x, y, z, x}, {x, y, z, x}, {x, y, z, x}}};
        through_lobes(through_moments(table, place, 1, &own), x, lobes);
        lobes[0] = behind_at<F>(memory, place.row, 3, between).alone + behind_at<F>(memory, place.row, 3, 1).alone;
        return add_through(x, table, place, lobes, z, between) + add_through(x, table, place, lobes, z, 1) +
               draw_azimuth(azimuth_nodes(table, place, x, y), z);
    }
#endif
#ifdef USE_scattering_far_among
    F among(F *f) const {
        const MeanStrands<S, M> mean{};
        const S luminance[] = {S(.3), S(.4), S(.3)};
        const auto field = far_among<3>(Azimuthal::normal, mean, FarFibre<F>{}, x, f, luminance, counted(y));
        return among_sample(Azimuthal::normal, mean, field, x, y, z, f).pdf;
    }
#endif
#ifdef USE_scattering_through_draw
    F drawn() const {
        const ThroughDraw<S, M> table{memory, memory, 5, 3, 9, S(1.5)};
        const OwnParts<F> own{{{x, y, z, x}, {x, y, z, x}, {x, y, z, x}}};
        const auto mixture = through_mixture(table, x, own);
        return through_sample(table, mixture, x, y, z).pdf + through_pdf(table, mixture, x, y);
    }
#endif
#ifdef USE_scattering_dual_scattering
    void dual(F *f) const {
        DualScatteringModel<S, M> model{};
        AzimuthalTerms<F> terms[3];
        const Surroundings<F> around{x, y, true};
        dual_scattering_terms(model, x, y, around, mask_all, terms);
        dual_scattering_around(model, terms, x, y, z, counted(x), f);
        const ChannelBetween<F> channel = locate(AbsorptionRange<S>{S(.1), S(1.2), 0, 9}, x);
        add_surroundings(model, channel, x, y, around, mask_all, terms[0]);
        f[0] = sum_around(model, terms[0], locate(model.direct, x, y), x, y, channel, around);
    }
#endif
#ifdef USE_scattering_chiang
    F chiang(F *f) const {
        const ChiangFibre<S> fibre{};
        const auto state = chiang_state(fibre, x, y, numbers, numbers, 3);
        const auto s = chiang_sample(fibre, state, x, y, z);
        chiang_eval(fibre, state, numbers, 3, mask_all, x, y, f);
        AzimuthalTerms<F> terms[3];
        const ChiangRest<S, M> rest{memory, 5, 3, S(.1)};
        chiang_far_terms(FibreLobes<S>{}, rest, x, y, mask_all, terms);
        return s.pdf + chiang_far_rest(rest, x, y, locate(AbsorptionRange<S>{S(.1), S(1.2), 0, 9}, x));
    }
#endif
#ifdef USE_scattering_far_cells
    F cells() const {
        const Turned<F> at = turned(Azimuthal::normal, x, unit_rate(Azimuthal::normal, y), y, z);
        constexpr auto geometry = cell_geometry<S>(true);
        return at.whole + at.rest + turn_of(Azimuthal::logistic, x, y) + F(geometry.width[0]) +
               sum_abreast<F>(cell_edges<F>(true, 0).sine * cell_middles<F>(false, 0).cosine);
    }
#endif
#ifdef USE_scattering_far_fibre
    F fibre() const { return chiang_fibre(x, y, z, x).width + marschner_fibre(x, y, z, x, y, z, x, y).tilt[2]; }
#endif
#ifdef USE_scattering_far_field
    F far(F *f) const {
        const F sigma_a[] = {x, y, z};
        const S luminance[] = {S(.2), S(.7), S(.1)};
        const FarFibre<F> fibre = chiang_fibre(x, y, z, x);
        const auto field = far_field<3>(Azimuthal::logistic, fibre, x, sigma_a, luminance);
        return far_eval(Azimuthal::normal, field, x, y, f) + far_sample(Azimuthal::normal, field, x, y, z, f).pdf;
    }
#endif
#ifdef USE_scattering_function_table
    void function_table(F *f) const {
        const TabulatedModel<S, M> model{memory, memory, 3, 5, 5, 5, 5, 3, S(1), S(1), true};
        tabulated_eval(model, numbers, x, y, z, x, f);
    }
#endif
#ifdef USE_groom_density_grid
    F crossed() const {
        if constexpr (std::is_arithmetic_v<F>) {
            deposit_strand(DensityGrid<F>{}, out, numbers, numbers, x);
            coarsen(DensityGrid<F>{}, 2, out);
        }
        const F from[3] = {x, y, z};
        return count_strands(DensityGrid<S, M>{memory, {2, 2, 2}, {}, {}}, from, Direction<F>{x, y, z}, x);
    }
#endif
};

#ifdef DRJIT
using Traced = drjit::DiffArray<JitBackend::LLVM, float>;
template struct Use<Traced, float, Traced>;
#else
template struct Use<float, float, const float *>;
template struct Use<double, double, const double *>;
template struct Use<Pack<float, 4>, float, const float *>;
template struct Use<Pack<double, 2>, double, const double *>;
template struct Use<BatchLanes<float>, float, const float *>;
#endif

}  // namespace
