// Environments of contacts that are differentiated side by side have the bits of one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <type_traits>

#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/systems/derivative_cases.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

/// Environments whose cones come in many orders, a few of them too large for a pack, or empty.
template <class Real>
ContactBatch<Real> many_kinds(Law law) {
  ContactBatch<double> batch(law);
  scenes::Rng rng(11);
  for (int e = 0; e < 45; ++e) {
    Recipe recipe;
    recipe.seed = static_cast<std::uint64_t>(e) + 100;
    recipe.contacts = e % 15 == 0 ? 24 : rng.below(9);
    recipe.others = rng.below(6);
    recipe.rank = e % 9 == 0 ? 0.4 : 1.5;
    if (e % 3 != 0) {  // as robots have them: many go into one pack
      recipe.order = e % 2 == 0 ? ConeOrder::friction_last : ConeOrder::friction_first;
      recipe.friction_rows = e % 3 == 1 ? 3 : 0;
    }
    batch.add(e % 17 == 5 ? Environment<double>{} : random_contacts(recipe));
  }
  return convert<Real>(batch);
}

DerivativeOptions with_any_residual() {
  DerivativeOptions options;
  options.residual_limit = 1e30;
  return options;
}

/// derived(instruction set) has the same numbers and records everywhere. The baseline of x86-64 has no packs: there
/// each environment is alone.
template <class F>
void expect_bits_of_one_by_one(const F& derived) {
  const auto in = [&](const char* isa) {
    const ScopedIsa scoped(isa);
    return derived();
  };
  const auto expected = in(narrowest_isa());
  Offset answered = 0;
  for (const GradientStatus& status : expected.status) answered += (status.flags & kGradientRefused) == 0;
  EXPECT_GT(answered, 25);
  for (const char* isa : usable_isas()) {
    const auto own = in(isa);
    EXPECT_EQ(own.all(), expected.all()) << isa;
    for (std::size_t e = 0; e < own.status.size(); ++e) {
      const GradientStatus &a = own.status[e], &b = expected.status[e];
      EXPECT_EQ(a.residual, b.residual) << isa << ", " << e;
      EXPECT_EQ(a.forward_residual, b.forward_residual) << isa << ", " << e;
      EXPECT_EQ(a.flags, b.flags) << isa << ", " << e;
      EXPECT_EQ(a.unknowns, b.unknowns) << isa << ", " << e;
      EXPECT_EQ(a.degenerate, b.degenerate) << isa << ", " << e;
    }
  }
}

template <class Real>
class DerivativeOfContacts : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(DerivativeOfContacts, Precisions);

TYPED_TEST(DerivativeOfContacts, HaveTheBitsOfOneByOne) {
  using Real = TypeParam;
  constexpr Offset kSets = 3;
  for (const Law law : kBothLaws)
    for (const bool normal_last : {false, true}) {
      const ContactBatch<Real> batch = many_kinds<Real>(law);
      ContactBatchView<Real> view = batch.view();
      view.normal_last = normal_last;
      const auto rows = static_cast<std::size_t>(view.row_count);
      // Reactions need not be an answer: each cone is in some mode, and pivots are exchanged often.
      std::vector<Real> lambda = random_numbers<Real>(rows, 7);
      const auto bar = random_numbers<Real>(kSets * rows, 8), w_bar = random_numbers<Real>(kSets * rows, 9);
      const DerivativeOptions options = with_any_residual();
      const std::vector<Real> none;
      for (const auto* by_lambda : {&bar, &none})
        for (const auto* by_w : {&w_bar, &none})
          expect_bits_of_one_by_one([&] { return vjp(view, lambda, *by_lambda, *by_w, options, nullptr, kSets); });
      const auto changed = random_numbers<Real>(static_cast<std::size_t>(kSets * view.nonzero_count), 10),
                 more = random_numbers<Real>(kSets * rows, 11);
      const Real *const A = changed.data(), *const one = bar.data(), *const two = w_bar.data(),
                        *const three = more.data();
      for (const BatchTangentView<Real>& along :
           {BatchTangentView<Real>{A, nullptr, one, two, three, two, one},
            BatchTangentView<Real>{nullptr, nullptr, nullptr, nullptr, one, two, three},
            BatchTangentView<Real>{A, nullptr, nullptr, nullptr, nullptr, nullptr, nullptr}})
        expect_bits_of_one_by_one([&] { return jvp(view, lambda, along, options, kSets); });
    }
}

/// Robots of one kind go into packs, all but the rest of a pack and unusual ones.
TYPED_TEST(DerivativeOfContacts, AreFoundInPacks) {
  using Real = TypeParam;
  ContactBatch<double> doubles(Law::coulomb);
  constexpr Offset kEnvs = 40;
  for (Offset e = 0; e < kEnvs; ++e) {
    Recipe recipe;
    recipe.seed = static_cast<std::uint64_t>(e) + 1;
    recipe.contacts = static_cast<int>(2 + e % 3);
    recipe.friction_rows = 3;
    recipe.order = ConeOrder::friction_last;
    doubles.add(random_contacts(recipe));
  }
  const ContactBatch<Real> batch = convert<Real>(doubles);
  const auto view = batch.view();
  const auto lambda = random_numbers<Real>(static_cast<std::size_t>(view.row_count), 7);
  std::vector<GradientStatus> status(static_cast<std::size_t>(kEnvs));
  std::vector<Real> change(lambda.size());
  const DerivativeOptions o;
  const DerivativeJob<Real> at{
      view, {lambda.data(), nullptr}, Law::coulomb, 1e30, o.tie_tolerance, o.max_unknowns, 1, status.data()};
  Offset stable = 0;
  for (const GradientStatus& one : vjp(view, lambda, lambda, {}, with_any_residual(), nullptr).status)
    stable += (one.flags & (kGradientRefused | kGradientUnstableBranch)) == 0;
  EXPECT_GT(stable, kEnvs / 2);
  const auto check = [&](const auto& job, const auto& packs, const char* isa) {
    std::vector<Offset> envs;
    for (Offset e = 0; e < kEnvs; ++e)
      if (packs.takes(job, e)) envs.push_back(e);
    EXPECT_EQ(static_cast<Offset>(envs.size()), kEnvs) << isa;
    std::vector<std::uint8_t> answered(static_cast<std::size_t>(kEnvs));
    cpu::Scratch scratch;
    packs.run(job, envs.data(), kEnvs, answered.data(), scratch);
    EXPECT_GE(std::count(answered.begin(), answered.end(), 1), stable - 2) << isa;
  };
  for (const char* isa : usable_isas()) {
    const ScopedIsa scoped(isa);
    const cpu::DerivativeKernels<Real> kernels = cpu::of_precision<Real>(cpu::best_isa().derivative());
    if (kernels.packs.vjp.width == 1) continue;
    VjpJob<Real> back{at, {lambda.data(), nullptr}, {}};
    check(back, kernels.packs.vjp, isa);
    JvpJob<Real> front{at, {}, {change.data(), nullptr}};
    front.tangents.b = lambda.data();
    check(front, kernels.packs.jvp, isa);
  }
}

}  // namespace
