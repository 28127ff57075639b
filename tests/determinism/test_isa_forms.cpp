#include <gtest/gtest.h>

#include "scenes/body_scenes.hpp"
#include "stiction/jacobian.hpp"
#include "tests/support/machines/body_methods.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/systems/jacobian_systems.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"

/// Every instruction set gives bodies and Jacobians the bits of every other, by every method. test_isa.cpp compares
/// matrices, test_worlds.cpp worlds.
namespace stiction::test {
namespace {

template <class Real>
class IsaForms : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(IsaForms, Precisions);

/// More alike than the widest pack has lanes, and some that no pack takes.
template <class Real>
BodyBatch<Real> crowd() {
  BodyBatch<Real> batch;
  for (std::uint64_t seed = 0; seed < 40; ++seed)
    batch.add(as<Real>(random_bodies(seed, 2 + static_cast<Index>(seed % 5), static_cast<Index>(7 * seed % 30))));
  batch.add(BodyEnvironment<Real>{});
  batch.add(as<Real>(scenes::make_body_pile(1, 150)));
  return batch;
}

TYPED_TEST(IsaForms, BodiesHaveTheSameBitsByEveryMethod) {
  const BodyBatch<TypeParam> batch = crowd<TypeParam>();
  for (const BodyMethodCase& method : every_body_method()) {
    std::optional<BodySolution<TypeParam>> expected;
    for (const char* name : usable_isas()) {
      const ScopedIsa isa(name);
      BodySolution<TypeParam> solution = solve_bodies(batch, {}, method.options());
      if (!expected) expected = solution;
      expect_same_bodies(*expected, solution, method.name() + ", " + name);
    }
  }
}

/// Small environments, empty ones and large ones, without friction for lemke.
template <class Real>
JacobianBatch<Real> jacobians(Law law, bool with_friction) {
  JacobianBatch<Real> batch(law);
  for (std::uint64_t seed = 1; seed < 20; ++seed) {
    const auto contacts = static_cast<int>(seed % 4);
    batch.add(cast<Real>(random_jacobian({seed, with_friction ? contacts : 0, 2 + contacts, 12})));
  }
  batch.add(cast<Real>(random_jacobian({91, 0, 0, 6})));
  batch.add(cast<Real>(random_jacobian({92, with_friction ? 25 : 0, 9, 18})));
  return batch;
}

template <class Real>
::testing::AssertionResult same(const JacobianSolution<Real>& a, const JacobianSolution<Real>& b) {
  const auto contact = same_bits(a.contact, b.contact);
  if (!contact) return contact;
  return same_bits(std::span<const Real>(a.velocity), std::span<const Real>(b.velocity));
}

TYPED_TEST(IsaForms, JacobiansHaveTheSameBitsByEverySolver) {
  using Real = TypeParam;
  for (const SolverKind solver : kEveryChoice)
    for (const Law law : kBothLaws)
      for (const FactorUse use : {FactorUse::by_size, FactorUse::always}) {
        const JacobianBatch<Real> batch = jacobians<Real>(law, solver != SolverKind::lemke);
        const SolverOptions o = options(solver, 1e-4, few_iterations(solver, 22));
        std::optional<JacobianSolution<Real>> expected;
        for (const char* name : usable_isas()) {
          const ScopedIsa isa(name);
          JacobianSolution<Real> solution = solve(batch, o, Device::cpu(), std::span<const Real>{}, use);
          if (!expected) expected = solution;
          EXPECT_TRUE(same(*expected, solution)) << label(solver, law) << ", " << name;
        }
      }
}

}  // namespace
}  // namespace stiction::test
