// Sweeps in reverse have their bits whatever team runs them.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/algorithm/unrolled/unrolled_vjp.hpp"
#include "core/plan/plan.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class T>
void append(std::string& bytes, const std::vector<T>& numbers) {
  bytes.append(reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T));
}

template <class Real>
class UnrolledDerivativeBits : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(UnrolledDerivativeBits, Precisions);

/// Sweeps in reverse by lanes that race, against the library.
TYPED_TEST(UnrolledDerivativeBits, AreThoseOfTeamsOfEveryWidth) {
  using Real = TypeParam;
  for (const Law law : kBothLaws)
    for (const FactorUse use : {FactorUse::never, FactorUse::always}) {
      JacobianBatch<double> jacobian(law);
      jacobian.add(random_jacobian({3, 5, 4, 11, 0}));
      const ContactBatch<Real> batch = convert<Real>(assemble(jacobian.view(), use));
      const auto view = batch.view();
      const auto rows = static_cast<std::size_t>(batch.row_count());
      const auto start = random_numbers<Real>(rows, 1), bar = random_numbers<Real>(rows, 2),
                 w_bar = random_numbers<Real>(rows, 3);
      const PlanData plan = make_plan(view);
      const auto by = [&](const auto& run) {
        Gradients<Real> own;
        own.A.resize(static_cast<std::size_t>(view.nonzero_count), Real(77));
        own.factor.resize(static_cast<std::size_t>(view.factor_count), Real(77));
        own.b = own.R = own.mu = own.lo = own.hi = std::vector<Real>(rows, Real(77));
        own.status.resize(1);
        std::vector<Real> lambda(rows), by_start(rows);
        run(own, SweepsView<Real>{start.data(), 5, 1.0, lambda.data(), by_start.data()});
        std::string bytes;
        for (const auto* part : {&own.A, &own.factor, &own.b, &own.R, &own.mu, &own.lo, &own.hi, &lambda, &by_start})
          append(bytes, *part);
        append(bytes, own.status);
        return bytes;
      };
      const std::string expected = by([&](Gradients<Real>& own, const SweepsView<Real>& sweeps) {
        Derivative().unrolled_vjp(view, sweeps, SolutionCotangentView<Real>{bar.data(), w_bar.data()}, own.view(),
                                  own.status.data());
        EXPECT_EQ(own.status[0].flags, 0U);
      });
      for (const Index width : {1, 2, 3, 8, 33}) {
        EXPECT_EQ(by([&](Gradients<Real>& own, const SweepsView<Real>& sweeps) {
                    const DerivativeOptions o;
                    UnrolledJob<Real> job{};
                    static_cast<DerivativeJob<Real>&>(job) = {
                        view, {}, law, o.residual_limit, o.tie_tolerance, o.max_unknowns, 1, own.status.data()};
                    job.cotangents = {bar.data(), w_bar.data()};
                    job.gradients = own.view();
                    job.sweeps = sweeps;
                    std::vector<double> memory(static_cast<std::size_t>(unrolled_elements(job, 0)), __builtin_nan(""));
                    run_stressed<1>(
                        width, [&](auto& team) { unrolled_env(team, job, 0, plan.cone_order.data(), memory.data()); });
                  }),
                  expected)
            << width;
      }
    }
}

}  // namespace
