#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/plan/plan.hpp"
#include "scenes/scenes.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/jitter_team.hpp"
#include "tests/support/plan_views.hpp"
#include "tests/support/stress_team.hpp"

/// One environment solved by an algorithm on teams of every width, by threads that race unless it syncs, and on every
/// stride. Each must give the bits of the public solver.
namespace stiction::test {

/// More lanes than leaves of a sum, fewer, odd, one.
inline constexpr Index kWidths[] = {1, 2, 3, 8, 16, 33};

template <class Method, Law kLaw, class Real>
class TortureCase {
 public:
  TortureCase(const Environment<double>& environment, bool warm) : batch_(make_batch(environment)) {
    options_.solver = Method::kKind;
    options_.tolerance = 1e-3;
    options_.max_iterations = 5;  // a chunk and a part of one
    options_.invalid = InvalidPolicy::isolate;
    options_.threads = 1;
    plan_ = make_plan(batch_.view());
    if (warm)
      for (std::size_t i = 0; i < rows(); ++i) warm_.push_back(static_cast<Real>(static_cast<double>(i % 5) * 0.125));
    expected_ = solve(batch_, options_, Device::cpu(), std::span<const Real>(warm_));
  }

  [[nodiscard]] EnvPath path() const { return plan_.path[0]; }

  /// The environment on a dense system of that stride, solved on `width` lanes that make(team, rank) gives.
  template <int kStride, class Make>
  void expect_same_dense(Index width, const Make& make, const std::string& label) const {
    run(width, make, label, DenseSystem<Real, kStride>::elements(plan_.counts[0], Method::workspace()) * kStride,
        [](const EnvView<Real>& env, Real* memory) {
          return DenseSystem<Real, kStride>(env.counts, Method::workspace(), memory);
        });
  }

  template <class Make>
  void expect_same_sparse(Index width, const Make& make, const std::string& label) const {
    const auto view = batch_.view();
    run(width, make, label,
        SparseSystem<Real>::elements(static_cast<Index>(view.row_count), static_cast<Index>(view.cone_count),
                                     view.nonzero_count, Method::workspace()),
        [](const EnvView<Real>& env, Real* memory) { return SparseSystem<Real>(env, Method::workspace(), memory); });
  }

 private:
  static ContactBatch<Real> make_batch(const Environment<double>& environment) {
    ContactBatch<double> batch(kLaw);
    batch.add(environment);
    return convert<Real>(batch);
  }
  [[nodiscard]] std::size_t rows() const { return static_cast<std::size_t>(batch_.row_count()); }

  template <class Make, class MakeSystem>
  void run(Index width, const Make& make, const std::string& label, Offset elements,
           const MakeSystem& make_system) const {
    Solution<Real> solution{std::vector<Real>(rows()), std::vector<Real>(rows()), std::vector<EnvStatus>(1)};
    // What an algorithm reads before it writes would show: no memory of a GPU is zero without being written.
    std::vector<Real> memory(static_cast<std::size_t>(elements), static_cast<Real>(__builtin_nan("")));
    const EnvView<Real> env = slice(batch_.view(), view_of(plan_), kLaw, warm_.empty() ? nullptr : warm_.data(),
                                    solution.lambda.data(), solution.w.data(), solution.status.data(), Offset{0});
    const StopRule rule{options_.tolerance, options_.max_iterations, options_.stall_window};
    run_stressed(width, make, [&](auto& team) {
      auto system = make_system(env, memory.data());
      solve_environment<Method, kLaw>(team, env, system, MethodParams<Real>{Real(options_.omega)}, rule);
    });
    EXPECT_TRUE(same_bits(expected_, solution)) << label << ", width " << width;
  }

  ContactBatch<Real> batch_;
  SolverOptions options_;
  PlanData plan_;
  std::vector<Real> warm_;
  Solution<Real> expected_;
};

template <Index kTile>
inline const auto kTorture = [](TortureTeam& team, Index rank) { return StressTeam<kTile>(team, rank); };
inline const auto kJitter = [](TortureTeam& team, Index rank) {
  return JitterTeam<StressTeam<1>>(StressTeam<1>(team, rank), 42);
};

template <class Method, Law kLaw, class Real>
void torture_dense(const Environment<double>& environment, bool warm) {
  const TortureCase<Method, kLaw, Real> one(environment, warm);
  ASSERT_EQ(one.path(), EnvPath::dense);
  for (const Index width : kWidths) one.template expect_same_dense<1>(width, kTorture<1>, "tile 1, stride 1");
  // A method that factorises has an environment to itself.
  if constexpr (!Method::workspace().is_direct())
    for (const Index width : kWidths) one.template expect_same_dense<32>(width, kTorture<8>, "tile 8, stride 32");
}

template <class Method, Law kLaw, class Real>
void torture_sparse(const Environment<double>& environment, bool warm) {
  const TortureCase<Method, kLaw, Real> one(environment, warm);
  ASSERT_EQ(one.path(), EnvPath::sparse);
  for (const Index width : kWidths) one.expect_same_sparse(width, kTorture<8>, "tile 8, sparse");
}

/// Cones of every kind a scene has: joints, joint friction, limits, torsional contacts.
inline Environment<double> small_dense() {
  return scenes::make("grasp", 5, 0, 2).system;
}
/// A stack too tall to be dense: many colours, manifolds of four contacts.
inline Environment<double> small_sparse() {
  return scenes::make("stack", 5, 0, 16).system;
}

/// Runs both laws and precisions of a method on both kinds of system. What computes what does not depend on how law
/// and precision are paired, and every pair costs a copy of the algorithm. The emulated device's tests have them all.
template <class Method>
void torture_method() {
  {
    SCOPED_TRACE("f32 convex");
    torture_dense<Method, Law::convex, float>(small_dense(), false);
    torture_sparse<Method, Law::convex, float>(small_sparse(), true);
  }
  {
    SCOPED_TRACE("f64 coulomb");
    torture_dense<Method, Law::coulomb, double>(small_dense(), true);
    torture_sparse<Method, Law::coulomb, double>(small_sparse(), false);
  }
}

}  // namespace stiction::test
