// The core without an export: a table of two lobes made by hand, evaluated and drawn from, one by one and as a batch.
#include <cuticle/cuticle.h>

#include <cmath>
#include <cstdio>
#include <vector>

int main() {
    // Two nodes of theta_r, at -90° and 90°; at each: weights, mean thetas, mean phis, sigmas in theta, sigmas in phi.
    const float nodes[] = {.7f, .3f, 1.2f,  1.4f,  3.14159f, .5f, .2f, .3f, .4f, .8f,   // viewer at -90°
                           .7f, .3f, -1.2f, -1.4f, 3.14159f, .5f, .2f, .3f, .4f, .8f};  // viewer at 90°
    const float energy[] = {1, 1}, strands[] = {0};
    const cuticle::LobeTable<float, 2> table{nodes, energy, strands, 1, 2, true};

    const auto s = cuticle::sample(table, .4f, .6f, .3f, .8f, 0.f);
    const float p = cuticle::pdf(table, s.theta_i, .4f, s.phi, 0.f);
    std::printf("theta_i %.4f, phi %.4f, pdf %.4f, again %.4f\n", double(s.theta_i), double(s.phi), double(s.pdf),
                double(p));

    // The integral of the pdf, as a batch.
    constexpr int side = 200;
    std::vector<float> theta_i, phi, theta_r(side * side, .4f), density(side * side);
    for (int i = 0; i < side * side; ++i) {
        theta_i.push_back(cuticle::pi<float> * ((float(i / side) + .5f) / side - .5f));
        phi.push_back(2 * cuticle::pi<float> * ((float(i % side) + .5f) / side - .5f));
    }
    const float none = 0;
    cuticle::pdf_batch(table, density.size(), theta_i.data(), theta_r.data(), phi.data(), &none, false, density.data());
    double integral = 0;
    for (std::size_t i = 0; i < density.size(); ++i)
        integral += double(density[i]) * std::cos(double(theta_i[i])) * 2 * 9.8696044 / (side * side);
    std::printf("integral %.5f\n", integral);
    return std::fabs(integral - 1) < 1e-3 && std::fabs(p - s.pdf) < 1e-5f ? 0 : 1;
}
