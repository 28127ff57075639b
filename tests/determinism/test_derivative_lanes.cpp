// Compliant environments, whose derivatives lanes find side by side, have their bits wherever and beside whatever they
// are computed.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr Offset kEnvs = 37;

template <class T>
void append(std::string& bytes, const std::vector<T>& numbers, Offset first, Offset last) {
  bytes.append(reinterpret_cast<const char*>(numbers.data() + first),
               static_cast<std::size_t>(last - first) * sizeof(T));
}
std::vector<Offset> in_order() {
  std::vector<Offset> order(static_cast<std::size_t>(kEnvs));
  std::iota(order.begin(), order.end(), Offset{0});
  return order;
}

template <class Real>
class DerivativeLanes : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(DerivativeLanes, Precisions);

TYPED_TEST(DerivativeLanes, HaveTheBitsOfAnyOrderThreadsAndInstructionSets) {
  using Real = TypeParam;
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    std::vector<JacobianEnvironment<Real>> envs;
    for (Offset e = 0; e < kEnvs; ++e) {
      const auto seed = static_cast<std::uint64_t>(e) + 1;
      const auto dofs = static_cast<Index>(e == 20 ? 72 : 3 * (1 + e % 4));
      const double compliance = e % 3 == 0 ? 2e-5 : 0.02;  // of so little, some adjoints are refined, and others not
      envs.push_back(
          cast<Real>(random_jacobian({seed, static_cast<int>(e % 5), static_cast<int>(e % 3), dofs, 3, compliance})));
    }
    const auto batch_in = [&](const std::vector<Offset>& order) {
      JacobianBatch<Real> batch(Law::convex, form, 3);
      for (const Offset e : order) batch.add(envs[static_cast<std::size_t>(e)]);
      return batch;
    };
    const JacobianBatch<Real> whole = batch_in(in_order());
    const double tolerance = sizeof(Real) == sizeof(float) ? 1e-5 : 1e-10;
    const auto solution = solve(whole, options(SolverKind::newton, tolerance, 100));
    const auto bars = random_numbers<Real>(solution.contact.lambda.size(), 1),
               v_bars = random_numbers<Real>(static_cast<std::size_t>(whole.view().dof_count), 2);
    /// Bytes of each environment, by its number.
    const auto derived = [&](const std::vector<Offset>& order, int threads) {
      const JacobianBatch<Real> batch = batch_in(order);
      const auto view = batch.view();
      std::vector<Real> lambda, bar, v_bar;
      const auto take = [&](std::vector<Real>& to, const std::vector<Real>& from, const Offset* begin, Offset e) {
        to.insert(to.end(), from.begin() + begin[e], from.begin() + begin[e + 1]);
      };
      for (const Offset e : order) {
        take(lambda, solution.contact.lambda, whole.view().env_row_offsets, e);
        take(bar, bars, whole.view().env_row_offsets, e);
        take(v_bar, v_bars, whole.view().env_dof_offsets, e);
      }
      DerivativeOptions o;
      o.threads = threads;
      JacobianGradients<Real> own(view);
      Derivative(Device::cpu(), o)
          .vjp(view, ReactionView<Real>{lambda.data(), nullptr},
               JacobianSolutionCotangentView<Real>{bar.data(), bar.data(), v_bar.data()}, own.view(),
               own.status.data());
      JacobianChanges<Real> changes(view);
      Derivative(Device::cpu(), o)
          .jvp(view, ReactionView<Real>{lambda.data(), nullptr}, own.tangents(), changes.view(), changes.status.data());
      std::vector<std::string> result(envs.size());
      for (std::size_t at = 0; at < order.size(); ++at) {
        const auto e = static_cast<Offset>(at);
        std::string& bytes = result[static_cast<std::size_t>(order[at])];
        const Offset first = view.env_row_offsets[e], last = view.env_row_offsets[e + 1];
        append(bytes, own.J, view.row_offsets[first], view.row_offsets[last]);
        append(bytes, own.M, view.env_mass_offsets[e], view.env_mass_offsets[e + 1]);
        append(bytes, own.v_free, view.env_dof_offsets[e], view.env_dof_offsets[e + 1]);
        for (const auto* part : {&own.target, &own.R, &own.mu, &changes.lambda, &changes.w})
          append(bytes, *part, first, last);
        append(bytes, changes.velocity, view.env_dof_offsets[e], view.env_dof_offsets[e + 1]);
        for (const auto* records : {&own.status, &changes.status}) {
          append(bytes, *records, e, e + 1);
          EXPECT_EQ((*records)[at].flags & kGradientRefused, 0U);
        }
      }
      return result;
    };
    const auto expected = derived(in_order(), 1);
    std::vector<Offset> order = in_order();
    std::ranges::reverse(order);
    EXPECT_EQ(derived(order, 1), expected);
    std::ranges::rotate(order, order.begin() + 11);
    EXPECT_EQ(derived(order, 3), expected);
    for (const Offset e : {0, 7, 18})
      EXPECT_EQ(derived({e}, 1)[static_cast<std::size_t>(e)], expected[static_cast<std::size_t>(e)]);
    for (const char* isa : usable_isas()) {
      const ScopedIsa scoped(isa);
      EXPECT_EQ(derived(in_order(), 1), expected) << isa;
    }
  }
}

}  // namespace
