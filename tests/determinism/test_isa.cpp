#include <gtest/gtest.h>

#include <algorithm>
#include <new>
#include <string>

#include "core/base/fp_env.hpp"
#include "core/schedule/plan.hpp"
#include "cpu_fallback/isa.hpp"
#include "tests/support/plan_views.hpp"
#include "tests/support/scene_batches.hpp"
#include "tests/support/scoped_isa.hpp"
#include "tests/support/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

template <class Real>
const cpu::Kernels<Real>& pick(const cpu::KernelSet& set, Law law) {
  if constexpr (std::is_same_v<Real, float>) {
    return set.f32[static_cast<std::size_t>(law)];
  } else {
    return set.f64[static_cast<std::size_t>(law)];
  }
}

/// A batch solved past the partition: every environment alone through the scalar, or all dense ones through one pack.
template <class Real>
class Direct {
 public:
  Direct(const ContactBatch<Real>& batch, const SolverOptions& o)
      : batch_(batch), plan_(make_plan(batch.view())), kernels_(pick<Real>(cpu::best_isa().kernels(o.solver), *o.law)) {
    const auto rows = static_cast<std::size_t>(batch.row_count());
    solution_.lambda.resize(rows);
    solution_.w.resize(rows);
    solution_.status.resize(static_cast<std::size_t>(batch.env_count()));
    job_.batch = batch.view();
    job_.plan = view_of(plan_);
    job_.warm_start = nullptr;
    job_.lambda = solution_.lambda.data();
    job_.w = solution_.w.data();
    job_.status = solution_.status.data();
    job_.tolerance = o.tolerance;
    job_.max_iterations = o.max_iterations;
    job_.stall_window = o.stall_window;
    job_.omega = static_cast<Real>(o.omega);
    job_.law = *o.law;
  }

  std::vector<std::uint64_t> one_by_one() {
    const ScopedFpEnv fp_env;
    for (Offset e = 0; e < batch_.env_count(); ++e) solve_alone(e);
    return env_hashes(batch_, solution_);
  }

  /// All dense environments in one run, whatever their shapes: far more padding than the partition would allow.
  std::vector<std::uint64_t> all_in_one_pack() {
    const ScopedFpEnv fp_env;
    ConeCounts slots;
    std::vector<Offset> dense;
    for (Offset e = 0; e < batch_.env_count(); ++e) {
      if (plan_.path[static_cast<std::size_t>(e)] != EnvPath::dense || !has_packs()) {
        solve_alone(e);
        continue;
      }
      dense.push_back(e);
      const ConeCounts& own = plan_.counts[static_cast<std::size_t>(e)];
      slots.free = std::max(slots.free, own.free);
      slots.unilateral = std::max(slots.unilateral, own.unilateral);
      slots.box = std::max(slots.box, own.box);
      for (Index m = 2; m <= kMaxConeRows; ++m) slots.friction[m] = std::max(slots.friction[m], own.friction[m]);
    }
    if (!dense.empty()) {
      Scratch memory(kernels_.pack_elements(slots));
      kernels_.solve_pack(job_, dense.data(), static_cast<Offset>(dense.size()), slots, memory.data);
    }
    return env_hashes(batch_, solution_);
  }

  [[nodiscard]] bool has_packs() const { return kernels_.pack_width > 1; }

 private:
  struct Scratch {
    explicit Scratch(Offset elements)
        : data(static_cast<Real*>(::operator new(static_cast<std::size_t>(elements + 1) * sizeof(Real), kAlignment))) {}
    ~Scratch() { ::operator delete(data, kAlignment); }
    Scratch(const Scratch&) = delete;
    Scratch& operator=(const Scratch&) = delete;
    static constexpr std::align_val_t kAlignment{64};
    Real* data;
  };

  void solve_alone(Offset env) {
    Scratch memory(kernels_.one_elements(job_, env));
    kernels_.solve_one(job_, env, memory.data);
  }

  const ContactBatch<Real>& batch_;
  PlanData plan_;
  cpu::Kernels<Real> kernels_;
  Solution<Real> solution_;
  cpu::Job<Real> job_{};
};

template <class Real>
class Isa : public testing::Test {};
using Precisions = testing::Types<float, double>;
TYPED_TEST_SUITE(Isa, Precisions);

TYPED_TEST(Isa, EveryBuildPackedOrScalarGivesEveryEnvironmentTheSameBits) {
  const auto isas = usable_isas();
  const auto has_packs = [](const char* name) {
    const ScopedIsa isa(name);
    return pick<TypeParam>(cpu::best_isa().kernels(SolverKind::npgs), Law::convex).pack_width > 1;
  };
  EXPECT_TRUE(isas.size() == 1 || std::any_of(isas.begin(), isas.end(), has_packs)) << "no build packs environments";
  if (isas.size() == 1) GTEST_SKIP() << "this CPU runs the baseline build only: there is nothing to compare it with";
  const ContactBatch<TypeParam> batch = convert<TypeParam>(ragged_batch(2, 5));
  for (const SolverKind solver : kAllSolvers)
    for (const Law law : kBothLaws) {
      SolverOptions o = options(solver, 1e-3, 22);
      o.law = law;
      std::vector<std::uint64_t> expected;
      for (const char* name : isas) {
        SCOPED_TRACE(label(solver, law) + ", " + name);
        const ScopedIsa isa(name);
        Direct<TypeParam> direct(batch, o);
        const auto scalar = direct.one_by_one();
        if (expected.empty()) expected = scalar;
        EXPECT_EQ(scalar, expected) << "scalar";
        EXPECT_EQ(direct.all_in_one_pack(), expected) << "one pack";
        EXPECT_EQ(solve_hashes(batch, o), expected) << "as solve() deals them out";
      }
    }
}

TYPED_TEST(Isa, ABatchOfOneIsSolvedLikeTheSameEnvironmentInAPack) {
  const auto envs = scene_batch("walker", 24, 6);
  const ContactBatch<TypeParam> batch = convert<TypeParam>(envs);
  for (const char* name : usable_isas()) {
    SCOPED_TRACE(name);
    const ScopedIsa isa(name);
    const SolverOptions o = options(SolverKind::npgs, 1e-4, 50);
    const auto together = solve_hashes(batch, o);
    for (Offset e = 0; e < batch.env_count(); ++e) {
      const Offset order[] = {e};
      EXPECT_EQ(solve_hashes(gather<TypeParam>(batch, order), o).at(0), together[static_cast<std::size_t>(e)]) << e;
    }
  }
}

TEST(IsaChoice, AnUnknownNameFallsBackToTheWidestBuild) {
  std::string widest = usable_isas().back();
  const ScopedIsa isa("mmx");
  EXPECT_EQ(cpu::best_isa().name, widest);
}

}  // namespace
