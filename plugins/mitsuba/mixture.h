// One row of a sampler's table in Mitsuba's memory: the lobes for one viewer, of whichever number the table has. Traced
// arrays' code is compiled once, in mixture.cpp.
#pragma once

#include "drjit_traits.h"

#include <drjit/tensor.h>
#include <mitsuba/core/properties.h>

#include <stdexcept>

#include "cuticle/sampler/sampler.h"
#include "variants.h"

namespace cuticle_mitsuba {

namespace dr = drjit;

// How the core reads a buffer: scalar code through a pointer, traced code through a gather.
template <class Float> using Memory = std::conditional_t<dr::is_jit_v<Float>, Float, const float *>;
template <class Float> using Buffer = mitsuba::DynamicBuffer<Float>;
template <class Float> using Tensor = dr::Tensor<Buffer<Float>>;

template <class Float> Memory<Float> memory(const Buffer<Float> &buffer) {
    if constexpr (dr::is_jit_v<Float>) return buffer;
    else return buffer.data();
}

template <class Float> class Mixture {
  public:
    // The tensor (theta nodes, 5, K), lobe_parameters in their order; K is 4, 8, 16 or 32.
    void set(const Tensor<Float> &table, bool even) {
        if (table.ndim() != 3 || table.shape(1) != cuticle::lobe_parameters ||
            (table.shape(2) != 4 && table.shape(2) != 8 && table.shape(2) != 16 && table.shape(2) != 32))
            throw std::runtime_error("a table of lobes must have shape (theta nodes, 5, 4 or 8 or 16 or 32)");
        m_nodes = table.array();
        m_theta_nodes = static_cast<int>(table.shape(0));
        m_lobes = static_cast<int>(table.shape(2));
        m_even = even;
    }
    bool empty() const { return m_lobes == 0; }

    // 1/sr.
    Float pdf(const Float &theta_i, const Float &theta_r, const Float &phi) const;
    cuticle::Sample<Float> sample(const Float &theta_r, const Float &u_lobe, const Float &u_theta, const Float &u_phi) const;

    Buffer<Float> m_nodes;

  private:
    template <class Use> auto visit(const Float &theta_r, const Use &use) const {
        switch (m_lobes) {
            case 4:
                return use(prepare<4>(theta_r));
            case 8:
                return use(prepare<8>(theta_r));
            case 16:
                return use(prepare<16>(theta_r));
            default:
                return use(prepare<32>(theta_r));
        }
    }
    template <int K> auto prepare(const Float &theta_r) const {
        const Memory<Float> nodes = memory<Float>(m_nodes);
        const cuticle::LobeTable<float, K, Memory<Float>> table{nodes, nodes, nullptr, 1, m_theta_nodes, m_even};
        // One row: nothing to find, and no two to blend.
        return cuticle::lobes_at(table, cuticle::locate_theta(table, theta_r), cuticle::RowPosition<float>{0, 0.f, false});
    }

    int m_lobes = 0, m_theta_nodes = 0;
    bool m_even = true;
};

template <class Float> Float Mixture<Float>::pdf(const Float &theta_i, const Float &theta_r, const Float &phi) const {
    return visit(theta_r, [&](const auto &lobes) { return lobes.pdf(theta_i, phi); });
}

template <class Float>
cuticle::Sample<Float> Mixture<Float>::sample(const Float &theta_r, const Float &u_lobe, const Float &u_theta,
                                              const Float &u_phi) const {
    return visit(theta_r, [&](const auto &lobes) { return lobes.sample(u_lobe, u_theta, u_phi); });
}

extern template class Mixture<CUTICLE_LLVM>;
CUTICLE_IF_CUDA(extern template class Mixture<CUTICLE_CUDA>;)

}  // namespace cuticle_mitsuba
