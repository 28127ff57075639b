// The derivative of an environment has its bits wherever and beside whatever it is computed.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "core/algorithm/derivative/relaxed_derivative.hpp"
#include "core/machine/jacobian_machine.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/machines/scoped_isa.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/oracles/jacobian_derivatives.hpp"
#include "tests/support/systems/scene_batches.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr Offset kEnvs = 37;

/// Environments of many sizes, their reactions, and a loss's derivatives by them, environment by environment.
template <class Real>
struct Problem {
  ContactBatch<Real> batch;
  std::vector<std::vector<Real>> lambda, bar;

  explicit Problem(Law law) : batch(law) {
    ContactBatch<double> doubles(law);
    for (Offset e = 0; e < kEnvs; ++e) {
      Recipe recipe;
      recipe.seed = static_cast<std::uint64_t>(e) + 1;
      recipe.contacts = static_cast<int>(e % 7);
      recipe.others = static_cast<int>(e % 5);
      recipe.rank = e % 11 == 0 ? 0.5 : 1.5;  // some are singular but for R
      doubles.add(e % 13 == 0 ? Environment<double>{} : random_contacts(recipe));
    }
    batch = convert<Real>(doubles);
    const auto view = batch.view();
    const auto solution = solve(batch, options(SolverKind::npgs, 1e-5, 500));
    const auto bars = random_numbers<Real>(solution.lambda.size(), 3);
    for (Offset e = 0; e < kEnvs; ++e) {
      const auto first = view.env_row_offsets[e], last = view.env_row_offsets[e + 1];
      lambda.emplace_back(solution.lambda.begin() + first, solution.lambda.begin() + last);
      bar.emplace_back(bars.begin() + first, bars.begin() + last);
    }
  }
};

template <class T>
void append(std::string& bytes, const std::vector<T>& numbers, Offset first, Offset last) {
  bytes.append(reinterpret_cast<const char*>(numbers.data() + first),
               static_cast<std::size_t>(last - first) * sizeof(T));
}

/// Returns the results of vjp() and jvp() for the environments of `order`.
template <class Real>
std::vector<std::string> answers(const Problem<Real>& problem, const std::vector<Offset>& order, int threads = 1,
                                 double kappa = 0.0) {
  const ContactBatch<Real> batch = gather<Real>(problem.batch, order);
  const auto view = batch.view();
  std::vector<Real> lambda, bar;
  for (const Offset e : order) {
    const auto& own = problem.lambda[static_cast<std::size_t>(e)];
    lambda.insert(lambda.end(), own.begin(), own.end());
    const auto& one = problem.bar[static_cast<std::size_t>(e)];
    bar.insert(bar.end(), one.begin(), one.end());
  }
  DerivativeOptions o;
  o.threads = threads;
  o.kappa = kappa;
  const auto own = vjp(view, lambda, bar, bar, o);
  const auto forward =
      jvp(view, lambda,
          BatchTangentView<Real>{own.A.data(), nullptr, bar.data(), own.R.data(), own.mu.data(), nullptr, nullptr}, o);
  std::vector<std::string> result;
  for (Offset e = 0; e < view.env_count; ++e) {
    const Offset first = view.env_row_offsets[e], last = view.env_row_offsets[e + 1];
    std::string bytes;
    append(bytes, own.A, view.row_offsets[first], view.row_offsets[last]);
    for (const auto* part : {&own.b, &own.R, &own.mu, &own.lo, &own.hi}) append(bytes, *part, first, last);
    append(bytes, forward.lambda, first, last);
    append(bytes, forward.w, first, last);
    append(bytes, own.status, e, e + 1);
    append(bytes, forward.status, e, e + 1);
    result.push_back(bytes);
  }
  return result;
}

std::vector<Offset> in_order() {
  std::vector<Offset> order(static_cast<std::size_t>(kEnvs));
  std::iota(order.begin(), order.end(), Offset{0});
  return order;
}

template <class Real>
class DerivativeBits : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(DerivativeBits, Precisions);

TYPED_TEST(DerivativeBits, AreThoseOfAnyNumberOfThreads) {
  for (const Law law : kBothLaws) {
    const Problem<TypeParam> problem(law);
    for (const double kappa : {0.0, 1e-2}) {
      const auto expected = answers(problem, in_order(), 1, kappa);
      for (const int threads : {2, 7}) EXPECT_EQ(answers(problem, in_order(), threads, kappa), expected) << threads;
    }
  }
}

TYPED_TEST(DerivativeBits, AreThoseOfAnyOrderAndAnyNeighbours) {
  for (const Law law : kBothLaws) {
    const Problem<TypeParam> problem(law);
    const auto expected = answers(problem, in_order());
    std::vector<Offset> order = in_order();
    scenes::Rng rng(5);
    for (std::size_t k = order.size(); k > 1; --k)
      std::swap(order[k - 1], order[static_cast<std::size_t>(rng.below(static_cast<int>(k)))]);
    const auto permuted = answers(problem, order);
    for (std::size_t k = 0; k < order.size(); ++k)
      EXPECT_EQ(permuted[k], expected[static_cast<std::size_t>(order[k])]) << order[k];
    for (const Offset e : {3, 12, 36}) EXPECT_EQ(answers(problem, {e})[0], expected[static_cast<std::size_t>(e)]) << e;
  }
}

TYPED_TEST(DerivativeBits, AreThoseOfEveryInstructionSet) {
  for (const Law law : kBothLaws) {
    const Problem<TypeParam> problem(law);
    ASSERT_GE(usable_isas().size(), 1U);
    for (const double kappa : {0.0, 1e-2}) {
      const auto expected = answers(problem, in_order(), 1, kappa);
      for (const char* isa : usable_isas()) {
        const ScopedIsa scoped(isa);
        EXPECT_EQ(answers(problem, in_order(), 1, kappa), expected) << isa;
      }
    }
  }
}

/// Sweeps in reverse: answers, cotangents and records of all environments, as bytes.
template <class Real>
std::string unrolled_answers(const Problem<Real>& problem, int threads) {
  const auto view = problem.batch.view();
  std::vector<Real> start, bar;
  for (std::size_t e = 0; e < problem.bar.size(); ++e) {
    start.insert(start.end(), problem.lambda[e].begin(), problem.lambda[e].end());
    bar.insert(bar.end(), problem.bar[e].begin(), problem.bar[e].end());
  }
  for (Real& number : start) number = Real(0.5) * number;
  std::vector<Real> lambda(start.size()), by_start(start.size());
  Gradients<Real> own;
  own.A.resize(static_cast<std::size_t>(view.nonzero_count));
  own.b = own.R = own.mu = own.lo = own.hi = std::vector<Real>(start.size());
  own.status.resize(static_cast<std::size_t>(view.env_count));
  DerivativeOptions o;
  o.threads = threads;
  Derivative(Device::cpu(), o)
      .unrolled_vjp(view, SweepsView<Real>{start.data(), 5, 1.0, lambda.data(), by_start.data()},
                    SolutionCotangentView<Real>{bar.data(), bar.data()}, own.view(), own.status.data());
  std::string bytes;
  for (const auto* part : {&own.A, &own.b, &own.R, &own.mu, &own.lo, &own.hi, &lambda, &by_start})
    append(bytes, *part, 0, static_cast<Offset>(part->size()));
  append(bytes, own.status, 0, view.env_count);
  return bytes;
}

TYPED_TEST(DerivativeBits, OfSweepsAreThoseOfThreadsAndInstructionSets) {
  for (const Law law : kBothLaws) {
    const Problem<TypeParam> problem(law);
    const std::string expected = unrolled_answers(problem, 1);
    for (const int threads : {2, 7}) EXPECT_EQ(unrolled_answers(problem, threads), expected) << threads;
    for (const char* isa : usable_isas()) {
      const ScopedIsa scoped(isa);
      EXPECT_EQ(unrolled_answers(problem, 1), expected) << isa;
    }
  }
}

TYPED_TEST(DerivativeBits, OfOthersDoNotChangeBesideNumbersThatAreNone) {
  using Real = TypeParam;
  constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
  for (const Law law : kBothLaws) {
    const Problem<Real> sound(law);
    const auto expected = answers(sound, in_order());
    constexpr Offset kBad = 17;
    for (int what = 0; what < 5; ++what) {
      Problem<Real> problem = sound;
      auto arrays = sound.batch.arrays();
      const auto row = static_cast<std::size_t>(arrays.env_row_offsets[kBad]);
      if (what == 0) arrays.A[static_cast<std::size_t>(arrays.row_offsets[row])] = kNan;
      if (what == 1) arrays.b[row] = kNan;
      if (what == 2) arrays.R[row] = std::numeric_limits<Real>::infinity();
      if (what == 3) problem.lambda[kBad][0] = kNan;
      if (what == 4) problem.bar[kBad][0] = kNan;
      problem.batch = ContactBatch<Real>::from_arrays(law, arrays);
      const auto own = answers(problem, in_order());
      EXPECT_NE(own[kBad], expected[kBad]);
      for (Offset e = 0; e < kEnvs; ++e)
        if (e != kBad) {
          EXPECT_EQ(own[static_cast<std::size_t>(e)], expected[static_cast<std::size_t>(e)]) << what << ", " << e;
        }
    }
  }
}

/// The algorithm on one environment by teams whose lanes race, against the library.
TYPED_TEST(DerivativeBits, AreThoseOfTeamsOfEveryWidth) {
  using Real = TypeParam;
  for (const Law law : kBothLaws)
    for (const FactorUse use : {FactorUse::never, FactorUse::always}) {
      JacobianBatch<double> jacobian(law);
      jacobian.add(random_jacobian({3, 5, 4, 11, 0}));
      const ContactBatch<Real> batch = convert<Real>(assemble(jacobian.view(), use));
      const auto view = batch.view();
      const auto rows = static_cast<std::size_t>(batch.row_count());
      const auto solution = solve(batch, options(SolverKind::npgs, 1e-5, 2000));
      const auto bar = random_numbers<Real>(2 * rows, 1), w_bar = random_numbers<Real>(2 * rows, 2);
      const auto expected = vjp(view, solution.lambda, bar, w_bar, {}, nullptr, 2);
      DerivativeOptions with_kappa;
      with_kappa.kappa = 1e-2;
      const auto relaxed = vjp(view, solution.lambda, bar, w_bar, with_kappa, nullptr, 2);
      EXPECT_EQ(relaxed.status[0].flags & kGradientRefused, 0U);
      EXPECT_EQ(expected.status[0].flags, 0U);
      for (const Index width : {1, 2, 3, 8, 33}) {
        Gradients<Real> own = expected;
        for (auto* part : {&own.A, &own.factor, &own.b, &own.R, &own.mu, &own.lo, &own.hi})
          std::fill(part->begin(), part->end(), Real(77));
        const DerivativeOptions o;
        VjpJob<Real> job;
        static_cast<DerivativeJob<Real>&>(job) = {view,
                                                  {solution.lambda.data(), nullptr},
                                                  law,
                                                  o.residual_limit,
                                                  o.tie_tolerance,
                                                  o.max_unknowns,
                                                  2,
                                                  own.status.data()};
        job.cotangents = {bar.data(), w_bar.data()};
        job.gradients = own.view();
        std::vector<double> memory(static_cast<std::size_t>(derivative_elements(job, 0)), __builtin_nan(""));
        run_stressed<1>(width, [&](auto& team) { vjp_env(team, job, 0, memory.data()); });
        const auto compare = [&](const Gradients<Real>& wanted) {
          const auto one = wanted.all(), two = own.all();
          EXPECT_TRUE(same_bits(std::span<const Real>(one), std::span<const Real>(two))) << width;
          std::string record, wanted_record;
          append(record, own.status, 0, 1);
          append(wanted_record, wanted.status, 0, 1);
          EXPECT_EQ(record, wanted_record) << width;
        };
        compare(expected);
        // The relaxed problem.
        std::vector<Real> reactions(rows);
        const RelaxedJob<VjpJob<Real>, Real> smooth{job, 1e-2, reactions.data()};
        std::vector<double> room(static_cast<std::size_t>(relaxed_elements(job, 0)), __builtin_nan(""));
        run_stressed<1>(width, [&](auto& team) { relaxed_vjp_env(team, smooth, 0, room.data()); });
        compare(relaxed);
      }
    }
}

/// Numbers and records of a derivative, as bytes one after another.
template <class Derived>
std::string bytes_of(const Derived& own) {
  std::string all;
  const auto numbers = own.all();
  append(all, numbers, 0, static_cast<Offset>(numbers.size()));
  append(all, own.status, 0, static_cast<Offset>(own.status.size()));
  return all;
}

/// Three environments, in the precision asked for.
template <class Real>
JacobianBatch<Real> jacobians(MassForm form) {
  JacobianBatch<Real> batch(Law::coulomb, form, 3);
  for (std::uint64_t seed = 1; seed < 4; ++seed) batch.add(cast<Real>(random_jacobian({seed, 3, 2, 9, 3})));
  return batch;
}

TYPED_TEST(DerivativeBits, ByJAndMAreThoseOfThreadsInstructionSetsAndTeams) {
  using Real = TypeParam;
  for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
    const JacobianBatch<Real> batch = jacobians<Real>(form);
    const auto view = batch.view();
    const auto lambda = solve(batch, options(SolverKind::npgs, 1e-5, 2000)).contact.lambda;
    const auto bar = random_numbers<Real>(lambda.size(), 1), w_bar = random_numbers<Real>(lambda.size(), 2),
               v_bar = random_numbers<Real>(static_cast<std::size_t>(view.dof_count), 3);
    const ReactionView<Real> at{lambda.data(), nullptr};
    const JacobianSolutionCotangentView<Real> cotangents{bar.data(), w_bar.data(), v_bar.data()};
    const auto pulled = [&](int threads) {
      DerivativeOptions o;
      o.threads = threads;
      JacobianGradients<Real> own(view);
      Derivative(Device::cpu(), o).vjp(view, at, cotangents, own.view(), own.status.data());
      return own;
    };
    const JacobianGradients<Real> expected = pulled(1);
    const auto pushed = [&](int threads) {
      DerivativeOptions o;
      o.threads = threads;
      JacobianChanges<Real> own(view);
      Derivative(Device::cpu(), o).jvp(view, at, expected.tangents(), own.view(), own.status.data());
      return own;
    };
    const JacobianChanges<Real> forward = pushed(1);
    for (const GradientStatus& status : expected.status) EXPECT_EQ(status.flags, 0U);
    for (const GradientStatus& status : forward.status) EXPECT_EQ(status.flags, 0U);
    EXPECT_EQ(bytes_of(pulled(2)), bytes_of(expected));
    EXPECT_EQ(bytes_of(pushed(2)), bytes_of(forward));
    for (const char* isa : usable_isas()) {
      const ScopedIsa scoped(isa);
      EXPECT_EQ(bytes_of(pulled(1)), bytes_of(expected)) << isa;
      EXPECT_EQ(bytes_of(pushed(1)), bytes_of(forward)) << isa;
    }
    // The same by lanes that race.
    const DerivativeOptions o;
    const auto machine = make_cpu_jacobian_machine<Real>(FactorUse::by_size, 1);
    std::vector<Real> in(lambda.size()), out(lambda.size());
    const auto fill = [&](auto& job, GradientStatus* status) {
      static_cast<DerivativeJob<Real>&>(job.contact) = {
          {}, at, view.law, o.residual_limit, o.tie_tolerance, o.max_unknowns, 1, status};
      job.connect(machine->lay_out(view, StreamRef::default_stream()), in.data(), out.data());
    };
    const auto room = [](const auto& job, Offset env) {
      return std::vector<double>(static_cast<std::size_t>(jacobian_derivative_elements<RowTile<Real>>(job, env)),
                                 __builtin_nan(""));
    };
    for (const Index width : {1, 2, 5}) {
      JacobianGradients<Real> own(view);
      JacobianVjpJob<Real> back{};
      back.cotangents = cotangents;
      back.gradients = own.view();
      back.contact.cotangents.w = cotangents.w;
      back.contact.gradients = {nullptr, nullptr, nullptr, own.R.data(), own.mu.data(), own.lo.data(), own.hi.data()};
      fill(back, own.status.data());
      JacobianChanges<Real> changes(view);
      JacobianJvpJob<Real> front{};
      front.tangents = expected.tangents();
      front.changes = changes.view();
      front.contact.tangents = {
          nullptr, nullptr, nullptr, expected.R.data(), expected.mu.data(), expected.lo.data(), expected.hi.data()};
      front.contact.changes.w = changes.w.data();
      fill(front, changes.status.data());
      for (Offset env = 0; env < view.env_count; ++env) {
        auto memory = room(back, env);
        run_stressed<1>(width, [&](auto& team) { jacobian_vjp_env<RowTile<Real>>(team, back, env, memory.data()); });
        memory = room(front, env);
        run_stressed<1>(width, [&](auto& team) { jacobian_jvp_env<RowTile<Real>>(team, front, env, memory.data()); });
      }
      EXPECT_EQ(bytes_of(own), bytes_of(expected)) << width;
      EXPECT_EQ(bytes_of(changes), bytes_of(forward)) << width;
    }
  }
}

}  // namespace
